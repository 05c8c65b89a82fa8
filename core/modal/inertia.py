"""How many negative eigenvalues a symmetric matrix has, and proofs of it."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femubench.core.fem.model import Model
from femubench.core.modal.factorisation import Definite, Symmetric
from femubench.core.typing import FloatArray, IntArray, SparseArray

Change = tuple[FloatArray, FloatArray]  # (basis, eigenvalues): basis @ diag(eigenvalues) @ basis'
_TRIES = 4
_HELD = 4.0  # stiffness over shift times mass from which on a dof needs no spring of its own
_MOST_LOOSE = 200
_LOST = 1e-13  # of what cancels: a smaller eigenvalue has no sign
_PROBES, _STEPS = 2, 2
_TRUSTED = 0.1  # spectral radius of the error; 1 is where a sign can change
_CHOICE = 8  # nodes to choose from for every one chosen


def signs_hold(factor: Symmetric, matrix: SparseArray) -> bool:
    """Tell whether the pivots have the signs of the matrix, in spite of growth and rounding.

    They are exactly those of A + E. Between this and A no eigenvalue passes zero where
    (A + E)^-1 E has a spectral radius below 1, for which some steps of iteration are a measure.

    Arguments:
        factor: of the matrix, without exchanges.
        matrix: A, symmetric, sparse, (n, n).

    Source: Higham (2002), Accuracy and Stability of Numerical Algorithms, sections 9.3 and 11.1.
    """
    vectors = np.random.default_rng(0).standard_normal((matrix.shape[0], _PROBES))
    for _ in range(_STEPS):
        error = vectors - factor.solve(matrix @ vectors)
        share = la.norm(error, axis=0) / la.norm(vectors, axis=0)
        if not share.max() < _TRUSTED:
            return False
        vectors = error
        if not vectors.any(axis=0).all():
            break
    return True


def negative_by_pins(
    definite: Definite, matrix: SparseArray, change: Change | None, model: Model, about: int
) -> int | None:
    """Return the number of negative eigenvalues of matrix + change; None where pins do not help.

    Springs at some nodes, as stiff as the structure there, make the matrix definite: that its
    Cholesky factorisation exists proves it, without the growth of an unpivoted L D L'. Taking
    them out again is a change of low rank, whose inertia is that of a small dense matrix.

    Arguments:
        definite: ready for the pattern of the matrix; holds the pinned matrix afterwards.
        matrix: K - shift M, sparse.
        change: its part of low rank.
        model: where its nodes are.
        about: how many negative eigenvalues there should be.

    Source: Haynsworth (1968); pins raise eigenvalues past as many others at most, Weyl (1912).
    """
    size = np.abs(model.stiffness.diagonal())
    heavy = np.maximum(size - matrix.diagonal(), 0.0)  # shift times mass
    loose = np.flatnonzero((size < _HELD * heavy) & (heavy > 0.0))
    if len(loose) > _MOST_LOOSE:
        return None
    size = size + _HELD * heavy
    for attempt in range(_TRIES):
        # Translations of joints that lie far from each other. A joint, where many elements meet,
        # takes more of the structure along than a node within a member does.
        wanted = (2 * about + 4) << attempt
        translates = np.abs(model.dofs.motions[:, :3]).max(axis=1) > 0.5
        dofs = np.flatnonzero(translates if translates.any() else ~translates)
        nodes, first = np.unique(model.dofs.node[dofs], return_index=True)
        entries = np.diff(sp.csc_array(model.stiffness).indptr)[dofs[first]]
        wanted = min(wanted, len(nodes))
        at_least = np.sort(entries)[-min(_CHOICE * wanted, len(nodes))]
        nodes, first = nodes[entries >= at_least], first[entries >= at_least]
        chosen = nodes[_scattered(model.dofs.xyz[dofs[first]], wanted)]
        pins = np.union1d(np.asarray(dofs[np.isin(model.dofs.node[dofs], chosen)]), loose)
        pins = pins[size[pins] > 0.0]
        spring = np.zeros(model.size)
        spring[pins] = size[pins]
        if definite.factorise(sp.csc_array(matrix + sp.diags_array(spring))):
            count = len(pins)
            basis = sp.csc_array(
                (np.sqrt(size[pins]), (pins, np.arange(count))), shape=(model.size, count)
            )
            values = np.full(count, -1.0)
            if change is not None:
                basis = sp.hstack([basis, sp.csc_array(change[0])], format="csc")
                values = np.concatenate([values, change[1]])
            return negative_after(0, values, np.diag(1.0 / values) + definite.compliance(basis))
    return None


def negative_after(negative: int, values: FloatArray, capacitance: FloatArray) -> int | None:
    """Return the number of negative eigenvalues of A + U C U'; None where rounding hides one.

    Arguments:
        negative: of A.
        values: the diagonal of C, (p,).
        capacitance: C^-1 + U' A^-1 U, (p, p).

    Source: Haynsworth (1968).
    """
    # What cancels in the diagonal sets its rounding errors, and those of the rest after scaling.
    own = 1.0 / values
    root = np.sqrt(np.abs(own) + np.abs(np.diagonal(capacitance) - own))
    inner = la.eigvalsh(capacitance / np.outer(root, root))
    if np.abs(inner).min(initial=1.0) < _LOST:
        return None
    return negative + int(np.sum(values < 0.0)) - int(np.sum(inner < 0.0))


def _scattered(xyz: FloatArray, count: int) -> IntArray:
    """Return points that lie far apart, (count,): each is the farthest from those before it."""
    if not np.isfinite(xyz).all():
        return np.linspace(0, len(xyz) - 1, count).astype(np.int64)
    chosen = [int(np.square(xyz - xyz.mean(axis=0)).sum(axis=1).argmax())]
    distance = np.full(len(xyz), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, np.square(xyz - xyz[chosen[-1]]).sum(axis=1))
        distance[chosen] = -1.0
        chosen.append(int(distance.argmax()))
    return np.array(chosen)
