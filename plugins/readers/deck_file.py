"""What an input file of CalculiX or Abaqus says of solids and shells."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from femubench import InputError
from femubench.plugins.readers import nodes, shells, solid_elements
from femubench.plugins.readers.attachments import Attachments

INSTEAD = "solids and shells alone, or the matrices of *FREQUENCY, SOLVER=MATRIXSTORAGE next to it"
REST = "rest"
# What changes neither stiffness nor mass, or is of a step, whose supports alone count.
_IGNORED = re.compile(
    "(END)?(ASSEMBLY|PART|STEP)|ENDINSTANCE|HEADING|INCLUDE|NODE|SYSTEM|PREPRINT|RESTART|"
    "DAMPING|DISTRIBUTING|EXPANSION|CONDUCTIVITY|SPECIFICHEAT|INITIALCONDITIONS|PHYSICALCONSTANTS|TIMEPOINTS"
)
KINDS: dict[str, solid_elements.Kind | shells.Shell] = {**solid_elements.KINDS, **shells.SHELLS}
POINTS = ("MASS", "SPRING1")
# By reduced integration or of another formula: what is next to them here.
_ALIKE = {"S4R": "S4", "S3R": "S3", "STRI65": "S6", "C3D8R": "C3D8I", "C3D10M": "C3D10"}
SECTIONS = ("SOLIDSECTION", "SHELLSECTION")
_HELD = {
    "ENCASTRE": range(6), "PINNED": range(3),
    "XSYMM": (0, 4, 5), "YSYMM": (1, 3, 5), "ZSYMM": (2, 3, 4),
}  # fmt: skip


@dataclass
class SolidDeck:
    """What an input file says of a linear model of solids and shells.

    Arguments:
        elements: kind and nodes by number.
        sets, node_sets: numbers by name, in capitals.
        named: names as the file first writes them.
        materials: modulus, Poisson's ratio and density by name, nan where not given.
        metals: by name of a material that is one property's own, the material that it is of.
        sections: material and thickness, nan of solids, by set of elements; the last one counts.
        masses: mass of the elements of a set.
        springs: direction, 0 to 5, and stiffness of the springs to ground of a set.
        surfaces: nodes by name.
        couplings: name and surface of distributing couplings, by reference node.
        held: node and direction of supports.
        attached: springs, masses and rigid elements at nodes.
        coated: sets whose density has mass in it that does not grow with the thickness.
    """

    path: Path
    elements: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    sets: dict[str, dict[int, None]] = field(default_factory=dict)
    node_sets: dict[str, dict[int, None]] = field(default_factory=dict)
    named: dict[str, str] = field(default_factory=dict)
    materials: dict[str, list[float]] = field(default_factory=dict)
    metals: dict[str, str] = field(default_factory=dict)
    sections: dict[str, tuple[str, float]] = field(default_factory=dict)
    masses: dict[str, float] = field(default_factory=dict)
    springs: dict[str, tuple[int, float]] = field(default_factory=dict)
    surfaces: dict[str, dict[int, None]] = field(default_factory=dict)
    couplings: dict[int, tuple[str, str]] = field(default_factory=dict)
    held: set[tuple[int, int]] = field(default_factory=set)
    attached: Attachments = field(default_factory=Attachments)
    coated: set[str] = field(default_factory=set)

    def solids(self) -> list[int]:
        """Return the elements that are no point masses."""
        return [n for n, (kind, _) in self.elements.items() if kind in KINDS]

    def groups(self) -> dict[str, list[int]]:
        """Return the solid elements by group: the smallest sets that share none, and the rest."""
        left, found = dict.fromkeys(self.solids()), {}
        for name in sorted(self.sets, key=lambda name: (len(self.sets[name]), name)):
            own = self.sets[name]
            if own and all(number in left for number in own):
                found[self.named[name]] = list(own)
                left = {number: None for number in left if number not in own}
        found |= {REST: list(left)} if left else {}
        return found if len(found) + len(self.attached.groups()) > 1 else {}


def read_deck(path: Path) -> SolidDeck:
    """Return what an input file says.

    Raises:
        InputError: for what changes stiffness or mass and is not read, and for a broken file.
    """
    deck = SolidDeck(path)
    for block in _read_blocks(path):
        _READ.get(block.keyword, _refuse)(deck, block)
    return deck


@dataclass(frozen=True)
class _Block:
    """A keyword with its options, and the cells of its lines."""

    file: Path
    number: int
    keyword: str
    options: dict[str, str]
    lines: list[tuple[int, list[str]]]
    in_step: bool

    def refuse(self, what: str, expected: str, number: int | None = None) -> InputError:
        return InputError(what, file=self.file, line=number or self.number, expected=expected)

    def option(self, name: str) -> str:
        if not self.options.get(name):
            raise self.refuse(f"*{self.keyword} without {name}", f"{name}=...")
        return self.options[name].upper()

    def first_numbers(self, count: int) -> list[float]:
        """Return the numbers of the first line."""
        number, cells = self.lines[0] if self.lines else (self.number, [])
        try:
            return [float(cell) for cell in cells[:count] + [""] * (count - len(cells))]
        except ValueError:
            what = f"{','.join(cells)[:40]!r} below *{self.keyword}"
            raise self.refuse(what, f"{count} numbers", number) from None

    def whole_numbers(self) -> Iterator[tuple[int, list[int]]]:
        """Return line and numbers of every line, empty cells left out."""
        for number, cells in self.lines:
            try:
                yield number, [int(cell.rpartition(".")[2]) for cell in cells if cell]
            except ValueError:
                what = f"{','.join(cells)[:40]!r} below *{self.keyword}"
                raise self.refuse(what, "whole numbers", number) from None


def _read_blocks(path: Path) -> Iterator[_Block]:
    """Return the blocks of an input file, those of included ones in place."""
    block, in_step = None, False
    for file, number, line in nodes.read_lines(path):
        if not line.startswith("*"):
            if block is not None:
                block.lines.append((number, [cell.strip() for cell in line.split(",")]))
            continue
        if block is not None:
            yield block
        keyword, *words = line[1:].split(",")
        keyword = keyword.upper().replace(" ", "")
        pairs = (word.partition("=") for word in words)
        options = {k.strip().upper(): v.strip().strip('"') for k, _, v in pairs}
        in_step = keyword == "STEP" or (in_step and keyword != "ENDSTEP")
        block = _Block(file, number, keyword, options, [], in_step)
    if block is not None:
        yield block


def _refuse(deck: SolidDeck, block: _Block) -> None:
    """Refuse what is not known to change nothing."""
    if not (block.in_step or _IGNORED.fullmatch(block.keyword)):
        raise block.refuse(f"*{block.keyword} is not read", INSTEAD)


def _instance(deck: SolidDeck, block: _Block) -> None:
    if block.lines or "instances" in deck.named:
        raise block.refuse("parts that are moved, or there twice", "one part where it lies")
    deck.named["instances"] = ""


def _element(deck: SolidDeck, block: _Block) -> None:
    kind, known = block.option("TYPE"), KINDS
    if kind not in known and kind not in POINTS:
        near = f"{_ALIKE[kind]} in its place; or " if kind in _ALIKE else ""
        others = f"of others {INSTEAD.partition(', or ')[2]}"
        expected = f"{near}{', '.join(known)}, {', '.join(POINTS)}; {others}"
        raise block.refuse(f"elements of type {kind}", expected)
    size = len(known[kind].places) if kind in known else 1
    own: dict[int, None] = {}
    gathered: list[int] = []
    for number, found in block.whole_numbers():
        gathered += found
        if len(gathered) > size:
            if gathered[0] in deck.elements:
                raise block.refuse(f"element {gathered[0]} is there twice", "one", number)
            if len(gathered) > size + 1:
                what = f"element {gathered[0]} has too many nodes"
                raise block.refuse(what, f"{size} nodes of {kind}", number)
            deck.elements[gathered[0]] = kind, tuple(gathered[1:])
            own[gathered[0]] = None
            gathered = []
    if gathered:
        raise block.refuse(f"element {gathered[0]} lacks nodes", f"{size} nodes of {kind}")
    if name := block.options.get("ELSET"):
        deck.named.setdefault(name.upper(), name)
        deck.sets.setdefault(name.upper(), {}).update(own)


def _set(deck: SolidDeck, block: _Block) -> None:
    of_elements = block.keyword == "ELSET"
    known = deck.sets if of_elements else deck.node_sets
    name = block.option(block.keyword)
    deck.named.setdefault(name, block.options[block.keyword])
    own = known.setdefault(name, {})
    if "GENERATE" in block.options:
        for number, found in block.whole_numbers():
            if len(found) not in {2, 3} or found[-1] < 1:
                raise block.refuse("GENERATE", "first, last, step", number)
            own.update(dict.fromkeys(range(found[0], found[1] + 1, *found[2:])))
        return
    for number, cells in block.lines:
        for cell in filter(None, cells):
            own.update(_members(known, cell, block, number))


def _members(
    known: dict[str, dict[int, None]], cell: str, block: _Block, number: int
) -> dict[int, None]:
    """Return the numbers that a cell names: one, or those of a set."""
    word = cell.rpartition(".")[2].strip('"')
    if word.isdecimal():
        return {int(word): None}
    if word.upper() not in known:
        raise block.refuse(f"no set {word[:40]!r}", "a number, or a set defined above it", number)
    return known[word.upper()]


def _material(deck: SolidDeck, block: _Block) -> None:
    deck.materials[block.option("NAME")] = [np.nan] * 3


def _elastic(deck: SolidDeck, block: _Block) -> None:
    if block.options.get("TYPE", "ISO").upper() not in {"ISO", "ISOTROPIC"}:
        raise block.refuse(f"*ELASTIC of type {block.options['TYPE']}", "TYPE=ISO")
    _last_material(deck, block)[:2] = block.first_numbers(2)


def _density(deck: SolidDeck, block: _Block) -> None:
    _last_material(deck, block)[2:] = block.first_numbers(1)


def _last_material(deck: SolidDeck, block: _Block) -> list[float]:
    if not deck.materials:
        raise block.refuse(f"*{block.keyword} of no material", "*MATERIAL above it")
    return next(reversed(deck.materials.values()))


def _section(deck: SolidDeck, block: _Block) -> None:
    name, of_shells = block.option("ELSET"), block.keyword == "SHELLSECTION"
    if unread := {"COMPOSITE", "OFFSET", "NODALTHICKNESS"} & block.options.keys():
        what = f"*SHELL SECTION with {min(unread)}"
        raise block.refuse(what, "one material and thickness, nodes in the middle")
    deck.sections.pop(name, None)
    thickness = block.first_numbers(1)[0] if of_shells else np.nan
    deck.sections[name] = block.option("MATERIAL"), thickness


def _mass(deck: SolidDeck, block: _Block) -> None:
    deck.masses[block.option("ELSET")] = block.first_numbers(1)[0]


def _spring(deck: SolidDeck, block: _Block) -> None:
    (stiffness,) = replace(block, lines=block.lines[1:]).first_numbers(1)
    direction = next(block.whole_numbers(), (0, [0]))[1][0]
    if not (1 <= direction <= 6 and stiffness > 0.0):
        raise block.refuse("*SPRING", "a direction from 1 to 6, below it a stiffness above zero")
    deck.springs[block.option("ELSET")] = direction - 1, stiffness


def _surface(deck: SolidDeck, block: _Block) -> None:
    if block.options.get("TYPE", "").upper() == "NODE":
        own = deck.surfaces.setdefault(block.option("NAME"), {})
        for number, cells in block.lines:
            own.update(_members(deck.node_sets, cells[0], block, number))


def _coupling(deck: SolidDeck, block: _Block) -> None:
    name, surface = block.option("REF NODE"), block.option("SURFACE")
    if not name.isdecimal() or surface not in deck.surfaces:
        what = f"no surface {surface}" if name.isdecimal() else f"reference node {name}"
        raise block.refuse(what, "a number, and a *SURFACE, TYPE=NODE above it")
    deck.couplings[int(name)] = block.options.get("CONSTRAINT NAME") or name, surface


def _boundary(deck: SolidDeck, block: _Block) -> None:
    for number, cells in block.lines:
        found = _members(deck.node_sets, cells[0], block, number)
        word = cells[1].upper() if len(cells) > 1 else ""
        along: Sequence[int] = _HELD.get(word, ())
        if not along:
            ends = [cell for cell in cells[1:3] if cell]
            if not ends or not all(end.isdecimal() for end in ends):
                what = f"{','.join(cells)[:40]!r} below *BOUNDARY"
                raise block.refuse(what, "node or set, first and last direction", number)
            along = range(int(ends[0]) - 1, int(ends[-1]))
        deck.held.update((node, d) for node in found for d in along if d < 6)


_READ = {
    "ELEMENT": _element, "ELSET": _set, "NSET": _set, "MATERIAL": _material, "ELASTIC": _elastic,
    "DENSITY": _density, "SOLIDSECTION": _section, "SHELLSECTION": _section, "MASS": _mass,
    "BOUNDARY": _boundary, "INSTANCE": _instance, "SPRING": _spring, "SURFACE": _surface,
    "COUPLING": _coupling,
}  # fmt: skip
