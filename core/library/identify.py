"""Modes from measured responses: ``bench identify``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.case.records import record_tables
from femubench.core.case.response_files import (
    Responses,
    join_files,
    locate_sensors,
    read_places,
    read_responses,
)
from femubench.core.case.writing import new_folder
from femubench.core.errors import InputError
from femubench.core.files import check_new, check_regular
from femubench.core.identify.averaging import (
    Estimator,
    Excitation,
    average_records,
    guess_excitation,
)
from femubench.core.identify.complexity import LEAST_COLLINEAR
from femubench.core.identify.identification import Identification
from femubench.core.identify.output_only import MOST_ORDER, identify_signals
from femubench.core.identify.responses import MOST_POLES, identify_responses
from femubench.core.library.cases import usable_plugins, way_of
from femubench.core.modal.signals import TimeSignals
from femubench.core.pace import Advance, OnAdvance
from femubench.core.plugin.loader import Plugins

_ORDERS = (4, 400)
PAGE = "identification.html"


def identify(
    measured: str | PathLike[str] | Responses | Sequence[str | PathLike[str]],
    *,
    band: tuple[float, float] | None = None,
    order: int | None = None,
    sensors: str | PathLike[str] | None = None,
    output: str | PathLike[str] | None = None,
    variables: Mapping[str, str] | None = None,
    excitation: Excitation | None = None,
    estimator: Estimator = "h1",
) -> Identification:
    """Return the modes of measured frequency responses, or of motions over time.

    Arguments:
        measured: a file (universal, a table, ``.mat``, ``.npz``, HDF5, ``.lvm``), several files
            of one state (records over time, or responses that no two of them have), or what such
            a file holds.
        band: lowest and highest frequency in Hz; None for all that was measured.
        order: number of poles of the largest model; None for 120 of frequency responses, and for
            60 of motions over time.
        sensors: a table label,x,y,z,direction with the places of the sensors, where the file has
            none.
        output: new folder for ``modes.csv`` and ``sensors.csv`` of a case, and a page.
        variables: from ``time``, ``motion``, ``force``, ... to the names of variables in the file.
        excitation: how motions over time came about; None to see it from them.
        estimator: of frequency responses over time, h1 or h2.

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
    if not isinstance(measured, Responses):
        source = ", ".join(file.name for file in _files(measured))
    found = identification_of(
        *(measured, usable_plugins(), band, order, sensors, variables, excitation, estimator)
    )
    if output is not None:
        write_identification(found, Path(output), source=source)
    return found


def _files(measured: Any) -> list[Path]:  # noqa: ANN401 - a file or several
    several = [measured] if isinstance(measured, str | PathLike) else measured
    return [Path(file) for file in several]


def identification_of(
    measured: str | PathLike[str] | Responses | Sequence[str | PathLike[str]],
    plugins: Plugins,
    band: tuple[float, float] | None = None,
    order: int | None = None,
    sensors: str | PathLike[str] | None = None,
    variables: Mapping[str, str] | None = None,
    excitation: Excitation | None = None,
    estimator: Estimator = "h1",
    on_advance: OnAdvance | None = None,
) -> Identification:
    """Return the identification; see `identify`."""
    if order is not None and not _ORDERS[0] <= order <= _ORDERS[1]:
        expected = f"{_ORDERS[0]} to {_ORDERS[1]} poles"
        raise InputError(f"order = {order!r}", expected=expected)
    if band is not None and not (0.0 <= band[0] < band[1] and np.isfinite(band).all()):
        raise InputError(f"band = {band!r}", expected="low, high in Hz, low < high")
    file, known = None, None
    tell = on_advance or (lambda _: None)
    tell(Advance(0, 3, "reading"))
    if sensors is not None:
        check_regular(Path(sensors), 2**26)
        known = read_places(Path(sensors))
    if not isinstance(measured, Responses):
        files, readers = _files(measured), tuple(plugins.readers.values())
        file = files[0]
        read = [read_responses(one, readers, known, variables) for one in files]
        measured = join_files(files, read)
    if known is not None:
        measured = locate_sensors(measured, known, Path(sensors or ""))
    said = ""
    try:
        with threadpool_limits(1):
            if isinstance(measured, TimeSignals):
                excitation = excitation or guess_excitation(measured)
                if excitation == "ambient":
                    tell(Advance(1, 2, "stochastic subspaces"))
                    return identify_signals(measured, band, order or MOST_ORDER)
                tell(Advance(1, 3, "averaging"))
                measured, said = average_records(measured, excitation, estimator)
            tell(Advance(2, 3, "fitting modes"))
            least = LEAST_COLLINEAR if said else 0.0
            found = identify_responses(measured, band, order or MOST_POLES, least)
            return replace(found, said=said)
    except InputError as fault:
        if file is None or fault.file is not None:
            raise
        raise InputError(fault.what, file=file, key=fault.key, expected=fault.expected) from None


def write_identification(found: Identification, folder: Path, *, source: str = "") -> None:
    """Write the tables of a case, and a page.

    Arguments:
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
    if references is not None and not any(":" in label for label in references.labels):
        references = None  # of records, or a point that nobody has named
    page = way_of("html", "render_modes")(found, source)
    return {**record_tables(found.measurement, references), PAGE: page.encode()}
