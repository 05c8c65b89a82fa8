"""What a comparison of two runs says, in plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from femubench.core.harness.evidence import Evidence

Metric = Literal["skill", "used", "higher", "modified", "seconds", "failures"]
METRICS: tuple[Metric, ...] = ("skill", "used", "higher", "modified", "seconds", "failures")
SCHEMA = 1


@dataclass(frozen=True)
class Threshold:
    """The largest value of a metric that is still accepted.

    Arguments:
        metric: a ratio B / A, or ``failures``, the number of results that B lost.
        most: exceeded means worse.
    """

    metric: Metric
    most: float


DEFAULT_THRESHOLDS = (Threshold("skill", 1.01), Threshold("failures", 0.0))


@dataclass(frozen=True)
class Job:
    """A job by its names."""

    strategy: str
    case: str
    seed: int


@dataclass(frozen=True)
class Change:
    """A job that ended otherwise in B.

    Arguments:
        kind: ``lost`` (a sound result before, none now), ``gained`` or ``other``.
        before, after: status; ``unphysical`` for a model that lost rigid-body modes or has
            negative eigenvalues.
        reason: of the one that is no sound result.
    """

    strategy: str
    case: str
    seed: int
    kind: Literal["lost", "gained", "other"]
    before: str
    after: str
    reason: str


@dataclass(frozen=True)
class Row:
    """Ratios B / A of one strategy in one scenario; less than 1 is better in B.

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
class Comparison:
    """Run B against run A.

    Arguments:
        before, after: names of the runs.
        jobs: number that both have.
        changes: what ended otherwise, lost results first.
        rows: by strategy, all scenarios first.
        evidence: of every strategy.
        only_before, only_after: jobs of one run alone.
        other_cases: jobs of one name on case files that are not the same; not compared.
        environment: what differs between the machines, a line each.
        thresholds, excesses: what was asked for, and what lies beyond it.
        untested: metrics with a threshold for which no job has a value.
    """

    before: str
    after: str
    jobs: int
    changes: tuple[Change, ...]
    rows: tuple[Row, ...]
    evidence: tuple[Evidence, ...]
    only_before: tuple[Job, ...]
    only_after: tuple[Job, ...]
    other_cases: tuple[Job, ...]
    environment: tuple[str, ...]
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
