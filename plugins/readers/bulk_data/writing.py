"""An updated frame as bulk data: new numbers in cards of properties and materials.

Everything else stays byte for byte. Bars of one property that have become different get copies of
it with numbers of their own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from femubench import InputError, Model
from femubench.fem import BeamProperties, FloatArray, GroundSpring, Place, PointMass, Structure
from femubench.plugins.readers.bulk_data.cards import Card, Deck
from femubench.plugins.readers.bulk_data.frame import ELEMENTS, PROPERTIES, BulkFrame
from femubench.plugins.readers.bulk_data.plates import BulkPlates, has_plates
from femubench.plugins.readers.bulk_data.properties import SHAPES, Bar
from femubench.plugins.readers.bulk_data.structure import GridPoint, number_cards
from femubench.plugins.readers.deck_file import REST
from femubench.plugins.readers.reading import DIRECTIONS
from femubench.plugins.readers.solid_deck import factors_of

_SAME = 1e-12  # far below any update, above the rounding of a change of units
_KEPT = 1e-9  # to which the matrices must be those of bars with other properties
_WIDTH = 16  # of a large field, the widest that Nastran knows
_EXPECTED = (
    "factors on properties, masses and springs to ground at grids; .op4 and .mtx hold any matrices"
)
# Properties of elements that follow from the numbers of cards.
_SAID = ("EA", "EIy", "EIz", "GJ", "flex_y", "flex_z", "rhoA", "rhoJp", "rhoIy", "rhoIz")
# Field of a PBAR or PBEAM -> the number; the first row, and K1 and K2.
_ROW = ("A", "I1", "I2", "J", "nsm")

Numbers = tuple[tuple[str, float], ...]
# By file and first line: the last line that goes, and what comes instead.
_Changes = dict[Path, dict[int, tuple[int, list[bytes]]]]


def write_cards(model: Model, path: Path, original: Path) -> None:
    """Write a file like the original one, with the properties of a model.

    Arguments:
        model: of the frame that the original describes, in the units of that.
        path: the new file; what the original includes is written next to it.
        original: the file that the model comes from.

    Raises:
        InputError: for what cards of properties cannot say.
    """
    deck = Deck(original)
    if has_plates(deck):
        return _write(deck, _scaled(BulkPlates(deck), model, path), path, original)
    reading = BulkFrame(deck)
    nominal = reading.model().frame_structure
    if model.structure is None or model.mass_change or model.stiffness_change:
        raise _refusal(path)
    masses = model.structure.frame.masses[len(nominal.frame.masses) :]
    springs = model.structure.frame.springs[len(nominal.frame.springs) :]
    laden = nominal.rebuilt(nominal.frame.with_attachments(masses, springs))
    changed = _changed(model, laden, reading.bar_of, path)
    cards = _Cards(reading)
    cards.assign(changed)
    cards.attach(masses, springs, path)
    return _write(deck, cards.edits, path, original)


def _scaled(reading: BulkPlates, model: Model, path: Path) -> _Changes:
    """Return the cards of factors on groups of plates, solids and springs; raises InputError."""
    found = factors_of(reading.model(), model)
    expected = ".op4 or .mtx, which hold any"
    if found is None or (reading.attached.masses and found[1].get(REST, 1.0) != 1.0):
        what = "the update is no factor on properties"
        raise InputError(what, file=path, expected=expected)
    factors, heavier = found
    edits = _Factors(reading.deck)
    for name in [*reading.solid.sets, *reading.attached.groups()]:
        factor = factors.get(name, factors.get(REST, 1.0))
        grown = heavier.get(name, heavier.get(REST, 1.0))
        word, number = name.split()
        card = number_cards(reading.deck, word).get(int(number))
        if card is None:  # the second PELAS of a card
            raise InputError(f"{name} is not the first of its card", file=path, expected=expected)
        material = reading.materials[card.id(2, "MID")] if name in reading.solid.sets else None
        if factor != 1.0 or (grown != 1.0 and material):
            edits.scale(card, factor, grown, material)
    return edits.edits


def _refusal(path: Path) -> InputError:
    what = "the update changed more than cards can say"
    return InputError(what, file=path, expected=_EXPECTED)


def _changed(
    model: Model, nominal: Structure, bars: Mapping[str, Bar], path: Path
) -> dict[str, tuple[Numbers, Numbers]]:
    """Return the new numbers of property and material of every bar; raises InputError."""
    structure = model.frame_structure
    new = structure.properties
    if structure.labels != nominal.labels or model.size != len(nominal.kinematics.node):
        raise _refusal(path)
    wanted: Structure = replace(nominal, properties=new)
    if not model.has_matrices(*wanted.matrices(), _KEPT):
        raise _refusal(path)
    for f in fields(BeamProperties):
        before, after = getattr(nominal.properties, f.name), getattr(new, f.name)
        arisen = (before == 0.0) & (after != 0.0)
        if arisen.any() or (f.name not in _SAID and not np.allclose(before, after, _KEPT, 0.0)):
            raise _refusal(path)
    found: dict[str, tuple[Numbers, Numbers]] = {}
    for i, (name, bar) in enumerate(bars.items()):
        # By what every property of the element has been multiplied, 1 where it is 0.
        ratio = {}
        for f in fields(BeamProperties):
            before, after = (float(getattr(p, f.name)[i]) for p in (nominal.properties, new))
            times = after / before if before else 1.0
            ratio[f.name] = 1.0 if abs(times - 1.0) <= _SAME else times
        # The cards leave open how a rigidity is parted between modulus and section: of the ways to
        # say it the one that changes least is taken, the first of several. RHO follows from the
        # torsional inertia RHO (I1 + I2), and NSM makes up the mass.
        moduli = dict.fromkeys((1.0, *(ratio[key] for key in ("EA", "EIy", "EIz", "GJ"))))
        ways = (_parted(bar, ratio, e) for e in moduli)
        found[name] = min(ways, key=lambda way: len(way[0]) + len(way[1]))
        of, rho = dict(found[name][0]), dict(found[name][1]).get("rho", bar.rho)
        inertia = (
            (ratio["rhoIy"], rho * of.get("I2", bar.of.I2), bar.rho * bar.of.I2),
            (ratio["rhoIz"], rho * of.get("I1", bar.of.I1), bar.rho * bar.of.I1),
        )
        kept = (abs(r * old - now) <= _KEPT * abs(old) for r, now, old in inertia)
        if bar.has_shear and not all(kept):
            what = f"bar {name!r} has a rotary inertia or a shear of its own"
            raise InputError(what, file=path, expected=_EXPECTED)
    return found


def _parted(bar: Bar, ratio: Mapping[str, float], e: float) -> tuple[Numbers, Numbers]:
    """Return the changed numbers where the moduli are multiplied by e."""
    of = bar.of
    a, i1, i2 = (ratio[name] / e for name in ("EA", "EIz", "EIy"))
    polar = of.I1 + of.I2
    grown = (i1 * of.I1 + i2 * of.I2) / polar if polar else 1.0
    r = ratio["rhoJp"] / grown if polar else ratio["rhoA"]
    nsm = (bar.rho * of.A + of.nsm) * ratio["rhoA"] - r * bar.rho * a * of.A
    scale = bar.rho * of.A + of.nsm
    section = {
        "A": a,
        "I1": i1,
        "I2": i2,
        "J": ratio["GJ"] / e,
        "K1": 1.0 / (ratio["flex_y"] * e * a),
        "K2": 1.0 / (ratio["flex_z"] * e * a),
    }
    numbers = [
        (key, factor * getattr(of, key))
        for key, factor in section.items()
        if getattr(of, key) and abs(factor - 1.0) > _SAME
    ]
    if abs(nsm - of.nsm) > _SAME * scale:
        numbers.append(("nsm", nsm))
    moduli = (("E", e), ("G", e), ("rho", r))
    material = [(key, f * getattr(bar, key)) for key, f in moduli if abs(f - 1.0) > _SAME]
    return tuple(numbers), tuple(material)


class _Edits:
    """Cards in place of others, and the highest numbers so far."""

    def __init__(self, deck: Deck) -> None:
        self.lines = deck.lines
        self.edits: _Changes = {}
        self.highest = {
            key: max((c.id(1, key) for c in deck.cards if c.name in names), default=0)
            for key, names in (
                ("PID", PROPERTIES),
                ("MID", ("MAT1",)),
                ("EID", (*ELEMENTS, "PLOTEL")),
            )
        }

    def _next(self, kind: str, card: Card) -> str:
        self.highest[kind] += 1
        if self.highest[kind] > 99_999_999:
            raise card.error("no number is left for a new card", "numbers below 99999999")
        return str(self.highest[kind])

    def _put(self, card: Card, lines: list[bytes]) -> None:
        self.edits.setdefault(card.file, {})[card.first] = (card.last, lines)

    def _old(self, card: Card) -> list[bytes]:
        return self.lines[card.file][card.first : card.last + 1]

    def _card(self, old: Card, name: str, texts: Sequence[str]) -> list[bytes]:
        """Return a card in large fields, with the end of line of the old one."""
        end = b"\r\n" if self.lines[old.file][old.first].endswith(b"\r\n") else b"\n"
        rows = [texts[i : i + 4] for i in range(0, len(texts), 4)]
        heads = [f"{name}*", *["*"] * len(rows)]
        return [
            f"{head:<8}{''.join(f'{text:<{_WIDTH}}' for text in row)}".rstrip().encode() + end
            for head, row in zip(heads, rows, strict=False)
        ]


class _Factors(_Edits):
    """Scales properties of plates, solids and springs: a plate or solid gets a MAT1 of its own."""

    def scale(self, card: Card, factor: float, heavier: float, material: Card | None) -> None:
        """Write a property, or a CELAS2, as much stiffer and heavier as stated."""
        texts = [*card.fields, *[""] * 8]
        if material is None:
            row = texts.index("K") + 1 if card.name == "PBUSH" else 1
            for i in range(row, row + 6 if card.name == "PBUSH" else row + 1):
                texts[i] = real(factor * card.real(i + 1, "K")) if texts[i] else ""
            self._put(card, self._card(card, card.name, _fitting(card, texts)))
            return
        number = self._next("MID", material)
        for i in (1, 3, 5) if card.name == "PSHELL" else (1,):
            texts[i] = number if texts[i] else ""
        if card.name == "PSHELL" and texts[7]:
            texts[7] = real(heavier * card.real(8, "NSM"))
        own = [number, *material.fields[1:]]
        for i, times in ((1, factor), (2, factor), (4, heavier)):
            if material.text(i + 1):
                own[i] = real(times * material.real(i + 1, "a number"))
        cards = self._card(card, card.name, _fitting(card, texts))
        self._put(card, cards + self._card(card, "MAT1", _fitting(material, own)))


class _Cards(_Edits):
    """Gives every bar a property card, and every property a material card, with its numbers."""

    def __init__(self, reading: BulkFrame) -> None:
        super().__init__(reading.deck)
        self.reading = reading

    def assign(self, changed: Mapping[str, tuple[Numbers, Numbers]]) -> None:
        """Find cards for the new numbers of every bar."""
        wanted: dict[int, dict[tuple[Numbers, Numbers], list[str]]] = {}
        for name, numbers in changed.items():
            pid = self.reading.bar_of[name].card.id(1, "PID")
            wanted.setdefault(pid, {}).setdefault(numbers, []).append(name)
        number_of = self._materials(wanted)
        for property_number, groups in wanted.items():
            bar = self.reading.bars[property_number]
            material = _material_of(bar)
            listed = [(of, number_of[material, m], names) for (of, m), names in groups.items()]
            # What did not change keeps its card, else what comes first does.
            listed.sort(key=lambda item: (item[0] != (), item[1] != material))
            new: list[bytes] = []
            for k, (of, mid, names) in enumerate(listed):
                if k == 0 and not of and mid == material:
                    new += self._old(bar.card)
                    continue
                number = bar.card.text(1) if k == 0 else self._next("PID", bar.card)
                new += self._card(bar.card, *_property(bar, dict(of), number, mid))
                for name in names if k else ():
                    # The element names another property; the rest of its lines stays as it is.
                    card = self.reading.card_of[name]
                    first, *rest = self._old(card)
                    text = first.decode("latin-1")
                    body, mark, comment = text.partition("$")
                    if "," in body:
                        parts = body.split(",")
                        parts[2] = number
                        body = ",".join(parts)
                    else:
                        width = _WIDTH if "*" in body[:8] else 8
                        body = body.expandtabs(8)
                        body = f"{body[: 8 + width]}{number:<{width}}{body[8 + 2 * width :]}"
                    self._put(card, [(body + mark + comment).encode("latin-1"), *rest])
            self._put(bar.card, new)

    def attach(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring], path: Path
    ) -> None:
        """Add cards of masses and of springs to ground behind all others; raises InputError."""
        deck, new = self.reading.deck, list[bytes]()
        last = deck.cards[-1]
        for mass in masses:
            grid, arm = self._grid(mass.at, path)
            offset = np.array(mass.offset) + arm
            texts = [self._next("EID", last), grid.name, "", real(mass.mass / self.reading.weight)]
            new += self._card(last, "CONM2", [*texts, *map(real, offset)])
        for spring in springs:
            grid, arm = self._grid(spring.at, path)
            i = DIRECTIONS.index(spring.direction.lstrip("+-"))
            along = np.abs(grid.axes[:, i % 3])
            if arm.any() or along.max() < 1.0 - _KEPT:
                raise _refusal(path)
            component = str(int(along.argmax()) + 1 + i // 3 * 3)
            texts = [self._next("EID", last), real(spring.stiffness), grid.name, component]
            new += self._card(last, "CELAS2", texts)
        if new:
            lines = deck.lines[deck.file]
            file, line = deck.end or (deck.file, len(lines))
            if line == len(lines) and not lines[-1].endswith((b"\n", b"\r")):
                new[:0] = [b"\n"]
            self.edits.setdefault(file, {}).setdefault(line, (line - 1, []))[1][:0] = new

    def _grid(self, place: Place, path: Path) -> tuple[GridPoint, FloatArray]:
        """Return the grid of a joint, and where the joint is from there."""
        joint = self.reading.parts.joints.get(place.joint or "")
        if joint is None:
            raise _refusal(path)
        grid = self.reading.grids[int(joint.name.partition(".")[0])]
        return grid, np.array(joint.xyz) - grid.xyz

    def _materials(
        self, wanted: Mapping[int, Mapping[tuple[Numbers, Numbers], object]]
    ) -> dict[tuple[str, Numbers], str]:
        """Return from a material and its new numbers to the number of a card that has them."""
        variants: dict[str, dict[Numbers, Bar]] = {}
        for number, bar in self.reading.bars.items():
            for _, numbers in wanted.get(number, {}):
                variants.setdefault(_material_of(bar), {})[numbers] = bar
        found: dict[tuple[str, Numbers], str] = {}
        for material, own in variants.items():
            new: list[bytes] = []
            for k, (numbers, bar) in enumerate(sorted(own.items(), key=lambda v: v[0] != ())):
                card = bar.material
                if k == 0 and not numbers:
                    new += self._old(card)
                    found[material, numbers] = material
                    continue
                mid = material if k == 0 else self._next("MID", card)
                found[material, numbers] = mid
                texts = _changed_material(bar, dict(numbers), mid)
                new += self._card(card, "MAT1", texts)
            self._put(card, new)
        return found


def _material_of(bar: Bar) -> str:
    return str(bar.material.id(1, "MID"))


def _property(
    bar: Bar, new: Mapping[str, float], number: str, material: str
) -> tuple[str, list[str]]:
    """Return the name and the data fields of a property with new numbers."""
    card, of = bar.card, bar.of
    name, texts = card.name, [*card.fields, *[""] * (24 - len(card.fields))]
    if name == "PBARL" and set(new) <= {"nsm"}:
        if new:  # behind the sizes
            texts[8 + SHAPES[card.text(4)]] = real(new["nsm"])
    elif name == "PBARL":
        numbers = {key: getattr(of, key) for key in (*_ROW, "K1", "K2")} | dict(new)
        name = "PBAR"
        texts = ["", "", *(real(numbers[key]) for key in _ROW), *[""] * 9]
        texts += [real(numbers["K1"]), real(numbers["K2"])]
    else:
        row = {"PBAR": (2, 3, 4, 5, 6), "PROD": (2, 0, 0, 3, 5)}.get(name, (2, 3, 4, 6, 7))
        places = dict(zip(_ROW, row, strict=True)) | {"K1": 16, "K2": 17}
        if name == "PBEAM":  # one section all along, so that no station is needed
            texts = [*texts[:16], *(real(getattr(of, key)) for key in ("K1", "K2"))]
        for key, value in new.items():
            texts[places[key]] = real(value)
    texts[:2] = [number, material]
    return name, _fitting(card, texts)


def _changed_material(bar: Bar, new: Mapping[str, float], number: str) -> list[str]:
    """Return the data fields of a MAT1 with new numbers; what was blank stays so."""
    texts = [number, *bar.material.fields[1:]]
    texts += [""] * (5 - len(texts))
    for place, key in ((1, "E"), (2, "G"), (4, "rho")):
        if key in new and texts[place]:
            texts[place] = real(new[key])
    return _fitting(bar.material, texts)


def _fitting(card: Card, texts: Sequence[str]) -> list[str]:
    """Return fields none of which is wider than a large one."""
    found = [
        real(card.real(i, "number")) if len(text) > _WIDTH else text
        for i, text in enumerate(texts, 1)
    ]
    last = max((i for i, text in enumerate(found, 1) if text), default=0)
    return found[:last]


def real(value: float) -> str:
    """Return a number as Nastran reads it, as exactly as 16 characters can say it.

    The last digit is the 13th or better where the exponent has one digit or none is needed.
    """
    value, best, least = float(value), "", np.inf
    for digits in range(17, 0, -1):
        mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
        sign, figures = "-" * (value < 0.0), mantissa.lstrip("-").replace(".", "")
        figures = figures.rstrip("0") or "0"
        n = int(power)
        forms = [f"{sign}{figures[0]}.{figures[1:]}{n:+d}", f"{sign}.{figures}{n + 1:+d}"]
        if 0 <= n < 16:
            whole = figures.ljust(n + 1, "0")
            forms.append(f"{sign}{whole[: n + 1]}.{whole[n + 1 :]}")
        elif -4 <= n < 0:
            forms.append(f"{sign}.{'0' * (-n - 1)}{figures}")
        for form in forms:
            error = abs(float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", form)) - value)
            if len(form) <= _WIDTH and (error, len(form)) < (least, len(best)):
                best, least = form, error
    return best


def _write(deck: Deck, edits: _Changes, path: Path, original: Path) -> None:
    """Write all files of a deck, those that it includes next to the main one."""
    for file, lines in deck.lines.items():
        target = path if file == original else path.parent / file.relative_to(original.parent)
        changes = edits.get(file, {})
        content: list[bytes] = []
        i = 0
        while i < len(lines) or i in changes:
            last, new = changes.get(i) or (i, [lines[i]])
            if last < i:  # in front of a line that stays
                content += new + lines[i : i + 1]
                i += 1
                continue
            comments = [line for line in lines[i : last + 1] if line.lstrip()[:1] == b"$"]
            content += new if all(c in new for c in comments) else [*comments, *new]
            i = last + 1
        if file != original and target.resolve() == file.resolve():
            if content == lines:
                continue
            what = "an included file changes and would be overwritten"
            raise InputError(what, file=path, expected="a file in another folder")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(b"".join(content))
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", file=target) from None
