"""What a drawing leaves open, class by class, each with the room that drawings of its kind leave.

A joint zone may be stiffer or softer about every axis, with the drawing in the middle: the arm of
half a depth, a wall that gives and a gusset are one net number, for data cannot tell them apart.
Modulus, density and masses have little room, for they take what is not theirs. Most joints and
masses lack little, and a few much: their priors have tails.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import SimpleNamespace
from typing import cast

import numpy as np

from femubench.core.change.change import Change
from femubench.core.change.hypothesis import Hypothesis
from femubench.core.change.parameter import Parameter
from femubench.core.change.terms import ElementOperator, Term
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.fem.beam import BEND_XY, BEND_XZ, TWIST
from femubench.core.fem.frame import (
    ACTIVE,
    MADE,
    Factor,
    Frame,
    GroundSpring,
    Member,
    Place,
    PointMass,
)
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.joints import JointZones
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import Matrix
from femubench.core.fem.structure import Structure
from femubench.core.fit.modal_fit import variance_of
from femubench.core.inference.settings import settings
from femubench.core.modal.group_prior import GroupPriors
from femubench.core.roles import Effect
from femubench.core.typing import FloatArray, IntArray

_JOINTS, _SPRINGS, _LUMPS = "joint stiffness", "springs to ground", "rotary inertia of masses"
_MASSES, _PADS, _PLATES = "joint mass", "extent of springs", "plates"
# Of most a drawing lacks little, of a few much.
TAILED = (_JOINTS, _SPRINGS, _LUMPS, _MASSES, _PADS, _PLATES)
_WHOLES = ("E", "GJ", "density")  # of everything
# Of every axis of a joint zone the displacements of an element, and what a factor multiplies.
_AXES = {"rx": (TWIST, "GJ"), "ry": (BEND_XZ, "bending ry"), "rz": (BEND_XY, "bending rz")}


@dataclass(frozen=True)
class Entry:
    """What a drawing leaves open of one class at one place: some numbers with a common prior.

    Arguments:
        place, kind: of the line of the budget that it belongs to.
        names: of the numbers, (q,).
        terms: what each changes, (t,): of plates stiffness and mass.
        root: of their prior covariance, of ln(factor), of a share or in kg, (q, q).
        quantities: the factor of a frame that each is; none of what is put on.
        at: elements with these factors, ``all``, or joints with the mass; of plates both.
    """

    place: str
    kind: str
    names: tuple[str, ...]
    terms: tuple[Term, ...]
    root: FloatArray
    quantities: tuple[str, ...]
    at: tuple[str, ...]

    def values(self, x: FloatArray) -> FloatArray:
        """Return the numbers at coordinates, (g, q) both."""
        moved = x @ self.root.T
        return np.asarray(np.expm1(moved) if self.quantities else moved)

    def grow(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms at coordinates, (g, t)."""
        return np.tile(self.values(x), len(self.terms) // len(self.names))

    @property
    def lines(self) -> tuple[str, str]:
        """Return the classes that its stiffness and its mass belong to."""
        return (_JOINTS, _MASSES) if self.kind == _PLATES else (self.kind, self.kind)

    @property
    def hypothesis(self) -> Hypothesis:
        """Return it as what a fit takes; a mass cannot be negative."""
        lower = -np.inf if self.quantities else 0.0
        own = tuple(Parameter(n, "", 1.0, lower=lower, reach=np.inf) for n in self.names)
        change = Change(self.terms, self.grow, name=self.kind, places=(self.place,), parameters=own)
        return Hypothesis(cast(Effect, SimpleNamespace(name=self.kind)), change, 1)

    def list_unseen(self, covariance: FloatArray) -> tuple[str, ...]:
        """Return of which numbers the data take away too little of the prior variance.

        Arguments:
            covariance: of the coordinates by data and prior, (q, q).
        """
        left = variance_of(self.root, covariance) / np.square(self.root).sum(axis=1)
        pairs = zip(self.names, left, strict=True)
        return tuple(name for name, share in pairs if 1.0 - share < settings.budget_seen)


def extend_model(model: Model, entries: Sequence[Entry], x: FloatArray) -> Model:
    """Return a model with some entries at coordinates, (k,)."""
    if model.structure is not None:
        return Model.of(model.structure.rebuilt(extend_frame(model.structure.frame, entries, x)))
    factors = [Property(entry.kind, entry.quantities[0], (entry.place,)) for entry in entries]
    grown = [1.0 + entry.grow(x[None, own])[0, 0] for entry, own in with_slices(entries)]
    return Groups(model).with_factors(factors, grown)


def extend_frame(frame: Frame, entries: Sequence[Entry], x: FloatArray) -> Frame:
    """Return a frame with some entries at coordinates, (k,), as factors, masses and springs.

    Changes of the matrices add up, as in the fit, where factors of a frame multiply.
    """
    everywhere, held = dict[str, float](), dict[str, float]()
    inertia, pads = dict[str, float](), dict[str, float]()
    zones, added = defaultdict[tuple[str, str], float](float), list[PointMass]()
    for entry, own in with_slices(entries):
        values = entry.values(x[None, own])[0].tolist()
        if entry.kind == _JOINTS:
            for quantity, value in zip(entry.quantities, values, strict=True):
                for label in entry.at:
                    zones[quantity, label] += value
        elif entry.kind == _SPRINGS:
            held |= {name: 1.0 + value for name, value in zip(entry.names, values, strict=True)}
        elif entry.kind == _PLATES:
            for at in entry.at if values[0] else ():
                if at in frame.joint_index:
                    added.append(PointMass(Place(joint=at), values[0] * _weigh_ends(frame, at)))
                else:
                    for axis in _axes_of(frame):
                        zones[_AXES[axis][1], at] += values[0]
        elif entry.kind == _LUMPS:
            inertia[entry.place] = values[0]
        elif entry.kind == _PADS:
            pads[entry.place] = values[0]
        elif entry.quantities:
            everywhere[entry.quantities[0]] = values[0]
        else:
            added += [PointMass(Place(joint=name), values[0]) for name in entry.at if values[0]]
    stiffer, twist, heavier = (everywhere.get(quantity, 0.0) for quantity in _WHOLES)
    stiffer, twisted = 1.0 + stiffer, 1.0 + stiffer + twist
    values = (stiffer, twisted / stiffer, 1.0 + heavier)
    factors = [Factor(name, ("all",), value) for name, value in zip(_WHOLES, values, strict=True)]
    alike = defaultdict[tuple[str, float], list[str]](list)
    for (quantity, label), value in zones.items():
        whole = twisted if quantity == "GJ" else stiffer
        alike[quantity, max(1.0 + value / whole, settings.quiet_share)].append(label)
    factors += [Factor(name, tuple(labels), factor) for (name, factor), labels in alike.items()]
    wanted = tuple(one for one in (*frame.factors, *factors) if one.factor != 1.0)
    bodies = [(mass, inertia.get(_family(frame, mass.at), 0.0)) for mass in frame.masses]
    masses = [part for mass, share in bodies for part in _spread(mass, share)]
    springs = [replace(s, stiffness=s.stiffness * held.get(_along(s), 1.0)) for s in frame.springs]
    springs += [
        replace(spring, stiffness=share * spring.stiffness)
        for place, share in pads.items()
        for spring in _turning(frame, place)
        if share
    ]
    return replace(frame, factors=wanted, masses=(*masses, *added), springs=tuple(springs))


def list_entries(model: Model) -> list[Entry]:
    """Return all that a drawing leaves open: joint zones, E, masses, springs; or groups."""
    if model.structure is None:
        return _list_groups(model)
    structure = model.structure
    frame = structure.frame
    p = structure.properties
    stiff, heavy = p.stiffness_matrices(), p.mass_matrices()
    found, (unknown, passing, correlation, part) = [], settings.budget_joints
    widths = dict(zip(MADE, settings.budget_made, strict=True))
    made = {kind.type: widths[kind.made] for kind in frame.joint_kinds}
    zones = JointZones(structure, part)
    for (place, role), ends in zones.ends.items():
        rows = np.unique(np.concatenate([zones.zone(end)[0] for end in ends]))
        labels = tuple(zones.labels[row] for row in rows.tolist())
        terms = {}
        for axis in _axes_of(frame):
            blocks = _within(stiff[rows], _AXES[axis][0])
            if blocks.any():
                terms[axis] = Term("stiffness", ElementOperator(structure, rows, blocks))
        if terms:
            bends = np.array([axis != "rx" for axis in terms])
            alike = np.where(np.outer(bends, bends), correlation, 0.0)
            np.fill_diagonal(alike, 1.0)
            std = passing if role == "through" else made.get(place, unknown)
            root = std * np.linalg.cholesky(alike)
            names = tuple(axis if role == "end" else f"{role} {axis}" for axis in terms)
            factors = tuple(_AXES[axis][1] for axis in terms)
            found.append(Entry(place, _JOINTS, names, tuple(terms.values()), root, factors, labels))
    found += _list_plates(structure, zones, stiff)
    every = np.arange(len(structure.properties))
    *wholes, mass = settings.budget_known[:4]
    parts = stiff, _within(stiff, TWIST), heavy
    for quantity, blocks, std in zip(_WHOLES, parts, wholes, strict=True):
        if blocks.any():
            operator = ElementOperator(structure, every, blocks)
            term = Term("mass" if blocks is heavy else "stiffness", operator)
            found.append(_alone("all", quantity, term, std, (quantity,), ("all",)))
    kinds = defaultdict[str, list[str]](list)
    for joint in frame.joints:
        kinds[joint.family].append(joint.name)
    for place, alike_joints in kinds.items():
        std = mass * model.total_mass / np.sqrt(len(alike_joints))
        for name in alike_joints:
            term = ModelPlaces(model).mass_term([Place(joint=name)])
            found.append(_alone(place, _MASSES, term, std, (), (name,)))
    return [*found, *_attached(structure)]


def _within(matrices: FloatArray, own: IntArray) -> FloatArray:
    """Return matrices of elements, (k, 12, 12), with what some displacements have alone."""
    inside = np.isin(np.arange(matrices.shape[1]), own)
    return matrices * np.outer(inside, inside)


def _axes_of(frame: Frame) -> list[str]:
    return [axis for axis in ACTIVE[frame.plane] if axis in _AXES]


def _list_plates(structure: Structure, zones: JointZones, stiff: FloatArray) -> list[Entry]:
    """Return plates and pieces at joints: by one number they stiffen what meets and weigh on it."""
    found, ends = list[Entry](), defaultdict[str, list[str]](list)
    frame, axes = structure.frame, _axes_of(structure.frame)
    for (place, role), own in zones.ends.items():
        if role != "foot":
            ends[place] += own
    for place, own in ends.items():
        rows = np.unique(np.concatenate([zones.zone(end)[0] for end in own]))
        turned = np.sum([_within(stiff[rows], _AXES[axis][0]) for axis in axes], axis=0)
        joints = dict.fromkeys(end.rpartition("@")[2] for end in own)
        masses = [PointMass(Place(joint=name), _weigh_ends(frame, name)) for name in joints]
        terms = (
            Term("stiffness", ElementOperator(structure, rows, turned)),
            Term.of("mass", structure.assemble_attachments(masses, ())[0]),
        )
        at = (*(zones.labels[row] for row in rows.tolist()), *joints)
        if turned.any():
            found.append(Entry(place, _PLATES, (_PLATES,), terms, np.eye(1), (), at))
    return found


def _weigh_ends(frame: Frame, joint: str) -> float:
    """Return the mass in kg of plates at a joint that make the ends of members twice as stiff.

    Over once the depth of each, of an equal rectangle, they lie at its faces, where a third of what
    the member weighs does it.
    """
    members = [frame.members[frame.member_index[name]] for name in frame.ends_at(joint)]
    weights = [m.material.rho * m.section.A * _gyration(m) for m in members]
    return float(np.sqrt(12.0) / 3.0 * sum(weights))


def _gyration(member: Member) -> float:
    """Return the larger radius of gyration of a section in m."""
    section = member.section
    return float(np.sqrt(max(section.Iy, section.Iz) / section.A))


def _list_groups(model: Model) -> list[Entry]:
    """Return the groups of matrices, each with the prior of its own, or density for all masses."""
    found, groups, priors = list[Entry](), Groups(model), GroupPriors(model)
    pairs: tuple[tuple[Matrix, str], ...] = ("stiffness", "E"), ("mass", "density")
    for matrix, quantity in pairs:
        for place in groups.places(matrix):
            std = priors.std(place.removeprefix(groups.PREFIX), matrix)
            term = Term.of(matrix, groups.matrix(matrix, place))
            found.append(_alone(place, matrix, term, std, (quantity,), ()))
    if not model.mass_groups:
        term, std = Term.of("mass", model.mass), settings.budget_known[2]
        found.append(_alone("all", _WHOLES[-1], term, std, _WHOLES[-1:], ()))
    return found


def _attached(structure: Structure) -> list[Entry]:
    """Return what is open of drawn springs to ground, and of drawn masses, which have no extent."""
    frame = structure.frame
    springs = defaultdict[str, dict[str, list[GroundSpring]]](dict)
    for one in frame.springs:
        springs[_family(frame, one.at)].setdefault(_along(one), []).append(one)
    found = []
    for place, groups in springs.items():
        held = [structure.assemble_attachments((), alike)[1] for alike in groups.values()]
        terms = tuple(Term.of("stiffness", matrix) for matrix in held)
        # Pads of one kind are half alike: ground differs from one footing to the next.
        count, along = len(terms), np.array([name.rpartition(" ")[2] for name in groups])
        together = np.where(along[:, None] == along, settings.budget_joints[2], 0.0)
        np.fill_diagonal(together, 1.0)
        root = settings.budget_known[4] * np.linalg.cholesky(together)
        found.append(Entry(place, _SPRINGS, tuple(groups), terms, root, (_SPRINGS,) * count, ()))
        if pads := _turning(frame, place):
            term = Term.of("stiffness", structure.assemble_attachments((), pads)[1])
            found.append(_alone(place, _PADS, term, 1.0, (), (place,)))
    lumps: dict[str, list[PointMass]] = {}
    for mass in frame.masses:
        lumps.setdefault(_family(frame, mass.at), []).append(mass)
    for place, alike in lumps.items():
        wide = [part for mass in alike for part in _spread(mass, 1.0)]
        bodies, points = (structure.assemble_attachments(m, ())[0] for m in (wide, alike))
        term = Term.of("mass", bodies - points)
        found.append(_alone(place, _LUMPS, term, 1.0, (), (place,)))
    return found


def _family(frame: Frame, at: Place) -> str:
    """Return the type of the joint where something is attached, or the member."""
    return str(at.member) if at.joint is None else frame.joint(at.joint).family


def _turning(frame: Frame, place: str) -> list[GroundSpring]:
    """Return what drawn springs hold of rotations, were they spread as wide as what they hold."""
    found = []
    own = [spring for spring in frame.springs if _family(frame, spring.at) == place]
    for at in dict.fromkeys(spring.at for spring in own):
        across = {_along(s).rpartition(" ")[2]: s.stiffness for s in own if s.at == at}
        held = {*across, *(d for s in frame.supports if s.at == at for d in s.fixed)}
        names = [at.member] if at.member else frame.ends_at(str(at.joint))
        wide = max((_gyration(frame.members[frame.member_index[n]]) for n in names), default=0.0)
        for axis in (axis for axis in _axes_of(frame) if axis not in held):
            turned = wide**2 * sum(k for d, k in across.items() if d in set("xyz") - {axis[1]})
            found += [GroundSpring(at, axis, turned)] if turned else []
    return found


def _along(spring: GroundSpring) -> str:
    """Return where a spring is, on a joint or a member, and its direction."""
    return f"{spring.at.joint or spring.at.member} {spring.direction.lstrip('+-')}"


def _spread(mass: PointMass, share: float) -> tuple[PointMass, ...]:
    """Return a mass as six of its sixths, with a share of the inertia of a cube of steel."""
    if not share:
        return (mass,)
    # A cube has m a^2 / 6 about every axis, six sixths at a radius r have 2 m r^2 / 3.
    radius = 0.5 * np.sqrt(share) * np.cbrt(mass.mass / settings.budget_known[5])
    arms = radius * np.vstack([np.eye(3), -np.eye(3)]) + mass.offset
    return tuple(PointMass(mass.at, mass.mass / 6.0, (x, y, z)) for x, y, z in arms.tolist())


def _alone(
    place: str, kind: str, term: Term, std: float, quantities: tuple[str, ...], at: tuple[str, ...]
) -> Entry:
    """Return an entry of one number, in the name of what it is at."""
    return Entry(place, kind, (*quantities, *at)[:1], (term,), np.array([[std]]), quantities, at)


def with_slices(entries: Sequence[Entry]) -> list[tuple[Entry, slice]]:
    """Return every entry with its place among the coordinates."""
    ends = np.cumsum([0, *(len(entry.names) for entry in entries)]).tolist()
    return [(e, slice(*own)) for e, own in zip(entries, pairwise(ends), strict=True)]
