"""Case folders written by hand come out as what they say."""

import shutil
import tomllib
import typing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from pydantic import BaseModel

from femubench import Case, read_case, solve_modes
from femubench.core.case.faults import key_lines, line_of
from femubench.core.case.schema import CaseSpec
from femubench.core.fem.frame import Frame, GroundSpring, JointSpring, Place, PointMass, RigidEnd
from femubench.core.fem.sections import Section
from femubench.modal import real_modes

CASES = Path(__file__).parent / "cases"
DOCS = Path(__file__).parent.parent / "docs"


def frame_of(case: Case) -> Frame:
    return case.model.frame_structure.frame


def test_in_plane_frame() -> None:
    frame = frame_of(read_case(CASES / "in-plane"))
    assert (frame.plane, frame.beam, frame.rotary_share) == ("in-plane", "timoshenko", 0.0)
    assert [joint.type for joint in frame.joints] == ["foot", "corner", "corner", "foot"]
    assert frame.joint("C").xyz == (1.5, 0.0, 1.2)
    left, girder, right = frame.members
    assert (girder.ends, girder.elements) == (("B", "C"), 6)
    assert right.ends == ("D", "C")
    post = left.section
    assert (post.A, post.Iy, post.Iz, post.J, post.Jp) == (3.5e-4, 8.2e-8, 0.0, 0.0, 0.0)
    assert post.width is None
    assert post.kappa is not None
    assert post.kappa(0.3) == (0.44, 0.44)
    assert girder.section.Iy == Section.rectangular_tube(0.04, 0.06, 0.003).Iy
    assert girder.section.height == 0.06
    np.testing.assert_allclose(left.material.G, 210e9 / 2.6)
    assert frame.masses == (
        PointMass(Place(joint="B"), 0.2),
        PointMass(Place(member="girder", s=0.3), 0.05, (0.0, 0.0, 0.035)),
    )
    assert frame.springs == (GroundSpring(Place(member="right", s=0.5), "-x", 2e4),)
    assert [(s.at.joint, s.fixed) for s in frame.supports] == [
        ("A", ("x", "z", "ry")),
        ("D", ("x", "z")),
    ]
    assert frame.joint_springs == (JointSpring("C", "right", {"ry": 3e5, "x": 4e8}, 0.02, 5.0),)
    assert frame.rigid_ends == (RigidEnd("B", "girder", -0.01, 0.02),)


def test_measurement_with_gaps_and_complex_shapes() -> None:
    case = read_case(CASES / "in-plane")
    m = case.measurement
    assert (case.used, case.held_out, case.band) == ((1, 2), (4,), (5.0, 400.0))
    assert m.numbers == (1, 2, 4, 7)
    assert m.total_mass == (14.1, 0.05)
    assert m.sensors.labels == ("left_top", "left_mid", "girder", "turn")
    assert m.sensors.directions == ("x", "-x", "z", "ry")
    np.testing.assert_array_equal(m.sensors.xyz[2], [0.75, 0.0, 1.1])
    np.testing.assert_allclose(m.frequencies, [21.5, 80.0, 240.0, 333.0])
    np.testing.assert_allclose(m.frequency_std, [0.05, 0.4, 1.2, 1.5])
    np.testing.assert_array_equal(m.damping, [0.004, np.nan, 0.01, np.nan])
    np.testing.assert_array_equal(m.shapes[:, 1], [0.1, np.nan, -2.0, 0.5])
    assert np.isnan(m.shapes[:, 2]).all()
    np.testing.assert_allclose(m.shapes[:, 3], [5.0, -np.hypot(0.5, 0.1), 0.0, -0.2])
    np.testing.assert_allclose(m.shape_std[:, 0], [0.1, 0.1, 0.001, 0.1])
    np.testing.assert_allclose(m.shape_std[:, 1], 0.1)
    assert np.isnan(m.shape_std[:, 2]).all()
    np.testing.assert_allclose(m.shape_std[:, 3], 0.1)


def test_modification() -> None:
    (change,) = read_case(CASES / "in-plane").modifications
    assert change.name == "half a kilogram at C"
    assert change.masses == (PointMass(Place(joint="C"), 0.5),)
    assert change.springs == (GroundSpring(Place(member="girder", s=0.5), "z", 5e4),)
    np.testing.assert_allclose(change.measurement.frequencies, [20.0, 70.5])
    assert change.measurement.shapes[2, 1] == 1.0
    assert np.isnan(change.measurement.shapes).sum() == 7


def test_frame_in_space() -> None:
    case = read_case(CASES / "3d", "mine")
    frame = frame_of(case)
    assert case.name == "mine"
    assert frame.members[0].up == (0.0, 1.0, 0.0)
    assert frame.members[1].up is None
    assert frame.members[1].section.Jp == 5.5e-8
    assert frame.rotary_share == 1.0
    assert case.model.size == 6 * 10
    assert case.measurement.sensors.directions == ("x", "y", "-rz")
    assert (solve_modes(case.model, 3).natural_frequencies > 0.0).all()


def test_digest_follows_every_file(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    first = read_case(folder).digest
    assert first == read_case(CASES / "in-plane").digest
    for name in ("case.toml", "sensors.csv", "modes.csv", "modified.csv"):
        text = (folder / name).read_text()
        (folder / name).write_text(text + "\n")
        assert read_case(folder).digest != first
        (folder / name).write_text(text)
    (folder / "notes.txt").write_text("not part of the case")
    assert read_case(folder).digest == first


def test_spreadsheet_dialects(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    plain = read_case(folder).measurement
    text = (folder / "modes.csv").read_text().replace(",", " , ").replace("girder", '"girder"', 1)
    (folder / "modes.csv").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    other = read_case(folder).measurement
    np.testing.assert_array_equal(other.shapes, plain.shapes)
    np.testing.assert_array_equal(other.shape_std, plain.shape_std)


def test_real_modes_follow_the_paper() -> None:
    shapes = np.array([[3 + 4j, 1j], [-3 + 4j, -2j], [np.nan, 0.5], [2.0, 0.0]])
    expected = [[5.0, 1.0], [-5.0, 2.0], [np.nan, 0.5], [2.0, 0.0]]
    np.testing.assert_allclose(real_modes(shapes), expected)


def test_what_is_lost_by_turning_a_shape_real_is_said(tmp_path: Path) -> None:
    """It is the lesser axis of the ellipse of its components."""
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    case, path = read_case(folder), folder / "modes.csv"
    parts = np.array([[3.0, 4.0], [-0.5, -0.1], [0.0, 0.0], [-0.2, 0.0]])
    values = np.linalg.svd(parts, compute_uv=False)
    assert case.measurement.out_of_phase is not None
    assert case.measurement.out_of_phase[-1] == pytest.approx(values[1] / np.linalg.norm(parts))
    assert case.measurement.select([1]).out_of_phase == pytest.approx(0.0, abs=1e-15)
    assert not any("out of phase" in note for note in case.notes)
    path.write_text(path.read_text().replace("-0.5-0.1i", "-2+3i"))
    case = read_case(folder)
    share = f"{100.0 * case.measurement.out_of_phase[-1]:.0f} % of mode 7"
    assert [note for note in case.notes if "phase" in note] == [
        f"modes.csv: shapes were turned real, and what was out of phase in them is lost: {share}."
    ]
    assert dict(case.measurement.rows())["mode 7"].endswith("% out of phase")


@settings(max_examples=20)
@given(st.floats(-3.1, 3.1), st.integers(0, 2**32 - 1))
def test_aligned_modes_do_not_depend_on_the_phase(phase: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = rng.uniform(0.5, 2.0, (6, 1)) * rng.choice([-1.0, 1.0], (6, 1))
    scattered = shape * np.exp(1j * rng.uniform(-0.1, 0.1, (6, 1)))
    turned = real_modes(scattered * np.exp(1j * phase), align_phase=True)
    np.testing.assert_allclose(turned / np.sign(turned[0] * shape[0]), shape, rtol=1e-12)


def tables(table: type[BaseModel]) -> dict[str, typing.Any]:
    """Return every key below a table of the schema with its field."""
    found = dict(table.model_fields)
    pending = [field.annotation for field in table.model_fields.values()]
    while pending:
        annotation = pending.pop()
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            found |= tables(annotation)
        pending.extend(typing.get_args(annotation))
    return found


def test_every_key_is_documented() -> None:
    text = (DOCS / "case-format.md").read_text()
    keys = tables(CaseSpec)
    assert {"rotary_inertia", "stiffness_length", "band", "groups", "kappa"} <= set(keys)
    assert [key for key in keys if f"`{key}`" not in text] == []
    assert [key for key, field in keys.items() if not field.description] == []


def test_examples_of_the_documentation_are_valid_toml() -> None:
    blocks = (DOCS / "case-format.md").read_text().split("```toml")[1:]
    assert blocks
    for block in blocks:
        tomllib.loads(block.split("```")[0])


def test_lines_of_nested_lists_of_tables() -> None:
    text = "[[a]]\n[[a.b]]\nc = 1\n[[a.b]]\nc = 2\n[[a]]\n[a.d]\n'e f' = [\n1, {g = 2}]\n"
    lines = key_lines(text)
    assert lines["a", 0, "b", 1, "c"] == 5
    assert lines["a", 1] == 6
    assert lines["a", 1, "d", "e f", 1, "g"] == 9
    assert line_of(lines, ("a", 0, "b", 0, "missing")) == 2
    assert line_of(lines, ("z",)) is None
