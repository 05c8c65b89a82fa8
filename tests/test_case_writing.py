"""A case folder that was written reads back to the same case, and writes the same bytes again."""

from __future__ import annotations

import os
import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import MISSING, fields, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
import seeds
from hypothesis import example, given, settings, strategies as st
from samples import one_of_each

from femubench import Case, InputError, Measurement, Model, Sensors, read_case
from femubench.core.case.writing import write_case
from femubench.core.fem.frame import (
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    GroundSpring,
    JointKind,
    JointSpring,
    Link,
    MemberSet,
    Oscillator,
    Place,
    PointMass,
    Preload,
    RigidEnd,
    Support,
)
from femubench.fem import Damping, LowRank, MatrixGeometry, Property, Section

HERE = Path(__file__).parent
CASES = HERE / "cases"
FOLDERS = [folder for folder in seeds.CASES if "handwritten" not in folder.parts]


def frame_of(case: Case) -> Frame:
    return case.model.frame_structure.frame


def assert_same_section(one: Section, other: Section) -> None:
    for f in (f for f in fields(Section) if f.compare):
        if f.name != "kappa":
            assert getattr(one, f.name) == getattr(other, f.name), f.name
    if one.kappa is None or other.kappa is None:
        assert one.kappa is other.kappa
    else:  # the wall of a tube is known but for the last digits
        for nu in (0.0, 0.17, 0.3):
            np.testing.assert_allclose(one.kappa(nu), other.kappa(nu), rtol=1e-13)


def assert_same_frame(one: Frame, other: Frame) -> None:
    for f in (f for f in fields(Frame) if f.compare):
        if f.name != "members":
            assert getattr(one, f.name) == getattr(other, f.name), f.name
    for first, second in zip(one.members, other.members, strict=True):
        assert_same_section(first.section, second.section)
        assert replace(first, section=second.section) == second


def assert_same_matrix(one: Any, other: Any) -> None:
    size = np.sqrt(np.abs(one.diagonal()))
    apart = (one - other).tocoo()
    assert np.all(np.abs(apart.data) <= 1e-12 * size[apart.row] * size[apart.col])


def assert_same_measurement(one: Measurement, other: Measurement) -> None:
    for f in fields(Measurement):
        first, second = getattr(one, f.name), getattr(other, f.name)
        if isinstance(first, np.ndarray) and f.name != "out_of_phase":
            np.testing.assert_array_equal(first, second)
        elif f.name not in ("sensors", "out_of_phase"):
            assert first == second
    assert one.sensors.labels == other.sensors.labels
    assert one.sensors.directions == other.sensors.directions
    np.testing.assert_array_equal(one.sensors.xyz, other.sensors.xyz)


def assert_same_case(one: Case, other: Case) -> None:
    for name in ("name", "title", "source", "structure", "used", "held_out", "band", "tolerance"):
        assert getattr(one, name) == getattr(other, name)
    assert_same_matrix(one.model.mass, other.model.mass)
    assert_same_matrix(one.model.stiffness, other.model.stiffness)
    assert one.model.dofs.direction == other.model.dofs.direction
    np.testing.assert_array_equal(one.model.dofs.node, other.model.dofs.node)
    np.testing.assert_array_equal(one.model.dofs.xyz, other.model.dofs.xyz)
    assert_same_measurement(one.measurement, other.measurement)
    for first, second in zip(one.modifications, other.modifications, strict=True):
        assert (first.name, first.masses, first.springs) == (
            second.name,
            second.masses,
            second.springs,
        )
        assert_same_measurement(first.measurement, second.measurement)


def content(folder: Path) -> dict[Path, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder): path.read_bytes() for path in files}


def round_trip(tmp_path: Path, case: Case, **how: Any) -> Case:
    """Write a case, read it, write it again to the same bytes; return what was read."""
    first, second = tmp_path / "first", tmp_path / "second"
    write_case(first, case, **how)
    back = read_case(first)
    write_case(second, back, comment=how.get("comment", ()))
    assert content(first) == content(second)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first", "second"]
    return back


def with_frame(case: Case, frame: Frame) -> Case:
    return replace(case, model=Model.of(frame))


def model_keys(folder: Path) -> dict[str, Any]:
    keys: dict[str, Any] = tomllib.loads((folder / "case.toml").read_text("utf-8"))["model"]
    return keys


@cache
def case_at(folder: Path) -> Case:
    return read_case(folder)


@pytest.fixture
def ladder() -> Case:
    return case_at(HERE.parent / "scenarios" / "frame-beam")


@pytest.fixture
def portal() -> Case:
    return case_at(CASES / "in-plane")


@pytest.fixture
def bracket() -> Case:
    return case_at(CASES / "3d")


def kind_of(folder: Path) -> object:
    """Return plane and keys of a model of the suite; every other case is of its own kind."""
    model = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))["model"]
    return folder.parent.name == "suite" or folder, model.get("plane"), frozenset(model)


def named(folder: Path) -> str:
    return f"{folder.parent.name}/{folder.name}"


@pytest.mark.parametrize("folder", one_of_each(FOLDERS, kind_of), ids=named)
def test_every_case_reads_back(tmp_path: Path, folder: Path) -> None:
    case = read_case(folder)
    back = round_trip(tmp_path, case)
    assert_same_case(case, back)
    assert_same_frame(frame_of(case), frame_of(back))
    old, new = (tomllib.loads((f / "case.toml").read_text()) for f in (folder, tmp_path / "first"))
    for key in ("materials", "sections"):
        assert set(new["model"][key]) <= set(old["model"][key])
    assert new["model"]["materials"] == old["model"]["materials"]


def full_frames(ladder: Case, portal: Case, bracket: Case) -> Iterator[tuple[str, Case, Frame]]:
    """Yield frames that together differ from a default frame in every field."""
    end, point = Place(joint="J3"), Place(member="back-left", s=0.3)
    base = frame_of(ladder)
    yield (
        "out-of-plane",
        ladder,
        replace(
            base,
            beam="timoshenko",
            bending_mass="cubic",
            rotary_inertia=1.4,
            masses=(PointMass(point, 0.05, (0.0, 0.01, 0.0)),),
            springs=(GroundSpring(end, "-ry", 1.2345678901234567),),
            supports=(Support(Place(joint="J9"), ("rx",)),),
            joint_springs=(JointSpring("J5", "front-left", {"ry": 3e4, "rx": 1 / 3}, 0.0127),),
            rigid_ends=(RigidEnd("J1", "rung-right", 0.01, 0.005),),
            factors=(
                Factor("E", ("front-left/2", "rung-left"), 0.7),
                Factor("shear", ("all",), 0.0),
            ),
            preloads=(Preload("front-left", 1500.0),),
            eccentricities=(Eccentricity("front-left", y=0.004),),
            couplings=(Coupling("front-left", -0.1),),
            oscillators=(Oscillator(point, "z", 0.05, 300.0),),
            joint_kinds=(JointKind("L", "bolted"),),
            sets=(MemberSet("side", ("front-left", "rung-left")),),
        ),
    )
    link = Link("J5", ("J11",), ("z", "rx"))
    yield "linked", ladder, replace(base, links=(link,), free=True)
    base = frame_of(portal)
    yield (
        "in-plane",
        portal,
        replace(
            base,
            rotary_inertia=True,
            braces=(Brace(("A", "C"), 1e5), Brace(("A", "B"), 2e4, "z")),
            eccentricities=(Eccentricity("left", z=-0.004),),
            gravity=0.5,
            damping=Damping(1.5, 2e-6, 0.01),
            oscillators=(Oscillator(Place(joint="B"), "x", 0.05, 30.0),),
        ),
    )
    base = frame_of(bracket)
    yield (
        "3d",
        bracket,
        replace(
            base,
            rotary_inertia=0.5,
            braces=(Brace(("foot", "tip"), 1e5),),
            couplings=(Coupling("arm", 0.2), Coupling("arm", 0.1)),
            eccentricities=(Eccentricity("arm", 1e-3, -2e-3),),
            joint_springs=(JointSpring("knee", "arm", {"ry": 3e4, "rz": 2e4}, 0.01),),
            oscillators=(
                Oscillator(Place(member="arm", s=0.5), "-y", 0.05, 300.0, crosswise=False),
            ),
        ),
    )


def test_every_field_of_a_frame_reads_back(
    tmp_path: Path, ladder: Case, portal: Case, bracket: Case
) -> None:
    seen = set()
    for name, case, frame in full_frames(ladder, portal, bracket):
        (tmp_path / name).mkdir()
        changed = with_frame(case, frame)
        back = round_trip(tmp_path / name, changed)
        assert_same_case(changed, back)
        assert_same_frame(frame, frame_of(back))
        seen |= {f.name for f in fields(Frame) if getattr(frame, f.name) != f.default}
    assert seen == {f.name for f in fields(Frame)}
    assert all(f.default is not MISSING for f in fields(Frame)[4:])


def test_a_model_given_next_to_the_case_is_the_one_written(tmp_path: Path, ladder: Case) -> None:
    frame = replace(frame_of(ladder), factors=(Factor("GJ", ("all",), 0.6),))
    lines = [
        "cause: torsion constant",
        'with "quotes"\nand a second line',
        "tab\tand \x07 bell",
        "",
    ]
    back = round_trip(
        tmp_path, ladder, model=Model.of(frame), comment=lines, name="ladder 2", title="a title"
    )
    assert_same_frame(frame, frame_of(back))
    assert (back.name, back.title, back.source) == ("ladder 2", "a title", ladder.source)
    assert_same_measurement(ladder.measurement, back.measurement)
    top = (tmp_path / "first" / "case.toml").read_text().splitlines()[:6]
    assert top == [
        "# cause: torsion constant",
        '# with "quotes"',
        "# and a second line",
        "# tab and   bell",
        "#",
        "",
    ]
    write_case(tmp_path / "text", ladder, comment="one\ntwo")
    assert (tmp_path / "text" / "case.toml").read_text().startswith("# one\n# two\n\n[case]\n")


# --- sections and materials -----------------------------------------------------------------------


def with_sections(case: Case, sections: dict[str, Section]) -> Frame:
    frame = frame_of(case)
    members = (replace(m, section=sections.get(m.name, m.section)) for m in frame.members)
    return replace(frame, members=tuple(members))


def section_table(folder: Path, member: str) -> tuple[str, dict[str, Any]]:
    keys = model_keys(folder)
    name = next(m["section"] for m in keys["members"] if m["name"] == member)
    return name, keys["sections"][name]


def test_a_changed_section_keeps_its_shape(tmp_path: Path, ladder: Case) -> None:
    tube = frame_of(ladder).members[0].section
    frame = with_sections(ladder, {"front-left": replace(tube, J=2.5e-8)})
    back = round_trip(tmp_path, with_frame(ladder, frame))
    assert_same_frame(frame, frame_of(back))
    shape = {"shape": "square-tube", "width": 0.0254, "wall": 0.00238}
    name, table = section_table(tmp_path / "first", "front-left")
    assert (name, table) == ("tube-front-left", {**shape, "J": 2.5e-8})
    name, table = section_table(tmp_path / "first", "rung-left")
    assert (name, table) == ("tube", {**shape, "J": 3.912476e-8})


@pytest.mark.parametrize(
    ("section", "table"),
    [
        (
            Section.rectangular_tube(0.04, 0.06, 0.003),
            {"shape": "rectangular-tube", "width": 0.04, "height": 0.06, "wall": 0.003},
        ),
        (
            Section.round_tube(0.03, 0.0021),
            {"shape": "round-tube", "diameter": 0.03, "wall": 0.0021},
        ),
        (Section.round_tube(0.03, 0.015), {"shape": "solid-circle", "diameter": 0.03}),
        (
            replace(
                Section.rectangular_tube(0.04, 0.04, 0.0025),
                kappa=Section.constant_kappa(0.4),
                J=1e-8,
            ),
            {"shape": "square-tube", "width": 0.04, "wall": 0.0025, "J": 1e-8, "kappa": 0.4},
        ),
        (
            Section(A=1e-4, Iy=1e-9, Iz=0.0, J=2e-9, Jp=3e-9),
            {"A": 1e-4, "Iy": 1e-9, "J": 2e-9, "Jp": 3e-9},
        ),
    ],
    ids=["box", "tube", "rod", "overridden", "numbers"],
)
def test_sections_whose_case_is_gone(
    tmp_path: Path, ladder: Case, section: Section, table: dict[str, Any]
) -> None:
    frame = with_sections(ladder, {m.name: section for m in frame_of(ladder).members})
    nowhere = replace(with_frame(ladder, frame), folder=tmp_path / "gone")
    back = round_trip(tmp_path, nowhere)
    assert_same_frame(frame, frame_of(back))
    assert section_table(tmp_path / "first", "front-left") == ("section", table)
    assert set(model_keys(tmp_path / "first")["materials"]) == {"material"}


# --- models that an update has changed ------------------------------------------------------------


def test_parameters_become_keys(tmp_path: Path, portal: Case) -> None:
    structure = portal.model.frame_structure
    parameters = [
        Property("all", "E", tuple(label for label in structure.label_index if label)),
        Property("left", "E", tuple(f"left/{k}" for k in (1, 2, 3, 4))),
        Property("one", "density", ("girder/2",)),
        Property("none", "shear", ("right/1", "left/1")),
        Property("spring", "spring", ("right@C:ry",), "N m/rad"),
        Property("end", "rigid", ("girder@B", "left@A"), "m"),
    ]
    updated = structure.with_values(parameters, [0.9, 0.8, 1.1, 0.0, 1.5e5, 0.015])
    updated = updated.with_values(parameters[:1], [1.05])
    back = round_trip(tmp_path, replace(portal, model=Model.of(updated)))
    frame = frame_of(back)
    assert_same_matrix(Model.of(updated).stiffness, back.model.stiffness)
    assert_same_matrix(Model.of(updated).mass, back.model.mass)
    assert {(f.quantity, f.at): f.factor for f in frame.factors} == {
        ("E", ("girder", "right")): pytest.approx(0.9 * 1.05),
        ("E", ("left",)): pytest.approx(0.9 * 0.8 * 1.05),
        ("density", ("girder/2",)): 1.1,
        ("shear", ("left/1", "right/1")): 0.0,
    }
    assert frame.joint_springs[0].stiffness == {"ry": 1.5e5, "x": 4e8}
    assert frame.rigid_ends == (RigidEnd("B", "girder", 0.015, 0.02), RigidEnd("A", "left", 0.015))


def test_a_factor_on_all_leaves_the_arms_of_joints_alone(tmp_path: Path, portal: Case) -> None:
    structure = portal.model.frame_structure
    labels = tuple(label for label in structure.label_index if label)
    updated = Model.of(structure.with_values([Property("all", "E", labels)], [0.9]))
    back = round_trip(tmp_path, replace(portal, model=updated))
    assert frame_of(back).factors == (Factor("E", ("all",), 0.9),)
    assert_same_matrix(updated.stiffness, back.model.stiffness)


def at_joints(case: Case) -> Case:
    """Return the case without what lies between the nodes of its nominal mesh."""
    spots = {joint.xyz for joint in frame_of(case).joints}
    keep = [i for i, xyz in enumerate(case.measurement.sensors.xyz) if tuple(xyz) in spots]
    m = case.measurement
    sensors = Sensors(
        tuple(m.sensors.labels[i] for i in keep),
        m.sensors.xyz[keep],
        tuple(m.sensors.directions[i] for i in keep),
    )
    measurement = replace(m, sensors=sensors, shapes=m.shapes[keep], shape_std=m.shape_std[keep])
    return replace(case, measurement=measurement, modifications=())


def test_changed_matrices_are_written_as_matrices(tmp_path: Path, ladder: Case) -> None:
    rng = np.random.default_rng(3)
    model = ladder.model
    basis = rng.standard_normal((model.size, 2))
    core = np.diag([1e3, 2e3])
    low_rank = replace(model, stiffness_change=LowRank(basis, core))
    edited = replace(model, mass=model.mass * 1.01)
    for name, changed in (("low-rank", low_rank), ("edited", edited)):
        (tmp_path / name).mkdir()
        back = round_trip(tmp_path / name, ladder, model=changed)
        assert model_keys(tmp_path / name / "first")["kind"] == "matrices"
        vectors = rng.standard_normal((model.size, 3))
        for product in ("stiffness_times", "mass_times"):
            expected = getattr(changed, product)(vectors)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(
                getattr(back.model, product)(vectors), expected, atol=1e-12 * scale
            )
        read = back.model.observe(back.measurement.sensors)
        np.testing.assert_array_equal(
            read.toarray(), model.observe(ladder.measurement.sensors).toarray()
        )
        masses, springs = ladder.modifications[0].masses, ladder.modifications[0].springs
        heavier = changed.attach(masses, springs)
        new = back.model.attach(back.modifications[0].masses, back.modifications[0].springs)
        np.testing.assert_allclose(
            new.mass_times(vectors), heavier.mass_times(vectors), atol=1e-9 * scale
        )


# --- matrices -------------------------------------------------------------------------------------


def as_matrices(folder: Path, case: Case, groups: str = "") -> Case:
    """Return a case of kind matrices made of what lies in `matrices/` of a written frame."""
    write_case(folder, case)
    text = (folder / "case.toml").read_text()
    tail = text[text.index("[measurement]") :]
    files = "".join(
        f'{key} = "matrices/{file}"\n'
        for key, file in (
            ("mass", "mass.mtx"),
            ("stiffness", "stiffness.mtx"),
            ("dofs", "dofs.csv"),
        )
    )
    head = f'[case]\nname = "matrices"\n[model]\nkind = "matrices"\n{files}{groups}'
    (folder / "case.toml").write_text(head + tail)
    return read_case(folder)


def test_the_folder_of_matrices_makes_a_case(tmp_path: Path, ladder: Case) -> None:
    groups = 'groups = [{name = "a b", dofs = ["J1", 5, "J3:z"]}, {name = "ü", dofs = ["J5"]}]\n'
    case = as_matrices(tmp_path / "from", at_joints(ladder), groups)
    assert_same_matrix(case.model.mass, ladder.model.mass)
    assert_same_matrix(case.model.stiffness, ladder.model.stiffness)
    (tmp_path / "to").mkdir()
    back = round_trip(tmp_path / "to", case)
    assert_same_case(case, back)
    assert isinstance(back.model.geometry, MatrixGeometry)
    assert isinstance(case.model.geometry, MatrixGeometry)
    assert back.model.geometry.names == case.model.geometry.names
    assert set(back.model.groups) == {"a b", "ü"}
    for name, part in case.model.groups.items():
        assert abs(part - back.model.groups[name]).max() == 0.0


def test_rows_in_any_order_and_odd_nodes(tmp_path: Path, ladder: Case) -> None:
    folder = tmp_path / "from"
    as_matrices(folder, at_joints(ladder))
    dofs = folder / "matrices" / "dofs.csv"
    header, *rows = dofs.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    lines = [",".join([str(int(row[0]) - 1), f'"{row[1]}, ""x""\\ é"', *row[2:]]) for row in cells]
    lines = lines[3::-1] + lines[:3:-1]
    dofs.write_text("\n".join([header, *lines]), encoding="utf-8")
    case = read_case(folder)
    (tmp_path / "to").mkdir()
    back = round_trip(tmp_path / "to", case)
    assert_same_case(case, back)
    assert isinstance(back.model.geometry, MatrixGeometry)
    assert back.model.geometry.first_row == 0
    assert 'J1, "x"\\ é' in back.model.geometry.names


def test_matrices_and_further_files_do_not_count(tmp_path: Path, ladder: Case) -> None:
    write_case(tmp_path / "new", ladder)
    digest = read_case(tmp_path / "new").digest
    shutil.rmtree(tmp_path / "new" / "matrices")
    (tmp_path / "new" / "notes.txt").write_text("mine")
    assert read_case(tmp_path / "new").digest == digest


def test_matrices_of_a_frame_for_other_programs(tmp_path: Path, portal: Case) -> None:
    write_case(tmp_path / "new", portal)
    folder = tmp_path / "new" / "matrices"
    for name in ("mass", "stiffness"):
        matrix = sp.csc_array(scipy.io.mmread(folder / f"{name}.mtx", spmatrix=False))
        own = getattr(portal.model, name)
        assert abs(matrix - 0.5 * (own + own.T)).max() <= 1e-15 * abs(own).max()
    axes = np.loadtxt(folder / "axes.csv", delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_array_equal(axes, portal.model.dofs.axes)
    nodes = [line.split(",")[1] for line in (folder / "dofs.csv").read_text().splitlines()]
    assert "girder 0.166667" in nodes
    assert "right 0.983333 arm" in nodes


# --- measurements ---------------------------------------------------------------------------------


def test_deviations_that_are_no_share_and_settings(tmp_path: Path, ladder: Case) -> None:
    m = ladder.measurement
    std = 0.0123 * np.max(np.abs(np.nan_to_num(m.shapes)), axis=0) * np.ones(m.shapes.shape)
    std[2, 1] = 0.5
    shapes = m.shapes.copy()
    shapes[0, 0] = np.nan
    shapes[:, 3] = np.nan
    std[:, 3] = np.nan
    m = replace(m, shapes=shapes, shape_std=std, total_mass=(1.0 / 3.0, 1e-7))
    settings = {"band": (0.0, 912.34), "tolerance": 0.0, "held_out": (), "source": ""}
    case = replace(ladder, measurement=m, modifications=(), **settings)  # type: ignore[arg-type]
    assert_same_case(case, round_trip(tmp_path, case))
    header = (tmp_path / "first" / "modes.csv").read_text().splitlines()[0].split(",")
    assert [name for name in header if name.endswith("_std")] == [
        "frequency_std",
        f"{m.sensors.labels[2]}_std",
    ]
    written = tomllib.loads((tmp_path / "first" / "case.toml").read_text())
    assert written["measurement"]["shape_std"] == 0.0123


def test_frequencies_alone(tmp_path: Path, ladder: Case) -> None:
    m = ladder.measurement
    none = np.zeros((0, len(m)))
    sensors = Sensors((), np.zeros((0, 3)), ())
    alone = replace(m, sensors=sensors, shapes=none, shape_std=none)
    case = replace(ladder, measurement=alone, modifications=())
    assert_same_case(case, round_trip(tmp_path, case))
    assert not (tmp_path / "first" / "sensors.csv").exists()


# --- names and numbers ----------------------------------------------------------------------------


NAMES = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Z"), exclude_characters="@/:"),
    min_size=1,
    max_size=30,
)
LABELS = NAMES.filter(str.isprintable).map(lambda name: f"{name}~")  # none is reserved
NUMBERS = st.floats(1e-9, 1e9)


@example(
    names=['"', "'[x]#\\u0041", '梁,="""ü', "1\u2028b"],
    labels=['"~', "'[x]#\\u0041~", '梁,="""ü~', "1''~"],
    numbers=[1.0] * 9,
    cells=[1.0] * 6,
)
@given(
    names=st.lists(NAMES, min_size=4, max_size=4, unique=True),
    labels=st.lists(LABELS, min_size=4, max_size=4, unique=True),
    numbers=st.lists(NUMBERS, min_size=9, max_size=9),
    cells=st.lists(st.one_of(st.floats(1e-29, 1e29), st.just(np.nan)), min_size=6, max_size=6),
)
@settings(max_examples=15, deadline=None)
def test_any_names_and_numbers(
    names: list[str], labels: list[str], numbers: list[float], cells: list[float]
) -> None:
    base = case_at(CASES / "in-plane")
    offset, station = numbers[1] - numbers[2], numbers[2] / (1.0 + numbers[2])
    joints = dict(zip("ABCD", names, strict=True))
    frame = frame_of(base)
    first, girder, last = (
        replace(m, name=name, ends=(joints[m.ends[0]], joints[m.ends[1]]))
        for m, name in zip(frame.members, names[1:], strict=True)
    )
    frame = Frame(
        "in-plane",
        "euler-bernoulli",
        tuple(replace(joint, name=joints[joint.name]) for joint in frame.joints),
        (replace(first, material=replace(first.material, E=numbers[0])), girder, last),
        masses=(PointMass(Place(joint=names[1]), numbers[1], (offset, 0.0, -offset / 3)),),
        springs=(GroundSpring(Place(member=girder.name, s=station), "x", numbers[2]),),
        joint_springs=(JointSpring(names[2], last.name, {"ry": numbers[3]}),),
        supports=(Support(Place(joint=names[0]), ("x", "z")),),
        factors=(Factor("EI", (f"{girder.name}/2", last.name), numbers[4]),),
    )
    shapes = np.array([numbers[5:7], *np.array(cells).reshape(3, 2)])
    frequencies = np.array(numbers[7:])
    measurement = Measurement(
        replace(base.measurement.sensors, labels=tuple(labels)),
        (3, 1),
        frequencies,
        frequencies / 7.0,
        np.array([np.nan, 1.0 / (1.0 + numbers[0])]),
        shapes,
        np.tile(np.nanmax(np.abs(shapes), axis=0) / 3.0, (4, 1)),
    )
    words = dict(zip(("name", "title", "source"), names, strict=False))
    case = replace(base, model=Model.of(frame), measurement=measurement, modifications=())
    case = replace(case, used=(1,), held_out=(3,), **words)
    with TemporaryDirectory() as folder:
        back = round_trip(Path(folder), case)
    assert_same_frame(frame, frame_of(back))
    # A deviation of what was not measured means nothing.
    std = np.where(np.isnan(shapes), back.measurement.shape_std, measurement.shape_std)
    assert_same_measurement(replace(measurement, shape_std=std), back.measurement)
    assert (back.name, back.title, back.source) == tuple(names[:3])


# --- folders --------------------------------------------------------------------------------------


def test_new_and_empty_folders_are_taken_and_others_left_alone(
    tmp_path: Path, ladder: Case
) -> None:
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "mine.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    for name, what in (("old", "is not empty"), ("file", "is no folder")):
        with pytest.raises(InputError, match=f"{name}: {what}"):
            write_case(tmp_path / name, ladder)
    assert {str(p) for p in content(tmp_path)} == {"file", "old/mine.txt"}
    (tmp_path / "empty").mkdir()
    for name in ("empty", "a/b/c"):
        write_case(tmp_path / name, ladder)
        assert_same_case(ladder, read_case(tmp_path / name))
    mode = (tmp_path / "a" / "b").stat().st_mode
    assert (tmp_path / "a" / "b" / "c").stat().st_mode == mode


def test_a_parent_that_is_read_only(tmp_path: Path, ladder: Case) -> None:
    tmp_path.chmod(0o555)
    user = os.geteuid()
    if user == 0:  # who may write everywhere
        os.seteuid(65534)
    try:
        with pytest.raises(InputError, match=r"cannot be written: Permission denied \(expected"):
            write_case(tmp_path / "new", ladder)
    finally:
        os.seteuid(user)
        tmp_path.chmod(0o700)


def unwritable(ladder: Case, portal: Case, bracket: Case) -> Iterator[tuple[Case, str]]:
    """Yield what no file can say, each with what is said of it."""
    odd = replace(frame_of(bracket).members[1].section, kappa=lambda nu: (0.5, 0.5 + nu))
    said = "model.sections: .*member 'arm': shear coefficients 0.5"
    yield with_frame(bracket, with_sections(bracket, {"arm": odd})), said
    frame, structure = frame_of(ladder), ladder.model.frame_structure
    for quantity, value in (("GJ", -0.5), ("EI", 0.0), ("E", np.nan)):
        one = structure.with_values([Property("odd one", quantity, ("front-left/1",))], [value])
        mass, stiffness = one.matrices()
        model = replace(ladder.model, structure=one, mass=mass, stiffness=stiffness)
        yield replace(ladder, model=model), "model: cannot be written: odd one = "
    tight = Model.of(replace(frame, preloads=(Preload("front-left", 2e4),))).frame_structure
    half = Property("half", "E", tuple(f"back-left/{k}" for k in (1, 2, 3, 4)))
    moved = replace(ladder, model=Model.of(tight.with_values([half], [0.5])))
    yield moved, "no keys of a frame give the matrices"
    model = Model.of(replace(frame_of(portal), joint_springs=()))
    model = replace(model, stiffness=1.1 * model.stiffness)
    between = replace(portal.measurement.sensors, xyz=portal.measurement.sensors.xyz + 0.0)
    between.xyz[1] = [0.0, 0.0, 0.1]
    off = replace(portal.measurement, sensors=between)
    yield replace(portal, measurement=off, modifications=(), model=model), "no node at left@"
    m = ladder.measurement
    std, frequencies = m.shape_std.copy(), m.frequencies.copy()
    std[0, 0], frequencies[0] = np.nan, np.inf
    partly = replace(ladder, measurement=replace(m, shape_std=std))
    yield partly, "the shape std of a measurement does not read back"
    endless = replace(ladder, measurement=replace(m, frequencies=frequencies))
    yield endless, "is not a finite number"
    for name, said in (
        ("joint@1", r"new: model.joints\[0\].name: cannot be written: "),
        ("\ud800", "is not a text"),
    ):
        joints = tuple(replace(j, name=name) if j.name == "J1" else j for j in frame.joints)
        members = tuple(
            replace(m, ends=tuple(name if end == "J1" else end for end in m.ends))
            for m in frame.members
        )
        renamed = replace(frame, joints=joints, members=members, masses=())
        yield replace(with_frame(ladder, renamed), modifications=()), said


def test_what_cannot_be_written_leaves_nothing_behind(
    tmp_path: Path, ladder: Case, portal: Case, bracket: Case
) -> None:
    for case, said in unwritable(ladder, portal, bracket):
        with pytest.raises(InputError, match=said) as caught:
            write_case(tmp_path / "a" / "new", case)
        assert caught.value.file == tmp_path / "a" / "new"
    assert list(tmp_path.iterdir()) == []
