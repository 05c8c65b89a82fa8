"""The functions of frequency that a modal model is a sum of, and their products with the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.typing import AnyArray, FloatArray

# Places of stand-ins for the modes beyond the ends of the band, in units of these ends: with
# residues of their own in every channel they take what a constant and 1/w^2 leave.
_BEYOND = (1.04, 1.12, 1.3, 2.0)
RESIDUALS = 2 * (2 + 2 * len(_BEYOND))  # real numbers of a channel


@dataclass(frozen=True)
class Lines:
    """Measured lines, whitened.

    Arguments:
        omega: in rad/s, (n_f,).
        derivative: how often displacement was derived with respect to time: 0, 1 or 2.
        values: real and imaginary parts one above the other, (2 n_f, n_out, n_ref).
        noise: standard deviation of every line's noise over that of the channel, (n_f,).
    """

    omega: FloatArray
    derivative: int
    values: FloatArray
    noise: FloatArray

    @staticmethod
    def of(omega: FloatArray, derivative: int, responses: AnyArray, noise: FloatArray) -> Lines:
        """Return the lines of complex responses, (n_f, n_out, n_ref)."""
        scaled = responses / noise[:, None, None]
        return Lines(omega, derivative, np.concatenate([scaled.real, scaled.imag]), noise)

    @property
    def responses(self) -> AnyArray:
        """Return the lines as complex numbers, whitened, (n_f, n_out, n_ref)."""
        half = len(self.omega)
        return np.asarray(self.values[:half] + 1j * self.values[half:])

    @property
    def raw(self) -> AnyArray:
        """Return the lines as measured, complex, (n_f, n_out, n_ref)."""
        return np.asarray(self.responses * self.noise[:, None, None])

    def modes(self, poles: AnyArray) -> FloatArray:
        """Return what residues and changes of poles multiply, (2 n_f, n, 4).

        For a complex residue a and a change d of the pole s, the first two columns take the real
        and imaginary part of a, the last two those of a d.

        Arguments:
            poles: in rad/s, (n,).
        """
        jw = 1j * self.omega[:, None]
        weight = (jw**self.derivative) / self.noise[:, None]
        own, mirrored = 1.0 / (jw - poles), 1.0 / (jw - poles.conj())
        found = np.empty((len(self.values), len(poles), 4))
        half = len(self.omega)
        for k in (0, 1):
            x, y = weight * own, weight * mirrored
            pair = x + y, 1j * (x - y)
            for column, values in enumerate(pair, start=2 * k):
                found[:half, :, column], found[half:, :, column] = values.real, values.imag
            own, mirrored = own**2, mirrored**2
        return found

    def residuals(self) -> FloatArray:
        """Return what stands for the modes outside of the band, (2 n_f, RESIDUALS)."""
        low, high = self.omega[0], self.omega[-1]
        square = np.square(self.omega)[:, None]
        poles = np.square([*(high * k for k in _BEYOND), *(low / k for k in _BEYOND)])
        shapes = np.concatenate(
            [np.ones_like(square), high**2 / square, high**2 / (poles - square)], axis=1
        )
        weighted = ((1j * self.omega) ** self.derivative / self.noise)[:, None] * shapes
        stacked = np.concatenate([weighted, 1j * weighted], axis=1)
        return np.concatenate([stacked.real, stacked.imag])


@dataclass(frozen=True)
class Products:
    """Inner products over the lines, in which everything else is a small problem.

    Arguments:
        gram: of the functions: 4 a mode, mode by mode, then those of the residuals.
        data: of functions and data, (4 n + 4, n_out, n_ref).
        squares: of the data, (n_out, n_ref).
    """

    gram: FloatArray
    data: FloatArray
    squares: FloatArray

    @staticmethod
    def of(lines: Lines, poles: AnyArray) -> Products:
        """Return the products for some poles."""
        functions = lines.modes(poles).reshape(len(lines.values), -1)
        functions = np.concatenate([functions, lines.residuals()], axis=1)
        flat = lines.values.reshape(len(lines.values), -1)
        data = (functions.T @ flat).reshape(-1, *lines.values.shape[1:])
        return Products(functions.T @ functions, data, np.square(lines.values).sum(axis=0))


def turning(values: AnyArray) -> FloatArray:
    """Return the matrix that multiplies pairs (real, imaginary) by complex numbers, (2 n, 2 n)."""
    n = len(values)
    found = np.zeros((n, 2, n, 2))
    at = np.arange(n)
    found[at, 0, at, 0] = found[at, 1, at, 1] = values.real
    found[at, 0, at, 1], found[at, 1, at, 0] = -values.imag, values.imag
    return found.reshape(2 * n, 2 * n)
