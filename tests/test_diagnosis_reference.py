"""What differs from the structure as it was: diagnosis beside a reference."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femubench import Case, InputError, Measurement, Model, diagnose, read_case
from femubench.core.case.writing import write_case
from femubench.core.challenge.structures import structure_named
from femubench.core.fem.frame import Factor, JointSpring, RigidEnd
from femubench.core.inference.examine import examine
from femubench.fem import Frame

sys.path.insert(0, str(Path(__file__).parent))
from diagnosis_problems import case_of, catalogue, measured

ROOT = Path(__file__).parents[1]
FRAME = structure_named("portal").frame
MODEL = Model.of(FRAME)


def as_built(frame: Frame) -> Frame:
    """Return what no drawing shows: soft joints, rigid corners, and members that scatter."""
    rng = np.random.default_rng(11)
    ends = [(member, joint) for member in frame.members for joint in member.ends]
    springs = tuple(
        JointSpring(joint, member.name, {"ry": 6.0 * 4.0 * _bending(frame, member.name)})
        for member, joint in ends[2:6]
    )
    rigid = tuple(RigidEnd(joint, member.name, 0.01) for member, joint in ends[6:])
    scatter = tuple(
        Factor("E", (member.name,), float(np.exp(0.03 * rng.standard_normal())))
        for member in frame.members
    )
    return replace(
        frame, joint_springs=springs, rigid_ends=rigid, factors=(*frame.factors, *scatter)
    )


def _bending(frame: Frame, name: str) -> float:
    member = frame.members[frame.member_index[name]]
    start, stop = (np.array(frame.joint(joint).xyz) for joint in member.ends)
    return member.material.E * member.section.Iy / float(np.linalg.norm(stop - start))


def case_with(present: Frame, seed: int, reference: Frame | None = None) -> Case:
    """Return the drawn model, what is measured of a frame, and what was of another."""
    rng = np.random.default_rng(seed)
    now, before = (
        measured(Model.of(frame), FRAME, count=8, shapes=6, rng=rng)
        for frame in (present, reference or present)
    )
    case = case_of(MODEL, now, 6)
    return replace(case, reference=before, reference_used=before.numbers[:6]) if reference else case


@pytest.fixture(scope="module")
def damaged() -> tuple[Frame, Frame]:
    """Return the structure as built, and with one element at half its stiffness."""
    built = as_built(FRAME)
    return built, replace(built, factors=(*built.factors, Factor("E", ("floor/2",), 0.5)))


def test_the_difference_is_named_where_the_drawing_is_wrong(damaged: tuple[Frame, Frame]) -> None:
    built, broken = damaged
    found = diagnose(case_with(broken, 1, built))
    assert found.verdict in ("named", "ambiguous")
    best = found.causes[0]
    assert (best.effect, best.place) == ("local-stiffness-loss", "floor/2")
    (parameter,) = best.parameters
    assert parameter.std is not None
    assert abs(parameter.value - 0.5) < 3.0 * parameter.std < 0.15


def test_a_structure_as_it_was_lacks_nothing(damaged: tuple[Frame, Frame]) -> None:
    built, _ = damaged
    verdicts = [diagnose(case_with(built, seed, built)).verdict for seed in range(2, 8)]
    assert verdicts == ["none"] * len(verdicts)


def test_without_the_reference_the_drawing_is_to_blame(damaged: tuple[Frame, Frame]) -> None:
    """Its joints stand between the data and the loss."""
    _, broken = damaged
    found = diagnose(case_with(broken, 1))
    named = {(cause.effect, cause.place) for cause in found.causes}
    assert found.verdict != "named" or named != {("local-stiffness-loss", "floor/2")}


def test_what_is_there_from_the_first_day_is_no_difference(damaged: tuple[Frame, Frame]) -> None:
    built, broken = damaged
    case = case_with(broken, 1, built)
    seen = examine(
        MODEL,
        case.used_measurement(),
        catalogue().values(),
        tolerance=0.005,
        pairs=False,
        reference=case.used_reference,
        width=1.0,
    )
    sought = {p.hypothesis.name for p in seen.problem.space.projections}
    assert {"local-stiffness-loss", "added-mass", "joint-rotation"} <= sought
    assert not {"torsion-constant", "shear-deformation", "rotary-inertia", "joint-offset"} & sought
    assert 0.0 <= seen.like_a_beam <= 1.0


def test_a_reference_on_other_sensors_is_refused(damaged: tuple[Frame, Frame]) -> None:
    built, broken = damaged
    case = case_with(broken, 1, built)
    assert case.reference is not None
    few = _fewer(case.reference)
    with pytest.raises(InputError, match="with other sensors"):
        diagnose(replace(case, reference=few))


def _fewer(measurement: Measurement) -> Measurement:
    sensors = measurement.sensors
    part = type(sensors)(sensors.labels[1:], sensors.xyz[1:], sensors.directions[1:])
    return replace(
        measurement,
        sensors=part,
        shapes=measurement.shapes[1:],
        shape_std=measurement.shape_std[1:],
    )


class TestCaseFolder:
    TABLE = '\n[reference]\nmodes = "modes.csv"\nmass = {value = 2.0, std = 0.01}\n'

    @pytest.fixture
    def folder(self, tmp_path: Path) -> Callable[[str], Path]:
        """Return what makes a case folder with some lines more."""

        def made(more: str) -> Path:
            folder = tmp_path / "case"
            folder.mkdir()
            for path in (ROOT / "tests" / "cases" / "in-plane").iterdir():
                if path.is_file():
                    (folder / path.name).write_bytes(path.read_bytes())
            with (folder / "case.toml").open("a") as stream:
                stream.write(more)
            return folder

        return made

    def test_it_is_read_and_written(self, folder: Callable[[str], Path], tmp_path: Path) -> None:
        settings = "\n[diagnosis]\nmodel_error = 2.0\nbeam_share = 0.3\n"
        case = read_case(folder(self.TABLE + settings))
        assert case.reference is not None
        assert case.reference_used == case.used
        assert case.reference.total_mass == (2.0, 0.01)
        assert (case.model_error, case.beam_share) == (2.0, 0.3)
        assert any(key == "reference" for key, _ in case.rows())
        write_case(tmp_path / "again", case)
        back = read_case(tmp_path / "again")
        assert back.reference is not None
        np.testing.assert_array_equal(back.reference.frequencies, case.reference.frequencies)
        assert back.reference_used == case.reference_used
        assert (back.model_error, back.beam_share) == (2.0, 0.3)

    def test_model_error_is_considered_beside_a_reference(
        self, folder: Callable[[str], Path]
    ) -> None:
        case = read_case(folder(self.TABLE))
        assert case.error_width == 1.0
        assert replace(case, reference=None).error_width == 0.0
        assert replace(case, model_error=0.0).error_width == 0.0

    @pytest.mark.parametrize(
        ("lines", "says"),
        [
            ("[reference]\nused = [1]", "reference.modes"),
            ('[reference]\nmodes = "healthy.csv"', "healthy.csv"),
            ('[reference]\nmodes = "modes.csv"\nused = [77]', "mode 77 has no data in modes.csv"),
            ('[reference]\nmodes = "modes.csv"\nused = [1, 1]', "listed twice"),
            ('[reference]\nmodes = "modes.csv"\nsensor = "a"', "sensor"),
            ("[diagnosis]\nmodel_error = -1.0", "model_error"),
            ("[diagnosis]\nbeam_share = 1.0", "beam_share"),
        ],
    )
    def test_what_is_wrong_is_one_line(
        self, folder: Callable[[str], Path], lines: str, says: str
    ) -> None:
        with pytest.raises(InputError) as fault:
            read_case(folder(f"\n{lines}\n"))
        assert says in str(fault.value)
        assert len(str(fault.value).splitlines()) == 1
