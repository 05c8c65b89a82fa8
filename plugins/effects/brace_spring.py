"""A strut, a cable or a stiff strap between two joints, or nodes, that nothing else joins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

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
    once_for,
)
from femubench.fem import Brace, Frame

_SHARE = 0.01  # of the mean EA / L of the members
_FIRST = 0.1  # of what the first frequency and the mass make a stiffness of, for matrices
_MOST = 300
_FELT = 1e-9
_STRAIGHT = np.cos(np.radians(5.0))


class BraceSpring(FrameEffect):
    """Tie two joints by a massless axial spring; out of plane it would act on nothing."""

    name: ClassVar[str] = "brace-spring"
    summary: ClassVar[str] = "a brace ties two joints"
    sizes: ClassVar[Sequence[Size]] = (Size(0.01, 1.0, Site.modal_stiffness, log=True),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the pairs of joints without a member between them, the nearest 300 at most.

        Joints that rigid links make one body are one joint, and of those that stand off members
        by links, a straight run of members joins all that it passes: a brace next to it would be
        a stiffener of these members. Of matrices they are nodes that the body joins by a detour.
        """
        if model.structure is None:
            places = ModelPlaces(model)
            # What is held, or moves across alone, feels nothing of it.
            felt = (ends for ends in places.spans() if abs(places.elongation(ends)).max() > _FELT)
            return [f"{first}-{last}" for first, last in felt]
        if model.structure.frame.plane == "out-of-plane":
            return ()
        frame = model.structure.frame
        body = dict(frame.joint_index)  # the number of the rigid body that links make of joints
        for link in frame.links:
            if len(link.motions) in (0, len(frame.active)):
                taken = {body[name] for name in (link.leads, *link.follows)}
                body = {name: min(taken) if own in taken else own for name, own in body.items()}
        joined = {frozenset(body[name] for name in member.ends) for member in frame.members}
        joined |= {frozenset([number]) for number in body.values()}
        joined |= _in_line(frame, body) if frame.links else set()
        # Where no member ends, a joint of links may have motions that nothing makes use of.
        loose = set((model.frame_structure.kinematics.unused // 6).tolist())
        names = [name for name, i in frame.joint_index.items() if i not in loose]
        pairs = [
            (first, last)
            for first, last in combinations(names, 2)
            if frozenset([body[first], body[last]]) not in joined
        ]
        return [f"{first}-{last}" for first, last in _nearest(frame, pairs)]

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffness along the line of the joints."""

        def rigidity() -> float:  # N/m, of the members along themselves in the mean
            if model.structure is None:
                first = 2.0 * np.pi * float(elastic_band(model)[0])
                return _FIRST * model.total_mass * first**2
            frame = model.structure.frame
            each = [m.material.E * m.section.A / frame.member_length(m.name) for m in frame.members]
            return _SHARE * float(np.mean(each))

        scale = once_for(model, "stiffness of a brace", rigidity)
        return (Parameter("stiffness", "N/m", scale, scaling="exponential", one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the brace."""
        if not values[0]:
            return frame
        return replace(frame, braces=(*frame.braces, Brace(Places(frame).pair(place), values[0])))

    def change(self, model: Model, place: str) -> Change:
        """Return the stiffness matrix of 1 N/m."""
        row = ModelPlaces(model).elongation(ModelPlaces(model).node_pairs(place)[0])
        return Change.proportional(Term("stiffness", RowOperator(row, np.eye(1))))


def _in_line(frame: Frame, body: Mapping[str, int]) -> set[frozenset[int]]:
    """Return the pairs of bodies that a straight run of members joins."""
    ends = [frozenset(body[name] for name in member.ends) for member in frame.members]
    along = np.diff(frame.corners[frame.member_ends], axis=1)[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    parallel = np.abs(along @ along.T) > _STRAIGHT
    meet = np.array([[bool(one & other) for other in ends] for one in ends])
    run = connected_components(csr_array(parallel & meet), directed=False)[1]
    found = set()
    for number in np.unique(run):
        passed = frozenset().union(*(ends[i] for i in np.flatnonzero(run == number)))
        found |= {frozenset(pair) for pair in combinations(passed, 2)}
    return found


def _nearest(frame: Frame, pairs: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the pairs that a brace could span, in their order."""
    if len(pairs) <= _MOST:
        return pairs
    index = np.array([[frame.joint_index[name] for name in pair] for pair in pairs])
    distance = np.linalg.norm(frame.corners[index[:, 1]] - frame.corners[index[:, 0]], axis=1)
    return [pairs[i] for i in np.sort(np.argsort(distance, kind="stable")[:_MOST])]
