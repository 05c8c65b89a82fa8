"""What an answer is to a truth from outside, whose causes may be said in several ways."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import permutations
from typing import Any

from femubench.core.challenge.answer import Answer
from femubench.core.challenge.score import (
    LARGEST_GROUP,
    Judgement,
    Parts,
    SizeError,
    candidates,
    faults_in,
    group_size,
)
from femubench.core.challenge.truth_file import KnownCase, TrueCause
from femubench.core.effect.places import Places
from femubench.core.fem.frame import Frame
from femubench.core.schema.records import to_plain
from femubench.core.schema.validation import read_plain

OUTCOMES = (
    "right",
    "other place",
    "in the group",
    "with others",
    "one of two",
    "none",
    "unknown",
    "not confirmed",
    "wrong",
    "error",
    "too long",
)

Same = Callable[[str, str], bool]
Record = Mapping[str, Any]


def _in_order(place: str) -> str:
    """Return a place with the two of a swap sorted: ``sensor:S5+S7``."""
    head, colon, tail = place.partition(":")
    return head + colon + "+".join(sorted(tail.split("+")))


def same_place(frame: Frame | None) -> Same:
    """Return what tells whether two words stand for one place.

    Arguments:
        frame: of the structure; None compares words.
    """

    def same(first: str, second: str) -> bool:
        one, two = _in_order(first), _in_order(second)
        return one == two if frame is None else Places(frame).match(one, two)

    return same


def anywhere(first: str, second: str) -> bool:
    """Take every two places for the same."""
    return True


def is_finding(part: tuple[str, str], cause: TrueCause, same: Same) -> bool:
    """Tell whether an effect at a place counts as a cause."""
    effect, place = part
    return any(effect == known and same(place, where) for known, where in cause.findings)


def _holds(truth: KnownCase, parts: Parts, same: Same) -> bool:
    """Tell whether every cause is among the parts, each by a part of its own."""
    return any(
        all(is_finding(part, cause, same) for part, cause in zip(chosen, truth.causes, strict=True))
        for chosen in permutations(parts, len(truth.causes))
    )


def _only(truth: KnownCase, parts: Parts, same: Same) -> bool:
    """Tell whether every part is a finding of some cause: one cause may show as two, a thinner
    wall as less stiffness and less mass."""
    return all(any(is_finding(part, cause, same) for cause in truth.causes) for part in parts)


def outcome(truth: KnownCase, record: Record, same: Same) -> str:
    """Return which of `OUTCOMES` a record is.

    A name is right with effect and place, or as an entry of `also`. A group holds the truth when
    one of its members is right by itself.
    """
    verdict = str(record["verdict"]).replace("-", " ")
    faulty = truth.kind.endswith("-fault") and "answer" in record
    if faulty and (found := faults_in(read_plain(Answer, record["answer"]))):
        if _holds(truth, found, same):
            return "right" if _only(truth, found, same) else "with others"
        return "other place" if _holds(truth, found, anywhere) else "wrong"
    if verdict not in ("named", "ambiguous"):
        return verdict
    # What handbooks give a drawn model lacks whether the structure has a defect or not.
    wanted = {effect for cause in truth.causes for effect, _ in cause.findings}
    textbook = set(record.get("textbook", ())) - wanted
    sets = [
        tuple(part for part in parts if part[0] not in textbook)
        for parts in candidates(read_plain(Answer, record["answer"]))
    ]
    if not any(sets):
        return "none"
    if not truth.causes:
        return "none" if verdict == "ambiguous" and () in sets else "wrong"
    if verdict == "ambiguous" and len(sets) > LARGEST_GROUP:
        return "unknown"
    exact = [parts for parts in sets if _only(truth, parts, same)]
    if any(_holds(truth, parts, same) for parts in exact):
        return "right" if verdict == "named" else "in the group"
    if any(_holds(truth, parts, anywhere) for parts in sets if _only(truth, parts, anywhere)):
        return "other place"
    if any(_holds(truth, parts, same) for parts in sets):
        return "with others"
    single = [parts[0] for parts in sets if len(parts) == 1 and len(truth.causes) == 2]
    half = any(is_finding(part, cause, same) for part in single for cause in truth.causes)
    return "one of two" if half else "wrong"


def counts_as_right(truth: KnownCase, said: str) -> bool:
    """Tell whether an outcome is the best that can be said of a truth."""
    if truth.kind == "clean":
        return said == "none"
    good = ("right", "in the group")
    return said in (*good, "unknown", "not confirmed") if truth.kind == "outside" else said in good


def record_of(answer: Answer) -> dict[str, Any]:
    """Return what is judged of an answer: verdict, causes, what it takes at a textbook value."""
    return {
        "verdict": answer.verdict,
        "probability": answer.probability,
        "answer": to_plain(answer),
        "textbook": [
            cause.effect
            for cause in answer.causes
            if cause.parameters and all(parameter.textbook for parameter in cause.parameters)
        ],
    }


def size_errors(truth: KnownCase, record: Record, same: Same) -> tuple[SizeError, ...]:
    """Return true and stated sizes of causes that are named where they sit, by their own name."""
    if record["verdict"] not in ("named", "ambiguous"):
        return ()
    found = []
    for said in read_plain(Answer, record["answer"]).causes:
        for cause in truth.causes:
            sizes = [p for p in said.parameters if p.std and p.unit == cause.unit]
            here = said.effect == cause.effect and same(said.place, cause.place)
            if here and cause.size is not None and len(sizes) == 1:
                found.append(SizeError.of(cause.effect, cause.size, cause.unit, sizes[0]))
    return tuple(found)


def judge_by_truth(truth: KnownCase, answer: Answer, same: Same) -> Judgement:
    """Judge an answer to a truth from outside."""
    record = record_of(answer)
    said = outcome(truth, record, same)
    right = counts_as_right(truth, said)
    named = {effect for parts in candidates(answer) for effect, _ in parts}
    found = sum(any(effect in named for effect, _ in cause.findings) for cause in truth.causes)
    hidden = bool(truth.causes) and truth.kind != "outside"
    return Judgement(
        right=right,
        names=said in ("right", "in the group", "other place") if hidden else None,
        places=said in ("right", "in the group") if hidden else None,
        group=group_size(answer),
        found=found,
        too_small=False,
        false_alarm=not truth.causes and not right,
        sizes=size_errors(truth, record, same),
        reason=said if right else f"{said}; hidden is {truth}",
    )
