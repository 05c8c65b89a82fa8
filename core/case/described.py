"""Describe a structure whose parameters were set as a frame that has them from the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femubench.core.case.faults import Fault
from femubench.core.fem.frame import Factor, Frame, RigidEnd
from femubench.core.fem.nominal import MAY_VANISH
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure

_Factors = dict[tuple[str, str], float]


def described_frame(structure: Structure) -> Frame:
    """Return the frame with all parameter changes turned into factors, joint springs, rigid ends.

    Raises:
        Fault: for a value that no key of a frame can have.
    """
    frame = structure.frame
    factors: _Factors = {}
    for parameter, value in structure.changes:
        if not np.isfinite(value):
            raise _refused(parameter, value)
        if parameter.quantity == "spring":
            frame = _with_springs(frame, parameter, value)
        elif parameter.quantity == "rigid":
            frame = _with_rigid_ends(frame, parameter, value)
        else:
            possible = value > 0.0 or (value == 0.0 and parameter.quantity in MAY_VANISH)
            if not possible or "" in parameter.places:
                raise _refused(parameter, value)
            for place in dict.fromkeys(parameter.places):
                key = parameter.quantity, place
                factors[key] = factors.get(key, 1.0) * value
    return replace(frame, factors=(*frame.factors, *_written(structure, factors)))


def _refused(parameter: Parameter, value: float) -> Fault:
    what = f"{parameter.name} = {value:g} cannot be written as a key of a frame"
    expected = "values > 0 of factors, >= 0 of springs, on members of the frame"
    return Fault(("model",), what, expected)


def _with_springs(frame: Frame, parameter: Parameter, value: float) -> Frame:
    if value < 0.0:
        raise _refused(parameter, value)
    springs = list(frame.joint_springs)
    for place in parameter.places:
        end, _, direction = place.rpartition(":")
        for i, spring in enumerate(springs):
            if f"{spring.member}@{spring.joint}" == end:
                stiffness = {**spring.stiffness, direction: value}
                springs[i] = replace(spring, stiffness=stiffness)
    return replace(frame, joint_springs=tuple(springs))


def _with_rigid_ends(frame: Frame, parameter: Parameter, value: float) -> Frame:
    ends = {f"{end.member}@{end.joint}": end for end in frame.rigid_ends}
    for place in parameter.places:
        member, _, joint = place.rpartition("@")
        old = ends.get(place, RigidEnd(joint, member, 0.0))
        ends[place] = replace(old, stiffness_length=value)
    return replace(frame, rigid_ends=tuple(ends.values()))


def _written(structure: Structure, factors: _Factors) -> tuple[Factor, ...]:
    groups: dict[tuple[str, float], list[str]] = {}
    for (quantity, place), factor in factors.items():
        if factor != 1.0:
            groups.setdefault((quantity, factor), []).append(place)
    return tuple(
        Factor(quantity, _shortened(structure, places), factor)
        for (quantity, factor), places in groups.items()
    )


def _shortened(structure: Structure, places: Sequence[str]) -> tuple[str, ...]:
    """Return ``all`` for every element of the frame, a member's name for all elements of it."""
    rest = dict.fromkeys(places)
    short: list[str] = []
    for member, labels in structure.member_labels.items():
        if all(label in rest for label in labels):
            short.append(member)
        else:
            short += [label for label in labels if label in rest]
    return ("all",) if short == list(structure.member_labels) else tuple(short)
