"""The error in the constitutive relation of frequency responses, line by line and force by force.

At a line of angular frequency w and under a force f, u is a motion near the readings, and v one
whose stresses are in equilibrium: K v + (i w C - w^2 M) u = f. The energy of u - v is the error of
the stiffness. In the modes of the model, mass-normalised, all is diagonal but the readings: with
z = lambda - w^2 + i w c a mode of the forced motion f/z moves by e more, u - v = z e / lambda, and
the least error of motions Y e that bring the readings near the measured ones is that of as many
equations as there are sensors, whose matrix is Y (lambda / |z|^2) Y' + 1/precision.

Source: Deraemaeker, Ladeveze & Leconte (2002), forced vibrations; u - v as a multiplier makes the
error stationary, so that its slope takes no derivative of the pair.
"""

from __future__ import annotations

import numpy as np

from femubench import Measurement, NotApplicable
from femubench.fem import FloatArray
from femubench.update import ParametricModel


def forced_energy(parts: ParametricModel, measurement: Measurement, x: FloatArray) -> FloatArray:
    """Return the strain energy of every line and force, as large as its readings, (n_f, n_ref).

    Arguments:
        parts: the nominal model and its changes.
        measurement: with responses and their deviations.
        x: coordinates of the model whose forced motions they are, (p,).

    Raises:
        NotApplicable: where no responses are given, or none with a deviation.
    """
    answer, _ = parts.answer(x, measurement)
    weight, reading = _weighted(measurement)
    if not reading.any():
        raise NotApplicable("no given frequency response has a standard deviation")
    elastic = np.maximum(answer.modes.eigenvalues, 0.0)
    motions = answer.read[1].T[:, None] / answer.dynamic.T[:, :, None]
    energy = 0.5 * np.einsum("m,mfr->fr", elastic, np.square(np.abs(motions)))
    size, own = (
        np.square(np.abs(values)).sum(axis=1) for values in (reading, weight * answer.receptances)
    )
    there = size > 0.0
    return np.asarray(np.where(there, energy * size / np.where(there, own, 1.0), 1.0))


def response_error(
    parts: ParametricModel,
    measurement: Measurement,
    energy: FloatArray,
    x: FloatArray,
    weight: float,
) -> tuple[float, FloatArray, FloatArray]:
    """Return the error of all lines and forces, its slopes, (p,), and every zone's share, (p,).

    Arguments:
        parts: the nominal model and its changes.
        measurement: with responses and their deviations.
        energy: that counts as 1, of every line and force, (n_f, n_ref).
        x: coordinates, (p,).
        weight: of the misfit of the readings, r/(1 - r).
    """
    answer, slopes = parts.answer(x, measurement)
    (out, into), dynamic = answer.read, answer.dynamic
    precise, reading = _weighted(measurement)
    size = np.square(np.abs(reading)).sum(axis=1)
    loose = np.where(size > 0.0, size / (2.0 * weight * energy), 1.0)
    spread = np.maximum(answer.modes.eigenvalues, 0.0) / np.square(np.abs(dynamic))
    reach = (out * spread[:, None]) @ out.T
    own = precise.transpose(0, 2, 1)
    matrix = own[..., :, None] * reach[:, None] * own[..., None, :]
    matrix = matrix + loose[..., None, None] * np.eye(len(out))
    missed = (reading - precise * answer.receptances).transpose(0, 2, 1)
    held = np.linalg.solve(matrix, missed[..., None])[..., 0]
    cost = 0.5 * float(((held.conj() * missed).real.sum(axis=-1) / energy).sum())
    forces = (own * held) @ out
    apart = forces / dynamic.conj()[:, None]  # u - v, of motions of the body their multiplier
    motions = into / dynamic[:, None] + spread[:, None] * forces
    share = apart / energy[..., None]
    by_mode = np.ascontiguousarray(motions.transpose(2, 0, 1))
    pulls = [
        float((share.transpose(2, 0, 1).conj() * exerted).real.sum())
        for exerted in answer.exert(by_mode, slopes)
    ]
    outer = np.einsum("fri,frj->ij", share, apart.conj()).real
    shapes = answer.modes.shapes
    strain = 0.5 * np.einsum("pij,ij->p", slopes.inner(shapes, shapes), outer)
    steps = parts.steps(x)
    return cost, (np.array(pulls) - strain) * steps, np.abs(strain * steps)


def _weighted(measurement: Measurement) -> tuple[FloatArray, FloatArray]:
    """Return 1/sigma of the receptances, 0 where there is none, and these times it."""
    assert measurement.responses is not None
    weight = 1.0 / measurement.responses.receptance_std
    known = np.where(weight > 0.0, measurement.responses.receptances, 0.0)
    return weight, weight * known
