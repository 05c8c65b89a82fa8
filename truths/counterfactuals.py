"""What a drawing lacks, mode by mode: features out of the solid, refinements into the drawing.

e = ln f(solid) - ln f(drawing). A feature's contribution is the mean of what it does alone, as the
first, and as the last; half the difference is its spread. What neither chain explains remains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import skfem

from femubench import Model, Sensors, read_case, solve_modes
from femubench.fem import Frame, RigidEnd, constant_kappa
from truths.bricks import brick_mesh
from truths.elasticity import Matrices
from truths.lacks import (
    MESH,
    SHEAR,
    STIFFNESS,
    TORSION,
    Built,
    Feature,
    ends_at,
    features_of,
    in_overlap,
    joints_by_type,
)
from truths.measurement import mac, paired
from truths.modes_of import SPARE, Observed, assembled, modes_of, stations
from truths.posing import SUITE
from truths.reduction import PLANES
from truths.sections import Section
from truths.solid import Solid
from truths.structure import Block, Structure

Array = npt.NDArray[np.float64]
CLOSENESS = 2.0  # weight of frequencies where states are paired by shape
FINER = 4  # elements of the fine drawing for one of the drawn one, at most
ROOM = 1.05  # of an arm, which the first element of a member must hold
Drawing = Callable[[Frame], Frame]


@dataclass(frozen=True)
class Share:
    """Hold what one feature does to each mode's ln f, and half of how first and last differ.

    Arguments:
        side: `"solid"` where it was taken out, `"drawing"` where it was put in.
        first, last: (modes,), as the first and as the last one.
    """

    kind: str
    place: str
    what: str
    side: str
    first: Array
    last: Array

    @property
    def contribution(self) -> Array:
        """Return the mean of first and last, (modes,)."""
        return (self.first + self.last) / 2


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

    @property
    def misfit(self) -> Array:
        """Return e = ln f(solid) - ln f(drawing), (modes,)."""
        return np.log(self.solid / self.drawing)

    @property
    def remainder(self) -> Array:
        """Return what no feature explains, (modes,)."""
        return np.asarray(self.misfit - sum(share.contribution for share in self.shares))


class Solids:
    """Solve a solid with some of its features taken out, on one grid of planes."""

    def __init__(self, structure: Structure, size: float) -> None:
        if structure.mesher != "bricks" or structure.oscillators:
            raise ValueError(f"{structure.name}: counterfactuals need bricks and no oscillator")
        self.structure, self.size = structure, size
        self.matrices = lru_cache(maxsize=4)(self._matrices)

    def _matrices(
        self, blocks: tuple[Block, ...], drawn_mass: frozenset[str], massless: frozenset[str]
    ) -> Matrices:
        solid = brick_mesh(replace(self.structure, blocks=blocks), self.size, self.structure)
        solid = solid.scaled(solid.of_part(*massless), mass=0.0)
        for joint in sorted(drawn_mass):
            solid = weighing_as_drawn(self.structure, solid, joint)
        return assembled(self.structure, solid)

    def solve(self, features: list[Feature]) -> Observed:
        """Return the modes without some features."""
        built = Built(self.structure)
        for feature in features:
            built = feature.out(built)
        matrices = self.matrices(built.structure.blocks, built.drawn_mass, built.massless)
        bodies = [
            np.flatnonzero(in_overlap(self.structure, joint, matrices.straight))
            for joint in sorted(built.rigid)
        ]
        count = self.structure.used + self.structure.held_out
        return modes_of(built.structure, matrices, count, mixed=True, bodies=bodies)


def weighing_as_drawn(structure: Structure, solid: Solid, joint: str) -> Solid:
    """Return a solid of which the overlap at a joint has the mass of the centre lines in it."""
    cells = in_overlap(structure, joint, solid.centres)
    volume = np.ptp(solid.points[:, solid.cells[:, cells]], axis=1).prod(axis=0)
    wanted = sum(
        structure.materials[member.material].rho
        * constants(structure.sections[member.section])[0]
        * face
        for member, _, face in ends_at(structure, joint)
    )
    return solid.scaled(cells, mass=float(wanted / (volume @ solid.density[cells])))


def constants(section: Section) -> tuple[float, float]:
    """Return area (m2) and torsion constant (m4) of a section's rectangles.

    Source: St Venant's warping function, J = min of the integral of |grad w + (-z, y)|^2.
    """
    mesh = _section_mesh(section)
    basis = skfem.CellBasis(mesh, skfem.ElementQuad2(), intorder=4)

    @skfem.BilinearForm
    def laplace(u, v, w):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        return u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1]

    @skfem.LinearForm
    def load(v, w):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        return w.x[1] * v.grad[0] - w.x[0] * v.grad[1]

    @skfem.Functional
    def polar(w):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        return w.x[0] ** 2 + w.x[1] ** 2

    @skfem.Functional
    def one(w):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
        return 1.0 + 0.0 * w.x[0]

    stiffness, force = laplace.assemble(basis), load.assemble(basis)
    warping = skfem.solve(*skfem.condense(stiffness, force, D=np.array([0])))
    return float(one.assemble(basis)), float(polar.assemble(basis) - force @ warping)


def _section_mesh(section: Section) -> skfem.MeshQuad:
    """Return a mesh of a section's rectangles, four cells across the thinnest, 16 in all."""
    lines = []
    for axis in (0, 2):
        edges = np.unique(np.round([r[axis + i] for r in section.rectangles for i in (0, 1)], 9))
        step = min(np.diff(edges).min() / 4, np.ptp(edges) / 16)
        pieces = [
            np.linspace(a, b, min(int(np.ceil((b - a) / step - 1e-6)), 24) + 1)[:-1]
            for a, b in pairwise(edges)
        ]
        lines.append(np.append(np.concatenate(pieces), edges[-1]))
    mesh = skfem.MeshQuad.init_tensor(*lines)
    y, z = mesh.p[:, mesh.t].mean(axis=1)
    solid = np.zeros(len(y), dtype=bool)
    for y0, y1, z0, z1, filled in section.rectangles:
        solid[(y > y0) & (y < y1) & (z > z0) & (z < z1)] = filled
    return mesh.restrict(np.flatnonzero(solid))


def arms(structure: Structure, joint: str) -> dict[str, RigidEnd]:
    """Return the rigid ends of half a depth at a joint, by member and end."""
    found = {}
    for member, end, face in ends_at(structure, joint):
        axes, _ = structure.axes(member)
        start = structure.point(joint)
        reach = np.array([start, start + face * axes[0] * (1 if end == 0 else -1)]).T
        real = structure.warped(reach)
        length = float(np.linalg.norm(real[:, 1] - real[:, 0]))
        if length > 0.0:
            found[f"{member.name}@{joint}"] = RigidEnd(joint, member.name, length)
    return found


class Drawings:
    """Solve a drawing with some refinements put in."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.frame = read_case(SUITE / structure.name).model.frame_structure.frame
        rigid = {
            kind: {end: arm for joint in joints for end, arm in arms(structure, joint).items()}
            for kind, joints in joints_by_type(structure).items()
        }
        longest: dict[str, float] = {}
        for ends in rigid.values():
            for arm in ends.values():
                longest[arm.member] = max(longest.get(arm.member, 0.0), arm.stiffness_length)
        self.refinements: dict[tuple[str, str, str], Drawing] = {
            (MESH, "all", "elements of finite length"): lambda f: _finer(f, longest)
        }
        if self.frame.beam == "euler-bernoulli":
            self.refinements[SHEAR, "all", "shear and rotary inertia"] = _timoshenko
        if structure.plane != "in-plane":
            constant = {
                name: constants(section)[1]
                for name, section in structure.sections.items()
                if section.rectangles
                and "circle" not in str(section.drawn)
                and "round" not in str(section.drawn)
            }
            self.refinements[TORSION, "all", "the sections' torsion constants"] = lambda f: (
                _twisting(structure, f, constant)
            )
        for kind, ends in rigid.items():
            self.refinements[STIFFNESS, f"type:{kind}", "arms of half a depth"] = (
                lambda f, ends=ends: replace(f, rigid_ends=(*f.rigid_ends, *ends.values()))  # type: ignore[misc]
            )

    def solve(self, refinements: list[Drawing]) -> tuple[Array, Array]:
        """Return frequencies (modes,) and shapes at stations (modes, readings) of elastic modes."""
        frame = self.frame
        for refine in refinements:
            frame = refine(frame)
        model, count = Model.of(frame), self.structure.used + self.structure.held_out
        modes = solve_modes(model, min(count + SPARE + 6, model.size)).elastic
        return modes.natural_frequencies, (model.observe(self._sensors) @ modes.shapes).T

    @property
    def _sensors(self) -> Sensors:
        places = np.array([self.structure.point(at) for at, _ in stations(self.structure)]).T
        xyz, along = self.structure.warped(places).T, PLANES[self.structure.plane]
        points = np.repeat(xyz, len(along), axis=0)
        names = tuple(map(str, range(len(points))))
        return Sensors(names, points, tuple("xyz"[axis] for axis in along) * len(xyz))


def _finer(frame: Frame, longest: Mapping[str, float]) -> Frame:
    """Return a frame of more elements, of which the outer ones still hold their members' arms."""
    corners = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    members = []
    for member in frame.members:
        start, end = (corners[joint] for joint in member.ends)
        length = float(np.linalg.norm(end - start))
        room = int(length / (ROOM * longest[member.name])) if member.name in longest else 10**6
        elements = max(member.elements, min(FINER * member.elements, room))
        members.append(replace(member, elements=elements))
    return replace(frame, members=tuple(members))


def _timoshenko(frame: Frame) -> Frame:
    members = tuple(
        replace(m, section=replace(m.section, kappa=m.section.kappa or constant_kappa(5 / 6)))
        for m in frame.members
    )
    return replace(frame, beam="timoshenko", bending_mass="shear-consistent", members=members)


def _twisting(structure: Structure, frame: Frame, constant: Mapping[str, float]) -> Frame:
    named = {member.name: member.section for member in structure.members}
    members = tuple(
        replace(m, section=replace(m.section, J=constant.get(named[m.name], m.section.J)))
        for m in frame.members
    )
    return replace(frame, members=members)


def budget_of(structure: Structure) -> Budget:
    """Return what the drawing of a structure lacks, features removed first and last.

    Raises:
        ValueError: where a state cannot be solved, or shows too few modes.
    """
    along, count = list(PLANES[structure.plane]), structure.used + structure.held_out
    features, solids, drawings = (
        features_of(structure),
        Solids(structure, structure.size[0]),
        Drawings(structure),
    )

    def planar(modes: Observed) -> tuple[Array, Array]:
        shapes = modes.stations.reshape(len(modes.frequencies), -1, 3)[:, :, along]
        return modes.frequencies, shapes.reshape(len(shapes), -1)

    whole = planar(solids.solve([]))
    lead = whole[0][:count], whole[1][:count]

    def partners(state: tuple[Array, Array]) -> tuple[Array, Array]:
        if len(state[0]) < count:
            raise ValueError(f"{structure.name}: {len(state[0])} modes of {count} in one state")
        chosen = paired(lead, state, CLOSENESS)
        return np.log(state[0][chosen]), state[1][chosen]

    @cache
    def solid(removed: frozenset[int]) -> tuple[Array, Array]:
        return partners(planar(solids.solve([features[i] for i in sorted(removed)])))

    refine = drawings.refinements

    def drawing(names: list[tuple[str, str, str]]) -> tuple[Array, Array]:
        return partners(drawings.solve([refine[name] for name in names]))

    every = frozenset(range(len(features)))
    ideal, drawn, finest = solid(every), drawing([]), drawing(list(refine))
    shares = []
    for i, item in enumerate(features):
        before = frozenset(j for j in every if features[j] is item.after)
        since = frozenset(j for j in every if features[j].after is item)
        first = solid(before)[0] - solid(before | {i})[0]
        last = solid(every - since - {i})[0] - solid(every - since)[0]
        shares.append(Share(item.kind, item.place, item.what, "solid", first, last))
    shares += [
        Share(
            *name,
            "drawing",
            drawing([name])[0] - drawn[0],
            finest[0] - drawing([other for other in refine if other != name])[0],
        )
        for name in refine
    ]
    alike = mac(ideal[1], finest[1]).diagonal()
    return Budget(lead[0], np.exp(drawn[0]), tuple(shares), alike)
