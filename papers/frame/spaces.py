"""Sets of stiffness matrices as linear spaces: how large they are, and which are the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femubench import Model
from femubench.fem import FloatArray, IntArray
from femubench.modal import rigid_modes_of
from femubench.papers.frame.common import CASE
from femubench.reproduction import Extra, Workbench
from femubench.update import ElementFamily

_RANK = 1e-9  # of the largest singular value
_UNCOUPLED = ("k11", "k12", "k22", "k33")  # generic beam and generic rod, without coupling


@dataclass(frozen=True)
class Spaces:
    """What section 4 says of sets of matrices, counted and compared.

    Arguments:
        entries: non-zero upper entries of K0.
        kept_by_rigid: dimension of the matrices with that pattern and K R = 0.
        beam_and_rod: dimension of the assemblies of generic beams and rods without coupling.
        outside: entries of such assemblies where K0 has a cancelled zero.
        within: dimension of the assemblies that are zero there.
        same_as_generic: largest principal angle between the two spaces in rad.
        nobari, nobari_kept: dimension of Nobari's matrices, and of those with K R = 0.
        physical: dimension of the physical family.
        same_as_physical: largest principal angle between the last two in rad.
        gap: smallest singular value that counted over the largest that did not, of all ranks.
    """

    entries: int
    kept_by_rigid: int
    beam_and_rod: int
    outside: int
    within: int
    same_as_generic: float
    nobari: int
    nobari_kept: int
    physical: int
    same_as_physical: float
    gap: float


class _Ranks:
    """Null spaces and ranks by singular values, with the smallest gap met."""

    def __init__(self) -> None:
        self.gap = np.inf

    def split(self, rows: FloatArray) -> tuple[int, FloatArray]:
        """Return the rank of the rows and an orthonormal basis of their null space."""
        _, singular, right = la.svd(rows, full_matrices=rows.shape[0] < rows.shape[1])
        rank = int(np.sum(singular > _RANK * singular[0]))
        if rank < len(singular):
            dropped = max(float(singular[rank]), np.finfo(float).tiny)
            self.gap = min(self.gap, float(singular[rank - 1]) / dropped)
        return rank, right[rank:].T


def compare_spaces(model: Model) -> Spaces:
    """Return the spaces of a ladder model, all entries scaled by the diagonal of K0.

    Every dof counts in units of 1 / sqrt(K0_ii), so that entries of forces, moments and
    couplings compare.
    """
    size = 1.0 / np.sqrt(model.stiffness.diagonal())
    rigid = rigid_modes_of(model) / size[:, None]
    row, column = np.triu_indices(model.size)
    present = np.abs(_upper(model.stiffness.toarray(), size)) > 0.0
    ranks, structure = _Ranks(), model.frame_structure

    # The entries whose matrix leaves rigid-body motion free of forces.
    forces = _forces(np.eye(int(present.sum())), rigid, row[present], column[present])
    kept = ranks.split(forces)[1]
    generic = ElementFamily.generic(structure, plain="none", joint="none")
    chosen = [i for i, name in enumerate(generic.names) if name.startswith(_UNCOUPLED)]
    assembled = _assembled(generic, chosen, size)
    added = ~present & (np.abs(assembled).max(axis=1) > _RANK)
    inside = ranks.split(assembled[added])[1]
    nobari, physical = (
        _assembled(family, range(len(family)), size)
        for family in (ElementFamily.nobari(structure), ElementFamily.physical(structure))
    )
    free = ranks.split(_forces(nobari, rigid, row, column))[1]
    return Spaces(
        entries=int(present.sum()),
        kept_by_rigid=kept.shape[1],
        beam_and_rod=ranks.split(assembled)[0],
        outside=int(added.sum()),
        within=ranks.split(assembled @ inside)[0],
        same_as_generic=float(la.subspace_angles(kept, (assembled @ inside)[present]).max()),
        nobari=ranks.split(nobari)[0],
        nobari_kept=free.shape[1],
        physical=ranks.split(physical)[0],
        same_as_physical=float(la.subspace_angles(nobari @ free, physical).max()),
        gap=ranks.gap,
    )


def spaces_extra(bench: Workbench) -> tuple[Extra, tuple[str, ...]]:
    """Return the table of spaces, and the findings."""
    s = compare_spaces(bench.cases[CASE].model)
    rows = (
        ("matrices with the pattern of K0", str(s.entries), ""),
        ("of them with the rigid-body modes kept", str(s.kept_by_rigid), ""),
        ("assemblies of generic beams and generic rods, uncoupled", str(s.beam_and_rod), ""),
        (
            f"of them with the {s.outside} cancelled zeros of K0",
            str(s.within),
            f"{s.same_as_generic:.1e} to the second row",
        ),
        ("Nobari's matrices", str(s.nobari), ""),
        ("of them with the rigid-body modes kept", str(s.nobari_kept), ""),
        ("physical parameters", str(s.physical), f"{s.same_as_physical:.1e} to the row above"),
    )
    extra = Extra(
        "Sets of stiffness matrices, counted by rank",
        ("set", "dimension", "largest principal angle (rad)"),
        rows,
        f"Ranks by singular values; the closest call has a gap of {s.gap:.0e} between those that "
        "count and those that do not.",
    )
    generic = (
        f"Of {s.entries} non-zero entries, {s.kept_by_rigid} are free once the rigid-body modes "
        f"are kept: {s.beam_and_rod // 4} x 4 - {s.outside}, four parameters an element less "
        f"{s.outside} zeros that cancel between equal neighbours. The set is that of generic beams "
        f"and generic rods without coupling (largest principal angle "
        f"{s.same_as_generic:.0e} rad): the remark of section 4.1 holds for every such "
        "matrix, not only for the one that was inspected."
    )
    nobari = (
        f"Nobari's {s.nobari} parameters with the rigid-body modes kept leave {s.nobari_kept}, and "
        f"that set is the physical one (dimension {s.physical}, largest principal angle "
        f"{s.same_as_physical:.0e} rad), as equation (21) says."
    )
    return extra, (generic, nobari)


def _upper(matrix: FloatArray, size: FloatArray) -> FloatArray:
    scaled = matrix * np.outer(size, size)
    return np.asarray(scaled[np.triu_indices(len(size))])


def _assembled(family: ElementFamily, chosen: Sequence[int], size: FloatArray) -> FloatArray:
    """Return the upper entries that a unit of every chosen unknown adds, (n_entries, n_chosen)."""
    plan, unit = family.structure.plan, np.eye(len(family))
    parts = [_upper(plan.assemble(family.change(unit[i])).toarray(), size) for i in chosen]
    return np.column_stack(parts)


def _forces(
    entries: FloatArray, rigid: FloatArray, rows: IntArray, columns: IntArray
) -> FloatArray:
    """Return K R for every column of upper entries, (n r, n_columns)."""
    forces = np.zeros((*rigid.shape, entries.shape[1]))
    np.add.at(forces, rows, rigid[columns][:, :, None] * entries[:, None, :])
    off = rows != columns
    np.add.at(forces, columns[off], rigid[rows[off]][:, :, None] * entries[off][:, None, :])
    return forces.reshape(-1, entries.shape[1])
