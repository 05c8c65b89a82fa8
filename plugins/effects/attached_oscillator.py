"""Something that hangs on the structure and swings by itself: a panel, a cable, an instrument."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from femubench import Model
from femubench.effect import (
    Change,
    FrameEffect,
    ModelPlaces,
    Parameter,
    Places,
    RowOperator,
    Site,
    Size,
    Term,
    elastic_band,
)
from femubench.fem import FloatArray, Frame, Oscillator, SparseArray

_SHARE = 0.005  # of the structure's mass
# A part that is tuned to a mode splits its peak by the root of the mass ratio (Den Hartog 1956,
# 3.2), and the two merge where that is less than the sum of the damping ratios. Structures of
# metal have some 1 %, panels, cables and instruments on their mounts 2 %: what is lighter than
# 0.03^2, a thousandth, damps a mode and is never read as a frequency.
_LEAST = 0.001  # of the structure's mass


class AttachedOscillator(FrameEffect):
    """Let a mass ride on a place and swing on a spring in one direction, which adds a mode.

    Across its direction the mass goes along with its place; ``:free``, it is not felt there.
    Without mass it is not there, whatever its frequency.
    """

    name: ClassVar[str] = "attached-oscillator"
    summary: ClassVar[str] = "something attached resonates by itself"
    sizes: ClassVar[Sequence[Size]] = (
        Size(0.005, 0.05, Site.mass),
        Size(0.6, 1.0, Site.first_frequency, upper_unit=Site.eighth_frequency),
    )

    def places(self, model: Model) -> Sequence[str]:
        """Return joints and middles of members, or nodes, in each direction that they move in."""
        if model.structure is None:
            return ModelPlaces(model).directed(ModelPlaces(model).points(few=True))
        frame = model.structure.frame
        # The mesh node nearest to the middle of a member.
        middle = {m.name: m.elements // 2 / m.elements or 0.5 for m in frame.members}
        middles = [f"{name}@{station:g}" for name, station in middle.items()]
        return ModelPlaces(model).directed([*frame.joint_index, *middles])

    def finer(self, model: Model, place: str) -> Sequence[str]:
        """Return the place with a mass that hangs free, where it can be felt across at all."""
        if place.endswith(Places.FREE):
            return ()
        at, direction = ModelPlaces(model).directed_point(place)
        across = set(ModelPlaces(model).free(at)) - {direction}
        return (f"{place}{Places.FREE}",) if across else ()

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return its mass, and its frequency around the middle of the lowest elastic ones."""
        scale, least = (share * model.total_mass for share in (_SHARE, _LEAST))
        centre = float(np.exp(np.log(elastic_band(model)).mean()))
        return (
            Parameter("mass", "kg", scale, scaling="exponential", one_sided=True, least=least),
            Parameter("frequency", "Hz", 0.5 * centre, centre, 0.05 * centre, 5.0 * centre),
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the oscillator."""
        if not values[0]:
            return frame
        at = Places(frame).directed_point(place)
        oscillator = Oscillator(
            *at, values[0], values[1], crosswise=not place.endswith(Places.FREE)
        )
        return replace(frame, oscillators=(*frame.oscillators, oscillator))

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with a node of its own that the oscillator swings on."""
        if not values[0]:
            return model
        grown = ModelPlaces(model).add_node(*ModelPlaces(model).directed_point(place))
        return self.change(model, place).add_to(grown, values)

    def change(self, model: Model, place: str) -> Change:
        """Return 1 kg on a dof of its own and the spring of 1 N/m that carries it."""
        at, direction = ModelPlaces(model).directed_point(place)
        crosswise = () if place.endswith(Places.FREE) else ModelPlaces(model).free(at)
        others = [d for d in crosswise if d != direction]
        own = sp.csr_array(([1.0], [model.size], [0, 1]), shape=(1, model.size + 1))
        spring = _with_extra(-ModelPlaces(model).translations(at, [direction]), [1.0])
        terms = [
            Term("stiffness", RowOperator(spring, np.eye(1))),
            # On a scale it weighs what it weighs, however it hangs.
            Term("mass", RowOperator(own, np.eye(1)), weight=None if others else 1.0),
        ]
        if others:
            carried = _with_extra(ModelPlaces(model).translations(at, others), [0.0] * len(others))
            terms.append(Term("mass", RowOperator(carried, np.eye(len(others)))))

        def factors(values: FloatArray) -> FloatArray:
            mass, frequency = values.T
            stiffness = mass * (2.0 * np.pi * frequency) ** 2
            return np.column_stack([stiffness, mass, mass][: len(terms)])

        return Change(tuple(terms), factors, extra=1)


def _with_extra(rows: SparseArray, extra: Sequence[float]) -> SparseArray:
    """Return rows on the dofs of the model and one behind them, where they have `extra`, (p,)."""
    count, size = rows.shape
    data = np.insert(rows.data, rows.indptr[1:], extra)
    indices = np.insert(rows.indices, rows.indptr[1:], size)
    bounds = rows.indptr + np.arange(count + 1)
    return sp.csr_array((data, indices, bounds), shape=(count, size + 1))
