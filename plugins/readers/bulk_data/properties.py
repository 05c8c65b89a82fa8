"""Constants of bars as bulk data give them: PBAR, PBARL, PBEAM and PROD with their MAT1.

Plane 1 of an element is its local x-y plane, so that I1 is the integral of y^2 (Iz here), I2 that
of z^2 (Iy here), K1 goes with shear along y and K2 with shear along z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from femubench.fem import Material, Section
from femubench.plugins.readers.bulk_data.cards import Card

_SAME = 1e-9
# What is left of a row of a PBEAM station, in addition to A, I1, I2, I12, J, NSM.
_STATION = ("A", "I1", "I2", "I12", "J", "NSM")


@dataclass(frozen=True)
class Constants:
    """The numbers of a property.

    Arguments:
        K1, K2: shear coefficients, 0 for no shear flexibility.
        shape: a section with sizes, where the property names a shape.
    """

    A: float
    I1: float
    I2: float
    J: float
    nsm: float
    K1: float = 0.0
    K2: float = 0.0
    shape: Section | None = None


@dataclass(frozen=True)
class Bar:
    """What the cards of a property and its material say of a bar.

    Arguments:
        card, material: those of the property and of its material.
    """

    E: float
    G: float
    nu: float
    rho: float
    of: Constants
    card: Card
    material: Card

    @property
    def has_shear(self) -> bool:
        """Tell whether the bar bends as Timoshenko's beam."""
        return self.of.K1 > 0.0 or self.of.K2 > 0.0

    def frame_material(self, *, weight: float) -> Material:
        """Return the material, its density times a factor."""
        return Material(self.E, self.nu, weight * self.rho, self.material.text(1))

    def frame_section(self) -> Section:
        """Return the section; G that does not follow from E and nu is in J and kappa."""
        name, of = self.card.text(1), self.of
        if of.shape is not None:
            return replace(of.shape, name=name)
        share = self.G / (self.E / (2.0 * (1.0 + self.nu)))
        return Section(
            A=of.A,
            Iy=of.I2,
            Iz=of.I1,
            J=share * of.J,
            Jp=of.I1 + of.I2,
            # 0 is a bar without shear flexibility, whose share is taken out elsewhere.
            kappa=Section.constant_kappa(share * of.K1 or 1.0, share * of.K2 or 1.0),
            name=name,
        )


def bar_of(card: Card, materials: Mapping[int, Card]) -> Bar:
    """Return what a property and its material say.

    Arguments:
        materials: the MAT1 by number.

    Raises:
        InputError: for constants that no bar has, or that are not read.
    """
    material = card.pick(materials, card.id(2, "MID"), "MAT1", "MID")
    read = {"PBAR": _pbar, "PBARL": _pbarl, "PBEAM": _pbeam, "PROD": _prod}[card.name]
    E, G, nu = moduli_of(material)
    of = read(card, nu)
    bar = Bar(E, G, nu, at_least_0(material, 5, "RHO"), of, card, material)
    if bar.has_shear and not G > 0.0:
        raise material.error("no shear modulus for bars with shear", "G or NU", "G")
    if of.nsm and not bar.rho * of.A + of.nsm > 0.0:
        raise card.error("the bar has no mass", "RHO A + NSM > 0", "NSM")
    if of.shape is not None and abs(G / (E / (2.0 * (1.0 + nu))) - 1.0) > _SAME:
        expected = "G = E / 2(1 + NU) with a shape"
        raise material.error("G does not belong to E and NU", expected, "G")
    return bar


def moduli_of(material: Card) -> tuple[float, float, float]:
    """Return E, G and Poisson's ratio of a MAT1, of which two are enough; raises InputError."""
    E, G, nu = (material.real(i, key, 0.0) for i, key in ((2, "E"), (3, "G"), (4, "NU")))
    if not material.text(2):
        E = 2.0 * (1.0 + nu) * G
    if not E > 0.0:
        raise material.error(f"{E:g}", "a number > 0", "E")
    if G < 0.0 or not -1.0 < nu <= 0.5:
        raise material.error(f"G {G:g}, NU {nu:g}", "G >= 0 and NU > -1 and <= 0.5", "G")
    if material.text(3) and not material.text(4) and G > 0.0:
        own = E / (2.0 * G) - 1.0
        nu = own if -1.0 < own <= 0.5 else 0.0
    if not material.text(3) and material.text(4):
        G = E / (2.0 * (1.0 + nu))
    return E, G, nu


def at_least_0(card: Card, number: int, key: str) -> float:
    """Return a number that is not negative, 0 where blank; raises InputError."""
    value = card.real(number, key, 0.0)
    if value < 0.0:
        raise card.error(f"{value:g}", "a number >= 0", key)
    return value


def _pbar(card: Card, nu: float) -> Constants:
    if card.real(19, "I12", 0.0) != 0.0:
        expected = "0: the principal axes, to which the orientation of the bars can be turned"
        raise card.error(card.text(19), expected, "I12")
    keys = ("A", "I1", "I2", "J")
    A, I1, I2, J = (at_least_0(card, 3 + i, key) for i, key in enumerate(keys))
    nsm = card.real(7, "NSM", 0.0)
    K1, K2 = at_least_0(card, 17, "K1"), at_least_0(card, 18, "K2")
    return Constants(_not_0(card, A), I1, I2, J, nsm, K1, K2)


def _prod(card: Card, nu: float) -> Constants:
    J, nsm = at_least_0(card, 4, "J"), card.real(6, "NSM", 0.0)
    return Constants(_not_0(card, at_least_0(card, 3, "A")), 0.0, 0.0, J, nsm)


def _not_0(card: Card, area: float) -> float:
    if not area > 0.0:
        raise card.error(f"{area:g}", "a number > 0", "A")
    return area


# How many sizes; they go along z and then y, a Section has its width along y.
SHAPES = {"ROD": 1, "TUBE": 2, "BAR": 2, "BOX": 4}


def _pbarl(card: Card, nu: float) -> Constants:
    kind = card.text(4)
    if kind not in SHAPES:
        expected = f"{', '.join(SHAPES)}, or a PBAR with numbers"
        raise card.error(f"shape {kind[:20]!r}", expected, "TYPE")
    sizes = [at_least_0(card, 9 + i, f"DIM{i + 1}") for i in range(SHAPES[kind])]
    across, along, wall, other = (*sizes, *(0.0,) * 4)[:4]
    if kind == "BOX" and abs(wall - other) > _SAME * wall:
        raise card.error("walls that differ", "DIM3 = DIM4, or a PBAR with numbers", "DIM4")
    round_one = kind in ("ROD", "TUBE")
    hollow = along < across if round_one else 2.0 * wall < min(across, along)
    if not (across > 0.0 and hollow and (kind != "BOX" or wall > 0.0)):
        raise card.error(f"sizes {', '.join(f'{d:g}' for d in sizes)}", "those of a bar", "DIM1")
    if round_one:
        shape = Section.round_tube(2.0 * across, across - along)
    elif wall:
        shape = Section.rectangular_tube(along, across, wall)
    else:
        shape = Section.solid_rectangle(along, across)
    K1, K2 = (1.0, 1.0) if shape.kappa is None else shape.kappa(nu)
    nsm = card.real(9 + len(sizes), "NSM", 0.0)
    return Constants(shape.A, shape.Iz, shape.Iy, shape.J, nsm, K1, K2, shape)


def _pbeam(card: Card, nu: float) -> Constants:
    """Return the constants of a PBEAM whose section is the same all along."""
    own = [card.real(3 + i, key, 0.0) for i, key in enumerate(_STATION)]
    row = 17  # behind the four points at which stresses of end A are wanted
    while card.text(row) in ("YES", "NO", "YESA"):
        for i, key in enumerate(_STATION):
            value = card.real(row + 2 + i, f"{key} of a station", own[i])
            if abs(value - own[i]) > _SAME * abs(own[i]):
                raise card.error(f"{key} changes along the beam", "a constant section", key)
        row += 16 if card.text(row) == "YES" else 8
    A, I1, I2, I12, J, nsm = own
    if I12 != 0.0:
        raise card.error(f"{I12:g}", "0: the principal axes", "I12")
    K1, K2 = (card.real(row + i, f"K{i + 1}", 1.0) for i in range(2))
    for i in range(row + 2, len(card.fields) + 1):
        if card.real(i, f"field {i}", 0.0) != 0.0:
            expected = "nothing behind K1 and K2: no taper, warping, NSI or offset axes"
            raise card.error(card.text(i), expected)
    if min(I1, I2, J, K1, K2) < 0.0:
        raise card.error("a negative constant", "numbers >= 0", "I1")
    return Constants(_not_0(card, A), I1, I2, J, nsm, K1, K2)
