"""A case under other names and in another order: nothing but its physics tells what it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import Frame, Joint, Member, MemberSet, Place
from femubench.core.fem.model import Model
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import SparseArray

_Part = TypeVar("_Part")
Names = Mapping[str, str]


@dataclass(frozen=True)
class Disguise:
    """New names, and what draws new orders.

    Arguments:
        joints, types, members, sections, materials, sets: from old names to new ones.
        rng: draws the orders; None leaves them as they are.
    """

    joints: Names
    types: Names
    members: Names
    sections: Names
    materials: Names
    sets: Names
    rng: np.random.Generator | None

    @classmethod
    def of(cls, frame: Frame, rng: np.random.Generator | None) -> Disguise:
        """Return new names for everything in a frame that has one."""
        return cls(
            _renamed("n", (joint.name for joint in frame.joints), rng),
            _renamed("t", (joint.type for joint in frame.joints), rng) | {"": ""},
            _renamed("m", (member.name for member in frame.members), rng),
            _renamed("s", (member.section.name for member in frame.members), rng) | {"": ""},
            _renamed("k", (member.material.name for member in frame.members), rng) | {"": ""},
            _renamed("set", (item.name for item in frame.sets), rng),
            rng,
        )

    def frame(self, frame: Frame) -> Frame:
        """Return the frame with new names, its joints and members in another order."""
        changed: dict[str, Any] = {
            "joints": self._shuffled(
                Joint(self.joints[j.name], j.xyz, self.types[j.type]) for j in frame.joints
            ),
            "members": self._shuffled(self._member(member) for member in frame.members),
            "links": tuple(
                replace(link, leads=self.joints[link.leads], follows=self._joints(link.follows))
                for link in frame.links
            ),
            "factors": tuple(
                replace(item, at=tuple(map(self._element, item.at))) for item in frame.factors
            ),
            "braces": tuple(replace(b, ends=self._joints(b.ends)) for b in frame.braces),
            "sets": tuple(MemberSet(self.sets[s.name], self._set(s)) for s in frame.sets),
            "families": tuple(
                MemberSet(self._family(s.name), self._set(s)) for s in frame.families
            ),
        }
        for name in ("masses", "springs", "supports", "oscillators"):
            changed[name] = self.place_parts(getattr(frame, name))
        for name in ("joint_springs", "rigid_ends", "preloads", "eccentricities", "couplings"):
            changed[name] = tuple(map(self._at_member, getattr(frame, name)))
        return replace(frame, **changed)

    def place_parts(self, parts: Iterable[_Part]) -> tuple[_Part, ...]:
        """Return what is attached at places, with the new names of those."""
        return tuple(replace(part, at=self._place(part.at)) for part in parts)  # type: ignore[type-var,attr-defined]

    def _place(self, place: Place) -> Place:
        if place.joint is not None:
            return Place(joint=self.joints[place.joint])
        return Place(member=self.members[str(place.member)], s=place.s)

    def _member(self, member: Member) -> Member:
        section = replace(member.section, name=self.sections[member.section.name])
        material = replace(member.material, name=self.materials[member.material.name])
        ends = self.joints[member.ends[0]], self.joints[member.ends[1]]
        name = self.members[member.name]
        return replace(member, name=name, ends=ends, section=section, material=material)

    def _at_member(self, part: Any) -> Any:  # noqa: ANN401 - a part of a frame at one member
        named = {"member": self.members[part.member]}
        if hasattr(part, "joint"):
            named["joint"] = self.joints[part.joint]
        return replace(part, **named)

    def _joints(self, names: Iterable[str]) -> Any:  # noqa: ANN401 - as many as there were
        return tuple(self.joints[name] for name in names)

    def _set(self, item: MemberSet) -> tuple[str, ...]:
        return self._shuffled(self.members[name] for name in item.members)

    def _element(self, place: str) -> str:
        """Return a place of factors: all, a member, or an element of it."""
        member, slash, number = place.rpartition("/")
        if place in self.members:
            return self.members[place]
        return f"{self.members[member]}/{number}" if slash else place

    def _family(self, word: str) -> str:
        kind, _, name = word.partition(":")
        names = self.sections if kind == "section" else self.materials
        return f"{kind}:{names[name]}"

    def _shuffled(self, parts: Iterable[_Part]) -> tuple[_Part, ...]:
        listed = list(parts)
        return tuple(listed[place] for place in _order(len(listed), self.rng))


def _order(count: int, rng: np.random.Generator | None) -> list[int]:
    return list(range(count)) if rng is None else rng.permutation(count).tolist()


def _renamed(letter: str, names: Iterable[str], rng: np.random.Generator | None) -> dict[str, str]:
    """Return a number for every name that is not empty, in the order of the alphabet or in none."""
    known = sorted({name for name in names if name})
    wide = len(str(len(known)))
    numbers = zip(known, _order(len(known), rng), strict=True)
    return {name: f"{letter}{number + 1:0{wide}}" for name, number in numbers}


def disguise_case(case: Case, rng: np.random.Generator | None) -> Case:
    """Return a case whose joints, nodes, members, sets and sensors have other names and orders.

    Arguments:
        case: a frame, or matrices.
        rng: draws the orders; None leaves them as they are, also that of the alphabet.

    Raises:
        NotApplicable: for a model that is neither a frame nor matrices with their nodes.
    """
    model, reference = case.model, case.reference
    if model.structure is not None:
        names = Disguise.of(model.structure.frame, rng)
        model = Model.of(names.frame(model.structure.frame))
    elif isinstance(model.geometry, MatrixGeometry):
        names = Disguise(_renamed("n", model.geometry.names, rng), {}, {}, {}, {}, {}, rng)
        model = _in_another_order(model, model.geometry, names)
    else:
        raise NotApplicable("a model without elements and without nodes has no names to change")
    sensors = [m.sensors for m in (case.measurement, reference) if m is not None]
    labels = _renamed("c", (label for listed in sensors for label in listed.labels), rng)

    def relabelled(measured: Measurement) -> Measurement:
        """Return modes at sensors of other names, in the order of these or in theirs."""
        known = measured.sensors
        new = [labels[label] for label in known.labels]
        order = list(range(len(known)))
        if rng is not None:
            order.sort(key=new.__getitem__)
        there = replace(known, labels=tuple(new)).take(order)
        shapes, std = measured.shapes[order], measured.shape_std[order]
        return replace(measured, sensors=there, shapes=shapes, shape_std=std)

    changes = tuple(
        replace(
            change,
            masses=names.place_parts(change.masses),
            springs=names.place_parts(change.springs),
            measurement=relabelled(change.measurement),
        )
        for change in case.modifications
    )
    return replace(
        case,
        model=model,
        measurement=relabelled(case.measurement),
        modifications=changes,
        reference=None if reference is None else relabelled(reference),
    )


def _in_another_order(model: Model, geometry: MatrixGeometry, names: Disguise) -> Model:
    """Return matrices with their rows in another order, and other names of nodes and groups."""
    rng, dofs = names.rng, model.dofs
    rows = np.array(_order(len(dofs), rng), dtype=int)
    # Nodes are counted in the order in which rows first name them.
    numbers = {int(node): number for number, node in enumerate(dict.fromkeys(dofs.node[rows]))}
    moved = replace(
        dofs,
        node=np.array([numbers[int(node)] for node in dofs.node[rows]], dtype=dofs.node.dtype),
        direction=tuple(dofs.direction[row] for row in rows),
        xyz=dofs.xyz[rows],
        axes=None if dofs.axes is None else dofs.axes[rows],
    )
    groups = _renamed("g", (*model.groups, *model.mass_groups), rng)
    families = _renamed("set:g", model.families, rng)

    def turned(matrix: SparseArray) -> SparseArray:
        found: SparseArray = matrix.tocsr()[rows][:, rows].asformat(matrix.format)
        return found

    return replace(
        model,
        mass=turned(model.mass),
        stiffness=turned(model.stiffness),
        groups={groups[name]: turned(part) for name, part in model.groups.items()},
        mass_groups={groups[name]: turned(part) for name, part in model.mass_groups.items()},
        powers={},  # no disguise has plates, nor knows what is held
        grounds={},
        group_priors={groups[n]: prior for n, prior in model.group_priors.items() if n in groups},
        group_kinds={groups[n]: kind for n, kind in model.group_kinds.items() if n in groups},
        families={families[w]: tuple(groups[n] for n in own) for w, own in model.families.items()},
        dofs=moved,
        geometry=MatrixGeometry(
            tuple(names.joints[geometry.names[node]] for node in numbers),
            moved,
            mesh=None if geometry.mesh is None else geometry.mesh[list(numbers)][:, list(numbers)],
            spans=geometry.spans and tuple((numbers[a], numbers[b]) for a, b in geometry.spans),
        ),
    )
