"""Frequency responses: as measured, and from modes and damping."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from femubench.core.display import Shown, count_noun
from femubench.core.errors import ModelError
from femubench.core.fem.damping import Damping
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import Modes
from femubench.core.typing import AnyArray, BoolArray, FloatArray, SparseArray

Motion: TypeAlias = Literal["receptance", "mobility", "accelerance"]
Quantity: TypeAlias = Literal[Motion, "free decay"]
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
        return self.values if DERIVATIVES[self.quantity] == 0 else self.values / self._derived

    @property
    def receptance_std(self) -> FloatArray:
        """Return the standard deviations of their real and imaginary parts; inf where unknown."""
        if self.deviations is None:
            return np.full(self.values.shape, np.inf)
        known = np.isfinite(self.values) & np.isfinite(self.deviations)
        return np.asarray(np.where(known, self.deviations, np.inf) / np.abs(self._derived))

    @property
    def _derived(self) -> AnyArray:
        """Return (i w)^k of every line, k times derived; nan at 0 Hz, (n_f, 1, 1)."""
        derivative, jw = DERIVATIVES[self.quantity], 2j * np.pi * self.frequencies
        jw[(jw == 0.0) & (derivative > 0)] = np.nan
        return np.asarray((jw**derivative)[:, None, None])

    def within(self, low: float, high: float) -> FrequencyResponses:
        """Return the lines between two frequencies in Hz."""
        return self.at_lines(in_bands(self.frequencies, [(low, high)]))

    def at_lines(self, keep: BoolArray) -> FrequencyResponses:
        """Return some of the lines, (n_f,)."""
        return self._with_values(lambda values: values[keep], frequencies=self.frequencies[keep])

    def take(self, rows: Iterable[int]) -> FrequencyResponses:
        """Return the motions of some of the response sensors, in the given order."""
        own = [int(row) for row in rows]
        return self._with_values(lambda v: v[:, own], responses=self.responses.take(own))

    def with_noise(self, rng: np.random.Generator) -> FrequencyResponses:
        """Return the same with a draw of Gaussian noise of real and imaginary parts, if known."""
        if self.deviations is None:
            return self
        real, imaginary = rng.standard_normal((2, *self.values.shape))
        return replace(self, values=self.values + self.deviations * (real + 1j * imaginary))

    def taken_as(self, quantity: Quantity, factor: float) -> FrequencyResponses:
        """Return the same numbers as those of another quantity, times a factor."""
        return self._with_values(lambda values: factor * values, quantity=quantity)

    def spread(self, responses: Sensors, references: Sensors) -> FrequencyResponses:
        """Return the same among more responses and references, nan where none was measured."""
        rows = [responses.labels.index(label) for label in self.responses.labels]
        columns = [references.labels.index(label) for label in self.references.labels]

        def wide(values: AnyArray) -> AnyArray:
            whole = np.full((len(values), len(responses), len(references)), np.nan, values.dtype)
            whole[np.ix_(range(len(values)), rows, columns)] = values
            return whole

        return self._with_values(wide, responses=responses, references=references)

    def transpose(self) -> FrequencyResponses:
        """Return the responses with forces and motions exchanged, as reciprocity allows."""
        sides = {"responses": self.references, "references": self.responses}
        return self._with_values(lambda values: values.transpose(0, 2, 1), **sides)

    def _with_values(self, of: Callable[[AnyArray], AnyArray], **more: Any) -> FrequencyResponses:  # noqa: ANN401
        deviations = None if self.deviations is None else of(self.deviations)
        return replace(self, values=of(self.values), deviations=deviations, **more)


def in_bands(frequencies: FloatArray, bands: Iterable[tuple[float, float]]) -> BoolArray:
    """Tell which frequencies lie in any of some bands, ends included, (n_f,)."""
    inside = [(frequencies >= low) & (frequencies <= high) for low, high in bands]
    return np.asarray(np.any(inside, axis=0) if inside else np.zeros(len(frequencies), dtype=bool))


@dataclass(frozen=True)
class ResponseSplit:
    """Which frequency responses a strategy is given, and which only the score sees.

    Arguments:
        used: bands of the lines that a strategy is given, in Hz.
        held_out: bands of the lines that only the score sees.
        held_out_sensors: labels of the sensors of which it sees all lines of both.
    """

    used: tuple[tuple[float, float], ...]
    held_out: tuple[tuple[float, float], ...] = ()
    held_out_sensors: tuple[str, ...] = ()

    def given(self, measured: FrequencyResponses) -> FrequencyResponses:
        """Return the used lines of the used sensors, and nothing else of the responses."""
        labels = enumerate(measured.responses.labels)
        own = [k for k, label in labels if label not in self.held_out_sensors]
        return measured.take(own).at_lines(in_bands(measured.frequencies, self.used))

    @property
    def whole(self) -> ResponseSplit:
        """Return the same with nothing held out."""
        return ResponseSplit((*self.used, *self.held_out))

    def unseen(self, measured: FrequencyResponses) -> BoolArray:
        """Tell which responses only the score sees, (n_f, n_responses)."""
        hidden = [label in self.held_out_sensors for label in measured.responses.labels]
        lines = [in_bands(measured.frequencies, own)[:, None] for own in (self.used, self.held_out)]
        return np.asarray(lines[1] | lines[0] & np.array(hidden, dtype=bool))


def receptance(
    modes: Modes,
    response: SparseArray,
    excitation: SparseArray,
    frequencies: FloatArray,
    damping: FloatArray | float | Damping = 0.0,
) -> FloatArray:
    """Return displacement over force, complex, (n_frequencies, n_response, n_excitation).

    Arguments:
        modes: mass-normalised modes, rigid-body modes included.
        response, excitation: readings and forces from dofs, (n_response, n), (n_excitation, n).
        frequencies: in Hz, (n_f,).
        damping: viscous damping ratio of every mode or of all, ignored at zero frequency; or that
            of the model.

    Raises:
        ModelError: at the very frequency of an undamped mode, such as 0 Hz of a free structure.

    Source: Ewins (2000), Modal Testing, (2.45): sum of phi_i phi_j / (lambda - w^2 + 2 i z w_r w).

    Examples:
        >>> modal.receptance(modes, readings, readings[:1], np.linspace(100.0, 300.0, 5)).shape
        (5, 13, 1)
    """
    out, into = response @ modes.shapes, excitation @ modes.shapes
    return modal_sum(modes.eigenvalues, out, into, frequencies, damping)


def modal_sum(
    eigenvalues: FloatArray,
    out: FloatArray,
    into: FloatArray,
    frequencies: FloatArray,
    damping: FloatArray | float | Damping,
) -> FloatArray:
    """Return the receptance of modes that are known at the readings alone.

    Arguments:
        eigenvalues: in rad^2/s^2, (m,).
        out, into: mass-normalised shapes at responses and forces, (n_response, m), (n_force, m).
        frequencies: in Hz, (n_f,).
        damping: as of `receptance`.

    Raises:
        ModelError: at the very frequency of an undamped mode.
    """
    compliance = 1.0 / dynamic_stiffness(eigenvalues, frequencies, damping)
    pairs = (out[:, None] * into).reshape(-1, len(eigenvalues))
    return np.asarray(compliance @ pairs.T).reshape(-1, len(out), len(into))


def dynamic_stiffness(
    eigenvalues: FloatArray, frequencies: FloatArray, damping: FloatArray | float | Damping
) -> AnyArray:
    """Return lambda - w^2 + 2 i z w_r w of modes, (n_f, m); raises ModelError where it is 0.

    Of the damping of a model it is lambda (1 + i eta) - w^2 + i w (alpha + beta lambda).
    """
    omega = 2.0 * np.pi * np.asarray(frequencies)[:, None]
    lost, growing = losses(eigenvalues, damping)
    dynamic = eigenvalues - omega**2 + 1j * (lost + omega * growing)
    if not dynamic.all():
        raise ModelError("the receptance is infinite at a frequency of an undamped mode")
    return np.asarray(dynamic)


def losses(
    eigenvalues: FloatArray, damping: FloatArray | float | Damping
) -> tuple[FloatArray, FloatArray]:
    """Return the imaginary dynamic stiffness of modes: the part that stays, and that over w."""
    if isinstance(damping, Damping):
        return damping.eta * eigenvalues, damping.alpha + damping.beta * eigenvalues
    growing = 2.0 * np.nan_to_num(damping) * np.sqrt(np.abs(eigenvalues))
    return np.zeros_like(growing), growing
