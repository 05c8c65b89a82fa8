"""Modes from frequency responses: poles, selection and fit in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from femubench.core.errors import InputError
from femubench.core.identify.basis import Lines
from femubench.core.identify.clusters import Cluster, clusters_of
from femubench.core.identify.complexity import phase_collinearity
from femubench.core.identify.hidden import find_hidden_poles
from femubench.core.identify.identification import Identification
from femubench.core.identify.lscf import Poles, lscf_poles
from femubench.core.identify.modal_fit import ModalModel, fit_modes, predict_responses
from femubench.core.identify.noise import first_weights, noise_kept, noise_left, unevenness
from femubench.core.identify.selection import find_needed, least_gain, select
from femubench.core.modal.complex_modes import mean_phase
from femubench.core.modal.correlation import mac
from femubench.core.modal.frf import DERIVATIVES, FrequencyResponses
from femubench.core.typing import AnyArray, BoolArray, FloatArray

MOST_POLES = 120
_LARGEST_DAMPING = 0.2
_SUPPORT = 0.3  # of the orders, that a candidate appears in
_SAME = 0.01  # relative distance of a pole to the cluster that it comes from
_FEWEST_LINES = 32
_ROUNDS = 5
_WIDTHS, _ALIKE = 3.0, 0.9  # half-widths and MAC within which two poles are one mode
_SURE = 0.1  # relative deviation of a driven point below which it says a modal mass
_NO_MODE = "no mode stands out of the noise"


def identify_responses(
    measured: FrequencyResponses,
    band: tuple[float, float] | None = None,
    most_poles: int = MOST_POLES,
    least_collinear: float = 0.0,
) -> Identification:
    """Return the modes in a band of frequency responses.

    Arguments:
        measured: the responses; the more numerous of its two sides carries the shapes.
        band: lowest and highest frequency in Hz; None for all lines.
        most_poles: of the largest model of the stabilisation diagram.
        least_collinear: modal phase collinearity below which a shape is no mode's; above 0, what
            no pole of the models stands for is none either, nor what does not stand out of the
            noise around it as a mode has to stand out of that of the weights.

    Raises:
        InputError: when there are too few lines, or no mode stands out of the noise.
    """
    data = measured if band is None else measured.within(*band)
    data = data.within(np.nextafter(0.0, 1.0), np.inf)
    if len(data.references) > len(data.responses) and data.quantity != "free decay":
        data = data.transpose()
    if len(data.frequencies) < _FEWEST_LINES:
        what = f"{len(data.frequencies)} lines above 0 Hz in the band"
        raise InputError(what, key="band", expected=f"{_FEWEST_LINES} or more")
    if not np.abs(np.nan_to_num(data.values)).any():
        raise InputError("all responses are zero", expected="measured responses")
    seen: BoolArray = np.asarray(np.isfinite(data.values).all(axis=0))
    _check_linked(data, seen)
    values = np.where(seen, data.values, 0.0)
    poles = _all_poles(data.frequencies, values, seen, most_poles)
    omega, derivative = 2.0 * np.pi * data.frequencies, DERIVATIVES[data.quantity]
    lines = Lines.of(omega, derivative, values, _course(data, seen))
    able = (poles.damping > 1e-6) & (poles.damping < _LARGEST_DAMPING)
    orders = len(np.unique(poles.orders))
    clusters = [c for c in clusters_of(poles.select(able), orders) if c.support >= _SUPPORT]
    fit, lines = _fitted(lines, clusters, seen)
    keep, clear = phase_collinearity(fit.shapes) >= least_collinear, 0.0
    if least_collinear > 0.0:
        clear = least_gain(np.ones(len(data.responses)))
        seeds = np.array([cluster.pole for cluster in clusters], dtype=complex)
        near = np.abs(seeds - fit.poles[:, None]) < _SAME * np.abs(fit.poles[:, None])
        keep &= near.any(axis=1)
    return _identification(data, fit, lines, clusters, poles, keep, clear)


def _check_linked(data: FrequencyResponses, seen: BoolArray) -> None:
    """Check that forces link all responses: else shapes have no common scale."""
    part = connected_components(seen @ seen.T)[1]
    measured = np.flatnonzero(seen.any(axis=1))
    apart = measured[part[measured] != part[measured[0]]]
    if len(apart):
        label = data.responses.labels[apart[0]]
        what = f"no force links the response at {label} with the first one: the scale is unknown"
        raise InputError(what, expected="one force, or one sensor, that both parts have")


def _course(data: FrequencyResponses, seen: BoolArray) -> FloatArray:
    """Return the noise of every line over the mean, as the deviations of the data have it, (n_f,).

    A line without a deviation has that of the others.
    """
    if data.deviations is None:
        return np.ones(len(data.frequencies))
    known = np.square(data.deviations[:, seen])
    known = known[:, np.isfinite(known).all(axis=0) & (known > 0.0).any(axis=0)]
    if not known.size:
        return np.ones(len(known))
    return np.asarray(np.sqrt(np.maximum((known / known.mean(axis=0)).mean(axis=1), 1e-6)))


def _all_poles(
    frequencies: FloatArray, values: AnyArray, seen: BoolArray, most_poles: int
) -> Poles:
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
    forces /= np.maximum(np.linalg.norm(forces, axis=1, keepdims=True), np.finfo(float).tiny)
    return replace(found, participation=forces)


def _fitted(lines: Lines, clusters: Sequence[Cluster], seen: BoolArray) -> tuple[ModalModel, Lines]:
    """Return the fit of all modes that the data need, and the data with the noise they show."""
    poles: AnyArray = np.array([cluster.pole for cluster in clusters], dtype=complex)
    forces: AnyArray = np.array([cluster.participation for cluster in clusters], dtype=complex)
    forces = forces.reshape(len(clusters), seen.shape[1]).T
    weights = first_weights(lines, poles, seen)
    chosen = select(lines, poles, weights, poles[:0])
    if not len(chosen):
        raise InputError(_NO_MODE, expected="resonances in the band")
    fit = fit_modes(lines, poles[chosen], forces[:, chosen], weights)
    for _ in range(_ROUNDS):
        lines, weights = noise_left(fit, lines, seen, rough=True)
        fit = fit_modes(lines, fit.poles, fit.participation, weights)
        poles, forces = find_hidden_poles(lines, fit)
        more = select(lines, poles, weights, fit.poles)
        keep = find_needed(lines, fit.poles, weights) & ~_twice(fit)
        if not len(more) and keep.all():
            break
        start = np.concatenate([fit.poles[keep], poles[more]])
        together = np.concatenate([fit.participation[:, keep], forces[:, more]], axis=1)
        fit = fit_modes(lines, start, together, weights)
    lines, weights = noise_left(fit, lines, seen)
    fit = fit_modes(lines, fit.poles, fit.participation, weights)
    of_poles, of_shapes = unevenness(fit, lines).T[:, :, None, None]
    return replace(
        fit,
        pole_covariance=of_poles * fit.pole_covariance,
        shape_covariance=of_shapes * fit.shape_covariance,
    ), lines


def _twice(fit: ModalModel) -> BoolArray:
    """Tell which modes are a stronger neighbour once more: as good as its place, and its shape.

    What a linear model cannot follow, as the bent peak of a joint that slips, is fitted so.
    """
    strength = np.linalg.norm(fit.shapes, axis=0) * np.linalg.norm(fit.participation, axis=0)
    strength = strength / -fit.poles.real
    apart = np.abs(fit.poles[:, None] - fit.poles)
    near = apart < _WIDTHS * np.maximum(-fit.poles.real[:, None], -fit.poles.real)
    near &= -fit.poles.real < _LARGEST_DAMPING * np.abs(fit.poles)  # what hardly swings is no mode
    alike = mac(fit.shapes, fit.shapes) > _ALIKE
    return np.asarray((near & alike & (strength[:, None] < strength)).any(axis=1))


def _identification(
    data: FrequencyResponses,
    fit: ModalModel,
    lines: Lines,
    clusters: Sequence[Cluster],
    poles: Poles,
    keep: BoolArray,
    clear: float,
) -> Identification:
    s = fit.poles + data.decay
    hz, ratio = np.abs(s) / (2.0 * np.pi), -s.real / np.abs(s)
    low, high = float(data.frequencies[0]), float(data.frequencies[-1])
    # Without its window a pole may grow: that is no mode.
    inside = keep & (hz >= low) & (hz <= high) & (ratio > 0.0) & (ratio < _LARGEST_DAMPING)
    order = np.flatnonzero(inside)[np.argsort(hz[inside])]
    if not len(order):
        raise InputError(_NO_MODE, expected="resonances in the band")
    # Of modes alone: rounding makes the variance of a pole that does not swing negative.
    s, hz, ratio, own = s[order], hz[order], ratio[order], fit.pole_covariance[order]
    size = np.abs(s)
    to_hz = np.stack([s.real, s.imag], axis=1) / (2.0 * np.pi * size[:, None])
    to_ratio = np.stack([-np.square(s.imag), s.real * s.imag], axis=1) / (size**3)[:, None]
    of_poles, of_shapes = _windowed(fit, lines, data)[:, order]
    stds = [
        np.sqrt(of_poles * np.einsum("na,nab,nb->n", way, own, way)) for way in (to_hz, to_ratio)
    ]
    covariance = fit.shape_covariance[order] * of_shapes[:, None, None]
    shapes, shape_std = _scaled_shapes(fit.shapes[:, order], covariance)
    faint = np.square(np.abs(shapes)).sum(axis=0) < clear * np.square(shape_std).mean(axis=0)
    if faint.any():
        keep = keep & ~np.isin(np.arange(len(keep)), order[faint])
        return _identification(data, fit, lines, clusters, poles, keep, clear)
    support = [
        max((c.support for c in clusters if abs(c.pole - pole) < _SAME * abs(pole)), default=0.0)
        for pole in fit.poles[order]
    ]
    residues = fit.shapes[:, None, order] * fit.participation[:, order]
    return Identification(
        sensors=data.responses,
        frequencies=hz,
        frequency_std=stds[0],
        damping=ratio,
        damping_std=stds[1],
        shapes=shapes,
        shape_std=shape_std,
        support=np.array(support),
        poles=replace(poles, values=poles.values + data.decay),
        band=(low, high),
        measured=data,
        modal_mass=_modal_masses(data, residues, s, shapes, shape_std),
        synthesised=predict_responses(fit, lines) * lines.noise[:, None, None],
    )


def _modal_masses(
    data: FrequencyResponses, residues: AnyArray, s: AnyArray, shapes: AnyArray, std: FloatArray
) -> FloatArray | None:
    """Return modal masses where a driven point was read too, nan where it is still; or None.

    Arguments:
        residues: psi_o psi_i / (2 i w_d m) of the receptances, (n_out, n_ref, m).
        s: poles in rad/s, (m,).
        shapes, std: scaled, with their deviations, (n_out, m).

    Source: Ewins (2000), Modal Testing, on the modal constants of a point receptance.
    """
    labels, forces = data.responses.labels, data.references.labels
    pairs = [(labels.index(x), i) for i, x in enumerate(forces) if x in labels]
    pairs = [pair for pair in pairs if np.isfinite(data.values[:, *pair]).all()]
    if not pairs or data.quantity == "free decay":
        return None
    rows, columns = np.transpose(pairs)
    size, inner = np.abs(shapes[rows]), np.square(shapes[rows].conj())
    inverse = (inner * 2j * s.imag * residues[rows, columns]).real.sum(axis=0)
    known = np.linalg.norm(size * std[rows], axis=0) < _SURE * np.square(size).sum(axis=0)
    return np.where(known & (inverse > 0.0), (size**4).sum(axis=0) / np.abs(inverse), np.nan)


def _windowed(fit: ModalModel, lines: Lines, data: FrequencyResponses) -> FloatArray:
    """Return by how much variances of poles and of shapes grow under an exponential window, (2, n).

    It makes the noise of neighbouring lines alike, which the fit takes to be independent: over
    time, noise of variance e^-2wt meets e^-at, or (t - 1 / 2a) e^-at, where a fit counts on its
    mean, of which it sees what it leaves.

    Arguments:
        fit: whose modes decay with a under the window.
    """
    if not data.decay:
        return np.ones((2, len(fit.poles)))
    ends = 2.0 * data.decay / float(np.diff(data.frequencies).mean())
    share = fit.poles.real / (fit.poles.real - data.decay)
    grown = np.stack([2.0 * share**3 - 2.0 * share**2 + share, share])
    mean = ends / -np.expm1(-ends)
    return np.asarray(mean * grown / noise_kept(fit, lines, data.decay).T)


def _scaled_shapes(shapes: AnyArray, covariance: FloatArray) -> tuple[AnyArray, FloatArray]:
    """Return shapes as real as they can be with the largest real part 1, and their deviations.

    The scale of a shape is arbitrary: what only changes it is taken out of the deviations, which
    are those of a shape of fixed length. No component is without one.

    Arguments:
        shapes: complex, (n_out, m).
        covariance: of real, then imaginary parts, (m, 2 n_out, 2 n_out).
    """
    angle = mean_phase(shapes)
    turned = shapes * np.exp(-1j * angle)
    largest = np.abs(turned.real).argmax(axis=0)
    scale = turned.real[largest, np.arange(turned.shape[1])]
    deviations = np.zeros(shapes.shape)
    count = len(shapes)
    for k in range(shapes.shape[1]):
        real = turned[:, k].real
        to_real = np.hstack([np.cos(angle[k]) * np.eye(count), np.sin(angle[k]) * np.eye(count)])
        across = (np.eye(count) - np.outer(real, real) / (real @ real)) @ to_real
        spread = np.einsum("ia,ab,ib->i", across, covariance[k], across)
        deviations[:, k] = np.sqrt(np.maximum(spread, 0.0)) / abs(scale[k])
    return turned / scale, deviations
