"""The keys of case.toml that set a structure apart from its plain beams, and what is refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from femubench import InputError
from femubench.core.case.reader import read_case
from femubench.fem import Brace, Coupling, Eccentricity, Factor, Oscillator, Place, Preload

CASES = Path(__file__).parent / "cases"
LINES = """
[[model.factors]]
quantity = "E"
at = ["post/1", "post/2:first", "post"]
factor = 0.7
[[model.factors]]
quantity = "shear"
at = "all"
factor = 0
[[model.eccentricities]]
member = "post"
y = 0.004
[[model.couplings]]
member = "post"
coefficient = 0.1
[[model.braces]]
ends = ["foot", "knee"]
stiffness = 1.0e5
[[model.oscillators]]
at = "post@0.3"
direction = "-z"
mass = 0.05
frequency = 300.0
[[model.preloads]]
member = "post"
force = -12.0
"""


def case_with(folder: Path, text: str, case: str = "3d") -> Path:
    """Write a case of the tests with further lines in it."""
    shutil.copytree(CASES / case, folder)
    (folder / "case.toml").write_text((CASES / case / "case.toml").read_text() + text)
    return folder


RING = """
[[model.joints]]
name = "ring"
xyz = [0.31, 0.17, -0.42]
[[model.members]]
name = "ring-1"
ends = ["foot", "ring"]
section = "flat"
material = "steel"
[[model.members]]
name = "ring-2"
ends = ["ring", "knee"]
section = "flat"
material = "steel"
"""


class TestReading:
    def test_every_key_arrives(self, tmp_path: Path) -> None:
        path = case_with(tmp_path / "case", RING + LINES)
        changed = (path / "case.toml").read_text()
        changed = changed.replace('plane = "3d"', 'plane = "3d"\nrotary_inertia = 1.4')
        (path / "case.toml").write_text(changed)
        frame = read_case(path).model.frame_structure.frame
        assert frame.rotary_inertia == 1.4
        assert frame.factors == (
            Factor("E", ("post/1", "post/2:first", "post"), 0.7),
            Factor("shear", ("all",), 0.0),
        )
        assert frame.eccentricities == (Eccentricity("post", 0.004, 0.0),)
        assert frame.couplings == (Coupling("post", 0.1),)
        assert frame.braces == (Brace(("foot", "knee"), 1e5),)
        assert frame.oscillators == (Oscillator(Place(member="post", s=0.3), "-z", 0.05, 300.0),)
        assert frame.preloads == (Preload("post", -12.0),)

    @pytest.mark.parametrize(
        ("old", "new", "key", "what", "expected"),
        [
            ('"E"', '"G"', "factors[0].quantity", "'G'", "EA, EI"),
            ('/1"', '/99"', "factors[0].at", "element '99'", "1 to"),
            ('/2:first"', '/99:first"', "factors[0].at", "element '99'", "1 to"),
            ('/2:first"', '/2:last"', "factors[0].at", "element '2:last'", "1 to"),
            ('"all"', '"everything"', "factors[1].at", "no member 'everything'", "member/k"),
            ('"all"', "3", "factors[1].at", "places", "member/k"),
            ("factor = 0.7", "factor = 0.0", "factors[0].factor", "leaves no E", "> 0"),
            ("0.1\n", "1.0\n", "couplings[0].coefficient", "1.0", "< 1"),
            ('ends = ["foot"', 'ends = ["Q"', "braces[0].ends[0]", "no joint 'Q'", "joint"),
            ('"knee"]', '"foot"]', "braces[0].ends", "zero", "different"),
            ("@0.3", "@1.3", "oscillators[0].at", "0..1", "0.25"),
            ('"-z"', '"rz"', "oscillators[0].direction", "rotation", "translation"),
            ("300.0", "300.0\ncrosswise = 1", "oscillators[0].crosswise", "1", "true or false"),
            ("-12.0", "inf", "preloads[0].force", "inf", "N"),
            ("y = 0.004", "x = 0.004", "eccentricities[0].x", "unknown", "y"),
            ('"post"\ny', '"Q"\ny', "eccentricities[0].member", "no member 'Q'", "member"),
            ('"post"\nc', '"Q"\nc', "couplings[0].member", "no member 'Q'", "member"),
            ('"post"\nf', '"Q"\nf', "preloads[0].member", "no member 'Q'", "member"),
        ],
    )
    def test_what_is_wrong_is_one_line(
        self, tmp_path: Path, old: str, new: str, key: str, what: str, expected: str
    ) -> None:
        text = LINES.replace(old, new, 1)
        assert text != LINES
        path = case_with(tmp_path / "case", text)
        with pytest.raises(InputError) as caught:
            read_case(path)
        error = caught.value
        assert "\n" not in str(error)
        assert error.key == f"model.{key}"
        assert what in str(error).split("expected")[0]
        assert error.expected is not None
        assert expected in error.expected
        assert error.line is not None

    @pytest.mark.parametrize(
        ("case", "text", "key"),
        [
            ("out-of-plane", '[[model.braces]]\nends = ["A", "C"]\nstiffness = 1.0', "braces[0]"),
            ("in-plane", '[[model.braces]]\nends = ["A", "C"]\nstiffness = 1.0\ndirection = "y"',
             "braces[0].direction"),
            ("out-of-plane", '[[model.eccentricities]]\nmember = "long"\nz = 0.1',
             "eccentricities[0].z"),
            ("in-plane", '[[model.eccentricities]]\nmember = "left"\ny = 0.1',
             "eccentricities[0].y"),
            ("in-plane", '[[model.couplings]]\nmember = "left"\ncoefficient = 0.1', "couplings[0]"),
            ("out-of-plane", '[[model.oscillators]]\nat = "A"\ndirection = "x"\nmass = 1.0\n'
             "frequency = 1.0", "oscillators[0].direction"),
            ("out-of-plane", '[[model.preloads]]\nmember = "long"\nforce = 1.0', "preloads[0]"),
        ],
    )  # fmt: skip
    def test_what_the_plane_does_not_have_is_refused(
        self, tmp_path: Path, case: str, text: str, key: str
    ) -> None:
        with pytest.raises(InputError) as caught:
            read_case(case_with(tmp_path / "case", f"\n{text}\n", case))
        assert caught.value.key == f"model.{key}"

    @pytest.mark.parametrize(
        ("case", "line", "what"),
        [
            ("out-of-plane", "gravity = 1.0", "out of plane"),
            ("out-of-plane", "gravity = -1.0", "-1"),
            *(("3d", f"rotary_inertia = {v}", "rotary inertia") for v in ("-0.5", "'yes'", "nan")),
        ],
    )
    def test_a_number_that_cannot_be(self, tmp_path: Path, case: str, line: str, what: str) -> None:
        path = case_with(tmp_path / "case", "", case)
        text, plane = (path / "case.toml").read_text(), f'plane = "{case}"'
        (path / "case.toml").write_text(text.replace(plane, f"{plane}\n{line}"))
        with pytest.raises(InputError, match=what) as caught:
            read_case(path)
        assert caught.value.key == f"model.{line.split()[0]}"
        assert caught.value.expected is not None
