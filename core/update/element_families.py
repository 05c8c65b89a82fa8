"""Families of stiffness matrices in which updated elements or groups are looked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.frame import Plane
from femubench.core.fem.model import Model
from femubench.core.fem.model_parameters import matrix_slopes, with_values
from femubench.core.fem.parameters import Property
from femubench.core.fem.structure import Structure
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray
from femubench.core.update.change_lists import Changes

Symmetry = Literal["none", "half-turn", "mirror", "full"]
_MIRROR_AXIS = 0  # the mid-plane is normal to the element
# A planar element is turned end for end in its plane; a spatial one about both transverse axes, so
# that the class does not depend on which of them is called z.
_TURN_AXES: dict[Plane, tuple[int, ...]] = {"out-of-plane": (2,), "in-plane": (1,), "3d": (2, 1)}


def operation_on_dofs(operation: FloatArray) -> FloatArray:
    """Return what a rotation or reflection of an element does to its dofs, (12, 12).

    Displacements are vectors, rotations axial vectors; where the operation turns the element end
    for end, the ends change places.

    Arguments:
        operation: orthogonal and diagonal, in local axes (x along the element), (3, 3).
    """
    node = np.kron(np.diag([1.0, np.linalg.det(operation)]), operation)
    ends = np.eye(2) if operation[0, 0] > 0.0 else np.eye(2)[::-1]
    return np.asarray(np.kron(ends, node))


def half_turn(axis: int) -> FloatArray:
    """Return the rotation by 180 degrees about local axis 0, 1 or 2, (3, 3)."""
    signs = -np.ones(3)
    signs[axis] = 1.0
    return np.diag(signs)


def mid_plane_mirror() -> FloatArray:
    """Return the reflection that swaps the ends, (3, 3)."""
    signs = np.ones(3)
    signs[_MIRROR_AXIS] = -1.0
    return np.diag(signs)


_TRANSLATION_XZ, _SLOPE_XZ = [2, 8], [4, 10]
_TRANSLATION_XY, _SLOPE_XY = [1, 7], [5, 11]
_TWIST, _AXIAL = [3, 9], [0, 6]


def strain_vectors(clear: FloatArray, rigid_1: FloatArray, rigid_2: FloatArray) -> FloatArray:
    """Return the six strain modes of beams in forces per strain, columns, (n_e, 12, 6).

    Symmetric bending, antisymmetric bending (shear) in the local x-z plane, twist, extension, and
    the same two bending modes in the local x-y plane. A rigid end lengthens the lever of the shear
    force, so that the columns stay free of rigid-body motion.

    Arguments:
        clear: flexible lengths in m, (n_e,).
        rigid_1, rigid_2: rigid lengths at the ends in m, (n_e,).

    Source: Ahmadian, Gladwell & Ismail (1997), section 4.3, U0.
    """
    first, last = clear + 2.0 * rigid_1, clear + 2.0 * rigid_2
    a, b = np.sqrt(0.5), np.sqrt(0.1)
    modes = np.zeros((len(clear), 12, 6))
    for bend, shear, (w1, w2), (r1, r2), turn in (
        (0, 1, _TRANSLATION_XZ, _SLOPE_XZ, -1.0),  # slope = -ry
        (4, 5, _TRANSLATION_XY, _SLOPE_XY, 1.0),
    ):
        modes[:, r1, bend], modes[:, r2, bend] = turn * a * clear, -turn * a * clear
        modes[:, w1, shear], modes[:, w2, shear] = 2.0 * b, -2.0 * b
        modes[:, r1, shear], modes[:, r2, shear] = turn * b * first, turn * b * last
    modes[:, _TWIST, 2] = np.stack([a * clear, -a * clear], axis=1)
    modes[:, _AXIAL, 3] = [a, -a]
    return modes


_UNIT_MODES = strain_vectors(np.ones(1), np.zeros(1), np.zeros(1))[0]  # of a beam of 1 m


def active_strain_modes(active: BoolArray) -> list[int]:
    """Return which strain modes a plane lets happen.

    Arguments:
        active: which of the twelve local dofs move, (12,).
    """
    still = np.abs(_UNIT_MODES[~active]).sum(axis=0) == 0.0
    return [int(i) for i in np.flatnonzero(still)]


def strain_mode_signs(operation: FloatArray, active: BoolArray) -> FloatArray:
    """Return +1 for every active strain mode that an operation keeps, -1 for one it turns, (q,).

    Raises:
        ModelError: when the operation mixes strain modes.
    """
    modes = _UNIT_MODES[:, active_strain_modes(active)]
    turned = operation_on_dofs(operation) @ modes
    signs = np.sign(np.einsum("iq,iq->q", modes, turned))
    if not np.allclose(turned, modes * signs):
        raise ModelError("the operation is not a symmetry of a prismatic beam")
    return np.asarray(signs)


def operations_of(symmetry: Symmetry, plane: Plane) -> list[FloatArray]:
    """Return the operations that a symmetry class promises to survive."""
    turns = [half_turn(axis) for axis in _TURN_AXES[plane]]
    return {
        "none": [],
        "half-turn": turns,
        "mirror": [mid_plane_mirror()],
        "full": [*turns, mid_plane_mirror()],
    }[symmetry]


def end_swap_signs(plane: Plane, active: BoolArray) -> FloatArray:
    """Return the signs by which equal elements differ when the other end touches the joint, (q,).

    An element turned end for end in the plane has k_ij times the product of signs i and j.
    """
    return strain_mode_signs(half_turn(_TURN_AXES[plane][0]), active)


def free_terms(operations: Sequence[FloatArray], active: BoolArray) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i <= j, of core terms that survive all the operations."""
    count = len(active_strain_modes(active))
    keep = np.ones((count, count), dtype=bool)
    for operation in operations:
        signs = strain_mode_signs(operation, active)
        keep &= np.outer(signs, signs) > 0.0
    diagonal = [(i, i) for i in range(count)]
    return diagonal + [(i, j) for i in range(count) for j in range(i + 1, count) if keep[i, j]]


@dataclass(frozen=True, kw_only=True)
class Family(ABC):
    """Stiffness matrices K_0 + sum_a x[column_ea] pattern_ea of parts e of a model.

    The unknowns x are relative changes (p - p0)/ref, zero for the nominal model.

    Arguments:
        columns: the unknown that scales each pattern, -1 for none, (n_e, n_a).
        names: one a unknown.
        before, units: nominal values of the parameters and their unit, one an unknown; an unknown
            x stands for the value before + x scale.
        scale: unit change of every parameter, (n_unknowns,).
        cores: part of each pattern in the part's relative core, whose nominal value is the unit
            matrix, (n_e, n_a, q, q); None for a family without such a promise. The part is
            positive semidefinite where its core is.
    """

    columns: IntArray
    names: tuple[str, ...]
    before: FloatArray
    scale: FloatArray
    units: tuple[str, ...]
    cores: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.names)

    def values(self, x: FloatArray) -> FloatArray:
        """Return the parameters that belong to the relative changes x, (n_unknowns,)."""
        return self.before + self.scale * x

    def relative(self, values: FloatArray) -> FloatArray:
        """Return the relative changes that belong to parameters, the inverse of `values`."""
        return np.asarray((values - self.before) / self.scale)

    def spread_unknowns(self, x: FloatArray) -> FloatArray:
        """Return the unknowns of every part and pattern, zero where there is none."""
        return np.asarray(np.append(x, 0.0)[self.columns])

    def relative_cores(self, x: FloatArray) -> FloatArray:
        """Return the relative core of every part, the unit matrix nominally, (n_e, q, q)."""
        assert self.cores is not None
        change = np.einsum("ea,eaij->eij", self.spread_unknowns(x), self.cores)
        return np.asarray(np.eye(self.cores.shape[-1]) + change)

    @property
    @abstractmethod
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Return the parts that every unknown acts on, in the grammar of places."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Return the length in m by which moments are made forces."""

    @abstractmethod
    def forces(self, shapes: FloatArray) -> list[SparseArray]:
        """Return, for each shape, what a unit of every unknown adds, sparse (n, n_unknowns)."""

    @abstractmethod
    def change_model(self, model: Model, x: FloatArray) -> Model:
        """Return the model with the change of stiffness that belongs to x."""


@dataclass(frozen=True, kw_only=True)
class ElementFamily(Family):
    """Families of element matrices k_e = k_e0 + sum_a x[column_ea] pattern_ea.

    Arguments:
        structure: the meshed frame.
        elements: the elements that may change, (n_e,).
        patterns: change of a local stiffness matrix for a unit change, (n_e, n_a, 12, 12).
    """

    structure: Structure
    elements: IntArray
    patterns: FloatArray

    @property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Return the labels of the elements that every unknown acts on."""
        found: list[list[str]] = [[] for _ in self.names]
        for element, columns in zip(self.elements, self.columns, strict=True):
            for column in set(columns[columns >= 0].tolist()):
                found[column].append(self.structure.labels[element])
        return tuple(map(tuple, found))

    @property
    def length(self) -> float:
        """Return the mean length of the elements in m."""
        return float(self.structure.properties.length[self.elements].mean())

    def change(self, x: FloatArray) -> FloatArray:
        """Return the change of all local stiffness matrices, (n_elements, 12, 12)."""
        change = np.zeros((len(self.structure.properties), 12, 12))
        change[self.elements] = np.einsum("ea,eaij->eij", self.spread_unknowns(x), self.patterns)
        return change

    def change_model(self, model: Model, x: FloatArray) -> Model:
        """Return the model with other element matrices."""
        change = self.structure.plan.assemble(self.change(x))
        return replace(model, stiffness=model.stiffness + change)

    def forces(self, shapes: FloatArray) -> list[SparseArray]:
        """Return, for each shape, what a unit of every unknown adds, sparse (n, n_unknowns)."""
        gather = self.structure.gather
        local = (gather @ shapes).reshape(-1, 12, shapes.shape[1])[self.elements]
        forces = self.patterns @ local[:, None]  # e, a, 12, m
        used = self.columns >= 0
        rows = 12 * self.elements[:, None, None] + np.arange(12)
        rows = np.broadcast_to(rows, forces.shape[:3])[used].ravel()
        columns = np.repeat(self.columns[used], 12)
        shape = (gather.shape[0], len(self))
        across = gather.T.tocsr()
        return [
            across @ sp.csr_array((forces[used][:, :, j].ravel(), (rows, columns)), shape=shape)
            for j in range(shapes.shape[1])
        ]

    @classmethod
    def physical(cls, structure: Structure) -> ElementFamily:
        """Return one factor on every rigidity of every element: EI, GJ or EA, or all of them.

        The matrices that integration gave are kept: with a Timoshenko beam the shear rigidity goes
        with EI, so that the ratio of shear to bending flexibility stays.

        Source: Ahmadian, Gladwell & Ismail (1997), section 4.2 and equation (21).

        Examples:
            >>> update.ElementFamily.physical(structure).names[:2]
            ('EI rung-right/1', 'GJ rung-right/1')
        """
        spatial = structure.frame.plane == "3d"
        xz, xy = _TRANSLATION_XZ + _SLOPE_XZ, _TRANSLATION_XY + _SLOPE_XY
        masks = {
            "EIy" if spatial else "EI": _block(xz, xz),
            "GJ": _block(_TWIST, _TWIST),
            "EA": _block(_AXIAL, _AXIAL),
        }
        if spatial:
            masks["EIz"] = _block(xy, xy)
        elements, patterns, columns, listed, labels = _masked(structure, masks)
        p = structure.properties
        rigidity = {"EI": p.EIy, "EIy": p.EIy, "EIz": p.EIz, "GJ": p.GJ, "EA": p.EA}
        before = np.array([rigidity[key][elements[e]] for key, e in listed])
        count = patterns.shape[1]
        units = np.eye(count)[:, :, None] * np.eye(count)[:, None, :]
        return cls(
            structure=structure,
            elements=elements,
            patterns=patterns,
            columns=columns,
            names=tuple(f"{key} {labels[e]}" for key, e in listed),
            before=before,
            scale=before,
            units=tuple("N" if key == "EA" else "N m2" for key, _ in listed),
            cores=np.broadcast_to(units, (len(elements), *units.shape)),
        )

    @classmethod
    def nobari(cls, structure: Structure) -> ElementFamily:
        """Return one factor each on w-w, w-slope and slope-slope of bending, and on the rod.

        Source: Nobari, Robb & Ewins (1993); Ahmadian, Gladwell & Ismail (1997), equation (20),
        whose third matrix is [2, 1; 1, 2] on the slopes.

        Examples:
            >>> len(update.ElementFamily.nobari(structure))
            112
        """
        spatial = structure.frame.plane == "3d"
        masks: dict[str, FloatArray] = {}
        planes = [("y" if spatial else "", _TRANSLATION_XZ, _SLOPE_XZ)]
        if spatial:
            planes.append(("z", _TRANSLATION_XY, _SLOPE_XY))
        for about, translation, slope in planes:
            masks[f"k1{about}"] = _block(translation, translation)
            masks[f"k2{about}"] = _block(translation, slope)
            masks[f"k3{about}"] = _block(slope, slope)
        masks["k4t" if spatial else "k4"] = _block(_TWIST, _TWIST)
        masks["k4a" if spatial else "k4 "] = _block(_AXIAL, _AXIAL)
        elements, patterns, columns, listed, labels = _masked(structure, masks)
        one = np.ones(len(listed))
        names = tuple(f"{key.strip()} {labels[e]}" for key, e in listed)
        return cls(
            structure=structure,
            elements=elements,
            patterns=patterns,
            columns=columns,
            names=names,
            before=one,
            scale=one,
            units=("",) * len(listed),
        )

    @classmethod
    def generic(
        cls,
        structure: Structure,
        *,
        plain: Symmetry = "half-turn",
        joint: Symmetry = "none",
        tied: bool = False,
    ) -> ElementFamily:
        """Return elements with the nominal strain modes and a free symmetric core for them.

        A parameter k_ij is relative: the core term divided by the nominal sqrt(k_ii k_jj).

        Arguments:
            plain: symmetry of elements that touch no joint.
            joint: symmetry of elements that touch a joint.
            tied: whether all elements at joints of one type, and all plain ones, share one relative
                core; that of an element is turned end for end where its second end is at the joint.

        Source: Ahmadian, Gladwell & Ismail (1997), section 4.3.

        Examples:
            >>> len(update.ElementFamily.generic(structure, tied=True))
            16
        """
        elements, _, labels = _changeable(structure)
        # The joint type that every element touches and the end by which it does.
        kinds, ends = [""] * len(structure.properties), [0] * len(structure.properties)
        for kind, touching in structure.joint_ends.items():
            for end_name in touching:
                element, end = structure.element_ends[end_name]
                kinds[element], ends[element] = kind, end
        plane, active = structure.frame.plane, structure.active_local
        terms, flip = free_terms([], active), end_swap_signs(plane, active)
        plain_cores = np.zeros((len(terms), len(flip), len(flip)))
        for a, (i, j) in enumerate(terms):
            plain_cores[a, i, j] = plain_cores[a, j, i] = 1.0
        turned = np.array([tied and ends[e] == 1 for e in elements])[:, None, None, None]
        cores = np.where(turned, np.outer(flip, flip) * plain_cores, plain_cores)
        vectors = scale_strain_vectors(structure, elements)[:, None]
        patterns = vectors @ cores @ np.swapaxes(vectors, 2, 3)
        allowed = {s: set(free_terms(operations_of(s, plane), active)) for s in (plain, joint)}
        unknowns: dict[tuple[int, int, str | int], tuple[int, str]] = {}
        columns = np.full(patterns.shape[:2], -1)
        for row, e in enumerate(elements):
            where = (kinds[e] or "plain") if tied else labels[row]
            for a, (i, j) in enumerate(terms):
                if (i, j) in allowed[joint if kinds[e] else plain] and patterns[row, a].any():
                    new = (len(unknowns), f"k{i + 1}{j + 1} {where}")
                    columns[row, a] = unknowns.setdefault((i, j, kinds[e] if tied else row), new)[0]
        before = np.array([1.0 if i == j else 0.0 for i, j, _ in unknowns])
        names = tuple(name for _, name in unknowns.values())
        return cls(
            structure=structure,
            elements=elements,
            patterns=patterns,
            columns=columns,
            names=names,
            before=before,
            scale=np.ones(len(names)),
            units=("",) * len(names),
            cores=cores,
        )


@dataclass(frozen=True, kw_only=True)
class GroupFamily(Family):
    """Factors on the groups of a model from matrices."""

    model: Model
    factors: tuple[Property, ...]

    @property
    def places(self) -> tuple[tuple[str, ...], ...]:
        """Return the groups."""
        return tuple(factor.places for factor in self.factors)

    @property
    def length(self) -> float:
        """Return the length at which rotations are as stiff as translations, 1 without either."""
        model = self.model
        turning = np.array([direction.startswith("r") for direction in model.dofs.direction])
        size = model.stiffness.diagonal()
        sizes = [size[chosen & (size > 0.0)] for chosen in (turning, ~turning)]
        if not all(map(len, sizes)):
            return 1.0
        turn, move = (float(np.log(size).mean()) for size in sizes)
        return float(np.exp(0.5 * (turn - move)))

    def change_model(self, model: Model, x: FloatArray) -> Model:
        """Return the model with factors 1 + x on its groups."""
        return with_values(self.model, self.factors, 1.0 + x)

    def forces(self, shapes: FloatArray) -> list[SparseArray]:
        """Return, for each shape, what a unit of every unknown adds, sparse (n, n_unknowns)."""
        slopes = matrix_slopes(self.model, self.factors)
        return [sp.csr_array(slopes.products(shape, 0.0)) for shape in shapes.T]

    @classmethod
    def of(cls, model: Model) -> GroupFamily:
        """Return one factor on every group of the stiffness of a model from matrices.

        Raises:
            NotApplicable: when it has no groups.
        """
        parts = Changes(model).parameterise("groups")
        one = np.ones(len(parts))
        return cls(
            columns=np.arange(len(parts))[:, None],
            names=parts.names,
            before=one,
            scale=one,
            units=("",) * len(parts),
            cores=np.ones((len(parts), 1, 1, 1)),
            model=model,
            factors=parts.properties,
        )


def tie_unknowns(family: ElementFamily, parts: Mapping[str, tuple[str, ...]]) -> ElementFamily:
    """Return the family with one unknown a pattern for all elements of a part; others stay nominal.

    Arguments:
        family: with an unknown a pattern and element, as large as another's at the same relative
            change.
        parts: from a name to labels of elements; no element is in two.
    """
    part_of = {label: name for name, labels in parts.items() for label in labels}
    unknowns: dict[tuple[int, str], tuple[int, int]] = {}
    columns = np.full(family.columns.shape, -1)
    for row, element in enumerate(family.elements):
        part = part_of.get(family.structure.labels[element])
        for a in np.flatnonzero(family.columns[row] >= 0):
            if part is not None:
                new = (len(unknowns), int(family.columns[row, a]))
                columns[row, a] = unknowns.setdefault((int(a), part), new)[0]
    first = [column for _, column in unknowns.values()]
    before = (family.before / family.scale)[first]
    names = tuple(
        f"{family.names[column].partition(' ')[0]} {part}"
        for (_, part), (_, column) in unknowns.items()
    )
    return replace(
        family, columns=columns, names=names, before=before,
        scale=np.ones(len(names)), units=("",) * len(names),
    )  # fmt: skip


def _changeable(structure: Structure) -> tuple[IntArray, FloatArray, list[str]]:
    """Return the elements that carry mass, their stiffness and distinct labels."""
    carries = (structure.properties.rhoA > 0.0) & np.array([bool(s) for s in structure.labels])
    elements = np.flatnonzero(carries)
    if len(elements) == 0:
        raise NotApplicable("no element of the model carries mass")
    stiffness = structure.properties.take(elements).stiffness_matrices()
    seen: Counter[str] = Counter()
    labels = []
    for e in elements:
        label = structure.labels[e]
        labels.append(label if not seen[label] else f"{label}#{seen[label] + 1}")
        seen[label] += 1
    return elements, np.asarray(stiffness), labels


def _block(rows: list[int], columns: list[int]) -> FloatArray:
    mask = np.zeros((12, 12))
    mask[np.ix_(rows, columns)] = mask[np.ix_(columns, rows)] = 1.0
    return mask


def _masked(
    structure: Structure, masks: Mapping[str, FloatArray]
) -> tuple[IntArray, FloatArray, IntArray, list[tuple[str, int]], list[str]]:
    """Return elements, parts of their stiffness, unknowns, (key, row) of each and labels."""
    elements, stiffness, labels = _changeable(structure)
    active = structure.active_local
    seen = {key: mask * np.outer(active, active) for key, mask in masks.items()}
    keys = [key for key, mask in seen.items() if mask.any()]
    patterns = stiffness[:, None] * np.array([seen[key] for key in keys])
    present = np.abs(patterns).max(axis=(2, 3)) > 0.0
    columns = np.where(present, np.cumsum(present.ravel()).reshape(present.shape) - 1, -1)
    listed = [(keys[a], int(e)) for e, a in zip(*np.nonzero(present), strict=True)]
    return elements, patterns, columns, listed, labels


def scale_strain_vectors(structure: Structure, elements: IntArray) -> FloatArray:
    """Return V with k_e0 = V V' on the dofs that the plane lets move, (n_e, 12, q)."""
    p = structure.properties.take(elements)
    vectors = strain_vectors(p.length - p.rigid_1 - p.rigid_2, p.rigid_1, p.rigid_2)
    vectors = vectors[:, :, active_strain_modes(structure.active_local)]
    inverse = np.linalg.pinv(vectors)
    core = inverse @ p.stiffness_matrices() @ np.swapaxes(inverse, 1, 2)
    diagonal = np.einsum("eqq->eq", core)
    return np.asarray(vectors * np.sqrt(np.maximum(diagonal, 0.0))[:, None, :])
