"""The promise of the matrix methods, measured: a model has given modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.errors import SelfCheckFailed
from femubench.core.fem.model import Model
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.ties import least
from femubench.core.typing import FloatArray

ALLOWED = 1e-8
# The most that is allowed of an eigenvalue, whatever the rounding.
MOST_ALLOWED = 1e-3
# The diagnostic in which a result says how far the worst used frequency is off, relative.
USED_ERROR = "used_frequency_error"
# An entry of K is rounded in its element, in the element's axes, in their sum and in the product.
_ROUNDINGS = 4.0
# A sum of k rounded products is off by less than k eps times the sum of their sizes; rows of
# assembled beams have up to about this many entries.
ROUNDED_TERMS = 32.0


def force_scale(model: Model) -> FloatArray:
    """Return factors that give forces and moments one unit, (n,).

    Examples:
        >>> update.force_scale(model).shape
        (81,)
    """
    diagonal = np.abs(model.stiffness.diagonal())
    return np.asarray(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))


def eigenvalue_rounding(model: Model, shapes: FloatArray, eigenvalues: FloatArray) -> FloatArray:
    """Return to what share rounding leaves the eigenvalues of a model unknown, (m,).

    A matrix whose entries are each off by a relative eps has eigenvalues that are off by up to
    eps |phi|' |K| |phi| / lambda: parts much stiffer than a mode needs, short links say, cancel
    in phi' K phi. No solver does better, and no check can ask for more, but a thousandth is the
    most: a strategy that makes such a model has spoilt it.

    Arguments:
        shapes: mass-normalised, (n, m).
        eigenvalues: in rad^2/s^2, (m,).

    Source: Higham & Higham (1998), "Structured backward error and condition of generalized
        eigenvalue problems".
    """
    size = np.abs(shapes)
    sums = np.einsum("ij,ij->j", size, np.abs(model.stiffness) @ size)
    share = _ROUNDINGS * np.finfo(float).eps * sums / np.abs(eigenvalues)
    return np.asarray(np.minimum(share, MOST_ALLOWED))


@dataclass(frozen=True)
class Residuals:
    """How far given shapes and eigenvalues are from modes of a model.

    Arguments:
        unbalanced: K phi - lambda M phi relative to lambda M phi, (m,).
        gains: Rayleigh quotient relative to lambda, less 1, (m,).
        products: phi_i' M phi_j - delta_ij, (m, m).
        rounding: what rounding alone can make of ``forces``: large on very fine meshes.
    """

    unbalanced: FloatArray
    gains: FloatArray
    products: FloatArray
    rounding: float

    @property
    def forces(self) -> float:
        """Return the largest unbalanced force."""
        return float(self.unbalanced.max())

    @property
    def frequencies(self) -> float:
        """Return the largest error of an eigenvalue."""
        return float(np.abs(self.gains).max())


def measure_residuals(model: Model, shapes: FloatArray, eigenvalues: FloatArray) -> Residuals:
    """Return the residuals of modes in a model.

    Arguments:
        shapes: mass-orthonormal, (n, m).
        eigenvalues: in rad^2/s^2, (m,).
    """
    scale = force_scale(model)[:, None]
    momentum, force = model.mass_times(shapes), model.stiffness_times(shapes)
    size = np.linalg.norm(scale * momentum * eigenvalues, axis=0)
    sums = np.abs(model.stiffness) @ np.abs(shapes)
    noise = ROUNDED_TERMS * np.finfo(float).eps * sums
    # Elastic forces are in balance but for rounding, and what puts them there moves every dof.
    rigid = rigid_modes_of(model)
    resultant = np.minimum(np.abs(rigid.T @ (model.stiffness @ shapes)), np.abs(rigid).T @ noise)
    noise = noise + np.abs(model.mass_times(rigid)) @ resultant
    rayleigh = np.einsum("ij,ij->j", shapes, force) / np.einsum("ij,ij->j", shapes, momentum)
    return Residuals(
        np.asarray(np.linalg.norm(scale * (force - momentum * eigenvalues), axis=0) / size),
        rayleigh / eigenvalues - 1.0,
        shapes.T @ momentum - np.eye(len(eigenvalues)),
        float((np.linalg.norm(scale * noise, axis=0) / size).max()),
    )


def check_used_modes(model: Model, shapes: FloatArray, eigenvalues: FloatArray) -> Residuals:
    """Return the residuals of the used modes if the model has these modes.

    They are allowed 1e-8, or what rounding makes of K phi and of the eigenvalue where a mesh is
    so fine, or a part so stiff, that neither can be computed as closely as that.

    Arguments:
        model: the updated model.
        shapes: expanded measured shapes, mass-orthonormal, (n, m).
        eigenvalues: measured, in rad^2/s^2, (m,).

    Raises:
        SelfCheckFailed: when they are not modes of the model.

    Examples:
        >>> used = modes.take([3, 4])
        >>> update.check_used_modes(model, used.shapes, used.eigenvalues).forces < 1e-8
        True
    """
    found = measure_residuals(model, shapes, eigenvalues)
    allowed = max(ALLOWED, found.rounding)
    hertz, error = np.sqrt(np.abs(eigenvalues)) / (2.0 * np.pi), np.abs(found.gains)
    most = min(allowed, MOST_ALLOWED)
    known = np.maximum(most, eigenvalue_rounding(model, shapes, eigenvalues))
    mode = int(least(-error / known, 1e-9))
    if not np.all(error <= known):
        ratio = float(np.sqrt(np.abs(1.0 + found.gains[mode])))
        own, percent = ratio * hertz[mode], 100.0 * (ratio - 1.0)
        raise SelfCheckFailed(
            f"the measured mode at {hertz[mode]:.5g} Hz comes out at {own:.5g} Hz in the "
            f"updated model ({percent:+.2g} %); the square of it",
            float(error[mode]),
            float(known[mode]),
        )
    mode = int(np.argmax(found.unbalanced))
    if not found.forces <= allowed:
        raise SelfCheckFailed(
            f"the measured mode at {hertz[mode]:.5g} Hz is no mode of the updated model; its "
            "stiffness forces against its inertia forces",
            found.forces,
            allowed,
        )
    off = np.abs(found.products)
    if not off.max() <= most:
        first, second = divmod(int(off.argmax()), len(off))
        raise SelfCheckFailed(
            f"the measured shapes at {hertz[first]:.5g} and {hertz[second]:.5g} Hz are not "
            "orthonormal by the mass of the updated model",
            float(off.max()),
            most,
        )
    return found
