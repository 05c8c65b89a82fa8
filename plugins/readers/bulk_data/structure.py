"""What frames and plates of bulk data share: grids, constraints, springs, masses, rigid links."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container, Iterator
from dataclasses import dataclass

import numpy as np

from femubench import InputError
from femubench.fem import FloatArray
from femubench.plugins.readers.bulk_data.cards import Card, Deck
from femubench.plugins.readers.bulk_data.systems import Systems
from femubench.plugins.readers.reading import DIRECTIONS

_MOST_CARDS = 1_000_000
_SAME = 1e-9

# What changes neither mass nor stiffness: loads, output, damping, design, how to solve; and
# properties and materials, which without an element carry nothing.
_IDLE = """
    ACCEL ACCEL1 CDAMP1 CDAMP2 CDAMP3 CDAMP4 CVISC DAREA DCONADD DCONSTR DDVAL DEFORM DELAY DEQATN
    DESVAR DLINK DLOAD DOPTPRM DPHASE DRESP1 DRESP2 DRESP3 DSCREEN DTABLE DTI DVBSHAP DVCREL1
    DVCREL2 DVGRID DVMREL1 DVMREL2 DVPREL1 DVPREL2 DVSET DVSHAP ECHOOFF ECHOON EIGB EIGC EIGP EIGR
    EIGRL FORCE FORCE1 FORCE2 FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 GRAV LOAD LSEQ MAT10 MAT2 MAT3 MAT4
    MAT5 MAT8 MAT9 MDLPRM MODTRAK MOMENT MOMENT1 MOMENT2 MPC MPCADD NLPARM PARAM PBCOMP PBEAML PBEND
    PBUSH PBUSH1D PBUSHT PCOMP PCOMPG PDAMP PGAP PLOAD PLOAD1 PLOAD2 PLOAD4 PLOTEL PLSOLID PMASS
    PSHEAR PSHELL PSOLID PTUBE PVISC RANDPS RANDT1 RFORCE RLOAD1 RLOAD2 SET1 SET2 SET3 SLOAD SPCD
    SPOINT TABDMP1 TABLED1 TABLED2 TABLED3 TABLED4 TABLEM1 TABLEM2 TABLEM3 TABLEM4 TABLES1 TABLEST
    TABRND1 TABRNDG TEMP TEMPD TEMPP1 TEMPRB TIC TLOAD1 TLOAD2 TSTEP TSTEPNL
"""
_REDUCTION = """
    ASET ASET1 BNDFIX BNDFIX1 BNDFREE BNDFREE1 BSET BSET1 CSET CSET1 DYNRED OMIT OMIT1 QSET QSET1
    RVDOF RVDOF1 SUPORT SUPORT1 USET USET1
"""
_REDUCING = frozenset(_REDUCTION.split())
IGNORED = frozenset(_IDLE.split()) | _REDUCING
_SUPERELEMENT = re.compile(r"SE(?!T)\w+|CSUP(ER|EXT)|EXTRN")


@dataclass(frozen=True)
class GridPoint:
    """A grid: its place in basic coordinates, and the axes of its displacements as rows."""

    card: Card
    xyz: FloatArray
    axes: FloatArray

    @property
    def name(self) -> str:
        """Return its number as a text."""
        return str(int(self.card.text(1)))


def number_cards(deck: Deck, *names: str) -> dict[int, Card]:
    """Return cards of some kinds by their number, in the order of the file.

    Raises:
        InputError: when a number is there twice, for different cards.
    """
    found: dict[int, Card] = {}
    for card in deck.cards:
        if card.name not in names:
            continue
        other = found.setdefault(card.id(1, "the number"), card)
        if other is not card and (other.name, other.fields) != (card.name, card.fields):
            raise card.error(f"{other} is there already", "a number of its own")
    if len(found) > _MOST_CARDS:
        what, expected = f"{len(found)} cards", f"at most {_MOST_CARDS}"
        raise InputError(what, file=deck.file, key=names[0], expected=expected)
    return found


def grids_of(deck: Deck) -> dict[int, GridPoint]:
    """Return the grids by their numbers; raises InputError."""
    usual = next((card for card in deck.cards if card.name == "GRDSET"), None)
    shown = 0 if usual is None else usual.id(6, "CD", 0)
    systems, found = systems_of(deck), {}
    for number, card in number_cards(deck, "GRID").items():
        xyz = systems.place(card)
        if card.text(6) == "-1":
            raise card.error("a point of a fluid", "a grid of a structure", "CD")
        motion = systems.find(card.id(6, "CD", shown), card, "CD")
        found[number] = GridPoint(card, xyz, motion.axes_at(xyz))
    return found


def systems_of(deck: Deck) -> Systems:
    """Return the coordinate systems of a file; raises InputError."""
    usual = next((card for card in deck.cards if card.name == "GRDSET"), None)
    first = 0 if usual is None else usual.id(2, "CP", 0)
    return Systems(deck.cards, number_cards(deck, "GRID"), first)


def _unread(card: Card, instead: str) -> InputError:
    if _SUPERELEMENT.fullmatch(card.name):
        return card.error("superelements are not read", "all of the structure in one section")
    return card.error("this card is not read", instead)


class BulkData:
    """What every reading of bulk data needs: grids, constraints, springs, masses, rigid links.

    Arguments:
        read: names of the cards that are read.
        instead: what is expected in place of any other card.

    Raises:
        InputError: for a card that is not read and may carry stiffness or mass, and all that is
            wrong in those that are.
    """

    def __init__(self, deck: Deck, read: frozenset[str], instead: str) -> None:
        self.deck = deck
        self.named: dict[str, list[Card]] = {}
        for card in deck.cards:
            if card.name not in read | IGNORED:
                raise _unread(card, instead)
            self.named.setdefault(card.name, []).append(card)
        weight = 1.0
        for i, card in enumerate(c for c in self.cards("PARAM") if c.text(1) == "WTMASS"):
            value = card.real(2, "WTMASS")
            if not value > 0.0 or (i and value != weight):
                raise card.error(f"{value:g}", "one number > 0", "WTMASS")
            weight = value
        self.weight = weight
        self.systems = systems_of(deck)
        self.grids = grids_of(deck)
        self.sorted = sorted(self.grids)
        self.listed = 0  # grids in lists so far
        pairs = [(card, i) for card in self.cards("PELAS") for i in (1, 5) if card.text(i)]
        self.stiffnesses = {card.id(i, "PID"): card.real(i + 1, "K") for card, i in pairs}

    def cards(self, *names: str) -> Iterator[Card]:
        """Return the cards of some names."""
        for name in names:
            yield from self.named.get(name, ())

    def grid(self, card: Card, number: int, key: str) -> GridPoint:
        """Return the grid that a field names; raises InputError."""
        return self.known(card, card.id(number, key), key)

    def known(self, card: Card, number: int, key: str) -> GridPoint:
        """Return the grid of a number that a card names; raises InputError."""
        return card.pick(self.grids, number, "GRID", key)

    def motions(self, grid: GridPoint, components: str, card: Card, key: str) -> list[str]:
        """Return the global directions that components at a grid are.

        Raises:
            InputError: where they are single directions of axes that are turned.
        """
        found: list[str] = []
        for block, shift in (("123", 0), ("456", 3)):
            chosen = [int(digit) - 1 - shift for digit in components if digit in block]
            if len(chosen) == 3:
                found += DIRECTIONS[shift : shift + 3]
                continue
            for row in chosen:
                axis = np.abs(grid.axes[row])
                if axis.max() < 1.0 - _SAME:
                    expected = "123, 456, or a grid whose axes are along x, y and z"
                    what = f"component {row + 1 + shift} of grid {grid.name} is turned"
                    raise card.error(what, expected, key)
                found.append(DIRECTIONS[shift + int(axis.argmax())])
        return found

    def spring(self, card: Card) -> tuple[float, list[tuple[GridPoint, str]]]:
        """Return stiffness, and grid and direction of each end, of a CELAS; raises InputError."""
        if card.name == "CELAS2":
            stiffness = card.real(2, "K")
        else:
            number = card.id(2, "PID", card.id(1, "EID"))
            stiffness = card.pick(self.stiffnesses, number, "PELAS", "PID")
        if stiffness < 0.0:
            raise card.error(f"{stiffness:g}", "a stiffness >= 0", "K")
        ends = []
        for i in (3, 5):
            if card.integer(i, "G", 0):
                grid = self.grid(card, i, f"G{i // 2}")
                component = card.components(i + 1, f"C{i // 2}")
                motions = self.motions(grid, component, card, f"C{i // 2}")
                if len(component) != 1:
                    raise card.error(f"component {component!r}", "one of 1 to 6", f"C{i // 2}")
                ends.append((grid, motions[0]))
        if stiffness and not ends:
            raise card.error("no grid", "one grid or two", "G1")
        return stiffness, ends

    def lumps(self, card: Card) -> tuple[GridPoint, list[tuple[float, FloatArray]]]:
        """Return the grid of a CONM2, and point masses with their arms; raises InputError."""
        grid = self.grid(card, 2, "G")
        mass = self.weight * card.real(4, "M")
        if mass < 0.0:
            raise card.error(f"{mass:g}", "a mass >= 0", "M")
        offset = np.array(card.vector(5, "X"))
        axes = np.eye(3)
        if card.text(3) == "-1":
            offset = offset - grid.xyz
        else:
            system = self.systems.find(card.id(3, "CID", 0), card, "CID")
            axes = system.axes_at(grid.xyz)
            offset = offset @ axes
        keys = ("I11", "I21", "I22", "I31", "I32", "I33")
        values = [self.weight * card.real(9 + i, key, 0.0) for i, key in enumerate(keys)]
        return grid, [(m, offset + arm) for m, arm in lumps(mass, values, axes, card)]

    def links(self, card: Card) -> tuple[GridPoint, list[tuple[GridPoint, tuple[str, ...]]]]:
        """Return the grid that an RBE2 leads by, and the others with their motions that follow."""
        leader = self.grid(card, 2, "GN")
        components = card.components(3, "CM")
        last = len(card.fields)
        if last > 4 and not card.is_integer(last) and card.text(last) != "THRU":
            last -= 1  # the coefficient of thermal expansion
        listed = Card(card.name, card.fields[:last], card.file, card.first, card.last)
        follow = [self.known(card, number, "GM") for number in self.list(listed, 4, "GM")]
        if not components or not follow:
            raise card.error("nothing follows", "components in CM and grids in GM", "CM")
        return leader, [(g, tuple(self.motions(g, components, card, "CM"))) for g in follow]

    def left_out(self, read: frozenset[str] = frozenset()) -> tuple[str, ...]:
        """Return which cards count for nothing, apart from some that are read."""
        known = [c for c in self.deck.cards if c.name != "PARAM" or c.text(1) != "WTMASS"]
        counts = Counter(card.name for card in known if card.name not in read)
        free = {card.id(1, "SID") for card in self.cards("SPC", "SPC1")}
        if not self.deck.controlled or "SPC" in self.deck.chosen:
            free = set()
        design = {"DVPREL1", "DVPREL2", "DVMREL1", "DVMREL2"} & set(counts)
        found = (
            _listed("cards left out: {}", counts, IGNORED - _REDUCING),
            _listed("nothing is reduced or held by {}: all directions stay", counts, _REDUCING),
            "properties are those of their cards, not of the design variables" * bool(design),
            f"nothing is held by SPC: no `SPC = {min(free)}` before BEGIN BULK" if free else "",
        )
        return tuple(filter(None, found))

    def other_masses(self) -> tuple[str, ...]:
        """Return that masses are consistent where the file does not ask for such."""
        cards = [card for card in self.cards("PARAM") if card.text(1) == "COUPMASS"]
        if any(card.text(2) == "YES" or card.text(2).strip("+0") == "1" for card in cards):
            return ()
        why = "the file asks for lumped ones (COUPMASS)"
        return (f"masses are consistent; {why if cards else 'Nastran lumps them by default'}",)

    def list(self, card: Card, first: int, key: str) -> list[int]:
        """Return the grids of a list; raises InputError for more than any structure needs."""
        found = card.numbers(first, key, self.sorted)
        self.listed += len(found)
        if self.listed > _MOST_CARDS:
            raise card.error("the lists name too many grids", f"at most {_MOST_CARDS}", key)
        return found

    def held(self, used: Container[str]) -> dict[str, set[str]]:
        """Return the directions held of some grids, by SPC of the chosen set and PS of GRID."""
        held: dict[str, set[str]] = {}
        for grid, components, card in self._constraints():
            if grid.name in used:
                motions = self.motions(grid, components, card, "C")
                held.setdefault(grid.name, set()).update(motions)
        usual = next(self.cards("GRDSET"), None)
        for grid in self.grids.values():
            own = grid.card if grid.card.text(7) or usual is None else usual
            if grid.name in used and own.text(7):
                motions = self.motions(grid, own.components(7, "PS"), own, "PS")
                held.setdefault(grid.name, set()).update(motions)
        return held

    def _constraints(self) -> Iterator[tuple[GridPoint, str, Card]]:
        cards = list(self.cards("SPC", "SPC1"))
        sets = {card.id(1, "SID") for card in cards}
        if "MPC" in self.deck.chosen:
            what = "a set of MPC is chosen"
            raise InputError(what, file=self.deck.file, expected="RBE2 instead")
        if not self.deck.controlled:
            for card in self.cards("MPC", "MPCADD"):
                raise card.error("this card is not read", "RBE2, or case control without MPC")
        if self.deck.controlled:
            chosen = {self.deck.chosen["SPC"]} if "SPC" in self.deck.chosen else set()
            for card in self.cards("SPCADD"):
                if card.id(1, "SID") in chosen:
                    chosen |= {card.id(i, "S") for i in range(2, len(card.fields) + 1)}
            if chosen and not chosen & sets:
                what = f"there is no SPC or SPC1 of set {min(chosen)}"
                raise InputError(what, file=self.deck.file, expected="the set of case control")
        elif len(sets) > 1:
            what = f"{len(sets)} sets, and no case control that chooses one"
            raise cards[-1].error(what, "one set, or SPC = n before BEGIN BULK", "SID")
        else:
            chosen = sets
        for card in cards:
            if card.id(1, "SID") in chosen:
                if card.name == "SPC1":
                    components = card.components(2, "C")
                    numbers = self.list(card, 3, "G")
                    pairs = [(number, components) for number in numbers]
                else:
                    rows = [i for i in (2, 5) if card.text(i)]
                    if any(card.real(i + 2, "D", 0.0) for i in rows):
                        raise card.error("a displacement that is not 0", "a grid that is held", "D")
                    pairs = [(card.id(i, "G"), card.components(i + 1, "C")) for i in rows]
                for number, components in pairs:
                    yield card.pick(self.grids, number, "GRID", "G"), components, card


def _listed(sentence: str, counts: Counter[str], names: frozenset[str]) -> str:
    """Return a sentence that lists the cards of some names, empty where there are none."""
    there = ", ".join(f"{name} ({counts[name]})" for name in sorted(names & set(counts)))
    return sentence.format(there) if there else ""


def lumps(
    mass: float, moments: list[float], axes: FloatArray, card: Card
) -> Iterator[tuple[float, FloatArray]]:
    """Return point masses, each with its place from the centre, that have the moments of a body.

    Pairs of a sixth of the mass lie on the principal axes, the rest in the centre.

    Arguments:
        moments: I11, I21, I22, I31, I32, I33 about its centre; products with their own sign.
        axes: to which these belong, as rows, (3, 3).

    Raises:
        InputError: where no body has such moments.
    """
    I11, I21, I22, I31, I32, I33 = moments
    inertia = np.array([[I11, -I21, -I31], [-I21, I22, -I32], [-I31, -I32, I33]])
    second, principal = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    largest = np.abs(second).max()
    if largest > 0.0 and (second.min() < -_SAME * largest or not mass > 0.0):
        expected = "a mass > 0 and moments of which none is larger than the sum of the others"
        raise card.error("moments of inertia that no body has", expected, "I11")
    rest = mass
    for value, direction in zip(second, principal.T, strict=True):
        if value > _SAME * largest:
            arm = np.sqrt(3.0 * value / mass) * (direction @ axes)
            rest -= mass / 3.0
            yield mass / 6.0, arm
            yield mass / 6.0, -arm
    if rest > _SAME * mass:
        yield rest, np.zeros(3)
