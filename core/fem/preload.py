"""Geometric stiffness of the stress that a lack of fit of one member or the own weight leaves.

The second variation of a geometrically exact beam under the internal forces n = (N, Vy, Vz) and
moments m = (T, My, Mz) is the integral of

    -2 n . (r x u') + n . (r x (r x e1)) - m . (r x r') + N (Jp/A) (rx')^2

with the displacement u and the rotation r. Out of plane it is N w'^2 + V phi w' +
M (phi w'' - phi' w') + N (Jp/A) phi'^2, in plane N w'^2. A rigid motion of a frame in equilibrium
costs nothing then, which N w'^2 alone does not give out of plane once members meet askew.

Source: strains and rotations of Simo & Vu-Quoc (1986).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from femubench.core.errors import ModelError
from femubench.core.fem.assembly import plan_assembly
from femubench.core.fem.attachments import (
    brace_ends,
    brace_lines,
    brace_motion,
    brace_rows,
    elastic_stiffness,
)
from femubench.core.fem.beam import GAUSS, cubic_rates, interpolation, rigid_transform
from femubench.core.fem.frame import ACTIVE, Frame, Support
from femubench.core.fem.kinematics import build_kinematics, node_at, point_rows, rigid_motions
from femubench.core.fem.links import rigid_arm
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.nominal import mesh_frame
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

_TRANSLATIONS = ("x", "y", "z")
_IN_PLANE = ("x", "y", "rz")  # of a frame that moves out of plane
# Without redundancy rounding leaves some 1e-13 of EA times the misfit strain.
_NO_FORCE = 1e-10
_DRAWS = 2
GRAVITY = 9.80665  # m/s2, the standard acceleration of free fall
_FALLS = 1e-6  # of all weights, of what nothing holds
# The pull of a misfit is far larger than the forces it leaves, so that the balance of these needs
# the digits of one step of iterative refinement (Higham 2002, chapter 12).
_REFINED = 2


@dataclass(frozen=True)
class StressState:
    """Internal forces on the face that looks to the second end, local axes.

    Arguments:
        force: normal and shear forces (N, Vy, Vz) of the elements in N, (n, 3).
        moment: (T, My, Mz) at their second nodes in N m, (n, 3).
        spring_force, spring_moment: on the member side of the joint springs, global, (c, 3).
        link_force: on what follows in a rigid link, from all that is not the link, global, (l, 3).
        brace_force: in the braces in N, tension positive, (b,).
    """

    force: FloatArray
    moment: FloatArray
    spring_force: FloatArray
    spring_moment: FloatArray
    link_force: FloatArray
    brace_force: FloatArray

    @property
    def largest(self) -> float:
        """Return the largest magnitude of a normal force in N."""
        return float(np.abs(np.concatenate([self.force[:, 0], self.brace_force])).max())

    def scale(self, factor: float) -> StressState:
        """Return a multiple of the state."""
        return StressState(*(factor * values for values in vars(self).values()))


@dataclass(frozen=True)
class Statics:
    """The frame in the plane in which it lies, factorised.

    Arguments:
        structure: the frame with the dofs of that plane.
        stiffness: element matrices, (n_elements, 12, 12).
        factor, matrix: of the stiffness on the dofs `free`.
        free: the dofs but those that stop the rigid motions, where nothing reacts.
        loose: the rigid motions that nothing holds, (n, r).
    """

    structure: MeshedFrame
    stiffness: FloatArray
    factor: Any
    matrix: SparseArray
    free: IntArray
    loose: FloatArray

    def state(self, member: str) -> StressState:
        """Return the state with 1 N as its largest normal force and tension in the member.

        Raises:
            ModelError: when the member is unknown or can be fitted without stress.
        """
        structure, mesh = self.structure, self.structure.mesh
        if member not in structure.frame.member_index:
            raise ModelError(f"there is no member {member!r}")
        own = mesh.member == structure.frame.member_index[member]
        own &= np.isnan(mesh.arm_factor)
        misfit = self._misfit(own.astype(float))
        motion = self._motion(self.structure.gather.T @ misfit.ravel())
        state = self._state(self._internal(motion, misfit), motion)
        tension = float(state.force[own, 0].mean())
        scale = float(np.abs(misfit).max())
        if not np.isfinite(state.largest) or abs(tension) < _NO_FORCE * scale:
            raise ModelError(
                f"nothing resists a lack of fit of member {member!r}: the frame is not redundant",
                next((item for item in structure.frame.preloads if item.member == member), None),
            )
        return state.scale(np.sign(tension) / state.largest)

    def under_weight(self, frame: Frame) -> StressState:
        """Return the state under the weight of all that the frame consists of, down along z.

        Raises:
            ModelError: when it would fall or tip over.
        """
        structure, mesh = self.structure, self.structure.mesh
        fall = np.zeros((len(mesh.ends), 12))
        fall[:, 0:3] = fall[:, 6:9] = -GRAVITY * mesh.axes[:, :, 2]
        weight = (structure.properties.mass_matrices() @ fall[:, :, None])[:, :, 0]
        load = structure.gather.T @ weight.ravel()
        hung = [(item.at, item.mass, item.offset) for item in frame.masses]
        hung += [(item.at, item.mass, (0.0, 0.0, 0.0)) for item in frame.oscillators]
        for at, mass, offset in hung:
            point = (
                point_rows(frame, mesh, structure.properties, at) @ structure.kinematics.transform
            )
            load -= mass * GRAVITY * (rigid_arm(np.array(offset))[2] @ point)
        largest = np.abs(load).sum() * np.abs(self.loose).max(axis=0, initial=0.0)
        if np.any(np.abs(load @ self.loose) > _FALLS * largest):
            raise ModelError("nothing holds the frame against its weight along z", "gravity")
        motion = self._motion(load)
        ends = self._internal(motion, weight)
        # Force and moment in the middle stand for those that grow along the element.
        axis, length = [1.0, 0.0, 0.0], structure.properties.length[:, None]
        force, moment = (0.5 * (ends[:, k + 6 : k + 9] - ends[:, k : k + 3]) for k in (0, 3))
        moment = moment - 0.5 * length * np.cross(axis, force)
        state = self._state(ends, motion)
        lumps = np.zeros((len(mesh.xyz), 3))
        for at, mass, _ in hung:
            node = node_at(frame, mesh, at)
            if node is not None:
                lumps[node, 2] -= mass * GRAVITY
        link = state.link_force + lumps[structure.kinematics.bodies[:, 0]]
        return replace(state, force=force, moment=moment, link_force=link)

    def resisting(self) -> BoolArray:
        """Tell which members cannot be fitted without stress, (n_members,).

        A member that can feels no misfit of others either, so that misfits of all members at
        once, taken at random, tell.
        """
        mesh, count = self.structure.mesh, len(self.structure.frame.members)
        rng = np.random.default_rng(0)
        found = np.zeros(count, dtype=bool)
        for _ in range(_DRAWS):
            misfit = self._misfit(rng.normal(size=count)[mesh.member])
            motion = self._motion(self.structure.gather.T @ misfit.ravel())
            tension = self._internal(motion, misfit)[:, 6]
            scale = self._misfit(np.ones(len(tension)))[:, 6]
            found[mesh.member[np.abs(tension) > _NO_FORCE * scale]] = True
        return found

    def _misfit(self, strain: FloatArray) -> FloatArray:
        """Return the end forces that would stretch the elements so, (n_elements, 12)."""
        p = self.structure.properties
        pull = strain * p.EA * p.length / (p.length - p.rigid_1 - p.rigid_2)
        misfit = np.zeros((len(pull), 12))
        misfit[:, 0], misfit[:, 6] = -pull, pull
        return misfit

    def _motion(self, load: FloatArray) -> FloatArray:
        """Return the displacements under a load, (n,)."""
        motion = np.zeros(len(load))
        for _ in range(_REFINED):
            left = load[self.free] - self.matrix @ motion[self.free]
            motion[self.free] += self.factor.solve(left)
        return motion

    def _internal(self, motion: FloatArray, loads: FloatArray) -> FloatArray:
        """Return the end forces of the elements from what pulls at their ends, (n_elements, 12)."""
        local = (self.structure.gather @ motion).reshape(-1, 12, 1)
        return np.asarray((self.stiffness @ local)[:, :, 0] - loads)

    def _state(self, ends: FloatArray, motion: FloatArray) -> StressState:
        mesh, frame = self.structure.mesh, self.structure.frame
        # A hanging node is the end of one element, so that its place among all ends is unique.
        place = np.zeros(len(mesh.xyz), dtype=np.int64)
        place[mesh.ends.ravel()] = np.arange(mesh.ends.size)
        element, end = np.divmod(place[[c.node for c in mesh.connections]].astype(np.int64), 2)
        local = ends.reshape(-1, 2, 2, 3)[element, end]
        outer = -np.einsum("cij,cki->ckj", mesh.axes[element], local)
        stiffness = np.array([brace.stiffness for brace in frame.braces])
        stretch = brace_rows(self.structure) @ motion if frame.braces else np.zeros(0)
        spring, tension = (outer[:, 0], outer[:, 1]), stiffness * stretch
        structure, mesh, frame = self.structure, self.structure.mesh, self.structure.frame
        followers = structure.kinematics.bodies[:, 0]
        total = np.zeros((len(mesh.xyz), 3))
        forces = -np.einsum("eij,eki->ekj", mesh.axes, ends.reshape(-1, 2, 2, 3)[:, :, 0])
        np.add.at(total, mesh.ends.ravel(), forces.reshape(-1, 3))
        np.add.at(total, [c.base for c in mesh.connections], spring[0])
        pull = tension[:, None] * brace_lines(frame)[0] if frame.braces else np.zeros((0, 3))
        for side, sign in ((0, 1.0), (1, -1.0)):
            np.add.at(total, brace_ends(frame)[:, side], sign * pull)
        for item in frame.springs if len(followers) else ():
            node, direction = node_at(frame, mesh, item.at), item.direction.lstrip("+-")
            if node is not None and direction in _TRANSLATIONS:
                column = _TRANSLATIONS.index(direction)
                row = structure.kinematics.transform[[6 * node + column]]
                total[node, column] -= item.stiffness * float((row @ motion)[0])
        link = total[followers]
        return StressState(ends[:, 6:9], ends[:, 9:], *spring, link, tension)


def statics_of(structure: MeshedFrame) -> Statics:
    """Return the statics of the frame as it is described, kept with the structure.

    Raises:
        ModelError: when the frame is a mechanism in its plane.
    """
    if "statics" not in structure.kept:
        source = mesh_frame(structure.frame) if structure.changes else structure
        structure.kept["statics"] = _prepare(source)
    statics: Statics = structure.kept["statics"]
    return statics


def _prepare(structure: MeshedFrame) -> Statics:
    frame = replace(structure.frame, oscillators=())
    directions = ACTIVE[frame.plane]
    if frame.plane == "out-of-plane":
        directions = _IN_PLANE
        # In the plane clamps hold everything, other supports nothing.
        whole = set(ACTIVE[frame.plane])
        clamps = (s.at for s in frame.supports if set(s.fixed) == whole)
        frame = replace(frame, supports=tuple(Support(at, _IN_PLANE) for at in clamps))
        flat = next((m.name for m in frame.members if m.section.Iz <= 0.0), None)
        if flat is not None:
            what = f"member {flat!r}: the stress of a lack of fit needs Iz"
            raise ModelError(what, next(iter(frame.preloads), None))
    kinematics = build_kinematics(frame, structure.mesh, directions)
    flat_structure = replace(structure, frame=frame, kinematics=kinematics)
    kinematics, xyz = flat_structure.kinematics, flat_structure.mesh.xyz
    centre, size = xyz.mean(axis=0), max(float(np.ptp(xyz, axis=0).max()), 1e-12)

    def motion(points: FloatArray, axes: FloatArray) -> FloatArray:
        scale = np.repeat([1.0, size], 3)
        return np.asarray(rigid_motions(points - centre, axes) / scale)

    loose = flat_structure.loose(motion)
    # As few dofs as possible stop the rigid motions.
    stopped = la.qr(loose.T, mode="r", pivoting=True)[1][: loose.shape[1]]
    free = np.setdiff1d(np.arange(len(loose)), stopped)
    matrix = sp.csc_array(elastic_stiffness(flat_structure))[free][:, free]
    try:
        factor = splu(sp.csc_matrix(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0)
    except RuntimeError:
        raise ModelError("the frame is a mechanism in its plane") from None
    stiffness = flat_structure.properties.stiffness_matrices()
    return Statics(flat_structure, stiffness, factor, matrix, free, loose)


def _stiffness(structure: MeshedFrame, state: StressState) -> SparseArray:
    total = structure.plan.assemble(geometric_matrices(structure, state))
    adjacent = _elements_next_to(structure, state)
    return total if adjacent is None else total + adjacent


def _elements_next_to(structure: MeshedFrame, state: StressState) -> SparseArray | None:
    """Return the geometric stiffness of all that is no element, sparse (n, n)."""
    connections, bodies = structure.mesh.connections, structure.kinematics.bodies
    parts = []  # relative motions, and their forms
    if connections:
        pairs = np.array([(c.base, c.node) for c in connections], dtype=np.int64)
        arm = np.array([c.arm for c in connections])
        parts.append(_behind_arms(structure, pairs, arm, state.spring_force, state.spring_moment))
    if len(bodies):
        pairs, xyz = bodies[:, ::-1], structure.mesh.xyz
        arm = xyz[pairs[:, 1]] - xyz[pairs[:, 0]]
        # A moment does no work on two ends that turn alike.
        parts.append(_behind_arms(structure, pairs, arm, state.link_force, np.zeros(arm.shape)))
    if structure.frame.braces:
        unit, length = brace_lines(structure.frame)
        across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
        forms = (state.brace_force / length)[:, None, None] * across
        parts.append((brace_motion(structure), forms))
    found = [plan_assembly(rows, forms.shape[1]).assemble(forms) for rows, forms in parts]
    return sum(found[1:], start=found[0]) if found else None


def _skew(vectors: FloatArray) -> FloatArray:
    """Return the matrices of the products vector x ..., (n, 3, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.moveaxis(np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]), -1, 0)


def _symmetric(matrices: FloatArray) -> FloatArray:
    return 0.5 * (matrices + np.swapaxes(matrices, 1, 2))


def _turned(force: FloatArray, line: FloatArray) -> FloatArray:
    """Return the form force . (r x (r x line)) of a rotation r, (n, 3, 3)."""
    work = np.einsum("ni,ni->n", force, line)[:, None, None]
    return np.asarray(_symmetric(force[:, :, None] * line[:, None, :]) - work * np.eye(3))


def geometric_matrices(structure: MeshedFrame, state: StressState) -> FloatArray:
    """Return the local geometric stiffness matrices of the elements, (n, 12, 12).

    Arguments:
        state: its internal forces, to which they are proportional.
    """
    mesh, force = structure.mesh, state.force
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    first, second = mesh.rigid.T
    L = length - first - second
    sections = [member.section for member in structure.frame.members]
    radius = np.array([section.Jp / section.A for section in sections])[mesh.member]
    axis = np.broadcast_to([1.0, 0.0, 0.0], force.shape)
    turned = _turned(force, axis)
    total = np.zeros((len(L), 12, 12))
    for x, weight in GAUSS:
        moment = state.moment + (length - first - x * L)[:, None] * np.cross(axis, force)
        total += (weight * L)[:, None, None] * _density(x, L, force, moment, turned, radius)
    transform = rigid_transform(first, second)
    total = np.swapaxes(transform, 1, 2) @ total @ transform
    for rotation, rigid in ((slice(3, 6), first), (slice(9, 12), second)):
        total[:, rotation, rotation] -= rigid[:, None, None] * turned
    return total


def _density(
    x: float,
    L: FloatArray,
    force: FloatArray,
    moment: FloatArray,
    turned: FloatArray,
    radius: FloatArray,
) -> FloatArray:
    """Return the second variation per length at a share of the length, (n, 12, 12)."""
    zero = np.zeros_like(L)
    rotation = interpolation(x, L, zero, zero)[:, 3:]
    rates = cubic_rates(x, L)
    slope, bend = rates[:, :3], rates[:, 3:]
    back = np.swapaxes(rotation, 1, 2)
    mixed = -2.0 * np.swapaxes(slope, 1, 2) @ _skew(force) @ rotation
    mixed -= np.swapaxes(bend, 1, 2) @ _skew(moment) @ rotation
    twist = bend[:, :1]
    wagner = (force[:, 0] * radius)[:, None, None] * np.swapaxes(twist, 1, 2) @ twist
    return _symmetric(mixed) + back @ turned @ rotation + wagner


def _behind_arms(
    structure: MeshedFrame, pairs: IntArray, arm: FloatArray, force: FloatArray, moment: FloatArray
) -> tuple[SparseArray, FloatArray]:
    """Return motions of the bases and tips of rigid arms, and their forms.

    A spring behind a rigid arm is the same as a beam of one point: u' dx is the relative
    displacement, r' dx the relative rotation, e1 dx the arm.
    """
    rows = (6 * pairs[:, :, None] + np.arange(6)).ravel()
    blocks = np.zeros((len(pairs), 12, 12))
    blocks[:, 3:6, 3:6] = _turned(force, arm)
    blocks[:, 6:9, 3:6], blocks[:, 0:3, 3:6] = -2.0 * _skew(force), 2.0 * _skew(force)
    blocks[:, 9:12, 3:6] = -_skew(moment)
    return structure.kinematics.transform[rows], _symmetric(blocks)


@dataclass(frozen=True)
class GeometricStiffness:
    """What the stress of a frame does to its stiffness: of preloads, of the weight.

    The stress is that of the frame as it is described: parameters set by `Structure.with_values`
    leave it alone.
    """

    structure: MeshedFrame

    def of_preload(self, member: str, force: float) -> SparseArray:
        """Return what one preload does, on the free dofs, sparse (n, n), in N/m, N, N m.

        It is linear in the force.

        Arguments:
            member: the member with the lack of fit.
            force: the normal force of largest magnitude anywhere in the frame in N, with the sign
                of the force in `member`, tension positive.

        Raises:
            ModelError: when the member is unknown or the frame is not redundant there.
        """
        return force * _stiffness(self.structure, statics_of(self.structure).state(member))

    def forces(self, member: str) -> tuple[FloatArray, SparseArray | None]:
        """Return the forces of a preload of 1 N, and its stiffness apart from the elements.

        With `unit_matrices`, they are the `of_preload` with fewer numbers.

        Arguments:
            member: as for `of_preload`.

        Returns:
            (N, Vy, Vz, T, My, Mz) of every element in N and N m, (n_elements, 6), and the geometric
            stiffness of joint springs, rigid links and braces, sparse (n, n); None without these.

        Raises:
            ModelError: as for `of_preload`.

        Examples:
            >>> forces, adjacent = fem.GeometricStiffness(structure).forces("rung-middle")
            >>> forces.shape[1], adjacent
            (6, None)
        """
        state = statics_of(self.structure).state(member)
        return np.hstack([state.force, state.moment]), _elements_next_to(self.structure, state)

    def unit_matrices(self) -> FloatArray:
        """Return the local geometric stiffness of the elements by each unit of internal force.

        Returns:
            a matrix each for N, Vy, Vz in 1/m and T, My, Mz in 1/m^2, (n_elements, 6, 12, 12).

        Examples:
            >>> fem.GeometricStiffness(structure).unit_matrices().shape[1:]
            (6, 12, 12)
        """
        count, nothing = len(self.structure.mesh.ends), np.zeros((0, 3))
        found = np.empty((count, 6, 12, 12))
        for i, unit in enumerate(np.eye(6)):
            force, moment = np.tile(unit, (count, 1)).reshape(count, 2, 3).swapaxes(0, 1)
            state = StressState(force, moment, nothing, nothing, nothing, np.zeros(0))
            found[:, i] = geometric_matrices(self.structure, state)
        return found

    def of_weight(self) -> SparseArray:
        """Return what the weight does, down along z, on the free dofs, sparse (n, n).

        The frame lies in a plane or in space, and stands or hangs.

        Raises:
            ModelError: when the frame moves out of plane, or nothing holds it against its weight.

        Examples:
            >>> joints = fem.Joint("A", (0.0, 0.0, 0.0)), fem.Joint("B", (0.0, 0.0, 2.0))
            >>> bar = fem.Section.solid_rectangle(0.05, 0.05)
            >>> steel = fem.Material(2.1e11, 0.3, 7850.0)
            >>> mast = fem.Member("mast", ("A", "B"), 4, bar, steel)
            >>> foot = fem.Support(fem.Place(joint="A"), ("x", "z", "ry"))
            >>> parts = {"joints": joints, "members": (mast,), "supports": (foot,)}
            >>> standing = fem.Frame("in-plane", "euler-bernoulli", **parts)
            >>> weight = fem.GeometricStiffness(fem.Structure.build(standing)).of_weight()
            >>> bool(weight.trace() < 0.0)
            True
        """
        if self.structure.frame.plane == "out-of-plane":
            raise ModelError("out of plane the weight leaves no stress in the plane", "gravity")
        return _stiffness(
            self.structure, statics_of(self.structure).under_weight(self.structure.frame)
        )

    def redundant_members(self) -> tuple[str, ...]:
        """Return the members whose lack of fit the rest of the frame resists, in the frame's order.

        Examples:
            >>> len(fem.GeometricStiffness(structure).redundant_members())
            7
        """
        try:
            resisting = statics_of(self.structure).resisting()
        except ModelError:
            return ()
        members = self.structure.frame.members
        return tuple(m.name for m, found in zip(members, resisting, strict=True) if found)
