"""Readings of the ladder paper's least squares: the equation error with every choice left open.

Dense and small, so that thousands of readings can be tried. With the default choices it is what the
element strategies do, without their bound on positive elements.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
import scipy.linalg as la
from ladder_settings import Setting, patterns, setting

from femubench import StrategyFailure
from femubench.fem import FloatArray
from femubench.modal import pair_modes

SOFT = 1e4  # rad2/s2: makes K + s M of a free structure invertible


@dataclass(frozen=True)
class Reading:
    """One way to read section 4 of the paper; the defaults are those of the strategies.

    Arguments:
        family: a key of `ladder_settings.FAMILIES`, or ``kabe-rigid``.
        data: shapes of the solid ``twin`` or of the ``beam`` truth.
        expansion: ``rotation`` (16)-(17), ``transposed`` (as printed), ``force`` (15), ``dynamic``
            (its condensation: no force at unmeasured dofs), ``serep`` of rigid and 8 elastic modes,
            ``own`` (the model's shapes), ``all dofs`` (beam truth, nothing to expand).
        orthogonal: whether expanded shapes are made orthogonal to M0 afterwards.
        metric: of the residual in (15): ``diagonal`` (of K), ``paper``, ``raw``, ``mass``.
        start: whether (15) has the ``current`` or the ``nominal`` stiffness.
        target: frequencies of the equations, ``measured`` or the ``nominal`` model's own.
        rows: of the equations of motion: ``paper`` (moments divided by L), ``raw``, ``mass``
            (M^-1/2), ``stiffness`` (K^-1/2), ``sensors`` (measured dofs), ``modal`` (Phi').
        per_mode: whether they are divided by lambda.
        motion: whether there are equations of motion at all.
        diagonal, cross: weights of the orthogonality rows; 0, 0 for none.
        iterations: number of solutions.
        damping: share of the old parameters that is kept in every iteration.
        tikhonov: weight of x = 0, of the norm of the equations.
        cutoff: of singular values.
        absolute: whether the smallest change is that of EI/L^3 and GJ/L, not of relative ones.
        tied: ``no``, ``kind`` (one value a rigidity for L, T and plain elements), ``element`` (r
            stays).
        only: unknowns whose names begin so; empty for all.
        bredt, accelerometer: the torsion constant and the mass of the nominal model.
        layout: of the 13 sensors: ``midpoints``, ``quarters``, ``rungs`` (the last two: beam).
        noise: standard deviation of every reading, of the largest in its mode.
        seed: of the noise.
        sharing: of a tied core: ``turned`` end for end where the second end is at the joint,
            ``numbered`` (equal in the numbering of each element), ``mirrored`` (turned, and twist
            of the other sign where the joint goes on to the other side).
        backward: members numbered from their other end, joined by ``+``.
        confused: two measured modes whose frequencies are exchanged, ``1-2`` or ``2-3``.
        mispaired: two measured modes whose partners in the model are exchanged.
        scale: factor of all expanded shapes, 1 for unit modal mass.
    """

    family: str = "physical"
    data: str = "twin"
    expansion: str = "rotation"
    orthogonal: bool = False
    metric: str = "diagonal"
    start: str = "current"
    target: str = "measured"
    rows: str = "paper"
    per_mode: bool = False
    motion: bool = True
    diagonal: float = 10.0
    cross: float = 2.0
    iterations: int = 5
    damping: float = 0.0
    tikhonov: float = 0.0
    cutoff: float = 1e-10
    absolute: bool = False
    tied: str = "no"
    only: str = ""
    bredt: bool = False
    accelerometer: bool = True
    layout: str = "midpoints"
    noise: float = 0.0
    seed: int = 0
    sharing: str = "turned"
    backward: str = ""
    confused: str = ""
    mispaired: str = ""
    scale: float = 1.0

    @property
    def words(self) -> str:
        """Return the choices that are not the defaults, the family aside."""
        base = Reading()
        names = [f.name for f in fields(self) if f.name != "family"]
        stated = [n for n in names if getattr(self, n) != getattr(base, n)]
        return ", ".join(f"{n} {getattr(self, n)}" for n in stated) or "as built in"


def modes_of(nominal: Setting, stiffness: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return three rigid frequencies, the others and their shapes; imaginary ones are negative."""
    eigenvalues, shapes = la.eigh(stiffness, nominal.mass)
    share = np.square(nominal.rigid.T @ nominal.mass @ shapes).sum(axis=0)
    rigid = np.zeros(len(share), dtype=bool)
    rigid[np.argsort(-share)[:3]] = True
    hz = np.sign(eigenvalues) * np.sqrt(np.abs(eigenvalues)) / (2.0 * np.pi)
    return hz[rigid], hz[~rigid], shapes[:, ~rigid]


def _paired(
    nominal: Setting, stiffness: FloatArray, measured: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return partners' shapes and frequencies, and all low shapes."""
    _, hz, shapes = modes_of(nominal, stiffness)
    low = shapes[:, :12]
    in_order = np.sort(nominal.frequencies)  # pairs by shape, though frequencies be confused
    index = pair_modes(in_order, measured, hz[:12], nominal.sensors @ low).index
    if (index < 0).any():
        raise StrategyFailure("a measured mode has no partner")
    return low[:, index], hz[index], low


def _by_force(
    reading: Reading, nominal: Setting, stiffness: FloatArray, measured: FloatArray
) -> FloatArray:
    """Return the shapes of equation (15), or with no force where nothing was measured."""
    scale = {
        "diagonal": lambda: np.diag(1.0 / np.sqrt(np.diagonal(nominal.stiffness))),
        "paper": lambda: np.diag(np.where(nominal.turning, 1.0 / nominal.length, 1.0)),
        "raw": lambda: np.eye(len(stiffness)),
        "mass": lambda: _root_inverse_of(nominal, "mass"),
    }[reading.metric]()
    used = nominal.stiffness if reading.start == "nominal" else stiffness
    free = _unseen(nominal)
    found = la.lstsq(nominal.sensors, measured)[0]
    for j, hz in enumerate(nominal.frequencies):
        dynamic = used - (2.0 * np.pi * hz) ** 2 * nominal.mass
        left = free.T if reading.expansion == "dynamic" else scale
        found[:, j] -= free @ la.lstsq(left @ dynamic @ free, left @ dynamic @ found[:, j])[0]
    return np.asarray(found)


@lru_cache(maxsize=32)
def _unseen(nominal: Setting) -> FloatArray:
    return np.asarray(la.null_space(nominal.sensors))


@lru_cache(maxsize=32)
def _root_inverse_of(nominal: Setting, of: str) -> FloatArray:
    matrix = nominal.mass if of == "mass" else nominal.stiffness + SOFT * nominal.mass
    return _root_inverse(matrix)


def _root_inverse(matrix: FloatArray) -> FloatArray:
    values, vectors = la.eigh(matrix)
    return np.asarray(vectors / np.sqrt(values) @ vectors.T)


def _exchanged(pair: str) -> list[int]:
    order = [0, 1, 2]
    if pair:
        i, j = (int(mode) - 1 for mode in pair.split("-"))
        order[i], order[j] = j, i
    return order


def expanded(
    reading: Reading, nominal: Setting, stiffness: FloatArray, measured: FloatArray
) -> FloatArray:
    """Return the quasi-measured shapes at all dofs, (n, m)."""
    full, _, low = _paired(nominal, stiffness, measured)
    full = full[:, _exchanged(reading.mispaired)]
    seen = nominal.sensors @ full
    sign = np.sign(np.einsum("ij,ij->j", measured, seen))
    alike = measured * sign * np.linalg.norm(seen, axis=0) / np.linalg.norm(measured, axis=0)
    if reading.expansion in ("rotation", "transposed"):
        left, _, right = la.svd(alike.T @ seen)
        turn = left @ right
        return np.asarray(full @ (turn.T if reading.expansion == "rotation" else turn))
    if reading.expansion == "own":
        return full
    if reading.expansion == "all dofs":
        shapes = nominal.everywhere
    elif reading.expansion == "serep":
        basis = np.hstack([nominal.rigid, low[:, :8]])
        shapes = basis @ la.lstsq(nominal.sensors @ basis, alike)[0]
    else:
        shapes = _by_force(reading, nominal, stiffness, alike)
    gram = shapes.T @ nominal.mass @ shapes
    norm = np.sqrt(np.diagonal(gram))
    return np.asarray(shapes @ _root_inverse(gram) if reading.orthogonal else shapes / norm)


def _rows(reading: Reading, nominal: Setting, shapes: FloatArray) -> FloatArray:
    """Return what the equations of motion are multiplied with, (n_rows, n)."""
    if reading.rows in ("mass", "stiffness"):
        return _root_inverse_of(nominal, reading.rows)
    if reading.rows == "modal":
        return np.asarray(shapes.T)
    if reading.rows == "sensors":
        return nominal.sensors
    lever = nominal.length if reading.rows == "paper" else 1.0
    return np.diag(np.where(nominal.turning, 1.0 / lever, 1.0))


def system(
    reading: Reading, nominal: Setting, change: FloatArray, shapes: FloatArray, wanted: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return A, b of A x = b for changes from the nominal model, and the size of the inertia."""
    rows = _rows(reading, nominal, shapes)
    inertia = nominal.mass @ shapes * wanted
    elastic = nominal.stiffness @ shapes
    size = float(np.linalg.norm(rows @ inertia))
    forces = change @ shapes
    left, right = [], []
    if reading.motion:
        weight = 1.0 / wanted if reading.per_mode else np.ones(len(wanted))
        moved = np.tensordot(rows, forces * weight, axes=(1, 1)).transpose(0, 2, 1)
        left.append(moved.reshape(-1, len(change)))
        right.append((rows @ (inertia - elastic) * weight).ravel())
        size = size * float(np.mean(weight))
    if reading.diagonal or reading.cross:
        i, j = np.triu_indices(len(wanted))
        weight = np.where(i == j, reading.diagonal, reading.cross) * size
        weight = weight / np.sqrt(wanted[i] * wanted[j])
        energy = np.tensordot(shapes, forces, axes=(0, 1)).transpose(0, 2, 1)
        left.append(energy[i, j] * weight[:, None])
        right.append((np.diag(wanted) - shapes.T @ elastic)[i, j] * weight)
    return np.vstack(left), np.concatenate(right), size


def solution(reading: Reading, a: FloatArray, b: FloatArray, change: FloatArray) -> FloatArray:
    """Return the least-squares change, the smallest one where that is not unique."""
    unit = 1.0 / np.abs(change).max(axis=(1, 2)) if reading.absolute else np.ones(len(change))
    a = a * unit
    if reading.tikhonov:
        a = np.vstack([a, reading.tikhonov * np.linalg.norm(a, 2) * np.eye(len(change))])
        b = np.append(b, np.zeros(len(change)))
    return np.asarray(la.lstsq(a, b, cond=reading.cutoff, lapack_driver="gelsd")[0] * unit)


def nominal_of(reading: Reading) -> Setting:
    """Return the setting of a reading; other layouts than midpoints have beam data."""
    made = setting(
        reading.data, reading.layout, reading.bredt, reading.accelerometer, reading.backward
    )
    if not reading.confused:
        return made
    return replace(made, frequencies=made.frequencies[_exchanged(reading.confused)])


def predicted(reading: Reading) -> tuple[FloatArray, FloatArray]:
    """Return the three rigid and the five next frequencies of the updated model in Hz.

    Raises:
        StrategyFailure: when a measured mode has no partner on the way.
    """
    nominal = nominal_of(reading)
    change = patterns(reading.family, reading.tied, reading.only, nominal, reading.sharing)
    draw = np.random.default_rng(reading.seed).standard_normal(nominal.measured.shape)
    measured = nominal.measured + reading.noise * np.abs(nominal.measured).max(axis=0) * draw
    _, own, _ = _paired(nominal, nominal.stiffness, measured)
    hz = nominal.frequencies if reading.target == "measured" else own
    wanted, stiffness = np.square(2.0 * np.pi * hz), nominal.stiffness
    x = np.zeros(len(change))
    for _ in range(reading.iterations):
        shapes = reading.scale * expanded(reading, nominal, stiffness, measured)
        a, b, _ = system(reading, nominal, change, shapes, wanted)
        x = reading.damping * x + (1.0 - reading.damping) * solution(reading, a, b, change)
        stiffness = nominal.stiffness + np.tensordot(x, change, axes=1)
    rigid, hz, _ = modes_of(nominal, stiffness)
    return rigid, hz[:5]
