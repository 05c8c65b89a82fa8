"""Evidence by structure: false alarms of a family, power, intervals where the truth is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import harness_toys as toys
import numpy as np
import pytest
import scored
from running import run_jobs
from scipy.stats import t as student

from femubench.core.errors import InputError
from femubench.core.schema.results import RunData
from femubench.core.score.comparison import Against, compare_runs
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.statistics import (
    Significance,
    flip_signs,
    interval_of_mean,
    tell_apart,
    weigh_evidence,
)
from femubench.core.typing import FloatArray
from femubench.results import Standings, run_from_json, run_to_json

TRIALS = 400
# Spread of a gain between structures, cases of one, and seeds.
STRUCTURE, CASE, SEED = 0.3, 0.15, 0.2


def drawn(
    random: np.random.Generator, structures: Sequence[int], seeds: int, effect: float = 0.0
) -> list[float]:
    """Return differences of gains of two strategies, `effect` on the average, by structure.

    Arguments:
        structures: that of every case.
    """
    cases, whole = len(structures), max(structures) + 1
    gains = STRUCTURE * random.standard_normal((2, whole, 1))[:, list(structures)]
    gains = gains + CASE * random.standard_normal((2, cases, 1))
    gains = gains + SEED * random.standard_normal((2, cases, seeds))
    change = (gains[1] - gains[0]).mean(axis=1) + effect
    return [float(change[np.equal(structures, s)].mean()) for s in range(whole)]


def judged(differences: Sequence[float]) -> Significance:
    """Return what the comparison of the two says."""
    (found,) = weigh_evidence({"b": differences})
    return found


def run_of(gains: Mapping[str, FloatArray], structures: Mapping[str, str]) -> RunData:
    """Return a run in which every strategy has the given gains, over a textbook error of 10 %.

    Arguments:
        gains: in [0, 1], (cases, seeds) in the order of `structures`.
        structures: by case.
    """
    errors = {case: {"used": 1.0, "higher": 10.0} for case in structures}
    listed = [
        scored.result(case, name, seed, higher=10.0 * (1.0 - values[c, seed]))
        for name, values in gains.items()
        for c, case in enumerate(structures)
        for seed in range(values.shape[1])
    ]
    count = max(values.shape[1] for values in gains.values())
    return scored.run(errors, listed, structures=dict(structures), seeds=list(range(count)))


NINE = {
    9: (0, 1, 2, 3, 4, 5, 6, 7, 8),
    7: (0, 0, 0, 1, 2, 3, 4, 5, 6),
    6: (0, 0, 0, 1, 1, 2, 3, 4, 5),
    4: (0, 0, 0, 0, 1, 1, 1, 2, 3),
}


@pytest.mark.parametrize(("count", "seeds"), [(9, 1), (7, 5), (6, 20), (4, 1)])
def test_no_difference_is_seldom_called_one(count: int, seeds: int) -> None:
    """The same on all but structures, cases and noise: 7 % of false alarms at most."""
    structures = NINE[count]
    random = np.random.default_rng([7, seeds, max(structures)])
    said = Counter(judged(drawn(random, structures, seeds)).verdict for _ in range(TRIALS))
    false = said["better"] + said["worse"]
    if count < 6:
        assert said == {"too few structures": TRIALS}
    else:
        # Five in a hundred are what the test allows itself: none at all would be a test asleep.
        assert 0 < false <= 0.07 * TRIALS


def test_a_true_difference_on_twelve_structures_is_found() -> None:
    random = np.random.default_rng(12)
    structures = (*range(12), 0, 0, 3)
    for effect, verdict in ((0.6, "better"), (-0.6, "worse")):
        said = Counter(judged(drawn(random, structures, 2, effect)).verdict for _ in range(100))
        assert said[verdict] >= 80
        assert said["worse" if verdict == "better" else "better"] == 0


def related(random: np.random.Generator, names: int, structures: int) -> FloatArray:
    """Return gains that share what a structure gives to all, (structures, names)."""
    gains = 0.3 * random.standard_normal((structures, 1))
    scale = random.uniform(0.05, 0.4, (structures, 1))  # structures differ in how much is at stake
    return np.asarray(gains + scale * random.standard_normal((structures, names)))


@pytest.mark.parametrize("better", [0, 4], ids=["complete", "partial"])
def test_a_family_errs_in_one_of_twenty(better: int) -> None:
    """Ten strategies without a difference, or six of them with four that are truly better."""
    random = np.random.default_rng([20, better])
    wrong = 0
    for _ in range(TRIALS):
        gains = related(random, 10, 10)
        gains[:, :better] += 3.0 * np.arange(1.0, better + 1.0)
        names = [f"s{k}" for k in range(10)]
        found = tell_apart(dict(zip(names, gains.T, strict=True)))
        null = set(names[better:])
        wrong += any(p < 0.05 and {a, b} <= null for a, b, p in found.pairs)
    assert 0.02 * TRIALS <= wrong <= 0.08 * TRIALS


def test_signs_are_counted_out_by_hand() -> None:
    """Of eight differences one has the other sign, at the smallest size."""
    sizes = np.array([0.5, 0.4, 0.3, 0.2, 0.1, 0.6, 0.7, -0.05])
    (p,) = flip_signs(sizes[:, None])
    signs = np.array(np.meshgrid(*[[1, -1]] * 8)).reshape(8, -1)
    assert p == pytest.approx(np.mean(np.abs(sizes @ signs) >= sizes.sum() - 1e-12))
    # A second comparison costs something, one without a difference nothing.
    both = flip_signs(np.column_stack([sizes, np.roll(sizes, 1) - 0.2]))
    assert both[0] > p
    assert flip_signs(np.column_stack([sizes, 0.0 * sizes])).tolist() == [p, 1.0]


@pytest.mark.parametrize("count", [6, 30])
def test_intervals_hold_the_truth_as_often_as_they_say(count: int) -> None:
    random = np.random.default_rng(count)
    held = 0
    for _ in range(TRIALS):
        low, high = interval_of_mean(random.normal(0.3, 0.4, count))
        held += low < 0.3 < high
    assert 0.92 * TRIALS <= held <= 0.98 * TRIALS


def test_a_structure_counts_once_whatever_its_cases_and_seeds() -> None:
    """Eight structures; one has five cases that all disagree with the seven others."""
    structures = {f"case-{c}": f"s{min(c, 7)}" for c in range(12)}
    gains = np.full((12, 4), 0.2)
    higher = gains.copy()
    higher[:7] = np.array([0.7, 0.6, 0.5, 0.4, 0.3, 0.8, 0.9])[:, None]
    higher[7:] = 0.15
    run = run_of({"a": gains, "b": higher}, structures)
    (found,) = compare_runs(run, run, against=Against("a", "b")).evidence
    assert (found.structures, found.differing) == (8, 8)
    # One of eight signs the wrong way, at the smallest size: 2 of 256 sums on either side.
    assert found.p == pytest.approx(4 / 256)
    assert found.verdict == "better"
    parts = [0.5, 0.4, 0.3, 0.2, 0.1, 0.6, 0.7, -0.05]
    assert found.difference == pytest.approx(np.mean(parts), rel=1e-9)
    # What the run does not say: every case is a structure of its own.
    silent = RunData({**run.meta, "structures": {}}, run.results)
    (found,) = compare_runs(silent, silent, against=Against("a", "b")).evidence
    assert found.structures == 12


TWENTY = {f"case-{c}": f"s{c}" for c in range(20)}


class TestBoard:
    def test_who_is_far_behind_is_shown_to_be_worse_and_equals_are_not(self) -> None:
        random = np.random.default_rng(3)
        means = {"best": 0.7, "as-good": 0.7, "behind": 0.4, "as-far": 0.4, "last": 0.1}
        gains = {n: mean + 0.05 * random.standard_normal((20, 1)) for n, mean in means.items()}
        rows = leaderboard(run_of(gains, TWENTY)).set_index("strategy")
        assert [set(rows.loc[name, "better_than"]) for name in means] == [
            {"behind", "as-far", "last"}, {"behind", "as-far", "last"}, {"last"}, {"last"}, set(),
        ]  # fmt: skip
        assert set(rows.loc["last", "worse_than"]) == {*means} - {"last"}


class TestGain:
    """The interval of a gain in the leaderboard."""

    def test_is_that_of_student_over_structures(self) -> None:
        """Gains that are normal, so that the interval of Student is the right one."""
        own = np.random.default_rng(1).normal(0.5, 0.1, 20)
        run = run_of({"a": own[:, None] + np.zeros((1, 2))}, TWENTY)
        assert Standings.interval_of(run) == "structures"
        (row,) = leaderboard(run).to_dict("records")
        assert row["gain"] == pytest.approx(own.mean())
        half = student.ppf(0.975, 19) * own.std(ddof=1) / np.sqrt(20)
        assert row["gain_low"] == pytest.approx(own.mean() - half, abs=0.1 * half)
        assert row["gain_high"] == pytest.approx(own.mean() + half, abs=0.1 * half)


class TestLabels:
    def test_a_run_carries_them_and_its_json_names_them_by_result(self) -> None:
        cases = [replace(toys.tiny_case(), structure="angle"), toys.tiny_case("other")]
        run = run_jobs(cases, [toys.Unchanged()], jobs=1)
        assert run.meta["structures"] == {"corner": "angle", "other": "other"}
        data = run_to_json(run)
        assert [result["structure"] for result in data["results"]] == ["angle", "other"]
        back = run_from_json(data)
        assert back.structures == run.meta["structures"]
        assert back.results == run.results

    def test_of_a_stored_run_are_checked(self) -> None:
        with pytest.raises(InputError, match=r"meta\.structures"):
            run_from_json({"meta": {"structures": {"corner": 3}}, "results": []})
