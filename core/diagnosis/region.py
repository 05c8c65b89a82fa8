"""Where something differs and of what kind, before the effects that compete to explain it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

import numpy as np

from femubench.core.change.change import parameter_of
from femubench.core.effect.places import ALL, Places, bare_place, split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame
from femubench.core.fit.modal_basis import place_parts
from femubench.core.fit.modal_fit import State
from femubench.core.fit.projection import Projection
from femubench.core.inference.examine import Examination
from femubench.core.inference.posterior import Explanation
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Region, RegionKind
from femubench.core.typing import FloatArray

_KINDS: tuple[RegionKind, ...] = ("stiffness lost", "stiffness added", "mass lost", "mass added")


@dataclass(frozen=True)
class _Deed:
    """What a cause does, where, and how much of it: size and variance, None where none is known."""

    kind: RegionKind
    place: str
    size: tuple[float, float] | None


class Regions:
    """The regions that hold what competes, for the causes of some explanations.

    Arguments:
        examination: what the explanations were weighed in.
        group: those that compete, whatever their probability.
    """

    def __init__(self, examination: Examination, group: Sequence[Explanation]) -> None:
        structure, posterior = examination.model.structure, examination.posterior
        self._frame = frame = None if structure is None else structure.frame
        self._atoms = cache(lambda place: list_atoms(frame, place))
        pairs = zip(posterior.explanations, posterior.probabilities, strict=True)
        self._found = [(self._deeds(e), p) for e, p in pairs if p > settings.negligible]
        self._group = [self._deeds(e) for e in group]
        self._own_error = examination.own_error

    def find(self, explanation: Explanation, part: int, held: float = 1.0) -> Region:
        """Return the smallest region with nearly all of a cause's kind and every rival of it.

        Arguments:
            explanation: that has the cause.
            part: position of the cause among its parts.
            held: probability that any explanation holds, at most.
        """
        others = self._deeds(explanation)
        own = others.pop(part)
        taken = [deed.place for deed in others]

        def alike(deeds: list[_Deed], held: frozenset[str] | None = None) -> list[_Deed]:
            near = [d for d in deeds if d.kind == own.kind and d.place not in taken]
            return [d for d in near if held is None or self._atoms(d.place) <= held]

        rivals = [deeds for deeds in self._group if alike(deeds)]
        total = sum(p for deeds, p in self._found if alike(deeds))
        for word, atoms in list_regions(self._frame, own.place):
            place, inside = (
                word,
                [(found, p) for deeds, p in self._found if (found := alike(deeds, atoms))],
            )
            share = sum(p for _, p in inside)
            holds = all(alike(deeds, atoms) for deeds in rivals)
            if holds and share >= settings.nearly_all * total:
                break
        mass, sure = own.kind.startswith("mass"), min(held * share, 1.0)
        size, variance = _pool_sizes(inside, share, None if mass else place)
        if size is None:
            return Region(place, own.kind, sure)
        std = float(np.hypot(np.sqrt(variance), self._own_error(explanation.fit.state) * size))
        return Region(place, own.kind, sure, size, std, "kg" if mass else "")

    def _deeds(self, explanation: Explanation) -> list[_Deed]:
        """Return what every cause of an explanation does."""
        state, found = explanation.fit.state, []
        kinds = list_kinds(state)
        parts = place_parts(len(state.problem.space), state.parts)
        for (part, _, own), kind in zip(parts, kinds, strict=True):
            x, covariance = state.x[own], explanation.fit.covariance[own, own]
            size = _size_of(part, x, covariance, mass=kind.startswith("mass"))
            place, _ = split_direction(bare_place(part.hypothesis.place))
            atoms = self._atoms(place)
            found.append(_Deed(kind, min(atoms) if len(atoms) == 1 else place, size))
        return found


def list_kinds(state: State) -> list[RegionKind]:
    """Return what each cause does to the elastic modes in use: what moves their frequencies more.

    A frequency changes by half the share that it adds to the strain energy, less half of that to
    the kinetic energy (Rayleigh).
    """
    values = state.eigenvalues[state.partner]
    moving = ~state.problem.space.still(values)
    values, kinds = values[moving], []
    for part, index, own in place_parts(len(state.problem.space), state.parts):
        factors = part.hypothesis.factors(state.x[None, own])[0]
        seen = part.rows @ state.vectors[np.ix_(index, state.partner[moving])]
        energy = [0.0, 0.0]
        for mass, scale in ((False, values), (True, np.ones(len(values)))):
            core = part.core(factors, mass=mass)
            if core is not None:
                energy[mass] = float((np.einsum("pm,pq,qm->m", seen, core, seen) / scale).sum())
        heavy = abs(energy[1]) > abs(energy[0])
        kinds.append(_KINDS[2 * heavy + (energy[heavy] > 0.0)])
    return kinds


def list_regions(frame: Frame | None, place: str) -> list[tuple[str, frozenset[str] | None]]:
    """Return the regions that a place lies in with their atoms, smallest first; None of the whole.

    The place itself, ends, joints and their types, members and families, and ``all``.
    """
    own, found = list_atoms(frame, place), []
    if frame is not None and place != ALL:
        ends = [f"{member.name}@{joint}" for member in frame.members for joint in member.ends]
        families = Places(frame).sets(("set", "section", "material"))
        words = [*ends, *frame.joint_index, *Places(frame).types(), *frame.member_index, *families]
        reach = [(word, list_atoms(frame, word, around=True)) for word in words if word != place]
        found = sorted((r for r in reach if own <= r[1]), key=lambda r: len(r[1]))
    return [*([(place, own)] if place != ALL else []), *found, (ALL, None)]


def list_atoms(frame: Frame | None, place: str, *, around: bool = False) -> frozenset[str]:
    """Return what a place touches of ends ``member@joint``, other elements, and joints.

    An element at a joint is that end of its member; what sits at a joint as a whole is at no end.

    Arguments:
        frame: None for a model that came as matrices, where a place touches itself alone.
        place: without direction.
        around: whether a joint has the ends that meet there, as a region does.
    """
    if frame is None:
        return frozenset({place})
    if named := Places(frame).members(place):
        members = [frame.members[frame.member_index[name]] for name in named]
        words = [f"{m.name}/{k}" for m in members for k in range(1, m.elements + 1)]
        joints = [joint for m in members for joint in m.ends]
        return frozenset(joints).union(*(list_atoms(frame, word) for word in words))
    name, _, number = place.rpartition("/")
    if name in frame.member_index and number.isdecimal():
        member = frame.members[frame.member_index[name]]
        ends = zip(member.ends, ("1", str(member.elements)), strict=True)
        return frozenset(f"{name}@{joint}" for joint, k in ends if k == number) or frozenset(
            {place}
        )
    if (found := Places(frame).joints_of(place)) and not around:
        return frozenset(found)
    with suppress(ModelError):
        return frozenset({*found, *Places(frame).ends_of(place)})
    with suppress(ModelError):
        return frozenset().union(
            *(list_atoms(frame, at) for at in Places(frame).supports_of(place))
        )
    with suppress(ModelError):
        point = Places(frame).point(place)
        along = (
            float(point.s or 0.0) * frame.members[frame.member_index[str(point.member)]].elements
        )
        near = {int(np.ceil(along + shift)) for shift in (-settings.minor, settings.minor)}
        return frozenset().union(*(list_atoms(frame, f"{point.member}/{k}") for k in near))
    return frozenset({place})


def _size_of(
    part: Projection, x: FloatArray, covariance: FloatArray, *, mass: bool
) -> tuple[float, float] | None:
    """Return a mass in kg or a relative change, and its variance; None where it is neither."""
    h, own = part.hypothesis, parameter_of(part.hypothesis.parameters[0])
    if mass:
        size, slope = h.factors(x[None])[0] @ part.weights, h.slopes(x) @ part.weights
    elif len(x) == 1 and own.wording != "value" and own.textbook is None:
        size, slope = own.value(x[0]), np.array([own.slope(x[0])])
    else:
        return None
    return abs(float(size)), float(slope @ covariance @ slope)


def _pool_sizes(
    inside: Sequence[tuple[list[_Deed], float]], share: float, region: str | None
) -> tuple[float | None, float]:
    """Return mean and variance over explanations; None where they state no common size.

    Masses add up; a relative change is one of a whole region.
    """
    sizes = []
    for deeds, p in inside:
        known = [d.size for d in deeds if d.size and region in (None, d.place)]
        if len(known) == len(deeds) and (len(known) == 1 or region is None):
            sizes.append((p, *np.sum(known, axis=0)))
    weight = sum(p for p, *_ in sizes)
    mean = sum(p * size for p, size, _ in sizes) / (weight or 1.0)
    if weight < settings.nearly_all * share or mean < settings.negligible:
        return None, 0.0
    return float(mean), sum(p * (v + (size - mean) ** 2) for p, size, v in sizes) / weight
