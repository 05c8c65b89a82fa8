"""Find out what the model lacks, put it in, and only then meet the measured frequencies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from femubench import (
    FemubenchError,
    InputError,
    Measurement,
    Model,
    NotApplicable,
    ParameterEstimate,
    Strategy,
    StrategyFailure,
    UpdateResult,
    solve_modes,
)
from femubench.diagnosis import (
    Examination,
    Explanation,
    causes_in,
    examine,
    extend_by,
    list_effects,
)
from femubench.effect import textbook_values
from femubench.modal import rigid_modes_of
from femubench.update import Uncertainty, with_measured_frequencies

# Of the first elastic eigenvalue of the nominal model, as the harness counts them.
_NEGATIVE = 1e-6


@dataclass(frozen=True)
class Diagnosed(Strategy):
    """Extend the model by the most probable cause of its error, then correct what is left.

    The used modes are examined as `bench diagnose` does it: every registered effect at every
    place is weighed against all others and against nothing. The best explanation goes into the
    model as properties of the frame. Then the used frequencies are met by the smallest change of
    the stiffness, which leaves all shapes and all other frequencies where the causes put them.

    An explanation is passed over where its model would be none: a spring to ground on a free
    structure, a negative eigenvalue. Where no frequency has a standard deviation nothing can be
    weighed, and the nominal model is left to meet the frequencies.

    Arguments:
        tolerance: standard deviation of the relative scatter of every element.
        meet_frequencies: whether the used frequencies are met at the end.
        without: effects that are not examined, joined by ``+``.
        textbook: whether effects are examined for which handbooks give a value without any fit.

    Source: docs/diagnosis.md for the causes; Baruch & Bar-Itzhack (1978) for the last step.
    """

    name: ClassVar[str] = "diagnosed"
    citation: ClassVar[str] = (
        "Kass, R. E. & Raftery, A. E. (1995). Bayes factors. JASA 90, 773-795, over physical "
        "causes; then Baruch & Bar-Itzhack (1978) with the shapes of the extended model"
    )
    needs: ClassVar[frozenset[str]] = frozenset()

    tolerance: float = 0.005
    meet_frequencies: bool = True
    without: str = ""
    textbook: bool = True

    settings: ClassVar[tuple[str, ...]] = ("meet_frequencies=false", "tolerance=0.01")
    writable: ClassVar[str] = "meet_frequencies=false"

    def __post_init__(self) -> None:
        known = {effect.name for effect in list_effects()} if self.without else set()
        for name in filter(None, self.without.split("+")):
            if name not in known:
                raise InputError(
                    f"without: there is no effect {name!r}",
                    expected="names that `bench plugins list` shows, joined by +",
                )

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the extended model, its causes as parameters.

        Raises:
            NotApplicable: when there is no used mode.
            SelfCheckFailed: when the used frequencies are not met to 1e-8.
        """
        if len(measurement) == 0:
            raise NotApplicable("there is no used mode")
        result = self._extended(model, measurement)
        if not self.meet_frequencies:
            return result
        model = with_measured_frequencies(result.model, measurement)
        change = model.stiffness_change
        diagnostics = {**result.diagnostics, "rank": 0.0 if change is None else len(change.core)}
        uncertainty = result.uncertainty
        if uncertainty is not None:
            # What the used modes said last holds for every size of the causes.
            samples = tuple(replace(s, stiffness_change=change) for s in uncertainty.samples)
            uncertainty = replace(uncertainty, samples=samples)
        return replace(result, model=model, diagnostics=diagnostics, uncertainty=uncertainty)

    def _extended(self, model: Model, measurement: Measurement) -> UpdateResult:
        """Return the model with the causes in it, or as it was where nothing can be weighed."""
        std = measurement.frequency_std
        pairs = zip(measurement.numbers, std, strict=True)
        known = [number for number, s in pairs if np.isfinite(s) and s > 0.0]
        if not known:
            return UpdateResult(model, diagnostics={"examined": 0.0})
        effects = [
            effect
            for effect in list_effects()
            if effect.name not in self.without.split("+")
            and (self.textbook or not textbook_values(effect, model))
        ]
        examination = examine(model, measurement.select(known), effects, tolerance=self.tolerance)
        found = _first_that_stands(model, examination)
        if found is None:
            return UpdateResult(model, diagnostics=_figures(examination, None))
        explanation, extended = found
        return UpdateResult(
            extended,
            parameter_count=len(explanation.fit.state.x),
            parameters=_estimates(explanation),
            diagnostics=_figures(examination, explanation),
            uncertainty=_uncertainty(model, examination, explanation, extended),
        )


def _first_that_stands(model: Model, examination: Examination) -> tuple[Explanation, Model] | None:
    """Return the most probable explanation whose model is as free as the nominal one."""
    free, space = rigid_modes_of(model).shape[1], examination.problem.space
    least = -_NEGATIVE * float(space.eigenvalues[space.rigid :][:1].sum())
    for name in examination.posterior.names:
        explanation = examination.posterior.best(name)
        try:
            extended = extend_by(model, explanation)
            lowest = float(solve_modes(extended).eigenvalues[0])
        except FemubenchError:
            continue
        if rigid_modes_of(extended).shape[1] >= free and lowest >= least:
            return explanation, extended
    return None


def _estimates(explanation: Explanation) -> tuple[ParameterEstimate, ...]:
    """Return every number that the explanation puts into the model."""
    parts = (*explanation.base.parts, *explanation.parts)
    neutral = {
        (part.hypothesis.effect.name, part.hypothesis.place, parameter.name): parameter.neutral
        for part in reversed(parts)
        for parameter in part.hypothesis.parameters
    }
    causes = causes_in(explanation, 1.0, frozenset(explanation.base.names))
    return tuple(
        ParameterEstimate(
            f"{cause.effect} {cause.place}: {item.name}",
            before=float(neutral[cause.effect, cause.place, item.name]),
            after=item.value,
            unit=item.unit,
            std=item.std,
            places=(cause.place,),
        )
        for cause in causes
        for item in cause.parameters
    )


def _uncertainty(
    model: Model, examination: Examination, explanation: Explanation, extended: Model
) -> Uncertainty | None:
    """Return models with the causes in other sizes, and what the elements' scatter does.

    None where rounding made the covariance none.
    """
    fit = explanation.fit
    try:
        found = Uncertainty.draw(
            partial(extend_by, model, explanation),
            fit.state.x,
            0.5 * (fit.covariance + fit.covariance.T),
            discrepancy_std=examination.scatter,
        )
    except StrategyFailure:
        return None
    # A cause of another size may have other degrees of freedom.
    alike = tuple(s for s in found.samples if s.dofs.direction == extended.dofs.direction)
    return replace(found, samples=alike)


def _figures(examination: Examination, explanation: Explanation | None) -> dict[str, float]:
    """Return how sure the diagnosis is, and what it leaves."""
    posterior = examination.posterior
    probability = posterior.names[posterior.key(explanation)] if explanation else 0.0
    return {
        "examined": 1.0,
        "probability": probability,
        "nothing_missing": posterior.names.get((), 0.0),
        "chi2_before": examination.nominal.chi2,
        "chi2_after": explanation.chi2 if explanation else examination.nominal.chi2,
        "adequacy": examination.adequacy,
    }
