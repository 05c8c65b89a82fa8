"""What a public leaderboard says: the latest version of every strategy, and those before it."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from femubench.core.errors import InputError
from femubench.core.publish.agreement import Finding, References, findings_of, machine_of
from femubench.core.publish.submissions import Submission, slug
from femubench.core.schema.results import BLOCKS, DONE, JobResult
from femubench.core.score.counting import block_shares
from femubench.core.score.ranking import geometric_mean, ranked as in_order, score_of
from femubench.core.score.repeatability import unsteady
from femubench.core.score.statistics import structures_of
from femubench.core.score.twin_skill import twin_skills

INDEX_SCHEMA = 2  # since more skill is better


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
    references = _references(submissions)
    findings = findings_of(submissions, references)
    current = {name: case["digest"] for item in submissions for name, case in _cases(item).items()}
    versions = _versions(findings)
    latest = {version.strategy: version for version in versions}  # the last one stays
    ranked = _ranked(latest.values(), versions, current)
    structures: dict[str, str] = {}
    for item in submissions:
        own = structures_of(item.run)
        for name in _cases(item):
            structures.setdefault(name, own.get(name, name))
    described = {
        version: _described(version, listed, current, ranked, references, structures)
        for version, listed in versions.items()
    }
    return {
        "schema": INDEX_SCHEMA,
        "cases": _case_entries(submissions, current, ranked, references),
        "strategies": _strategy_entries(submissions, latest, described, ranked),
        "conflicts": [_conflict(item) for item in findings if item.conflict],
        "runs": [_run_entry(item) for item in submissions],
    }


def _cases(item: Submission) -> dict[str, dict[str, Any]]:
    """Return the cases that a run has results on."""
    used = {result.case for result in item.run.results}
    return {name: case for name, case in item.run.meta["cases"].items() if name in used}


def _references(submissions: Iterable[Submission]) -> dict[tuple[str, str], dict[str, float]]:
    """Return the nominal errors by case and digest: the median of what the runs found."""
    found: dict[tuple[str, str], dict[str, list[float]]] = {}
    for item in submissions:
        for name, case in _cases(item).items():
            blocks = found.setdefault((name, case["digest"]), {})
            for block, value in item.run.meta["reference"][name].items():
                blocks.setdefault(block, []).append(value)
    return {
        case: {name: statistics.median(blocks[name]) for name in BLOCKS if name in blocks}
        for case, blocks in found.items()
    }


def _versions(findings: Iterable[Finding]) -> dict[_Version, list[Finding]]:
    """Return the findings of every version, the version with the earliest last run first."""
    groups: dict[_Version, list[Finding]] = {}
    for item in findings:
        provenance = item.result.provenance
        number, own = str(provenance["strategy"]), str(provenance["femubench"])
        groups.setdefault(_Version(item.result.strategy, number, own), []).append(item)

    def age(version: _Version) -> tuple[tuple[str, str], _Version]:
        return max(run.order for item in groups[version] for run in item.runs), version

    return {version: groups[version] for version in sorted(groups, key=age)}


def _ranked(
    latest: Iterable[_Version],
    versions: Mapping[_Version, Sequence[Finding]],
    current: Mapping[str, str],
) -> tuple[str, ...]:
    """Return the cases that more than half of the strategies have: the ranking is on them.

    So a case that somebody adds does not leave all others without a rank.
    """
    listed = list(latest)
    counts = dict.fromkeys(current, 0)
    for version in listed:
        for case in {item.result.case for item in versions[version] if _is_current(item, current)}:
            counts[case] += 1
    return tuple(sorted(case for case, count in counts.items() if 2 * count > len(listed)))


def _is_current(item: Finding, current: Mapping[str, str]) -> bool:
    return bool(item.result.provenance["case"] == current[item.result.case])


def _described(
    version: _Version,
    findings: Sequence[Finding],
    current: Mapping[str, str],
    ranked: Sequence[str],
    references: References,
    structures: Mapping[str, str],
) -> dict[str, Any]:
    """Return a version with its results on every case and what they come to."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for item in findings:
        job = item.result.case, str(item.result.provenance["case"])
        groups.setdefault(job, []).append(item)
    known = {name: references[name, digest] for name, digest in groups if digest == current[name]}
    known = {name: errors for name, errors in known.items() if name in ranked}
    shares = block_shares(known, structures)
    cases = [
        {
            **_on_case(listed, references[case], shares.get(case[0])),
            "current": case[1] == current[case[0]],
            "ranked": case[1] == current[case[0]] and case[0] in ranked,
        }
        for case, listed in sorted(groups.items())
    ]
    counted = [case for case in cases if case["ranked"]]
    weights = [sum(shares.get(case["case"], {"": 1.0}).values()) for case in counted]
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
        "skill": 1.0 - geometric_mean([c["score"] for c in counted], weights) if counted else None,
        **{f"{name}_percent": _median(counted, f"{name}_percent") for name in BLOCKS},
        "seconds": _median([c for c in counted if c["status"] == "ok"], "seconds"),
        "covered": len(counted),
        "complete": len(counted) == len(ranked) and bool(ranked),
        "unphysical": any(case["unphysical"] for case in counted),
        "failures": sum(case["status"] not in DONE for case in counted),
        "conflicts": sum(item.conflict for item in findings),
        "comparable": bool(counted),
        "cases": cases,
    }


def _marks(strategy: str, findings: Iterable[Finding]) -> list[str]:
    """Return what a reader has to know of a version: who vouches for it, and what is odd."""
    listed = list(findings)
    runs = {run.name: run for item in listed for run in item.runs}.values()
    marks = []
    if not all(any(run.verified for run in item.runs) for item in listed):
        marks.append("unverified")
    twins = [twin_skills(run.run).get(strategy) for run in runs]
    if any(found is not None and found.suspicious for found in twins):
        marks.append("knows the cases?")
    if any(strategy in unsteady(run.run) for run in runs):
        marks.append("two answers to one job")
    return marks


def _on_case(
    findings: Sequence[Finding], reference: Mapping[str, float], shares: Mapping[str, float] | None
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
        **_errors(results),
        "seconds": statistics.median(result.seconds for result in results),
        "unphysical": any(result.unphysical for result in results),
        "conflict": any(item.conflict for item in findings),
        "machines": min(item.machines for item in listed),
    }


def _errors(results: Sequence[JobResult]) -> dict[str, float | None]:
    """Return the median error of every block."""
    return {
        f"{name}_percent": _middle(
            [r.blocks[name].rms_percent for r in results if name in r.blocks]
        )
        for name in BLOCKS
    }


def _middle(values: Sequence[float]) -> float | None:
    return statistics.median(values) if values else None


def _median(cases: Iterable[Mapping[str, Any]], name: str) -> float | None:
    return _middle([case[name] for case in cases if case[name] is not None])


def _strategy_entries(
    submissions: Iterable[Submission],
    latest: Mapping[str, _Version],
    described: Mapping[_Version, dict[str, Any]],
    ranked: Sequence[str],
) -> list[dict[str, Any]]:
    """Return the strategies, best first; those that lack a case have no rank."""
    citations: dict[str, str] = {}
    for item in submissions:
        citations.update(item.run.meta["citations"])

    def order(name: str) -> tuple[tuple[float, ...], float, str]:
        row = described[latest[name]]
        tier = not row["complete"], row["unphysical"], -row["covered"]
        return tier, 0.0 if row["skill"] is None else 1.0 - row["skill"], name

    return [
        {
            "name": name,
            "citation": citations.get(name, ""),
            "page": f"strategies/{slug(name)}.html",
            "rank": rank if described[latest[name]]["complete"] else None,
            "cases": len(ranked),
            "versions": [row for own, row in described.items() if own.strategy == name][::-1],
        }
        for rank, name in in_order(latest, order)
    ]


def _case_entries(
    submissions: Iterable[Submission],
    current: Mapping[str, str],
    ranked: Sequence[str],
    references: References,
) -> list[dict[str, Any]]:
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
            "ranked": name in ranked,
            "nominal_percent": dict(references[name, digest]),
        }
        for name, digest in sorted(current.items())
    ]


def _conflict(item: Finding) -> dict[str, Any]:
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
                **_errors([other.result]),
                "runs": [run.name for run in other.runs],
                "machines": [dict(run.run.meta["machine"]) for run in other.runs],
            }
            for number, other in enumerate((item, *item.others))
        ],
    }


def _run_entry(item: Submission) -> dict[str, Any]:
    meta = item.run.meta
    return {
        "file": f"data/{item.name}",
        "run": meta["run"],
        "started": item.started,
        "machine": dict(meta["machine"]),
        "versions": dict(meta["versions"]),
        "results": len(item.run.results),
        "strategies": len({result.strategy for result in item.run.results}),
        "verified": item.verified,
    }
