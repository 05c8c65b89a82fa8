"""A case from the files that are at hand: ``bench init FOLDER --model FILE --modes FILE``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from femubench.core.case.case import Case
from femubench.core.case.records import (
    MODES,
    SENSORS,
    folder_tables,
    mean_record,
    read_record,
    record_tables,
)
from femubench.core.case.starting import (
    REFERENCE,
    REFERENCE_SENSORS,
    Beginning,
    mode_numbers,
    start_case,
)
from femubench.core.display import count_noun
from femubench.core.library.identify import identification_files, identification_of
from femubench.core.modal.measurement import Measurement
from femubench.core.plugin.loader import Plugins


def begin_case(folder: Path, given: Beginning, plugins: Plugins) -> Case:
    """Write a case folder from files, with a picture of the match.

    Arguments:
        folder: new or empty.
        given: the files, and what was given of them.

    Raises:
        InputError: when the folder holds anything, or for what is wrong in the files.
    """
    given = _with_reference(_identified(given, plugins), plugins)
    return start_case(folder, given, tuple(plugins.readers.values()), _draw)


def _identified(given: Beginning, plugins: Plugins) -> Beginning:
    """Return what is at hand with the tables of what was identified, or is to be."""
    readers = tuple(plugins.readers.values())
    first = given.modes[0]
    if len(given.modes) == 1 and first.is_dir():
        tables = folder_tables(first)
        if given.sensors is not None:
            tables.pop(SENSORS, None)
        return replace(given, tables={n: (first / n, held) for n, held in tables.items()})
    if len(given.modes) == 1 and mode_numbers(first, readers):
        return given
    records: list[Measurement] = []
    tables, stated = {}, []
    for file in given.modes:
        if file.is_dir():
            records.append(read_record(file))
            continue
        found = identification_of(file, plugins, sensors=given.sensors)
        records.append(found.measurement)
        tables = identification_files(found, file.name)
        low, high = found.band
        modes = count_noun(len(found), "mode")
        said = f" ({found.said})" if found.said else ""
        stated.append(f"{file.name}: {modes} identified from {low:.6g} to {high:.6g} Hz{said}")
    if len(records) > 1:
        mean, said = mean_record(records, given.modes)
        tables, stated = record_tables(mean, fitted=False), [*stated, said]
    named = {name: (first, content) for name, content in tables.items()}
    return replace(given, tables=named, stated=tuple(stated))


def _with_reference(given: Beginning, plugins: Plugins) -> Beginning:
    """Return what is at hand with the tables of the structure as it was."""
    file = given.reference
    if file is None or (file.is_file() and mode_numbers(file, tuple(plugins.readers.values()))):
        return given
    if file.is_dir():
        tables = folder_tables(file)
    else:
        tables = record_tables(identification_of(file, plugins, sensors=given.sensors).measurement)
    names = {MODES: REFERENCE} | ({SENSORS: REFERENCE_SENSORS} if given.sensors is None else {})
    own = {names[name]: (file, held) for name, held in tables.items() if name in names}
    return replace(given, tables={**given.tables, **own})


def _draw(case: Case, file: Path) -> None:
    from femubench.core.plot.matching import matching
    from femubench.core.plot.style import figure_of

    figure_of(matching(case)).savefig(str(file), dpi=150)
