"""Evidence by structure: false alarms, power, intervals and tiers where the truth is known."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import harness_toys as toys
import numpy as np
import pytest
from scipy.stats import t as student

from femubench.core.errors import InputError
from femubench.core.run.runner import run_jobs
from femubench.core.schema.results import Block, JobResult, Run
from femubench.core.score.comparison import Against, compare_runs
from femubench.core.score.statistics import ScoreTable, Significance, evidence_of, structures_of
from femubench.core.typing import FloatArray
from femubench.reports.runs import TerminalReporter
from femubench.results import (
    interval_kind,
    leaderboard,
    run_from_json,
    run_to_json,
    tell_apart,
)

TRIALS = 400
BLOCKS = ("used", "higher", "modified")
# Spread of the logarithm of a score between structures, cases and blocks of one, and seeds.
STRUCTURE, CASE, BLOCK, SEED = 0.5, 0.2, 0.3, 0.3


def drawn(
    random: np.random.Generator, structures: Sequence[int], seeds: int, effect: float = 0.0
) -> FloatArray:
    """Return logarithms of the scores of two strategies that differ by `effect` on the average.

    Arguments:
        structures: that of every case.

    Returns:
        (strategies, cases, blocks, seeds).
    """
    cases, whole = len(structures), max(structures) + 1
    logs = STRUCTURE * random.standard_normal((2, whole, 1, 1))[:, list(structures)]
    logs = logs + CASE * random.standard_normal((2, cases, 1, 1))
    logs = logs + BLOCK * random.standard_normal((2, cases, len(BLOCKS), 1))
    logs = logs + SEED * random.standard_normal((2, cases, len(BLOCKS), seeds))
    logs[1] += effect
    return np.asarray(logs)


def judged(logs: FloatArray, structures: Sequence[int]) -> Significance:
    """Return what the comparison of the two says."""
    member = np.equal.outer(range(max(structures) + 1), np.repeat(structures, len(BLOCKS)))
    flat = logs.reshape(2, -1, logs.shape[-1])
    (found,) = evidence_of({"b": ScoreTable(flat, member.astype(float)).ratios(0, 1)})
    return found


def run_of(scores: Mapping[str, FloatArray], structures: Mapping[str, str]) -> Run:
    """Return a run in which every strategy has the given scores.

    Arguments:
        scores: (cases, blocks, seeds) in the order of `structures`.
        structures: by case.
    """
    reference = {case: dict.fromkeys(BLOCKS, 1.0) for case in structures}
    results = [
        JobResult(
            case, name, seed, "ok",
            blocks={
                block: Block(max(1.05 * values[c, b, seed] - 0.05, 0.0), None, ())
                for b, block in enumerate(BLOCKS)
            },
        )
        for name, values in scores.items()
        for c, case in enumerate(structures)
        for seed in range(values.shape[2])
    ]  # fmt: skip
    return Run({"structures": dict(structures), "reference": reference}, tuple(results))


NINE = {
    9: (0, 1, 2, 3, 4, 5, 6, 7, 8),
    7: (0, 0, 0, 1, 2, 3, 4, 5, 6),
    6: (0, 0, 0, 1, 1, 2, 3, 4, 5),
    4: (0, 0, 0, 0, 1, 1, 1, 2, 3),
}


@pytest.mark.parametrize("seeds", [1, 5, 20])
@pytest.mark.parametrize("structures", NINE.values(), ids=lambda s: f"{max(s) + 1}-structures")
def test_no_difference_is_seldom_called_one(structures: Sequence[int], seeds: int) -> None:
    """The same on all but structures, cases, blocks and noise: 7 % of false alarms at most."""
    random = np.random.default_rng([7, seeds, max(structures)])
    draws = (drawn(random, structures, seeds) for _ in range(TRIALS))
    said = Counter(judged(logs, structures).verdict for logs in draws)
    false = said["better"] + said["worse"]
    if max(structures) + 1 < 6:
        assert said == {"too few structures": TRIALS}
    else:
        # Five in a hundred are what the test allows itself: none at all would be a test asleep.
        assert 0 < false <= 0.07 * TRIALS


def test_a_true_difference_on_twelve_structures_is_found() -> None:
    random = np.random.default_rng(12)
    structures = (*range(12), 0, 0, 3)
    for effect, verdict in ((-1.0, "better"), (1.0, "worse")):
        draws = (drawn(random, structures, 2, effect) for _ in range(100))
        said = Counter(judged(logs, structures).verdict for logs in draws)
        assert said[verdict] >= 80
        assert said["worse" if verdict == "better" else "better"] == 0


@pytest.mark.parametrize("count", [6, 8, 12, 30])
def test_intervals_hold_the_truth_as_often_as_they_say(count: int) -> None:
    random = np.random.default_rng(count)
    held = 0
    for _ in range(TRIALS):
        found = judged(drawn(random, range(count), 2, 0.3), range(count))
        assert found.low is not None
        assert found.high is not None
        held += found.low < np.exp(0.3) < found.high
    assert 0.92 * TRIALS <= held <= 0.98 * TRIALS


def test_a_structure_counts_once_whatever_its_cases_blocks_and_seeds() -> None:
    """Eight structures; one has five cases that all disagree with the seven others."""
    structures = {f"case-{c}": f"s{min(c, 7)}" for c in range(12)}
    scores = np.ones((12, 3, 4))
    lower = scores.copy()
    lower[:7] = np.array([0.5, 0.6, 0.7, 0.8, 0.9, 0.4, 0.3])[:, None, None]
    lower[7:] = 1.1
    run = run_of({"a": scores, "b": lower}, structures)
    (found,) = compare_runs(run, run, against=Against("a", "b")).evidence
    assert (found.structures, found.differing) == (8, 8)
    # One of eight signs the wrong way, at the smallest rank: 2 of 256 sums on either side.
    assert found.p == pytest.approx(4 / 256)
    assert found.verdict == "better"
    parts = [*(0.5, 0.6, 0.7, 0.8, 0.9, 0.4, 0.3), 1.1]
    assert found.ratio == pytest.approx(np.prod(parts) ** (1 / 8), rel=1e-9)
    # What the run does not say: every case is a structure of its own.
    silent = Run({"reference": run.meta["reference"]}, run.results)
    (found,) = compare_runs(silent, silent, against=Against("a", "b")).evidence
    assert found.structures == 12


def test_seeds_on_few_structures_show_nothing_and_the_reader_is_told() -> None:
    random = np.random.default_rng(5)
    five = {f"case-{c}": f"s{c}" for c in range(5)}
    one = dict.fromkeys(five, "s0")
    for structures in (five, one):
        worse = 3.0 + random.random((5, 3, 50))
        run = run_of({"a": np.ones((5, 3, 50)), "b": worse}, structures)
        (found,) = compare_runs(run, run, against=Against("a", "b")).evidence
        assert (found.verdict, found.p, found.low) == ("too few structures", None, None)
        groups = tell_apart(run, ["a", "b"])
        assert groups.tiers == groups.groups == ()
        assert "6 structures or more" in groups.note


TWENTY = {f"case-{c}": f"s{c}" for c in range(20)}


class TestTiers:
    def test_the_best_is_in_the_first_and_who_is_far_behind_is_not(self) -> None:
        random = np.random.default_rng(3)
        means = {"best": 0.3, "as-good": 0.3, "behind": 0.6, "as-far": 0.6, "last": 2.0}
        scores = {
            name: mean * np.exp(0.1 * random.standard_normal((20, 3, 1)))
            for name, mean in means.items()
        }
        found = tell_apart(run_of(scores, TWENTY), list(means))
        assert found.tiers == (("best", "as-good"), ("behind", "as-far"), ("last",))
        assert found.tier_of() == {"best": 1, "as-good": 1, "behind": 2, "as-far": 2, "last": 3}
        assert found.letters() == dict(zip(means, "aabbc", strict=True))

    def test_comparisons_with_the_best_need_not_pay_for_all_pairs(self) -> None:
        """Nine structures: p is 2 / 2^9, times 9 for the best and times 45 for all pairs."""
        scores = {f"s-{k}": np.full((9, 3, 1), 0.1 * (k + 1)) for k in range(10)}
        structures = {f"case-{c}": f"s{c}" for c in range(9)}
        found = tell_apart(run_of(scores, structures), list(scores))
        assert [len(tier) for tier in found.tiers] == [1] * 10
        assert len(found.groups) == 1
        assert "too much for 45 pairs" in found.note
        assert "comparisons with the first strategy" not in found.note.partition(" With 9 ")[2]

    def test_who_shares_no_letter_with_the_best_is_below_it(self) -> None:
        for seed in range(20):
            random = np.random.default_rng(seed)
            scores = {
                f"s-{k}": 0.3 * 1.2**k * np.exp(0.3 * random.standard_normal((20, 3, 1)))
                for k in range(8)
            }
            order = list(scores)
            found = tell_apart(run_of(scores, TWENTY), order)
            assert sorted(name for tier in found.tiers for name in tier) == sorted(order)
            letters = {name: set(text.split()) for name, text in found.letters().items()}
            apart = {name for name in order if not letters[name] & letters[order[0]]}
            assert not apart & set(found.tiers[0])

    def test_one_of_many_equals_is_seldom_below_and_letters_seldom_err(self) -> None:
        """Of ten equal ones a given one is in the first tier, as often as a best one should be."""
        random = np.random.default_rng(10)
        names = [f"s-{k}" for k in range(10)]
        member = np.eye(20)
        kept = apart = 0
        for _ in range(100):
            logs = random.standard_normal((10, 20, 1, 1)) + np.zeros((1, 1, 3, 1))
            scores = dict(zip(names, np.exp(logs), strict=True))
            table = ScoreTable(logs[:, :, 0], member)
            order = sorted(names, key=lambda name: float(table.logs[names.index(name)].mean()))
            found = tell_apart(run_of(scores, TWENTY), order)
            kept += names[0] in found.tiers[0]
            apart += any(p < 0.05 for *_, p in found.pairs)
        assert kept >= 95
        assert apart <= 7


class TestScreen:
    def test_names_the_first_tier_with_its_intervals(self) -> None:
        random = np.random.default_rng(5)
        scores = {
            name: mean * np.exp(0.1 * random.standard_normal((20, 3, 1)))
            for name, mean in {"first": 0.3, "second": 0.3, "third": 0.9}.items()
        }
        text = TerminalReporter().render(run_of(scores, TWENTY))
        assert max(map(len, text.splitlines())) <= 80
        said = " ".join(text.split())
        number = r"(0\.\d{3})"
        gains = dict(re.findall(rf"\d  (\w+) +{number} ", text))
        found = re.findall(rf"(\w+) +{number} to {number} +1 ", text)
        assert {name for name, *_ in found} == {"first", "second"}
        assert all(float(low) < float(gains[name]) < float(high) for name, low, high in found)
        assert "1 of 3 are below" in said.partition("Next to it in tier 1, not shown to differ")[2]

    def test_says_why_nothing_is_tested(self) -> None:
        scores = {"first": np.full((20, 3, 9), 0.1), "second": np.full((20, 3, 9), 5.0)}
        text = TerminalReporter().render(run_of(scores, dict.fromkeys(TWENTY, "one")))
        stated = "Ranks are not tested: no two strategies differ on 6 structures"
        assert stated in " ".join(text.split())
        assert "tier 1" not in text


class TestGain:
    """The interval of a gain in the leaderboard."""

    def test_is_that_of_student_over_structures(self) -> None:
        """Log scores that are normal, so that the interval of Student is the right one."""
        logs = np.random.default_rng(1).normal(-1.0, 0.4, 20)
        scores = np.exp(np.repeat(logs, 3).reshape(20, 3, 1) + np.zeros((1, 1, 2)))
        run = run_of({"a": scores}, TWENTY)
        assert interval_kind(run) == "structures"
        (row,) = leaderboard(run).to_dict("records")
        assert 1.0 - row["gain"] == pytest.approx(np.exp(logs.mean()))
        half = student.ppf(0.975, 19) * logs.std(ddof=1) / np.sqrt(20)
        low, high = np.log(1.0 - row["gain_high"]), np.log(1.0 - row["gain_low"])
        assert low == pytest.approx(logs.mean() - half, abs=0.1 * half)
        assert high == pytest.approx(logs.mean() + half, abs=0.1 * half)

    def test_grows_where_cases_share_structures_and_is_none_of_few(self) -> None:
        logs = np.repeat(np.random.default_rng(2).normal(-1.0, 0.4, 10), 2)
        scores = {"a": np.exp(np.repeat(logs, 3).reshape(20, 3, 1))}

        def width(sharing: int) -> float:
            labels = {case: f"s{c // sharing}" for c, case in enumerate(TWENTY)}
            (row,) = leaderboard(run_of(scores, labels)).to_dict("records")
            return float(np.log((1.0 - row["gain_low"]) / (1.0 - row["gain_high"])))

        # Half as many independent ones: wider by the root of two, and a little for Student.
        assert 1.4 < width(2) / width(1) < 1.7
        assert np.isnan(width(4))


class TestLabels:
    def test_a_run_carries_them_and_its_json_names_them_by_result(self) -> None:
        cases = [replace(toys.tiny_case(), structure="angle"), toys.tiny_case("other")]
        run = run_jobs(cases, [toys.Unchanged()], jobs=1)
        assert run.meta["structures"] == {"corner": "angle", "other": "other"}
        data = run_to_json(run)
        assert [result["structure"] for result in data["results"]] == ["angle", "other"]
        back = run_from_json(data)
        assert structures_of(back) == run.meta["structures"]
        assert back.results == run.results

    def test_of_a_stored_run_are_checked(self) -> None:
        with pytest.raises(InputError, match=r"meta\.structures"):
            run_from_json({"meta": {"structures": {"corner": 3}}, "results": []})
