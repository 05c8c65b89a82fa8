"""What runs along with the cases of a run: twins of them, and one job of every strategy again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from femubench.core.case.case import Case
from femubench.core.schema.results import Nominal
from femubench.core.score.ranking import list_models
from femubench.core.score.scoring import Reference
from femubench.core.twin.twins import AGAIN, Twin


@dataclass(frozen=True)
class Companions:
    """Cases whose results are in no figure of a run, but checks of it.

    Arguments:
        repeated_case: the case whose jobs are run again; None for none.
        number: of twins that were asked for of each case.
    """

    twins: Sequence[Twin] = ()
    repeated_case: Case | None = None
    seed: int = 0
    number: int = 0

    def add_repeated(self, references: Mapping[str, Reference]) -> dict[str, Reference]:
        """Return references with that of the repeated case under its second name too."""
        return {**references, **{name: references[case] for name, case in self._again.items()}}

    @cached_property
    def _again(self) -> dict[str, str]:
        case = self.repeated_case
        return {} if case is None else {f"{case.name}{AGAIN}": case.name}

    def about(self, references: Mapping[str, Reference], yardstick: Nominal) -> dict[str, Any]:
        """Return what a run tells of it in its meta data; nothing where there is nothing."""
        if not self.twins and self.repeated_case is None:
            return {}
        case, digests = self.repeated_case, {twin.name: twin.digest for twin in self.twins}
        if case is not None:
            digests |= dict.fromkeys(self._again, case.digest)
        return {
            "twins": {
                "seed": self.seed,
                "number": self.number,
                "of": {twin.name: twin.origin for twin in self.twins},
                "kinds": {twin.name: list(twin.families) for twin in self.twins},
                "again": self._again,
                "cases": {name: {"digest": digest} for name, digest in digests.items()},
                "reference": {twin.name: references[twin.name].rms_percent for twin in self.twins},
                "models": list_models(
                    {twin.name: {yardstick: references[twin.name].blocks} for twin in self.twins}
                ),
            }
        }


NOTHING = Companions()


def choose_companions(
    cases: Sequence[Case], twins: Sequence[Twin], number: int, seed: int
) -> Companions:
    """Return twins, and the case with the smallest model to run again.

    Arguments:
        number, seed: of twins of each case, and what they were drawn from.
    """
    return Companions(twins, min(cases, key=lambda case: case.model.size), seed, number)
