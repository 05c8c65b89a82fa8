"""The keys of `[model]` that say how a structure differs from its plain beams."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PlainValidator

from femubench.core.case.fields import (
    AT,
    LARGEST,
    At,
    Direction,
    Name,
    NotNegative,
    Number,
    Positive,
    Table,
    misfit,
)

_SHARE = "true, false or a multiple of rho I, a number >= 0"
_PLACES = '"all", the name of a member, "member/k" for its element k, or a list of these'
_MEMBER = "the name of a member"


def _share(value: object) -> bool | float:
    if isinstance(value, bool):
        return value
    if isinstance(value, (int, float)) and 0 <= value <= LARGEST:
        return float(value)
    raise misfit("not a share of the rotary inertia", _SHARE)


def _places(value: object) -> tuple[str, ...]:
    found = [value] if isinstance(value, str) else value
    if isinstance(found, (list, tuple)) and found and all(isinstance(v, str) for v in found):
        return tuple(found)
    raise misfit("not a list of places", _PLACES)


Share = Annotated[bool | float, PlainValidator(_share)]
Quantity = Literal["EA", "EI", "GJ", "E", "rhoA", "rhoJp", "density", "shear", "rotary"]


class FactorSpec(Table):
    """`[[model.factors]]`."""

    quantity: Quantity = Field(
        description="one of EA, EI, GJ, E, rhoA, rhoJp, density, shear, rotary"
    )
    at: Annotated[tuple[str, ...], PlainValidator(_places)] = Field(description=_PLACES)
    factor: NotNegative = Field(description="a number > 0")


class PreloadSpec(Table):
    """`[[model.preloads]]`."""

    member: Name = Field(description=_MEMBER)
    force: Number = Field(description="a number in N, tension positive")


class EccentricitySpec(Table):
    """`[[model.eccentricities]]`."""

    member: Name = Field(description=_MEMBER)
    y: Number = Field(0.0, description="a number in m, along local y")
    z: Number = Field(0.0, description="a number in m, along local z")


class CouplingSpec(Table):
    """`[[model.couplings]]`."""

    member: Name = Field(description=_MEMBER)
    coefficient: Annotated[float, Field(strict=True, gt=-1, lt=1, allow_inf_nan=False)] = Field(
        description="a number > -1 and < 1"
    )


class BraceSpec(Table):
    """`[[model.braces]]`."""

    ends: tuple[Name, Name] = Field(description="the names of two joints")
    stiffness: NotNegative = Field(description="a number >= 0 in N/m")


class OscillatorSpec(Table):
    """`[[model.oscillators]]`."""

    at: At = Field(description=AT)
    direction: Direction = Field(description="a translation x, y or z, with an optional sign")
    mass: Positive = Field(description="a number > 0 in kg")
    frequency: Positive = Field(description="a number > 0 in Hz")
