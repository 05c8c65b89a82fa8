"""What a drawing lacks, mode by mode: features out of the solid, refinements into the drawing.

e = ln f(solid) - ln f(drawing). A feature's contribution is the mean of what it does alone, as the
first, and as the last; half the difference is its spread. Features of one class and place come in
all orders: a gusset on walls that bend does other than on a rigid block. The rest is the remainder.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import combinations
from math import comb

import numpy as np
import numpy.typing as npt

from femubench import Model, Sensors, read_case, solve_modes
from femubench.fem import Frame, ModelError, RigidEnd
from truths.bricks import brick_mesh
from truths.elasticity import Matrices, reweighed
from truths.lacks import STIFFNESS, Feature, ends_at, features_of, in_overlap, joints_by_type
from truths.measurement import mac, paired
from truths.modes_of import SHARES, SPARE, Observed, assembled, modes_of
from truths.posing import SUITE
from truths.reduction import PLANES
from truths.section_features import Refinement, Sections, constants
from truths.solid import Solid
from truths.structure import Block, Member, Structure

Array = npt.NDArray[np.float64]
CLOSENESS = 2.0  # weight of frequencies where states are paired by shape
FINER = 4  # elements of the fine drawing for one of the drawn one, at most
ROOM = 1.05  # of an arm, which the first element of a member must hold
State = tuple[Array, Array]  # frequencies, Hz, and shapes at stations, a row a mode
Made = tuple[tuple[Member, ...], tuple[Block, ...]]


@dataclass(frozen=True)
class Share:
    """Hold what one feature does to each mode's ln f as the first and as the last, (modes,).

    Arguments:
        side: `"solid"` where it was taken out, `"drawing"` where it was put in.
    """

    kind: str
    place: str
    what: str
    side: str
    first: Array
    last: Array


@dataclass(frozen=True)
class Budget:
    """Hold all that a drawing lacks.

    Arguments:
        solid, drawing: frequencies of paired modes, (modes,), Hz.
        shares: of every feature.
        alike: MAC of the ideal solid and the ideal drawing in each mode, (modes,).
    """

    solid: Array
    drawing: Array
    shares: tuple[Share, ...]
    alike: Array


class Solids:
    """Solve a solid with some of its features taken out, on one grid of planes."""

    def __init__(self, structure: Structure) -> None:
        if structure.mesher != "bricks" or structure.oscillators:
            raise ValueError(f"{structure.name}: counterfactuals need bricks and no oscillator")
        self.structure = structure
        self.meshed = lru_cache(maxsize=2)(self._meshed)
        self.matrices = lru_cache(maxsize=4)(self._matrices)

    def _meshed(self, made: Made) -> tuple[Solid, Matrices]:
        built = replace(self.structure, members=made[0], blocks=made[1])
        solid = brick_mesh(built, self.structure.size[0], self.structure)
        return solid, assembled(self.structure, solid)

    def _matrices(
        self, made: Made, drawn_mass: tuple[str, ...], massless: tuple[str, ...]
    ) -> Matrices:
        solid, matrices = self.meshed(made)
        light = [part for part in solid.parts if part.startswith(massless)]
        solid = solid.scaled(solid.of_part(*light), mass=0.0)
        for joint in drawn_mass:
            solid = weighing_as_drawn(self.structure, solid, joint)
        return reweighed(matrices, solid, self.structure.warped(solid.points))

    def solve(self, features: list[Feature]) -> Observed:
        """Return the modes without some features."""
        built = self.structure
        for feature in features:
            built = feature.change(built)
        names = ("drawn_mass", "massless", "rigid")
        drawn_mass, massless, rigid = (sum((getattr(f, n) for f in features), ()) for n in names)
        matrices = self.matrices((built.members, built.blocks), drawn_mass, massless)
        inside = [in_overlap(self.structure, joint, matrices.straight) for joint in rigid]
        bodies, count = [np.flatnonzero(body) for body in inside], built.used + built.held_out
        return modes_of(built, matrices, count, mixed=True, bodies=bodies)


def weighing_as_drawn(structure: Structure, solid: Solid, joint: str) -> Solid:
    """Return a solid of which the overlap at a joint has the mass of the centre lines in it."""
    cells = in_overlap(structure, joint, solid.centres)
    volume = np.ptp(solid.points[:, solid.cells[:, cells]], axis=1).prod(axis=0)
    wanted = sum(
        structure.materials[member.material].rho
        * constants(structure.sections[member.section].rectangles).area
        * face
        for member, _, face in ends_at(structure, joint)
    )
    return solid.scaled(cells, mass=float(wanted / (volume @ solid.density[cells])))


def arms(structure: Structure, joint: str) -> Iterable[RigidEnd]:
    """Yield the rigid ends of half a depth at a joint."""
    start = structure.point(joint)
    for member, end, face in ends_at(structure, joint):
        inwards = structure.axes(member)[0][0] * (1 if end == 0 else -1)
        real = structure.warped(np.array([start, start + face * inwards]).T)
        if face > 0.0:
            yield RigidEnd(joint, member.name, float(np.linalg.norm(real[:, 1] - real[:, 0])))


class Drawings:
    """Solve a drawing with some refinements put in.

    Arguments:
        refinements: each by class, place and words.
    """

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.frame = read_case(SUITE / structure.name).model.frame_structure.frame
        self.refinements: dict[Refinement, Callable[[Frame], Frame]] = {}
        longest, held = dict[str, float](), {clamp.at for clamp in structure.clamps}
        for kind, joints in joints_by_type(structure).items():
            held |= {*joints}
            ends = tuple(arm for joint in joints for arm in arms(structure, joint))
            for arm in ends:
                longest[arm.member] = max(longest.get(arm.member, 0.0), arm.stiffness_length)
            self.refinements[STIFFNESS, f"type:{kind}", "arms of half a depth"] = partial(
                _armed, longest=longest, ends=ends
            )
        finer = partial(_divided, longest=longest, finer=FINER)
        self.refinements["mesh", "all", "elements of finite length"] = finer
        if self.frame.beam == "euler-bernoulli":
            theory = partial(replace, beam="timoshenko", bending_mass="shear-consistent")
            self.refinements["shear-deformation", "all", "shear and rotary inertia"] = theory
        self.sections = Sections(structure, self.frame, held)
        self.refinements |= self.sections.refinements()

    def solve(self, names: Iterable[Refinement]) -> State:
        """Return the elastic modes of the drawing with some refinements."""
        frame, structure = self.frame, self.structure
        names, count = list(names), structure.used + structure.held_out
        for name in names:
            frame = self.refinements[name](frame)
        try:
            model = self.sections.refine(Model.of(frame), names)
        except ModelError as error:
            raise ValueError(f"{structure.name}: {error}") from error
        modes = solve_modes(model, min(count + SPARE + 6, model.size)).elastic
        corners, along = {j.name: np.array(j.xyz) for j in frame.joints}, PLANES[structure.plane]
        chords = [[corners[j] for j in m.ends] for m in structure.solid_members]
        xyz = np.array([a + share * (b - a) for a, b in chords for share in SHARES])
        points = np.repeat(xyz, len(along), axis=0)
        directions = tuple("xyz"[axis] for axis in along) * len(xyz)
        sensors = Sensors(tuple(map(str, range(len(points)))), points, directions)
        return modes.natural_frequencies, (model.observe(sensors) @ modes.shapes).T


def _divided(frame: Frame, longest: Mapping[str, float], finer: int) -> Frame:
    """Return a frame of other elements, of which the outer ones hold their members' arms."""
    corners = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    members = []
    for member in frame.members:
        start, end = (corners[joint] for joint in member.ends)
        arm = ROOM * longest.get(member.name, 1e-6)
        room = max(int(float(np.linalg.norm(end - start)) / arm), 1)
        least = member.elements if finer > 1 else 1
        elements = max(least, min(finer * member.elements, room))
        members.append(replace(member, elements=elements))
    return replace(frame, members=tuple(members))


def _armed(frame: Frame, longest: Mapping[str, float], ends: tuple[RigidEnd, ...]) -> Frame:
    return replace(_divided(frame, longest, 1), rigid_ends=(*frame.rigid_ends, *ends))


def shapley(
    value: Callable[[frozenset[int]], Array], item: int, group: set[int], out: Iterable[int]
) -> Array:
    """Return what one of a group adds, on average over the orders in which the group comes in.

    Arguments:
        value: of a state by what is out of it.
        out: what is out at all times.

    Source: Shapley (1953), the value of an n-person game.
    """
    rest, size = group - {item}, len(group)
    total = np.zeros(())
    for count in range(size):
        weight = 1 / (size * comb(size - 1, count))
        for there in combinations(sorted(rest), count):
            absent = frozenset(out) | (rest - set(there))
            total = total + weight * (value(absent) - value(absent | {item}))
    return total


def budget_of(structure: Structure) -> Budget:
    """Return what the drawing of a structure lacks, features removed first and last.

    Raises:
        ValueError: where a state cannot be solved, or shows too few modes.
    """
    along, count = list(PLANES[structure.plane]), structure.used + structure.held_out
    features, solids, drawings = features_of(structure), Solids(structure), Drawings(structure)

    every, refined = frozenset(range(len(features))), frozenset(drawings.refinements)

    def followed(before: State, state: State) -> State:
        """Return the modes of a state that are those of the one before, by shape."""
        if len(state[0]) < count:
            raise ValueError(f"{structure.name}: {len(state[0])} modes of {count} in one state")
        partner = paired(before, state, CLOSENESS)
        return state[0][partner], state[1][partner]

    def solved(removed: frozenset[int]) -> State:
        modes = solids.solve([features[i] for i in sorted(removed)])
        shapes = modes.stations.reshape(len(modes.frequencies), -1, 3)[:, :, along]
        return modes.frequencies, shapes.reshape(len(shapes), -1)

    # From the solid to the ideal frame, to the ideal drawing, to the drawing: each step is small.
    hertz, shapes = solved(frozenset())
    lead = hertz[:count], shapes[:count]
    ideal = followed(lead, solved(every))
    finest = followed(ideal, drawings.solve(sorted(refined)))
    drawn = followed(finest, drawings.solve(()))

    @cache
    def solid(removed: frozenset[int]) -> Array:
        near = lead if 2 * len(removed) < len(every) else ideal
        return np.log(followed(near, solved(removed))[0])

    def drawing(names: frozenset[Refinement]) -> Array:
        near = drawn if 2 * len(names) < len(refined) else finest
        return np.log(followed(near, drawings.solve(sorted(names)))[0])

    shares = []
    for i, item in enumerate(features):
        group = {j for j in every if features[j].unit == item.unit}
        before = {j for j in every for k in group if features[j] is features[k].after}
        since = {j for j in every for k in group if features[j].after is features[k]}
        first, last = (shapley(solid, i, group, out) for out in (before, every - group - since))
        shares.append(Share(item.kind, item.place, item.what, "solid", first, last))
    for name in drawings.refinements:
        first = drawing(frozenset([name])) - np.log(drawn[0])
        last = np.log(finest[0]) - drawing(refined - {name})
        shares.append(Share(*name, "drawing", first, last))
    return Budget(lead[0], drawn[0], tuple(shares), mac(ideal[1], finest[1]).diagonal())
