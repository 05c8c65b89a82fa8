"""Who stands where, on all cases of the ranking and on those of one class of structures."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from femubench.core.publish.agreement import Outcome, Scales
from femubench.core.schema.results import BLOCKS, DONE, JobResult, RunData, origins_of
from femubench.core.score.bounded_gain import Rule
from femubench.core.score.leaderboard import list_rows, row_of
from femubench.core.score.ranking import Scale, list_models

_FEWEST_OF_CLASS = 2  # structures; a class of one is its case
# Of a row of a leaderboard, under the same names; the rest of the site's rows is their own.
FIGURES = (
    *("gain", "error_percent", "textbook_percent", "better_share", "worse_share", "error_gain"),
    *("change_gain", "band_percent", "shape_error", "false_modes", "gain_tests"),
    *(f"{block}_percent" for block in BLOCKS),
    "seconds",
)


@dataclass(frozen=True)
class Scope:
    """What a ranking is on.

    Arguments:
        current: digest of the files of every case.
        scales: what results on a case are measured by.
        structures: by case; one that is not named is a structure of its own.
        kinds: classes of structure and of truth by case.
        yardsticks: strategies without rank, and what they stand for.
    """

    cases: tuple[str, ...]
    current: Mapping[str, str]
    scales: Scales
    structures: Mapping[str, str]
    kinds: Mapping[str, Sequence[str]]
    yardsticks: Mapping[str, str]

    def has(self, case: tuple[str, str]) -> bool:
        """Tell whether a case, by name and digest, is the one of today."""
        return case[1] == self.current[case[0]]

    def counts(self, case: tuple[str, str]) -> bool:
        """Tell whether results on a case count."""
        return case[0] in self.cases and self.has(case)

    @property
    def owners(self) -> int:
        """Return the number of structures."""
        return len({self.structures.get(case, case) for case in self.cases})

    def classes(self) -> Iterator[tuple[str, Scope]]:
        """Yield all, without a name, and every class that some structures have and others not."""
        yield "", self
        for kind in sorted({kind for case in self.cases for kind in self.kinds.get(case, ())}):
            part = replace(
                self, cases=tuple(c for c in self.cases if kind in self.kinds.get(c, ()))
            )
            if part.owners >= _FEWEST_OF_CLASS and len(part.cases) < len(self.cases):
                yield kind, part


def board_on(ground: Scope, entrants: Mapping[str, Sequence[Outcome]]) -> dict[str, Any]:
    """Return the strategies on the cases of a ranking, best first.

    Those that lack a case have no rank.

    Arguments:
        entrants: what was found of the latest version of every strategy.
    """
    counted = {name: counted_on(ground, findings) for name, findings in entrants.items()}
    whole = {name: own for name, own in counted.items() if len(own) == len(ground.cases) > 0}
    rows = list_rows(run_on(ground, whole)) if whole else []
    listed = [_stated(row["strategy"], row, counted[row["strategy"]], ground) for row in rows]
    lacking = [gain_on(ground, name, own) for name, own in counted.items() if name not in whole]
    lacking.sort(key=lambda row: (-row["covered"], -(row["gain"] or 0.0), row["strategy"]))
    return {"cases": list(ground.cases), "structures": ground.owners, "rows": [*listed, *lacking]}


def counted_on(ground: Scope, findings: Iterable[Outcome]) -> dict[str, list[Outcome]]:
    """Return what counts by case: the data as recorded or, without these, all draws of noise."""
    groups: dict[str, list[Outcome]] = {}
    for item in findings:
        if ground.counts((item.result.case, str(item.result.provenance["case"]))):
            groups.setdefault(item.result.case, []).append(item)
    return {case: _recorded(groups[case]) for case in sorted(groups)}


def gain_on(
    ground: Scope, strategy: str, counted: Mapping[str, Sequence[Outcome]]
) -> dict[str, Any]:
    """Return the row of one strategy on the cases that it has, without a rank.

    Arguments:
        counted: from `counted_on`.
    """
    part = replace(ground, cases=tuple(counted))
    row = row_of(run_on(part, {strategy: counted}), strategy) if counted else {}
    return _stated(strategy, {**row, "rank": None, "better_than": (), "worse_than": ()},
                   counted, ground)  # fmt: skip


def run_on(ground: Scope, counted: Mapping[str, Mapping[str, Sequence[Outcome]]]) -> RunData:
    """Return what counts of several runs as one, in which the draws of a case are averaged."""
    results, companions = [], {}
    twins: dict[str, dict[str, Any]] = {"of": {}, "kinds": {}, "models": {}}
    for name, by_case in counted.items():
        for outcome in (one for listed in by_case.values() for one in listed):
            results.append(replace(outcome.result, strategy=name, seed=0, nominal="textbook"))
            for item in outcome.runs:
                for own, origin in origins_of(item.run.meta, "of").items():
                    if origin != outcome.result.case:
                        continue
                    label = f"{own} of {item.name}"  # every run draws twins of its own
                    stated = item.run.meta["twins"]
                    models = stated["models"][own]
                    twins["of"][label] = origin
                    twins["kinds"][label] = (stated.get("kinds") or {}).get(own, [])
                    twins["models"][label] = {"textbook": next(iter(models.values()))}
                    for r in item.run.companions:
                        if (r.case, r.strategy) == (own, name):
                            moved = replace(r, case=label, seed=0, nominal="textbook")
                            companions[name, label, r.seed] = moved
    models = {c: ground.scales[c, ground.current[c]].blocks[c] for c in ground.cases}
    meta = {
        "rule": Rule().to_json(),
        "yardstick": "textbook",
        "models": list_models({case: {"textbook": blocks} for case, blocks in models.items()}),
        "structures": ground.structures,
        "classes": ground.kinds,
        "seeds": [0],
        "strategies": list(counted),
        "yardsticks": ground.yardsticks,
        **({"twins": twins} if companions else {}),
    }
    return RunData(meta, tuple(results), tuple(companions.values()))


def on_case(findings: Sequence[Outcome], scale: Scale) -> dict[str, Any]:
    """Return the result on one case: of the data as recorded, or of the noise draws."""
    listed = _recorded(findings)
    results = [item.result for item in listed]
    gains = [scale.gain(r.case, scale.errors(r)).gain for r in results]
    failed = [result.status for result in results if result.status not in DONE]
    return {
        "case": results[0].case,
        "digest": str(results[0].provenance["case"]),
        "recorded": any(item.result.seed == 0 for item in findings),
        "seeds": sorted({item.result.seed for item in findings}),
        "status": failed[0] if failed else results[0].status,
        "gain": statistics.fmean(gains),
        **errors_of(results),
        "seconds": statistics.median(result.seconds for result in results),
        "unphysical": any(result.unphysical for result in results),
        "conflict": any(item.others for item in findings),
        "machines": min(item.machines for item in listed),
    }


def errors_of(results: Sequence[JobResult]) -> dict[str, float | None]:
    """Return the median error of every block."""
    known = {n: [r.blocks[n].rms_percent for r in results if n in r.blocks] for n in BLOCKS}
    return {f"{n}_percent": statistics.median(own) if own else None for n, own in known.items()}


def _recorded(findings: Sequence[Outcome]) -> list[Outcome]:
    return [item for item in findings if item.result.seed == 0][-1:] or list(findings)


def _stated(
    strategy: str, row: Mapping[str, Any], counted: Mapping[str, Sequence[Outcome]], ground: Scope
) -> dict[str, Any]:
    """Return a row of a leaderboard as the site has it; null for what is not known."""

    def known(name: str) -> float | None:
        value = row.get(name)
        return None if value is None or value != value else value

    results = [outcome.result for listed in counted.values() for outcome in listed]
    return {
        "strategy": strategy,
        "rank": row["rank"],
        "yardstick": ground.yardsticks.get(strategy, ""),
        **{name: known(name) for name in FIGURES},
        "low": known("gain_low"),
        "high": known("gain_high"),
        "better_than": list(row["better_than"]),
        "worse_than": list(row["worse_than"]),
        "covered": len(counted),
        "complete": len(counted) == len(ground.cases) > 0,
        "answered": sum(all(o.result.answered for o in listed) for listed in counted.values()),
        "unphysical": any(result.unphysical for result in results),
        "failures": sum(result.status not in DONE for result in results),
    }
