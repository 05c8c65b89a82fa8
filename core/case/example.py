"""The case that ``bench init`` writes: a portal frame, measured on a better model of itself."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

from femubench.core.case.files import CASE_FILE
from femubench.core.case.frames import FrameSite, attachments, frame_of
from femubench.core.case.matching import Alignment
from femubench.core.case.schema import FrameSpec, parse_spec
from femubench.core.case.sensors import read_sensors
from femubench.core.case.table_text import csv_bytes
from femubench.core.case.tables import RESERVED
from femubench.core.errors import InputError
from femubench.core.fem.frame import Frame, JointSpring
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes

_FILES = Path(__file__).with_name("example_files")
_ELEMENTS = 40  # a member, in the model that stands for the real frame
_CORNER = 4.0e5  # N m/rad, its corners
_MODES = 6


def write_example(folder: Path) -> tuple[Path, ...]:
    """Write the example case into a new or empty folder and return its files.

    Raises:
        InputError: when the folder holds anything, or cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError("is not empty", file=folder, expected="a new or an empty folder")
        files = (folder / CASE_FILE, folder / "sensors.csv")
        for path in files:
            path.write_bytes((_FILES / path.name).read_bytes())
        spec = parse_spec(tomllib.loads(files[0].read_text(encoding="utf-8")))
        assert isinstance(spec.model, FrameSpec)
        better = _better(frame_of(spec.model))
        site = FrameSite(better)
        sensors = read_sensors(files[1], site, Alignment.of(spec.measurement)).sensors
        change = spec.modification[0]
        heavier = better.with_attachments(
            attachments("masses", change.masses, site), attachments("springs", change.springs, site)
        )
        tables = {
            spec.measurement.modes: _modes_csv(better, sensors),
            change.modes: _modes_csv(heavier, sensors),
        }
        for name, text in tables.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError(what, file=folder, expected="a folder that can be written") from None
    return (*files, *(folder / name for name in tables))


def _better(frame: Frame) -> Frame:
    """Return the frame on a finer Timoshenko mesh with corners that turn."""
    corners = [joint.name for joint in frame.joints if joint.type == "corner"]
    return replace(
        frame,
        beam="timoshenko",
        members=tuple(replace(member, elements=_ELEMENTS) for member in frame.members),
        joint_springs=tuple(
            JointSpring(end, member.name, {"ry": _CORNER})
            for member in frame.members
            for end in member.ends
            if end in corners and member.name != "beam"
        ),
    )


def _modes_csv(frame: Frame, sensors: Sensors) -> str:
    model = Model.of(frame)
    modes = solve_modes(model, _MODES)
    shapes = model.observe(sensors) @ modes.shapes
    rows = []
    for i, frequency in enumerate(modes.natural_frequencies):
        shape = shapes[:, i] / max(shapes[:, i], key=abs)
        cells = [f"{frequency:.3f}", f"{0.001 * frequency:.3f}", ""]
        rows.append([i + 1, *cells, *(f"{value:.5f}" for value in shape)])
    return csv_bytes([*RESERVED, *sensors.labels], rows).decode()
