"""Twins of cases, drawn when a run begins: what a strategy knows by heart is of no use on them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.similarity import Similarity, similar_case
from femubench.core.errors import NotApplicable
from femubench.core.twin.disguise import disguise_case
from femubench.core.twin.stretched_case import draw_stretched_case

MARK = "~"  # between the name of a case and the number of its twin
AGAIN = f"{MARK}again"


# From a case to one with another nominal model, and with what is measured on that structure; name,
# used modes and modifications are kept, the digest too, unless the truth follows from other files
# than those of the case. NotApplicable where the family has no structure like that of the case.
TruthFamily = Callable[[Case, np.random.Generator], Case]

# A structure of its own geometry where its truth is known, and then a similar one.
FAMILIES: Mapping[str, TruthFamily] = {
    "stretched": draw_stretched_case,
    "similar": lambda case, rng: similar_case(case, Similarity.draw(rng)),
}


@dataclass(frozen=True, repr=False)
class Twin(Case):
    """A case of another structure of which the truth follows from that of a case.

    Arguments:
        origin: name of the case that it is a twin of.
        twin_seed: from which it was drawn; noise too is drawn with it.
        families: names of those that changed the structure, one after another.
    """

    origin: str = ""
    twin_seed: int = 0
    families: tuple[str, ...] = ()

    @property
    def drawn_as(self) -> str:
        """Return the name that goes into the random numbers: nobody knows them before the run."""
        return f"{self.name} {self.twin_seed}"

    def conditions(self, seed: int) -> Mapping[str, float | str]:
        """Return of which case it is a twin, and the seed that it was drawn from."""
        kind = " and ".join(self.families)
        return {"twin_of": self.origin, "twin_seed": self.twin_seed, "twin_kind": kind}


@dataclass(frozen=True, repr=False)
class Again(Case):
    """A case whose jobs are run a second time, with the same random numbers."""

    origin: str = ""

    @property
    def drawn_as(self) -> str:
        """Return the name that goes into the random numbers, that of the case."""
        return self.origin

    def conditions(self, seed: int) -> Mapping[str, float | str]:
        """Return which case it is."""
        return {"again": self.origin}


def twin_of(
    case: Case, number: int, seed: int, families: Mapping[str, TruthFamily] = FAMILIES
) -> Twin:
    """Return a twin of a case.

    The first one keeps the order of joints, members and sensors: a strategy without chance answers
    as on the case, up to rounding. The others have another order too, which may decide between
    causes that are equally good.

    Arguments:
        case: of which the truth was computed.
        number: of the twin, from 1.
        seed: of the run's twins; the same one gives the same twins.
        families: by name, which change the structure one after another; those that have none like
            it do not.

    Raises:
        NotApplicable: where no family changes it, its model has no names to change, or a
            modification changes more than masses and springs.
    """
    for change in case.modifications:
        if change.alteration:
            what = f"modification {change.name!r} changes more than masses and springs"
            raise NotApplicable(f"{what}, which twins do not take")
    words = [seed, number, *case.name.encode()]
    rng = np.random.default_rng(np.random.SeedSequence(words))
    found, used, reasons = case, [], []
    for name, draw in families.items():
        try:
            found = draw(found, rng)
            used.append(name)
        except NotApplicable as error:
            reasons.append(str(error))
    if found is case:
        raise NotApplicable("; ".join(reasons) or "there is no family of structures")
    name = f"{case.name}{MARK}{number}"
    stated = f"twin {number} from seed {seed} of {case.name}: {found.digest}"
    renamed = replace(
        disguise_case(found, rng if number > 1 else None),
        name=name,
        title=f"{case.title} (twin {number})",
        digest=hashlib.sha256(stated.encode()).hexdigest(),
        structure=case.structure or case.name,
        frfs=None,
        split=None,
    )
    own = {field.name: getattr(renamed, field.name) for field in fields(Case)}
    return Twin(**own, origin=case.name, twin_seed=seed, families=tuple(used))


def twins_of(
    cases: Sequence[Case], number: int, seed: int, families: Mapping[str, TruthFamily] = FAMILIES
) -> Iterator[Twin]:
    """Yield twins of every case that can have some; arguments as for `twin_of`.

    Arguments:
        number: of twins of each case.
    """
    for case in cases:
        for place in range(1, number + 1):
            try:
                yield twin_of(case, place, seed, families)
            except NotApplicable:
                break


def again(case: Case) -> Again:
    """Return a case whose jobs are run a second time."""
    own = {field.name: getattr(case, field.name) for field in fields(Case)}
    own |= {"name": f"{case.name}{AGAIN}", "structure": case.structure or case.name}
    return Again(**own, origin=case.name)
