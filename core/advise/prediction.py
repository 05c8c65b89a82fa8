"""What a fitted explanation predicts for data that were not taken yet, and how surely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.change.tabulated import place_change
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.reading import Reading
from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.alteration import Alteration, alter_model
from femubench.core.fem.model import Model
from femubench.core.fit.modal_basis import place_parts
from femubench.core.fit.modal_fit import Fit, Problem, State, signed_hz, state_at
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.settings import settings
from femubench.core.modal.antiresonances import Antiresonances, zeros_by_force
from femubench.core.modal.eigen import Modes, once_for
from femubench.core.modal.receptances import PredictedResponses
from femubench.core.typing import FloatArray, IntArray, SparseArray


@dataclass(frozen=True)
class Predicted:
    """Values that an explanation predicts.

    Arguments:
        values: (k,).
        spread: their change with each independent standard deviation of the fit, (k, p).
    """

    values: FloatArray
    spread: FloatArray

    def take(self, index: IntArray | list[int]) -> Predicted:
        """Return some of the values."""
        return Predicted(self.values[index], self.spread[index])


def distance(first: Predicted, second: Predicted, std: FloatArray) -> float:
    """Return the squared distance of two predictions in standard deviations of what is measured.

    Arguments:
        first, second: of k values.
        std: standard deviations of the measurement, (k,).

    Source: Box & Hill (1967), Technometrics 9, 57-71: the term of the two means.
    """
    gap = first.values - second.values
    spread = np.hstack([first.spread, second.spread])
    covariance = np.diag(np.square(std)) + spread @ spread.T
    return float(gap @ la.solve(covariance, gap, assume_a="pos"))


@dataclass(frozen=True)
class Points:
    """Points of a structure and the directions in which they can move.

    Arguments:
        labels: words of `point_places`.
        directions: of each.
    """

    labels: tuple[str, ...]
    directions: tuple[tuple[str, ...], ...]

    @property
    def sensors(self) -> list[str]:
        """Return the words for every point and direction."""
        pairs = zip(self.labels, self.directions, strict=True)
        return [f"{label}, {name}" for label, names in pairs for name in names]

    @property
    def counts(self) -> list[int]:
        """Return the number of directions of every point."""
        return [len(names) for names in self.directions]

    def rows(self, model: Model) -> SparseArray:
        """Return the translations from the dofs of a model, sparse (n_sensors, n)."""
        pairs = zip(self.labels, self.directions, strict=True)
        places = ModelPlaces(model)
        rows = [places.translations(places.point(label), d) for label, d in pairs]
        return sp.csr_array(sp.vstack(rows)) if rows else sp.csr_array((0, model.size))


@dataclass(frozen=True)
class Outlook:
    """One explanation at its best fit.

    Arguments:
        state: in modal coordinates of the model that it extends.
        root: lower Cholesky factor of the covariance of its coordinates, (p, p).
        readings: translations of points from the modal coordinates, (s, N).
    """

    state: State
    root: FloatArray
    readings: FloatArray

    @property
    def causes(self) -> tuple[tuple[Hypothesis, slice], ...]:
        """Return the causes with their places among the coordinates."""
        parts = place_parts(len(self.state.problem.space), self.state.parts)
        return tuple((part.hypothesis, own) for part, _, own in parts)

    @property
    def zero(self) -> float:
        """Return the frequency in Hz up to which a mode counts as one of zero frequency."""
        return self.state.problem.space.zero

    @cached_property
    def seen(self) -> FloatArray:
        """Return the translations of the points from the modes, (s, N)."""
        return np.asarray(self.readings @ self.state.vectors[: self.readings.shape[1]])

    @cached_property
    def sensed(self) -> FloatArray:
        """Return the readings of the sensors of the test from the modes, (n_sensors, N)."""
        vectors = self.state.vectors
        return np.asarray(self.state.problem.space.pad_readings(len(vectors)) @ vectors)

    @cached_property
    def _slopes(self) -> list[tuple[FloatArray, FloatArray, float]]:
        return self.state.problem.space.slopes(self.state.parts, self.state.x)

    @cached_property
    def stiffness_spread(self) -> FloatArray:
        """Return the change of stiffness with each deviation between all modes, (p, N, N)."""
        return self._turned([stiffness for stiffness, *_ in self._slopes])

    @cached_property
    def mass_spread(self) -> FloatArray:
        """Return the change of mass with each deviation between all modes, (p, N, N)."""
        return self._turned([mass for _, mass, _ in self._slopes])

    def _turned(self, matrices: Sequence[FloatArray]) -> FloatArray:
        vectors = self.state.vectors
        if not matrices:
            return np.zeros((0, *vectors.shape))
        modal = vectors.T @ np.array(matrices) @ vectors
        return np.asarray(np.tensordot(self.root.T, modal, axes=1))

    def hertz(self, values: FloatArray, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return frequencies in Hz and their spread.

        Arguments:
            values: eigenvalues of the structure or of one derived from it, (..., q).
            vectors: in its modes, of unit modal mass there, (..., N, q).

        Returns:
            frequencies (..., q) and spread (..., q, p).
        """
        spread = np.zeros((*values.shape, len(self.stiffness_spread)))
        pairs = zip(self.stiffness_spread, self.mass_spread, strict=True)
        for i, (stiff, heavy) in enumerate(pairs):
            force = stiff @ vectors - (heavy @ vectors) * values[..., None, :]
            spread[..., i] = (vectors * force).sum(axis=-2)
        frequencies = signed_hz(values)
        scale = 8.0 * np.pi**2 * np.maximum(np.abs(frequencies), 1e-9)
        return frequencies, spread / scale[..., None]

    def zeros(self, highest: float) -> Iterator[tuple[Antiresonances, FloatArray]]:
        """Yield the antiresonances of all sensors under a force at each, and their spread, (k, p).

        Arguments:
            highest: frequency in Hz up to which they are sought; from half the lowest measured one.
        """
        values, sensed = self.state.eigenvalues, self.sensed
        own = np.sqrt(np.abs(values[self.state.partner])) / (2.0 * np.pi)
        at = sp.eye_array(len(sensed), format="csr")
        modes = Modes(values, sensed, signed_hz(values) <= self.zero)
        lines = np.array([0.5 * own.min(), highest])
        undamped, heavy = np.zeros(len(values)), self.mass_spread.any()
        answer = PredictedResponses(modes, self.state.partner, (at, at, lines), undamped)
        for force, found in zip(sensed, zeros_by_force(answer), strict=True):
            found = found.take((found.frequencies >= lines[0]) & (found.frequencies <= highest))
            square = np.square(2.0 * np.pi * found.frequencies)
            compliance = 1.0 / (values - square[:, None])
            left, right = compliance * sensed[found.response], compliance * force
            pull = self.stiffness_spread @ right.T
            pull -= (self.mass_spread @ right.T) * square if heavy else 0.0
            steep = 2.0 * square * (left * right).sum(axis=1) / found.frequencies
            yield found, np.einsum("kN,pNk->kp", left, pull) / steep[:, None]

    def mass(self) -> Predicted:
        """Return the mass of the structure in kg."""
        slope = np.array([[weight for *_, weight in self._slopes]])
        return Predicted(np.array([self.state.mass]), slope @ self.root)

    def frequencies(self, modes: IntArray) -> Predicted:
        """Return natural frequencies in Hz."""
        vectors = np.eye(len(self.state.eigenvalues))[:, modes]
        return Predicted(*self.hertz(self.state.eigenvalues[modes], vectors))

    def further(self, count: int) -> IntArray:
        """Return the elastic modes next above those that were measured, (count,) or fewer."""
        start = int(self.state.partner.max()) + 1
        return np.arange(start, min(start + count, len(self.state.eigenvalues)))

    def shapes(self) -> tuple[FloatArray, FloatArray]:
        """Return the measured modes at the points and their spread, (s, m) and (s, m, p)."""
        values, partner = self.state.eigenvalues, self.state.partner
        gap = values[partner] - values[:, None]
        least = settings.close_modes * np.abs(values[partner])
        gap = np.where(np.abs(gap) < least, np.copysign(least, gap), gap)
        gap[partner, np.arange(len(partner))] = np.inf
        force = self.stiffness_spread[:, :, partner]
        force = force - self.mass_spread[:, :, partner] * values[partner]
        return self.seen[:, partner], np.moveaxis(self.seen @ (force / gap), 0, 2)

    def flexibility(self) -> Predicted:
        """Return the deflections at the points under unit loads there, in m/N, (s,)."""
        bent = self.seen / self.state.eigenvalues
        softer = -np.einsum("sn,pnm,sm->sp", bent, self.stiffness_spread, bent)
        return Predicted((bent * self.seen).sum(axis=1), softer)

    def departure(self, reading: Reading) -> Predicted:
        """Return by how much what an instrument reads departs from neutral, 0 without a cause."""
        value, slope = 0.0, np.zeros(len(self.state.x))
        for hypothesis, columns in self.causes:
            for i, parameter in enumerate(hypothesis.parameters, start=columns.start):
                own = getattr(hypothesis.effect, "reading", None) == reading
                if own and parameter.name == reading.parameter:
                    ends = self.state.x[i] + settings.slope_step * np.array([-1.0, 1.0])
                    low, high = parameter.value(ends)
                    value += float(parameter.value(self.state.x[i])) - parameter.neutral
                    slope[i] = (high - low) / (2.0 * settings.slope_step)
        return Predicted(np.array([value]), slope[None] @ self.root)

    def altered(self, change: Alteration) -> Predicted | None:
        """Return as many frequencies in Hz as are used, of the structure held otherwise.

        A cause of a support goes with it. None where a cause cannot be there, or nothing holds.
        """
        problem, columns, kept = self.state.problem, list[int](), list[Hypothesis]()
        gone = tuple(f"support:{part.at}:" for part in change.removed if hasattr(part, "at"))
        try:
            model = once_for(problem.model, change, lambda: alter_model(problem.model, change))
            for one, own in self.causes:
                if not f"{one.place}:".startswith(gone):
                    there = place_change(one.effect, model, one.place, one.parameters)
                    kept.append(replace(one, change=there))
                    columns += range(own.start, own.stop)
            posed = place_data(model, problem.data, problem.noise, kept)
            state = state_at(posed, posed.space.projections, self.state.x[columns])
        except (ModelError, NotApplicable):
            return None
        frame = model.structure and model.structure.frame
        grounds = {name for name, kind in model.group_kinds.items() if kind == "support"}
        left = frame.supports or frame.springs if frame else grounds - {*change.groups}
        if posed.space.rigid and left and not change.supports:
            return None
        moving = np.flatnonzero(~posed.space.still(state.eigenvalues))[: len(self.state.partner)]
        return replace(self, state=state, root=self.root[columns]).frequencies(moving)

    def without(self, columns: slice) -> State:
        """Return the explanation with some coordinates of the causes at zero."""
        x = self.state.x.copy()
        x[columns] = 0.0
        return state_at(self.state.problem, self.state.parts, x, every=True)


def outlook_of(problem: Problem, found: Fit, points: Points) -> Outlook:
    """Return the outlook of a fit.

    Arguments:
        problem: the model that the fit extends, and the data.
        found: an explanation.
        points: of this or any like model.
    """
    # In coordinates of our own: those of the problem are not kept as motions of the dofs.
    hypotheses = [part.hypothesis for part in found.parts]
    space = place_data(problem.model, problem.data, problem.noise, hypotheses).space
    state = state_at(replace(problem, space=space), space.projections, found.state.x, every=True)
    root = la.cholesky(found.covariance, lower=True) if hypotheses else np.zeros((0, 0))
    shapes = modes_for(problem.model).shapes
    return Outlook(state, np.asarray(root), points.rows(problem.model) @ shapes)
