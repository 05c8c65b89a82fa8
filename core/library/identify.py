"""Modes from measured responses: ``bench identify``."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.case.records import record_tables
from femubench.core.case.response_files import Responses, locate_sensors, read_responses
from femubench.core.case.writing import new_folder
from femubench.core.errors import InputError
from femubench.core.files import check_new, check_regular
from femubench.core.identify.identification import Identification
from femubench.core.identify.output_only import MOST_ORDER, identify_signals
from femubench.core.identify.responses import MOST_POLES, identify_responses
from femubench.core.library.cases import usable_plugins, way_of
from femubench.core.modal.signals import TimeSignals
from femubench.core.plugin.loader import Plugins

_ORDERS = (4, 400)
PAGE = "identification.html"


def identify(
    measured: str | PathLike[str] | Responses,
    *,
    band: tuple[float, float] | None = None,
    order: int | None = None,
    sensors: str | PathLike[str] | None = None,
    output: str | PathLike[str] | None = None,
) -> Identification:
    """Return the modes of measured frequency responses, or of motions over time.

    Arguments:
        measured: a file (universal, ``.csv``, ``.npz``), or what such a file holds.
        band: lowest and highest frequency in Hz; None for all that was measured.
        order: number of poles of the largest model; None for 120 of frequency responses, and for
            60 of motions over time.
        sensors: a table label,x,y,z,direction with the places of the sensors, where the file has
            none.
        output: new folder for ``modes.csv`` and ``sensors.csv`` of a case, and a page.

    Raises:
        InputError: when the file holds no responses, or no mode stands out of their noise.

    Examples:
        >>> found = femubench.identify(responses, band=(200.0, 290.0))
        >>> print(found.frequencies.round(2), found.damping.round(4))
        [255.8  277.67] [0.005 0.005]
    """
    if output is not None:
        check_new(Path(output))
    source = ""
    if isinstance(measured, str | PathLike):
        source = Path(measured).name
    found = identification_of(measured, usable_plugins(), band, order, sensors)
    if output is not None:
        write_identification(found, Path(output), source=source)
    return found


def identification_of(
    measured: str | PathLike[str] | Responses,
    plugins: Plugins,
    band: tuple[float, float] | None,
    order: int | None,
    sensors: str | PathLike[str] | None,
) -> Identification:
    """Return the identification; see `identify`."""
    if order is not None and not _ORDERS[0] <= order <= _ORDERS[1]:
        expected = f"{_ORDERS[0]} to {_ORDERS[1]} poles"
        raise InputError(f"order = {order!r}", expected=expected)
    if band is not None and not (0.0 <= band[0] < band[1] and np.isfinite(band).all()):
        raise InputError(f"band = {band!r}", expected="low, high in Hz, low < high")
    file = None
    if isinstance(measured, str | PathLike):
        file = Path(measured)
        measured = read_responses(file, tuple(plugins.readers.values()))
    if sensors is not None:
        check_regular(Path(sensors), 2**26)
        measured = locate_sensors(measured, Path(sensors))
    try:
        with threadpool_limits(1):
            if isinstance(measured, TimeSignals):
                return identify_signals(measured, band, order or MOST_ORDER)
            return identify_responses(measured, band, order or MOST_POLES)
    except InputError as fault:
        if file is None or fault.file is not None:
            raise
        raise InputError(fault.what, file=file, key=fault.key, expected=fault.expected) from None


def write_identification(found: Identification, folder: Path, *, source: str = "") -> None:
    """Write the tables of a case, and a page.

    Arguments:
        found: what was identified.
        folder: new or empty.
        source: name of the file that it comes from, for the page.

    Raises:
        InputError: when nothing can be written there.
    """
    with new_folder(folder) as fresh:
        for name, content in identification_files(found, source).items():
            (fresh / name).write_bytes(content)


def identification_files(found: Identification, source: str) -> dict[str, bytes]:
    """Return the tables of a case, and a page, by name."""
    references = None if found.measured is None else found.measured.references
    page = way_of("html", "render_modes")(found, source)
    return {**record_tables(found.measurement, references), PAGE: page.encode()}
