"""Write and read what drawings lack: ``python -m truths [NAME ...] --only lacks``.

A file a structure in `truths/data/lacks`, all numbers of modes in ln f, used modes first; no case
holds them, so that neither a strategy nor a diagnosis can see them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from femubench.core.challenge.truth_file import is_held
from femubench.core.score.responses import rms
from truths.counterfactuals import Budget, Share, budget_of
from truths.drawing import table
from truths.posing import ROOT
from truths.structure import Structure
from truths.suite import write_files

Array = npt.NDArray[np.float64]
LACKS = ROOT / "truths" / "data" / "lacks"
PAGE = ROOT / "docs" / "diagnosis-accuracy.md"
MARK, END = "<!-- lacks -->", "<!-- /lacks -->"
OF_OPEN = ("eccentricity", "product-of-inertia", "shear-centre", "taper", "warping")
LARGEST_REMAINDER = 1 / 3  # of the misfit, rms over the modes
LEAST_MAC = 0.9  # of the ideal solid and the ideal drawing, in every mode
DIGITS = 5  # decimals of ln f: 0.001 %


@dataclass(frozen=True)
class Part:
    """Hold what one feature, or all of a class at a place, does to ln f of each mode.

    Arguments:
        kind: the class; an effect's name where there is one.
        place: in the grammar of a case; `"undrawn"` for what no drawing has.
        contribution, spread: (modes,); the spread is half of how first and last differ.
        what: in words; empty for the sum of a class at a place.
        side: `"solid"` for what was taken out, `"drawing"` for what was put in; empty for a sum.
    """

    kind: str
    place: str
    contribution: tuple[float, ...]
    spread: tuple[float, ...]
    what: str = ""
    side: str = ""

    @property
    def size(self) -> float:
        """Return the rms contribution over all modes."""
        return rms(self.contribution)


@dataclass(frozen=True)
class Lacks:
    """Hold what the drawing of a structure lacks.

    Arguments:
        structure: its name in the suite.
        held: whether it belongs to the half from which no figure of development is taken.
        refused: why the truth does not count; empty where it does.
        used: number of modes that a strategy sees; the others are held out.
        solid, drawing: frequencies of paired modes, (modes,), Hz.
        misfit: ln of their ratios.
        remainder: of the misfit, what no feature explains, (modes,).
        mac: of the ideal solid and the ideal drawing, (modes,).
        features: one by one.
        net: their sums by class and place, the largest first.
    """

    structure: str
    held: bool
    refused: str
    used: int
    solid: tuple[float, ...]
    drawing: tuple[float, ...]
    misfit: tuple[float, ...]
    remainder: tuple[float, ...]
    mac: tuple[float, ...]
    features: tuple[Part, ...]
    net: tuple[Part, ...]


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(round(float(value), DIGITS) + 0.0 for value in values)


def lacks_of(structure: Structure, budget: Budget) -> Lacks:
    """Return the content of a structure's file, with the reason where it is refused."""
    groups: dict[tuple[str, str], list[Share]] = {}
    for share in budget.shares:
        groups.setdefault((share.kind, share.place), []).append(share)
    net = (_part(shares) for shares in groups.values())
    misfit = np.log(budget.solid / budget.drawing)
    remainder = misfit - sum((share.first + share.last) / 2 for share in budget.shares)
    return Lacks(
        structure=structure.name,
        held=is_held(structure.name),
        refused=refusal(misfit, remainder, budget.alike),
        used=structure.used,
        solid=_numbers(budget.solid),
        drawing=_numbers(budget.drawing),
        misfit=_numbers(misfit),
        remainder=_numbers(remainder),
        mac=_numbers(budget.alike),
        features=tuple(
            replace(_part([share]), what=share.what, side=share.side) for share in budget.shares
        ),
        net=tuple(sorted(net, key=lambda part: -part.size)),
    )


def _part(shares: list[Share]) -> Part:
    first, last = (np.sum([getattr(s, end) for s in shares], axis=0) for end in ("first", "last"))
    contribution, spread = _numbers((first + last) / 2), _numbers(np.abs(first - last) / 2)
    return Part(shares[0].kind, shares[0].place, contribution, spread)


def refusal(misfit: Array, remainder: Array, mac: Array) -> str:
    """Return why a truth does not count; empty where it does."""
    share = float(np.linalg.norm(remainder) / np.linalg.norm(misfit))
    reasons = []
    if share > LARGEST_REMAINDER:
        reasons.append(f"the remainder is {share:.2f} of the misfit")
    if mac.min() < LEAST_MAC:
        reasons.append(f"the ideal MAC of mode {mac.argmin() + 1} is {mac.min():.2f}")
    return " and ".join(reasons)


def lacks_text(lacks: Lacks) -> str:
    """Return the content of a file."""
    parts = {"features": lacks.features, "net": lacks.net}
    head = {name: value for name, value in vars(lacks).items() if name not in parts}
    texts = ["# Written by `make truths`.", table("", head).lstrip("\n")]
    for name, items in parts.items():
        texts += [
            table(f"[[{name}]]", {k: v for k, v in vars(p).items() if v != ""}) for p in items
        ]
    return "\n".join(texts)


def read_lacks(file: Path) -> Lacks:
    """Read a file of what a drawing lacks."""
    return msgspec.toml.decode(file.read_bytes(), type=Lacks)


def write(structure: Structure, folder: Path = LACKS) -> list[str]:
    """Compute what a drawing lacks and write its file; return what differs."""
    text = lacks_text(lacks_of(structure, budget_of(structure)))
    return write_files(folder, {f"{structure.name}.toml": text})


def write_table(page: Path = PAGE, folder: Path = LACKS) -> None:
    """Replace what stands between the marks of the page by a row for each file."""
    rows = [
        "| structure | half | misfit of the drawing, % | largest, net, % | second, net, % "
        "| remainder, % | lowest ideal MAC | |",
        "| :--- | :--- | ---: | :--- | :--- | ---: | ---: | :--- |",
    ]
    found = [read_lacks(file) for file in sorted(folder.glob("*.toml"))]
    for item in found:
        two = [f"{p.kind} {p.place} {100 * p.size:.1f}" for p in item.net[:2]]
        cells = [
            f"`{item.structure}`",
            "held" if item.held else "development",
            f"{100 * rms(item.misfit):.1f}",
            *two,
            f"{100 * rms(item.remainder):.1f}",
            f"{min(item.mac):.2f}",
            f"refused: {item.refused}" if item.refused else "kept",
        ]
        rows.append(f"| {' | '.join(cells)} |")
    rows += [
        "",
        "Of open sections and tapers, in % of the frequency of each mode, used ones first:",
        "",
    ]
    rows += ["| structure | of its sections | what they do |", "| :--- | :--- | :--- |"]
    for item, part in ((i, p) for i in found for p in i.net if p.kind in OF_OPEN):
        pairs = zip(part.contribution, part.spread, strict=True)
        percent = ", ".join(f"{100 * value:+.1f} ± {100 * spread:.1f}" for value, spread in pairs)
        rows.append(f"| `{item.structure}` | {part.kind} | {percent} |")
    kept = [item for item in found if not item.refused]
    foot = f"\n{len(kept)} of {len(found)} are kept, {sum(i.held for i in kept)} of them held.\n"
    before, _, rest = page.read_text(encoding="utf-8").partition(MARK)
    text = MARK + "\n\n" + "\n".join(rows) + "\n" + foot + "\n" + END
    page.write_text(before + text + rest.partition(END)[2], encoding="utf-8")
