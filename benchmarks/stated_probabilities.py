"""Whether stated probabilities and deviations hold: bins, shares and their intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from femubench.core.challenge.answer import Answer, AnswerCause

EDGES = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)
WITHIN = 2.0  # deviations
Matter = Literal["name", "place"]
MATTERS: tuple[Matter, ...] = ("name", "place")


def wilson(hits: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Return the confidence interval of a proportion, 95 % by default (Wilson 1927, (17))."""
    if count == 0:
        return 0.0, 1.0
    share, square = hits / count, z * z / count
    middle = share + square / 2.0
    half = z * math.sqrt(share * (1.0 - share) / count + square / (4.0 * count))
    scale = 1.0 + square
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def percent(hits: int, count: int) -> dict[str, str]:
    """Return a share and its 95 % interval as the cells of a table."""
    low, high = wilson(hits, count)
    return {
        "right": f"{100.0 * hits / count:.1f} %" if count else "-",
        "95 % interval": f"{100.0 * low:.1f} to {100.0 * high:.1f} %" if count else "-",
    }


@dataclass(frozen=True)
class Statement:
    """A probability that was stated, and whether what it is about is so.

    Arguments:
        matter: a name wherever it sits, or a name at its place.
        probability: as stated.
        right: whether it is so.
    """

    matter: Matter
    probability: float
    right: bool


def statements(
    answer: Answer,
    is_named: Callable[[str], bool],
    is_placed: Callable[[str, str], bool],
    counts: Callable[[AnswerCause], bool] = lambda cause: True,
) -> list[Statement]:
    """Return what an answer states of every cause that it names, alone or in a group.

    Arguments:
        answer: with a verdict; best guesses next to ``unknown`` and ``not-confirmed`` are none.
        is_named: whether an effect is among what is hidden.
        is_placed: whether an effect at a place is.
        counts: which causes are judged.
    """
    found = []
    for cause in answer.causes:
        guess = answer.verdict not in ("named", "ambiguous") and cause.side == "model"
        if guess or cause.probability is None or cause.claim is None or not counts(cause):
            continue
        named = all(is_named(effect) for effect, _ in cause.parts)
        placed = all(is_placed(effect, place) for effect, place in cause.parts)
        found.append(Statement("name", cause.probability, named))
        found.append(Statement("place", cause.claim, placed))
    return found


@dataclass(frozen=True)
class Bin:
    """Statements of about the same probability.

    Arguments:
        low, high: edges; the upper one belongs to the last bin alone.
        mean: of the probabilities, nan without any.
        hits, count: how many are right, of how many.
    """

    low: float
    high: float
    mean: float
    hits: int
    count: int


def binned(said: Iterable[Statement], matter: Matter) -> list[Bin]:
    """Return the bins of what was stated of names or of places."""
    own = [one for one in said if one.matter == matter]
    bins = []
    for low, high in pairwise(EDGES):
        inside = [s for s in own if low <= s.probability < high or s.probability == high == 1.0]
        mean = math.fsum(s.probability for s in inside) / len(inside) if inside else math.nan
        bins.append(Bin(low, high, mean, sum(s.right for s in inside), len(inside)))
    return bins


def calibration_rows(said: Sequence[Statement]) -> list[dict[str, str]]:
    """Return one row a bin of stated probability: how often names and places are right."""
    rows = []
    for bins in zip(*(binned(said, matter) for matter in MATTERS), strict=True):
        row = {"stated": f"{bins[0].low:g} to {bins[0].high:g}"}
        for matter, own in zip(MATTERS, bins, strict=True):
            row[f"{matter}s"] = str(own.count)
            row |= {f"{matter} {k}": v for k, v in percent(own.hits, own.count).items()}
        rows.append(row)
    return rows


def coverage_rows(deviations: Mapping[str, Sequence[float]]) -> list[dict[str, str]]:
    """Return one row a kind and one over all: whether the true sizes lie where they are said to.

    Arguments:
        deviations: (stated - true) / stated deviation of every size that was found, by kind.
    """
    every = [z for own in deviations.values() for z in own]
    rows = []
    for name, own in (*deviations.items(), ("all", every)):
        if not own:
            continue
        inside = sum(abs(z) < WITHIN for z in own)
        cells = percent(inside, len(own))
        rows.append(
            {
                "kind": name,
                "sizes": str(len(own)),
                f"within {WITHIN:g} deviations": cells["right"],
                "95 % interval": cells["95 % interval"],
                "root mean square": f"{math.sqrt(math.fsum(z * z for z in own) / len(own)):.2f}",
            }
        )
    return rows


def fault_rows(faults: Mapping[str, Sequence[tuple[bool, bool]]]) -> list[dict[str, str]]:
    """Return one row a kind and one over all: answers that fit worse than the truth.

    Arguments:
        faults: of every truth that was fitted, by kind: whether the answer fits worse, and
            whether that is a fault of the search.
    """
    every = [pair for own in faults.values() for pair in own]
    rows = []
    for name, own in (*faults.items(), ("all", every)):
        if not own:
            continue
        found = sum(fault for _, fault in own)
        cells = percent(found, len(own))
        rows.append(
            {
                "kind": name,
                "truths fitted": str(len(own)),
                "answer fits worse": str(sum(worse for worse, _ in own)),
                "faults of search": str(found),
                "share": cells["right"],
                "95 % interval": cells["95 % interval"],
            }
        )
    return rows
