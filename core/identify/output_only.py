"""Modes from motions alone: stochastic subspaces of pyOMA-2, with the selection of this room."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any

import numpy as np

from femubench.core.errors import InputError, require
from femubench.core.identify.clusters import Cluster, clusters_of
from femubench.core.identify.complexity import phase_collinearity
from femubench.core.identify.identification import Identification
from femubench.core.identify.lscf import Poles
from femubench.core.modal.complex_modes import mean_phase
from femubench.core.modal.signals import TimeSignals
from femubench.core.typing import AnyArray, FloatArray

MOST_ORDER = 60
_BLOCKS = 50  # of the record, whose scatter gives the standard deviations
_SUPPORT = 0.4  # of the orders, that a mode appears in
_LARGEST_DAMPING = 0.1
_LEAST_COLLINEAR = 0.5
_LARGEST_SPREAD = 0.02  # standard deviation of a mode's frequency over itself
_FEWEST = 2048  # samples


def identify_signals(
    measured: TimeSignals, band: tuple[float, float] | None = None, most_order: int = MOST_ORDER
) -> Identification:
    """Return the modes of a structure that moves by forces that are broad and unknown.

    Arguments:
        band: lowest and highest frequency in Hz of modes; None for up to half the rate.
        most_order: of the largest model of the stabilisation diagram, two a mode.

    Raises:
        InputError: when the record is too short, no mode is stable, or pyOMA-2 is not there.

    Source: Peeters & De Roeck (1999), Reference-based stochastic subspace identification for
        output-only modal analysis; Döhler & Mevel (2013), Efficient multi-order uncertainty
        computation for stochastic subspace identification, for the standard deviations: both as
        pyOMA-2 has them.
    """
    require("pyoma2", "identify", "an identification from motions alone")
    low, high = band or (0.0, 0.5 * measured.rate)
    if len(measured.values) < _FEWEST or not np.ptp(measured.values, axis=0).all():
        short = len(measured.values) < _FEWEST
        what = f"{len(measured.values)} samples" if short else "a sensor that never moves"
        raise InputError(what, expected=f"{_FEWEST} samples or more, all sensors alive")
    if measured.values.shape[1] < 2:
        expected = "two or more in one file, since shapes tell modes from noise, or a force: "
        expected += "`bench identify --variables force=NAME`, `--excitation decay` if it dies out"
        raise InputError("one sensor alone over time", expected=expected)
    found = _subspaces(measured, most_order)
    rows, orders = np.nonzero(np.isfinite(found.Fn_poles) & (found.Fn_poles > 0.0))
    hz, ratio = found.Fn_poles[rows, orders], found.Xi_poles[rows, orders]
    shapes = found.Phi_poles[rows, orders]
    values = 2.0 * np.pi * hz * (-ratio + 1j * np.sqrt(1.0 - np.square(ratio)))
    poles = Poles(values, orders, shapes / np.linalg.norm(shapes, axis=1, keepdims=True))
    able = (ratio > 0.0) & (ratio < _LARGEST_DAMPING) & (hz >= low) & (hz <= high)
    able &= phase_collinearity(shapes.T) > _LEAST_COLLINEAR
    able &= np.asarray(found.Fn_poles_std)[rows, orders] < _LARGEST_SPREAD * hz
    at = np.flatnonzero(able)
    tried = len(np.unique(orders))
    clusters = [c for c in clusters_of(poles.select(at), tried) if c.support >= _SUPPORT]
    if not clusters:
        raise InputError("no mode is stable over the orders", expected="a longer record")
    members = [at[list(cluster.members)] for cluster in clusters]
    return _identification(
        measured, (low, high), found, poles, clusters, [(rows[m], orders[m]) for m in members]
    )


@contextmanager
def _silent() -> Iterator[None]:
    """Keep a library's progress bars and log from the screen."""
    held = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with redirect_stderr(StringIO()), redirect_stdout(StringIO()):
            yield
    finally:
        logging.disable(held)


def _subspaces(measured: TimeSignals, most_order: int) -> Any:  # noqa: ANN401 - of pyOMA-2
    with _silent():
        from pyoma2.algorithms.ssi import SSI
        from pyoma2.setup.single import SingleSetup

        centred = measured.values - measured.values.mean(axis=0)
        rows = int(np.clip(np.ceil(1.5 * most_order / centred.shape[1]), 10, 60))
        setup = SingleSetup(centred / centred.std(), fs=measured.rate)
        wide = {"xi_max": 1.0, "mpc_lim": 0.0, "mpd_lim": 1.0, "CoV_max": 1.0}
        algorithm = SSI(
            name="ssi", br=rows, ordmin=2, ordmax=most_order, step=2, method="cov", hc=wide,
            calc_unc=True, nb=_BLOCKS,
        )  # fmt: skip
        setup.add_algorithms(algorithm)
        try:
            setup.run_all()
        except np.linalg.LinAlgError:
            expected = "a longer record, more sensors, or a smaller --order"
            raise InputError(f"no models of {most_order} poles", expected=expected) from None
        return algorithm.result


def _identification(
    measured: TimeSignals,
    band: tuple[float, float],
    found: Any,  # noqa: ANN401 - of pyOMA-2
    poles: Poles,
    clusters: list[Cluster],
    members: list[tuple[AnyArray, AnyArray]],
) -> Identification:
    """Return each mode as the member of its cluster that is nearest to the median."""
    columns = []
    for cluster, (rows, orders) in zip(clusters, members, strict=True):
        hz, ratio = found.Fn_poles[rows, orders], found.Xi_poles[rows, orders]
        own = 2.0 * np.pi * hz * (-ratio + 1j * np.sqrt(1.0 - np.square(ratio)))
        k = int(np.abs(own - cluster.pole).argmin())
        shape = found.Phi_poles[rows[k], orders[k]]
        shape = shape * np.exp(-1j * mean_phase(shape[:, None]))[0]
        scale = shape.real[np.abs(shape.real).argmax()]
        stds = (
            np.median(spread[rows, orders], axis=0)
            for spread in (found.Fn_poles_std, found.Xi_poles_std, found.Phi_poles_std)
        )
        columns.append((hz[k], ratio[k], shape / scale, *stds, cluster.support))
    columns.sort(key=lambda column: column[0])
    hz, ratio, shapes, hz_std, ratio_std, shape_std, support = map(
        np.array, zip(*columns, strict=True)
    )
    return Identification(
        sensors=measured.sensors,
        frequencies=hz,
        frequency_std=hz_std,
        damping=ratio,
        damping_std=ratio_std,
        shapes=shapes.T,
        shape_std=shape_std.T,
        support=support,
        poles=poles,
        band=band,
        spectrum=_spectrum(measured, band),
    )


def _spectrum(measured: TimeSignals, band: tuple[float, float]) -> FloatArray:
    """Return frequencies in Hz and the largest singular value of the spectra in dB, (n_f, 2)."""
    from scipy.signal import csd

    length = min(1024, len(measured.values) // 8)
    columns = measured.values.T
    hz, spectra = csd(columns[:, None], columns[None], fs=measured.rate, nperseg=length)
    values = np.linalg.svd(spectra.transpose(2, 0, 1), compute_uv=False)[:, 0]
    keep = (hz > 0.0) & (hz >= band[0]) & (hz <= band[1])
    levels = 10.0 * np.log10(np.maximum(values, np.finfo(float).tiny))
    return np.stack([hz[keep], levels[keep]], axis=1)
