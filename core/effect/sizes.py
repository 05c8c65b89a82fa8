"""How large an effect may be in a hidden case: ranges in units that fit structure and place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femubench.core.effect.places import Places
from femubench.core.fem.frame import Frame, Member
from femubench.core.fem.mesh import member_axes
from femubench.core.typing import FloatArray

_DEPTH = 0.02  # m, of sections that were given as numbers


@dataclass(frozen=True)
class Site:
    """A place on a structure and the quantities that sizes are measured in there.

    Arguments:
        frame: the nominal frame.
        place: where the effect sits.
        weight: mass of the structure in kg.
        frequencies: natural frequencies of its elastic modes in Hz, ascending, (q,).
    """

    frame: Frame
    place: str
    weight: float
    frequencies: FloatArray

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """Return the members that the place names, or that end at the joint it names; else all."""
        return Places(self.frame).members_at(self.place)

    def mean(self, quantity: Callable[[Member], float]) -> float:
        """Return the mean of something over the members at the place."""
        return float(np.mean([quantity(member) for member in self.members]))

    def length(self, member: Member) -> float:
        """Return the length of a member in m."""
        return member_axes(self.frame, member)[1]

    def bending_stiffness(self) -> float:
        """Return 4 EI / L in N m/rad."""
        return self.mean(lambda m: 4.0 * m.material.E * m.section.Iy / self.length(m))

    def torsional_stiffness(self) -> float:
        """Return GJ / L in N m/rad, 4 EI / L where no member has a torsion constant."""
        own = self.mean(lambda m: m.material.G * m.section.J / self.length(m))
        return own or self.bending_stiffness()

    def euler_load(self) -> float:
        """Return pi^2 EI / L^2 in N."""
        return self.mean(lambda m: np.pi**2 * m.material.E * m.section.Iy / self.length(m) ** 2)

    def half_height(self) -> float:
        """Return half the height of the sections in m."""
        return self.mean(lambda m: 0.5 * (m.section.height or _DEPTH))

    def width(self) -> float:
        """Return the width of the sections in m."""
        return self.mean(lambda m: m.section.width or _DEPTH)

    def mass(self) -> float:
        """Return the mass of the structure in kg."""
        return self.weight

    def modal_stiffness(self) -> float:
        """Return mass times the square of the first natural frequency in N/m."""
        return self.weight * (2.0 * np.pi * self.first_frequency()) ** 2

    def first_frequency(self) -> float:
        """Return the first natural frequency in Hz."""
        return float(self.frequencies[0])

    def eighth_frequency(self) -> float:
        """Return the eighth natural frequency in Hz, the highest where there are fewer."""
        return float(self.frequencies[:8][-1])


@dataclass(frozen=True)
class Size:
    """The range of one parameter of an effect in hidden cases.

    Arguments:
        low, high: in the unit.
        unit: what is 1, e.g. ``Site.mass``; None for the unit of the parameter.
        signed: whether the range also holds with a minus.
        log: whether decades are drawn rather than values.
        upper_unit: unit of `high`, where it is another one.
    """

    low: float
    high: float
    unit: Callable[[Site], float] | None = None
    signed: bool = False
    log: bool = False
    upper_unit: Callable[[Site], float] | None = None

    def bounds(self, site: Site) -> tuple[float, float]:
        """Return the ends of the range at a place, signs left aside."""
        low = self.low * (self.unit(site) if self.unit else 1.0)
        upper = self.upper_unit or self.unit
        return low, self.high * (upper(site) if upper else 1.0)

    def draw(self, site: Site, rng: np.random.Generator) -> float:
        """Return a random value."""
        low, high = self.bounds(site)
        share = float(rng.random())
        value = low * (high / low) ** share if self.log else low + (high - low) * share
        return -value if self.signed and rng.random() < 0.5 else value
