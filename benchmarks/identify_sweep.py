"""Print how `bench identify` does on synthetic sets: python -m benchmarks.identify_sweep."""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

from femubench import identify
from tests.frf_problems import frf_set
from tests.identify_score import NAMES, Score, covered, score


def one(job: tuple[int, int]) -> Score:
    """Return the score of one set."""
    seed, references = job
    truth = frf_set(seed, references=references)
    return score(truth, identify(truth.measured))


def main() -> None:
    """Print one row a number of driven points."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--first", type=int, default=1000)
    words.add_argument("--sets", type=int, default=100)
    words.add_argument("--references", type=int, nargs="+", default=[3, 2, 1])
    words.add_argument("--jobs", type=int, default=2)
    given = words.parse_args()
    seeds = range(given.first, given.first + given.sets)
    for references in given.references:
        with ProcessPoolExecutor(given.jobs) as pool:
            scores = list(pool.map(one, [(seed, references) for seed in seeds]))
        found = sum(item.missed == 0 for item in scores)
        within = sum(item.within for item in scores)
        extra = sum(item.extra for item in scores)
        missed = sum(item.missed for item in scores)
        shares = ", ".join(f"{name} {100.0 * covered(scores, name):.1f} %" for name in NAMES)
        worst = max(item.frequency_percent for item in scores)
        least = min(item.mac for item in scores)
        print(
            f"{references} forces: {found} of {len(scores)} sets with all modes, {within} within "
            f"the bounds, {missed} modes missed, {extra} invented; worst frequency {worst:.4f} %, "
            f"least MAC {least:.5f}; 90 % intervals cover {shares}",
            flush=True,
        )


if __name__ == "__main__":
    main()
