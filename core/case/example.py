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

_ELEMENTS = 40  # a member, in the model that stands for the real frame
_CORNER = 4.0e5  # N m/rad, its corners
_MODES = 6

CASE_TOML = """\
# A case for femubench: a nominal model and what was measured on the structure.
# Every key is explained in docs/case-format.md; an unknown key is an error. Units are SI.

[case]
name = "portal"
title = "Steel portal frame on clamped feet"
source = "Example of `bench init`: computed, not measured; see modes.csv below"

# --- the nominal model: what you would have drawn before the test -----------------------------
[model]
kind = "frame"              # or "matrices": files with mass and stiffness
plane = "in-plane"          # x-z plane; or "out-of-plane" (structure in x-y), "3d"
beam = "euler-bernoulli"    # or "timoshenko"

[model.materials.steel]
E = 210e9                   # Pa
nu = 0.3
rho = 7850.0                # kg/m3

[model.sections.tube]       # a shape with its sizes, or numbers: A, Iy, Iz, J, Jp, kappa
shape = "rectangular-tube"
width = 0.04                # m, along local y
height = 0.06               # m, along local z
wall = 0.003                # m

[[model.joints]]
name = "A"
xyz = [0.0, 0.0, 0.0]       # m
type = "foot"
[[model.joints]]
name = "B"
xyz = [0.0, 0.0, 1.0]
type = "corner"             # joints of one type are expected to behave alike
[[model.joints]]
name = "C"
xyz = [1.4, 0.0, 1.0]
type = "corner"
[[model.joints]]
name = "D"
xyz = [1.4, 0.0, 0.0]
type = "foot"

[[model.members]]
name = "left"
ends = ["A", "B"]
elements = 4
section = "tube"
material = "steel"
[[model.members]]
name = "beam"
ends = ["B", "C"]
elements = 6
section = "tube"
material = "steel"
[[model.members]]
name = "right"
ends = ["D", "C"]
elements = 4
section = "tube"
material = "steel"

[[model.masses]]            # what hung on the structure during the test, e.g. accelerometers
at = "beam@0.25"            # a joint, or a point of a member
mass = 0.05                 # kg

[[model.supports]]
at = "A"
fixed = ["x", "z", "ry"]
[[model.supports]]
at = "D"
fixed = ["x", "z", "ry"]

# --- the measurement ----------------------------------------------------------------------------
[measurement]
sensors = "sensors.csv"
# These modes come from a finer Timoshenko mesh of the same frame whose corners turn on springs of
# 4e5 N m/rad. Put your own in their place.
modes = "modes.csv"
shape_std = 0.015           # of the largest component of each shape
used = [1, 2, 3]            # what an updating strategy is given
held_out = [4, 5, 6]        # what only the score sees

# --- a known change of the structure, measured as well: the test that counts --------------------
[[modification]]
name = "2 kg at midspan"
masses = [{at = "beam@0.5", mass = 2.0}]
modes = "modified.csv"
"""

SENSORS_CSV = """\
label,at,direction
left_mid,left@0.5,x
left_top,B,x
beam_quarter,beam@0.25,z
beam_mid,beam@0.5,z
beam_three_quarters,beam@0.75,z
right_top,C,x
right_mid,right@0.5,x
"""


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
        for path, text in zip(files, (CASE_TOML, SENSORS_CSV), strict=True):
            path.write_text(text, encoding="utf-8")
        spec = parse_spec(tomllib.loads(CASE_TOML))
        assert isinstance(spec.model, FrameSpec)
        better = _better(frame_of(spec.model))
        site = FrameSite(better)
        sensors = read_sensors(files[1], site, Alignment.of(None, None, None)).sensors
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
