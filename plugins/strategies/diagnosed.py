"""Put what the drawing lacks into the model, and only then meet the measured frequencies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from femubench import Measurement, Model, NotApplicable, ParameterEstimate, Strategy, UpdateResult
from femubench.diagnosis import Budget, budget_of_modes, list_effects
from femubench.update import Uncertainty, with_measured_frequencies


@dataclass(frozen=True)
class Diagnosed(Strategy):
    """Extend the model by the budget of its errors, then correct what is left.

    What handbooks say comes first, then all that drawings of real structures lack, fitted at once
    to the used modes as `bench diagnose` does it: stiffness of joint zones, masses, springs, E, GJ,
    density. Then the used frequencies are met by the smallest change of the stiffness, which
    leaves all shapes and all other frequencies where the budget puts them.

    The uncertainty is that of all these explanations: models drawn from what data and drawing
    leave open, each of which meets the frequencies, and `tolerance` of a frequency on top.

    Where no frequency has a standard deviation, and for matrices without groups, there is no
    budget, and the nominal model is left to meet the frequencies.

    Arguments:
        tolerance: relative standard deviation of a frequency by what no budget has.
        meet_frequencies: whether the used frequencies are met at the end.

    Source: Tarantola (2005), section 3.2, for the budget; Baruch & Bar-Itzhack (1978) for the
    last step.
    """

    name: ClassVar[str] = "diagnosed"
    citation: ClassVar[str] = (
        "Tarantola, A. (2005). Inverse Problem Theory, section 3.2, over all that a drawing "
        "lacks; then Baruch & Bar-Itzhack (1978) with the shapes of the extended model"
    )
    needs: ClassVar[frozenset[str]] = frozenset()

    tolerance: float = 0.005
    meet_frequencies: bool = True

    settings: ClassVar[tuple[str, ...]] = ("meet_frequencies=false", "tolerance=0.01")
    writable: ClassVar[str] = "meet_frequencies=false"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the extended model, what was put in as parameters.

        Raises:
            NotApplicable: when there is no used mode.
            SelfCheckFailed: when the used frequencies are not met to 1e-8.
        """
        if len(measurement) == 0:
            raise NotApplicable("there is no used mode")

        def meet(extended: Model) -> Model:
            met = self.meet_frequencies
            return with_measured_frequencies(extended, measurement) if met else extended

        std = measurement.frequency_std
        pairs = zip(measurement.numbers, std, strict=True)
        known = [number for number, s in pairs if np.isfinite(s) and s > 0.0]
        every = measurement.select(known)
        budget = budget_of_modes(model, every, known, list_effects()) if known else None
        if budget is None:
            count = len(measurement) if self.meet_frequencies else 0
            return UpdateResult(meet(model), parameter_count=count, diagnostics={"examined": 0.0})
        updated = meet(budget.extended)
        found = Uncertainty.draw(
            lambda x: meet(budget.model_at(x)),
            budget.state.x,
            budget.loose,
            discrepancy_std=self.tolerance,
        )
        # A factor of exactly 1 needs no element of its own.
        alike = tuple(s for s in found.samples if s.dofs.direction == updated.dofs.direction)
        return UpdateResult(
            updated,
            parameter_count=len(budget.state.x),
            parameters=tuple(_estimates(budget)),
            diagnostics=_figures(budget),
            uncertainty=replace(found, samples=alike),
        )


def _estimates(budget: Budget) -> Iterator[ParameterEstimate]:
    """Yield every number that was fitted: a relative change, or kg."""
    x, loose, done = budget.state.x, budget.loose, 0
    for entry in budget.entries:
        own = slice(done, done := done + len(entry.names))
        values = entry.values(x[None, own])[0]
        stds = np.sqrt(np.diag(entry.root @ loose[own, own] @ entry.root.T))
        if entry.quantities:  # of ln(factor)
            stds = stds * (1.0 + values)
        for name, value, std in zip(entry.names, values.tolist(), stds.tolist(), strict=True):
            yield ParameterEstimate(
                f"{entry.kind} {entry.place}: {name}",
                before=0.0,
                after=value,
                unit="kg" if entry.kind == "joint mass" else "",
                std=std,
                places=entry.at,
            )


def _figures(budget: Budget) -> dict[str, float]:
    """Return how far off the drawing is, and what the budget leaves, as rms of the used modes."""
    rows = np.array([[mode.error_percent, mode.left_percent] for mode in budget.modes])
    before, after = np.sqrt(np.mean(np.square(rows), axis=0)).tolist()
    return {"examined": 1.0, "error_percent": before, "left_percent": after}
