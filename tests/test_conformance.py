"""The conformance kit: good plugins pass, and every bad one fails the check that it should."""

from __future__ import annotations

import json
import os
import random
import re
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import conformance_toys as toys
import numpy as np
import pytest

from femubench import Scenario, Strategy
from femubench.core.child import sandbox
from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import MIB
from femubench.core.conformance import kit
from femubench.core.conformance.checking import Subject, checks_of, findings, subjects
from femubench.core.conformance.effect_checks import has_place
from femubench.core.conformance.kit import Bench, Role
from femubench.core.conformance.problems import problem
from femubench.core.errors import InputError
from femubench.core.plugin.loader import load_plugins
from tests.command import call_bench, run_python

ROOT = Path(__file__).parents[1]
# Strategies that end or block their process, and what is said of them.
SAYS = {
    toys.Looping: "no result within 3 s",
    toys.Exiting: "exit code 0",
    toys.Hog: "memory|Unable to allocate",
}
HARMLESS = [toy for toy in toys.FAULTS if toy not in SAYS]
BUILT_IN = load_plugins()
FEW = ("baruch",)  # all others in `make nightly`
SLOW = ("spring", "offset", "bayesian", "bayesian-sampling", "diagnosed")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Trials run in this process, which is quicker and does for strategies that do no harm."""

    def run_here(
        tasks: Mapping[Any, tuple[Callable[[Any], bytes], object]], limits: object, count: int
    ) -> dict[Any, Ending]:
        found = {}
        for key, (function, argument) in tasks.items():
            with np.errstate():
                found[key] = Ending("answer", function(argument))
        return found

    monkeypatch.setattr(kit, "run_apart", run_here)
    numbers, own = np.random.get_state(), random.getstate()  # noqa: NPY002
    yield
    np.random.set_state(numbers)  # noqa: NPY002
    random.setstate(own)


def verdicts(role: Role, item: object, **options: Any) -> dict[str, kit.Verdict]:
    subject = Subject(role, "toy", Bench(item, **options))
    return {finding.check.name: finding.verdict for finding in findings(subject)}


def bad(found: Mapping[str, kit.Verdict]) -> dict[str, str]:
    return {name: v.message for name, v in found.items() if v.status in ("fail", "warn")}


@pytest.mark.usefixtures("here")
def test_a_good_strategy_passes_every_check() -> None:
    found = verdicts("strategy", toys.Good())
    assert bad(found) == {}
    passed = {name for name, v in found.items() if v.status == "pass"}
    assert set(found) - passed == {"options-documented", "promises", "cases"}
    assert found["promises"].message == "nothing promised"


@pytest.mark.usefixtures("here")
def test_to_say_by_how_much_a_used_mode_is_off_keeps_the_promise() -> None:
    found = verdicts("strategy", toys.Candid())
    assert bad(found) == {}
    assert found["promises"].status == "pass"


@pytest.mark.usefixtures("here")
def test_to_decline_everything_with_a_reason_is_honest() -> None:
    found = verdicts("strategy", toys.Declining())
    assert bad(found) == {}
    assert found["sizes"].status == "not-applicable"
    assert "full moon" in found["returns"].message


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("toy", HARMLESS, ids=lambda toy: toy.__name__)
def test_a_bad_strategy_fails_the_check_that_it_should(toy: type[Strategy]) -> None:
    found = bad(verdicts("strategy", toy()))
    assert list(found) == [toys.FAULTS[toy]]
    (message,) = found.values()
    assert "expected" in message or "allowed" in message
    assert "\n" not in message


@pytest.mark.parametrize("toy", SAYS, ids=lambda toy: toy.__name__)
def test_a_strategy_that_ends_or_blocks_its_process_leaves_the_checker_alone(
    toy: type[Strategy],
) -> None:
    # What never comes back is waited for; the rest has time on a busy machine too.
    limits = {"seconds": 3.0 if "no result" in SAYS[toy] else 300.0, "memory": 256 * MIB}
    found = verdicts("strategy", toy(), **limits)
    assert list(bad(found)) == [toys.FAULTS[toy]]
    assert re.search(SAYS[toy], bad(found)[toys.FAULTS[toy]], re.IGNORECASE)
    if toys.FAULTS[toy] == "returns":
        assert found["symmetric"].status == "not-applicable"


@pytest.mark.parametrize("toy", toys.FORGED, ids=lambda toy: toy.__name__)
def test_a_strategy_that_changes_the_checks_in_its_process_changes_no_verdict(
    toy: type[Strategy],
) -> None:
    (check,) = (check for check in checks_of("strategy") if check.name == toys.FORGED[toy])
    found = kit.judge_check(check, Bench(toy()))
    assert found.status == "fail", found
    assert "\n" not in found.message


@pytest.mark.skipif(sandbox.missing() is not None, reason="no sandbox here")
def test_a_strategy_is_checked_in_the_sandbox(tmp_path: Path) -> None:
    file = tmp_path / "held_out.csv"
    file.write_text("123.4")
    checks = {check.name: check for check in checks_of("strategy")}
    assert kit.judge_check(checks["returns"], Bench(toys.Nosy(str(file)))).status == "pass"
    # What it does find is stated.
    shown = kit.judge_check(checks["returns"], Bench(toys.Nosy(toys.__file__)))
    assert "Strategies that break one rule each" in shown.message


@pytest.mark.parametrize("stated", [b"", b"null", b"{}", b'["splendid", ""]', b"[" * 9999, b"\xff"])
def test_a_verdict_that_is_none_is_a_failure(
    stated: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_here(tasks: Mapping[Any, object], limits: object, count: int) -> dict[Any, Ending]:
        return {key: Ending("answer", stated) for key in tasks}

    monkeypatch.setattr(kit, "run_apart", run_here)
    found = Bench(toys.Spring()).apart(print)
    assert found == kit.Verdict("fail", "what its process sent is no verdict")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "name",
    [n if n in FEW else pytest.param(n, marks=pytest.mark.nightly) for n in BUILT_IN.strategies
     if n not in SLOW],
)  # fmt: skip
def test_built_in_strategies_pass(name: str) -> None:
    (subject,) = subjects(name, BUILT_IN)
    assert bad({f.check.name: f.verdict for f in findings(subject)}) == {}


@pytest.mark.nightly
@pytest.mark.parametrize("name", SLOW)
def test_slow_built_in_strategies_pass(name: str) -> None:
    (subject,) = subjects(name, BUILT_IN)
    found = bad({f.check.name: f.verdict for f in findings(subject)})
    assert set(found) <= {"resources"}


@pytest.mark.slow(5)
@pytest.mark.usefixtures("here")
def test_time_and_memory_are_said_and_a_ratio_is_a_warning() -> None:
    physical = BUILT_IN.strategies["physical"]
    found = verdicts("strategy", toys.Good(), reference=physical)
    assert re.fullmatch(
        r".* s and .*B on the .*, \S+ and \S+ times those of physical", found["resources"].message
    )
    assert found["resources"].status == "pass"
    hungry = verdicts("strategy", toys.Hungry(), reference=toys.Good())
    assert hungry["resources"].status == "warn"
    assert "expected at most 100 times" in hungry["resources"].message


@pytest.mark.usefixtures("here")
def test_cases_of_the_user_count() -> None:
    picky = replace(problem("free frame out of plane"), name="mine")
    found = verdicts("strategy", toys.Inverting(), cases=[picky])
    assert found["cases"].status == "fail"
    assert found["cases"].message.startswith("mine: LinAlgError")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("item", "fault"),
    [
        (toys.Spring(), None),
        (toys.Elsewhere(), "places"),
        (toys.NeverNeutral(), "neutral"),
        (toys.Worded(), None),
        (toys.Oversized(), "worded"),
        (toys.Misread(), "worded"),
        (toys.Foreign(), "worded"),
        (toys.InPercent(), "worded"),
        (toys.Overfilled(), "worded"),
    ],
    ids=lambda item: type(item).__name__ if isinstance(item, toys.Spring) else "",
)
def test_effects(item: object, fault: str | None) -> None:
    found = bad(verdicts("effect", item))
    assert list(found) == ([] if fault is None else [fault])


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["member-stiffness", "attached-oscillator"])
def test_built_in_effects_pass(name: str) -> None:
    (subject,) = subjects(name, BUILT_IN)
    assert bad({f.check.name: f.verdict for f in findings(subject)}) == {}


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("item", "fault"),
    [
        (toys.Reader(), None),
        (toys.Careless(), "empty-file"),
        (toys.Decoding(), "random-file"),
        (BUILT_IN.readers["universal file"], None),
    ],
    ids=["good", "careless", "decoding", "universal"],
)
def test_readers(item: object, fault: str | None) -> None:
    assert list(bad(verdicts("reader", item))) == ([] if fault is None else [fault])


@pytest.mark.usefixtures("here")
def test_scenarios(tmp_path: Path) -> None:
    frame = BUILT_IN.scenarios["frame"]
    assert bad(verdicts("scenario", frame)) == {}
    (tmp_path / "case.toml").write_text("[case]\nname = 3\n")
    broken = Scenario("mine", "Mine", {"mine": tmp_path})
    found = verdicts("scenario", broken)
    assert list(bad(found)) == ["reads"]
    assert "case.toml" in found["reads"].message
    assert found["solves"].status == "not-applicable"


def test_places_are_words_of_the_grammar() -> None:
    model = problem("grounded frame in space").model
    good = ("all", "L", "type:L", "A", "AB", "AB/2", "AB@A", "AB@0.25", "A-D", "A:z", "AB@0.5:x")
    assert [place for place in good if not has_place(model, place)] == []
    wrong = ("Z", "AB/3", "AB/0", "AB@C", "AB@1.5", "A-Z", "A:w", "type:Q", "")
    assert [place for place in wrong if has_place(model, place)] == []


def test_a_name_is_looked_up_kindly() -> None:
    with pytest.raises(InputError, match="did you mean 'baruch'"):
        subjects("barch", BUILT_IN)
    assert {s.role for s in subjects("spring:arm=0.01", BUILT_IN)} == {"strategy"}


@pytest.mark.usefixtures("here")
def test_command_line(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    words = ["plugins", "check", "unchanged", "--case", "frame", "--json", str(file)]
    outcome = call_bench(*words)
    lines = outcome.output.splitlines()
    assert lines[0] == f"strategy unchanged: {len(checks_of('strategy'))} checks"
    assert lines[-1].endswith("0 failed, 0 warnings, 1 not applicable")
    (record,) = json.loads(file.read_text())["checked"]
    assert [c["check"] for c in record["checks"]] == [c.name for c in checks_of("strategy")]
    assert record["counts"]["fail"] == 0
    assert {c["check"]: c["status"] for c in record["checks"]}["cases"] == "pass"


@pytest.mark.usefixtures("here")
def test_exit_codes(monkeypatch: pytest.MonkeyPatch) -> None:
    strategies = {**BUILT_IN.strategies, "asymmetric": toys.Asymmetric()}
    known = replace(BUILT_IN, strategies=strategies)
    monkeypatch.setattr("femubench.core.cli.plugins.plugins_for", lambda ctx: known)
    outcome = call_bench("plugins", "check", "asymmetric", code=1)
    assert re.search(r"^FAIL +symmetric +grounded .* allowed 1e-08", outcome.output, re.MULTILINE)
    call_bench("plugins", "check", "nothing", code=2)
    gone = ["plugins", "check", "unchanged", "--json", "/no/such/folder/x.json"]
    call_bench(*gone, code=2)


PLUGIN = """
import sys
sys.path.insert(0, {toys!r})
import conformance_toys as toys
import femubench.core.plugin.loader as loader

def pytest_configure():
    given = loader.Plugins(strategies={{"good": toys.Good(), "exiting": toys.Exiting()}})
    loader.load_plugins = lambda: given
"""


def run_pytest(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    (folder / "conftest.py").write_text(PLUGIN.format(toys=str(ROOT / "tests" / "toys")))
    command = ("-m", "pytest", "-p", "no:cacheprovider", "--rootdir", ".")
    plugin = ("-p", "femubench.core.conformance.pytest_plugin")
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    return run_python(*command, *plugin, *words, code=None, cwd=folder, env=environment)


@pytest.mark.slow(10)
def test_pytest_runs_checks_without_any_test_file(tmp_path: Path) -> None:
    words = ("--femubench", "good", "--femubench", "exiting", "-k", "described or returns", "-rA")
    found = run_pytest(tmp_path, *words)
    assert found.returncode == 1, found.stdout
    assert "PASSED femubench::good::returns" in found.stdout
    assert "FAILED femubench::exiting::returns" in found.stdout
    assert "exiting: returns: grounded frame out of plane: the worker process" in found.stdout
    assert "1 failed, 3 passed" in found.stdout
    assert "Traceback" not in found.stdout


@pytest.mark.nightly
def test_pytest_without_the_option_does_nothing(tmp_path: Path) -> None:
    assert run_pytest(tmp_path).returncode == 5
    unknown = run_pytest(tmp_path, "--femubench", "god")
    assert unknown.returncode == 4
    assert "did you mean 'good'" in unknown.stderr
    code = (
        "import sys, femubench.core.conformance.pytest_plugin; "
        "sys.exit(bool({'numpy', 'scipy', 'pluggy.x', 'pandas'} & set(sys.modules)))"
    )
    run_python("-c", code)


def test_docs_name_every_check() -> None:
    text = (ROOT / "docs" / "conformance.md").read_text(encoding="utf-8")
    roles: tuple[Role, ...] = ("strategy", "effect", "reader", "scenario")
    for check in (check for role in roles for check in checks_of(role)):
        assert f"| `{check.name}` | {check.sentence} |" in text
