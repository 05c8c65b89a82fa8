"""A site says of every row whether its errors were computed again from the answers themselves."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from femubench.core.cli.main import bench
from femubench.core.library.cases import usable_plugins
from femubench.core.library.rank import Run, plan_run
from femubench.core.library.report import report
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.handed_in import read_answers, write_answers
from femubench.core.run.runner import Receivers
from femubench.core.schema.records import run_from_json
from femubench.core.schema.results import JobName
from femubench.core.score.ranking import rank_results

pytestmark = pytest.mark.slow(40)
Data, Handed = dict[str, Any], tuple[dict[str, Any], Path]


@pytest.fixture(scope="module")
def handed(tmp_path_factory: pytest.TempPathFactory) -> Handed:
    """A run with twins as one that had a sandbox, and the file of its answers."""
    file = tmp_path_factory.mktemp("handed") / "run.answers"
    names, given = ["unchanged", "global"], {"twins": 2, "twin_seed": 3}
    plan = plan_run(["suite/bracket", "frame"], names, usable_plugins(), given)
    answers: dict[JobName, bytes] = {}
    receivers = Receivers(keep_answer=answers.__setitem__)
    run = Run.of(plan.run(LocalProcesses(2), receivers))
    write_answers(file, run, answers)
    data: Data = json.loads(str(report(run, style="json")))
    data["meta"]["sandbox"] = "namespaces"
    for result in (*data["results"], *data["companions"]):
        result["provenance"]["sandbox"] = "namespaces"
    return data, file


def publish(room: Path, data: Data, answers: Path | None) -> tuple[int, str]:
    room.mkdir(exist_ok=True)
    (room / "run.json").write_text(json.dumps(data))
    if answers is not None:
        (room / "run.answers").write_bytes(answers.read_bytes())
    done = CliRunner().invoke(bench, ["publish", str(room / "site"), str(room / "run.json")])
    return done.exit_code, done.output


def shown(room: Path) -> tuple[list[str], set[str]]:
    """Return what a site says of its runs, and the marks of its strategies."""
    index = json.loads((room / "site" / "index.json").read_text())
    marks = {mark for one in index["strategies"] for mark in one["versions"][0]["marks"]}
    return [run["proof"] for run in index["runs"]], marks


def forged(data: Data) -> Data:
    """Return a run in which one strategy is ten times better on all that is unseen."""
    made = copy.deepcopy(data)
    for result in (*made["results"], *made["companions"]):
        for name in ("higher", "modified"):
            if result["strategy"] != "global" or result.get(name) is None:
                continue
            for mode in result[name]["modes"]:
                if mode["predicted_hz"] is not None:
                    error = mode["predicted_hz"] - mode["measured_hz"]
                    mode["predicted_hz"] = mode["measured_hz"] + 0.1 * error
                mode.pop("candidates", None)
            errors = [
                1.0 if m["predicted_hz"] is None else m["predicted_hz"] / m["measured_hz"] - 1.0
                for m in result[name]["modes"]
            ]
            mean = sum(error * error for error in errors) / len(errors)
            result[name]["rms_percent"] = 100.0 * mean**0.5
    # Gains and board as our own library computes them.
    run, meta = run_from_json(made), data["meta"]
    ranked = (rank_results(results, meta) for results in (run.results, run.companions))
    found: Data = json.loads(str(report(Run(meta, *ranked), style="json")))
    return found


def test_with_its_answers_a_run_is_recomputed_and_has_no_mark(
    handed: Handed, tmp_path: Path
) -> None:
    assert publish(tmp_path / "one", *handed)[0] == 0
    assert shown(tmp_path / "one") == (["recomputed"], set())
    # Without them it is what its file states; with them it takes the place of that.
    assert publish(tmp_path / "two", handed[0], None)[0] == 0
    assert shown(tmp_path / "two") == (["stated"], {"stated"})
    assert "stated</span>" in (tmp_path / "two" / "site" / "index.html").read_text()
    assert publish(tmp_path / "two", *handed)[0] == 0
    assert shown(tmp_path / "two") == (["recomputed"], set())


def test_forged_errors_are_refused_with_the_answers_and_stated_without(
    handed: Handed, tmp_path: Path
) -> None:
    data, answers = handed
    code, said = publish(tmp_path / "one", forged(data), answers)
    assert code == 2
    assert "not the errors of its answer" in said
    assert not (tmp_path / "one" / "site").exists()
    assert publish(tmp_path / "two", forged(data), None)[0] == 0
    assert shown(tmp_path / "two") == (["stated"], {"stated"})


def _drop(answers: dict[JobName, bytes]) -> None:
    answers.pop(next(job for job in answers if job[1] == "global"))


def _exchange(answers: dict[JobName, bytes]) -> None:
    jobs = [job for job in answers if job[0] == "frame"]
    answers.update(zip(jobs, [answers[job] for job in reversed(jobs)], strict=True))


@pytest.mark.parametrize(
    "edit", [_drop, _exchange, lambda a: a.update({next(iter(a)): b"o" + bytes(99)})]
)
def test_answers_that_do_not_give_the_errors_are_refused(
    handed: Handed, tmp_path: Path, edit: Callable[[dict[JobName, bytes]], None]
) -> None:
    data, file = handed
    answers = dict(read_answers(file)[1])
    edit(answers)
    changed = tmp_path / "changed.answers"
    write_answers(changed, Run.of(run_from_json(data)), answers)
    code, said = publish(tmp_path / "site", data, changed)
    assert code == 2
    assert said.count("\n") == 1
    assert "not the errors of its answer" in said
