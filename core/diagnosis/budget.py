"""What a drawing gets wrong of the structure that it stands for: a budget of its frequency errors.

The handbook says what it knows. Then all that drawings of real structures lack is fitted at once to
the used modes, each with the room that the drawing leaves it. A joint zone may be stiffer or softer
about every axis, with the drawing in the middle: the arm of half a depth, a wall that gives and a
gusset are one net number, for data cannot tell them apart. Modulus, density and masses have little
room, for they take what is not theirs. Most joints and masses lack little, and a few much: their
priors have tails. What the data do not see stays as drawn.

Source: Tarantola (2005), section 3.2, the most probable point of an iterated linear-Gaussian model;
Lange, Little & Taylor (1989) for the tails; Aumann & Shapley (1974) for the shares of what is
fitted together.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from types import SimpleNamespace
from typing import Literal, cast

import numpy as np
import scipy.linalg as la
from msgspec import structs

from femubench.core.case.case import Case
from femubench.core.change.change import Change
from femubench.core.change.hypothesis import Hypothesis
from femubench.core.change.parameter import Parameter
from femubench.core.change.terms import ElementOperator, Term
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.textbook import textbook_values
from femubench.core.fem.beam import BEND_XY, BEND_XZ, TWIST
from femubench.core.fem.frame import (
    ACTIVE,
    MADE,
    Factor,
    Frame,
    GroundSpring,
    Place,
    PointMass,
    RigidEnd,
    halves_of,
)
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.joints import (
    Joints,
    half_depth,
    joint_groups,
    whole_members,
    without_overlaps,
)
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.slopes import Matrix
from femubench.core.fem.structure import Structure
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.fit.modal_fit import Problem, State, bounds_of, fit, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.projection import Projection
from femubench.core.fit.residuals import Data
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.model_error import general_slopes
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import zero_tolerance
from femubench.core.modal.group_prior import GroupPriors
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import Advice, BudgetLine, BudgetMode
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray, IntArray

# Of every axis of a joint zone the displacements of an element, and what a factor multiplies.
_JOINTS, _SPRINGS, _LUMPS = "joint stiffness", "springs to ground", "rotary inertia of masses"
_MASSES = "joint mass"
_TAILED = (_JOINTS, _SPRINGS, _LUMPS, _MASSES)  # of most a drawing lacks little, of a few much
_WHOLES = ("E", "GJ", "density")  # of everything
_AXES = {"rx": (TWIST, "GJ"), "ry": (BEND_XZ, "bending ry"), "rz": (BEND_XY, "bending rz")}
Source = Literal["handbook", "data", "drawing"]
_Parts = Sequence[Projection]


@dataclass(frozen=True)
class Entry:
    """What a drawing leaves open of one class at one place: some numbers with a common prior.

    Arguments:
        place, kind: of the line of the budget that it belongs to.
        names: of the numbers, (q,).
        terms: what each changes.
        root: of their prior covariance, of ln(factor) or in kg, (q, q).
        quantities: the factor of a frame that each is; of masses none.
        at: elements with these factors, ``all``, or joints with the mass.
    """

    place: str
    kind: str
    names: tuple[str, ...]
    terms: tuple[Term, ...]
    root: FloatArray
    quantities: tuple[str, ...]
    at: tuple[str, ...]

    def grow(self, x: FloatArray) -> FloatArray:
        """Return the factors of the terms at coordinates, (g, q) both."""
        moved = x @ self.root.T
        return np.asarray(np.expm1(moved) if self.quantities else moved)

    @property
    def hypothesis(self) -> Hypothesis:
        """Return it as what a fit takes; a mass cannot be negative."""
        lower = -np.inf if self.quantities else 0.0
        own = tuple(Parameter(n, "", 1.0, lower=lower, reach=np.inf) for n in self.names)
        change = Change(self.terms, self.grow, name=self.kind, places=(self.place,), parameters=own)
        return Hypothesis(cast(Effect, SimpleNamespace(name=self.kind)), change, 1)

    def list_seen(self, covariance: FloatArray) -> list[bool]:
        """Tell of which numbers the data take away enough of the prior variance.

        Arguments:
            covariance: of the coordinates by data and prior, (q, q).
        """
        left = variance_of(self.root, covariance)
        prior = np.square(self.root).sum(axis=1)
        return [bool(share >= settings.budget_seen) for share in 1.0 - left / prior]


@dataclass(frozen=True)
class Budget:
    """A budget of errors, and the model that it leads to.

    Arguments:
        lines: by place and class, largest first.
        modes: those of the measurement.
        start: the drawing with the handbook.
        entries: all that it leaves open.
        state: on all measured modes; its parts are the entries at what the data see.
        covariance: of their coordinates, (k, k).
    """

    lines: tuple[BudgetLine, ...]
    modes: tuple[BudgetMode, ...]
    start: Model
    entries: tuple[Entry, ...]
    state: State
    covariance: FloatArray

    @cached_property
    def extended(self) -> Model:
        """Return the drawing with the handbook, and with all that the data see."""
        return self.model_at(self.state.x)

    def model_at(self, x: FloatArray) -> Model:
        """Return it with other coordinates of the entries, taken within their bounds, (k,)."""
        return extend_model(self.start, self.entries, np.clip(x, *bounds_of(self.state.parts)))

    @property
    def loose(self) -> FloatArray:
        """Return the covariance of the coordinates with what each of them idealises, (k, k)."""
        ideal = np.square(settings.own_error_of_change * self.state.x)
        return np.asarray(0.5 * (self.covariance + self.covariance.T) + np.diag(ideal))

    @property
    def hidden_percent(self) -> float:
        """Return the rms change of the frequencies below which no defect shows next to it."""
        left = [mode.left_percent for mode in self.modes if mode.used]
        least = float(np.sqrt(np.mean(np.square(left))))
        return settings.visible_deviations * max(least, 100.0 * settings.budget_rest[0])


def budget_of(case: Case, effects: Iterable[Effect]) -> Budget | None:
    """Return what the drawing of a case lacks; None for matrices without groups.

    Arguments:
        case: only its used modes are fitted; the others are predicted.
        effects: whose handbook values come first.

    Raises:
        NotApplicable: when a frequency has no standard deviation.
        ModelError: when the model has no modes.
    """
    return budget_of_modes(case.model, case.measurement, case.used, effects)


def budget_of_modes(
    drawing: Model, every: Measurement, numbers: Sequence[int], effects: Iterable[Effect]
) -> Budget | None:
    """Return what a drawing lacks, as `budget_of`.

    Arguments:
        every: measured modes.
        numbers: of those that are fitted.

    Examples:
        >>> found = diagnosis.budget_of_modes(model, measurement, [1, 2], diagnosis.list_effects())
        >>> len(found.modes) == len(measurement)
        True
    """
    model = drawing
    if model.structure is None and not model.groups:
        return None
    if model.structure is not None and model.structure.frame.supports:
        # Scales show what is held too, such as a base plate, which moves in no mode.
        every = replace(every, total_mass=None)
    start = _as_it_is(model, every)
    # What the drawing has as a rigid motion has no ratio of frequencies, and which of its modes one
    # without a shape is, that no fit has seen, nobody knows where others have theirs.
    out = start.problem.space.still(start.eigenvalues[start.partner])
    shaped = np.isfinite(every.shapes).any(axis=0)
    if shaped.any():
        out |= ~shaped & ~np.isin(every.numbers, numbers)
    every = every.select([n for n, without in zip(every.numbers, out, strict=True) if not without])
    used = [number for number in numbers if number in every.numbers]
    if not used:
        return None
    if out.any():
        start = _as_it_is(model, every)
    drawn, model = np.log(np.abs(start.frequencies[start.partner])), halve_zones(model)
    last = log_frequencies(start if model is drawing else _as_it_is(model, every))
    lines = [_line("all", "mesh", last - drawn, np.zeros((len(every),) * 2), "handbook")]

    def take(place: str, name: str, better: Model, share: float) -> None:
        nonlocal model, last
        now = log_frequencies(_as_it_is(better, every))
        std = share * np.abs(now - last)
        lines.append(_line(place, name, now - last, np.outer(std, std), "handbook"))
        model, last = better, now

    for effect in effects:
        for place, values in textbook_values(effect, model).items():
            better = cast(Model, effect.extend(model, place, values))
            take(place, effect.name, better, settings.budget_handbook)
    for group in joint_groups(model.structure.frame) if model.structure else ():
        cut = without_overlaps(model.frame_structure, group)
        if cut is not model.frame_structure:
            take(group.type, "overlap of members", Model.of(cut), settings.own_error_of_change)
    joints = defaultdict[str, list[str]](list)
    if model.structure:
        for (place, role), ends in _ends_of_joints(model.structure.frame).items():
            joints[place] += ends if role != "foot" else ()
    for place, ends in joints.items():
        better = with_arms(model, ends)
        if better is not model:
            take(place, "arms of joints", better, settings.own_error_of_change)
    entries = list_entries(model)
    hypotheses = [entry.hypothesis for entry in entries]
    problem, parts = _pose(model, every.select(used), hypotheses, every)
    fitted = _fit_with_tails(problem, parts, entries)
    if fitted is None:
        return None
    x, covariance = fitted
    wide, places = _pose(model, every, hypotheses, every)
    state = state_at(wide, places, x)
    slopes, found = frequency_slopes(state), log_frequencies(state)
    fresh = _share_out(entries, state, slopes, covariance)
    variance = variance_of(slopes, covariance)
    # A used mode was fitted with all that its lines idealise, another was not.
    shares = np.array([line.percent for line in fresh]) / 100.0
    ideal = np.square(settings.own_error_of_change * shares).sum(axis=0)
    deviation = np.sqrt(variance + np.where(np.isin(every.numbers, used), 0.0, ideal))
    lines += fresh
    measured = np.log(every.frequencies)
    figures = 100.0 * np.column_stack([measured - drawn, measured - found, deviation])
    rows = zip(every.numbers, figures.tolist(), strict=True)
    modes = tuple(BudgetMode(number, number in used, *row) for number, row in rows)
    lines.sort(key=lambda line: -abs(line.rms_percent))
    return Budget(tuple(lines), modes, model, tuple(entries), state, covariance)


def _fit_with_tails(
    problem: Problem, parts: _Parts, entries: Sequence[Entry]
) -> tuple[FloatArray, FloatArray] | None:
    """Return the most probable coordinates, (k,), and their covariance; None where no fit stands.

    A normal prior whose width is known to its order alone is Cauchy's, of all numbers of an entry
    together: fit and widths follow in turn, each given the other.

    Source: Lange, Little & Taylor (1989), JASA 84, 881-896, for one degree of freedom.
    """
    split = _split(entries)
    x = np.zeros(sum(len(entry.names) for entry in entries))
    width = np.ones(len(x))
    problem = _with_rest(state_at(problem, parts, x))
    for _ in range(settings.scale_steps[1]):
        own = [e.root * width[at] for e, at in zip(entries, split, strict=True)]
        scaled = [replace(e, root=root).hypothesis for e, root in zip(entries, own, strict=True)]
        posed = [replace(p, hypothesis=h) for p, h in zip(parts, scaled, strict=True)]
        found = fit(problem, posed, x / width)
        if found is None:
            return None
        x, before = width * found.state.x, width.copy()
        covariance = found.covariance * np.outer(width, width)
        # What is left beyond the noise makes all of it less sure (Birge 1932).
        excess = max(1.0, found.state.chi2 / len(problem.data))
        size = np.square(x) + covariance.diagonal()
        for entry, at in zip(entries, split, strict=True):
            if entry.kind in _TAILED:
                width[at] = np.sqrt((1.0 + size[at].sum()) / (1.0 + len(entry.names)))
        if np.allclose(width, before, rtol=settings.budget_rest[0]):
            break
        problem = _with_rest(found.state)
    return x, covariance * excess


def extend_model(model: Model, entries: Sequence[Entry], x: FloatArray) -> Model:
    """Return a model with some entries at coordinates, (k,)."""
    if model.structure is not None:
        return Model.of(model.structure.rebuilt(extend_frame(model.structure.frame, entries, x)))
    factors = [Property(entry.kind, entry.quantities[0], (entry.place,)) for entry in entries]
    pairs = zip(entries, _split(entries), strict=True)
    grown = [1.0 + entry.grow(x[None, own])[0, 0] for entry, own in pairs]
    return Groups(model).with_factors(factors, grown)


def extend_frame(frame: Frame, entries: Sequence[Entry], x: FloatArray) -> Frame:
    """Return a frame with some entries at coordinates, (k,), as factors, masses and springs.

    Changes of the matrices add up, as in the fit, where factors of a frame multiply.
    """
    everywhere, held, inertia = dict[str, float](), dict[str, float](), dict[str, float]()
    zones, added = defaultdict[tuple[str, str], float](float), list[PointMass]()
    for entry, own in zip(entries, _split(entries), strict=True):
        values = entry.grow(x[None, own])[0].tolist()
        if entry.kind == _JOINTS:
            for quantity, value in zip(entry.quantities, values, strict=True):
                for label in entry.at:
                    zones[quantity, label] += value
        elif entry.kind == _SPRINGS:
            held |= {name: 1.0 + value for name, value in zip(entry.names, values, strict=True)}
        elif entry.kind == _LUMPS:
            inertia[entry.place] = values[0]
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
    masses += added
    return replace(frame, factors=wanted, masses=tuple(masses), springs=tuple(springs))


def halve_zones(model: Model) -> Model:
    """Return a model whose elements at joints are halves where a joint zone is no longer.

    A zone as long as a coarse element would act on modes that hardly bend the joint.
    """
    structure = model.structure
    if structure is None:
        return model
    halves: dict[str, None] = {}
    for end in (end for ends in _ends_of_joints(structure.frame).values() for end in ends):
        rows, reach = _zone(structure, end)
        element = structure.labels[rows[0]]
        # The middle of the other half lies behind the zone.
        if 0.75 * structure.properties.length[rows[0]] > reach:
            halves[halves_of(element)[structure.element_ends[end][1]]] = None
    if not halves:
        return model
    factors = (*structure.frame.factors, Factor(_WHOLES[0], tuple(halves), 1.0))
    halved = Model.of(structure.rebuilt(replace(structure.frame, factors=factors)))
    return halved if halved.size <= settings.most_dofs else model


def with_arms(model: Model, ends: Iterable[str]) -> Model:
    """Return a frame with members rigid up to the faces of what they meet, and soft behind.

    Under a constant moment a zone turns as drawn, so that what no data see stays as drawn; but what
    gives does so at a face, where moments are others than at the crossing of centre lines.
    """
    structure = model.frame_structure
    frame, joints, named = structure.frame, Joints(structure), _labels(structure)
    rigid = {f"{one.member}@{one.joint}": one for one in frame.rigid_ends}
    soft = defaultdict[float, dict[str, None]](dict)
    for end in ends:
        member, _, joint = end.rpartition("@")
        there = rigid.get(end, RigidEnd(joint, member, 0.0))  # its overlap may be out
        arm = min(joints.half_depth(end), joints.available_length(end))
        if arm > 0.0 == there.stiffness_length:
            rows, _ = _zone(structure, end)
            share = round(1.0 - arm / float(structure.properties.length[rows].sum()), 6)
            rigid[end] = replace(there, stiffness_length=arm)
            soft[share] |= dict.fromkeys(named[row] for row in rows.tolist())
    if not soft:
        return model
    factors = (Factor(_WHOLES[0], tuple(labels), share) for share, labels in soft.items())
    changed = replace(frame, rigid_ends=tuple(rigid.values()), factors=(*frame.factors, *factors))
    return Model.of(structure.rebuilt(changed))


def _labels(structure: Structure) -> dict[int, str]:
    """Return by element what the factors of a frame call it."""
    return {row: at for at, own in structure.place_index.items() for row in own.tolist()}


def list_entries(model: Model) -> list[Entry]:
    """Return all that a drawing leaves open: joint zones, E, masses, springs; or groups."""
    if model.structure is None:
        return _list_groups(model)
    structure = model.structure
    frame = structure.frame
    p = structure.properties
    stiff, heavy = p.stiffness_matrices(), p.mass_matrices()
    found, (unknown, passing, correlation, _) = [], settings.budget_joints
    widths = dict(zip(MADE, settings.budget_made, strict=True))
    made = {kind.type: widths[kind.made] for kind in frame.joint_kinds}
    named = _labels(structure)
    for (place, role), ends in _ends_of_joints(frame).items():
        rows = np.unique(np.concatenate([_zone(structure, end)[0] for end in ends]))
        labels = tuple(named[row] for row in rows.tolist())
        terms = {}
        for axis in (axis for axis in ACTIVE[frame.plane] if axis in _AXES):
            own = _AXES[axis][0]
            index = slice(None), own[:, None], own
            blocks = np.zeros((len(rows), 12, 12))
            blocks[index] = stiff[rows][index]
            if np.abs(blocks).max():
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
    every = np.arange(len(structure.properties))
    twist = np.zeros_like(stiff)
    index = slice(None), TWIST[:, None], TWIST
    twist[index] = stiff[index]
    *wholes, mass = settings.budget_known[:4]
    for quantity, blocks, std in zip(_WHOLES, (stiff, twist, heavy), wholes, strict=True):
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


def _list_groups(model: Model) -> list[Entry]:
    """Return the groups of matrices, each with the prior of its own, or density for all masses."""
    found = []
    groups, priors = Groups(model), GroupPriors(model)
    pairs: tuple[tuple[Matrix, str], ...] = ("stiffness", "E"), ("mass", "density")
    for matrix, quantity in pairs:
        for place in groups.places(matrix):
            std = priors.std(place.removeprefix(groups.PREFIX), matrix)
            term = Term.of(matrix, groups.matrix(matrix, place))
            found.append(_alone(place, matrix, term, std, (quantity,), ()))
    if not model.mass_groups:
        term = Term.of("mass", model.mass)
        quantity = _WHOLES[-1]
        found.append(_alone("all", quantity, term, settings.budget_known[2], (quantity,), ()))
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


def _split(entries: Sequence[Entry]) -> list[slice]:
    """Return which coordinates belong to each entry."""
    ends = np.cumsum([0, *(len(entry.names) for entry in entries)]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]


def _ends_of_joints(frame: Frame) -> dict[tuple[str, str], list[str]]:
    """Return ``member@joint`` by joint type and role; a foot is an end that is held alone.

    Where a member only goes on there is no joint.
    """
    found: dict[tuple[str, str], list[str]] = {}
    within = {name: pieces for pieces in whole_members(frame) for name in pieces}
    for group in joint_groups(frame):
        for end in group.ends:
            ends = frame.ends_at(end.rpartition("@")[2])
            if len(ends) > 2 or len({within[name] for name in ends}) > 1:
                found.setdefault((group.type, group.role), []).append(end)
    held = {str(s.at) for s in frame.supports} | {str(s.at) for s in frame.springs}
    for joint in frame.joints:
        ends = frame.ends_at(joint.name)
        if joint.name in held and len(ends) == 1:
            found.setdefault((joint.family, "foot"), []).append(f"{next(iter(ends))}@{joint.name}")
    return found


def _zone(structure: Structure, end: str) -> tuple[IntArray, float]:
    """Return the elements of a joint at a member end, one at least, (k,), and its length in m.

    They reach half the depth of what crosses, and once the own depth, from the centre of the joint.
    """
    frame, mesh = structure.frame, structure.mesh
    name, _, joint = end.rpartition("@")
    number = frame.member_index[name]
    own = np.flatnonzero(mesh.member == number)
    own = own[np.argsort(mesh.stations[own, 0])]
    own = own[[bool(structure.labels[row]) for row in own]]
    if structure.element_ends[end][1] == 1:
        own = own[::-1]
    section, length = frame.members[number].section, structure.properties.length[own]
    crossing = half_depth(frame, end) if len(frame.ends_at(joint)) > 1 else 0.0
    reach = crossing + max(section.height or 0.0, section.width or 0.0)
    reach = min(reach, settings.budget_joints[3] * float(length.sum()))
    inside = np.cumsum(length) - 0.5 * length < reach
    inside[0] = True
    return np.asarray(own[inside]), reach


def _pose(
    model: Model, measurement: Measurement, hypotheses: Sequence[Hypothesis], every: Measurement
) -> tuple[Problem, _Parts]:
    """Return some modes in the coordinates of a model.

    Arguments:
        every: all measured modes, which the coordinates serve.
    """
    modes, bias = modes_for(model), mesh_bias(model, 2 * len(every) + settings.spare_modes)
    still = modes.rigid | (modes.eigenvalues <= zero_tolerance(modes))
    data = Data(measurement, np.zeros(0) if bias is None else bias, int(still.sum()))
    problem = place_data(model, data, Noise(np.eye(len(data))), hypotheses)
    return problem, problem.space.projections


def _with_rest(state: State) -> Problem:
    """Return the problem of a state with what no class of a budget is as noise.

    It is in every reading, and it couples the modes, so that close ones have less certain shapes.
    """
    data, (rest_f, rest_s) = state.problem.data, settings.budget_rest
    mode, _ = data.shape_rows
    count, largest = len(data.measurement), np.abs(data.shapes).max(axis=0, initial=0.0)
    rest = np.zeros(len(data))
    rest[count:][: len(mode)] = rest_s * largest[mode]
    coupled = 2.0 * rest_f * general_slopes(state)
    total = np.diag(1.0 + np.square(rest / data.std)) + coupled @ coupled.T
    least = 1.0 + np.square(rest_f * data.measurement.frequencies / data.std[:count])
    at = np.arange(count)  # beyond the modes that random changes couple
    total[at, at] = np.maximum(total[at, at], least)
    return replace(state.problem, noise=Noise(np.asarray(la.cholesky(total, lower=True))))


def _as_it_is(model: Model, every: Measurement) -> State:
    return state_at(_pose(model, every, (), every)[0], (), np.zeros(0))


def log_frequencies(state: State) -> FloatArray:
    """Return ln of the frequency of the partner of every measured mode, (m,)."""
    hertz, _ = state.predicted
    return np.asarray(np.log(np.abs(hertz[0, state.partner])))


def advise_modes(budget: Budget, case: Case) -> tuple[Advice, ...]:
    """Return the modes that say most of what the drawing lacks, if they were used too.

    Of as many further modes as are used; the separation is the variance of a mode's prediction in
    those of what no class of a budget is.
    """
    state, count = budget.state, len(case.used)
    numbers = np.array([mode.mode for mode in budget.modes])
    used = state.partner[[mode.used for mode in budget.modes]]
    moving = np.flatnonzero(~state.problem.space.still(state.eigenvalues))
    further = np.setdiff1d(moving, used)[:count]
    variance = variance_of(frequency_slopes(state, further), budget.covariance)
    separation = variance / settings.budget_rest[0] ** 2
    space, labels = state.problem.space, case.measurement.sensors.labels
    seen = np.abs(space.pad_readings(len(state.vectors)) @ state.vectors[:, further])
    found = []
    rows = zip(further, separation, np.sqrt(variance), seen.T, strict=True)
    for mode, size, std, reading in rows:
        if size < settings.visible_deviations:  # hardly more than is not known anyhow
            continue
        hertz = state.frequencies[mode]
        low, high = hertz * (1.0 - std), hertz * (1.0 + std)
        where = " and ".join(labels[i] for i in np.argsort(-reading)[: settings.least_modes])
        held = numbers[state.partner == mode].tolist()
        what = f"use mode {held[0]}" if held else "measure and use the mode"
        text = f"{what} between {low:.4g} and {high:.4g} Hz, where {where} move most"
        found.append(Advice(text, float(size)))
    return tuple(in_order(found, lambda advice: -advice.separation))[: settings.of_a_kind]


def loosest_mode(budget: Budget) -> int | None:
    """Return the unused mode whose frequency is known least; None where all are known well."""
    variance = variance_of(frequency_slopes(budget.state), budget.covariance)
    variance = np.where([mode.used for mode in budget.modes], 0.0, variance)
    row = int(variance.argmax())
    least = settings.visible_deviations * settings.budget_rest[0] ** 2
    return budget.modes[row].mode if variance[row] >= least else None


def frequency_slopes(state: State, modes: IntArray | None = None) -> FloatArray:
    """Return d ln f / d x of the partner of every measured mode, or of other modes, (m, k)."""
    modes = state.partner if modes is None else modes
    values, near = state.eigenvalues[modes], state.vectors[:, modes]
    forces, _ = state.problem.space.forces(state.parts, state.x, near, values)
    return np.asarray(np.einsum("nm,nmk->mk", near, forces) / (2.0 * values[:, None]))


def variance_of(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the variance of values by their slopes in the coordinates, (m, k), as (m,)."""
    return np.asarray(np.einsum("mk,kl,ml->m", slopes, covariance, slopes))


def _share_out(
    entries: Sequence[Entry], state: State, slopes: FloatArray, covariance: FloatArray
) -> list[BudgetLine]:
    """Return the lines of what was fitted, which add up to all that it changes.

    Each entry has the integral of its slope on the straight way from the drawing (Aumann & Shapley
    1974), by Simpson's rule; what that misses goes to the lines by their size.
    """
    x, problem, parts = state.x, state.problem, state.parts
    start, half = (state_at(problem, parts, t * x) for t in (0.0, 0.5))
    first, middle = frequency_slopes(start), frequency_slopes(half)
    each = (first + 4.0 * middle + slopes) / 6.0 * x
    missing = log_frequencies(state) - log_frequencies(start) - each.sum(axis=1)
    total = np.abs(each).sum(axis=1)
    each += np.abs(each) * (missing / np.where(total > 0.0, total, 1.0))[:, None]
    lines: dict[tuple[str, str], list[tuple[Entry, slice]]] = {}
    for entry, one in zip(entries, _split(entries), strict=True):
        lines.setdefault((entry.place, entry.kind), []).append((entry, one))
    found = []
    for (place, kind), owners in lines.items():
        own = np.concatenate([np.arange(len(x))[one] for _, one in owners])
        spread = slopes[:, own] @ covariance[np.ix_(own, own)] @ slopes[:, own].T
        sees = {
            name: seen
            for entry, one in owners
            for name, seen in zip(entry.names, entry.list_seen(covariance[one, one]), strict=True)
        }
        unseen = tuple(name for name, seen in sees.items() if not seen)
        share = each[:, own].sum(axis=1)
        # A zone, or a point mass, is an idealisation of what is there.
        spread = spread + np.outer(share, share) * settings.own_error_of_change**2
        line = _line(place, kind, share, spread, "data", unseen)
        moved = len(unseen) < len(sees) or abs(line.rms_percent) > line.rms_std
        found.append(line if moved else structs.replace(line, source="drawing"))
    return found


def _line(
    place: str,
    kind: str,
    share: FloatArray,
    covariance: FloatArray,
    source: Source,
    unseen: tuple[str, ...] = (),
) -> BudgetLine:
    """Return a line from its share in ln f of every mode, and the covariance of that."""
    rms = float(np.sqrt(np.mean(np.square(share))))
    std = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    # Of the root mean square: along the share itself; of no share, that of one drawn at random.
    along = share / np.sqrt(len(share)) / rms if rms > 0.0 else np.zeros(len(share))
    spread = np.sqrt(along @ covariance @ along / len(share)) if rms else np.sqrt(np.mean(std**2))
    rms = -rms if share.sum() < 0.0 else rms
    percent = tuple((100.0 * share).tolist()), tuple((100.0 * std).tolist())
    return BudgetLine(place, kind, *percent, 100.0 * rms, 100.0 * float(spread), source, unseen)
