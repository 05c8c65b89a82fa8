"""`bench publish` takes complete sandboxed runs with twins, and nothing that was edited."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from femubench.core.library.publish import InstalledCases
from femubench.core.library.rank import rank
from femubench.core.library.report import report
from femubench.core.publish.verification import _Known
from femubench.core.run.provenance import plan_digest
from tests.command import call_bench

pytestmark = pytest.mark.slow(10)

Data = dict[str, Any]
Edit = Callable[[Data], object]


def kept(function: Callable[..., Any], key: Callable[..., object]) -> Callable[..., Any]:
    """Return a function that keeps what it has computed."""
    found: dict[object, Any] = {}

    def call(*given: Any) -> Any:
        if key(*given) not in found:
            found[key(*given)] = function(*given)
        return found[key(*given)]

    return call


@pytest.fixture(scope="module", autouse=True)
def once() -> Iterator[None]:
    """Compute but once what this installation says of its cases, the same for every file."""
    with pytest.MonkeyPatch.context() as patch:
        digests = lambda _, cases, *rest: (*(case.digest for case in cases), *rest)  # noqa: E731
        patch.setattr(InstalledCases, "twins", kept(InstalledCases.twins, digests))
        patch.setattr(_Known, "of", kept(_Known.of, lambda case, _: case.digest))
        yield


@pytest.fixture(scope="module")
def honest() -> Data:
    """A run of a computed and of a tested structure, as one that had a sandbox."""
    run = rank(["suite/bracket", "frame"], ["unchanged", "global"], twins=2, jobs=2)
    data: Data = json.loads(str(report(run, style="json")))
    data["meta"]["sandbox"] = "namespaces"
    for result in (*data["results"], *data["companions"]):
        result["provenance"]["sandbox"] = "namespaces"
    return data


def publish(room: Path, data: Data, *words: str) -> Result:
    file = room / "run.json"
    file.write_text(json.dumps(data))
    return call_bench("publish", room / "site", file, *words, code=None)


def edited(data: Data, edit: Edit) -> Data:
    made = copy.deepcopy(data)
    edit(made)
    return made


def index(room: Path) -> Data:
    return json.loads((room / "site" / "index.json").read_text())  # type: ignore[no-any-return]


def test_an_honest_run_is_stated_and_stays_so(honest: Data, tmp_path: Path) -> None:
    answer = publish(tmp_path, honest)
    assert answer.exit_code == 0, answer.output
    assert [run["proof"] for run in index(tmp_path)["runs"]] == ["stated"]
    assert {mark for s in index(tmp_path)["strategies"] for mark in s["versions"][0]["marks"]} == {
        "stated"
    }
    assert "unverified</span>" not in (tmp_path / "site" / "index.html").read_text()
    # Its published file can be checked again, and the site reads its own files as they are.
    (kept,) = (tmp_path / "site" / "data").iterdir()
    again = tmp_path / "again"
    again.mkdir()
    assert publish(again, json.loads(kept.read_text())).exit_code == 0
    assert index(again)["runs"][0]["proof"] == "stated"
    first = (tmp_path / "site" / "index.json").read_bytes()
    assert publish(tmp_path, honest).exit_code == 0
    assert (tmp_path / "site" / "index.json").read_bytes() == first


def _higher(data: Data, place: int = 0) -> Data:
    ok = [r for r in data["results"] if r["status"] == "ok"]
    return ok[place]["higher"]  # type: ignore[no-any-return]


def _better(data: Data) -> None:
    """Move measured figures to the predicted ones, and the errors with them."""
    block = next(r for r in data["results"] if r["strategy"] == "global")["higher"]
    for mode in block["modes"]:
        mode["measured_hz"] = mode["predicted_hz"]
    block["rms_percent"] = 0.0


def _other_nominal(data: Data) -> None:
    errors = data["meta"]["reference"]["suite/bracket"]
    errors["higher"] *= 3.0


def _other_model(data: Data) -> None:
    """Make the textbook model worse than it is, so that all gain more."""
    for mode in data["meta"]["models"]["suite/bracket"]["textbook"]["higher"]["modes"]:
        mode["predicted_hz"] *= 1.1


def _without(data: Data, **fields: str) -> None:
    for key in ("results", "companions"):
        kept = [r for r in data[key] if any(r[k] != v for k, v in fields.items())]
        data[key] = kept


def _without_strategy(data: Data) -> None:
    _without(data, strategy="global")
    data["meta"]["strategies"] = ["unchanged"]
    del data["leaderboard"]


def _without_case(data: Data) -> None:
    _without(data, case="frame")
    for name in ("cases", "reference", "models", "starts", "structures"):
        del data["meta"][name]["frame"]


def _fewer_modes(data: Data) -> None:
    block = _higher(data)
    worst = max(block["modes"], key=lambda m: abs((m["predicted_hz"] or 0) / m["measured_hz"] - 1))
    block["modes"].remove(worst)
    errors = [(m["predicted_hz"] / m["measured_hz"] - 1.0) ** 2 for m in block["modes"]]
    block["rms_percent"] = 100.0 * (sum(errors) / len(errors)) ** 0.5


def _other_files(data: Data) -> None:
    data["meta"]["cases"]["frame"]["digest"] = "beef"
    for result in data["results"]:
        if result["case"] == "frame":
            result["provenance"]["case"] = "beef"


def _unknown(data: Data) -> None:
    text = json.dumps(data).replace("suite/bracket", "suite/racket")
    data.clear()
    data.update(json.loads(text))


def _one_mode_of_a_twin(data: Data) -> None:
    result = next(r for r in data["companions"] if r["case"] == "suite/bracket~1")
    result["higher"]["modes"][0]["measured_hz"] *= 1.01


def _without_ranks(data: Data) -> None:
    for result in data["results"]:
        result["rank"] = None
    data.pop("leaderboard", None)


def _spared(data: Data) -> None:
    """Say that a strategy was not applicable to a drawn model."""
    result = next(
        r for r in data["results"] if r["nominal"] == "drawn" and r["strategy"] == "global"
    )
    result |= {"status": "not-applicable", "gain": None, "unphysical": False}
    result |= dict.fromkeys(("used", "higher", "modified"))
    _without_ranks(data)


def _new_plan(data: Data) -> None:
    """Leave a strategy out, and make the plan fit: what is left is a run of its own."""
    _without_strategy(data)
    _without_ranks(data)
    keys = [r["key"] for r in (*data["results"], *data["companions"])]
    data["meta"]["plan"] = plan_digest(keys)


EDITS: dict[str, tuple[Edit, str]] = {
    "no sandbox": (lambda d: d["meta"].pop("sandbox"), "meta.sandbox: the strategies ran without"),
    "one job without": (
        lambda d: d["companions"][0]["provenance"].update(sandbox="none"),
        "meta.sandbox",
    ),
    "no twins": (
        lambda d: (d["meta"].pop("twins"), d.pop("companions")),
        "meta.twins: it has no 2 tw",
    ),
    "results on twins": (lambda d: _without(d, case="suite/bracket~2"), "results: 2 jobs are"),
    "another seed": (lambda d: d["meta"]["twins"].update(seed=1), "meta.twins: these are not the"),
    "twins of another kind": (
        lambda d: d["meta"]["twins"]["kinds"].update({"suite/bracket~1": ["stretched"]}),
        "meta.twins.kinds: its twins are of other kinds",
    ),
    "twins of another case": (
        lambda d: d["meta"]["twins"]["of"].update({"suite/bracket~1": "frame"}),
        "meta.twins: they are of other cases",
    ),
    "measured figures": (_better, "Hz was not measured"),
    "measured figure of a twin": (_one_mode_of_a_twin, "Hz was not measured"),
    "nominal errors": (_other_nominal, "meta.reference.suite/bracket: not the errors"),
    "gain of a job": (lambda d: d["results"][0].update(gain=0.99), "results[0].gain: gain 0.99"),
    "nominal model": (_other_model, "meta.models.suite/bracket: not what the textbook model"),
    "rule": (lambda d: d["meta"]["rule"].update(cap=0.2), "meta.rule: gains by another rule"),
    "gain": (lambda d: d["leaderboard"][1].update(gain=0.99), "leaderboard[1].gain: gain 0.99"),
    "digest": (_other_files, "meta.cases.frame.digest: other files"),
    "unknown case": (_unknown, "no case 'suite/racket' is installed here"),
    "one result": (lambda d: d["results"].pop(1), "results: 1 jobs are missing"),
    "all of a strategy": (_without_strategy, "meta.plan: the jobs are not those"),
    "all of a case": (_without_case, "meta.twins.again: what ran twice is not"),
    "a mode": (_fewer_modes, "not the measured modes of its case"),
    "structure": (
        lambda d: d["meta"]["structures"].update({"suite/bracket": "frame"}),
        "meta.structures.suite/bracket",
    ),
    "yardstick": (
        lambda d: d["meta"].update(yardstick="drawn"),
        "meta.models.suite/bracket.drawn: missing",
    ),
    "a job twice": (
        lambda d: d["companions"].append(d["companions"][0]),
        "results: 0 jobs are missing",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EDITS)
def test_what_was_edited_is_refused_in_one_line(honest: Data, tmp_path: Path, name: str) -> None:
    edit, said = EDITS[name]
    answer = publish(tmp_path, edited(honest, edit))
    assert answer.exit_code == 2, answer.output
    (line,) = answer.stderr.splitlines()
    assert said in line
    assert "(expected " in line
    assert not (tmp_path / "site").exists()


def test_who_was_not_applicable_is_taken_as_the_model_that_was_given(
    honest: Data, tmp_path: Path
) -> None:
    answer = publish(tmp_path, edited(honest, _spared))
    assert answer.exit_code == 0, answer.output


def test_a_smaller_run_is_a_run(honest: Data, tmp_path: Path) -> None:
    # Anyone who makes a new plan of what is left says what a run of these alone would say.
    assert publish(tmp_path, edited(honest, _new_plan)).exit_code == 0


def test_the_rest_is_taken_when_asked_and_marked(honest: Data, tmp_path: Path) -> None:
    answer = publish(tmp_path, edited(honest, EDITS["no sandbox"][0]), "--unverified")
    assert answer.exit_code == 0, answer.output
    assert [run["proof"] for run in index(tmp_path)["runs"]] == ["unverified"]
    (marks,) = {tuple(s["versions"][0]["marks"]) for s in index(tmp_path)["strategies"]}
    assert marks == ("unverified", "no twins")
    assert "unverified</span>" in (tmp_path / "site" / "index.html").read_text()
    # A file cannot say of itself how far it was checked.
    (kept,) = (tmp_path / "site" / "data").iterdir()
    claimed = {**json.loads(kept.read_text()), "proof": "recomputed", "verified": True}
    again = tmp_path / "again"
    again.mkdir()
    assert publish(again, claimed).exit_code == 2
    assert publish(again, claimed, "--unverified").exit_code == 0
    assert index(again)["runs"][0]["proof"] == "unverified"
    # The same run, checked, takes its place.
    assert publish(tmp_path, honest).exit_code == 0
    assert [run["proof"] for run in index(tmp_path)["runs"]] == ["stated"]


def test_sites_of_earlier_versions_are_read(honest: Data, tmp_path: Path) -> None:
    assert publish(tmp_path, honest, "--unverified").exit_code == 0
    (kept,) = (tmp_path / "site" / "data").iterdir()
    old = json.loads(kept.read_text())
    for name in ("plan", "sandbox", "twins"):
        old["meta"].pop(name)
    old = {name: old[name] for name in ("schema", "meta", "results")}
    kept.write_text(json.dumps(old, sort_keys=True, separators=(",", ":")) + "\n")
    assert publish(tmp_path, honest).exit_code == 0
    assert [run["proof"] for run in index(tmp_path)["runs"]] == ["stated"]
