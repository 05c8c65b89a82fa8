"""What a truth in the words of beams is in a drawing of the structure in groups of matrices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from femubench import Model
from femubench.core.challenge.outcome import Same, same_place
from femubench.core.challenge.truth_file import KnownCase, TrueCause
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.places import split_direction
from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import GROUP
from femubench.core.fem.mesh import place_xyz
from femubench.core.modal.group_prior import GroupPriors
from femubench.core.modal.interfaces import Interfaces
from truths.solid_drawing import JOINT, NEAR, group_of
from truths.suite import structures

STIFFNESS, MASS, BOTH = "member-stiffness", "group-mass", "group-material"
SOFTNESS = "interface-softness"
# Effects of a member -> what scales in its group.
OF_MEMBER = {
    "local-stiffness-loss": (STIFFNESS,),
    "member-stiffness": (BOTH, STIFFNESS, MASS),
    "wall-thickness": (BOTH, STIFFNESS, MASS),
    "member-mass": (MASS,),
}
SOFT_FOOT = "support-flexibility"
AT_JOINT = ("joint-rotation", "joint-flexibility", SOFT_FOOT)


def truth_in_groups(truth: KnownCase, model: Model) -> KnownCase:
    """Return a truth whose causes also count as found in the groups of a drawing.

    A loose joint or a soft foot is the joint's group, or where it has none the member that ends
    there; a soft foot is in the plate that is held, too, whose cells are soft, or in what lies
    between them and the ground. A material or a wall
    scales stiffness and mass of the member's group.

    Arguments:
        truth: in the words of the beams.
        model: the drawing.
    """
    groups = {*model.groups, *model.mass_groups}
    plates = plates_held(truth.structure)
    grounds = [p for p in GroupPriors(model).interfaces.places if p.startswith(Interfaces.GROUND)]
    causes = tuple(_in_groups(cause, groups, plates, grounds) for cause in truth.causes)
    return replace(truth, causes=causes)


def plates_held(name: str) -> dict[str, list[str]]:
    """Return the plates of a structure of the suite that a clamp holds, by its joint."""
    structure, found = structures().get(name), {}
    for clamp in () if structure is None else structure.clamps:
        low, high = np.array(clamp.low) - NEAR, np.array(clamp.high) + NEAR
        held = [b for b in structure.blocks if (low < b.high).all() and (high > b.low).all()]
        found[clamp.at] = [group_of(block) for block in held if block.material]
    return found


def _in_groups(
    cause: TrueCause, groups: set[str], plates: Mapping[str, list[str]], grounds: Iterable[str]
) -> TrueCause:
    joint = cause.place.removeprefix("support:").rpartition("@")[2]
    member = next((g for g in groups if g == cause.place.partition("/")[0]), None)
    found: list[str] = []
    if cause.effect in AT_JOINT:
        zones = {g for g in groups if g == JOINT + joint or g.startswith(f"{JOINT}{joint}-")}
        zones |= {*plates.get(joint, ())} & groups if cause.effect == SOFT_FOOT else set()
        found = [f"{STIFFNESS}@{GROUP}{zone}" for zone in sorted(zones)]
        if cause.effect == SOFT_FOOT:
            found += [f"{SOFTNESS}@{word}" for word in grounds if word.rpartition("|")[2] in zones]
    elif member is not None:
        found = [f"{name}@{GROUP}{member}" for name in OF_MEMBER.get(cause.effect, ())]
    return replace(cause, also=(*cause.also, *found))


def same_in_groups(model: Model, beams: Model) -> Same:
    """Return what tells whether two words stand for one place of a drawing, or of its beams.

    A node of the drawing is the nearest point of the beams, and so are the two of a strut.

    Arguments:
        model: the drawing.
        beams: the first drawing of the structure.
    """
    frame, places = beams.frame_structure.frame, ModelPlaces(model).nodes
    same, words = same_place(frame), ModelPlaces(beams).points()
    points = np.array([place_xyz(frame, ModelPlaces(beams).point(word)) for word in words])

    def on_beams(place: str) -> str:
        (head, direction), nodes = split_direction(place), ()
        with suppress(ModelError):
            (nodes,) = ModelPlaces(model).node_pairs(head)
        nodes = (head,) if head in places else nodes
        near = (np.linalg.norm(points - places[node], axis=1).argmin() for node in nodes)
        found = "-".join(words[int(i)] for i in near)
        return found + (f":{direction}" if direction else "") if found else place

    def is_same(first: str, second: str) -> bool:
        return first == second or same(on_beams(first), on_beams(second))

    return is_same
