"""Sensors go to the nearest place of the structure: tolerance, unit, axes, directions."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from femubench import Case, FemubenchError, InputError, Measurement, Sensors, read_case
from femubench.core.case.nodes import with_mesh
from femubench.core.case.writing import write_case
from femubench.fem import MatrixGeometry, matrix_model

CASES = Path(__file__).parent / "cases"
PLACES = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.5], [0.75, 0.0, 1.1], [1.5, 0.0, 0.6]])
TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # "x,z,-y"


class Reader:
    """Gives one measurement, whatever the file says."""

    name, suffixes = "made up", (".test",)

    def __init__(self, xyz: np.ndarray, directions: tuple[str, ...] = ("x",) * 4) -> None:
        self.sensors = Sensors(tuple("abcd"), np.asarray(xyz, dtype=float), directions)

    def read_modes(self, path: Path) -> Measurement:
        count = len(self.sensors)
        two = np.arange(2.0 * count).reshape(count, 2) + 1.0
        hertz = np.array([10.0, 20.0])
        return Measurement(
            self.sensors, (1, 2), hertz, 0.01 * hertz, np.full(2, np.nan), two, 0.1 * two
        )

    def read_matrix(self, path: Path) -> None:
        raise InputError("none", file=path)


def read(tmp_path: Path, reader: Reader, keys: str = "") -> Case:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case", dirs_exist_ok=True))
    text = (CASES / "in-plane" / "case.toml").read_text().split("[[modification]]")[0]
    text = text.replace('sensors = "sensors.csv"', keys).replace("modes.csv", "m.test")
    (folder / "case.toml").write_text(text.replace("held_out = [4]", ""))
    (folder / "m.test").write_text("")
    return read_case(folder, readers=(reader,))


def test_sensors_next_to_the_structure_are_moved_and_said(tmp_path: Path) -> None:
    companions = PLACES + np.array([0.0, 0.004, 0.0])
    case = read(tmp_path, Reader(companions))
    np.testing.assert_allclose(case.measurement.sensors.xyz, PLACES, atol=1e-12)
    assert [(m.sensor, m.place) for m in case.matches] == [
        ("a", "B"), ("b", "left@0.5"), ("c", "girder@0.5"), ("d", "right@0.5"),
    ]  # fmt: skip
    assert case.matches[0].distance == pytest.approx(0.004)
    assert "4 of the 4 sensors of m.test were moved" in case.notes[0]
    assert case.model.observe(case.measurement.sensors).shape[0] == 4
    # Written, the places are those of the structure, and nothing is left to say.
    write_case(tmp_path / "written", case)
    again = read_case(tmp_path / "written")
    np.testing.assert_array_equal(again.measurement.sensors.xyz, case.measurement.sensors.xyz)
    assert again.notes == ()


def test_tolerance_is_a_share_of_the_structure(tmp_path: Path) -> None:
    companions = PLACES + np.array([0.0, 0.03, 0.0])
    with pytest.raises(
        InputError, match=r"'a' at .* 0.03 m off the structure, nearest B .*0.0192 m"
    ):
        read(tmp_path, Reader(companions))
    assert len(read(tmp_path, Reader(companions), "tolerance = 0.02").matches) == 4
    with pytest.raises(InputError, match="off the structure"):
        read(tmp_path, Reader(PLACES + np.array([0.0, 0.001, 0.0])), "tolerance = 0.0")


@pytest.mark.parametrize("size", [-1e31, 1.4e154, 1.7e308])
def test_a_coordinate_of_which_a_square_might_overflow_is_refused(
    tmp_path: Path, size: float
) -> None:
    lost = PLACES.copy()
    lost[0, 2] = size
    with pytest.raises(InputError, match=r"a coordinate of 'a' is 1.*expected .* up to 1e\+30"):
        read(tmp_path, Reader(lost))


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254)])
def test_unit_is_detected_and_said(tmp_path: Path, unit: str, metres: float) -> None:
    case = read(tmp_path, Reader(PLACES / metres))
    np.testing.assert_allclose(case.measurement.sensors.xyz, PLACES, atol=1e-12)
    assert f"coordinates were taken in {unit}" in case.notes[0]
    stated = read(tmp_path, Reader(PLACES / metres), f'unit = "{unit}"')
    assert stated.notes == ()


def test_stated_unit_is_believed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'off the structure.*with unit = "mm" all fit'):
        read(tmp_path, Reader(1e3 * PLACES), 'unit = "m"')


def test_one_sensor_far_off_changes_no_unit(tmp_path: Path) -> None:
    wrong = PLACES.copy()
    wrong[3, 2] = 6.0  # typed for 0.6
    with pytest.raises(InputError, match=r"sensor 'd' at .* nearest C "):
        read(tmp_path, Reader(wrong))


def test_frame_of_the_test_turns_places_and_directions(tmp_path: Path) -> None:
    ways = ("x", "-y", "0.6 -0.8 0.0", "rz")  # of a test whose z is the model's y
    with pytest.raises(InputError, match='with frame = "x,z,-y" all fit'):
        read(tmp_path, Reader(PLACES @ TURN, ways))
    case = read(tmp_path, Reader(PLACES @ TURN, ways), 'frame = "x,z,-y"')
    np.testing.assert_allclose(case.measurement.sensors.xyz, PLACES, atol=1e-12)
    # Its rotation about z is one about y, which the portal has.
    assert case.measurement.sensors.directions == ("x", "z", "0.6 0.0 0.8", "ry")


@pytest.mark.parametrize("text", ["x,y", "x,y,y", "x,y,-z", "x;y;z", "", "x,y,z,x"])
def test_frames_that_are_none(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"measurement\.frame"):
        read(tmp_path, Reader(PLACES), f'frame = "{text}"')


def test_two_sensors_at_one_place_and_direction(tmp_path: Path) -> None:
    shared = PLACES.copy()
    shared[1] = PLACES[0] + np.array([-0.01, 0.0, 0.0])
    with pytest.raises(InputError, match="sensors 'a' and 'b' both lie nearest to B, direction x"):
        read(tmp_path, Reader(shared))
    case = read(tmp_path, Reader(shared, ("x", "z", "x", "x")))  # two directions
    assert [match.place for match in case.matches][:2] == ["B", "B"]


@pytest.mark.parametrize(
    ("xyz", "keys", "advice"),
    [
        (PLACES, 'frame = "x,z,-y"', 'with frame = "x,y,z" all fit'),
        (PLACES, 'unit = "cm"', 'with unit = "m" all fit'),
        (PLACES, 'unit = "in"\ntolerance = 0.5', 'with unit = "m" all fit'),
        (1e-5 * PLACES, "", "the structure 1.92 m (expected more than 0.0192 m"),
        (np.full((4, 3), np.nan), "", "sensors FILE`): a table label,x,y,z,direction"),
    ],
)
def test_what_would_fit_is_said(tmp_path: Path, xyz: np.ndarray, keys: str, advice: str) -> None:
    with pytest.raises(InputError) as fault:
        read(tmp_path, Reader(xyz), keys)
    assert advice in str(fault.value)


def test_a_test_of_a_small_part_is_said(tmp_path: Path) -> None:
    case = read(tmp_path, Reader(PLACES[0] + 0.02 * (PLACES - PLACES[0])))
    assert any("the structure 1.92 m: is one of the units wrong?" in note for note in case.notes)


def test_oblique_direction_in_a_table(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CASES / "3d", tmp_path / "case"))
    table = folder / "sensors.csv"
    table.write_text(table.read_text().replace("0.5,x", "0.5,0.6 0 0.8"))
    case = read_case(folder)
    assert case.measurement.sensors.directions[0] == "0.6 0 0.8"
    write_case(tmp_path / "again", case)
    again = read_case(tmp_path / "again").measurement.sensors
    np.testing.assert_array_equal(again.axes, case.measurement.sensors.axes)
    for wrong in ("0 0 0", "1 2", "0.6 0 inf", "x y z"):
        table.write_text(f"label,x,y,z,direction\nknee_x,0,0,0.5,{wrong}\n")
        with pytest.raises(FemubenchError, match=r"sensors.csv:2: direction.*vector"):
            read_case(folder)


def test_coordinates_in_a_table_in_millimetres_are_seen_and_said(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CASES / "3d", tmp_path / "case"))
    table = folder / "sensors.csv"
    table.write_text(
        "label,x,y,z,direction\nknee_x,0,0,500,x\narm_y,200,150,550,y\ntip_turn,400,300,600,-rz\n"
    )
    expected = read_case(CASES / "3d").measurement.sensors.xyz
    seen = read_case(folder)
    np.testing.assert_allclose(seen.measurement.sensors.xyz, expected)
    (note,) = (note for note in seen.notes if "sensors.csv" in note)
    assert "coordinates were taken in mm" in note
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace("[measurement]", '[measurement]\nunit = "mm"'))
    stated = read_case(folder)
    np.testing.assert_allclose(stated.measurement.sensors.xyz, expected)
    assert not any("were taken" in note for note in stated.notes)


def test_a_sensor_between_nodes_reads_a_linear_field_of_its_own_body() -> None:
    """Two bricks of 50, 40 and 10 mm, 1 mm apart, which no stiffness couples."""
    corners = np.array(list(np.ndindex(2, 2, 2))) * [0.05, 0.04, 0.01]
    xyz = np.vstack([corners, corners + np.array([0.0, 0.0, 0.011])])
    rows = np.repeat(np.arange(16), 3)
    stiffness = (rows[:, None] // 8 == rows // 8) + 48.0 * np.eye(48)
    model = with_mesh(matrix_model(np.eye(48), stiffness, rows, "xyz" * 16, xyz[rows]))
    rng = np.random.default_rng(7)
    inside = rng.uniform(size=(40, 3)) * [0.05, 0.04, 0.01] + np.repeat([[0, 0, 0.011]], 40, 0)
    inside[20:] -= [0.0, 0.0, 0.011]
    points = np.vstack([inside, xyz[3] + np.array([-0.001, 0.001, 0.0]), [0.02, 0.02, -0.003]])
    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    names, feet = zip(*geometry.nearest(points), strict=True)
    np.testing.assert_allclose(feet[:40], inside, atol=1e-9)
    np.testing.assert_allclose(feet[40:], [xyz[3], [0.02, 0.02, 0.0]], atol=1e-7)
    assert {int(name) > 7 for name in " + ".join(names[:20]).split(" + ")} == {True}
    assert names[40] == "3"
    directions = ("x", "-z", "0 0.6 0.8", "y") * 10
    sensors = Sensors(tuple(map(str, range(40))), np.array(feet[:40]), directions)
    gradient, offset = rng.standard_normal((3, 3)), rng.standard_normal(3)
    field = (xyz @ gradient.T + offset).ravel()
    expected = np.einsum("ij,ij->i", inside @ gradient.T + offset, sensors.axes[:, :3])
    np.testing.assert_allclose(model.observe(sensors) @ field, expected, atol=1e-7)
    # Amid four alike corners each has a quarter, whatever the rounding.
    ((place, _),) = geometry.nearest(np.array([[0.025, 0.02, 0.0]]))
    assert place == "0 + 2 + 4 + 6"
    shares = model.observe(Sensors(("m",), np.array([[0.025, 0.02, 0.0]]), ("z",))).data
    np.testing.assert_allclose(shares, 0.25, atol=1e-6)
