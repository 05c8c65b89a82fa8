"""Natural frequencies and mode shapes of any model, negative eigenvalues included."""

from __future__ import annotations

import sys
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
import scipy.linalg as la

from femubench.core.errors import ModelError
from femubench.core.fem.model import LowRank, Model
from femubench.core.modal.rigid import (
    mass_orthonormal,
    rigid_body_vectors,
    rigid_modes_of,
    rigid_share,
)
from femubench.core.modal.sparse_eigen import lowest_eigenpairs
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

DENSE_LIMIT = 500
ALL_MODES_LIMIT = 2000  # dofs: up to here a basis takes as long as what it saves
_FEW_FROM, _FEW_SHARE = 250, 6  # dofs, and dofs a mode, above which a few modes are solved alone
_MANY = 20  # modes of a large model, where nobody says how many
_RIGID_SHARE = 0.9
_ROUNDOFF = 32.0 * np.finfo(float).eps
_ZERO = 1e-6  # of the first elastic eigenvalue
_LOOSE = 1e-4  # of the next eigenvalue: cords that carry at a hundredth of its frequency
_LOWEST = "lowest modes"


@dataclass(eq=False)
class Evaluations:
    """How many eigenvalue solutions were made, and how many may be; 0 for any number."""

    count: int = 0
    most: int = 0

    @property
    def left(self) -> int:
        """Return how many more may be made."""
        return max(self.most - self.count, 0) if self.most else sys.maxsize


_counting: list[Evaluations] = []


@contextmanager
def count_evaluations() -> Iterator[Evaluations]:
    """Count the eigenvalue solutions made inside the block, blocks inside it included."""
    counter = Evaluations()
    _counting.append(counter)
    try:
        yield counter
    finally:
        _counting.remove(counter)


def count_evaluation() -> None:
    """Count one more eigenvalue solution, made without `solve_modes`."""
    for counter in _counting:
        counter.count += 1


@dataclass(frozen=True)
class Modes:
    """Eigenpairs in ascending order.

    Arguments:
        eigenvalues: omega^2 in rad^2/s^2 with their sign, (m,).
        shapes: mass-normalised, (n, m).
        rigid: whether a mode lies in the space of rigid-body motions, (m,).
    """

    eigenvalues: FloatArray
    shapes: FloatArray
    rigid: BoolArray

    def __len__(self) -> int:
        return len(self.eigenvalues)

    @property
    def natural_frequencies(self) -> FloatArray:
        """Return Hz; a negative number stands for an imaginary frequency, (m,)."""
        root = np.sqrt(np.abs(self.eigenvalues)) / (2.0 * np.pi)
        return np.asarray(np.copysign(root, self.eigenvalues))

    def take(self, index: IntArray | BoolArray) -> Modes:
        """Return some of the modes."""
        return Modes(self.eigenvalues[index], self.shapes[:, index], self.rigid[index])

    @property
    def elastic(self) -> Modes:
        """Return the modes that are not rigid-body motions."""
        return self.take(~self.rigid)


def _dense(matrix: SparseArray, change: LowRank | None) -> FloatArray:
    dense = np.asarray(matrix.toarray())
    return dense if change is None else dense + change.toarray()


def dense_matrices(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return mass and stiffness as dense arrays, for small models only."""
    return _dense(model.mass, model.mass_change), _dense(model.stiffness, model.stiffness_change)


def natural_shift(mass: FloatArray, stiffness: FloatArray) -> float:
    """Return a positive eigenvalue scale from the diagonals in rad^2/s^2.

    The least k/m, which bounds the lowest eigenvalue (Rayleigh), where it lies between 1e-11 and
    1e-6 of the median. That alone would swamp low eigenvalues where most dofs hardly have mass;
    less would lose the highest ones.
    """
    m, k = np.diagonal(mass), np.diagonal(stiffness)
    carrying = (m > 0.0) & (k > 0.0)
    if not carrying.any():
        raise ModelError("no degree of freedom has both mass and stiffness")
    scale = k[carrying] / m[carrying]
    return float(np.clip(scale.min(), *(np.array([1e-11, 1e-6]) * np.median(scale))))


def solve_dense(mass: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return all finite eigenpairs, ascending, shapes mass-normalised.

    The reciprocal problem M x = mu (K + s M) x is solved, mu = 1/(lambda + s): low eigenvalues
    come out with full relative accuracy, massless dofs have mu = 0 and are thereby condensed
    exactly, and their motion is part of the shapes. Where K + s M is not positive definite
    (an indefinite K), massless dofs are condensed first and the problem is solved as it stands.

    Raises:
        ModelError: when a massless motion has no stiffness, or the mass is indefinite.
    """
    shift = natural_shift(mass, stiffness)
    for factor in (1.0, 1e3, 1e6):
        try:
            lower = la.cholesky(stiffness + factor * shift * mass, lower=True)
        except la.LinAlgError:
            continue
        # LAPACK's own reduction (gvd) takes two thirds of the time and loses two digits.
        half = la.solve_triangular(lower, mass, lower=True)
        inner = la.solve_triangular(lower, half.T, lower=True)
        mu, vectors = la.eigh(0.5 * (inner + inner.T))
        if mu[0] < -1e-9 * mu[-1]:
            raise ModelError("the mass matrix is not positive semidefinite")
        finite = mu > 1e-13 * mu[-1]
        mu, vectors = mu[finite][::-1], vectors[:, finite][:, ::-1]
        shapes = la.solve_triangular(lower.T, vectors, lower=False) / np.sqrt(mu)
        eigenvalues = 1.0 / mu - factor * shift
        # An eigenvalue that happens to lie at minus the shift would swamp all others.
        if eigenvalues[0] > -0.99 * factor * shift:
            return eigenvalues, shapes
    reduced_k, reduced_m, expand = condense_massless(mass, stiffness)
    try:
        eigenvalues, shapes = la.eigh(reduced_k, reduced_m)
    except la.LinAlgError as error:
        raise ModelError("the mass matrix is not positive definite") from error
    return eigenvalues, expand @ shapes


def condense_massless(
    mass: FloatArray, stiffness: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return stiffness and mass on the space that carries mass, and the expansion from it.

    Massless motions follow statically, which is exact (Guyan 1965 with M_ss = 0): the expansion
    is (n, n_massive), K and M are expansion' K expansion and so on.

    Raises:
        ModelError: when a massless motion has no stiffness.
    """
    # Dofs without any mass are taken as they are: an eigenvector of the mass would bring in traces
    # of others, whose stiffness hides that the dof has none.
    bare = ~mass.any(axis=0)
    unit = np.eye(len(mass))
    rest = unit[:, ~bare]
    loaded = mass[np.ix_(~bare, ~bare)]
    diagonal = np.diagonal(loaded)
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    values, vectors = la.eigh(np.asarray(loaded * np.outer(scale, scale)))
    if values[0] < -1e-9 * values[-1]:
        raise ModelError("the mass matrix is not positive semidefinite")
    empty = values < 1e-13 * values[-1]
    basis = rest @ (scale[:, None] * vectors)
    null, carrying = np.hstack([unit[:, bare], basis[:, empty]]), basis[:, ~empty]
    if null.shape[1] == 0:
        return stiffness, mass, np.eye(len(mass))
    inner = null.T @ stiffness @ null
    size = np.sqrt(np.abs(np.diagonal(inner)))
    scaled = inner / np.outer(size, size) if size.all() else np.zeros_like(inner)
    if np.linalg.matrix_rank(scaled, hermitian=True) < len(inner):
        raise ModelError("a degree of freedom has neither mass nor stiffness")
    expand = carrying - null @ la.solve(inner, null.T @ stiffness @ carrying, assume_a="sym")
    return expand.T @ stiffness @ expand, carrying.T @ mass @ carrying, expand


def solve_modes(model: Model, count: int | None = None) -> Modes:
    """Return the lowest modes of a model, rigid-body modes recognised by projection.

    Arguments:
        model: any model; up to 500 dofs it is solved densely and completely.
        count: number of modes wanted, rigid ones included; None for all (small models), or 20
            of a large one, which has its negative eigenvalues as well. What of them is known, by
            `modes_of` or without a solution, is not solved again.

    Raises:
        ModelError: when the eigenvalue problem has no solution, e.g. a mechanism without mass.

    Examples:
        >>> print(femubench.solve_modes(model).elastic.natural_frequencies[:3].round(1))
        [255.8 277.7 581.3]
    """
    return _solved(model, count, model.size > DENSE_LIMIT)


def _solved(model: Model, count: int | None, sparsely: bool) -> Modes:
    """Return what `solve_modes` does, a small model solved as a large one where that is asked."""
    wanted = _MANY if count is None else count
    lowest = _lowest_known(model).get(_LOWEST) if sparsely else None
    if lowest is not None and lowest.count >= wanted:
        return lowest.first(wanted)
    count_evaluation()
    stiffness: SparseArray | FloatArray = model.stiffness
    if not sparsely:
        mass, stiffness = dense_matrices(model)
        if not (np.isfinite(mass).all() and np.isfinite(stiffness).all()):
            raise ModelError("a matrix has entries that are not finite")
        eigenvalues, shapes = solve_dense(mass, stiffness)
        eigenvalues, shapes = eigenvalues[:count], shapes[:, :count]
    else:
        eigenvalues, shapes = lowest_eigenpairs(model, wanted)
    share = rigid_share(model, shapes, rigid_modes_of(model))
    # phi' K phi sums terms of the size of |phi|' |K| |phi|, so that is what its rounding error
    # scales with; on fine meshes it exceeds any fixed share of the first elastic eigenvalue.
    small = np.abs(shapes)
    bound = np.einsum("ij,ij->j", small, np.abs(stiffness) @ small)
    eigenvalues = np.where(np.abs(eigenvalues) <= _ROUNDOFF * bound, 0.0, eigenvalues)
    return Modes(eigenvalues, shapes, share > _RIGID_SHARE)


def enough_modes(model: Model, measured: int) -> int | None:
    """Return how many modes to ask of a model so that measured ones find their partners.

    Arguments:
        model: a small one is solved completely: None.
    """
    return None if model.size <= DENSE_LIMIT else 2 * measured + 12


def zero_tolerance(modes: Modes) -> float:
    """Return the eigenvalue below which a mode counts as one of zero frequency."""
    elastic = modes.eigenvalues[~modes.rigid & (modes.eigenvalues > 0.0)]
    return float(_ZERO * elastic[0]) if len(elastic) else 0.0


_Kept = TypeVar("_Kept")
_Given = ParamSpec("_Given")
# In the model: a table of models by weak references would never lose one to which a value refers.
_KEPT = "_kept"


def once_for(model: Model, key: Hashable, make: Callable[[], _Kept]) -> _Kept:
    """Return what was made before for this very model, or make it and keep it as long.

    Arguments:
        key: what it is, among all that is kept of a model.
        make: called where it was not made before.

    Examples:
        >>> effect.once_for(model, "size", lambda: model.size)
        81
    """
    entry: dict[Hashable, Any] = vars(model).setdefault(_KEPT, {})
    if key not in entry:
        entry[key] = make()
    value: _Kept = entry[key]
    return value


def keep_last(model: Model, key: Hashable, source: object, make: Callable[[], _Kept]) -> _Kept:
    """Return what was made last under a key where it was of this very source, or make it anew.

    Arguments:
        key: what it is, among all that is kept of a model, as for `once_for`.
        source: what it is made of; kept with it, so that an `id` of it in the key is no other's.
        make: called where it was not made of the source.
    """
    last: list[Any] = once_for(model, (keep_last, key), list)
    if not last or last[0] is not source:
        last[:] = source, make()
    value: _Kept = last[1]
    return value


def cache_by_model(
    function: Callable[Concatenate[Model, _Given], _Kept],
) -> Callable[Concatenate[Model, _Given], _Kept]:
    """Let a function of a model and of hashable values find each result once, as `once_for`."""

    @wraps(function)
    def cached(model: Model, /, *args: _Given.args, **kwargs: _Given.kwargs) -> _Kept:
        return once_for(model, (function, args), lambda: function(model, *args, **kwargs))

    return cached


@dataclass(frozen=True)
class _Lowest:
    """The lowest modes that are known of a large model.

    Arguments:
        count: number of them, those with negative eigenvalues aside.
        modes: all of them from the lowest one on.
    """

    count: int
    modes: Modes

    def first(self, wanted: int) -> Modes:
        """Return so many of them, and the negative ones."""
        stop = wanted + max(len(self.modes) - self.count, 0)
        return self.modes.take(np.arange(stop)) if stop < len(self.modes) else self.modes


def keep_modes(model: Model, modes: Modes) -> None:
    """Keep the lowest modes of a large model, which follow without a solution, as long as it.

    Arguments:
        model: with more dofs than are solved densely.
        modes: all of them from the lowest one on.
    """
    negative = int(np.sum(modes.eigenvalues < -zero_tolerance(modes)))
    _lowest_known(model)[_LOWEST] = _Lowest(len(modes) - negative, modes)


def _lowest_known(model: Model) -> dict[str, _Lowest]:
    """Return where the lowest modes are that were kept or solved; empty where none were."""
    return once_for(model, _LOWEST, dict)


def modes_of(model: Model, count: int | None = None) -> Modes:
    """Return the lowest modes of a model as `solve_modes` does, solved only once.

    A large model is solved anew where more of its modes are wanted than ever before.

    Arguments:
        count: number of modes wanted, rigid ones included; None as for `solve_modes`.

    Raises:
        ModelError: when the model has no modes.
    """
    small = model.size <= DENSE_LIMIT
    few = count is not None and model.size > max(_FEW_FROM, _FEW_SHARE * count)
    if small and not (few and "modes" not in vars(model).get(_KEPT, {})):
        modes = once_for(model, "modes", lambda: solve_modes(model))
        return modes if count is None else modes.take(np.arange(min(count, len(modes))))
    wanted = _MANY if count is None else count
    modes = _solved(model, wanted, sparsely=True)
    lowest = _lowest_known(model)
    if _LOWEST not in lowest or lowest[_LOWEST].count < wanted:
        lowest[_LOWEST] = _Lowest(wanted, modes)
    return modes.take(np.arange(min(wanted, len(modes)))) if small else modes


def all_modes(model: Model) -> Modes:
    """Return all modes of a model, solved densely whatever its size, and only once.

    Raises:
        ModelError: when the model has no modes.
    """
    return once_for(model, "modes", lambda: _solved(model, None, sparsely=False))


def modes_up_to(model: Model, hertz: float, count: int = _MANY) -> Modes:
    """Return the modes of a large model up to a frequency and perhaps more, half of all at most.

    Arguments:
        count: of modes to begin with.

    Raises:
        ModelError: when the model has no modes.
    """
    limit = model.size // 2
    modes = modes_of(model, min(count, limit))
    while modes.natural_frequencies[-1] < hertz and count < limit:
        count = min(2 * count, limit)
        modes = modes_of(model, count)
    return modes


@cache_by_model
def loose_motions(model: Model) -> FloatArray:
    """Return how a model that is known to hang free moves as a body, mass-orthonormal, (n, r).

    Of a frame these are all that its dofs have. A model from files may be lumped: a row of floors
    on rails does not tilt as a body, though its labels say so. There a motion counts that costs
    nothing next to what the first mode beyond it costs.
    """
    rigid = mass_orthonormal(model, rigid_body_vectors(model.dofs))
    if model.structure is not None:
        return rigid
    cost, turn = la.eigh(rigid.T @ model.stiffness_times(rigid))
    beyond = modes_of(model, enough_modes(model, 1)).eigenvalues[1:]
    cost = cost[: len(beyond)]
    free = np.flatnonzero(cost <= _LOOSE * beyond[: len(cost)])
    return np.asarray(rigid @ turn[:, : free.max(initial=-1) + 1])
