"""A set whose truths nobody has: open halves, answers, and the judgement by who has the key."""

from __future__ import annotations

import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest
from cryptography.fernet import Fernet

import femubench
from femubench import read_case
from femubench.core.challenge.closed_set import CLOSED, KEY
from tests.command import call_bench

pytestmark = pytest.mark.slow(60)

SUITE = Path(__file__).parents[1] / "scenarios" / "suite"
Bench = Callable[..., str]


class Set(NamedTuple):
    """A closed set with the answers of two strategies."""

    folder: Path
    answers: Path
    bench: Bench
    said: str  # when it was closed


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> Set:
    folder = tmp_path_factory.mktemp("closed")
    key = Fernet.generate_key().decode()

    def run(*words: object, code: int = 0, key: str | None = key) -> str:
        return call_bench(*words, code=code, env={KEY: key}).output

    said = run("challenge", "close", folder / "set", SUITE / "portal", SUITE / "arch")
    halves = sorted((folder / "set").iterdir())
    words = ("-s", "global", "-s", "shifted", "--twins", "0", "--jobs", "1", "-q")
    run("submit", *words, "--output", folder / "mine.json", *halves, key=None)
    return Set(folder / "set", folder / "mine.answers", run, said)


def test_the_open_half_has_what_a_strategy_is_given_and_nothing_else(closed: Set) -> None:
    for name in ("arch", "portal"):
        half, whole = read_case(closed.folder / name), read_case(SUITE / name)
        assert (half.held_out, half.modifications) == ((), ())
        assert half.measurement.numbers == whole.used_measurement(0).numbers
        assert (half.measurement.shapes == whole.used_measurement(0).shapes).all()
        unseen = [f"{f:.6g}" for f in whole.measurement.select(whole.held_out).frequencies]
        unseen += [f"{f:.6g}" for c in whole.modifications for f in c.measurement.frequencies]
        for file in (closed.folder / name).iterdir():
            content = file.read_bytes().decode("utf-8", "replace")
            assert not [hertz for hertz in unseen if hertz in content], file
        assert {file.name for file in (closed.folder / name).iterdir()} == {
            *("case.toml", "modes.csv", "sensors.csv", CLOSED)
        }


def test_judged_answers_score_as_in_a_run_on_the_whole_cases(closed: Set) -> None:
    out = closed.folder.parent / "run.json"
    said = closed.bench("challenge", "judge", closed.folder, closed.answers, "--json", out)
    assert "global" in said
    judged = femubench.read_run(out)
    cases = ["suite/arch", "suite/portal"]
    direct = femubench.rank(cases, ["global", "shifted"], nominal="textbook", jobs=1)
    for one, other in zip(judged.results, direct.results, strict=True):
        assert (one.case, one.strategy, one.status) == (other.case, other.strategy, "ok")
        assert one.gain == pytest.approx(other.gain, rel=1e-9)
    assert judged.leaderboard["rank"].isna().sum() == 1  # a yardstick stays one


def test_what_was_not_answered_counts_as_the_model_that_was_given(closed: Set) -> None:
    part, out = closed.folder.parent / "part.zip", closed.folder.parent / "part.json"
    with zipfile.ZipFile(closed.answers) as whole, zipfile.ZipFile(part, "w") as less:
        head = msgspec.json.decode(whole.read("answers.json"))
        kept = [n for n, job in enumerate(head["jobs"]) if "arch" not in job[0]]
        for number, n in enumerate(kept):
            less.writestr(str(number), whole.read(str(n)))
        head["jobs"] = [head["jobs"][n] for n in kept]
        less.writestr("answers.json", msgspec.json.encode(head))
    closed.bench("challenge", "judge", closed.folder, part, "--json", out)
    lost = [one for one in femubench.read_run(out).results if one.case == "suite/arch"]
    assert [(one.status, one.reason) for one in lost] == [("failed", "no answer was handed in")] * 2
    assert [one.gain for one in lost] == [0.0, 0.0]


def test_a_case_published_later_is_the_one_closed(closed: Set, tmp_path: Path) -> None:
    said = dict(re.findall(r"/(\w+), sha256 of the whole case ([0-9a-f]{64})\n", closed.said))
    closed.bench("challenge", "judge", closed.folder, closed.answers, "--json", tmp_path / "r.json")
    judged = femubench.read_run(tmp_path / "r.json").meta["cases"]
    for name in ("arch", "portal"):
        published = shutil.copytree(SUITE / name, tmp_path / name)
        digest = read_case(published).digest
        assert said[name] == judged[f"suite/{name}"]["digest"] == digest
        unseen = published / "change-1.csv"
        unseen.write_bytes(unseen.read_bytes().replace(b"\n1,", b"\n1,1"))  # a frequency
        assert read_case(published).digest != digest


@pytest.mark.parametrize("key", [None, "short", "A" * 43 + "="])
def test_no_other_key_opens_it(closed: Set, key: str | None) -> None:
    said = closed.bench("challenge", "judge", closed.folder, closed.answers, code=2, key=key)
    assert said.count("\n") == 1
    assert KEY in said


def test_a_changed_file_does_not_open(closed: Set, tmp_path: Path) -> None:
    shutil.copytree(closed.folder, tmp_path / "set")
    file = tmp_path / "set" / "arch" / CLOSED
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    said = closed.bench("challenge", "judge", tmp_path / "set", closed.answers, code=2)
    assert "the file was changed" in said


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("judge", "SET", "SET/arch/case.toml"), "no answers"),
        (("judge", "SET", "A", "A"), "is there twice"),
        (("judge", "SET/arch", "A"), "no closed set"),
        (("close", "SET", "SET/arch"), "is not empty"),
        (("close", "NEW", "SET/arch"), "holds nothing back"),
    ],
)
def test_wrong_input_is_one_line(closed: Set, tmp_path: Path, words: list[str], part: str) -> None:
    named = {"SET": str(closed.folder), "A": str(closed.answers), "NEW": str(tmp_path / "new")}
    typed = [named.get(w, w.replace("SET", named["SET"])) for w in words]
    said = closed.bench("challenge", *typed, code=2)
    assert part in said
    assert said.count("\n") == 1
    assert not (tmp_path / "new").exists()
