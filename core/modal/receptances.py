"""Receptances of a model: the modes and static responses that they take, and their slopes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.damping import Damping
from femubench.core.fem.model import Model
from femubench.core.fem.slopes import MatrixSlopes
from femubench.core.modal.eigen import Modes, modes_of, modes_up_to
from femubench.core.modal.frf import dynamic_stiffness, receptance
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_measured
from femubench.core.modal.sparse_eigen import ShiftedModel
from femubench.core.typing import AnyArray, FloatArray, IntArray, SparseArray

_FEW = 100  # dofs of a model of which all modes are cheaper than what stands for most of them
_ABOVE = 1.5  # times the highest line: modes up to there are exact, the rest responds statically
_SHIFT = 0.5  # of the first elastic eigenvalue, below zero
_APART = 1e-12  # squared sine below which a response lies in the span of the others
_REPEATED = 1e-8  # of eigenvalues, relative


@dataclass(frozen=True)
class PredictedResponses:
    """What a model answers where responses were measured.

    Arguments:
        modes: as of `response_modes`.
        partner: which of them belongs to every measured mode; -1 where none does, (m,).
        at: readings and forces from dofs, and lines in Hz.
        damping: of the model; where nothing is known of it the ratio of every mode, that of its
            measured partner.
    """

    modes: Modes
    partner: IntArray
    at: tuple[SparseArray, SparseArray, FloatArray]
    damping: FloatArray | Damping

    @classmethod
    def of(cls, model: Model, measured: Measurement) -> PredictedResponses:
        """Return the answer of a model; raises ModelError without modes, NotApplicable."""
        if (at := measured.responses) is None:
            raise NotApplicable("no frequency responses are given: frfs and responses in the case")
        rows = model.observe(at.responses), model.observe(at.references)
        modes = response_modes(model, sp.vstack(rows, format="csr"), float(at.frequencies[-1]))
        readings = np.asarray(model.observe(measured.sensors) @ modes.shapes)
        partner = pair_measured(measured, modes, readings).index
        damping = model.damping or measured.damping_of(partner, len(modes))
        return cls(modes, partner, (*rows, at.frequencies), damping)

    @cached_property
    def receptances(self) -> AnyArray:
        """Return displacement over force, complex, like the measured ones."""
        return receptance(self.modes, *self.at, self.damping)

    @property
    def ratios(self) -> FloatArray:
        """Return the viscous damping ratio of every mode, (m,)."""
        own = self.damping
        return own.ratios(self.modes.eigenvalues) if isinstance(own, Damping) else own

    @cached_property
    def read(self) -> tuple[FloatArray, FloatArray]:
        """Return the shapes at responses and forces, (n_responses, m), (n_references, m)."""
        out, into = (np.asarray(rows @ self.modes.shapes) for rows in self.at[:2])
        return out, into

    @cached_property
    def dynamic(self) -> AnyArray:
        """Return the dynamic stiffness of every mode at every line, complex, (n_f, m)."""
        return dynamic_stiffness(self.modes.eigenvalues, self.at[2], self.damping)

    def exert(self, motions: AnyArray, slopes: MatrixSlopes) -> Iterator[AnyArray]:
        """Yield the forces dZ q of the slope of each parameter, of motions q, (m, n_f, n) both."""
        return _exerted(self.modes, motions, self.at[2], slopes, self.damping)

    def slopes(self, slopes: MatrixSlopes) -> AnyArray:
        """Return those of the receptances by parameters, of the slopes of the matrices."""
        return receptance_slopes(self.modes, *self.at, slopes, self.damping)


def response_modes(model: Model, rows: SparseArray, highest: float) -> Modes:
    """Return what gives receptances at rows up to a frequency: all modes of a small model.

    Of a large one these are the modes up to 1.5 times the frequency and, behind them, what the
    static response to forces along the rows adds: vectors orthogonal to the modes, each with
    the eigenvalue of its Rayleigh quotient, which stand for all modes above.

    Arguments:
        model: any model; where forces act it has mass.
        rows: readings and forces from dofs, (n_rows, n).
        highest: frequency in Hz.

    Raises:
        ModelError: when the model has no modes.

    Source: MacNeal (1971), A hybrid method of component mode synthesis: residual flexibility.
    """
    if model.size <= _FEW:
        return modes_of(model)
    modes = modes_up_to(model, _ABOVE * highest)
    elastic = np.abs(modes.eigenvalues[~modes.rigid])
    if not len(elastic):
        raise ModelError("the model has no elastic mode")
    shift = min(-_SHIFT * float(elastic.min()), 2.0 * float(modes.eigenvalues.min()))
    momentum = model.mass_times(modes.shapes)
    force = np.asarray(rows.T.toarray())
    moved = ShiftedModel(model, shift).solve(force - momentum @ (modes.shapes.T @ force))
    for _ in range(2):  # the second time what rounding left of the modes
        moved -= modes.shapes @ (momentum.T @ moved)
        size = np.sqrt(np.einsum("ij,ij->j", moved, model.mass_times(moved)))
        moved = moved[:, size > 0.0] / size[size > 0.0]
        values, turn = np.linalg.eigh(moved.T @ model.mass_times(moved))
        kept = values > _APART * max(values[-1:], default=0.0)
        moved = moved @ (turn[:, kept] / np.sqrt(values[kept]))
    values, turn = np.linalg.eigh(moved.T @ model.stiffness_times(moved))
    return Modes(
        np.concatenate([modes.eigenvalues, values]),
        np.hstack([modes.shapes, moved @ turn]),
        np.append(modes.rigid, np.zeros(len(values), dtype=bool)),
    )


def receptance_slopes(
    modes: Modes,
    response: SparseArray,
    excitation: SparseArray,
    frequencies: FloatArray,
    slopes: MatrixSlopes,
    damping: FloatArray | float | Damping = 0.0,
) -> AnyArray:
    """Return d receptance / d parameter, complex, (n_frequencies, n_response, n_excitation, p).

    dH = -H dZ H with dZ = dK - w^2 dM + i w dC. The damping of a model stays in proportion to its
    matrices; else the ratio of every mode stays, so that the damping C = sum 2 z_r w_r M phi_r
    phi_r' M moves with the modes.

    Arguments:
        modes: mass-normalised; all of them give exact slopes, those of `response_modes` of a large
            model slopes that are as good as its receptances.
        response, excitation, frequencies, damping: as of `receptance`.
        slopes: of the matrices, such as `ParametricModel.slopes` gives.

    Raises:
        ModelError: at the very frequency of an undamped mode.

    Source: Lin & Ewins (1990), the linear term of their equation; Fox & Kapoor (1968) for dC.
    """
    out, into = (np.asarray(rows @ modes.shapes) for rows in (response, excitation))
    compliance = 1.0 / dynamic_stiffness(modes.eigenvalues, frequencies, damping)
    read = compliance[:, None, :] * out  # (n_f, n_response, m)
    found = np.empty((len(read), len(out), len(into), slopes.count), dtype=complex)
    coordinates = compliance.T[:, :, None] * into.T[:, None, :]
    for p, exerted in enumerate(_exerted(modes, coordinates, frequencies, slopes, damping)):
        found[..., p] = -read @ np.broadcast_to(exerted, coordinates.shape).transpose(1, 0, 2)
    return found


def paired_slopes(
    modes: Modes,
    out: FloatArray,
    into: FloatArray,
    frequencies: FloatArray,
    slopes: MatrixSlopes,
    damping: FloatArray | Damping,
) -> AnyArray:
    """Return `receptance_slopes` of one response and one force at each frequency, (k, p).

    Arguments:
        out, into: shapes at the response and at the force of every frequency, (k, m).
    """
    compliance = 1.0 / dynamic_stiffness(modes.eigenvalues, frequencies, damping)
    read, coordinates = (compliance * out).T, (compliance * into).T[:, :, None]
    found = np.empty((len(compliance), slopes.count), dtype=complex)
    for p, exerted in enumerate(_exerted(modes, coordinates, frequencies, slopes, damping)):
        found[:, p] = -np.einsum("mk,mk->k", read, exerted[..., 0])
    return found


def _exerted(
    modes: Modes,
    coordinates: AnyArray,
    frequencies: FloatArray,
    slopes: MatrixSlopes,
    damping: FloatArray | float | Damping,
) -> Iterator[AnyArray]:
    """Yield what the slope of each parameter exerts on motions, dZ q, in modes, (m, n_f, n).

    Arguments:
        coordinates: q, modal, under n forces at every frequency, (m, n_f, n).
    """
    # As pairs of real numbers.
    pairs = np.ascontiguousarray(coordinates.reshape(len(modes), -1)).view(float)
    of_stiffness: FloatArray | float
    of_mass: FloatArray | float
    if isinstance(damping, Damping):
        of_stiffness, of_mass, loss = damping.beta, damping.alpha, damping.eta
    else:
        ratio = np.broadcast_to(np.nan_to_num(np.asarray(damping, dtype=float)), len(modes))
        (of_stiffness, of_mass), loss = _damping_slopes(modes.eigenvalues, ratio), 0.0
    omega = 2.0 * np.pi * np.asarray(frequencies)[None, :, None]
    stiffness = slopes.inner(modes.shapes, modes.shapes)
    mass = slopes.inner(modes.shapes, modes.shapes, "mass")
    for k, m in zip(stiffness, mass, strict=True):
        parts = (k, m, of_stiffness * k + of_mass * m)
        force, inertia, damped = (
            (part @ pairs).view(complex).reshape(coordinates.shape)
            if part.any()
            else np.zeros((len(modes), 1, 1))
            for part in parts
        )
        elastic = (1.0 + 1j * loss) * force
        yield np.asarray(elastic - np.square(omega) * inertia + 1j * omega * damped)


def _damping_slopes(eigenvalues: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return G and L, (m, m), with phi_r' dC phi_s = G_rs phi_r' dK phi_s + L_rs phi_r' dM phi_s.

    With h = z w and g = lambda_r - lambda_s they are 2 (h_r - h_s) / g and 2 (lambda_r h_s -
    lambda_s h_r) / g. Modes that share an eigenvalue have their mean ratio.
    """
    root = np.sqrt(np.abs(eigenvalues))
    half, gap = ratio * root, eigenvalues[:, None] - eigenvalues
    total = root[:, None] + root
    same = np.abs(gap) <= _REPEATED * np.maximum(np.square(total), 1.0)
    gap, total = np.where(same, np.inf, gap), np.where(total > 0.0, total, np.inf)
    mean = np.where(same, ratio[:, None] + ratio, 0.0) / total
    crossed = eigenvalues[:, None] * half
    of_stiffness = 2.0 * (half[:, None] - half) / gap + mean
    of_mass = 2.0 * (crossed - crossed.T) / gap + mean * np.outer(root, root)
    return of_stiffness, of_mass
