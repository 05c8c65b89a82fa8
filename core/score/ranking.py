"""Gains and ranks of jobs: every model against the textbook one of its case."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import msgspec

from femubench.core.errors import InputError
from femubench.core.garbage import pause_collection
from femubench.core.schema.records import Models, to_plain
from femubench.core.schema.results import BLOCKS, UNSEEN, Block, JobResult, Nominal, rate
from femubench.core.score.bounded_gain import CaseGain, MeasuredModes, ModelErrors, Rule, find_gain

TIE = 1e-6  # gains that differ by less share a rank: rounding differs by 1e-9 or so

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Scale:
    """What the results of a run are measured by.

    Arguments:
        rule: of the gains.
        blocks: what the textbook model of every case predicts.
        modes: that were measured of every case.
        textbook: the errors of its textbook model.
        starts: the errors of the model that strategies were given, by case and nominal model.
    """

    rule: Rule
    blocks: Mapping[str, Mapping[str, Block]]
    modes: Mapping[str, MeasuredModes]
    textbook: Mapping[str, ModelErrors]
    starts: Mapping[tuple[str, Nominal], ModelErrors]

    @classmethod
    def of(cls, meta: Mapping[str, Any]) -> Scale:
        """Return the scale of a run; one made before there was a rule gives it no case.

        Raises:
            InputError: for a rule, or models, that are none.
        """
        rule = Rule.of(meta)
        listed = {**(meta.get("models") or {}), **((meta.get("twins") or {}).get("models") or {})}
        return cls.of_models(msgspec.convert(listed, Models), rule, meta.get("yardstick"))

    @classmethod
    def of_models(cls, models: Models, rule: Rule, yardstick: Nominal | None) -> Scale:
        """Return the scale that models give.

        Arguments:
            models: what the nominal models of every case predict.
            yardstick: the one that all others are measured against.

        Raises:
            InputError: when a case lacks that one.
        """
        try:
            blocks = {case: own[yardstick or "drawn"] for case, own in models.items()}
        except KeyError as fault:
            what = f"a case has no {fault.args[0]} model to be measured against"
            raise InputError(what, expected="a run of this version: run it again") from fault
        modes = {case: MeasuredModes.of(own, rule) for case, own in blocks.items()}
        errors: dict[tuple[str, Nominal], ModelErrors] = {
            (case, nominal): modes[case].errors(found)
            for case, own in models.items()
            for nominal, found in own.items()
        }
        textbook = {case: errors[case, yardstick or "drawn"] for case in models}
        return cls(rule, blocks, modes, textbook, errors)

    def holds_back(self, case: str) -> bool:
        """Tell whether a case has data that no strategy is given."""
        self.start(case, "drawn")  # of one that is not kept it says so
        return any(name in UNSEEN for name in self.blocks[case])

    def start(self, case: str, nominal: Nominal) -> ModelErrors:
        """Return the errors of a model that a strategy was given.

        Raises:
            InputError: when the run does not keep it, as one made before there was a rule.
        """
        if case not in self.textbook:
            what = f"the run keeps no candidate partners of case {case!r}, on which gains rest"
            raise InputError(what, expected="a run of this version: run it again")
        return self.starts.get((case, nominal), self.textbook[case])

    def errors(self, result: JobResult) -> ModelErrors:
        """Return the errors of a result; without a possible model, of the one that was given."""
        start = self.start(result.case, result.nominal)
        if not result.answered:
            return start
        return self.modes[result.case].errors(result.blocks)

    def figures(self, case: str, errors: ModelErrors) -> dict[str, float]:
        """Return what is averaged over seeds, cases and structures, by the name of its column."""
        gain = self.gain(case, errors)
        return {
            "gain": gain.gain,
            "error_gain": gain.error,
            "change_gain": gain.change,
            "error_percent": 100.0 * errors.error,
            "band_percent": 100.0 * errors.band,
            "shape_error": errors.shape,
            "false_modes": float(errors.false_modes),
        }

    def gain(self, case: str, errors: ModelErrors) -> CaseGain:
        """Return what a model with these errors gains over the textbook one of a case."""
        return find_gain(errors, self.textbook[case], self.rule)


def rank_items(
    items: Iterable[_Item], key: Callable[[_Item], tuple[tuple[float, ...], float, str]]
) -> list[tuple[int, _Item]]:
    """Return the items with their ranks, best first; equal ones share a rank: 1, 2, 2, 4.

    Sorted numbers are split where the gap to the next one exceeds 1e-6, so that anyone who is
    tied with one of a group is tied with all of it.

    Arguments:
        key: tier, number and name; the tier counts first, then the number, less being better. The
            name orders those that share a rank.
    """
    keyed = sorted(((*key(item), item) for item in items), key=lambda entry: entry[:3])
    found: list[tuple[int, str, _Item]] = []
    rank = 0
    for place, (tier, number, name, item) in enumerate(keyed):
        before = keyed[place - 1]
        if not rank or tier != before[0] or number - before[1] > TIE:
            rank = place + 1
        found.append((rank, name, item))
    return [(rank, item) for rank, _, item in sorted(found, key=lambda entry: entry[:2])]


@pause_collection()
def rank_results(results: Iterable[JobResult], meta: Mapping[str, Any]) -> tuple[JobResult, ...]:
    """Return results with their gains, and their ranks within case, seed and nominal model.

    Equal gains share a rank. A job without a possible model counts as the one that it was given.

    Arguments:
        results: in any order, which is kept.
        meta: of their run; results on a case whose models it does not keep stay as they are.
    """
    listed = [replace(result) for result in results]
    rate_results(listed, Scale.of(meta))
    return tuple(listed)


def rate_results(results: Sequence[JobResult], scale: Scale) -> None:
    """Give results that nobody else has yet their gains and ranks."""
    groups: dict[tuple[str, int, Nominal], list[tuple[float, JobResult]]] = {}
    for result in results:
        if result.case in scale.textbook:
            gain = scale.gain(result.case, scale.errors(result)).gain
            group = result.case, result.seed, result.nominal
            groups.setdefault(group, []).append((gain, result))
    for listed in groups.values():
        for rank, (gain, result) in rank_items(listed, _order):
            rate(result, None if math.isnan(gain) else gain, rank)


def _order(item: tuple[float, JobResult]) -> tuple[tuple[bool, ...], float, str]:
    gain, result = item
    return (math.isnan(gain),), 0.0 if math.isnan(gain) else -gain, result.strategy


def list_models(models: Models) -> dict[str, Any]:
    """Return what nominal models predict as the meta data of a run have it."""
    plain: dict[str, Any] = to_plain(models)
    order = {name: place for place, name in enumerate(BLOCKS)}
    return {
        case: {n: dict(sorted(own.items(), key=lambda b: order[b[0]])) for n, own in known.items()}
        for case, known in plain.items()
    }
