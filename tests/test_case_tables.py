"""Joints and members of a frame in tables of their own, and frames of many members."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femubench import Case, InputError
from femubench.core.case import frame_tables, writing
from femubench.core.case.reader import read_case
from femubench.core.case.writing import write_case
from femubench.core.fem.mesh import Mesh, build_mesh
from femubench.fem import Frame, Joint, Material, Member, Place, PointMass, Section

CASES = Path(__file__).parent / "cases"
JOINTS = "name,x,y,z\nfoot,0,0,0\nknee,0.0,0,0.5\ntip,0.4,0.3,0.6\n"
MEMBERS = """name,end_1,end_2,elements,section,material,up_x,up_y,up_z
post,foot,knee,5,flat,steel,0,1,0
arm,knee,tip,5,numbers,steel,,,
"""


def tabled(folder: Path, joints: str = JOINTS, members: str = MEMBERS) -> Path:
    """Write the spatial case of the tests with its joints and members in tables."""
    shutil.copytree(CASES / "3d", folder)
    text = (folder / "case.toml").read_text()
    text = re.sub(r"\[\[model\.(joints|members)\]\]\n(?:[^\[\n].*\n|\n)*", "", text)
    keys = '[model]\njoints = "joints.csv"\nmembers = "members.csv"\n'
    (folder / "case.toml").write_text(text.replace("[model]\n", keys, 1))
    (folder / "joints.csv").write_text(joints)
    (folder / "members.csv").write_text(members)
    return folder


def said(case: Case) -> list[object]:
    """Return what a case says of its joints and members."""
    frame = case.model.frame_structure.frame
    members = [(m.name, m.ends, m.elements, m.section.name, m.up) for m in frame.members]
    return [frame.joints, members]


def test_tables_say_the_same_as_keys(tmp_path: Path) -> None:
    case, other = read_case(tabled(tmp_path / "case")), read_case(CASES / "3d")
    assert said(case) == said(other)
    assert abs(case.model.stiffness - other.model.stiffness).max() == 0.0
    assert case.digest != other.digest


@pytest.mark.parametrize(
    ("joints", "members", "stated"),
    [
        (JOINTS.replace("0.4,", "nan,"), MEMBERS, "joints.csv:4: x: 'nan' is not allowed"),
        (JOINTS.splitlines()[0] + "\n", MEMBERS, "joints.csv: no rows"),
        (JOINTS.replace("tip", "knee"), MEMBERS, "joints.csv:4: name: 'knee' is listed twice"),
        (JOINTS, MEMBERS.replace("tip,5", "top,5"), "members.csv:3: end_2: member 'arm' ends"),
        (JOINTS, MEMBERS.replace("numbers", "round"), "members.csv:3: section: there is no"),
        (JOINTS, MEMBERS.replace("0,1,0", "0,1,"), "members.csv:2: up_z: '' is not allowed"),
        (JOINTS, MEMBERS.replace("end_2", "last"), "members.csv:1: end_2: missing column"),
        (JOINTS, MEMBERS.replace("up_x", "twist"), "members.csv:1: twist: unknown column"),
    ],
)
def test_a_fault_is_said_with_file_line_and_column(
    tmp_path: Path, joints: str, members: str, stated: str
) -> None:
    with pytest.raises(InputError) as error:
        read_case(tabled(tmp_path / "case", joints, members))
    assert stated in str(error.value)
    assert "\n" not in str(error.value)


def test_a_table_lies_in_the_case_folder(tmp_path: Path) -> None:
    folder = tabled(tmp_path / "case")
    text = (folder / "case.toml").read_text().replace("joints.csv", "../joints.csv")
    (folder / "case.toml").write_text(text)
    with pytest.raises(InputError, match=r"model\.joints.*leads out"):
        read_case(folder)


def test_large_frames_are_written_with_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writing, "MANY", 1)
    case = read_case(CASES / "3d")
    write_case(tmp_path / "written", case)
    assert (tmp_path / "written" / "members.csv").read_text().splitlines()[0].startswith("name,end")
    back = read_case(tmp_path / "written")
    assert said(back) == said(case)
    assert frame_tables.MANY > 100  # a case that people read keeps its keys


def plane_frame(count: int, elements: int = 3) -> Frame:
    """Return a zigzag of members out of plane."""
    rng = np.random.default_rng(5)
    tube, steel = Section.rectangular_tube(0.05, 0.04, 0.003), Material(2.1e11, 0.3, 7800.0)
    joints = tuple(
        Joint(f"J{i}", (float(i), float(rng.uniform(-1, 1)), 0.0)) for i in range(count + 1)
    )
    members = tuple(
        Member(f"M{i}", (f"J{i}", f"J{i + 1}"), 1 + (elements + i) % 4, tube, steel)
        for i in range(count)
    )
    return Frame("out-of-plane", "timoshenko", joints, members)


def mesh_arrays(mesh: Mesh) -> list[np.ndarray]:
    return [mesh.xyz, mesh.ends, mesh.axes, mesh.member, mesh.number, mesh.stations]


def test_members_meshed_together_are_those_meshed_one_by_one() -> None:
    frame = plane_frame(40)
    # A mass next to a node splits nothing, but its member takes the way of split ones.
    masses = tuple(PointMass(Place(member=m.name, s=1e-12), 0.0) for m in frame.members[::2])
    one, other = build_mesh(frame), build_mesh(replace(frame, masses=masses))
    for first, second in zip(mesh_arrays(one), mesh_arrays(other), strict=True):
        assert np.array_equal(first, second)
