"""The frame that bulk data describe: grids are joints, CBAR and CBEAM members, RBE2 rigid links."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
from femubench.plugins.readers.bulk_data.structure import BulkData, GridPoint, number_cards
from femubench.plugins.readers.bulk_data.systems import KINDS
from femubench.plugins.readers.reading import DIRECTIONS

PROPERTIES = ("PBAR", "PBARL", "PBEAM", "PROD")
_BARS = ("CBAR", "CBEAM")
ELEMENTS = (*_BARS, "CROD", "CELAS1", "CELAS2", "CONM2", "RBE2")
_MOST_MEMBERS = 20_000
_ALONG = 1e-6  # how far a spring between two grids may point off the line between them
_SAME = 1e-9
_READ = frozenset(
    (
        *(*PROPERTIES, *_BARS, *KINDS, "GRID", "GRDSET", "BAROR", "CROD", "MAT1", "CONM2"),
        *("CELAS1", "CELAS2", "PELAS", "RBE2", "SPC", "SPC1", "SPCADD"),
    )
)
_OTHER = frozenset(("PBCOMP", "PBEAML", "PBEND"))  # left out where no bar names them


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
