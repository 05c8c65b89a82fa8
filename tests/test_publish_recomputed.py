"""A site says of every row whether its errors were computed again from the answers themselves."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from femubench.core.library.cases import usable_plugins
from femubench.core.library.rank import Run, plan_run
from femubench.core.library.report import report
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.handed_in import read_answers, write_answers
from femubench.core.run.runner import Receivers
from femubench.core.schema.records import run_from_json
from femubench.core.schema.results import JobName
from femubench.core.score.ranking import rank_results
from tests.command import call_bench

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


def publish(room: Path, data: Data, answers: Path | None, rerun: int = 0) -> tuple[int, str]:
    room.mkdir(exist_ok=True)
    (room / "run.json").write_text(json.dumps(data))
    if answers is not None:
        (room / "run.answers").write_bytes(answers.read_bytes())
    words = ["publish", str(room / "site"), str(room / "run.json"), "--rerun", str(rerun)]
    done = call_bench(*words, code=None)
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


def test_with_its_answers_a_run_is_recomputed_and_says_so(handed: Handed, tmp_path: Path) -> None:
    code, said = publish(tmp_path / "one", *handed, rerun=2)
    assert code == 0, said
    assert re.search(r"run.json: 2 of 12 jobs run again, drawn from seed \d+\n", said)
    assert shown(tmp_path / "one") == (["recomputed"], {"recomputed"})
    for name in ("index.html", "leaderboard.md", "leaderboard.csv", "feed.xml"):
        assert "recomputed" in (tmp_path / "one" / "site" / name).read_text()
    # Without them it is what its file states; with them it takes the place of that.
    assert publish(tmp_path / "two", handed[0], None)[0] == 0
    assert shown(tmp_path / "two") == (["stated"], {"stated"})
    assert "stated</span>" in (tmp_path / "two" / "site" / "index.html").read_text()
    assert "| stated |" in (tmp_path / "two" / "site" / "leaderboard.md").read_text()
    assert "errors stated" in (tmp_path / "two" / "site" / "feed.xml").read_text()
    assert publish(tmp_path / "two", *handed)[0] == 0
    assert shown(tmp_path / "two") == (["recomputed"], {"recomputed"})


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
    """Leave an answer out: a failed job that was turned into a good one has none."""
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


def _own(data: Data) -> Data:
    return next(r for r in data["results"] if r["strategy"] == "global")  # type: ignore[no-any-return]


def _improve(data: Data) -> None:
    """Make one error smaller, and the mean with it."""
    block = _own(data)["higher"]
    for mode in block["modes"]:
        mode["predicted_hz"] = mode["measured_hz"]
    block["rms_percent"] = 0.0


def _fail(data: Data) -> None:
    """Say that a good job has failed, as one might of another's strategy."""
    _own(data).update(status="failed", reason="no", gain=None, rank=None, unphysical=False)
    _own(data).update(dict.fromkeys(("used", "higher", "modified")))
    for result in data["results"]:
        result["rank"] = None
    del data["leaderboard"]


def _other_seed(data: Data) -> None:
    data["meta"]["seeds"] = [7]
    for result in (*data["results"], *data["companions"]):
        result["seed"] = 7


def _repeat_nothing(data: Data) -> None:
    again = data["meta"]["twins"]["again"]
    data["companions"] = [r for r in data["companions"] if r["case"] not in again]
    again.clear()


PLAIN: dict[str, tuple[Callable[[Data], object], str]] = {
    "error": (_improve, "its modes give another"),
    "rank": (lambda d: _own(d).update(rank=2), "rank 2, the gains give 1"),
    "rank on the board": (lambda d: d["leaderboard"][0].update(rank=3), "rank 3, the results give"),
    "good to failed": (_fail, "not the errors of its answer"),
    "entry of a repeat": (
        lambda d: d["meta"]["twins"]["cases"].popitem(),
        "meta.twins.cases: there is no frame~again",
    ),
    "entry of a twin": (
        lambda d: d["meta"]["twins"]["cases"].pop("suite/bracket~2"),
        "meta.twins.cases: there is no suite/bracket~2",
    ),
    "seed": (_other_seed, "not the errors of its answer"),
    "repeats": (_repeat_nothing, "what ran twice"),
}


@pytest.mark.parametrize("name", PLAIN)
def test_plain_edits_are_refused(handed: Handed, tmp_path: Path, name: str) -> None:
    edit, expected = PLAIN[name]
    made = copy.deepcopy(handed[0])
    edit(made)
    code, said = publish(tmp_path, made, handed[1])
    assert code == 2, said
    assert expected in said
    assert not (tmp_path / "site").exists()


def test_what_a_file_says_of_its_sandbox_is_shown_as_its_word(
    handed: Handed, tmp_path: Path
) -> None:
    assert publish(tmp_path, *handed)[0] == 0
    page = (tmp_path / "site" / "index.html").read_text()
    assert "sandbox, as its file states" in page
    assert "in a sandbox, is what its contributor states" in page


def test_models_of_another_strategy_are_found_by_running_jobs_again(
    handed: Handed, tmp_path: Path
) -> None:
    """Errors and answers agree, but the models did not come out of this strategy."""
    made, other = copy.deepcopy(handed[0]), {"global": "unchanged", "unchanged": "global"}
    for result in (*made["results"], *made["companions"]):
        result["strategy"] = other[result["strategy"]]
    del made["leaderboard"]
    answers = {(c, other[s], *rest): a for (c, s, *rest), a in read_answers(handed[1])[1].items()}
    changed = tmp_path / "changed.answers"
    write_answers(changed, Run.of(run_from_json(made)), answers)  # type: ignore[arg-type]
    code, said = publish(tmp_path / "one", made, changed, rerun=12)
    assert code == 2
    assert re.search(r"gives another model here \(expected .*, as run again \(draw \d+\)\)", said)
    assert publish(tmp_path / "two", made, changed)[0] == 0


def test_a_run_writes_its_answers_next_to_its_json(tmp_path: Path) -> None:
    file, answers = tmp_path / "run.json", tmp_path / "run.answers"
    words = ["run", "suite/bracket", "-s", "unchanged", "--twins", "2", "--json", str(file), "-q"]
    words += ["--store", str(tmp_path / "store")]
    call_bench(*words)
    assert len(read_answers(answers)[1]) == 4  # the case, two twins, one job again
    # What comes from the store has no models, and those of another run must not stand for them.
    done = call_bench(*words, "--resume")
    assert "run.answers: 4 results come from the store, without their models" in done.stderr
    assert not answers.exists()
