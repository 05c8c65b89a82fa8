"""Read measurements of LabVIEW: text files of channels over time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from femubench import InputError, Sensors
from femubench.modal import TimeSignals
from femubench.plugins.readers.reading import ProgramReader, open_broken

_END, _KIND = "***End_of_Header***", "a LabVIEW measurement (.lvm) with a table behind every header"
_DEFAULTS = (("Decimal_Separator", "."), ("X_Columns", "One"))
_COLUMNS = {"no": (0, 1), "one": (1, 1), "multi": (1, 2)}  # the first of y, and the step to others
_LARGEST = 512 * 2**20  # bytes


class LabViewReader(ProgramReader):
    """Reads channels by their names and units; every segment is a record."""

    name: str = "LabVIEW"
    suffixes: tuple[str, ...] = (".lvm",)

    def read_responses(self, path: Path) -> TimeSignals:
        """Return the channels; which of them are forces their names or units say.

        Raises:
            InputError: when the file is broken.
        """
        if path.stat().st_size > _LARGEST:
            raise InputError("file is too large", file=path, expected=f"{_LARGEST} bytes at most")
        with open_broken(path, _KIND):
            return TimeSignals.joined(list(_segments(path)))


def _segments(path: Path) -> Iterator[TimeSignals]:
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    ends = [k for k, line in enumerate(lines) if line.strip().startswith(_END)]
    mark = "," if any(line.strip() == "Separator,Comma" for line in lines[:30]) else "\t"
    if len(ends) < 2:  # that of the file, and that of every segment
        raise InputError("no segment", file=path, expected=_KIND)
    general = _header(lines[: ends[0]], mark)
    point, kind = (general.get(k, [d])[0] for k, d in _DEFAULTS)
    first, step = _COLUMNS[kind.strip().lower()]
    for begin, end, after in zip(ends, ends[1:], [*ends[2:], len(lines)], strict=False):
        head, names = _header(lines[begin + 1 : end], mark), lines[end + 1].split(mark)
        wide = names.index("Comment") if "Comment" in names else len(names)
        rows = []
        for line in lines[end + 2 : after]:
            cells = line.replace(point.strip(), ".").split(mark)[:wide]
            if len(cells) < wide or not cells[-1].strip():
                break  # the header of the next segment
            rows.append([float(cell or "nan") for cell in cells])
        units = [*head.get("Y_Unit_Label", []), *[""] * wide]
        labels = (
            f"{name.strip()} [{unit.strip() or '-'}]"
            for name, unit in zip(names[first:wide:step], units, strict=False)
        )
        seconds = float(head["Delta_X"][0].replace(point.strip(), "."))
        yield TimeSignals(Sensors.unplaced(labels), 1.0 / seconds, np.array(rows)[:, first::step])


def _header(lines: list[str], mark: str) -> dict[str, list[str]]:
    cells = (line.split(mark) for line in lines)
    return {row[0].strip(): row[1:] for row in cells if len(row) > 1}
