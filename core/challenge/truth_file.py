"""What a truth file says: the structure, what is wrong with it, and how visible that is."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import asdict

from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text
from femubench.core.schema.bounds import Real, Whole
from femubench.core.schema.validation import read_plain

TRUTH_FILE = "truth.toml"
# Kind -> how many causes it has.
KINDS = {"defect": 1, "pair": 2, "clean": 0, "outside": 1, "data-fault": 1, "input-fault": 1}

_Finding = Annotated[str, Meta(pattern=r"^[^@]+@(?s:.+)$")]
_ChiSquare = Annotated[float, Meta(ge=0.0, le=1e300)]


def is_held(name: str) -> bool:
    """Tell of a case, by ``SUITE/NAME`` or ``NAME``, whether no figure of development is its."""
    return hashlib.sha256(name.rpartition("/")[2].encode()).digest()[0] % 2 == 1


@dataclass(frozen=True, slots=True)
class TrueCause:
    """One thing that is wrong.

    Arguments:
        what: in words.
        effect: slug; empty where no effect describes it.
        place: in the grammar of the effects, or ``mode:3``, ``sensor:S5+S7``, ``data`` and alike.
        also: ``effect@place`` of what an engineer would accept as the same finding.
        size: in `unit`; None where there is none.
        unit: empty for a ratio.
    """

    what: str
    effect: str
    place: str
    also: tuple[_Finding, ...] = ()
    size: Real | None = None
    unit: str = ""

    @property
    def findings(self) -> tuple[tuple[str, str], ...]:
        """Return effect and place of everything that counts as this cause."""
        own = ((self.effect, self.place),) if self.effect else ()
        return (*own, *((word.partition("@")[0], word.partition("@")[2]) for word in self.also))

    def __str__(self) -> str:
        size = "" if self.size is None else f" ({self.size:.4g} {self.unit}".rstrip() + ")"
        return f"{self.what}: {self.effect or 'no effect'} at {self.place}{size}"


@dataclass(frozen=True)
class KnownCase:
    """A case whose truth is known.

    Arguments:
        name: of its folder.
        structure: folder in the suite.
        kind: one of `KINDS`.
        seed: of its random numbers.
        causes: as many as the kind has.
        chi2: of the noise-free change of the used modes, in stated deviations; None where nothing
            that was measured or predicted changes.
        chi2_frequencies: the part of the frequencies.
        appears: how many of the used modes no healthy mode is the partner of.
        mass: that a balance reads of the structure as it is, and its deviation, kg; None where
            that of the structure's folder holds.
    """

    name: str
    structure: str
    kind: str
    seed: int
    causes: tuple[TrueCause, ...] = ()
    chi2: float | None = None
    chi2_frequencies: float | None = None
    appears: int = 0
    mass: tuple[float, float] | None = None

    @property
    def held(self) -> bool:
        """Tell whether it is in the held half."""
        return is_held(self.name)

    def __str__(self) -> str:
        return " + ".join(map(str, self.causes)) or "nothing"


@dataclass(frozen=True)
class GivenTruth:
    """A truth from outside that was posed as a blind case.

    Arguments:
        truth: as its file says.
        seed: of the draw.
        reference: whether the case brings the healthy structure.
        digest: of the case.
    """

    truth: KnownCase
    seed: int
    reference: bool
    digest: str

    def __str__(self) -> str:
        return str(self.truth)


class _Mass(Struct, forbid_unknown_fields=True):
    value: Real
    std: Real


class _Visible(Struct, forbid_unknown_fields=True):
    chi2: _ChiSquare
    chi2_frequencies: _ChiSquare
    appears: int = 0


class _TruthTable(Struct, forbid_unknown_fields=True):
    structure: str
    kind: str
    held: bool
    seed: Whole
    mass: _Mass | None = None
    visible: _Visible | None = None
    cause: list[TrueCause] = []


def read_truth(folder: Path) -> KnownCase:
    """Return what the truth file in a folder says.

    Raises:
        InputError: for a missing file and for a missing, unknown or faulty key, in one line.
    """
    file = folder / TRUTH_FILE
    try:
        content = tomllib.loads(read_text(file, MIB))
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(error), file=file, expected="valid TOML") from None
    table = read_plain(_TruthTable, content, file=file)
    for number, cause in enumerate(content.get("cause", ())):
        if more := sorted(cause.keys() - {field.name for field in fields(TrueCause)}):
            raise InputError("unknown key", file=file, key=f"cause[{number}].{more[0]}")
    kind, half = table.kind, is_held(folder.name)
    if kind not in KINDS:
        expected = f"one of {', '.join(KINDS)}"
        raise InputError(f"unknown kind {kind!r}", file=file, key="kind", expected=expected)
    if table.held != half:
        expected = f"{str(half).lower()}, by the hash of the name"
        raise InputError("the half is another", file=file, key="held", expected=expected)
    if len(table.cause) != KINDS[kind]:
        expected = f"{KINDS[kind]} tables [[cause]]"
        raise InputError(f"not what {kind!r} has", file=file, key="cause", expected=expected)
    mass = None if table.mass is None else (table.mass.value, table.mass.std)
    causes, seen = tuple(table.cause), table.visible
    known = KnownCase(folder.name, table.structure, kind, table.seed, causes, mass=mass)
    return known if seen is None else replace(known, **asdict(seen))
