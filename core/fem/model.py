"""The role of a model: sparse mass and stiffness, labelled dofs, and what else a case can offer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.display import Shown, count_noun
from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.assembly import prune
from femubench.core.fem.attaching import MatrixChange, attach, grow_matrix
from femubench.core.fem.damping import Damping
from femubench.core.fem.frame import Frame, GroundSpring, PointMass
from femubench.core.fem.sensors import Sensors, unit_motions
from femubench.core.fem.structure import Structure
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

# Stiffness and mass, (n, n) each, by the power of a value that they come with.
Powers = Mapping[int, tuple[SparseArray, SparseArray]]
_NEGLIGIBLE = 1e-14  # of the largest eigenvalue of a change


class Edge(NamedTuple):
    """What a part resists and weighs where it may move apart from what it meets.

    Arguments:
        part: a group of the stiffness.
        near: rows of the model at the edge, (k,).
        pulled, carried: stiffness and mass between all rows and the motions apart, (n, p).
        stiff, heavy: those of the motions apart, (p, p).
    """

    part: str
    near: IntArray
    pulled: SparseArray
    carried: SparseArray
    stiff: SparseArray
    heavy: SparseArray

    def take(self, rows: IntArray) -> Edge:
        """Return what some rows of the model have of it, (k,)."""
        pulled, carried = (sp.csr_array(own)[rows] for own in (self.pulled, self.carried))
        near = np.flatnonzero(np.isin(rows, self.near))
        return self._replace(near=near, pulled=pulled, carried=carried)

    def grown(self, size: int) -> Edge:
        """Return it for a model with further rows behind its own, (size,)."""
        pulled, carried = (sp.csr_array(own) for own in (self.pulled, self.carried))
        for own in (pulled, carried):
            own.resize((size, own.shape[1]))
        return self._replace(pulled=pulled, carried=carried)


@dataclass(frozen=True)
class Dofs:
    """Labels of the degrees of freedom.

    Arguments:
        node: node of every dof, (n,).
        direction: one of x y z rx ry rz, (n,).
        xyz: position of every dof's node in m, (n, 3).
        axes: unit motion of every dof in (x, y, z, rx, ry, rz), (n, 6); None where it is the
            direction itself. Flexible connections of skew members have dofs along the member;
            zero where no motion of a body moves it, as of nodes inside an element.
    """

    node: IntArray
    direction: tuple[str, ...]
    xyz: FloatArray
    axes: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.direction)

    def take(self, rows: IntArray) -> Dofs:
        """Return some of them, (k,)."""
        direction = tuple(self.direction[i] for i in rows)
        axes = None if self.axes is None else self.axes[rows]
        return Dofs(self.node[rows], direction, self.xyz[rows], axes)

    @property
    def internal(self) -> BoolArray:
        """Tell which dofs no motion of a body moves, (n,)."""
        moved = np.ones(len(self)) if self.axes is None else np.abs(self.axes).sum(axis=1)
        return np.asarray(moved == 0.0)

    @property
    def motions(self) -> FloatArray:
        """Return the unit motion of every dof in (x, y, z, rx, ry, rz), (n, 6)."""
        if self.axes is not None:
            return self.axes
        return unit_motions(self.direction)


@dataclass(frozen=True)
class LowRank:
    """A symmetric change ``basis @ core @ basis.T`` that is never multiplied out.

    Arguments:
        basis: (n, p).
        core: symmetric, (p, p).
    """

    basis: FloatArray
    core: FloatArray

    def __matmul__(self, vectors: FloatArray) -> FloatArray:
        product: FloatArray = self.basis @ (self.core @ (self.basis.T @ vectors))
        return product

    def take(self, rows: IntArray) -> LowRank:
        """Return the change of some degrees of freedom, (k,)."""
        return LowRank(self.basis[rows], self.core)

    def toarray(self) -> FloatArray:
        """Return the dense matrix, for small models."""
        dense: FloatArray = self.basis @ self.core @ self.basis.T
        return dense

    @classmethod
    def total(cls, parts: Sequence[LowRank | None]) -> LowRank | None:
        """Return the sum of low-rank changes with the smallest rank that represents it.

        Arguments:
            parts: changes of one matrix; None stands for no change.

        Examples:
            >>> change = fem.LowRank(np.eye(4, 2), np.eye(2))
            >>> both = fem.LowRank.total([change, None, change])
            >>> np.allclose(both.toarray(), 2 * change.toarray())
            True
        """
        changes = [part for part in parts if part is not None]
        if not changes:
            return None
        q, r = la.qr(np.hstack([change.basis for change in changes]), mode="economic")
        core = r @ la.block_diag(*(change.core for change in changes)) @ r.T
        values, turn = la.eigh(0.5 * (core + core.T))
        keep = np.abs(values) > _NEGLIGIBLE * np.abs(values).max(initial=0.0)
        return cls(q @ turn[:, keep], np.diag(values[keep]))


class Geometry(Protocol):
    """What a model needs to know of its structure apart from the matrices."""

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from dofs, sparse (n_sensors, n)."""
        ...

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        """Return the mass and stiffness that attachments add, sparse (n, n) each."""
        ...


@dataclass(frozen=True, repr=False, eq=False)
class Model(Shown):
    """A structural model; strategies return another one made by `dataclasses.replace`.

    Arguments:
        mass: sparse symmetric, (n, n), in kg, kg m, kg m2.
        stiffness: sparse symmetric, (n, n), in N/m, N, N m.
        dofs: what the rows are.
        geometry: where sensors and attachments act.
        structure: the meshed frame that gave the matrices; None for matrices from files.
        mass_change, stiffness_change: low-rank terms on top of the sparse matrices.
        free: whether the structure is known to hang free, so that nothing may hold it.
        damping: of the whole structure; None where nothing is known of it.
        groups, mass_groups: named parts of stiffness and mass of a model from files, sparse (n, n)
            each.
        group_priors: by name of a group, a factor of so much up or down is as likely as not.
        group_kinds: by name of a group, what it is: a word of `modal.group_prior.KINDS`.
        finer: of a model from files, gives the whole of it and the same with better elements, whose
            rows begin with those of the whole; None where nobody knows better ones.
        powers: by a place, what comes with powers of a value there: of `group:NAME` (`all` where it
            is the only part) the thickness of its plates over that drawn, of `preload:NAME` its
            force over that drawn.
        grounds: by ``ground|NAME``, where nodes of a part are held, what it does when they give.
        families: by ``set:NAME`` or ``material:NAME``, the groups that belong together.
    """

    mass: SparseArray
    stiffness: SparseArray
    dofs: Dofs
    geometry: Geometry
    structure: Structure | None = None
    mass_change: LowRank | None = None
    stiffness_change: LowRank | None = None
    groups: Mapping[str, SparseArray] = field(default_factory=dict)
    free: bool = False
    damping: Damping | None = None
    mass_groups: Mapping[str, SparseArray] = field(default_factory=dict)
    group_priors: Mapping[str, float] = field(default_factory=dict)
    group_kinds: Mapping[str, str] = field(default_factory=dict)
    finer: Callable[[], tuple[Model, Model]] | None = None
    powers: Mapping[str, Powers] = field(default_factory=dict)
    grounds: Mapping[str, Edge] = field(default_factory=dict)
    families: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """Return its fields alone: what was made of this very model stays with it."""
        return {part.name: getattr(self, part.name) for part in fields(self)}

    @classmethod
    def of(cls, source: Frame | Structure) -> Model:
        """Return the model of a frame or of a meshed frame.

        Raises:
            ModelError: when the frame cannot be meshed.
        """
        structure = Structure.build(source) if isinstance(source, Frame) else source
        mass, stiffness = structure.matrices()
        free, damping = structure.frame.free, structure.frame.damping
        model = cls(mass, stiffness, dofs_of(structure), structure, structure)
        return replace(model, free=free, damping=damping)

    def with_ground(
        self,
        part: str,
        pulled: SparseArray,
        carried: SparseArray,
        stiff: SparseArray,
        heavy: SparseArray,
    ) -> Model:
        """Return the model with what a part does where its nodes are held: the ground may give.

        It is at ``ground|PART``; with several of one part, at ``ground 1|PART`` and so on.

        Arguments:
            part: a group of the stiffness.
            pulled, carried: its stiffness and mass between all rows and the held motions, (n, p).
            stiff, heavy: those of the held motions, (p, p).

        Examples:
            >>> from dataclasses import replace
            >>> deck = replace(model, structure=None, groups={"deck": model.stiffness})
            >>> held = deck.stiffness[:, :3], deck.mass[:, :3]
            >>> inside = deck.stiffness[:3, :3], deck.mass[:3, :3]
            >>> list(deck.with_ground("deck", *held, *inside).grounds)
            ['ground|deck']
        """
        near = np.flatnonzero(np.diff(sp.csr_array(pulled).indptr))
        own = [edge for edge in self.grounds.values() if edge.part == part]
        own.append(Edge(part, near, pulled, carried, stiff, heavy))
        found = {name: edge for name, edge in self.grounds.items() if edge.part != part}
        for i, edge in enumerate(own, 1):
            found[f"ground {i}|{part}" if len(own) > 1 else f"ground|{part}"] = edge
        return replace(self, grounds=found)

    def with_dofs(self, dofs: Dofs, geometry: Geometry) -> Model:
        """Return a model from files on more dofs, which have neither mass nor stiffness yet.

        Arguments:
            dofs: its own, and those behind them.
            geometry: of all of them.
        """
        size, own = len(dofs), np.arange(self.size)

        def grow(parts: Mapping[str, SparseArray]) -> dict[str, SparseArray]:
            return {name: grow_matrix(part, size) for name, part in parts.items()}

        whole = grow({"mass": self.mass, "stiffness": self.stiffness})
        return replace(
            self,
            **whole,
            dofs=dofs,
            geometry=geometry,
            mass_change=_spread_low_rank(self.mass_change, own, size),
            stiffness_change=_spread_low_rank(self.stiffness_change, own, size),
            groups=grow(self.groups),
            mass_groups=grow(self.mass_groups),
            powers=self.map_powers(*(partial(grow_matrix, size=size) for _ in range(2))),
            grounds={name: edge.grown(size) for name, edge in self.grounds.items()},
        )

    def map_powers(
        self, stiffness: Callable[[Any], Any], mass: Callable[[Any], Any]
    ) -> dict[str, Powers]:
        """Return what comes with powers of values, each matrix of it changed by a function."""
        return {
            place: {power: (stiffness(k), mass(m)) for power, (k, m) in own.items()}
            for place, own in self.powers.items()
        }

    def rows(self) -> list[tuple[str, str]]:
        """Return what it is a model of, its mass and what of it is not in the matrices."""
        size, what = f"{self.size} degrees of freedom", "matrices from files"
        if self.structure is not None:
            frame = self.structure.frame
            members, joints = count_noun(len(frame.members), "member"), len(frame.joints)
            what = f"{frame.plane}, {members}, {count_noun(joints, 'joint')}"
        found = [("", f"{size}, {what}")]
        for name in ("mass", "stiffness"):
            matrix, change = getattr(self, name), getattr(self, f"{name}_change")
            rank = "" if change is None else f", and a change of rank {change.core.shape[0]}"
            found.append((name, f"{matrix.nnz} entries, largest {abs(matrix).max():.4g}{rank}"))
        groups = (("groups", self.groups), ("mass groups", self.mass_groups))
        return found + [(word, ", ".join(known)) for word, known in groups if known]

    @property
    def size(self) -> int:
        """Return the number of degrees of freedom n."""
        return len(self.dofs)

    @cached_property
    def total_mass(self) -> float:
        """Return the mass of the whole structure in kg, as scales would show it.

        The largest that moves when all dofs are shifted along x, y or z; of a frame on supports,
        where some of it cannot move, that of its parts.
        """
        if self.structure is not None and self.structure.frame.supports:
            return self.structure.total_mass
        shift = self.dofs.motions[:, :3]
        return float(np.einsum("nd,nd->d", shift, self.mass_times(shift)).max())

    def has_matrices(
        self, mass: SparseArray, stiffness: SparseArray, tolerance: float = 1e-12
    ) -> bool:
        """Tell whether both matrices are the model's, to a share of their diagonals.

        They are not where a change of low rank comes on top of its own.
        """
        if self.mass_change is not None or self.stiffness_change is not None:
            return False
        for own, other in ((self.mass, mass), (self.stiffness, stiffness)):
            if own.shape != other.shape:
                return False
            apart, size = (own - other).tocoo(), np.sqrt(np.abs(own.diagonal()))
            if not np.all(np.abs(apart.data) <= tolerance * size[apart.row] * size[apart.col]):
                return False
        return True

    @property
    def frame_structure(self) -> Structure:
        """Return the meshed frame.

        Raises:
            NotApplicable: when the model came as matrices.
        """
        if self.structure is None:
            raise NotApplicable("the model is a pair of matrices without elements")
        return self.structure

    def dofs_in(self, other: Model) -> IntArray:
        """Return the position of every dof of a frame among those of the frame meshed anew, (n,).

        Raises:
            ModelError: when one is not there.
        """
        return common_dofs(self.frame_structure, other.frame_structure)

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from dofs, sparse (n_sensors, n).

        Raises:
            ModelError: when a sensor lies off the structure.
        """
        return self.geometry.observe(sensors)

    def stiffness_times(self, vectors: FloatArray) -> FloatArray:
        """Return K @ vectors with the low-rank change, (n, m)."""
        product: FloatArray = self.stiffness @ vectors
        change = self.stiffness_change
        return product if change is None else product + change @ vectors

    def mass_times(self, vectors: FloatArray) -> FloatArray:
        """Return M @ vectors with the low-rank change, (n, m)."""
        product: FloatArray = self.mass @ vectors
        change = self.mass_change
        return product if change is None else product + change @ vectors

    def mass_normalised(self, shapes: FloatArray) -> FloatArray:
        """Return shapes with phi' M phi = 1 each, (n, m).

        Arguments:
            shapes: at all dofs, each with some mass in it, (n, m).

        Examples:
            >>> shapes = model.mass_normalised(3.0 * modes.shapes)
            >>> np.allclose(np.diag(shapes.T @ model.mass_times(shapes)), 1.0)
            True
        """
        mass = np.einsum("ij,ij->j", shapes, self.mass_times(shapes))
        return np.asarray(shapes / np.sqrt(mass))

    def attach(self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]) -> Model:
        """Return the model with further masses and springs to ground.

        An attachment between nodes splits its element, whose new dofs come last; what an update
        changed in the matrices is carried over to the dofs that were there before.

        Raises:
            ModelError: when an attachment lies off the structure.
        """
        found = self.assemble_attachments(masses, springs)
        if found is None:
            meshed = self.frame_structure
            frame = meshed.frame.with_attachments(tuple(masses), tuple(springs))
            return carry_over(self, Model.of(meshed.rebuilt(frame)))
        structure, change = found
        size = change.mass.shape[0]
        mass, stiffness = grow_matrix(self.mass, size), grow_matrix(self.stiffness, size)
        mass, stiffness = mass + change.mass, stiffness + change.stiffness
        if structure is None:
            return replace(self, mass=mass, stiffness=stiffness)
        if size > self.size:
            mass, stiffness = prune(mass), prune(stiffness)
        return replace(
            self,
            mass=mass,
            stiffness=stiffness,
            dofs=dofs_of(structure),
            geometry=structure,
            structure=structure,
            mass_change=_spread_low_rank(self.mass_change, np.arange(self.size), size),
            stiffness_change=_spread_low_rank(self.stiffness_change, np.arange(self.size), size),
        )

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[Structure | None, MatrixChange] | None:
        """Return the structure with attachments and what they add; None where no change is local.

        Raises:
            ModelError: when an attachment lies off the structure.
        """
        if self.structure is not None:
            return attach(self.structure, masses, springs)
        mass, stiffness = self.geometry.assemble_attachments(masses, springs)
        return None, MatrixChange(mass, stiffness, stiffness)


def dofs_of(structure: Structure) -> Dofs:
    """Return the labels of the degrees of freedom of a meshed frame."""
    kinematics = structure.kinematics
    xyz = structure.mesh.xyz[kinematics.node]
    return Dofs(kinematics.node, kinematics.direction, xyz, kinematics.axes)


def differ(first: Model, second: Model) -> bool:
    """Tell whether two models have other matrices."""
    pairs = (first.mass, second.mass), (first.stiffness, second.stiffness)
    return any(one.shape != other.shape or (one != other).nnz > 0 for one, other in pairs)


def _keys(structure: Structure) -> list[tuple[object, ...]]:
    """Return a name of every dof that stays the same when other elements are split."""
    nodes = structure.mesh.node_keys(len(structure.frame.joints))
    kinematics = structure.kinematics
    pairs = zip(kinematics.node, kinematics.direction, strict=True)
    return [(*nodes[node], direction) for node, direction in pairs]


def common_dofs(old: Structure, new: Structure) -> IntArray:
    """Return the position of every old dof among the new ones, (n_old,)."""
    index = {key: i for i, key in enumerate(_keys(new))}
    try:
        return np.array([index[key] for key in _keys(old)], dtype=np.int64)
    except KeyError as error:
        raise ModelError("two attachments lie too close to each other on a member") from error


def carry_over(model: Model, rebuilt: Model, *, held: bool = False) -> Model:
    """Return a frame meshed anew, with what an update changed in the matrices of the old one.

    Arguments:
        held: whether dofs of the old one may be held in the new one; what changed there goes.
    """
    old, new = model.frame_structure, rebuilt.frame_structure
    pairs = zip((model.mass, model.stiffness), old.matrices(), strict=True)
    changes = [sp.csr_array(own - drawn) for own, drawn in pairs]
    if held:
        keys = {key: i for i, key in enumerate(_keys(new))}
        found = [(i, keys[key]) for i, key in enumerate(_keys(old)) if key in keys]
        rows, keep = np.array(found, dtype=np.int64).reshape(-1, 2).T
        changes = [change[rows][:, rows] for change in changes]
        cut = [c and c.take(rows) for c in (model.mass_change, model.stiffness_change)]
        model = replace(model, mass_change=cut[0], stiffness_change=cut[1])
    else:
        keep = common_dofs(old, new)
    return _changed_at(rebuilt, keep, changes[0], changes[1], model)


def neighbours_of(model: Model, changed: Model, samples: Iterable[Model]) -> tuple[Model, ...]:
    """Return models near a model as they are after the attachments that made `changed` of it.

    Arguments:
        changed: what its `attach` returned.
        samples: models on the dofs of `model`.
    """
    keep = np.arange(model.size)
    if model.structure is not None:
        keep = common_dofs(model.structure, changed.frame_structure)
    return tuple(
        _changed_at(changed, keep, s.mass - model.mass, s.stiffness - model.stiffness, s)
        for s in samples
    )


def _changed_at(
    model: Model, keep: IntArray, mass: SparseArray, stiffness: SparseArray, source: Model
) -> Model:
    """Return a model with further mass and stiffness, and a source's low rank, at some dofs."""
    found = []
    for whole, change in ((model.mass, mass), (model.stiffness, stiffness)):
        entries = sp.coo_array(change)
        triplet = (entries.data, (keep[entries.row], keep[entries.col]))
        found.append(whole + sp.csc_array(triplet, shape=whole.shape))
    return replace(
        model,
        mass=found[0],
        stiffness=found[1],
        mass_change=_spread_low_rank(source.mass_change, keep, model.size),
        stiffness_change=_spread_low_rank(source.stiffness_change, keep, model.size),
    )


def _spread_low_rank(change: LowRank | None, keep: IntArray, size: int) -> LowRank | None:
    if change is None:
        return None
    basis = np.zeros((size, change.basis.shape[1]))
    basis[keep] = change.basis
    return LowRank(basis, change.core)
