"""What a truth file says: the structure, what is wrong with it, and how visible that is."""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import tomlkit

from femubench.core.errors import InputError
from femubench.core.files import MIB, read_text

TRUTH_FILE = "truth.toml"
# Kind -> how many causes it has.
KINDS = {"defect": 1, "pair": 2, "clean": 0, "outside": 1, "data-fault": 1, "input-fault": 1}
DIGITS = 4  # of what is computed: more would differ between kernels of linear algebra

T = TypeVar("T")


def held(name: str) -> bool:
    """Tell whether a truth belongs to the half from which no figure of development is taken."""
    return hashlib.sha256(name.encode()).digest()[0] % 2 == 1


@dataclass(frozen=True)
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
    also: tuple[str, ...] = ()
    size: float | None = None
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
        return held(self.name)

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


@dataclass(frozen=True)
class _Table:
    """A table of a truth file, whose keys are taken one by one."""

    file: Path
    path: str
    content: Mapping[str, Any]

    def error(self, key: str, what: str, expected: str) -> InputError:
        return InputError(what, file=self.file, key=f"{self.path}{key}", expected=expected)

    def only(self, *known: str) -> None:
        for key in self.content:
            if key not in known:
                raise self.error(key, "unknown key", ", ".join(known))

    def take(self, key: str, kind: type[T], expected: str) -> T:
        if key not in self.content:
            raise self.error(key, "missing key", expected)
        value = self.content[key]
        if kind is float and type(value) is int:
            value = float(value)
        # A truth value is a whole number to Python.
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.error(key, f"{str(value)[:40]!r} is not allowed", expected)
        if isinstance(value, float) and not math.isfinite(value):
            raise self.error(key, "not finite", expected)
        return value

    def below(self, key: str, part: Any) -> _Table:  # noqa: ANN401 - as the parser gives it
        if not isinstance(part, dict):
            raise self.error(key, "not a table", f"a table [{key}]")
        return _Table(self.file, f"{key}.", part)


def read_truth(folder: Path) -> KnownCase:
    """Return what the truth file in a folder says.

    Raises:
        InputError: for a missing file and for a missing, unknown or faulty key, in one line.
    """
    file = folder / TRUTH_FILE
    try:
        table = _Table(file, "", tomllib.loads(read_text(file, MIB)))
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(error), file=file, expected="valid TOML") from None
    table.only("structure", "kind", "held", "seed", "mass", "visible", "cause")
    kind = table.take("kind", str, f"one of {', '.join(KINDS)}")
    if kind not in KINDS:
        raise table.error("kind", f"unknown kind {kind!r}", f"one of {', '.join(KINDS)}")
    word = str(held(folder.name)).lower()
    if table.take("held", bool, word) != held(folder.name):
        raise table.error("held", "the half is another", f"{word}, by the hash of the name")
    listed = table.content.get("cause", [])
    if not isinstance(listed, list) or len(listed) != KINDS[kind]:
        expected = f"{KINDS[kind]} tables [[cause]]"
        raise table.error("cause", f"not what {kind!r} has", expected)
    causes = tuple(_cause(table.below(f"cause[{i}]", part)) for i, part in enumerate(listed))
    seed = table.take("seed", int, "a whole number >= 0")
    if seed < 0:
        raise table.error("seed", f"{seed}", "a whole number >= 0")
    structure = table.take("structure", str, "a folder of the suite")
    return KnownCase(folder.name, structure, kind, seed, causes, *_visible(table), _mass(table))


def _mass(table: _Table) -> tuple[float, float] | None:
    if "mass" not in table.content:
        return None
    mass = table.below("mass", table.content["mass"])
    mass.only("value", "std")
    return mass.take("value", float, "a mass in kg"), mass.take("std", float, "a mass in kg")


def _visible(table: _Table) -> tuple[float | None, float | None, int]:
    if "visible" not in table.content:
        return None, None, 0
    visible = table.below("visible", table.content["visible"])
    visible.only("chi2", "chi2_frequencies", "appears")
    whole = visible.take("chi2", float, "a number >= 0")
    part = visible.take("chi2_frequencies", float, "a number >= 0")
    for key, value in (("chi2", whole), ("chi2_frequencies", part)):
        if value < 0.0:
            raise visible.error(key, f"{value:g}", "a number >= 0")
    new = visible.take("appears", int, "a number of modes") if "appears" in visible.content else 0
    return whole, part, new


def _cause(table: _Table) -> TrueCause:
    table.only("what", "effect", "also", "place", "size", "unit")
    also = table.take("also", list, 'a list of "effect@place"') if "also" in table.content else []
    for word in also:
        parts = word.partition("@") if isinstance(word, str) else ("", "", "")
        if not parts[0] or not parts[2]:
            raise table.error("also", f"{str(word)[:40]!r}", '"effect@place"')
    return TrueCause(
        what=table.take("what", str, "what is wrong, in words"),
        effect=table.take("effect", str, "the slug of an effect, or an empty text"),
        place=table.take("place", str, "a place"),
        also=tuple(also),
        size=table.take("size", float, "a number") if "size" in table.content else None,
        unit=table.take("unit", str, "a unit") if "unit" in table.content else "",
    )


def rounded(value: float) -> float:
    """Return a number with as many digits as truth files have."""
    return float(f"{value:.{DIGITS}g}")


def truth_text(truth: KnownCase) -> str:
    """Return the content of the truth file."""
    document = tomlkit.document()
    document.update(
        {"structure": truth.structure, "kind": truth.kind, "held": truth.held, "seed": truth.seed}
    )
    if truth.mass is not None:
        mass = tomlkit.inline_table()
        mass.update({"value": truth.mass[0], "std": truth.mass[1]})
        document["mass"] = mass
    if truth.chi2 is not None and truth.chi2_frequencies is not None:
        visible = tomlkit.table()
        visible["chi2"] = rounded(truth.chi2)
        visible["chi2_frequencies"] = rounded(truth.chi2_frequencies)
        if truth.appears:
            visible["appears"] = truth.appears
        document["visible"] = visible
    causes = tomlkit.aot()
    for cause in truth.causes:
        table = tomlkit.table()
        table.update({"what": cause.what, "effect": cause.effect})
        if cause.also:
            table["also"] = list(cause.also)
        table["place"] = cause.place
        if cause.size is not None:
            table.update({"size": rounded(cause.size), "unit": cause.unit})
        causes.append(table)
    if truth.causes:
        document["cause"] = causes
    return tomlkit.dumps(document)
