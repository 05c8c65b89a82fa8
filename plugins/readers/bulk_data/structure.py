"""The frame that bulk data describe: grids are joints, CBAR and CBEAM members, RBE2 rigid links."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from femubench import InputError, Model
from femubench.fem import (
    Brace,
    Factor,
    FloatArray,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Link,
    Member,
    MemberSet,
    ModelError,
    Place,
    PointMass,
    Support,
)
from femubench.plugins.readers.bulk_data.cards import Card, Deck
from femubench.plugins.readers.bulk_data.properties import Bar, bar_of
from femubench.plugins.readers.bulk_data.systems import KINDS, Systems
from femubench.plugins.readers.reading import DIRECTIONS

PROPERTIES = ("PBAR", "PBARL", "PBEAM", "PROD")
_BARS = ("CBAR", "CBEAM")
ELEMENTS = (*_BARS, "CROD", "CELAS1", "CELAS2", "CONM2", "RBE2")
_MOST_MEMBERS, _MOST_CARDS = 20_000, 1_000_000
_ALONG = 1e-6  # how far a spring between two grids may point off the line between them
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
_READ = frozenset(
    (
        *(*PROPERTIES, *_BARS, *KINDS, "GRID", "GRDSET", "BAROR", "CROD", "MAT1", "CONM2"),
        *("CELAS1", "CELAS2", "PELAS", "RBE2", "SPC", "SPC1", "SPCADD"),
    )
)
_OTHER = frozenset(("PBCOMP", "PBEAML", "PBEND"))  # left out where no bar names them
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


@dataclass
class Parts:
    """What of a frame has been found so far.

    Arguments:
        offsets: joints at the ends of bars next to their grids, by grid and offset.
        arms: how many such joints a grid has.
        of: the card of a part of the frame, by the part's id in memory.
    """

    members: list[Member] = field(default_factory=list)
    masses: list[PointMass] = field(default_factory=list)
    springs: list[GroundSpring] = field(default_factory=list)
    supports: list[Support] = field(default_factory=list)
    joint_springs: list[JointSpring] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    braces: list[Brace] = field(default_factory=list)
    joints: dict[str, Joint] = field(default_factory=dict)
    offsets: dict[tuple[float, ...], str] = field(default_factory=dict)
    arms: dict[str, int] = field(default_factory=dict)
    of: dict[int, Card] = field(default_factory=dict)

    def add(self, key: str, part: Any, card: Card) -> None:  # noqa: ANN401 - a part of a frame
        """Add a part that a card describes."""
        getattr(self, key).append(part)
        self.of[id(part)] = card


def _unread(card: Card, instead: str) -> InputError:
    if _SUPERELEMENT.fullmatch(card.name):
        return card.error("superelements are not read", "all of the structure in one section")
    return card.error("this card is not read", instead)


class BulkData:
    """What every reading of bulk data needs: grids, constraints, springs, masses, rigid links.

    Arguments:
        deck: all cards.
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
        counts = Counter(card.name for card in self.deck.cards if card.name not in read)
        design = {"DVPREL1", "DVPREL2", "DVMREL1", "DVMREL2"} & set(counts)
        found = (
            _listed("cards left out: {}", counts, IGNORED - _REDUCING),
            _listed("nothing is reduced or held by {}: all directions stay", counts, _REDUCING),
            "properties are those of their cards, not of the design variables" * bool(design),
        )
        return tuple(filter(None, found))

    def other_masses(self) -> tuple[str, ...]:
        """Return that masses are consistent where the file does not ask for such."""
        cards = [card for card in self.cards("PARAM") if card.text(1) == "COUPMASS"]
        if any(card.text(2) == "YES" or card.text(2).strip("+0") == "1" for card in cards):
            return ()
        return ("masses are consistent; the file asks for lumped ones (COUPMASS)",)

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


class BulkFrame(BulkData):
    """Bulk data as a frame; arguments and errors are those of `BulkData`."""

    def __init__(self, deck: Deck) -> None:
        super().__init__(
            deck, _READ, "a frame of CBAR, CBEAM, CROD, CONM2, CELAS2, RBE2, SPC; see the docs"
        )
        materials = number_cards(deck, "MAT1")
        properties = number_cards(deck, *PROPERTIES).items()
        self.bars = {number: bar_of(card, materials) for number, card in properties}
        self.parts = Parts()
        self.bar_of: dict[str, Bar] = {}  # by member
        self.card_of: dict[str, Card] = {}

    def frame(self) -> Frame:
        """Return the frame, in the units of the file."""
        elements = number_cards(self.deck, *ELEMENTS)
        actions: dict[str, Callable[[Card], None]] = {
            **dict.fromkeys(_BARS, self._bar),
            **dict.fromkeys(("CELAS1", "CELAS2"), self._spring),
            **{"CONM2": self._mass, "RBE2": self._link},
        }
        for card in elements.values():
            if card.name in actions:
                actions[card.name](card)
        cards = [card for card in elements.values() if card.name not in actions]
        springs = (s for s in self.parts.springs if s.direction in DIRECTIONS[3:])
        found = {spring.at.joint for spring in springs if spring.at.joint is not None}
        turning = found | self._joined()
        for card in cards:
            number = card.id(2, "PID", card.id(1, "EID"))
            bar = self._property(card, number, ("PROD",))
            ends = tuple(self.grid(card, 3 + i, f"G{i + 1}") for i in range(2))
            names = {grid.name for grid in ends}
            if not names <= turning:  # the joint turns freely with the rod
                bar = replace(bar, of=replace(bar.of, J=0.0))
            self._rod(card, bar, ends, lumped=bool(names & turning))
        if not self.parts.members:
            what, expected = "there is no bar", "a frame of CBAR or CBEAM, or a truss of CROD"
            raise InputError(what, file=self.deck.file, expected=expected)
        self._supports()
        self._check_held()
        return self._assembled()

    def model(self) -> Model:
        """Return the model of the frame; raises InputError at the card of what is wrong in it."""
        frame = self.frame()
        try:
            with np.errstate(all="ignore"):
                model = Model.of(frame)
        except ModelError as error:
            card = self.parts.of.get(id(error.item))
            if card is None:
                raise InputError(str(error), file=self.deck.file) from None
            raise card.error(str(error)) from None
        if not all(np.isfinite(m.data).all() for m in (model.mass, model.stiffness)):
            what, expected = "the matrices are not finite", "constants of a real structure"
            raise InputError(what, file=self.deck.file, expected=expected)
        if model.size == 0:
            raise InputError("nothing can move", file=self.deck.file, expected="a free direction")
        return model

    def known(self, card: Card, number: int, key: str) -> GridPoint:
        """Return the grid of a number that a card names, and make a joint of it."""
        grid = super().known(card, number, key)
        self._joint(grid.name, grid.xyz)
        return grid

    def _joint(self, name: str, xyz: FloatArray) -> str:
        x, y, z = (float(v) for v in xyz)
        self.parts.joints.setdefault(name, Joint(name, (x, y, z)))
        return name

    def _bar(self, card: Card) -> None:
        usual = next(self.cards("BAROR"), None) if card.name == "CBAR" else None
        own = card.id(1, "EID")
        number = card.id(2, "PID", own if usual is None else usual.id(2, "PID", own))
        kinds = ("PBAR", "PBARL") if card.name == "CBAR" else ("PBEAM",)
        bar = self._property(card, number, kinds)
        ends = [self.grid(card, 3 + i, key) for i, key in enumerate(("GA", "GB"))]
        flags = card.text(8) or (usual.text(8) if usual else "") or "GGG"
        if flags not in ("GGG", "BGG", "GGO", "GOG", "GOO", "BGO", "BOG", "BOO"):
            raise card.error(f"{flags[:20]!r}", "GGG, or B and O in it", "OFFT")
        offsets = [np.array(card.vector(11 + 3 * i, f"W{end}")) for i, end in enumerate("AB")]
        if "O" in flags[1:] and any(o.any() for o in offsets):
            raise card.error(
                "offsets along the axes of the bar", "along those of its grids", "OFFT"
            )
        names = tuple(
            self._end(grid, w @ grid.axes, card) for grid, w in zip(ends, offsets, strict=True)
        )
        start, stop = (np.array(self.parts.joints[name].xyz) for name in names)
        if names[0] == names[1] or not np.linalg.norm(stop - start) > 0.0:
            raise card.error("the bar has no length", "two grids apart", "GB")
        x = (stop - start) / np.linalg.norm(stop - start)
        first = ends[0]
        source = card if usual is None or any(card.text(i) for i in (5, 6, 7)) else usual
        if source.is_integer(5) and not source.text(6) and not source.text(7):
            turn = card.pick(self.grids, source.id(5, "G0"), "GRID", "G0")
            v = np.asarray(turn.xyz - first.xyz)
        else:
            vector = np.array(source.vector(5, "X"))
            if not vector.any():
                raise card.error("no orientation vector", "X1, X2, X3 or G0", "X1")
            v = np.asarray(vector if flags[0] == "B" else vector @ first.axes)
        up = np.cross(x, v)
        if not np.linalg.norm(up) > 1e-6 * np.linalg.norm(v):
            raise card.error("the orientation vector lies along the bar", "one across it", "X1")
        member = self._member(card, bar, (names[0], names[1]), up)
        for number, key, joint in ((9, "PA", member.ends[0]), (10, "PB", member.ends[1])):
            components = card.components(number, key)
            if components:
                released = {DIRECTIONS[int(digit) - 1]: 0.0 for digit in components}
                self.parts.add("joint_springs", JointSpring(joint, member.name, released), card)
        if card.name == "CBEAM" and any(card.real(i, "SA", 0.0) for i in (17, 18)):
            raise card.error("warping", "no SA and SB", "SA")

    def _property(self, card: Card, number: int, kinds: tuple[str, ...]) -> Bar:
        bar = self.bars.get(number)
        if bar is None or bar.card.name not in kinds:
            wanted = " or ".join(kinds)
            other = next(
                (c for c in self.deck.cards if c.name in _OTHER and c.text(1) == str(number)), None
            )
            if other is not None:
                raise other.error("this property is not read", f"a {wanted}")
            raise card.error(f"there is no {wanted} {number}", f"the number of a {wanted}", "PID")
        return bar

    def _end(self, grid: GridPoint, offset: FloatArray, card: Card) -> str:
        """Return the joint of an end of a bar: its grid, or a joint that is linked to it."""
        if not offset.any():
            return grid.name
        key = (float(grid.name), *(float(v) for v in offset))
        if key not in self.parts.offsets:
            count = self.parts.arms[grid.name] = self.parts.arms.get(grid.name, 0) + 1
            name = self._joint(f"{grid.name}.{count}", grid.xyz + offset)
            self.parts.offsets[key] = name
            self.parts.add("links", Link(grid.name, (name,)), card)
        return self.parts.offsets[key]

    def _joined(self) -> set[str]:
        """Return the joints of bars and links, which take up rotations."""
        found = {name for link in self.parts.links for name in (link.leads, *link.follows)}
        bars = (m for m in self.parts.members if self.card_of[m.name].name != "CROD")
        return found | {name for member in bars for name in member.ends}

    def _rod(self, card: Card, bar: Bar, ends: tuple[GridPoint, ...], *, lumped: bool) -> None:
        """Add a member that does not bend; lumped: half of its mass at either end, else its own.

        Where a joint turns, mass of a member would turn with it.
        """
        x = ends[1].xyz - ends[0].xyz
        length = float(np.linalg.norm(x))
        if not length > 0.0:
            raise card.error("the rod has no length", "two grids apart", "G2")
        half = 0.5 * self.weight * (bar.rho * bar.of.A + bar.of.nsm) * length
        if lumped:
            bar = replace(bar, rho=0.0, of=replace(bar.of, nsm=0.0))
            for grid in ends if half > 0.0 else ():
                self.parts.add("masses", PointMass(Place(joint=grid.name), half), card)
        # Any vector across will do: nothing depends on it.
        up = np.asarray(np.cross(x, np.eye(3)[np.abs(x).argmin()]), dtype=float)
        self._member(card, bar, (ends[0].name, ends[1].name), up)

    def _member(self, card: Card, bar: Bar, ends: tuple[str, str], up: FloatArray) -> Member:
        """Add the member of an element."""
        name, z = f"E{card.id(1, 'EID')}", up / np.linalg.norm(up)
        member = Member(
            name,
            ends,
            1,
            bar.frame_section(),
            bar.frame_material(weight=self.weight),
            (float(z[0]), float(z[1]), float(z[2])),
        )
        self.parts.add("members", member, card)
        self.bar_of[name], self.card_of[name] = bar, card
        return member

    def _spring(self, card: Card) -> None:
        stiffness, ends = self.spring(card)
        if stiffness == 0.0:
            return
        if len(ends) == 1:
            spring = GroundSpring(Place(joint=ends[0][0].name), ends[0][1], stiffness)
            self.parts.add("springs", spring, card)
            return
        (first, one), (second, other) = ends
        along = second.xyz - first.xyz
        off = np.delete(np.abs(along), "xyz".index(one)) if one in "xyz" else np.ones(1)
        if one != other or not off.max() <= _ALONG * np.abs(along).max():
            expected = "to ground, or along the line between the two grids"
            raise card.error("a spring between two grids across their line", expected)
        self.parts.add("braces", Brace((first.name, second.name), stiffness), card)

    def _mass(self, card: Card) -> None:
        grid, found = self.lumps(card)
        for m, arm in found:
            x, y, z = (float(v) for v in arm)
            self.parts.add("masses", PointMass(Place(joint=grid.name), m, (x, y, z)), card)

    def _link(self, card: Card) -> None:
        """Add the rigid links of an RBE2; grids that follow in the same motions share one."""
        leader, found = self.links(card)
        follows: dict[tuple[str, ...], list[str]] = {}
        for grid, motions in found:
            follows.setdefault(motions, []).append(grid.name)
        for motions, names in follows.items():
            link = Link(leader.name, tuple(names), () if len(motions) == 6 else motions)
            self.parts.add("links", link, card)

    def _supports(self) -> None:
        """Hold what the constraints hold that case control chooses, or all where there is none."""
        for name, stopped in self.held(self.parts.joints).items():
            fixed = tuple(d for d in DIRECTIONS if d in stopped)
            if fixed:
                self.parts.supports.append(Support(Place(joint=name), fixed))

    def _check_held(self) -> None:
        """Check that every joint is part of the structure; hold rotations that nothing resists."""
        joined = self._joined()
        ends = [member.ends for member in self.parts.members]
        ends += [brace.ends for brace in self.parts.braces]
        pulled = {name for pair in ends for name in pair}
        sprung: dict[str | None, set[str]] = {}
        for spring in self.parts.springs:
            sprung.setdefault(spring.at.joint, set()).add(spring.direction)
        for name in self.parts.joints:
            if name in joined:
                continue
            if name not in pulled and name not in sprung:
                card = self.grids[int(name)].card
                raise card.error("nothing holds this grid", "a bar, a rod, a spring or an RBE2")
            idle = tuple(d for d in DIRECTIONS[3:] if d not in sprung.get(name, ()))
            if idle:
                self.parts.supports.append(Support(Place(joint=name), idle))

    def remarks(self) -> tuple[str, ...]:
        """Return what the frame leaves out or takes otherwise than the file says."""
        rods = [name for name, card in self.card_of.items() if card.name == "CROD"]
        lumped = [name for name in rods if not self.bar_of[name].rho > 0.0]
        twisting = [n for n in rods if self.bar_of[n].card.real(4, "J", 0.0) > self.bar_of[n].of.J]
        found = []
        if lumped:
            what = "half of their mass at either end, which no factor on density changes"
            found.append(f"{len(lumped)} CROD parallel to bars: {what}")
        if twisting:
            found.append("J of PROD is left out: a joint of rods alone takes up no twist")
        consistent = any(m.material.rho > 0.0 for m in self.parts.members)
        return (*self.left_out(), *found, *self.other_masses() * consistent)

    def _assembled(self) -> Frame:
        parts = self.parts
        if len(parts.members) > _MOST_MEMBERS or len(parts.joints) > _MOST_MEMBERS:
            what, expected = f"{len(parts.members)} bars", f"at most {_MOST_MEMBERS}"
            raise InputError(what, file=self.deck.file, expected=expected)
        found: dict[str, list[str]] = {}
        for kind in ("section", "material"):
            for member in parts.members:
                found.setdefault(f"{kind}:{getattr(member, kind).name}", []).append(member.name)
        return Frame(
            plane="3d",
            beam="timoshenko"
            if any(b.has_shear for b in self.bar_of.values())
            else "euler-bernoulli",
            joints=tuple(sorted(parts.joints.values(), key=lambda j: self._order(j.name))),
            members=tuple(parts.members),
            masses=tuple(parts.masses),
            springs=tuple(parts.springs),
            supports=tuple(parts.supports),
            joint_springs=tuple(parts.joint_springs),
            links=tuple(parts.links),
            braces=tuple(parts.braces),
            factors=tuple(_factors(self.bar_of)),
            families=tuple(MemberSet(word, tuple(names)) for word, names in found.items()),
        )

    def _order(self, name: str) -> tuple[int, int]:
        grid, _, number = name.partition(".")
        return int(grid), int(number or 0)


def _listed(sentence: str, counts: Counter[str], names: frozenset[str]) -> str:
    """Return a sentence that lists the cards of some names, empty where there are none."""
    there = ", ".join(f"{name} ({counts[name]})" for name in sorted(names & set(counts)))
    return sentence.format(there) if there else ""


def _factors(bars: dict[str, Bar]) -> Iterator[Factor]:
    """Return what makes members differ from material times section.

    Mass without stiffness (NSM) adds to the translations alone; a bar without shear coefficients
    bends as Euler's and Bernoulli's beam, also among others.
    """
    timoshenko = any(bar.has_shear for bar in bars.values())
    groups: dict[tuple[str, float], list[str]] = {}
    for name, bar in bars.items():
        if bar.of.nsm:
            if not bar.rho * bar.of.A > 0.0:
                expected = "a MAT1 with RHO > 0 with NSM"
                raise bar.card.error("mass of a bar without density", expected, "NSM")
            groups.setdefault(("rhoA", 1.0 + bar.of.nsm / (bar.rho * bar.of.A)), []).append(name)
        if timoshenko and not bar.has_shear:
            for quantity in ("shear", "rotary"):
                groups.setdefault((quantity, 0.0), []).append(name)
        elif timoshenko and not (bar.of.K1 > 0.0 and bar.of.K2 > 0.0):
            expected = "both K1 and K2, or neither"
            raise bar.card.error("shear in one plane alone", expected, "K1")
    for (quantity, factor), names in groups.items():
        yield Factor(quantity, tuple(names), factor)


def lumps(
    mass: float, moments: list[float], axes: FloatArray, card: Card
) -> Iterator[tuple[float, FloatArray]]:
    """Return point masses, each with its place from the centre, that have the moments of a body.

    Pairs of a sixth of the mass lie on the principal axes, the rest in the centre.

    Arguments:
        mass: of the body.
        moments: I11, I21, I22, I31, I32, I33 about its centre; products with their own sign.
        axes: to which these belong, as rows, (3, 3).
        card: for errors.

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
