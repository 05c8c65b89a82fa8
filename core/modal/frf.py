"""Frequency responses: as measured, and from modes and damping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from femubench.core.display import Shown, count_noun
from femubench.core.errors import ModelError
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import Modes
from femubench.core.typing import AnyArray, FloatArray, SparseArray

Quantity: TypeAlias = Literal["receptance", "mobility", "accelerance", "free decay"]
# How often displacement was derived with respect to time.
DERIVATIVES: dict[str, int] = {"receptance": 0, "mobility": 1, "accelerance": 2, "free decay": 0}


@dataclass(frozen=True, repr=False)
class FrequencyResponses(Shown):
    """Measured frequency responses between points of a structure.

    Arguments:
        responses: where and along what the motion was measured; coordinates nan where unknown.
        references: where and along what the force acted.
        frequencies: in Hz, rising, (n_f,).
        values: motion over force in m, m/s or m/s2 over N, complex, (n_f, n_responses,
            n_references); nan in the whole of a channel that was not measured.
        quantity: what the motion is; of a free decay, whatever it is, its spectrum: every decay
            is a reference then.
        deviations: standard deviations of real and imaginary parts, from the coherence, like
            `values`; None where they are not known.
        decay: of the exponential window that was laid over what they come from, in 1/s.

    Examples:
        >>> print(modal.FrequencyResponses(sensors, force, lines, curves))
        FrequencyResponses: receptance of 13 responses to 1 force
          lines  401, 200 to 300 Hz
    """

    responses: Sensors
    references: Sensors
    frequencies: FloatArray
    values: AnyArray
    quantity: Quantity = "receptance"
    deviations: FloatArray | None = None
    decay: float = 0.0

    def rows(self) -> list[tuple[str, str]]:
        """Return what was measured, where, and the band."""
        sizes = (
            count_noun(len(self.responses), "response"),
            count_noun(len(self.references), "force"),
        )
        low, high = (f"{hz:.6g}" for hz in self.frequencies[[0, -1]])
        return [
            ("", f"{self.quantity} of {sizes[0]} to {sizes[1]}"),
            ("lines", f"{len(self.frequencies)}, {low} to {high} Hz"),
        ]

    @property
    def receptances(self) -> AnyArray:
        """Return displacement over force in m/N; nan at 0 Hz where motion was no displacement."""
        derivative = DERIVATIVES[self.quantity]
        if not derivative:
            return self.values
        jw = 2j * np.pi * self.frequencies
        jw[jw == 0.0] = np.nan
        return np.asarray(self.values / (jw**derivative)[:, None, None])

    def within(self, low: float, high: float) -> FrequencyResponses:
        """Return the lines between two frequencies in Hz."""
        keep = (self.frequencies >= low) & (self.frequencies <= high)
        return self._with_values(lambda values: values[keep], frequencies=self.frequencies[keep])

    def transpose(self) -> FrequencyResponses:
        """Return the responses with forces and motions exchanged, as reciprocity allows."""
        sides = {"responses": self.references, "references": self.responses}
        return self._with_values(lambda values: values.transpose(0, 2, 1), **sides)

    def _with_values(self, of: Callable[[AnyArray], AnyArray], **more: Any) -> FrequencyResponses:  # noqa: ANN401
        deviations = None if self.deviations is None else of(self.deviations)
        return replace(self, values=of(self.values), deviations=deviations, **more)


def receptance(
    modes: Modes,
    response: SparseArray,
    excitation: SparseArray,
    frequencies: FloatArray,
    damping: FloatArray | float = 0.0,
) -> FloatArray:
    """Return displacement over force, complex, (n_frequencies, n_response, n_excitation).

    Arguments:
        modes: mass-normalised modes, rigid-body modes included.
        response, excitation: readings and forces from dofs, (n_response, n), (n_excitation, n).
        frequencies: in Hz, (n_f,).
        damping: viscous damping ratio of every mode or of all; ignored at zero frequency.

    Raises:
        ModelError: at the very frequency of an undamped mode, such as 0 Hz of a free structure.

    Source: Ewins (2000), Modal Testing, (2.45): sum of phi_i phi_j / (lambda - w^2 + 2 i z w_r w).

    Examples:
        >>> modal.receptance(modes, readings, readings[:1], np.linspace(100.0, 300.0, 5)).shape
        (5, 13, 1)
    """
    ratio = np.broadcast_to(np.nan_to_num(np.asarray(damping, dtype=float)), len(modes))
    out, into = response @ modes.shapes, excitation @ modes.shapes
    return modal_sum(modes.eigenvalues, out, into, frequencies, ratio)


def modal_sum(
    eigenvalues: FloatArray,
    out: FloatArray,
    into: FloatArray,
    frequencies: FloatArray,
    damping: FloatArray | float,
) -> FloatArray:
    """Return the receptance of modes that are known at the readings alone.

    Arguments:
        eigenvalues: in rad^2/s^2, (m,).
        out, into: mass-normalised shapes at responses and forces, (n_response, m), (n_force, m).
        frequencies: in Hz, (n_f,).
        damping: viscous damping ratio of every mode, or of all.

    Raises:
        ModelError: at the very frequency of an undamped mode.
    """
    omega = 2.0 * np.pi * np.asarray(frequencies)[:, None]
    root = np.sqrt(np.abs(eigenvalues))
    dynamic = eigenvalues - omega**2 + 2j * damping * root * omega
    if not dynamic.all():
        raise ModelError("the receptance is infinite at a frequency of an undamped mode")
    return np.asarray(np.einsum("im,fm,jm->fij", out, 1.0 / dynamic, into))
