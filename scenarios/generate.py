"""Writes the measured side of every built-in scenario: ``python -m femubench.scenarios.generate``.

Nominal models are written by hand (`case.toml`); what is "measured" comes from published tables,
from the solid twins, or from a beam truth on a finer mesh that no strategy is given.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from femubench import Model, Sensors, solve_modes
from femubench.fem import GroundSpring, Place, PointMass, Section
from femubench.scenarios.structures import HALF_SIDE, RUNG, ladder_truth
from femubench.scenarios.twin_data import read_shapes, twin_modes

HERE = Path(__file__).parent
Array = npt.NDArray[np.float64]

FRAME_HZ = (226.8, 275.2, 537.4, 861.5, 974.8)
HFRAME_HZ = (77.13, 137.60, 300.90, 404.98, 482.23, 911.64, 960.79, 979.89)
HFRAME_DAMPING = (0.0049, 0.0022, 0.0009, 0.0007, 0.0007, 0.0011, 0.0008, 0.0010)
TEST_STD, TWIN_STD, BEAM_STD = 0.005, 0.0025, 0.002  # of a frequency

# Changes of the ladder's beam truth: masses (kg) and springs (N/m) at coordinates.
CHANGES: Mapping[str, tuple[Mapping[int, float], Mapping[int, float]]] = {
    "mass and spring at 6": ({6: 0.5}, {6: 1.0e6}),
    "mass at 9": ({9: 0.5}, {}),
    "spring at 5": ({}, {5: 1.0e6}),
    "mass at 13": ({13: 0.25}, {}),
    "mass at 12, spring at 8": ({12: 0.3}, {8: 5.0e5}),
    "masses at 2 and 10": ({2: 0.4, 10: 1.0}, {}),
}
MEMBER_OF = {
    2: "rung-right",
    4: "front-right",
    6: "front-left",
    8: "rung-left",
    10: "back-left",
    12: "back-right",
    13: "rung-middle",
}


def ladder_sensors(stretch: float = 1.0) -> Sensors:
    """Return the 13 measuring points, numbered along the rim from the accelerometer's corner."""
    middle, right, left = HALF_SIDE, 2 * HALF_SIDE, HALF_SIDE * (1.0 - stretch)
    rim = [(right, RUNG), (right, RUNG / 2), (right, 0.0), (1.5 * HALF_SIDE, 0.0), (middle, 0.0)]
    rim += [((left + middle) / 2, 0.0), (left, 0.0), (left / 2, RUNG / 2), (0.0, RUNG)]
    rim += [(HALF_SIDE / 2, RUNG), (middle, RUNG), (1.5 * HALF_SIDE, RUNG), (middle, RUNG / 2)]
    xyz = np.array([(x, y, 0.0) for x, y in rim])
    return Sensors(tuple(f"{i}Z" for i in range(1, 14)), xyz, ("z",) * 13)


def hframe_sensors() -> Sensors:
    """Return 28 measuring points, as many as the test had, at stations of the twin."""
    across = (0.0634667, 0.133133, 0.2028, 0.272467, 0.356067)
    along = (-0.3, -0.216505, -0.146926, -0.0634316, 0.0637455, 0.176327, 0.260764, 0.373345, 0.5)
    rows = [(f"H{i + 1}Z", (x, 0.0, 0.0), "z") for i, x in enumerate(across)]
    mirrored = (0.383933, 0.467533, 0.5372, 0.606867, 0.676533)
    rows += [(f"H{i + 6}Z", (x, 0.0, 0.0), "z") for i, x in enumerate(mirrored)]
    rows += [
        (f"{side}{i + 1}X", (x, 0.0, z), "x")
        for side, x in (("L", 0.0), ("R", 0.74))
        for i, z in enumerate(along)
    ]
    labels, xyz, directions = zip(*rows, strict=True)
    return Sensors(labels, np.array(xyz), directions)


def _place(coordinate: int) -> Place:
    member = MEMBER_OF.get(coordinate)
    return Place(joint=f"J{coordinate}") if member is None else Place(member=member, s=0.5)


def write_sensors(folder: Path, sensors: Sensors) -> None:
    """Write ``sensors.csv``."""
    table = pd.DataFrame(sensors.xyz, columns=["x", "y", "z"])
    table.insert(0, "label", sensors.labels)
    table["direction"] = sensors.directions
    table.to_csv(folder / "sensors.csv", index=False, float_format="%.9g", lineterminator="\n")


def write_modes(
    path: Path,
    sensors: Sensors,
    frequencies: Sequence[float] | Array,
    shapes: Array,
    std: float,
    damping: Sequence[float] | None = None,
) -> None:
    """Write a table of modes; every shape is scaled to a largest component of 1."""
    count = len(frequencies)
    table = pd.DataFrame({"mode": np.arange(1, count + 1), "frequency": frequencies})
    table["frequency_std"] = std * table["frequency"]
    table["damping"] = np.full(count, np.nan) if damping is None else damping
    # Symmetric structures have several largest components: take the first, whatever roundoff says.
    size = np.abs(np.nan_to_num(shapes))
    peak = shapes[np.argmax(size >= 0.999 * size.max(axis=0), axis=0), np.arange(count)]
    scaled = pd.DataFrame((shapes / peak).T, columns=list(sensors.labels))
    text = pd.concat([table, scaled.round(6) + 0.0], axis=1)
    text.to_csv(path, index=False, float_format="%.7g", lineterminator="\n")


def _pairs(sensors: Sensors) -> list[tuple[Array, str]]:
    return list(zip(sensors.xyz, sensors.directions, strict=True))


def write_tests(root: Path) -> None:
    """Write the two published tests with the shapes of the twins under the test's masses."""
    sensors = ladder_sensors()
    write_sensors(root / "frame", sensors)
    shapes = read_shapes("frame_twin_outofplane.csv", HERE / "frame", sensors)
    write_modes(root / "frame" / "modes.csv", sensors, FRAME_HZ, shapes[:, :5], TEST_STD)
    sensors = hframe_sensors()
    write_sensors(root / "hframe", sensors)
    shapes = read_shapes("hframe_twin_inplane.csv", HERE / "hframe", sensors)
    # Test mode 7 moves out of plane and has no shape here; the twin's mode 7 is the test's 8.
    listed = np.column_stack([shapes[:, :6], np.full(len(sensors), np.nan), shapes[:, 6]])
    path = root / "hframe" / "modes.csv"
    write_modes(path, sensors, HFRAME_HZ, listed, TEST_STD, HFRAME_DAMPING)


def write_solid(root: Path) -> None:
    """Write the scenarios whose every figure comes from a solid twin."""
    for folder, part, sensors, base, modified in (
        ("frame-solid", "ladder-solid", ladder_sensors(), "frame_twin_outofplane.csv",
         "frame_twin_modified.csv"),
        ("hframe-solid", "hframe-solid", hframe_sensors(), "hframe_twin_inplane.csv",
         "hframe_twin_modified.csv"),
    ):  # fmt: skip
        for target in (root / folder, root / "design-change" / part):
            write_sensors(target, sensors)
            for file, name in ((base, "modes.csv"), (modified, "modified.csv")):
                frequencies, shapes = twin_modes(file, _pairs(sensors))
                count = 10 if name == "modes.csv" else 8
                write_modes(
                    target / name, sensors, frequencies[:count], shapes[:, :count], TWIN_STD
                )


def _write_truth(path: Path, model: Model, sensors: Sensors, count: int) -> None:
    modes = solve_modes(model).elastic
    shapes = (model.observe(sensors) @ modes.shapes)[:, :count]
    write_modes(path, sensors, modes.natural_frequencies[:count], shapes, BEAM_STD)


def write_beam(root: Path) -> None:
    """Write the scenarios whose truth is the ladder of shear-flexible beams and soft joints."""
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    for folder, stretch, soft in (
        ("frame-beam", 1.0, 1.0),
        ("frame-beam-asymmetric", 1.04, 0.25),
        ("design-change/ladder-beam", 1.0, 1.0),
    ):
        target, sensors = root / folder, ladder_sensors(stretch)
        write_sensors(target, sensors)
        truth = Model.of(ladder_truth(tube, stretch, soft))
        _write_truth(target / "modes.csv", truth, sensors, 8)
        changes = CHANGES if "design" in folder else dict(list(CHANGES.items())[:1])
        for name, (masses, springs) in changes.items():
            modified = truth.attach(
                [PointMass(_place(at), mass) for at, mass in masses.items()],
                [GroundSpring(_place(at), "z", stiffness) for at, stiffness in springs.items()],
            )
            file = "modified.csv" if len(changes) == 1 else f"{name.replace(' ', '-')}.csv"
            _write_truth(target / file.replace(",", ""), modified, sensors, 6)


def write_all(root: Path) -> None:
    """Write the data of every scenario below a folder that has their sub-folders."""
    write_tests(root)
    write_solid(root)
    write_beam(root)


if __name__ == "__main__":
    write_all(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
