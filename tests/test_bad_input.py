"""Whatever is wrong in a case folder: one line with file, line, key and what was expected."""

import re
import shutil
from pathlib import Path

import pytest

from femubench import InputError, read_case

CASES = Path(__file__).parent / "cases"

Row = tuple[str, str, int, str, str, str]

# text, its replacement, lines from there to the error's line, key, and words of what is wrong
# and of what is expected
ROWS: dict[tuple[str, str], list[Row]] = {
    ("in-plane", "case.toml"): [
        ('name = "portal"', 'name = "portal', 0, "", "Illegal", "TOML"),
        ("[case]", "[case]\n[case]", 1, "", "Cannot declare", "TOML"),
        ("title", "titel", 0, "case.titel", "is 'title' meant", "source"),
        ("nu = 0.3\n", "", -2, "model.materials.steel.nu", "missing", "-1"),
        ('kind = "frame"', "", -1, "model.kind", "missing", "'matrices'"),
        ('"frame"', '"fem"', 0, "model.kind", "'fem'", "'frame'"),
        ('"in-plane"', '"xz"', 0, "model.plane", "'xz'", "out-of-plane"),
        ("[[model.joints]]", "[[model.join]]", 0, "model.join", "", "joints"),
        ("[case]", "[kase]", 0, "kase", "'case' meant", "measurement"),
        ("210e9", "-210e9", 0, "model.materials.steel.E", "-210", "> 0"),
        ("0.3\n", "0.5\n", 0, "model.materials.steel.nu", "0.5", "< 0.5"),
        ("7850.0", "nan", 0, "model.materials.steel.rho", "nan", "> 0"),
        ("7850.0", "'7850'", 0, "model.materials.steel.rho", "'7850'", "> 0"),
        ("1.5, 0.0, 1.2", "1.5, 0.0, inf", 0, "model.joints[2].xyz[2]", "inf", "m"),
        ("1.5, 0.0, 1.2", "1.5, 1.2", 0, "model.joints[2].xyz", "number", "m"),
        ("elements = 6", "elements = 0", 0, "model.members[1].elements", "0", "from 1 to 1000000"),
        ("mass = 0.2", "mass = -0.2", 0, "model.masses[0].mass", "-0.2", ">= 0"),
        ("0.003", "0.02", 0, "model.sections.beam.wall", "0.02", "< 0.02"),
        ("rectangular-", "oval-", 0, "model.sections.beam.shape", "oval", "tube"),
        ("wall = 0.003", "", -4, "model.sections.beam.wall", "missing", "height"),
        ("0.003", "0.003\ndiameter = 1", 1, "model.sections.beam.diameter", "not a size", "wall"),
        ("kappa = 0.44", "", -3, "model.sections.post.kappa", "missing", "shear"),
        ("Iy = 8.2e-8", "width = 0.1", 0, "model.sections.post.width", "without a shape", "square"),
        ('["B", "C"]', '["B", "X"]', 0, "model.members[1].ends[1]", "'X'", "joint"),
        ('["B", "C"]', '["B", "B"]', 0, "model.members[1].ends", "zero", "two"),
        ("1.5, 0.0, 1.2", "0, 0, 1", 0, "model.joints[2].xyz", "same point", "own"),
        ("1.5, 0.0, 1.2", "1.5, 0.1, 1.2", 0, "model.joints[2].xyz", "plane", "y = 0"),
        ('name = "C"', 'name = "B"', 0, "model.joints[2].name", "twice", "own"),
        ('name = "C"', 'name = "C@1"', 0, "model.joints[2].name", "C@1", "without @"),
        ('section = "beam"', 'section = "ibeam"', 0, "model.members[1].section", "ibeam", "beam"),
        ("elements = 6", "up = [0, 0, 1]", 0, "model.members[1].up", "in-plane", "3d"),
        ("elements = 6", "elements = 999999", 0, "model.members[1].elements", "more than", "fewer"),
        ('at = "B"', 'at = "Z"', 0, "model.masses[0].at", "'Z'", "joint"),
        ("s = 0.3", "s = 1.3", 0, "model.masses[1].at", "0..1", "0.25"),
        ('"right@0.5"', '"right@half"', 0, "model.springs[0].at", "half", "0.25"),
        ('"-x"', '"y"', 0, "model.springs[0].direction", "'y'", "x, z, ry"),
        ('["x", "z"]', '["x", "rz"]', 0, "model.supports[1].fixed", "'rz'", "x, z, ry"),
        ("{ry = 3e5,", "{rz = 3e5,", 0, "model.joint_springs[0].stiffness", "'rz'", "ry"),
        ('joint = "C"', 'joint = "A"', 0, "model.joint_springs[0].joint", "'A'", "D, C"),
        ("arm = 0.02", "arm = 0.9", -4, "model.joint_springs[0]", "arm", ""),
        ("arm = 0.02\n", "", 0, "model.joint_springs[0].arm_factor", "no arm", "arm > 0"),
        ("-0.01", "0.9", -3, "model.rigid_ends[0]", "rigid end", ""),
        ('"modes.csv"', '"mode.csv"', 0, "measurement.modes", "no file", "a file in"),
        ('"modes.csv"', '"../modes.csv"', 0, "measurement.modes", "out of", "inside"),
        ('"modes.csv"', '"case.toml"', 0, "measurement.modes", "kind of file", ".csv"),
        ("used = [1, 2]", "used = [1, 3]", 0, "measurement.used[1]", "no data", "1, 2, 4, 7"),
        ("used = [1, 2]", "used = []", 0, "measurement.used", "entries", "one at least"),
        ("held_out = [4]", "held_out = [2]", 0, "measurement.held_out[0]", "twice", "once"),
        ("[5.0, 400.0]", "[400.0, 5.0]", 0, "measurement.band", "empty", "low < high"),
        ('{at = "C", mass', '{at = "K", mass', 0, "modification[0].masses[0].at", "'K'", "joint"),
    ],
    ("out-of-plane", "case.toml"): [
        ("J = 2.1e-8", "", -4, "model.sections.numbers.J", "missing", "Jp"),
        ("0.8, 0.3", "0.8, 0.4", 0, "model.joints[3].xyz", "plane", "z = 0.3"),
        ('["C", "D"]', '["C", "B"]', -18, "model.joints[3]", "not connected", "members"),
        ('direction = "z"', 'direction = "x"', 0, "model.springs[0].direction", "'x'", "z, rx, ry"),
    ],
    ("3d", "case.toml"): [
        ("0.0, 1.0, 0.0", "0, 0, 1", 0, "model.members[0].up", "along", "vector"),
    ],
    ("in-plane", "sensors.csv"): [
        ("girder,0.75,0,1.1", "girder,0.75,0,1.2", 0, "x", "off the structure", "tolerance"),
        ("left_mid", "left_top", 0, "label", "twice", "own"),
        ("left_mid", "damping", 0, "label", "reserved", "own"),
        ("1.1,z", "1.1,y", 0, "direction", "'y'", "x, z, ry"),
        ("1.1,z", "1.1,up", 0, "direction", "'up'", "one of x"),
        ("0.75,", "nan,", 0, "x", "nan", "number"),
        ("label,x", "name,x", 0, "label", "missing column", "name"),
        ("girder,", "girder,girder,", 0, "", "6 cells", "5"),
    ],
    ("out-of-plane", "sensors.csv"): [
        ("long@0.5", "long@2", 0, "at", "station", "0..1"),
        ("a,A", "a,Q", 0, "at", "'Q'", "joint"),
    ],
    ("in-plane", "modes.csv"): [
        ("2,80.0", "1,80.0", 0, "mode", "twice", "own"),
        ("2,80.0", "two,80.0", 0, "mode", "'two'", "whole"),
        ("2,80.0", "2,-80.0", 0, "frequency", "'-80.0'", "> 0"),
        ("2,80.0", "2,1e999", 0, "frequency", "too large", "finite"),
        ("2,80.0", "2,", 0, "frequency", "empty", "> 0"),
        ("21.5,0.05", "21.5,-0.05", 0, "frequency_std", "'-0.05'", ">= 0"),
        ("0.004", "1.5", 0, "damping", "1.5", "ratio"),
        ("0.02,", "o.o2,", 0, "girder", "o.o2", "number"),
        (",turn", ",twist", 0, "twist", "unknown column", "mode"),
        (",turn", ",", 0, "", "no name", "name"),
        ("0.8,0.001", "0.8,-0.001", 0, "girder_std", "'-0.001'", ">= 0"),
        ("0.1,,-2.0,0.5", "0,,0,0", 0, "mode", "zero", "shape"),
        ("2,80.0", '"2,80.0', 2, "", "quotation", "commas"),
    ],
}  # fmt: skip
BROKEN = [(*at, row) for at, rows in ROWS.items() for row in rows]


def message(folder: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        read_case(folder)
    assert "\n" not in str(caught.value)
    return caught.value


def broken_copy(folder: Path, case: str, file: str, old: str, new: str) -> Path:
    shutil.copytree(CASES / case, folder, dirs_exist_ok=True)
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, 1))
    return folder


@pytest.mark.parametrize(
    ("case", "file", "row"), BROKEN, ids=[f"{row[3]}-{i}" for i, (_, _, row) in enumerate(BROKEN)]
)
def test_one_line(tmp_path: Path, case: str, file: str, row: Row) -> None:
    old, new, lines_on, key, what, expected = row
    error = message(broken_copy(tmp_path / "case", case, file, old, new))
    before = (CASES / case / file).read_text().split(old)[0]
    line = before.count("\n") + 1 + lines_on
    assert (error.line, error.key or "") == (line, key)
    assert what in error.what
    assert expected in (error.expected or "")
    assert str(error).startswith(f"{tmp_path / 'case' / file}:{line}: ")
    assert re.search("pydantic|Traceback|type=|Input should", str(error)) is None


@pytest.mark.parametrize(
    ("new", "what"), [("x = " + "[" * 9999, "nested"), ("x = " + "1" * 5000, "too long")]
)
def test_monstrous_toml(tmp_path: Path, new: str, what: str) -> None:
    folder = broken_copy(tmp_path / "case", "in-plane", "case.toml", "[case]", new)
    assert what in message(folder).what


@pytest.mark.parametrize("file", ["case.toml", "modified.csv"])
def test_missing_file(tmp_path: Path, file: str) -> None:
    shutil.copytree(CASES / "in-plane", tmp_path / "case")
    (tmp_path / "case" / file).unlink()
    assert file in str(message(tmp_path / "case"))
    assert "case.toml" in str(message(tmp_path / "nothing").expected)


@pytest.mark.parametrize("file", ["case.toml", "modes.csv"])
def test_bytes_that_are_no_text(tmp_path: Path, file: str) -> None:
    shutil.copytree(CASES / "in-plane", tmp_path / "case")
    with (tmp_path / "case" / file).open("ab") as stream:
        stream.write(b"\n\xff\xfe\n")
    error = message(tmp_path / "case")
    assert error.expected == "UTF-8"
    assert error.line is not None


def test_a_frame_that_cannot_move(tmp_path: Path) -> None:
    shutil.copytree(CASES / "3d", tmp_path / "case")
    file = tmp_path / "case" / "case.toml"
    text = file.read_text().replace("elements = 5", "elements = 1")
    support = '[[model.supports]]\nat = "{}"\nfixed = ["x", "y", "z", "rx", "ry", "rz"]\n'
    file.write_text(text + support.format("knee") + support.format("tip"))
    error = message(tmp_path / "case")
    assert (error.key, error.what) == ("model.supports", "nothing can move")


SPRING = """[[model.joint_springs]]
joint = "{}"
member = "right"
stiffness = {{ry = 3e5}}
arm = {}
"""
RIGID = """[[model.rigid_ends]]
joint = "{}"
member = "{}"
stiffness_length = {}
mass_length = 0.0
"""


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("joint_springs", SPRING.format("D", 0.9), "joint_springs[0]"),
        ("joint_springs", SPRING.format("D", 0.01), "joint_springs[1]"),
        ("rigid_ends", RIGID.format("C", "girder", 0.9), "rigid_ends[0]"),
        ("rigid_ends", RIGID.format("A", "left", 0.01), "rigid_ends[1]"),
    ],
)
def test_of_several_like_parts_the_one_at_fault_is_named(
    tmp_path: Path, old: str, new: str, key: str
) -> None:
    """Another one stands before that of the case, which is good or bad against it."""
    folder = tmp_path / "case"
    head = f"[[model.{old}]]"
    broken_copy(folder, "in-plane", "case.toml", head, new + head)
    if key.endswith("[1]"):
        good = "arm = 0.02" if old == "joint_springs" else "stiffness_length = -0.01"
        text = (folder / "case.toml").read_text()
        (folder / "case.toml").write_text(text.replace(good, f"{good.split()[0]} = 0.9"))
    error = message(folder)
    assert error.key == f"model.{key}"
    assert error.line is not None


def test_empty_tables(tmp_path: Path) -> None:
    shutil.copytree(CASES / "in-plane", tmp_path / "case")
    for file, content in (("modes.csv", "mode,frequency\n"), ("sensors.csv", "")):
        (tmp_path / "case" / file).write_text(content)
        assert str(message(tmp_path / "case").file).endswith(file)
