"""The verb `diagnose`: what it asks of the search, prints, writes and returns."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import diagnosis_toys as toys
import pytest
from click.testing import Result
from distributions import install_module

from femubench import Diagnosis, InputError, NotApplicable, solve_modes
from femubench.core.case.case import TOLERANCE, Case
from femubench.core.case.example import write_example
from femubench.core.case.reader import read_case
from femubench.core.diagnosis.serial import diagnosis_from_json
from femubench.core.inference.effort import Effort
from femubench.core.library import diagnose as library
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.core.score.scoring import score_model
from femubench.reports.diagnosis import diagnosis_text
from tests.command import call_bench

Invoke = Callable[..., Result]
OnAdvance = tuple[Result, dict[str, Any], Path]

EFFECTS = """
from femubench import hookimpl

class Rust:
    name = "test-rust"
    def places(self, model):
        return []
    def parameters(self, model, place):
        return []
    def extend(self, model, place, values):
        return model

class Moss(Rust):
    name = "test-moss"

@hookimpl
def femubench_effects():
    return [Rust, Moss]
"""


class Search:
    """Stands for the search: notes how it was called, gives what it is stated to."""

    def __init__(self) -> None:
        self.found: Diagnosis | Exception = toys.made()
        self.calls: list[tuple[Case, list[str], bool]] = []
        self.budgets: list[float | None] = []
        self.faults: list[object] = []
        self.written: list[tuple[Path, Case, object, list[str], str]] = []
        self.fault: Exception | None = None

    def diagnose(
        self, case: Case, *, effects: Any, faults: object, pairs: bool, effort: Effort
    ) -> Diagnosis:
        self.budgets.append(effort.budget)
        self.faults.append(faults)
        self.calls.append((case, [effect.name for effect in effects], pairs))
        if isinstance(self.found, Exception):
            raise self.found
        return replace(self.found, subject=case)

    def write_case(
        self, folder: Path, case: Case, model: object, *, comment: list[str], name: str
    ) -> None:
        if self.fault is not None:
            raise self.fault
        self.written.append((folder, case, model, comment, name))
        folder.mkdir(exist_ok=True)
        (folder / "case.toml").write_text("x = 1\n")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Install a plugin with two effects."""
    folder = tmp_path_factory.mktemp("site")
    name = "femubench_diagnose_tests"
    install_module(folder, name, EFFECTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield folder
    sys.modules.pop(name, None)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> Search:
    """Put a stand-in where the search and the writer of cases are imported from."""
    stand_in = Search()
    monkeypatch.setattr(library, "search", stand_in.diagnose)
    monkeypatch.setattr("femubench.core.case.writing.write_case", stand_in.write_case)
    return stand_in


@pytest.fixture
def invoke(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Invoke:
    """Call `bench diagnose` in this process, in a folder with one case."""
    monkeypatch.chdir(tmp_path)
    write_example(tmp_path / "case")
    return lambda *words: call_bench("diagnose", *words, code=None)


def screen(found: Diagnosis, written: Path | None = None) -> str:
    from femubench.core.diagnosis.serial import diagnosis_to_json

    return diagnosis_text(diagnosis_to_json(found, written=written)) + "\nNext: bench run case\n"


class TestAsking:
    def test_everything_by_default(self, invoke: Invoke, search: Search) -> None:
        assert invoke("case").exit_code == 0
        ((case, effects, pairs),) = search.calls
        assert (case.folder, case.tolerance, pairs) == (Path("case"), TOLERANCE, True)
        assert effects == list(load_plugins(third_parties=False).effects)

    def test_effects_of_a_plugin_that_is_named_come_too(
        self, invoke: Invoke, search: Search
    ) -> None:
        assert invoke("case", "--plugin", "femubench_diagnose_tests").exit_code == 0
        ((_, effects, _),) = search.calls
        assert effects == [*load_plugins(third_parties=False).effects, "test-rust", "test-moss"]
        words = ("--effects", "density", "--plugin", "femubench_diagnose_tests")
        assert invoke("case", *words).exit_code == 0
        assert search.calls[1][1] == ["density", "test-rust", "test-moss"]
        result = invoke("case", "--plugin", "femubench_diagnose_test")
        assert (result.exit_code, "did you mean" in result.stderr) == (2, True)

    def test_options_reach_the_search(self, invoke: Invoke, search: Search) -> None:
        words = ("--effects", "test-moss, test-rust,test-moss", "--no-pairs", "--tolerance", "0.02")
        assert invoke("case", *words).exit_code == 0
        ((case, effects, pairs),) = search.calls
        assert (case.tolerance, effects, pairs) == (0.02, ["test-moss", "test-rust"], False)
        assert invoke("case", "--budget", "0.5").exit_code == 0
        assert search.budgets == [None, 0.5]
        assert invoke("case", "--no-faults").exit_code == 0
        assert search.faults == [None, None, ()]


class TestWrongInput:
    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (["cas"], "no case 'cas'"),
            (["design-change"], "'design-change' stands for"),
            (["case", "--effects", "test-mos"], "no effect 'test-mos'; did you mean 'test-moss'"),
            (["case", "--effects", ""], "no effect ''"),
            (["case", "--tolerance", "0.3"], "tolerance = 0.3 (expected a number >= 0 and <= 0.2)"),
            (["case", "--tolerance", "nan"], "tolerance = nan (expected a number >= 0 and <= 0.2)"),
            (["case", "--budget=-1"], "budget = -1.0 (expected seconds >= 0)"),
            (
                ["case", "--output", "case"],
                "case: is not empty (expected a new or an empty folder)",
            ),
            (["case", "--output", "case/case.toml"], "is a file"),
            (["case", "--output", "case/case.toml/x"], "case/case.toml: cannot be written to"),
        ],
    )
    def test_is_one_line_and_asks_nothing(
        self, invoke: Invoke, search: Search, tmp_path: Path, words: list[str], expected: str
    ) -> None:
        before = sorted(tmp_path.rglob("*"))
        result = invoke(*words)
        assert (result.exit_code, result.stdout, search.calls) == (2, "", [])
        (line,) = result.stderr.splitlines()
        assert expected in line
        assert sorted(tmp_path.rglob("*")) == before

    def test_case_that_cannot_be_diagnosed(self, invoke: Invoke, search: Search) -> None:
        search.found = NotApplicable("no measured mode\nhas a partner")
        result = invoke("case", "--json", "x.json", "--output", "out")
        assert (result.exit_code, result.stdout) == (2, "")
        expected = "bench: case: cannot be diagnosed: no measured mode has a partner\n"
        assert result.stderr == expected
        assert not Path("x.json").exists()
        assert not Path("out").exists()

    @pytest.mark.parametrize(
        ("text", "key"),
        [
            ("tolerance = 0.21", "diagnosis.tolerance"),
            ("tolerance = nan", "diagnosis.tolerance"),
            ("tolerence = 0.1", "diagnosis.tolerence"),
        ],
    )
    def test_tolerance_in_the_case(self, tmp_path: Path, text: str, key: str) -> None:
        write_example(tmp_path / "case")
        file = tmp_path / "case" / "case.toml"
        file.write_text(f"{file.read_text()}\n[diagnosis]\n{text}\n")
        with pytest.raises(InputError) as caught:
            read_case(tmp_path / "case")
        assert caught.value.key == key
        assert caught.value.line == len(file.read_text().splitlines())


class TestTelling:
    def test_text(self, invoke: Invoke, search: Search) -> None:
        result = invoke("case")
        assert (result.exit_code, result.stderr) == (0, "")
        assert result.stdout == screen(toys.made())

    def test_json_file(self, invoke: Invoke, search: Search) -> None:
        result = invoke("case", "--json", "found.json")
        assert result.stdout == screen(toys.made())
        data = json.loads(Path("found.json").read_text(), parse_constant=pytest.fail)
        assert diagnosis_from_json(data) == data
        assert data["verdict"] == "named"

    def test_json_on_the_screen_is_alone_there(self, invoke: Invoke, search: Search) -> None:
        for words in ((), ("--quiet",)):
            result = invoke("case", "--json", "-", *words)
            data = json.loads(result.stdout, parse_constant=pytest.fail)
            assert data["case"] == "toy"
        assert not Path("-").exists()


class TestExtending:
    @pytest.mark.parametrize("verdict", ["named", "not-confirmed"])
    def test_writes_the_extended_case(self, invoke: Invoke, search: Search, verdict: Any) -> None:
        search.found = toys.made(verdict)
        result = invoke("case", "-o", "new/out", "--json", "found.json", "--tolerance", "0.01")
        assert (result.exit_code, result.stderr) == (0, "")
        ((folder, case, model, comment, name),) = search.written
        assert name == f"{case.name}-extended"
        assert (folder, case.folder, case.tolerance) == (Path("new/out"), Path("case"), 0.01)
        assert model is search.found.extended
        assert comment[0] == search.found.sentence
        assert "bending 31000 ± 1200 N m/rad" in comment[1]
        assert result.stdout == screen(search.found, Path("new/out"))
        assert json.loads(Path("found.json").read_text())["written"] == "new/out"

    def test_writes_nothing_without_a_cause(self, invoke: Invoke, search: Search) -> None:
        search.found = toys.made("unknown")
        result = invoke("case", "--output", "out", "--json", "found.json")
        assert result.exit_code == 0
        assert result.stderr == "bench: the verdict is 'unknown': nothing was written to out\n"
        assert search.written == []
        assert not Path("out").exists()
        assert json.loads(Path("found.json").read_text())["written"] is None

    @pytest.mark.parametrize(
        ("fault", "code"), [(InputError("a name that TOML lacks"), 2), (OSError("disk full"), 1)]
    )
    def test_diagnosis_outlives_a_failed_write(
        self, invoke: Invoke, search: Search, fault: Exception, code: int
    ) -> None:
        search.fault = fault
        result = invoke("case", "--output", "out", "--json", "found.json")
        assert result.exit_code == code
        assert result.stdout == screen(toys.made())
        assert result.stderr == f"bench: {fault}\n"
        assert json.loads(Path("found.json").read_text())["written"] is None


@pytest.fixture(scope="module")
def stated(tmp_path_factory: pytest.TempPathFactory) -> OnAdvance:
    folder = tmp_path_factory.mktemp("frame")
    words = ["frame", "--json", folder / "found.json", "--output", folder / "out"]
    result = call_bench("diagnose", *words)
    data = json.loads((folder / "found.json").read_text(), parse_constant=pytest.fail)
    return result, data, folder / "out"


class TestBuiltInCases:
    """The real search on measured structures, from the command line to the extended case."""

    @pytest.mark.slow(10)
    def test_screen_and_json_agree(self, stated: OnAdvance) -> None:
        result, data, _ = stated
        assert data["case"] == "frame"
        assert diagnosis_from_json(data) == data
        assert result.stdout == f"{diagnosis_text(data)}\n"
        lines = diagnosis_text({**data, "written": None}).splitlines()
        assert max(map(len, lines)) <= 80
        assert "".join(data["sentence"].split()) in "".join(result.stdout.split())

    def test_finds_what_these_models_are_known_to_lack(self, stated: OnAdvance) -> None:
        """The nominal ladder is of Euler-Bernoulli beams, with J = Jp for a tube."""
        _, data, _ = stated
        found = {cause["effect"] for cause in data["causes"]}
        assert "shear-deformation" in found
        assert data["nothing"] < 0.01
        assert data["chi2"][1] < 0.25 * data["chi2"][0]
        before, after = data["gain"]["held_out_percent"]
        assert after < 0.5 * before
        looked = {look["effect"] for look in data["looks"]}
        assert "torsion-constant" in looked & found

    def test_residuals_are_those_of_the_nominal_model(self, stated: OnAdvance) -> None:
        """By hand: the frequencies of the model as drawn, mode by mode in their order."""
        _, data, _ = stated
        (case,) = read_cases(["frame"], load_plugins())
        modes = solve_modes(case.model)
        predicted = modes.natural_frequencies[~modes.rigid]
        measured = case.measurement.select(case.used)
        rows = [row for row in data["residuals"] if row["kind"] == "frequency"]
        for k, row in enumerate(rows):
            sigma = (measured.frequencies[k] - predicted[k]) / measured.frequency_std[k]
            assert row["measured"] == measured.frequencies[k]
            assert row["before"] == pytest.approx(sigma, abs=0.5)

    def test_extended_case_is_what_was_found(self, stated: OnAdvance) -> None:
        """The folder read again predicts the held-out modes as the diagnosis says."""
        _, data, out = stated
        assert data["written"] == str(out)
        case = read_case(out)
        assert data["sentence"] in " ".join(
            (out / "case.toml").read_text().replace("#", " ").split()
        )
        gain = data["provisional"] or data["gain_rms"]
        error = score_model(case, case.model)["higher"].rms_percent
        assert error == pytest.approx(gain["held_out_percent"][1], rel=1e-6)
