"""Many blind cases, diagnosed and judged: the record of each, and the figures over all."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, astuple, dataclass
from typing import Any

from stated_probabilities import Statement, percent, statements
from true_fit import CataloguedCause, fits_of, fits_worse, is_search_fault

from femubench.core.case.case import Case
from femubench.core.challenge.answer import Answer
from femubench.core.challenge.draw import BlindCase, draw_case, registered_effects
from femubench.core.challenge.score import Judgement, judge_answer
from femubench.core.challenge.structures import STRUCTURES, structure_named
from femubench.core.challenge.truth import DataKind, Hidden, Truth
from femubench.core.challenge.visibility import delta_chi2
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.effect.places import Places
from femubench.core.errors import FemubenchError

Diagnose = Callable[[Case], Diagnosis]
Record = dict[str, Any]

LADDERS = ("ladder", "ladder-asymmetric")
OTHERS = tuple(name for name in STRUCTURES if name not in LADDERS)


@dataclass(frozen=True)
class CaseGroup:
    """Cases that are counted together.

    Arguments:
        name: in tables.
        count: number of cases.
        hidden: how much is hidden.
        kind: of the data.
        structures: taken in turn.
        scatter: of the elements, relative.
    """

    name: str
    count: int
    hidden: Hidden
    kind: DataKind
    structures: tuple[str, ...] = STRUCTURES
    scatter: float = 0.0


GROUPS = (
    CaseGroup("A, ladders", 160, "one", "A", LADDERS),
    CaseGroup("A, other structures", 60, "one", "A", OTHERS),
    CaseGroup("B", 50, "one", "B"),
    CaseGroup("C", 60, "one", "C"),
    CaseGroup("A with scatter", 60, "one", "A", scatter=0.005),
    CaseGroup("clean A", 50, "none", "A"),
    CaseGroup("clean B", 50, "none", "B"),
    CaseGroup("clean C", 50, "none", "C"),
    CaseGroup("clean A with scatter", 50, "none", "A", scatter=0.005),
    CaseGroup("pairs", 50, "pair", "A"),
    CaseGroup("outside", 40, "outside", "A"),
)


@dataclass(frozen=True)
class SweepCase:
    """One case of a sweep; group and number give it again."""

    group: str
    number: int
    seed: int
    kind: DataKind
    structure: str
    hidden: Hidden
    scatter: float

    @property
    def key(self) -> tuple[str, int]:
        """Return what tells this task from all others."""
        return self.group, self.number

    def draw(self) -> BlindCase:
        """Return its case and truth."""
        return draw_case(
            self.seed,
            self.kind,
            structure=self.structure,
            hidden=self.hidden,
            scatter=self.scatter,
        )


def tasks(groups: Iterable[CaseGroup] = GROUPS, limit: int | None = None) -> list[SweepCase]:
    """Return the cases of groups, at most `limit` a group; every case has a seed of its own."""
    order = {group.name: 1000 * i for i, group in enumerate(GROUPS, 1)}
    return [
        SweepCase(
            group.name,
            i,
            order[group.name] + i,
            group.kind,
            group.structures[i % len(group.structures)],
            group.hidden,
            group.scatter,
        )
        for group in groups
        for i in range(group.count if limit is None else min(limit, group.count))
    ]


def run_task(task: SweepCase, diagnose: Diagnose) -> Record:
    """Return the record of one case; an error of the diagnosis is a wrong answer.

    Arguments:
        task: what to draw.
        diagnose: from a case to its diagnosis.
    """
    blind = task.draw()
    known = registered_effects(*(cause.effect for cause in blind.truth.causes))
    delta = delta_chi2(blind.case, blind.truth, known)
    begin = time.perf_counter()
    record = {**asdict(task), "truth": str(blind.truth), "delta_chi2": list(delta)}
    record["effects"] = [cause.effect for cause in blind.truth.causes]
    record["places"] = [cause.place for cause in blind.truth.causes]
    try:
        diagnosis = diagnose(blind.case)
    except (FemubenchError, ArithmeticError, ValueError, LookupError) as error:
        failed = {"error": f"{type(error).__name__}: {error}", "right": False, "alarm": True}
        return {**record, **failed, "verdict": "error", "seconds": time.perf_counter() - begin}
    record["seconds"] = time.perf_counter() - begin
    answer = Answer.of(diagnosis)
    judged = judge_answer(blind.truth, answer, delta)
    gain = diagnosis.gain
    return {
        **record,
        **_said(answer, judged),
        "stated": [list(astuple(one)) for one in _stated_of(answer, blind.truth)],
        "gain": {"held_out": gain.held_out_percent, "modified": gain.modified_percent},
        **_fits(diagnosis, blind.truth),
        "adequacy_p": diagnosis.adequacy_p,
        "chi2": list(diagnosis.chi2),
    }


def _fits(diagnosis: Diagnosis, truth: Truth) -> Record:
    """Return how the truth fits next to what was found; nothing where nothing is to be found."""
    if diagnosis.examination is None or not truth.causes:
        return {}
    frame = structure_named(truth.structure).frame
    causes = [[CataloguedCause(cause.effect, cause.place, cause.values)] for cause in truth.causes]
    return fits_of(diagnosis.examination, causes, registered_effects(), Places(frame).match)


# What a diagnosis can say, and where, of causes that the catalogue did not have when it was drawn.
_GROUNDED = re.compile(r"a spring of .* to ground about (\w+) at (\w+)")
_SAYS = {
    "sensors-swapped": re.compile(r"sensors (\d+) and (\d+) are swapped"),
    "sensor-gain": re.compile(r"sensor (\d+) has a gain of"),
    **dict.fromkeys(("support-missing", "support-flexibility"), _GROUNDED),
}


def _stated_of(answer: Answer, truth: Truth) -> list[Statement]:
    frame = structure_named(truth.structure).frame
    known = {name: words.match(truth.outside) for name, words in _SAYS.items()}

    def is_named(effect: str) -> bool:
        return bool(known.get(effect)) or any(effect == cause.effect for cause in truth.causes)

    def is_placed(effect: str, place: str) -> bool:
        if said := known.get(effect):
            words = place.split(":") if effect.startswith("support") else re.findall(r"\d+", place)
            return set(said.groups()) <= set(words)
        return any(effect == c.effect and Places(frame).match(place, c.place) for c in truth.causes)

    return statements(answer, is_named, is_placed)


def stated(records: Iterable[Record]) -> list[Statement]:
    """Return every probability that was stated in some records."""
    return [Statement(*one) for record in records for one in record.get("stated", ())]


def _said(answer: Answer, judged: Judgement) -> Record:
    return {
        "verdict": answer.verdict,
        "named": [cause.effect for cause in answer.causes],
        "named_places": [cause.place for cause in answer.causes],
        "probability": answer.probability,
        "right": judged.right,
        "place_right": judged.places,
        "found": judged.found,
        "group_size": judged.group,
        "too_small": judged.too_small,
        "alarm": judged.false_alarm,
        "size_deviations": [s.deviations for s in judged.sizes if s.deviations is not None],
        "reason": judged.reason,
    }


@dataclass(frozen=True)
class Goal:
    """A figure and what it must reach.

    Arguments:
        what: in words.
        chosen: which records count.
        hit: which of them are hits.
        target: the share of hits.
        at_least: whether the share must be at least the target, else at most.
        prototype: the figure to beat, as text.
    """

    what: str
    chosen: Callable[[Record], bool]
    hit: Callable[[Record], bool]
    target: float
    at_least: bool = True
    prototype: str = ""

    def counts(self, records: Sequence[Record]) -> tuple[int, int]:
        """Return hits and cases."""
        chosen = [record for record in records if self.chosen(record)]
        return sum(self.hit(record) for record in chosen), len(chosen)

    def reached(self, hits: int, count: int) -> bool:
        """Tell whether the share is what it must be; no case reaches nothing."""
        if count == 0:
            return False
        share = hits / count
        return share >= self.target if self.at_least else share <= self.target


def _in(*names: str) -> Callable[[Record], bool]:
    return lambda record: record["group"].startswith(names)


def _right(record: Record) -> bool:
    return bool(record["right"])


def _wrong(record: Record) -> bool:
    return not record["right"]


def _alarm(record: Record) -> bool:
    return bool(record["alarm"])


def _stated(low: float, high: float) -> Callable[[Record], bool]:
    def chosen(record: Record) -> bool:
        p = record.get("probability")
        return p is not None and low <= p < high

    return chosen


_DATA_A = ("A, ladders", "A, other")
BARS = (
    Goal("A: name right", _in(*_DATA_A), _right, 0.98, prototype="94.4 %"),
    Goal(
        "A: name right where chi-square falls by 30 or more",
        lambda r: _in(*_DATA_A)(r) and min(r["delta_chi2"]) >= 30.0,
        _right,
        0.995,
        prototype="198 of 198",
    ),
    Goal(
        "A: place right",
        lambda r: _in(*_DATA_A)(r) and r.get("place_right") is not None,
        lambda r: bool(r["place_right"]),
        0.96,
        prototype="91.7 %",
    ),
    Goal("B: name right", _in("B"), _right, 0.90, prototype="80.6 %"),
    Goal("C: name right", _in("C"), _right, 0.90, prototype="85.9 %"),
    Goal("A with scatter: name right", _in("A with"), _right, 0.92, prototype="83 %"),
    Goal("Clean with scatter: false alarms", _in("clean A with"), _alarm, 0.02, False, "0 of 12"),
    Goal("Clean: false alarms", _in("clean"), _alarm, 0.02, False, "0 of 85"),
    Goal("Outside the catalogue: flagged", _in("outside"), _right, 0.90, prototype="80 %"),
    Goal("Pairs: both named", _in("pairs"), _right, 0.90, prototype="82.5 %"),
    Goal("Stated P >= 0.99: wrong", _stated(0.99, 2.0), _wrong, 0.01, False, "1 of 185"),
    Goal(
        "Faults of search",
        lambda r: fits_worse(r) is not None,
        lambda r: bool(is_search_fault(r)),
        0.01,
        at_least=False,
    ),
    Goal("Stated 0.9 <= P < 0.99: wrong", _stated(0.9, 0.99), _wrong, 0.10, False, "25 %"),
)


def bars_table(records: Sequence[Record], bars: Sequence[Goal] = BARS) -> list[dict[str, str]]:
    """Return one row a bar: cases, figure, 95 % interval, what it must be, whether it is."""
    rows = []
    for bar in bars:
        hits, count = bar.counts(records)
        cells = percent(hits, count)
        sign = ">=" if bar.at_least else "<="
        rows.append(
            {
                "figure": bar.what,
                "cases": str(count),
                "measured": cells["right"],
                "95 % interval": cells["95 % interval"],
                "must be": f"{sign} {100.0 * bar.target:.1f} %",
                "reached": "yes" if bar.reached(hits, count) else "no",
                "prototype": bar.prototype,
            }
        )
    return rows
