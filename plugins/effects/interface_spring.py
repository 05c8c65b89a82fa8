"""A spring between parts that face each other: a bolted, glued or merely touching interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from femubench import Model
from femubench.effect import (
    Change,
    FrameEffect,
    ModelPlaces,
    Parameter,
    RowOperator,
    Site,
    Size,
    Term,
    elastic_band,
    once_for,
)
from femubench.fem import Brace, Frame, ModelError, Place, SparseArray

_SHARE = 0.01  # of the squared lowest elastic frequency
_TOUCHING = 1e-6  # m
_MOST = 300  # pairs


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
        return _words(model, once_for(model, "facing nodes", lambda: _facing(model)))

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
            for pair in ModelPlaces(model).node_pairs(place)
            for direction in ModelPlaces(model).pair_directions(place)
        )
        return replace(frame, braces=(*frame.braces, *found))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness matrix of springs of 1 N/m."""
        rows = _rows(model, place)
        return Change.proportional(Term("stiffness", RowOperator(rows, np.eye(rows.shape[0]))))


def _rows(model: Model, place: str) -> SparseArray:
    """Return how much the nodes of each pair move apart in each direction, sparse (p, n)."""
    directions = ModelPlaces(model).pair_directions(place)
    rows = [
        ModelPlaces(model).translations(Place(joint=last), directions)
        - ModelPlaces(model).translations(Place(joint=first), directions)
        for first, last in ModelPlaces(model).node_pairs(place)
    ]
    return sp.csr_array(sp.vstack(rows))


def _facing(model: Model) -> tuple[tuple[str, str], ...]:
    """Return the pairs of joints or nodes that share a place, 300 at most.

    Of more than two at one place each pairs with the next.
    """
    at: dict[tuple[float, ...], list[str]] = {}
    for name, xyz in ModelPlaces(model).nodes.items():
        at.setdefault(tuple(np.round(xyz / _TOUCHING).tolist()), []).append(name)
    pairs = [pair for names in at.values() for pair in pairwise(names)]
    return tuple(pairs[:_MOST])


def _words(model: Model, pairs: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Return the words of pairs of nodes, of each direction, and of all of them together."""
    words = [f"{first}-{last}" for first, last in pairs]
    if len(pairs) > 1:
        sides = ("+".join(names) for names in zip(*pairs, strict=True))
        words.insert(0, "-".join(sides))
    found = []
    for word in words:
        try:
            directions = ModelPlaces(model).pair_directions(word)
        except ModelError:
            continue
        found.append(word)
        found += [f"{word}:{d}" for d in directions] if len(directions) > 1 else []
    return tuple(found)
