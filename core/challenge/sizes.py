"""How large a hidden effect may be: ranges for every effect, in units that fit the structure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femubench.core.challenge.measuring import Seen
from femubench.core.challenge.structures import Specimen
from femubench.core.effect.frame_effect import EffectParameter
from femubench.core.fem.frame import Frame, Member
from femubench.core.fem.mesh import member_axes


@dataclass(frozen=True)
class Site:
    """A place on a structure and the quantities that sizes are measured in there.

    Arguments:
        specimen: the structure.
        seen: its nominal modes.
        place: where the effect sits.
    """

    specimen: Specimen
    seen: Seen
    place: str

    @property
    def frame(self) -> Frame:
        """Return the nominal frame."""
        return self.specimen.frame

    @cached_property
    def members(self) -> tuple[Member, ...]:
        """Return the members at the place; all where it names none."""
        return members_at(self.frame, self.place)

    def mean(self, quantity: Callable[[Member], float]) -> float:
        """Return the mean of something over the members at the place."""
        return float(np.mean([quantity(member) for member in self.members]))

    def length(self, member: Member) -> float:
        """Return the length of a member in m."""
        return member_axes(self.frame, member)[1]


def members_at(frame: Frame, place: str) -> tuple[Member, ...]:
    """Return the members that a place names, or that end at the joint it names; else all."""
    word = place.partition(":")[0]
    head = word.partition("@")[0].partition("/")[0]
    joints = {joint.name for joint in frame.joints if head in (joint.name, joint.type)}
    named = tuple(m for m in frame.members if m.name == head or joints & set(m.ends))
    return named or frame.members


def _bending(site: Site) -> float:
    """Return 4 EI / L in N m/rad."""
    return site.mean(lambda m: 4.0 * m.material.E * m.section.Iy / site.length(m))


def _torsion(site: Site) -> float:
    """Return GJ / L in N m/rad, 4 EI / L where no member has a torsion constant."""
    own = site.mean(lambda m: m.material.G * m.section.J / site.length(m))
    return own or _bending(site)


def _euler(site: Site) -> float:
    """Return pi^2 EI / L^2 in N."""
    return site.mean(lambda m: np.pi**2 * m.material.E * m.section.Iy / site.length(m) ** 2)


def _half_depth(site: Site) -> float:
    return site.mean(lambda m: 0.5 * (m.section.height or 0.02))


def _width(site: Site) -> float:
    return site.mean(lambda m: m.section.width or 0.02)


def _mass(site: Site) -> float:
    return site.seen.mass


def _modal_stiffness(site: Site) -> float:
    """Return mass times the square of the first natural frequency in N/m."""
    return site.seen.mass * (2.0 * np.pi * float(site.seen.frequencies[0])) ** 2


def _frequency(site: Site) -> float:
    """Return the first natural frequency in Hz."""
    return float(site.seen.frequencies[0])


def _band(site: Site) -> float:
    """Return the eighth natural frequency in Hz."""
    return float(site.seen.frequencies[7])


def _one(_: Site) -> float:
    return 1.0


@dataclass(frozen=True)
class Size:
    """The range of one parameter.

    Arguments:
        low, high: in the unit.
        unit: what the site makes of 1.
        signed: whether the range also holds with a minus.
        log: whether decades are drawn rather than values.
        upper_unit: unit of `high`, where it is another one.
    """

    low: float
    high: float
    unit: Callable[[Site], float] = _one
    signed: bool = False
    log: bool = False
    upper_unit: Callable[[Site], float] | None = None

    def draw(self, site: Site, rng: np.random.Generator) -> float:
        """Return a random value."""
        low = self.low * self.unit(site)
        high = self.high * (self.upper_unit or self.unit)(site)
        share = float(rng.random())
        value = low * (high / low) ** share if self.log else low + (high - low) * share
        return -value if self.signed and rng.random() < 0.5 else value


# One size a parameter; where an effect has more parameters than sizes, the last one goes on.
SIZES: Mapping[str, Sequence[Size]] = {
    "youngs-modulus": [Size(0.03, 0.15, signed=True)],
    "density": [Size(0.03, 0.15, signed=True)],
    "torsion-constant": [Size(0.05, 0.40, signed=True)],
    "shear-deformation": [Size(0.5, 3.0)],
    "rotary-inertia": [Size(0.5, 3.0)],
    "joint-rotation": [Size(0.3, 30.0, _bending, log=True), Size(0.3, 30.0, _torsion, log=True)],
    "joint-offset": [Size(0.3, 1.5, _half_depth)],
    "joint-mass": [Size(0.005, 0.02, _mass)],
    "added-mass": [Size(0.005, 0.08, _mass)],
    "grounding-spring": [Size(0.002, 0.2, _modal_stiffness, log=True)],
    "member-stiffness": [Size(0.05, 0.30, signed=True)],
    "member-mass": [Size(0.05, 0.30, signed=True)],
    "local-stiffness-loss": [Size(0.10, 0.70)],
    "axial-preload": [Size(0.05, 0.40, _euler, signed=True)],
    "mass-eccentricity": [Size(0.05, 0.25, _width, signed=True)],
    "bending-torsion-coupling": [Size(0.05, 0.30, signed=True)],
    "brace-spring": [Size(0.01, 1.0, _modal_stiffness, log=True)],
    "attached-oscillator": [
        Size(0.005, 0.05, _mass),
        Size(0.6, 1.0, _frequency, upper_unit=_band),
    ],
    "temperature": [Size(10.0, 40.0, signed=True)],
}


def draw_values(
    effect: str, parameters: Sequence[EffectParameter], site: Site, rng: np.random.Generator
) -> tuple[float, ...]:
    """Return random values of an effect's parameters within their bounds.

    An effect without a range of its own is drawn from half a deviation to two of its prior.
    """
    sizes = SIZES.get(effect)
    values = []
    for i, parameter in enumerate(parameters):
        if sizes is None:
            value = _from_prior(parameter, rng)
        else:
            value = sizes[min(i, len(sizes) - 1)].draw(site, rng)
        values.append(float(np.clip(value, parameter.lower, parameter.upper)))
    return tuple(values)


def _from_prior(parameter: EffectParameter, rng: np.random.Generator) -> float:
    low, high = parameter.range
    x = float(rng.uniform(0.5, 2.0))
    if not parameter.one_sided and rng.random() < 0.5:
        x = -x
    return float(parameter.value(float(np.clip(x, low, high))))
