"""Make cross sections of what `case.toml` says of them."""

from __future__ import annotations

from dataclasses import replace

from femubench.core.case.faults import Fault
from femubench.core.case.schema import SectionSpec
from femubench.core.fem.frame import BeamTheory, Plane
from femubench.core.fem.sections import SHAPES, Section, constant_kappa

_SIZES = ("width", "height", "diameter", "wall")
_CONSTANTS = ("A", "Iy", "Iz", "J", "Jp")
_NEEDED: dict[Plane, tuple[str, ...]] = {
    "in-plane": ("A", "Iy"),
    "out-of-plane": ("A", "Iy", "J", "Jp"),
    "3d": ("A", "Iy", "Iz", "J", "Jp"),
}


def section_of(spec: SectionSpec, plane: Plane, beam: BeamTheory) -> Section:
    """Return the section of a table, numbers beside a shape taking the place of the shape's.

    Raises:
        Fault: where a size or a constant is missing or does not belong there.
    """
    shape = spec.shape
    section = _from_numbers(spec, plane) if shape is None else _from_shape(spec, shape)
    if spec.kappa is not None:
        section = replace(section, kappa=constant_kappa(spec.kappa))
    if beam == "timoshenko" and section.kappa is None:
        raise Fault(("kappa",), "missing key", "the shear coefficient of a timoshenko beam, > 0")
    return section


def _from_shape(spec: SectionSpec, shape: str) -> Section:
    if shape not in SHAPES:
        raise Fault(("shape",), f"unknown shape {shape[:40]!r}", f"one of {', '.join(SHAPES)}")
    make, keys = SHAPES[shape]
    sizes: dict[str, float] = {}
    for key in _SIZES:
        value = getattr(spec, key)
        if key in keys and value is None:
            raise Fault((key,), "missing key", f"{', '.join(keys)}, each > 0 in m")
        if key not in keys and value is not None:
            raise Fault((key,), f"not a size of a {shape}", f"{', '.join(keys)}")
        if value is not None:
            sizes[key] = value
    wall = sizes.get("wall", 0.0)
    smallest = min(value for key, value in sizes.items() if key != "wall")
    if wall >= smallest / 2:
        raise Fault(("wall",), f"wall {wall:g}", f"a number < {smallest / 2:g}, half of the size")
    given = {key: getattr(spec, key) for key in _CONSTANTS if getattr(spec, key) is not None}
    return replace(make(**sizes), **given)


def _from_numbers(spec: SectionSpec, plane: Plane) -> Section:
    for key in _SIZES:
        if getattr(spec, key) is not None:
            raise Fault((key,), "a size without a shape", f"shape = one of {', '.join(SHAPES)}")
    given: dict[str, float] = {
        key: getattr(spec, key) for key in _CONSTANTS if getattr(spec, key) is not None
    }
    if "Iy" in given and "Iz" in given:
        given.setdefault("Jp", given["Iy"] + given["Iz"])
    for key in _NEEDED[plane]:
        if key not in given:
            expected = f"{', '.join(_NEEDED[plane])}, which plane {plane!r} needs"
            raise Fault((key,), "missing key", expected)
    a, iy, iz, j, jp = (given.get(key, 0.0) for key in _CONSTANTS)
    return Section(A=a, Iy=iy, Iz=iz, J=j, Jp=jp)
