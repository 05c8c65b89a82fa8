"""Groups of scenarios, their classes, and what runs where no case is named."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from printed_boards import assert_same_errors, stored

import femubench
import femubench.scenarios
from femubench import InputError, Scenario, hookimpl
from femubench.core.errors import PluginError
from femubench.core.library.cases import case_folders, read_cases
from femubench.core.library.rank import plan_run
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.plugin.validation import check_scenario
from tests.command import call_bench

ROOT = Path(__file__).parents[1]
QUICK = (
    *("unchanged", "textbook", "baruch", "berman", "global", "local", "bayesian", "physical"),
    "eigensensitivity",
)
LISTED = """\
[portal]
title = "Portal with haunches"
classes = ["planar frame", "tapered members", "clamped"]
default = true

[tower]
title = "Lattice tower"
classes = ["space frame", "on feet"]
default = false

[wing]
title = "Wing box"
classes = ["wing-like"]
default = false
"""
STRUCTURES = {"portal": "in-plane", "tower": "3d", "wing": "out-of-plane"}


@pytest.fixture
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Put three structures where the suite stands, and work in an empty folder."""
    folder = tmp_path / "suite"
    for name, case in STRUCTURES.items():
        shutil.copytree(ROOT / "tests" / "cases" / case, folder / name)
    (folder / "suite.toml").write_text(LISTED)
    monkeypatch.setattr(femubench.scenarios, "SUITE", folder)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return folder


@pytest.fixture
def call() -> Callable[..., Result]:
    return lambda *words: call_bench(*words, code=None)


def names(words: list[str], plugins: Plugins | None = None) -> list[str]:
    return [case.name for case in read_cases(words, load_plugins() if plugins is None else plugins)]


@pytest.mark.usefixtures("suite")
class TestSuite:
    def test_each_structure_is_a_scenario_and_a_case(self) -> None:
        portal = load_plugins().scenarios["suite/portal"]
        assert portal.title == "Portal with haunches"
        assert portal.classes == ("planar frame", "tapered members", "clamped")
        assert (portal.default, load_plugins().scenarios["suite/tower"].default) == (True, False)
        assert femubench.cases["suite/wing"].name == "suite/wing"
        assert names(["suite/tower"]) == ["suite/tower"]

    def test_the_name_of_the_group_is_all_of_it(self) -> None:
        assert names(["suite"]) == ["suite/portal", "suite/tower", "suite/wing"]
        assert names(["suite/wing", "suite"]) == ["suite/wing", "suite/portal", "suite/tower"]
        run = femubench.rank("suite", "unchanged", nominal="textbook")
        assert [(r.case, r.status) for r in run.results] == [
            (f"suite/{name}", "ok") for name in STRUCTURES
        ]

    def test_a_class_of_the_group_is_part_of_it(self) -> None:
        assert names(["suite:wing-like"]) == ["suite/wing"]
        assert names(["suite:planar frame", "suite/tower"]) == ["suite/portal", "suite/tower"]
        with pytest.raises(InputError, match="did you mean 'suite:planar frame'"):
            names(["suite:planer frame"])
        with pytest.raises(InputError, match="no case 'nothing'") as fault:
            names(["nothing"])
        assert "planar" not in str(fault.value)

    def test_without_a_case_the_default_set_runs(self) -> None:
        plugins = load_plugins()
        default = [name for name, scenario in plugins.scenarios.items() if scenario.default]
        assert {"frame", "hframe", "suite/portal"} <= set(default)
        assert not {"suite/tower", "suite/wing", "footbridge"} & set(default)
        plan = plan_run((), ["unchanged"], plugins, {})
        assert plan.request["cases"] == default
        assert [case.name for case in plan.cases] == names(default)

    def test_a_run_of_the_group_can_be_continued(self, call: Callable[..., Result]) -> None:
        assert call("run", "suite", "-s", "unchanged", "-q").exit_code == 0
        again = call("run", "--resume")
        assert again.exit_code == 0
        assert "3 cases from both nominal models, 1 strategy" in " ".join(again.stdout.split())

    @pytest.mark.parametrize(
        ("word", "says"),
        [
            ("suite/portl", "no case 'suite/portl'; did you mean 'suite/portal'"),
            ("siute", "did you mean 'suite'"),
            ("nothing/portal", "folder does not exist"),
        ],
    )
    def test_a_wrong_name_is_one_line(
        self, call: Callable[..., Result], word: str, says: str
    ) -> None:
        wrong = call("scenarios", "show", word)
        assert wrong.exit_code == 2
        assert says in wrong.stderr
        assert len(wrong.stderr.splitlines()) == 1


def test_without_a_list_there_is_no_suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(femubench.scenarios, "SUITE", tmp_path)
    plugins = load_plugins()
    assert plugins.broken == ()
    assert not [name for name in plugins.scenarios if name.startswith("suite/")]
    with pytest.raises(InputError, match="no case 'suite'"):
        case_folders(["suite"], plugins.scenarios)


class TestOutsiders:
    def offering(self, *scenarios: Scenario) -> Plugins:
        class Plugin:
            @hookimpl
            def femubench_scenarios(self) -> list[Scenario]:
                return list(scenarios)

        return load_plugins([], {"plugin": Plugin()})

    def test_a_scenario_of_three_arguments_runs_by_default(self) -> None:
        folder = ROOT / "scenarios" / "frame"
        plugins = self.offering(Scenario("mine", "Mine", {"mine": folder}))
        assert names([], plugins) == ["mine"]

    def test_folders_can_be_made_when_asked_for(self, tmp_path: Path) -> None:
        made = []

        def case() -> Path:
            made.append("mine/a")
            return Path(shutil.copytree(ROOT / "tests" / "cases" / "3d", tmp_path / "made"))

        plugins = self.offering(
            Scenario("mine", "Mine", {"mine/a": case}, default=False),
            Scenario("other", "Other", {"other": ROOT / "scenarios" / "frame"}),
        )
        assert names([], plugins) == ["other"]
        assert made == []
        assert names(["mine"], plugins) == ["mine/a"]
        assert made == ["mine/a"]

    def test_what_cannot_be_made_is_one_line_that_names_the_scenario(self) -> None:
        def case() -> Path:
            raise ValueError("nothing\nhere")

        plugins = self.offering(Scenario("mine", "Mine", {"mine": case}))
        with pytest.raises(
            PluginError, match=r"scenario 'mine': .*ValueError: nothing here"
        ) as fault:
            case_folders(["mine"], plugins.scenarios)
        assert len(str(fault.value).splitlines()) == 1

    def test_names_and_classes_are_checked(self, tmp_path: Path) -> None:
        check_scenario(Scenario("group/mine", "t", {"group/mine": tmp_path}))
        check_scenario(Scenario("group/mine", "t", {"group/mine/part": tmp_path}))
        for name, case in (("a/b/c", "a/b/c"), ("/a", "/a"), ("a/", "a/"), ("a/b", "a/c")):
            with pytest.raises(PluginError, match=r"is not one word|is neither"):
                check_scenario(Scenario(name, "t", {case: tmp_path}))
        for classes in ("planar frame", ("",), (1,)):
            with pytest.raises(PluginError, match="classes is no tuple of words"):
                check_scenario(Scenario("s", "t", {"s": tmp_path}, classes))  # type: ignore[arg-type]

    def test_the_first_keeps_the_name_of_a_case(self) -> None:
        first, second = ROOT / "scenarios" / "frame", ROOT / "scenarios" / "hframe"
        plugins = self.offering(
            Scenario("group/a", "A", {"group/a": first}),
            Scenario("group", "B", {"group/a": second, "group/b": second}),
        )
        assert case_folders(["group/a"], plugins.scenarios) == [("group/a", first)]


@pytest.mark.slow(30)
def test_the_run_kept_is_what_runs_today() -> None:
    """On the structures of the papers; all cases in test_documented_figures."""
    assert_same_errors(stored("default"), femubench.rank(["frame", "hframe"], list(QUICK), jobs=2))
