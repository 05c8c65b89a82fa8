"""Kabe's update: the smallest relative changes of the non-zero entries of a stiffness matrix."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.errors import NotApplicable, SelfCheckFailed, StrategyFailure
from femubench.core.measurement import Measurement
from femubench.core.model import Model
from femubench.core.strategy import UpdateResult
from femubench.core.typing import FloatArray
from femubench.core.update.least_change import (
    Equations,
    null_space,
    smallest_change,
    smallest_change_sparse,
)
from femubench.core.update.pattern import EntryPattern
from femubench.core.update.promise import (
    ALLOWED,
    Residuals,
    check_used_modes,
    force_scale,
    measure_residuals,
)
from femubench.core.update.quasi import ITERATIONS, QuasiModes, quasi_measured_modes

# A direction in which entries change by 100 % and forces by less than 3 % of the inertia forces
# is taken for one that the modes do not show.
CUTOFF = 0.03
MOST_ITERATIONS = 40
# Beyond these numbers of entries: a sparse solution, refusal with and without rigid-body modes.
DENSE_UNKNOWNS = 1_500
MOST_RIGID_UNKNOWNS = 2_500
MOST_UNKNOWNS = 30_000


@dataclass(frozen=True)
class EntryUpdate:
    """A model with other entries in the pattern of the nominal stiffness matrix.

    Arguments:
        model: the updated model.
        pattern: the entries.
        changes: relative to the nominal sizes, (n_entries,).
        free: number of unknowns that the rigid-body modes leave; None where it was not counted.
        rank: of the equations in the last step; None where it was not counted.
        residuals: of the used modes.
        history: one mapping an iteration.
    """

    model: Model
    pattern: EntryPattern
    changes: FloatArray
    free: int | None
    rank: int | None
    residuals: Residuals
    history: tuple[Mapping[str, float], ...]

    @property
    def result(self) -> UpdateResult:
        """Return what a strategy hands back."""
        diagnostics = {
            "residual": self.residuals.forces,
            "entries": float(len(self.pattern)),
            "largest_relative_change": float(np.abs(self.changes).max()),
        }
        if self.rank is not None:
            diagnostics["rank"] = float(self.rank)
        count = len(self.pattern) if self.free is None else self.free
        return UpdateResult(
            self.model, parameter_count=count, history=self.history, diagnostics=diagnostics
        )


def equations_of(
    pattern: EntryPattern, model: Model, quasi: QuasiModes, cutoff: float = CUTOFF
) -> Equations:
    """Return the equations for further relative changes of a current estimate.

    Phi' K Phi = Lambda is exact, K Phi = M Phi Lambda fitted, with rows scaled so that
    displacements and rotations count alike and every mode's inertia forces have size 1. As the
    shapes turn with the model, both hold in the end.

    Arguments:
        pattern: entries of the nominal stiffness.
        model: the current estimate.
        quasi: measured modes at the current estimate.
        cutoff: change of forces, of the inertia forces for entries that change by 100 %, below
            which a direction is left alone.

    Source: Kabe (1985); Ahmadian, Gladwell & Ismail (1997), section 4.
    """
    scale, shapes, eigenvalues = force_scale(model), quasi.shapes, quasi.eigenvalues
    inertia = model.mass_times(shapes) * eigenvalues
    size = 1.0 / np.linalg.norm(scale[:, None] * inertia, axis=0)
    force = model.stiffness_times(shapes)
    modal = shapes / np.sqrt(eigenvalues)
    energy = modal.T @ model.stiffness_times(modal)
    return Equations(
        exact=pattern.energies(modal),
        exact_right=(np.eye(len(eigenvalues)) - energy)[np.triu_indices(len(eigenvalues))],
        fitted=pattern.products(shapes * size, scale),
        fitted_right=(scale[:, None] * (inertia - force) * size).ravel(),
        cutoff=cutoff,
    )


def update_entries(
    model: Model, measurement: Measurement, rigid: FloatArray, cutoff: float = CUTOFF
) -> EntryUpdate:
    """Return the model whose changed entries give the used modes, pattern kept exactly.

    Five iterations, and further ones until the used modes are there.

    Arguments:
        model: the nominal model.
        measurement: the used modes.
        rigid: rigid-body modes that must stay at zero frequency, (n, r).
        cutoff: as in `equations_of`.

    Raises:
        NotApplicable: when the matrix has too many entries, or a low-rank term.
        StrategyFailure: when a measured mode has no partner in the nominal model.
        SelfCheckFailed: when no matrix of this pattern was found that has the used modes.
    """
    pattern = EntryPattern.of(model)
    free = _free_directions(pattern, model, rigid)
    changes, current, rank = np.zeros(len(pattern)), model, None
    history: list[Mapping[str, float]] = []
    for step in range(MOST_ITERATIONS):
        quasi = _next_quasi(current, measurement, history)
        equations = equations_of(pattern, current, quasi, cutoff)
        if free is not None:
            change, rank = smallest_change(equations, free)
        else:
            change = smallest_change_sparse(equations)
        changes = changes + change
        current = replace(model, stiffness=pattern.matrix(changes))
        found = measure_residuals(current, quasi.shapes, quasi.eigenvalues)
        history.append({"residual": found.forces, "change": float(np.linalg.norm(change))})
        if step + 1 >= ITERATIONS and found.forces <= max(0.1 * ALLOWED, found.rounding):
            break
    found = check_used_modes(current, quasi.shapes, quasi.eigenvalues)
    _check_kept(model, current, rigid)
    count = None if free is None else free.shape[1]
    return EntryUpdate(current, pattern, changes, count, rank, found, tuple(history))


def _free_directions(pattern: EntryPattern, model: Model, rigid: FloatArray) -> FloatArray | None:
    """Return a basis of the changes with K rigid = 0; None where all are free and many.

    As a hard constraint: least-squares rows leave rigid-body modes at tens of Hz.
    """
    most = MOST_RIGID_UNKNOWNS if rigid.shape[1] else MOST_UNKNOWNS
    if len(pattern) > most:
        kept = " and rigid-body modes kept" if rigid.shape[1] else ""
        raise NotApplicable(
            f"the stiffness has {len(pattern)} non-zero entries; with the pattern{kept}, "
            f"at most {most} can be solved for"
        )
    if rigid.shape[1] == 0 and len(pattern) > DENSE_UNKNOWNS:
        return None
    return null_space(pattern.products(rigid, force_scale(model)).toarray())


def _check_kept(model: Model, updated: Model, rigid: FloatArray) -> None:
    outside = (updated.stiffness != 0.0).astype(int) - (model.stiffness != 0.0).astype(int)
    grown = int((outside > 0).sum())
    if grown:
        raise SelfCheckFailed("no entries outside the pattern of K", float(grown), 0.0)
    if rigid.shape[1]:
        force = np.abs(updated.stiffness_times(rigid)).max()
        size = (np.abs(updated.stiffness) @ np.abs(rigid)).max()
        if not force <= ALLOWED * size:
            raise SelfCheckFailed("rigid-body modes free of forces", float(force / size), ALLOWED)


def _next_quasi(
    current: Model, measurement: Measurement, history: list[Mapping[str, float]]
) -> QuasiModes:
    try:
        return quasi_measured_modes(current, measurement)
    except StrategyFailure as lost:
        if not history:
            raise
        promise = f"used modes reproduced, pattern of K kept (after step {len(history)}: {lost})"
        raise SelfCheckFailed(promise, history[-1]["residual"], ALLOWED) from lost
