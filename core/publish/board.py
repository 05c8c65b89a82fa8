"""What a public leaderboard says: the latest version of every strategy, and those before it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, get_args

from femubench.core.errors import InputError
from femubench.core.publish.agreement import Outcome, findings_of, machine_of
from femubench.core.publish.news import news_of
from femubench.core.publish.places import Scope, board_on, counted_on, errors_of, gain_on, on_case
from femubench.core.publish.submissions import Proof, Submission, slug
from femubench.core.score.ranking import Scale
from femubench.core.score.repeatability import unsteady
from femubench.core.score.twin_gain import twin_gains

INDEX_SCHEMA = 4  # since runs have a proof
_PROOFS = get_args(Proof)  # less first


class _Version(NamedTuple):
    """A version of a strategy: of its package with a digest of the source, and of femubench."""

    strategy: str
    number: str
    femubench: str


def index_of(submissions: Sequence[Submission]) -> dict[str, Any]:
    """Return the content of ``index.json``, documented in docs/publish.md.

    Arguments:
        submissions: oldest first.

    Raises:
        InputError: when the runs do not share what they are measured against.
    """
    if len({item.run.meta.get("yardstick") or "drawn" for item in submissions}) > 1:
        what = "some runs are measured against the textbook models, others against the drawn ones"
        raise InputError(what, expected="one of both: run again with this version")
    scales = _choose_scales(submissions)
    findings = findings_of(submissions, scales)
    current = {name: case["digest"] for item in submissions for name, case in _cases(item).items()}
    groups: dict[_Version, list[Outcome]] = {}
    for one in findings:
        provenance = one.result.provenance
        number, own = str(provenance["strategy"]), str(provenance["femubench"])
        groups.setdefault(_Version(one.result.strategy, number, own), []).append(one)

    def age(version: _Version) -> tuple[tuple[str, str], _Version]:
        return max(run.order for one in groups[version] for run in one.runs), version

    # The version with the earliest last run comes first.
    versions = {version: groups[version] for version in sorted(groups, key=age)}
    latest = {version.strategy: version for version in versions}  # the last one stays
    ranked = _ranked_cases(latest.values(), versions, current)
    stated = _stated_in_runs(submissions, "structures"), _stated_in_runs(submissions, "classes")
    yardsticks = {
        name: str(said)
        for item in submissions
        for name, said in (item.run.meta.get("yardsticks") or {}).items()
    }
    ground = Scope(ranked, current, scales, *stated, yardsticks)
    runs = [
        {
            "file": f"data/{item.name}",
            "run": item.run.meta["run"],
            "started": item.started,
            "machine": dict(item.run.meta["machine"]),
            "versions": dict(item.run.meta["versions"]),
            "results": len(item.run.results),
            "strategies": len({result.strategy for result in item.run.results}),
            "proof": item.proof,
            "sandbox": item.run.meta.get("sandbox") or "",
        }
        for item in submissions
    ]
    described = {v: _describe(v, listed, ground) for v, listed in versions.items()}
    entrants = {name: versions[version] for name, version in latest.items()}
    boards = [
        {"class": name, "page": f"classes/{slug(name)}.html" if name else "index.html", **board}
        for name, part in ground.classes()
        for board in (board_on(part, entrants),)
    ]
    strategies = _strategy_entries(submissions, described, boards[0])
    return {
        "schema": INDEX_SCHEMA,
        "boards": boards,
        "cases": _case_entries(submissions, ground),
        "strategies": strategies,
        "conflicts": [_conflict(item) for item in findings if item.others],
        "runs": runs,
        "news": news_of(strategies, runs),
    }


def _cases(item: Submission) -> dict[str, dict[str, Any]]:
    """Return the cases that a run has results on."""
    used = {result.case for result in item.run.results}
    return {name: case for name, case in item.run.meta["cases"].items() if name in used}


def _choose_scales(submissions: Iterable[Submission]) -> dict[tuple[str, str], Scale]:
    """Return what results are measured by, by case and digest of its files.

    Of the runs, checked ones where there are any, the one whose textbook error is the median: no
    run alone can shift what all are measured by.
    """
    found: dict[tuple[str, str], list[tuple[bool, Scale]]] = {}
    for item in submissions:
        own = Scale.of(item.run.meta)
        for name, case in _cases(item).items():
            alone = replace(own, starts={})
            found.setdefault((name, case["digest"]), []).append((item.is_checked, alone))
    chosen = {}
    for (name, digest), listed in found.items():
        sure = [scale for checked, scale in listed if checked] or [scale for _, scale in listed]
        order = sorted(sure, key=lambda scale: scale.textbook[name].error)
        chosen[name, digest] = order[(len(order) - 1) // 2]
    return chosen


def _ranked_cases(
    latest: Iterable[_Version],
    versions: Mapping[_Version, Sequence[Outcome]],
    current: Mapping[str, str],
) -> tuple[str, ...]:
    """Return the cases that more than half of the strategies have: the ranking is on them.

    So a case that somebody adds does not leave all others without a rank.
    """
    listed = list(latest)
    counts = dict.fromkeys(current, 0)
    for version in listed:
        known = (item.result for item in versions[version])
        for case in {r.case for r in known if r.provenance["case"] == current[r.case]}:
            counts[case] += 1
    return tuple(sorted(case for case, count in counts.items() if 2 * count > len(listed)))


def _describe(version: _Version, findings: Sequence[Outcome], ground: Scope) -> dict[str, Any]:
    """Return a version with its results on every case and what they come to."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for item in findings:
        job = item.result.case, str(item.result.provenance["case"])
        groups.setdefault(job, []).append(item)
    cases = [
        {
            **on_case(listed, ground.scales[case]),
            "current": ground.has(case),
            "ranked": ground.counts(case),
        }
        for case, listed in sorted(groups.items())
    ]
    figures = gain_on(ground, version.strategy, counted_on(ground, findings))
    del figures["strategy"], figures["rank"]
    runs = sorted({run.order: run for item in findings for run in item.runs}.items())
    machines = {machine_of(run): run.run.meta["machine"] for _, run in runs}
    return {
        "marks": _marks(version.strategy, findings),
        "version": version.number,
        "femubench": version.femubench,
        "first": runs[0][1].started,
        "last": runs[-1][1].started,
        "machines": [machines[key] for key in sorted(machines)],
        "runs": [run.name for _, run in runs],
        **figures,
        "conflicts": sum(bool(item.others) for item in findings),
        "comparable": figures["covered"] > 0,
        "cases": cases,
    }


def _marks(strategy: str, findings: Iterable[Outcome]) -> list[str]:
    """Return what a reader has to know of a version: who vouches for it, and what is odd."""
    listed = list(findings)
    runs = {run.name: run for item in listed for run in item.runs}.values()
    # The best that each result has, and the worst of these.
    best = (max((run.proof for run in item.runs), key=_PROOFS.index) for item in listed)
    proof = min(best, key=_PROOFS.index, default="recomputed")
    marks: list[str] = [proof]
    twins = [twin_gains(run.run).get(strategy) for run in runs]
    if not any(twins):
        marks.append("no twins")
    if any(found is not None and found.suspicious for found in twins):
        marks.append("knows the cases?")
    if any(strategy in unsteady(run.run) for run in runs):
        marks.append("two answers to one job")
    return marks


def _stated_in_runs(submissions: Iterable[Submission], what: str) -> dict[str, Any]:
    """Return what the runs say of their cases; the first that says something counts."""
    found: dict[str, Any] = {}
    for item in submissions:
        said = item.run.structures if what == "structures" else item.run.meta.get(what) or {}
        for name in _cases(item):
            if said.get(name):
                found.setdefault(name, said[name])
    return found


def _strategy_entries(
    submissions: Iterable[Submission],
    described: Mapping[_Version, dict[str, Any]],
    board: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """Return the strategies, best first, as on the board of all cases."""
    citations: dict[str, str] = {}
    about: dict[str, dict[str, str]] = {}
    for item in submissions:
        citations.update(item.run.meta["citations"])
        about.update(item.run.meta.get("about") or {})
    return [
        {
            "name": name,
            "citation": citations.get(name, ""),
            "about": about.get(name, {}),
            "page": f"strategies/{slug(name)}.html",
            "rank": row["rank"],
            "cases": len(board["cases"]),
            "versions": [own for key, own in described.items() if key.strategy == name][::-1],
        }
        for row in board["rows"]
        for name in (row["strategy"],)
    ]


def _case_entries(submissions: Iterable[Submission], ground: Scope) -> list[dict[str, Any]]:
    titles: dict[str, str] = {}
    digests: dict[str, dict[str, None]] = {}
    for item in submissions:
        for name, case in _cases(item).items():
            titles[name] = case["title"] or ""
            digests.setdefault(name, {})[case["digest"]] = None
    return [
        {
            "name": name,
            "title": titles[name],
            "page": f"cases/{slug(name)}.html",
            "digest": digest,
            "older": [old for old in digests[name] if old != digest],
            "classes": list(ground.kinds.get(name, ())),
            "ranked": name in ground.cases,
            "nominal_percent": {
                block: found.rms_percent
                for block, found in ground.scales[name, digest].blocks[name].items()
            },
        }
        for name, digest in sorted(ground.current.items())
    ]


def _conflict(item: Outcome) -> dict[str, Any]:
    result = item.result
    return {
        "case": result.case,
        "strategy": result.strategy,
        "seed": result.seed,
        "key": result.key,
        "results": [
            {
                "counted": number == 0,
                "status": other.result.status,
                **errors_of([other.result]),
                "runs": [run.name for run in other.runs],
                "machines": [dict(run.run.meta["machine"]) for run in other.runs],
            }
            for number, other in enumerate((item, *item.others))
        ],
    }
