"""Natural frequencies and mode shapes of a solid with what is attached to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph, linalg

from truths.elasticity import Matrices
from truths.seats import DIRECTIONS, rigid_fit, rigid_motion
from truths.structure import Lump, Oscillator, Spring, Structure, Strut

Array = npt.NDArray[np.float64]
HOLD = 1e-9  # of the stiffness' size: what keeps a free structure in place under a static load
RIGID = 0.02  # of the first elastic frequency; slower modes are rigid


@dataclass(frozen=True)
class System:
    """Hold the matrices that are solved; dofs of oscillators come last, `fixed` ones are out.

    Arguments:
        observe: maps the dofs that are kept back to those of the solid, (dofs, kept).
    """

    stiffness: sparse.csc_array
    mass: sparse.csc_array
    observe: sparse.csr_array


@dataclass(frozen=True)
class Modes:
    """Hold frequencies (Hz), shapes (dofs of the solid, modes), the number of rigid modes."""

    frequencies: Array
    shapes: Array
    rigid: int


def translation(
    fit: sparse.csr_array, offset: Sequence[float] = (0.0, 0.0, 0.0)
) -> sparse.csr_array:
    """Return the (3, dofs) motion of a point at an offset (m) from a seat's place."""
    x, y, z = offset
    arm = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return sparse.csr_array(fit[:3] + sparse.csr_array(arm) @ fit[3:])


def attach(
    structure: Structure,
    matrices: Matrices,
    lumps: Sequence[Lump],
    springs: Sequence[Spring],
    struts: Sequence[Strut] = (),
    oscillators: Sequence[Oscillator] = (),
) -> System:
    """Return the matrices of a solid with masses, springs, struts and oscillators, clamps fixed."""
    K, M = matrices.stiffness.copy(), matrices.mass.copy()
    n, extra = K.shape[0], len(oscillators)
    for lump in lumps:
        move = translation(rigid_fit(structure, matrices, lump.at), lump.offset)
        M = M + lump.mass * (move.T @ move)
    for spring in springs:
        row = rigid_fit(structure, matrices, spring.at)[[DIRECTIONS.index(spring.direction)]]
        K = K + spring.stiffness * (row.T @ row)
    for strut in struts:
        ends = [translation(rigid_fit(structure, matrices, at)) for at in strut.ends]
        points = [structure.warped(structure.point(at)[:, None])[:, 0] for at in strut.ends]
        axis = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        stretch = sparse.csr_array(axis[None, :] @ (ends[1] - ends[0]).toarray())
        K = K + strut.stiffness * (stretch.T @ stretch)
        for end in ends:
            M = M + strut.mass / 2 * (end.T @ end)
    if extra:
        grow = sparse.csr_array(sparse.eye_array(n, n + extra))
        K, M = grow.T @ K @ grow, grow.T @ M @ grow
    for i, item in enumerate(oscillators):
        d = DIRECTIONS.index(item.direction)
        fit = rigid_fit(structure, matrices, item.at) @ sparse.csr_array(
            sparse.eye_array(n, n + extra)
        )
        own = sparse.csr_array(([1.0], ([0], [n + i])), shape=(1, n + extra))
        stretch = own - fit[[d]]
        K = K + item.mass * (2 * np.pi * item.frequency) ** 2 * (stretch.T @ stretch)
        M = M + item.mass * (own.T @ own)
        for across in {0, 1, 2} - {d}:
            M = M + item.mass * (fit[[across]].T @ fit[[across]])
    free = np.ones(n + extra, dtype=bool)
    for clamp in structure.clamps:
        nodes = np.flatnonzero(clamp.holds(matrices.straight))
        if not len(nodes):
            raise ValueError(f"{structure.name}: the clamp at {clamp.at} holds no node")
        free[(3 * nodes[:, None] + np.arange(3)).ravel()] = False
    keep = np.flatnonzero(free)
    back = sparse.csr_array(
        (np.ones(len(keep)), (keep, np.arange(len(keep)))), shape=(n + extra, len(keep))
    )
    return System(sparse.csc_array(K[keep][:, keep]), sparse.csc_array(M[keep][:, keep]), back[:n])


def bind(system: System, nodes: Array, bodies: Sequence[npt.NDArray[np.int64]]) -> System:
    """Return a system of which sets of nodes move as rigid bodies; one that is clamped stays fixed.

    Arguments:
        nodes: of the solid, (3, n), m.
        bodies: nodes of each body; those with nodes in common are one.
    """
    held = np.asarray(abs(system.observe).sum(axis=1)).ravel().reshape(-1, 3).sum(axis=1) == 0
    count = nodes.shape[1]
    ends = np.concatenate([body[:1].repeat(len(body)) for body in bodies])
    links = sparse.coo_array((np.ones(len(ends)), (ends, np.concatenate(bodies))), (count, count))
    label = csgraph.connected_components(links, directed=False)[1]
    tied = np.unique(np.concatenate(bodies))
    loose = np.setdiff1d(np.flatnonzero(~held), tied)
    dofs = (3 * loose[:, None] + np.arange(3)).ravel()
    parts = [
        sparse.coo_array((np.ones(len(dofs)), (dofs, np.arange(len(dofs)))), (3 * count, len(dofs)))
    ]
    for body in (tied[label[tied] == name] for name in np.unique(label[tied])):
        if held[body].any():
            continue
        motion = rigid_motion(nodes[:, body] - nodes[:, body].mean(axis=1, keepdims=True))
        rows = np.repeat((3 * body[:, None] + np.arange(3)).ravel(), 6)
        columns = np.tile(np.arange(6), 3 * len(body))
        parts.append(sparse.coo_array((motion.ravel(), (rows, columns)), (3 * count, 6)))
    kept = sparse.csr_array(sparse.hstack(parts))
    own = sparse.csr_array(system.observe.T @ kept)
    return System(
        sparse.csc_array(own.T @ system.stiffness @ own),
        sparse.csc_array(own.T @ system.mass @ own),
        sparse.csr_array(system.observe @ own),
    )


def factorised(matrix: sparse.csc_array) -> linalg.SuperLU:
    """Factorise a symmetric positive definite matrix."""
    return linalg.splu(
        sparse.csc_matrix(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def statics(system: System) -> linalg.SuperLU:
    """Factorise the stiffness for loads in balance, a free structure held by next to nothing."""
    return factorised(system.stiffness + HOLD * sparse.diags_array(system.stiffness.diagonal()))


def solve(system: System, count: int, guess: float) -> Modes:
    """Return the lowest modes, rigid ones left out.

    Arguments:
        count: number of modes asked of the solver, rigid ones among them.
        guess: a frequency near the first elastic one, Hz.

    Raises:
        ValueError: where an eigenpair leaves a residual over 1e-5, or an eigenvalue is negative.
    """
    factor = factorised(system.stiffness + shift_at(guess) * system.mass)
    return lowest(system, factor, count, guess)


def shift_at(guess: float) -> float:
    """Return what the eigenvalues of a solve near a frequency in Hz are moved by, rad^2/s^2."""
    return float((2 * np.pi * guess) ** 2)


def lowest(system: System, factor: linalg.SuperLU, count: int, guess: float) -> Modes:
    """Return the lowest modes; as `solve`, of a system that is factorised at its guess already."""
    shift = shift_at(guess)
    inverse = linalg.LinearOperator(system.stiffness.shape, matvec=factor.solve)
    start = np.random.default_rng(0).standard_normal(system.mass.shape[0])
    values, vectors = linalg.eigsh(
        system.stiffness, count, system.mass, sigma=-shift, OPinv=inverse, v0=start
    )
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    left = system.stiffness @ vectors - system.mass @ vectors * values
    scale = np.linalg.norm(system.mass @ vectors, axis=0) * (np.abs(values) + shift)
    worst = float((np.linalg.norm(left, axis=0) / scale).max())
    if worst > 1e-5:
        raise ValueError(f"an eigenpair leaves {worst:.1e} of its own norm")
    if values[0] < -((2 * np.pi * RIGID * guess) ** 2):
        raise ValueError(f"the structure buckles: an eigenvalue of {values[0]:.3g} 1/s2")
    hertz = np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)
    rigid = int((hertz < RIGID * guess).sum())
    return Modes(hertz[rigid:], (system.observe @ vectors)[:, rigid:], rigid)
