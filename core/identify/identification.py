"""Modes from frequency responses: poles, selection and fit in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.display import Shown, counted
from femubench.core.errors import InputError
from femubench.core.fem.sensors import Sensors
from femubench.core.identify.basis import RESIDUALS, Lines
from femubench.core.identify.clusters import Cluster, clusters_of
from femubench.core.identify.complexity import mean_phase_deviation, phase_collinearity
from femubench.core.identify.lscf import Poles, lscf_poles
from femubench.core.identify.modal_fit import ModalFit, fit_modes, predicted
from femubench.core.identify.selection import explained, least_gain, select
from femubench.core.modal.complex_modes import mean_phase
from femubench.core.modal.frf import DERIVATIVES, FrequencyResponses
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import AnyArray, FloatArray

MOST_POLES = 120
_LARGEST_DAMPING = 0.2
_SUPPORT = 0.3  # of the orders, that a candidate appears in
_FEWEST_LINES = 32
_ROUNDS = 4
_WINDOW = 61  # lines over which the level of the noise is averaged


@dataclass(frozen=True, repr=False)
class Identification(Shown):
    """Modes that were identified from measured responses, by frequency.

    Arguments:
        sensors: where the shapes are known.
        frequencies: natural frequencies in Hz, (m,).
        frequency_std: their standard deviations in Hz, (m,).
        damping: viscous damping ratios, (m,).
        damping_std: their standard deviations, (m,).
        shapes: complex, turned to be as real as they can, the largest real part 1, (n_sensors, m).
        shape_std: standard deviations of the real parts, (n_sensors, m).
        support: share of the model orders that have the pole, (m,).
        poles: of all orders, for a stabilisation diagram.
        band: that was looked at, in Hz.
        measured: the responses in the band; None where no force was measured.
        synthesised: the same channels from the fit, in the quantity of `measured`.
        spectrum: largest singular value of the spectra in dB by frequency in Hz, where no force
            was measured, (n_f, 2).
        beyond: number of modes beyond the ends of the band that the fit needed.
    """

    sensors: Sensors
    frequencies: FloatArray
    frequency_std: FloatArray
    damping: FloatArray
    damping_std: FloatArray
    shapes: AnyArray
    shape_std: FloatArray
    support: FloatArray
    poles: Poles
    band: tuple[float, float]
    measured: FrequencyResponses | None = None
    synthesised: AnyArray | None = None
    spectrum: FloatArray | None = None
    beyond: int = 0

    def __len__(self) -> int:
        return len(self.frequencies)

    def rows(self) -> list[tuple[str, str]]:
        """Return frequency, damping and collinearity of every mode."""
        low, high = self.band
        found = [("", f"{counted(len(self), 'mode')} from {low:.6g} to {high:.6g} Hz")]
        for k in range(len(self)):
            text = f"{self.frequencies[k]:.6g} Hz, std {self.frequency_std[k]:.2g} Hz"
            text += f", damping {self.damping[k]:.3g}, MPC {self.collinearity[k]:.3f}"
            found.append((f"mode {k + 1}", text))
        return found

    @property
    def collinearity(self) -> FloatArray:
        """Return the modal phase collinearity of every mode, 1 for a real one, (m,)."""
        return phase_collinearity(self.shapes)

    @property
    def phase_deviation(self) -> FloatArray:
        """Return the mean phase deviation of every mode in degrees, 0 for a real one, (m,)."""
        return mean_phase_deviation(self.shapes)

    @property
    def measurement(self) -> Measurement:
        """Return the modes as a case has them; shapes are the real parts."""
        return Measurement(
            sensors=self.sensors,
            numbers=tuple(range(1, len(self) + 1)),
            frequencies=self.frequencies,
            frequency_std=self.frequency_std,
            damping=self.damping,
            shapes=np.asarray(self.shapes.real),
            shape_std=self.shape_std,
        )


def identify_responses(
    measured: FrequencyResponses,
    band: tuple[float, float] | None = None,
    most_poles: int = MOST_POLES,
) -> Identification:
    """Return the modes in a band of frequency responses.

    Arguments:
        measured: the responses; the more numerous of its two sides carries the shapes.
        band: lowest and highest frequency in Hz; None for all lines.
        most_poles: of the largest model of the stabilisation diagram.

    Raises:
        InputError: when there are too few lines, or no mode stands out of the noise.
    """
    data, values = _usable(measured, band)
    seen = np.isfinite(values).all(axis=0)
    values = np.where(seen, values, 0.0)
    poles = _all_poles(data.frequencies, values, seen, most_poles)
    orders = len(np.unique(poles.orders))
    able = (poles.damping > 1e-6) & (poles.damping < _LARGEST_DAMPING)
    clusters = [c for c in clusters_of(poles.select(able), orders) if c.support >= _SUPPORT]
    lines = Lines.of(
        2.0 * np.pi * data.frequencies,
        DERIVATIVES[data.quantity],
        values,
        np.ones(len(values)),
    )
    fit, lines = _fitted(lines, clusters, seen)
    return _identification(data, fit, lines, clusters, poles)


def _usable(
    measured: FrequencyResponses, band: tuple[float, float] | None
) -> tuple[FrequencyResponses, AnyArray]:
    """Return the lines to work with, responses the longer side, and their values."""
    data = measured if band is None else measured.within(*band)
    data = data.within(np.nextafter(0.0, 1.0), np.inf)
    if len(data.references) > len(data.responses):
        data = data.turned()
    if len(data.frequencies) < _FEWEST_LINES:
        what = f"{len(data.frequencies)} lines above 0 Hz in the band"
        raise InputError(what, key="band", expected=f"{_FEWEST_LINES} or more")
    if not np.abs(np.nan_to_num(data.values)).any():
        raise InputError("all responses are zero", expected="measured responses")
    return data, data.values


def _all_poles(frequencies: FloatArray, values: AnyArray, seen: AnyArray, most_poles: int) -> Poles:
    """Return the poles of all orders, from the references that most responses were measured to."""
    whole = seen.all(axis=1)
    references = np.arange(seen.shape[1])
    if not whole.any():
        references = np.array([int(seen.sum(axis=0).argmax())])
        whole = seen[:, references[0]]
    part = values[:, whole][:, :, references]
    size = np.sqrt(np.square(np.abs(part)).mean(axis=0))
    rows = np.sqrt(np.square(size).mean(axis=1, keepdims=True))
    rows[rows == 0.0] = 1.0
    columns = np.sqrt(np.square(size / rows).mean(axis=0))
    columns[columns == 0.0] = 1.0
    # A weight for every response and one for every force: more would make residues of rank one
    # residues of any rank.
    found = lscf_poles(frequencies, part / rows / columns, min(most_poles, len(frequencies) // 2))
    forces = np.zeros((len(found), seen.shape[1]), dtype=complex)
    forces[:, references] = found.participation * columns
    forces /= np.linalg.norm(forces, axis=1, keepdims=True)
    return replace(found, participation=forces)


def _fitted(lines: Lines, clusters: Sequence[Cluster], seen: AnyArray) -> tuple[ModalFit, Lines]:
    """Return the fit of all modes that the data need, and the data with the noise they show."""
    candidates = np.array([c.pole for c in clusters])
    participation = np.array([c.participation for c in clusters]).T
    weights = _first_weights(lines, candidates, seen)
    chosen = select(lines, candidates, weights, np.zeros(0, dtype=complex))
    if not len(chosen):
        raise InputError("no mode stands out of the noise", expected="resonances in the band")
    fit = fit_modes(lines, candidates[chosen], participation[:, chosen], weights)
    for _ in range(_ROUNDS):
        lines, weights = _noise(fit, lines, seen)
        fit = fit_modes(lines, fit.poles, fit.participation, weights)
        rest = np.setdiff1d(np.arange(len(candidates)), chosen)
        more = rest[select(lines, candidates[rest], weights, fit.poles)] if len(rest) else rest
        keep = _needed(lines, fit, weights)
        if not len(more) and keep.all():
            break
        chosen = np.concatenate([chosen, more])
        start = np.concatenate([fit.poles[keep], candidates[more]])
        forces = np.concatenate([fit.participation[:, keep], participation[:, more]], axis=1)
        fit = fit_modes(lines, start, forces, weights)
    lines, weights = _noise(fit, lines, seen)
    return fit_modes(lines, fit.poles, fit.participation, weights), lines


def _first_weights(lines: Lines, poles: AnyArray, seen: AnyArray) -> FloatArray:
    """Return one over the noise of every channel that no candidate explains."""
    functions = lines.modes(poles)[:, :, :2].reshape(len(lines.values), -1)
    functions = np.concatenate([functions, lines.residuals()], axis=1)
    functions = functions / np.linalg.norm(functions, axis=0)
    flat = lines.values.reshape(len(functions), -1)
    left = flat - functions @ np.linalg.lstsq(functions, flat, rcond=1e-10)[0]
    freedom = max(1, len(flat) - functions.shape[1])
    return _inverse(np.square(left).sum(axis=0) / freedom, seen)


def _inverse(variance: FloatArray, seen: AnyArray) -> FloatArray:
    floor = 1e-24 * float(variance.max(initial=0.0)) or 1.0
    return np.where(seen, 1.0 / np.sqrt(np.maximum(variance.reshape(seen.shape), floor)), 0.0)


def _noise(fit: ModalFit, lines: Lines, seen: AnyArray) -> tuple[Lines, FloatArray]:
    """Return lines and weights with the noise that the fit leaves.

    Its level over frequency is that of all channels together: a test tells no more.
    """
    data = lines.values[: len(lines.omega)] + 1j * lines.values[len(lines.omega) :]
    left = np.square(np.abs((data - predicted(fit, lines)) * fit.weights)).sum(axis=(1, 2))
    window = min(_WINDOW, len(left) // 4)
    kernel = np.ones(window)
    level = np.convolve(left, kernel, "same") / np.convolve(np.ones_like(left), kernel, "same")
    level = np.sqrt(np.maximum(level / level.mean(), 1e-6))
    noise = lines.noise * level
    rescaled = Lines.of(lines.omega, lines.derivative, data * lines.noise[:, None, None], noise)
    error = (data - predicted(fit, lines)) / level[:, None, None]
    channels = max(1, int(seen.sum()))
    modes, references = len(fit.poles), seen.shape[1]
    unknowns = modes * 2 * (references + len(seen)) / channels + RESIDUALS
    freedom = max(1.0, 2 * len(level) - unknowns)
    return rescaled, _inverse(np.square(np.abs(error)).sum(axis=0) / freedom, seen)


def _needed(lines: Lines, fit: ModalFit, weights: FloatArray) -> AnyArray:
    """Tell which modes of a fit the data need; at most one is not, the weakest."""
    n = len(fit.poles)
    keep = np.ones(n, dtype=bool)
    if n < 2:
        return keep
    gains = [
        explained(lines, np.delete(fit.poles, k), fit.poles[[k]], weights)[0] for k in range(n)
    ]
    keep[np.argmin(gains)] = min(gains) >= least_gain(weights)
    return keep


def _identification(
    data: FrequencyResponses,
    fit: ModalFit,
    lines: Lines,
    clusters: Sequence[Cluster],
    poles: Poles,
) -> Identification:
    hz, ratio = np.abs(fit.poles) / (2.0 * np.pi), -fit.poles.real / np.abs(fit.poles)
    low, high = float(data.frequencies[0]), float(data.frequencies[-1])
    inside = (hz >= low) & (hz <= high) & (ratio < _LARGEST_DAMPING)
    order = np.flatnonzero(inside)[np.argsort(hz[inside])]
    if not len(order):
        raise InputError("no mode stands out of the noise", expected="resonances in the band")
    s, size = fit.poles, np.abs(fit.poles)
    to_hz = np.stack([s.real, s.imag], axis=1) / (2.0 * np.pi * size[:, None])
    to_ratio = np.stack([-np.square(s.imag), s.real * s.imag], axis=1) / (size**3)[:, None]
    stds = [
        np.sqrt(np.einsum("na,nab,nb->n", way, fit.pole_covariance, way))
        for way in (to_hz, to_ratio)
    ]
    shapes, shape_std = scaled_shapes(fit.shapes[:, order], fit.shape_covariance[order])
    near = [c.pole for c in clusters]
    support = (
        [
            max((c.support for c in clusters if abs(c.pole - p) < 0.01 * abs(p)), default=0.0)
            for p in s[order]
        ]
        if near
        else np.zeros(len(order))
    )
    model = predicted(fit, lines) * lines.noise[:, None, None]
    return Identification(
        sensors=data.responses,
        frequencies=hz[order],
        frequency_std=stds[0][order],
        damping=ratio[order],
        damping_std=stds[1][order],
        shapes=shapes,
        shape_std=shape_std,
        support=np.asarray(support),
        poles=poles,
        band=(low, high),
        measured=data,
        synthesised=model,
        beyond=int(len(hz) - len(order)),
    )


def scaled_shapes(shapes: AnyArray, covariance: FloatArray) -> tuple[AnyArray, FloatArray]:
    """Return shapes as real as they can be with the largest real part 1, and their deviations.

    The scale of a shape is arbitrary: what only changes it is taken out of the deviations, which
    are those of a shape of fixed length. No component is without one.

    Arguments:
        shapes: complex, (n_out, m).
        covariance: of real, then imaginary parts, (m, 2 n_out, 2 n_out).
    """
    turned = shapes * np.exp(-1j * mean_phase(shapes))
    largest = np.abs(turned.real).argmax(axis=0)
    scale = turned.real[largest, np.arange(turned.shape[1])]
    angle = -mean_phase(shapes)
    deviations = np.zeros(shapes.shape)
    count = len(shapes)
    for k in range(shapes.shape[1]):
        real = turned[:, k].real
        to_real = np.concatenate(
            [np.cos(angle[k]) * np.eye(count), -np.sin(angle[k]) * np.eye(count)], axis=1
        )
        across = (np.eye(count) - np.outer(real, real) / (real @ real)) @ to_real
        spread = np.einsum("ia,ab,ib->i", across, covariance[k], across)
        deviations[:, k] = np.sqrt(np.maximum(spread, 0.0)) / abs(scale[k])
    return turned / scale, deviations
