"""What a comparison of two runs says, in plain data."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import geometric_mean, mean
from typing import Any, Literal, get_args

from femubench.core.errors import InputError
from femubench.core.schema.results import BLOCKS, DONE, NOMINALS, JobResult, Nominal, RunData
from femubench.core.score.ranking import Scale
from femubench.core.score.repeatability import environment_differences
from femubench.core.score.statistics import Significance, weigh_evidence

Metric = Literal["loss", "used", "higher", "modified", "seconds", "failures"]
METRICS: tuple[Metric, ...] = get_args(Metric)
Kind = Literal["lost", "gained", "other"]
SCHEMA = 4


@dataclass(frozen=True)
class Threshold:
    """The largest value of a metric that is still accepted.

    Arguments:
        metric: ``loss`` of gain, that in A less that in B; a ratio B / A of errors or of seconds;
            or ``failures``, the number of results that B lost.
        most: exceeded means worse.
    """

    metric: Metric
    most: float


DEFAULT_THRESHOLDS = (Threshold("loss", 0.01), Threshold("failures", 0.0))


@dataclass(frozen=True)
class NamedJob:
    """A job by its names."""

    strategy: str
    case: str
    seed: int


@dataclass(frozen=True)
class StatusChange(NamedJob):
    """A job that ended otherwise in B.

    Arguments:
        kind: ``lost`` (a sound result before, none now), ``gained`` or ``other``.
        before, after: status; ``unphysical`` for a model that lost rigid-body modes or has
            negative eigenvalues.
        reason: of the one that is no sound result.
    """

    kind: Kind
    before: str
    after: str
    reason: str


@dataclass(frozen=True)
class RatioRow:
    """Loss of gain and ratios B / A of one strategy in one scenario; less is better in B.

    Arguments:
        scenario: None for all of them together.
        jobs: that both runs have.
        values: by metric; None where nothing can be said.
    """

    strategy: str
    scenario: str | None
    jobs: int
    values: Mapping[str, float | None]


@dataclass(frozen=True)
class Excess:
    """A value beyond its threshold."""

    strategy: str
    scenario: str | None
    metric: Metric
    value: float
    most: float


@dataclass(frozen=True)
class Against:
    """A strategy of A and the one of B that is compared with it."""

    before: str
    after: str


@dataclass(frozen=True)
class Comparison:
    """Run B against run A.

    Arguments:
        before, after: names of the runs.
        against: strategies compared under two names; elsewhere they have that of B.
        jobs: number that both have.
        changes: what ended otherwise, lost results first.
        rows: by strategy, all scenarios first.
        evidence: of every strategy.
        only_before, only_after: jobs of one run alone.
        other_cases: jobs of one name on case files that are not the same; not compared.
        environment: what differs between the machines, a line each.
        notes: what was left out of either run since it is damaged, a line each.
        thresholds, excesses: what was asked for, and what lies beyond it.
        untested: metrics with a threshold for which no job has a value.
    """

    before: str
    after: str
    against: tuple[Against, ...]
    jobs: int
    changes: tuple[StatusChange, ...]
    rows: tuple[RatioRow, ...]
    evidence: tuple[Significance, ...]
    only_before: tuple[NamedJob, ...]
    only_after: tuple[NamedJob, ...]
    other_cases: tuple[NamedJob, ...]
    environment: tuple[str, ...]
    notes: tuple[str, ...]
    thresholds: tuple[Threshold, ...]
    excesses: tuple[Excess, ...]
    untested: tuple[str, ...]

    @property
    def worse(self) -> bool:
        """Tell whether something got worse beyond its threshold."""
        return bool(self.excesses)

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as plain data with its schema."""
        return {"schema": SCHEMA, "worse": self.worse, **asdict(self)}


_ROUNDING = 1e-9  # relative; two machines may differ by it
_OFFSET_PERCENT = 0.05  # added to both errors of a ratio: one that is met must not decide it


@dataclass(frozen=True)
class _JobPair:
    """One job in both runs, and the gain that B lost; None on a case that does not count."""

    strategy: str
    before: JobResult
    after: JobResult
    loss: float | None

    @property
    def blocks(self) -> dict[str, float]:
        """Return the ratio of the errors of every block that both have."""
        first, second = self.before.blocks, self.after.blocks
        return {
            name: (second[name].rms_percent + _OFFSET_PERCENT)
            / (first[name].rms_percent + _OFFSET_PERCENT)
            for name in BLOCKS
            if name in first and name in second
        }


def compare_runs(
    before: RunData,
    after: RunData,
    *,
    thresholds: Sequence[Threshold] = DEFAULT_THRESHOLDS,
    strategies: Iterable[str] = (),
    against: Against | None = None,
) -> Comparison:
    """Return what run `after` (B) does otherwise than run `before` (A).

    Strategies are compared by their names. Where each run has one strategy, and where each has one
    variant of a strategy that the other run lacks, these two are compared.

    Arguments:
        thresholds: what counts as worse.
        strategies: those to compare; all where there are none.
        against: one strategy of each to compare, and nothing else; the runs may then be the same.

    Raises:
        InputError: when the runs have no job in common.
    """
    names = _names(_strategies(before), _strategies(after), against)
    chosen = frozenset(strategies)
    names = {a: b for a, b in names.items() if not chosen or {a, b} & chosen}
    nominal = _common_start(before, after)
    old = _by_job(before.started_from(nominal), names)
    new = _by_job(after.started_from(nominal), {b: b for b in names.values()})
    shared = [job for job in old if job in new]
    # One name may stand for two different cases.
    digests = ((job, _digest(before, old[job]), _digest(after, new[job])) for job in shared)
    other = [job for job, first, second in digests if first and second and first != second]
    shared = [job for job in shared if job not in set(other)]
    if not shared:
        expected = "one (case, strategy, seed) with the same case files"
        raise InputError("the two runs have no job in common", expected=expected)
    scale, structures = Scale.of(before.meta), {**after.structures, **before.structures}
    held = {job.case for job in shared if scale.holds_back(job.case)}
    pairs = [
        _JobPair(j.strategy, old[j], new[j], _lost_gain(scale, old[j], new[j], held))
        for j in shared
    ]
    rows = tuple(_rows(pairs, structures))
    excesses = (
        Excess(row.strategy, row.scenario, t.metric, value, t.most)
        for t in thresholds
        for row in rows
        if (value := row.values[t.metric]) is not None and value > t.most + _ROUNDING * abs(t.most)
    )
    stated = (t.metric for t in thresholds if all(row.values[t.metric] is None for row in rows))
    ran = list(dict.fromkeys(pair.strategy for pair in pairs))
    losses = {n: _by_structure((p for p in pairs if p.strategy == n), structures) for n in ran}
    evidence = weigh_evidence({name: [-lost for lost in own] for name, own in losses.items()})
    return Comparison(
        before=str(before.meta.get("run") or "A"),
        after=str(after.meta.get("run") or "B"),
        against=tuple(Against(a, b) for a, b in names.items() if a != b),
        jobs=len(pairs),
        changes=_changes(pairs),
        rows=rows,
        evidence=evidence,
        only_before=tuple(job for job in old if job not in new),
        only_after=tuple(job for job in new if job not in old),
        other_cases=tuple(other),
        environment=tuple(environment_differences(_safe(before.meta), _safe(after.meta))),
        notes=tuple(dict.fromkeys((*_notes(before), *_notes(after)))),
        thresholds=tuple(thresholds),
        excesses=tuple(excesses),
        untested=tuple(stated),
    )


def _lost_gain(
    scale: Scale, before: JobResult, after: JobResult, held: Collection[str]
) -> float | None:
    """Return what B gains less than A; None on a case without unseen data where others have some.

    A job without a possible model counts as the one that was given.
    """
    if held and before.case not in held:
        return None
    gains = (scale.gain(r.case, scale.errors(r)).gain for r in (before, after))
    lost = next(gains) - next(gains)
    return None if math.isnan(lost) else lost


def _by_structure(pairs: Iterable[_JobPair], structures: Mapping[str, str]) -> list[float]:
    """Return the mean loss of every structure, over seeds and then over its cases."""
    found: dict[str, dict[str, list[float]]] = {}
    for pair in pairs:
        if pair.loss is not None:
            case = pair.before.case
            found.setdefault(structures.get(case, case), {}).setdefault(case, []).append(pair.loss)
    return [mean(map(mean, cases.values())) for cases in found.values()]


def _notes(run: RunData) -> list[str]:
    stated = run.meta.get("notes")
    return list(map(str, stated)) if isinstance(stated, (list, tuple)) else []


def _common_start(before: RunData, after: RunData) -> Nominal:
    """Return the nominal model from which both runs start, the one that ranks before the other.

    Raises:
        InputError: when there is none.
    """
    for nominal in reversed(NOMINALS):
        if nominal in before.nominals and nominal in after.nominals:
            return nominal
    for nominal in reversed(NOMINALS):
        if before.started_from(nominal) and after.started_from(nominal):
            return nominal
    starts = " and ".join(f"the {run.nominals[0]} models" for run in (before, after))
    raise InputError(f"the two runs start from {starts}", expected="one nominal model in both")


def _by_job(results: Iterable[JobResult], names: Mapping[str, str]) -> dict[NamedJob, JobResult]:
    """Return the results by job, under the strategy's name in B where A has another."""
    chosen = (r for r in results if r.strategy in names)
    return {NamedJob(names[r.strategy], r.case, r.seed): r for r in chosen}


def _strategies(run: RunData) -> list[str]:
    return list(dict.fromkeys(result.strategy for result in run.results))


def _names(old: Sequence[str], new: Sequence[str], against: Against | None) -> dict[str, str]:
    """Return from the strategies of A to those of B with which they are compared.

    A strategy that the other run does not have stands for itself.
    """
    if against is not None:
        return {against.before: against.after}
    if len(old) == len(new) == 1:
        return {old[0]: new[0]}
    names = {name: name for name in (*old, *new)}
    for base in dict.fromkeys(name.partition(":")[0] for name in old):
        alone = [
            [n for n in mine if n not in other and n.partition(":")[0] == base]
            for mine, other in ((old, new), (new, old))
        ]
        if len(alone[0]) == len(alone[1]) == 1:
            names[alone[0][0]] = alone[1][0]
    return names


def _digest(run: RunData, result: JobResult) -> str:
    """Return the digest of the case files of a result, nothing where it is not known."""
    listed = (run.meta.get("cases") or {}).get(result.case) or {}
    return str(result.provenance.get("case") or listed.get("digest") or "")


def _safe(meta: Mapping[str, Any]) -> dict[str, Any]:
    """Return the meta data with nothing in place of what a third party wrote for a table."""
    return {
        name: value
        for name, value in meta.items()
        if name not in ("versions", "machine", "cases") or isinstance(value, dict)
    }


def _state(result: JobResult) -> str:
    return "unphysical" if result.unphysical else result.status


def _changes(pairs: Iterable[_JobPair]) -> tuple[StatusChange, ...]:
    found = []
    for pair in pairs:
        before, after = _state(pair.before), _state(pair.after)
        if before == after:
            continue
        kind: Kind = "other"
        if (before in DONE) != (after in DONE):
            kind = "lost" if before in DONE else "gained"
        result = pair.before if kind == "gained" else pair.after
        reason = result.reason or ("" if not result.unphysical else _damage(result))
        job = pair.strategy, result.case, result.seed
        found.append(StatusChange(*job, kind, before, after, reason))
    return tuple(sorted(found, key=lambda change: get_args(Kind).index(change.kind)))


def _damage(result: JobResult) -> str:
    counts = {
        "rigid-body modes lost": result.rigid_modes_lost,
        "eigenvalues < 0": result.negative_eigenvalues or 0,
    }
    return ", ".join(f"{number} {what}" for what, number in counts.items() if number)


def _rows(pairs: Iterable[_JobPair], structures: Mapping[str, str]) -> Iterable[RatioRow]:
    groups: dict[str, dict[str | None, list[_JobPair]]] = {}
    for pair in pairs:
        group = groups.setdefault(pair.strategy, {None: []})
        group[None].append(pair)
        group.setdefault(pair.before.case.partition("/")[0], []).append(pair)
    for strategy, scenarios in groups.items():
        for scenario, listed in scenarios.items():
            losses = _by_structure(listed, structures)
            values: dict[str, float | None] = {"loss": mean(losses) if losses else None}
            for block in BLOCKS:
                errors = [pair.blocks[block] for pair in listed if block in pair.blocks]
                values[block] = geometric_mean(errors) if errors else None
            timed = [pair for pair in listed if pair.before.status == pair.after.status == "ok"]
            total = sum(pair.before.seconds for pair in timed)
            ratio = sum(pair.after.seconds for pair in timed) / total if total > 0.0 else math.inf
            values["seconds"] = ratio if math.isfinite(ratio) else None
            values["failures"] = float(sum(change.kind == "lost" for change in _changes(listed)))
            yield RatioRow(strategy, scenario, len(listed), values)
