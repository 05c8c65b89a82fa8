"""What a solid has and its drawing lacks: features, each an edit that takes it out.

Overlaps of members, the joints' mass and what is marked as not drawn follow from the description;
plates, gussets and feet are named in the structure's own file as `LACKS`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from truths.bricks import face_of
from truths.drawing import place
from truths.structure import Block, Clamp, Member, Place, Structure

Array = npt.NDArray[np.float64]
STIFFNESS, MASS, SUPPORT, LUMP = "joint-stiffness", "joint-mass", "support", "added-mass"
# Chosen before any result was seen; a file without `LACKS` has no plates, gussets or feet.
TRIED = (
    *("a-frame", "box-frame", "bracket", "c-press", "curved-deck", "footing-frame", "gantry"),
    *("grid-tabs", "h-tube", "haunched-portal", "lathe-bed", "mast-lumps", "mast-on-pad"),
    *("pi-portal", "pile-bent", "portal", "skew-grid", "table-feet", "tower", "trailer"),
    *("two-material-tee", "vierendeel", "warren-truss", "wing-spar"),
)


@dataclass(frozen=True)
class Feature:
    """Describe one thing that the solid has and the drawing lacks, and how it goes.

    Arguments:
        kind: its class, an effect's name where there is one.
        place: in the grammar of a case.
        what: in words.
        change: of the description, where it is one.
        rigid: joints at which the members' overlap becomes a rigid body.
        drawn_mass: joints of which the overlap then weighs what the centre lines in it do.
        massless: beginnings of the names of blocks that then weigh nothing.
        after: a feature that must be out before, as a plate's mass before its stiffness.
    """

    kind: str
    place: str
    what: str
    change: Callable[[Structure], Structure] = lambda structure: structure
    rigid: tuple[str, ...] = ()
    drawn_mass: tuple[str, ...] = ()
    massless: tuple[str, ...] = ()
    after: Feature | None = None

    @property
    def unit(self) -> tuple[str, str]:
        """Return class and place: what data can show, net of what cancels in it."""
        return self.kind, self.place


def features_of(structure: Structure) -> list[Feature]:
    """Return what the solid has: what its own file names, and what every structure may have."""
    module = importlib.import_module(f"truths.structures.{structure.name.replace('-', '_')}")
    found: list[Feature] = [*getattr(module, "LACKS", ())]
    for kind, joints in joints_by_type(structure).items():
        at = f"type:{kind}"
        found.append(Feature(STIFFNESS, at, "walls of the overlap that bend", rigid=joints))
        found.append(Feature(MASS, at, "mass of the overlap as it is", drawn_mass=joints))
    for joint in structure.joints:
        if any(m.extend[end] > 0.0 and face == 0.0 for m, end, face in ends_at(structure, joint)):
            out = partial(_without_overhang, joint)
            found.append(Feature(LUMP, joint, "the end beyond the joint", out))
    for hung in dict.fromkeys(item.at for item in structure.lumps if not item.drawn):
        out = partial(_without_lump, hung)
        found.append(Feature(LUMP, place(hung), "a mass that is not drawn", out))
    if structure.struts or any(not spring.drawn for spring in structure.springs):
        found.append(Feature(SUPPORT, "all", "springs that are not drawn", _without_springs))
    return found


def _without_overhang(joint: str, structure: Structure) -> Structure:
    def cut(member: Member) -> Member:
        low, high = (
            0.0 if j == joint else e for j, e in zip(member.ends, member.extend, strict=True)
        )
        return replace(member, extend=(low, high))

    return replace(structure, members=tuple(cut(member) for member in structure.members))


def _without_lump(at: Place, structure: Structure) -> Structure:
    lumps = tuple(item for item in structure.lumps if item.drawn or item.at != at)
    return replace(structure, lumps=lumps)


def _without_springs(structure: Structure) -> Structure:
    springs = tuple(item for item in structure.springs if item.drawn)
    return replace(structure, springs=springs, struts=())


def joints_by_type(structure: Structure) -> dict[str, tuple[str, ...]]:
    """Return the joints of each type at which members cross, as the solid has them."""
    found: dict[str, tuple[str, ...]] = {}
    for joint in structure.joints:
        if any(face > 0.0 for *_, face in ends_at(structure, joint)):
            kind = structure.types.get(joint, joint)
            found[kind] = (*found.get(kind, ()), joint)
    return found


def ends_at(structure: Structure, joint: str) -> list[tuple[Member, int, float]]:
    """Return member, end (0, 1) and distance to the face of the crossing member (m) at a joint."""
    made = replace(structure, members=tuple(structure.solid_members))
    return [
        (member, end, face_of(made, member, end))
        for member in made.members
        for end in (0, 1)
        if member.ends[end] == joint
    ]


def in_overlap(structure: Structure, joint: str, points: Array) -> npt.NDArray[np.bool_]:
    """Return which points (3, n) of the straight description lie where members overlap at a joint.

    That is inside a member's outline, from its end past the joint to the face of what crosses it.
    """
    inside = np.zeros(points.shape[1], dtype=bool)
    for member, end, face in ends_at(structure, joint):
        x, y, z = structure.axes(member)[0] @ (points - structure.point(joint)[:, None])
        section, x = structure.sections[member.section], x if end == 0 else -x
        along = (x > -max(member.extend[end], face) - 1e-6) & (x < face + 1e-6)
        outline = np.array([section.width, section.height]) / 2 + 1e-6
        inside |= along & (np.abs(y) < outline[0]) & (np.abs(z) < outline[1]) & (face > 0.0)
    return inside


def without_blocks(kind: str, place: str, what: str, *names: str) -> Feature:
    """Return the feature of blocks whose names begin with some words: they are left out."""

    def change(structure: Structure) -> Structure:
        kept = tuple(block for block in structure.blocks if not block.name.startswith(names))
        if len(kept) == len(structure.blocks):
            raise ValueError(f"{structure.name} has no block {' or '.join(names)}")
        return replace(structure, blocks=kept)

    return Feature(kind, place, what, change)


def plates(
    place: str, what: str, *names: str, mass: str = MASS, stiffness: str = STIFFNESS
) -> tuple[Feature, Feature]:
    """Return the mass and the stiffness of blocks whose names begin with some words."""
    weight = Feature(mass, place, f"mass of {what}", massless=names)
    return weight, replace(without_blocks(stiffness, place, what, *names), after=weight)


def clamped(place: str, what: str, clamp: Callable[[Structure, Clamp], Clamp]) -> Feature:
    """Return the feature of clamps that hold something else than drawn ones do."""

    def change(structure: Structure) -> Structure:
        return replace(structure, clamps=tuple(clamp(structure, c) for c in structure.clamps))

    return Feature(SUPPORT, place, what, change)


def rigid_feet(place: str, what: str, *names: str) -> Feature:
    """Return the feature of feet that give way: the blocks between clamp and joint are held too."""

    def grown(structure: Structure, clamp: Clamp) -> Clamp:
        low, high = np.array(clamp.low), np.array(clamp.high)
        blocks: list[Block] = [b for b in structure.blocks if b.name.startswith(names)]
        # As often as there are blocks: the next one lies on what is held already.
        for block in blocks * len(blocks):
            first, last = np.array(block.low), np.array(block.high)
            if (first <= high + 1e-6).all() and (last >= low - 1e-6).all():
                low, high = np.minimum(low, first), np.maximum(high, last)
        return Clamp(clamp.at, (low[0], low[1], low[2]), (high[0], high[1], high[2]))

    return clamped(place, what, grown)
