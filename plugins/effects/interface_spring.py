"""A spring between parts that face each other: a bolted, glued or merely touching interface."""

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
    Parameter,
    RowOperator,
    Site,
    Size,
    Term,
    elastic_band,
    facing_nodes,
    interface_directions,
    interface_places,
    node_pairs,
    proportional,
    translation_rows,
)
from femubench.fem import Brace, Frame, Place, SparseArray

_SHARE = 0.01  # of the squared lowest elastic frequency


class InterfaceSpring(FrameEffect):
    """Tie two nodes, or the nodes of two sets one by one, by springs in global directions.

    All springs of a place have one stiffness. Where nodes share a place, parts that face each other
    end there.
    """

    name: ClassVar[str] = "interface-spring"
    summary: ClassVar[str] = "an interface holds parts together"
    sizes: ClassVar[Sequence[Size]] = (Size(0.01, 1.0, Site.modal_stiffness, log=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the pairs of nodes that share a place, and all of them together."""
        return interface_places(model, facing_nodes(model))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffness of each spring."""
        scale = _SHARE * model.total_mass * (2.0 * np.pi * float(elastic_band(model)[0])) ** 2
        return (Parameter("stiffness", "N/m", scale, scaling="exponential", one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the springs."""
        model = Model.of(frame)
        if not values[0]:
            return frame
        found = tuple(
            Brace(pair, values[0], direction)
            for pair in node_pairs(model, place)
            for direction in interface_directions(model, place)
        )
        return replace(frame, braces=(*frame.braces, *found))

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the springs in it."""
        rows = _rows(model, place)
        return replace(model, stiffness=model.stiffness + values[0] * (rows.T @ rows))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness matrix of springs of 1 N/m."""
        rows = _rows(model, place)
        return proportional(Term("stiffness", RowOperator(rows, np.eye(rows.shape[0]))))


def _rows(model: Model, place: str) -> SparseArray:
    """Return how much the nodes of each pair move apart in each direction, sparse (p, n)."""
    directions = interface_directions(model, place)
    rows = [
        translation_rows(model, Place(joint=last), directions)
        - translation_rows(model, Place(joint=first), directions)
        for first, last in node_pairs(model, place)
    ]
    return sp.csr_array(sp.vstack(rows))
