"""Poles of frequency responses by least squares in the complex frequency domain, by order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from femubench.core.typing import FloatArray, IntArray

ComplexArray = Any

_CIRCLE = 0.96  # of the unit circle, that the band fills; the rest keeps its ends apart
_RIDGE = 1e-9  # of the lines: the gap leaves some polynomials undetermined


@dataclass(frozen=True)
class Poles:
    """Poles of models of several orders.

    Arguments:
        values: in rad/s, the imaginary part positive, (n,).
        orders: number of poles of the model that each is from, (n,).
        participation: of the references, of unit length, complex, (n, n_references).
    """

    values: ComplexArray
    orders: IntArray
    participation: ComplexArray

    def __len__(self) -> int:
        return len(self.values)

    @property
    def frequencies(self) -> FloatArray:
        """Return the natural frequencies in Hz, (n,)."""
        return np.asarray(np.abs(self.values) / (2.0 * np.pi))

    @property
    def damping(self) -> FloatArray:
        """Return the damping ratios, negative for what grows, (n,)."""
        return np.asarray(-self.values.real / np.abs(self.values))

    def select(self, keep: Any) -> Poles:  # noqa: ANN401 - a mask or indices
        """Return some of them."""
        return Poles(self.values[keep], self.orders[keep], self.participation[keep])


def lscf_poles(frequencies: FloatArray, responses: ComplexArray, largest: int) -> Poles:
    """Return the poles of models with up to so many poles.

    A right matrix fraction H = B(z) A(z)^-1 with complex coefficients in z, which runs once
    around the unit circle from the lowest to the highest line. The lowest coefficient of A is
    one: poles that only follow noise then grow, and are distinguished from decaying ones.

    Arguments:
        frequencies: at even distances, in Hz, (n_f,).
        responses: weighted, (n_f, n_out, n_ref), finite.

    Source: Guillaume, Verboven, Vanlanduit, Van der Auweraer & Peeters (2003), A poly-reference
        implementation of the least-squares complex frequency-domain estimator, (6)-(14);
        Cauberghe (2004), Applied frequency-domain system identification, section 5.3, for the
        constraint.
    """
    references = responses.shape[2]
    span = frequencies[-1] - frequencies[0]
    step = _CIRCLE / span  # s
    phase = 2.0 * np.pi * step * (frequencies - frequencies[0])
    most = max(2, largest // references)
    basis = np.exp(1j * phase[:, None] * np.arange(most + 1))  # (n_f, most + 1)
    lags = basis.conj().T  # z^-d
    own = lags.sum(axis=1)
    crossed = np.tensordot(lags, responses, axes=(1, 0))  # (d, out, ref)
    back = np.tensordot(basis.T, responses, axes=(1, 0))
    squares = np.einsum("fop,foq->fpq", responses.conj(), responses)
    powers = np.tensordot(lags, squares, axes=(1, 0))  # (d, ref, ref)
    found = []
    for order in range(max(2, most // 4), most + 1, max(1, most // 48)):
        values, left = _poles_of_order(order, own, crossed, back, powers, len(frequencies))
        # The lines lie within the angles 0 and 2 pi _CIRCLE; half of the gap belongs to each end.
        angle = np.mod(values.imag + np.pi * (1 - _CIRCLE), 2 * np.pi) - np.pi * (1 - _CIRCLE)
        s = (values.real + 1j * angle) / step + 2j * np.pi * frequencies[0]
        found.append(Poles(s, np.full(len(s), order * references), left))
    return Poles(
        np.concatenate([poles.values for poles in found]),
        np.concatenate([poles.orders for poles in found]),
        np.concatenate([poles.participation for poles in found]),
    )


def _poles_of_order(
    order: int,
    own: ComplexArray,
    crossed: ComplexArray,
    back: ComplexArray,
    powers: ComplexArray,
    lines: int,
) -> tuple[ComplexArray, ComplexArray]:
    """Return the logarithms of the poles in z and their participations.

    Arguments:
        order: of the polynomials.
        own, crossed, powers: sums over the lines of z^-d times 1, H and H^H H, by d from 0.
        back: the sums of z^d times H.
        lines: their number.
    """
    n, references = order + 1, powers.shape[1]
    index = np.subtract.outer(np.arange(n), np.arange(n))  # row j, column k: z^(k - j)
    normal = scipy.linalg.toeplitz(own[:n], own[:n].conj())
    normal[np.diag_indices(n)] += _RIDGE * lines
    both = np.concatenate([back[1:n][::-1], crossed[:n]])  # z^(n-1) ... z^0 ... z^-(n-1)
    mixed = both[index + n - 1]  # (j, k, out, ref)
    whole = np.concatenate([powers[1:n][::-1].conj().transpose(0, 2, 1), powers[:n]])
    reduced = whole[index + n - 1].transpose(0, 2, 1, 3).reshape(n * references, n * references)
    stacked = mixed.transpose(2, 0, 1, 3).reshape(-1, n, n * references)
    lower = np.linalg.cholesky(normal)
    for block in stacked:
        half = scipy.linalg.solve_triangular(lower, block, lower=True, check_finite=False)
        reduced -= half.conj().T @ half
    rest = reduced[references:, references:]
    tail = scipy.linalg.solve(rest, -reduced[references:, :references], assume_a="her")
    blocks = tail.reshape(order, references, references)
    size = order * references
    companion = np.zeros((size, size), dtype=complex)
    # Transposed, for the left null vectors; in 1/z, of which the leading term is one.
    companion[:references] = np.concatenate([-block.T for block in blocks], axis=1)
    companion[references:, :-references] = np.eye(size - references)
    inverse, vectors = np.linalg.eig(companion)
    inverse = np.where(inverse == 0.0, np.finfo(float).tiny, inverse)
    left = vectors[-references:].T
    left = left / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), np.finfo(float).tiny)
    return -np.log(inverse), left
