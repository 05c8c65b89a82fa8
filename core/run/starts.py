"""From which nominal models the strategies of a run start, and what they are measured against."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from femubench.core.case.case import Case
from femubench.core.run.companions import NOTHING, Companions
from femubench.core.schema.results import NOMINALS, Block, Nominal
from femubench.core.schema.run_options import StartModels
from femubench.core.score.scoring import Reference, score_model
from femubench.core.twin.twins import again


@dataclass(frozen=True)
class Starts:
    """The nominal models of a run's cases.

    Arguments:
        textbook: the cases with their textbook models by name, which all errors are measured
            against; without those whose drawing has all that handbooks give. None starts from the
            cases as given and measures against them.
        nominal: which of the two models strategies start from.
        classes: kinds of structure and truth by case.
        companions: twins of the cases, and what is to run again.
    """

    textbook: Mapping[str, Case] | None = None
    nominal: StartModels = "both"
    classes: Mapping[str, Sequence[str]] = field(default_factory=dict)
    companions: Companions = NOTHING

    def yardstick(self, case: Case) -> Case:
        """Return a case with the model that all errors are measured against."""
        return (self.textbook or {}).get(case.name, case)

    def of(self, case: Case) -> Iterator[tuple[Nominal, Case]]:
        """Yield a case with each nominal model to start from, the one that ranks first."""
        textbook, drawn = reversed(NOMINALS)
        if self.textbook is None:
            yield drawn, case
            return
        if self.nominal != drawn:
            yield textbook, self.yardstick(case)
        if self.nominal == drawn or (self.nominal == "both" and case.name in self.textbook):
            yield drawn, case

    def of_all(self, cases: Sequence[Case]) -> Iterator[tuple[Nominal, Case]]:
        """Yield what the jobs of a run start from; for its companions, the model that ranks."""
        for case in cases:
            yield from self.of(case)
        for twin in self.companions.twins:
            yield next(self.of(twin))
        if self.companions.repeated_case is not None:
            nominal, case = next(self.of(self.companions.repeated_case))
            yield nominal, again(case)

    def predict(
        self, cases: Sequence[Case], references: Mapping[str, Reference]
    ) -> dict[str, dict[Nominal, Mapping[str, Block]]]:
        """Return what the nominal models predict that results are measured by, by case.

        Arguments:
            references: what the one that all errors are measured against gives.

        Raises:
            ModelError: when a model as drawn has no modes.
        """
        yardstick: Nominal = NOMINALS[self.textbook is not None]
        found = {case.name: {yardstick: references[case.name].blocks} for case in cases}
        for case in cases:
            for nominal, own in self.of(case):
                if nominal != yardstick and case.name in (self.textbook or {}):
                    found[case.name][nominal] = score_model(own, own.model)
        return found

    def about(self, cases: Sequence[Case]) -> dict[str, Any]:
        """Return what a run tells of its cases: from where they start, and what they are."""
        known = self.textbook
        starts = {case.name: list(self.of(case)) for case in cases}
        return {
            "yardstick": NOMINALS[known is not None],
            "starts": {name: [nominal for nominal, _ in own] for name, own in starts.items()},
            "alike": [name for name in starts if known is not None and name not in known],
            "drawings": {name: own[0][1].digest for name, own in starts.items()},
            "classes": {name: list(self.classes[name]) for name in starts if name in self.classes},
        }
