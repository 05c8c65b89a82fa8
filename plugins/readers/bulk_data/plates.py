"""Bulk data of plates and solids as a model of matrices in groups, one for each property."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from femubench import Model
from femubench.fem import FloatArray
from femubench.plugins.readers.attachments import Follower, NodeSpring, rigid
from femubench.plugins.readers.bulk_data.cards import Card, Deck
from femubench.plugins.readers.bulk_data.properties import at_least_0, moduli_of
from femubench.plugins.readers.bulk_data.structure import BulkData, GridPoint, number_cards
from femubench.plugins.readers.bulk_data.systems import KINDS
from femubench.plugins.readers.deck_file import SolidDeck
from femubench.plugins.readers.reading import DIRECTIONS
from femubench.plugins.readers.solid_deck import solid_model

_SAME = 1e-3  # of a factor that is stated with few digits, as 5/6 by .8333
_LINE = 1e-9  # of the moments of grids about their middle: what rounding leaves on a line
_APART = 1e-4  # grids that are nearer coincide for a CBUSH, whatever the unit


class _Element(NamedTuple):
    """An element of bulk data.

    Arguments:
        kinds: what it is read as, by its number of grids.
        of: its property.
        angle: the field of the angle of the material, which an isotropic one does not have.
        order: from its grids to those of a deck: Nastran's upright edges come before those on top.
    """

    kinds: dict[int, str]
    of: str
    angle: int = 0
    order: tuple[int, ...] = ()


_ELEMENTS = {
    "CQUAD4": _Element({4: "S4"}, "PSHELL", 7),
    "CTRIA3": _Element({3: "S3"}, "PSHELL", 6),
    "CQUAD8": _Element({8: "S8R"}, "PSHELL", 15),
    "CTRIA6": _Element({6: "S6"}, "PSHELL", 9),
    "CHEXA": _Element(
        {8: "C3D8I", 20: "C3D20R"}, "PSOLID", order=(*range(12), *range(16, 20), *range(12, 16))
    ),
    "CPENTA": _Element(
        {6: "C3D6", 15: "C3D15"}, "PSOLID", order=(*range(9), *range(12, 15), *range(9, 12))
    ),
    "CTETRA": _Element({4: "C3D4", 10: "C3D10"}, "PSOLID"),
}
_SPRINGS = ("CELAS1", "CELAS2", "CBUSH")
_RIGID = ("RBE2", "RBE3")
_PROPERTIES = frozenset(("PSHELL", "PSOLID", "PELAS", "PBUSH", "MAT1"))
_READ = frozenset(
    (*_ELEMENTS, *_PROPERTIES, *_SPRINGS, *_RIGID, *KINDS, "GRID", "GRDSET", "CONM2", "SPC", "SPC1",
     "SPCADD")
)  # fmt: skip
_INSTEAD = (
    "plates and solids alone, with CONM2, CELAS1, CELAS2, CBUSH, RBE2, RBE3, SPC; or the matrices "
    "of all (.op4, .pch)"
)


def has_plates(deck: Deck) -> bool:
    """Return whether a file has plates or solids."""
    return any(card.name in _ELEMENTS for card in deck.cards)


class BulkPlates(BulkData):
    """Bulk data as a deck of shells and solids.

    Raises:
        InputError: for a card that is not read and may carry stiffness or mass, and all that is
            wrong in those that are.
    """

    def __init__(self, deck: Deck) -> None:
        super().__init__(deck, _READ, _INSTEAD)
        self.materials = number_cards(deck, "MAT1")
        self.properties = {n: number_cards(deck, n) for n in ("PSHELL", "PSOLID", "PBUSH")}
        self.solid = SolidDeck(deck.file)
        self.attached = self.solid.attached
        self.leads: dict[tuple[int, int], Card] = {}
        actions: dict[str, Callable[[Card], None]] = {
            **dict.fromkeys(_ELEMENTS, self._element),
            **dict.fromkeys(("CELAS1", "CELAS2"), self._spring),
            **{"CONM2": self._mass, "CBUSH": self._bush, "RBE2": self._link, "RBE3": self._mean},
        }
        for card in number_cards(deck, *actions).values():
            actions[card.name](card)
        used = {n for _, own in self.solid.elements.values() for n in own}
        used |= set(self.attached.nodes())
        for name, found in self.held({str(n) for n in used}).items():
            self.solid.held |= {(int(name), DIRECTIONS.index(d)) for d in found}
        for (node, d), card in self.leads.items():
            if (node, d) in self.solid.held:
                what = f"grid {node} is held in {DIRECTIONS[d]}, where it follows"
                raise card.error(what, "no SPC or PS of what follows", "G")

    def model(self) -> Model:
        """Return the model, in the units of the file; raises InputError."""
        places = {
            g.name: (float(g.xyz[0]), float(g.xyz[1]), float(g.xyz[2])) for g in self.grids.values()
        }
        return solid_model(self.solid, places)

    def remarks(self) -> tuple[str, ...]:
        """Return which cards count for nothing or otherwise than the file says."""
        return (*self.left_out(_PROPERTIES), *self.other_masses())

    def _element(self, card: Card) -> None:
        element, number = _ELEMENTS[card.name], card.id(1, "EID")
        most = max(element.kinds)
        size = most
        while size and not card.text(size + 2):
            size -= 1
        if size not in element.kinds:
            expected = " or ".join(map(str, element.kinds))
            raise card.error(f"{size} grids", f"{expected} grids, none of them blank", "G")
        grids = [self.grid(card, 3 + i, f"G{i + 1}").name for i in range(size)]
        for i in range(3 + most, len(card.fields) + 1):
            if i != element.angle and card.real(i, f"field {i}", 0.0):
                expected = "grids in the middle of one thickness, which PSHELL states"
                raise card.error("an offset, or a thickness at a grid", expected)
        order = element.order if size == most and element.order else range(size)
        self.solid.elements[number] = element.kinds[size], tuple(int(grids[i]) for i in order)
        pid = card.id(2, "PID", number)
        name = f"{element.of} {pid}"
        if name not in self.solid.sets:
            for other in self.cards("PCOMP", "PCOMPG", "PLSOLID"):
                if other.text(1) == str(pid):
                    raise other.error("this property is not read", f"a {element.of}")
            self._property(card.pick(self.properties[element.of], pid, element.of, "PID"), name)
        self.solid.sets[name][number] = None

    def _property(self, card: Card, name: str) -> None:
        """Add a property with a material of its own, whose density has the mass without stiffness.

        A plate bends by solids of its one material: what says otherwise is refused.
        """
        of_plates = card.name == "PSHELL"
        if not of_plates and card.text(7) not in ("", "SMECH"):
            raise card.error(card.text(7)[:20], "blank or SMECH", "FCTN")
        key = "MID1" if of_plates else "MID"
        material = card.pick(self.materials, card.id(2, key), "MAT1", key)
        modulus, shear, poisson = moduli_of(material)
        if not poisson < 0.5 or abs(shear * 2.0 * (1.0 + poisson) / modulus - 1.0) > _SAME:
            raise material.error(f"G {shear:g}, NU {poisson:g}", "G = E / 2(1 + NU), NU < 0.5", "G")
        density, thickness = at_least_0(material, 5, "RHO"), np.nan
        if of_plates:
            thickness = card.real(3, "T")
            if not thickness > 0.0:
                raise card.error(f"{thickness:g}", "a thickness > 0", "T")
            for i, key in ((4, "MID2"), (6, "MID3")):
                if card.text(i) != card.text(2) and (card.text(i) or i == 4):
                    what = f"{card.text(i) or 'blank'}: a plate that does not bend as one material"
                    raise card.error(what, "the material of MID1", key)
            for i, key, usual in ((5, "12I/T**3", 1.0), (7, "TS/T", 5.0 / 6.0)):
                if abs(card.real(i, key, usual) / usual - 1.0) > _SAME:
                    raise card.error(card.text(i), f"{usual:.5g}, that of a whole plate", key)
            if card.real(11, "MID4", 0.0):
                raise card.error(card.text(11), "blank: bending apart from membrane", "MID4")
            if coat := at_least_0(card, 8, "NSM"):
                density += coat / thickness
                self.solid.coated.add(name)
        if not density > 0.0:
            raise material.error("no mass", f"RHO > 0{', or NSM of the plate' * of_plates}", "RHO")
        self.solid.sets[name], self.solid.named[name] = {}, name
        self.solid.materials[name] = [modulus, poisson, self.weight * density]
        self.solid.metals[name] = f"MAT1 {material.text(1)}"
        self.solid.sections[name] = name, thickness

    def _mass(self, card: Card) -> None:
        grid, found = self.lumps(card)
        arms = ((m, rigid(arm)[:3]) for m, arm in found)
        whole = sum((m * arm.T @ arm for m, arm in arms), np.zeros((6, 6)))
        self.attached.masses.append((int(grid.name), whole))

    def _spring(self, card: Card) -> None:
        stiffness, ends = self.spring(card)
        pid = card.id(1, "EID") if card.name == "CELAS2" else card.id(2, "PID", card.id(1, "EID"))
        name = f"{card.name if card.name == 'CELAS2' else 'PELAS'} {pid}"
        rows = [
            (int(grid.name), sign * np.eye(6)[[DIRECTIONS.index(d)]])
            for sign, (grid, d) in zip((1.0, -1.0), ends, strict=False)
        ]
        self._add_spring(name, rows, np.array([stiffness]))

    def _add_spring(
        self, name: str, ends: list[tuple[int, FloatArray]], stiffness: FloatArray
    ) -> None:
        if stiffness.any():
            self.attached.springs.append(NodeSpring(name, ends, stiffness))

    def _bush(self, card: Card) -> None:
        number = card.id(2, "PID", card.id(1, "EID"))
        of = card.pick(self.properties["PBUSH"], number, "PBUSH", "PID")
        stiffness = _bush_stiffness(of)
        first = self.grid(card, 3, "GA")
        second = self.grid(card, 4, "GB") if card.integer(4, "GB", 0) else None
        if card.integer(10, "OCID", -1) >= 0:
            raise card.error("a place of its own", "a place on the line of its grids (S)", "OCID")
        line = np.zeros(3) if second is None else second.xyz - first.xyz
        axes = self._bush_axes(card, first, line, stiffness)
        share = card.real(9, "S", 0.5)
        turn = np.kron(np.eye(2), axes)
        ends = [(int(first.name), turn @ rigid(share * line))]
        if second is not None:
            ends.append((int(second.name), -turn @ rigid((share - 1.0) * line)))
        self._add_spring(f"PBUSH {number}", ends, stiffness)

    def _bush_axes(
        self, card: Card, first: GridPoint, line: FloatArray, stiffness: FloatArray
    ) -> FloatArray:
        """Return the axes of a CBUSH as rows, basic ones where nothing says otherwise."""
        if card.text(8):
            return self.systems.find(card.id(8, "CID", 0), card, "CID").axes_at(first.xyz)
        length = float(np.linalg.norm(line))
        if length < _APART:
            return np.eye(3)
        if card.is_integer(5) and not card.text(6) and not card.text(7):
            towards = card.pick(self.grids, card.id(5, "GO"), "GRID", "GO").xyz - first.xyz
        else:
            towards = np.array(card.vector(5, "X")) @ first.axes
        if not towards.any() and not stiffness[[1, 2, 4, 5]].any():
            towards = np.eye(3)[np.abs(line).argmin()]  # nothing depends on it
        up = np.cross(line, towards)
        size = float(np.linalg.norm(up))
        if not size > 1e-6 * length * np.linalg.norm(towards):
            raise card.error("no vector across the spring", "CID, or X1, X2, X3 or GO", "X1")
        x, z = line / length, up / size
        return np.array([x, np.cross(z, x), z])

    def _link(self, card: Card) -> None:
        leader, found = self.links(card)
        for grid, motions in found:
            of = {int(leader.name): rigid(grid.xyz - leader.xyz)}
            self._follow(card, grid, motions, of)

    def _mean(self, card: Card) -> None:
        """Add the grid that an RBE3 moves by the mean motion of others, by least squares."""
        grid = self.grid(card, 3, "REFGRID")
        along = self.motions(grid, card.components(4, "REFC"), card, "REFC")
        texts = [text for text in card.fields[4:] if text]
        if "UM" in texts:
            raise card.error("UM", "the reference grid follows", "UM")
        texts = texts[: texts.index("ALPHA") if "ALPHA" in texts else None]
        weighed = [i for i, text in enumerate(texts) if "." in text]
        if not along or weighed[:1] != [0]:
            expected = "REFC, and a weight, 123 and grids behind it"
            raise card.error("nothing to follow", expected, "WT1")
        own: dict[int, FloatArray] = {}
        whole = np.zeros((6, 6))
        for start, end in pairwise([*weighed, len(texts)]):
            fields = (card.text(1), *texts[start:end])
            row = Card(card.name, fields, card.file, card.first, card.last)
            weight = row.real(2, "WT")
            if row.text(3) != "123" or not weight > 0.0:
                what = f"weight {weight:g} of directions {row.text(3)[:20]!r}"
                raise card.error(what, "a weight > 0, and 123", "C")
            for number in self.list(row, 4, "G"):
                arm = self.known(card, number, "G").xyz - grid.xyz
                motion = rigid(arm)[:3]
                own[number] = own.get(number, np.zeros((6, 6)))
                own[number][:, :3] += weight * motion.T
                whole += weight * motion.T @ motion
        size = np.sqrt(np.where(whole.diagonal() > 0.0, whole.diagonal(), 1.0))
        scaled = whole / np.outer(size, size)
        if np.linalg.eigvalsh(scaled).min() < _LINE:
            raise card.error("the grids lie on one line", "three grids that do not", "G")
        of = {n: np.asarray(np.linalg.solve(whole, p), np.float64) for n, p in own.items()}
        self._follow(card, grid, along, of)

    def _follow(
        self, card: Card, grid: GridPoint, along: Sequence[str], of: dict[int, FloatArray]
    ) -> None:
        node, directions = int(grid.name), frozenset(map(DIRECTIONS.index, along))
        self.attached.followers.append(Follower(node, directions, of))
        for d in directions:
            other = self.leads.setdefault((node, d), card)
            if other is not card:
                raise card.error(f"grid {node} follows {other} already", "one that leads", "G")


def _bush_stiffness(card: Card) -> FloatArray:
    """Return K1 to K6 of a PBUSH, (6,); raises InputError."""
    for row in range(0, len(card.fields), 8):
        if card.text(row + 2) == "K":
            return np.array([at_least_0(card, row + 3 + i, f"K{i + 1}") for i in range(6)])
        if card.text(row + 2) == "M":
            raise card.error("a mass", "a CONM2", "M")
    raise card.error("no stiffness", "K, and K1 to K6 behind it", "K")
