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
SHEAR, TORSION, SECTION, MESH = "shear-deformation", "torsion-constant", "section", "mesh"


@dataclass(frozen=True)
class Built:
    """Hold a structure on its way to an ideal frame.

    Arguments:
        structure: as it is meshed and held.
        rigid: joints at which the members' overlap is a rigid body.
        drawn_mass: joints of which the overlap weighs what the centre lines in it do.
        massless: blocks that weigh nothing.
    """

    structure: Structure
    rigid: frozenset[str] = frozenset()
    drawn_mass: frozenset[str] = frozenset()
    massless: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Feature:
    """Describe one thing that the solid has and the drawing lacks.

    Arguments:
        kind: its class, an effect's name where there is one.
        place: in the grammar of a case.
        what: in words.
        out: takes it out of the solid.
        after: a feature that must be out before, as a plate's mass before its stiffness.
    """

    kind: str
    place: str
    what: str
    out: Callable[[Built], Built]
    after: Feature | None = None


def own_features(name: str) -> tuple[Feature, ...] | None:
    """Return `LACKS` of a structure's file; None where it says nothing of the kind."""
    module = importlib.import_module(f"truths.structures.{name.replace('-', '_')}")
    found: tuple[Feature, ...] | None = getattr(module, "LACKS", None)
    return found


def features_of(structure: Structure) -> list[Feature]:
    """Return what the solid has: what its own file names, and what every structure may have.

    Raises:
        ValueError: where its file has no `LACKS`.
    """
    own = own_features(structure.name)
    if own is None:
        raise ValueError(f"{structure.name}: its file in truths/structures has no LACKS")
    return [*own, *overlaps(structure)]


def joints_by_type(structure: Structure) -> dict[str, list[str]]:
    """Return the joints of each type at which members cross, as the solid has them."""
    found: dict[str, list[str]] = {}
    for joint in structure.joints:
        if any(arm > 0.0 for *_, arm in ends_at(structure, joint)):
            found.setdefault(structure.types.get(joint, joint), []).append(joint)
    return found


def ends_at(structure: Structure, joint: str) -> list[tuple[Member, int, float]]:
    """Return member, end (0, 1) and distance to the face of the crossing member (m) at a joint."""
    return [
        (member, end, face_of(structure, member, end))
        for member in structure.solid_members
        for end in (0, 1)
        if member.ends[end] == joint
    ]


def in_overlap(structure: Structure, joint: str, points: Array) -> npt.NDArray[np.bool_]:
    """Return which points (3, n) of the straight description lie where members overlap at a joint.

    That is inside a member's outline, from its end past the joint to the face of what crosses it.
    """
    inside = np.zeros(points.shape[1], dtype=bool)
    for member, end, face in ends_at(structure, joint):
        if face == 0.0:
            continue
        axes, _ = structure.axes(member)
        x, y, z = axes @ (points - structure.point(joint)[:, None])
        x = x if end == 0 else -x
        section = structure.sections[member.section]
        half = np.array([section.width, section.height]) / 2 + 1e-6
        along = (x > -max(member.extend[end], face) - 1e-6) & (x < face + 1e-6)
        inside |= along & (np.abs(y) < half[0]) & (np.abs(z) < half[1])
    return inside


def overlaps(structure: Structure) -> list[Feature]:
    """Return what every structure may have: walls and mass of overlaps, what is not drawn."""
    found = []
    for kind, joints in joints_by_type(structure).items():
        names = frozenset(joints)
        found += [
            Feature(
                STIFFNESS,
                f"type:{kind}",
                "walls that bend where members overlap",
                partial(_rigid, names),
            ),
            Feature(
                MASS,
                f"type:{kind}",
                "mass of the overlap next to that of the centre lines",
                partial(_weighing, names),
            ),
        ]
    for at in dict.fromkeys(item.at for item in structure.lumps if not item.drawn):
        found.append(edited(LUMP, place(at), "a mass that is not drawn", partial(_drawn_at, at)))
    if structure.struts or any(not spring.drawn for spring in structure.springs):
        found.append(edited(SUPPORT, "all", "springs that are not drawn", _drawn_springs))
    return found


def _rigid(joints: frozenset[str], built: Built) -> Built:
    return replace(built, rigid=built.rigid | joints)


def _weighing(joints: frozenset[str], built: Built) -> Built:
    return replace(built, drawn_mass=built.drawn_mass | joints)


def edited(kind: str, place: str, what: str, change: Callable[[Structure], Structure]) -> Feature:
    """Return a feature that a change of the description takes out."""
    return Feature(kind, place, what, lambda b: replace(b, structure=change(b.structure)))


def _drawn_at(at: Place, structure: Structure) -> Structure:
    lumps = tuple(item for item in structure.lumps if item.drawn or item.at != at)
    return replace(structure, lumps=lumps)


def _drawn_springs(structure: Structure) -> Structure:
    springs = tuple(item for item in structure.springs if item.drawn)
    return replace(structure, springs=springs, struts=())


def _named(block: Block, names: tuple[str, ...]) -> bool:
    return block.name.startswith(names)


def without_blocks(kind: str, place: str, what: str, *names: str) -> Feature:
    """Return the feature of blocks whose names begin with some words: they are left out."""

    def change(structure: Structure) -> Structure:
        kept = tuple(block for block in structure.blocks if not _named(block, names))
        if len(kept) == len(structure.blocks):
            raise ValueError(f"{structure.name} has no block {' or '.join(names)}")
        return replace(structure, blocks=kept)

    return edited(kind, place, what, change)


def plates(
    place: str, what: str, *names: str, mass: str = MASS, stiffness: str = STIFFNESS
) -> tuple[Feature, Feature]:
    """Return the mass and the stiffness of blocks whose names begin with some words."""

    def light(built: Built) -> Built:
        own = {block.name for block in built.structure.blocks if _named(block, names)}
        return replace(built, massless=built.massless | own)

    weight = Feature(mass, place, f"mass of {what}", light)
    return weight, replace(without_blocks(stiffness, place, what, *names), after=weight)


def end_clamps(place: str, what: str, axis: int) -> Feature:
    """Return the feature of clamps that grip a length of members along an axis: they hold ends."""

    def flat(structure: Structure, clamp: Clamp) -> Clamp:
        low, high = list(clamp.low), list(clamp.high)
        low[axis] = high[axis] = structure.joints[clamp.at][axis]
        return Clamp(clamp.at, (low[0], low[1], low[2]), (high[0], high[1], high[2]))

    return edited(
        SUPPORT, place, what, lambda s: replace(s, clamps=tuple(flat(s, c) for c in s.clamps))
    )


def rigid_feet(place: str, what: str, *names: str) -> Feature:
    """Return the feature of feet that give way: the blocks between clamp and joint are held too."""

    def change(structure: Structure) -> Structure:
        return replace(structure, clamps=tuple(_grown(structure, c) for c in structure.clamps))

    def _grown(structure: Structure, clamp: Clamp) -> Clamp:
        low, high = np.array(clamp.low), np.array(clamp.high)
        blocks = [block for block in structure.blocks if _named(block, names)]
        for _ in blocks:
            for block in blocks:
                first, last = np.array(block.low), np.array(block.high)
                if (first <= high + 1e-6).all() and (last >= low - 1e-6).all():
                    low, high = np.minimum(low, first), np.maximum(high, last)
        return Clamp(clamp.at, (low[0], low[1], low[2]), (high[0], high[1], high[2]))

    return edited(SUPPORT, place, what, change)
