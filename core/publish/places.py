"""Who stands where, on all cases of the ranking and on those of one class of structures."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from femubench.core.publish.agreement import Outcome, References
from femubench.core.schema.results import BLOCKS, DONE, JobResult
from femubench.core.score.counting import block_shares
from femubench.core.score.ranking import geometric_mean, rank_items as in_order, score_of
from femubench.core.score.statistics import FEWEST, evidence_of, interval_over_structures

_FEWEST_OF_CLASS = 2  # structures; a class of one is its case


@dataclass(frozen=True)
class Scope:
    """What a ranking is on.

    Arguments:
        cases: of the ranking.
        current: digest of the files of every case.
        references: nominal errors.
        structures: by case; one that is not named is a structure of its own.
        kinds: classes of structure and of truth by case.
    """

    cases: tuple[str, ...]
    current: Mapping[str, str]
    references: References
    structures: Mapping[str, str]
    kinds: Mapping[str, Sequence[str]]

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """Return how much every block of every case counts."""
        known = {name: self.references[name, self.current[name]] for name in self.cases}
        return block_shares(known, self.structures)

    def has(self, case: tuple[str, str]) -> bool:
        """Tell whether a case, by name and digest, is the one of today."""
        return case[1] == self.current[case[0]]

    def counts(self, case: tuple[str, str]) -> bool:
        """Tell whether results on a case count."""
        return case[0] in self.cases and self.has(case)

    def owners(self, cases: Iterable[str]) -> dict[str, list[str]]:
        """Return the cases of every structure."""
        found: dict[str, list[str]] = {}
        for case in cases:
            found.setdefault(self.structures.get(case, case), []).append(case)
        return found

    def classes(self) -> Iterator[tuple[str, Scope]]:
        """Yield all, without a name, and every class that some structures have and others not."""
        yield "", self
        for kind in sorted({kind for case in self.cases for kind in self.kinds.get(case, ())}):
            cases = tuple(case for case in self.cases if kind in self.kinds.get(case, ()))
            if len(self.owners(cases)) >= _FEWEST_OF_CLASS and len(cases) < len(self.cases):
                yield kind, replace(self, cases=cases)


def board_on(ground: Scope, entrants: Mapping[str, Sequence[Outcome]]) -> dict[str, Any]:
    """Return the strategies on the cases of a ranking, best first, and how sure the best one is.

    Those that lack a case have no rank.

    Arguments:
        entrants: what was found of the latest version of every strategy.
    """
    rows = {}
    for name, findings in entrants.items():
        groups: dict[str, list[Outcome]] = {}
        for item in findings:
            case = item.result.case, str(item.result.provenance["case"])
            if ground.counts(case):
                groups.setdefault(case[0], []).append(item)
        rows[name] = [
            on_case(listed, ground.references[case, ground.current[case]], ground.shares.get(case))
            for case, listed in sorted(groups.items())
        ]
    figures = {name: gain_on(ground, counted) for name, counted in rows.items()}

    def order(name: str) -> tuple[tuple[float, ...], float, str]:
        row = figures[name]
        tier = not row["complete"], row["unphysical"], -row["covered"]
        return tier, 0.0 if row["gain"] is None else 1.0 - row["gain"], name

    listed = in_order(rows, order)
    sound = [n for _, n in listed if figures[n]["complete"] and not figures[n]["unphysical"]]
    # None where too few structures are there.
    logs = {name: logs_of(ground, rows[name]) for name in sound}
    best, *others = logs or [""]
    if not others or len(logs[best]) < FEWEST:
        below = None
    else:
        ratios = {n: [math.exp(logs[n][key] - logs[best][key]) for key in logs[n]] for n in others}
        below = frozenset(item.strategy for item in evidence_of(ratios) if item.verdict == "worse")
    return {
        "cases": list(ground.cases),
        "structures": len(ground.owners(ground.cases)),
        "tested": below is not None,
        "rows": [
            {
                "strategy": name,
                "rank": rank if figures[name]["complete"] else None,
                "below_best": None if below is None or name not in sound else name in below,
                **figures[name],
            }
            for rank, name in listed
        ],
    }


def logs_of(ground: Scope, counted: Iterable[Mapping[str, Any]]) -> dict[str, float]:
    """Return the logarithm of what is left of the error, by structure.

    Arguments:
        counted: results on cases, from `on_case`.
    """
    scores = {case["case"]: math.log(case["score"]) for case in counted}
    found = {}
    for owner, cases in ground.owners(scores).items():
        weights = [sum(ground.shares.get(case, {"": 1.0}).values()) for case in cases]
        if sum(weights):
            found[owner] = float(np.average([scores[case] for case in cases], weights=weights))
    return found


def gain_on(ground: Scope, counted: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return what results on cases come to: gain with its interval, errors, failures.

    Arguments:
        counted: from `on_case`, those that count.
    """
    weights = [sum(ground.shares.get(c["case"], {"": 1.0}).values()) for c in counted]
    complete = len(counted) == len(ground.cases) and bool(ground.cases)
    logs = list(logs_of(ground, counted).values())
    wide = complete and len(logs) >= FEWEST
    low, high = interval_over_structures(np.array(logs)) if wide else (None, None)
    left = geometric_mean([c["score"] for c in counted], weights) if sum(weights) else None
    return {
        "gain": None if left is None else 1.0 - left,
        "low": None if high is None else 1.0 - high,
        "high": None if low is None else 1.0 - low,
        **{
            name: _median(case[name] for case in counted)
            for name in (f"{block}_percent" for block in BLOCKS)
        },
        "seconds": _median(case["seconds"] for case in counted if case["status"] == "ok"),
        "covered": len(counted),
        "complete": complete,
        "unphysical": any(case["unphysical"] for case in counted),
        "failures": sum(case["status"] not in DONE for case in counted),
    }


def on_case(
    findings: Sequence[Outcome], reference: Mapping[str, float], shares: Mapping[str, float] | None
) -> dict[str, Any]:
    """Return the result on one case: of the data as recorded, or the median over noise draws."""
    recorded = [item for item in findings if item.result.seed == 0]
    listed = recorded[-1:] or list(findings)
    results = [item.result for item in listed]
    scores = [score_of(result, reference, shares) for result in results]
    failed = [result.status for result in results if result.status not in DONE]
    return {
        "case": results[0].case,
        "digest": str(results[0].provenance["case"]),
        "recorded": bool(recorded),
        "seeds": sorted({item.result.seed for item in findings}),
        "status": failed[0] if failed else results[0].status,
        "score": statistics.median(scores),
        **errors_of(results),
        "seconds": statistics.median(result.seconds for result in results),
        "unphysical": any(result.unphysical for result in results),
        "conflict": any(item.others for item in findings),
        "machines": min(item.machines for item in listed),
    }


def errors_of(results: Sequence[JobResult]) -> dict[str, float | None]:
    """Return the median error of every block."""
    return {
        f"{name}_percent": _median(r.blocks[name].rms_percent for r in results if name in r.blocks)
        for name in BLOCKS
    }


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None
