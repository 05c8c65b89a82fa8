"""Sections of a frame, made anew with other sizes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from femubench import Measurement, Model
from femubench.fem import Frame, Section

_SAME = 1e-6
_CONSTANTS = ("A", "Iy", "Iz", "J", "Jp")


def sections_of(frame: Frame) -> tuple[Section, ...]:
    """Return the sections that members have, each name once."""
    named = {(member.section.name, member.section): member.section for member in frame.members}
    return tuple(named.values())


def sizes_of(section: Section) -> dict[str, float]:
    """Return the sizes of a section with a shape as they may have been typed, in m."""
    width, height = section.width, section.height
    if width is None or height is None or not section.shape:
        return {}
    if width == height:
        return {"width": width}
    return {"width": width, "height": height}


def resize_section(section: Section, sizes: Mapping[str, float]) -> Section | None:
    """Return a section with other sizes, and what was typed in apart from its shape as it was.

    None for one without a shape, or with a wall too thick for the sizes. A square or round one
    has one size.

    Arguments:
        section: with a shape.
        sizes: of ``width``, ``height`` and ``wall`` those that differ, m.
    """
    old = sizes_of(section)
    if not old:
        return None
    wall = section.wall
    new = {"wall": wall, **old, **sizes}
    width, height = new["width"], new.get("height", new["width"])
    if section.shape == "round-tube" and new["wall"] > 0.499 * old["width"]:
        new["wall"] = 0.5 * width  # solid
    if new["wall"] > 0.5 * min(width, height):
        return None
    own = section.same_shape(old["width"], old.get("height", old["width"]), wall)
    typed = {
        key: getattr(section, key)
        for key in _CONSTANTS
        if not np.isclose(getattr(section, key), getattr(own, key), rtol=_SAME, atol=0.0)
    }
    return replace(section.same_shape(width, height, new["wall"]), **typed, name=section.name)


def correct_section(
    old: Section, new: Section, model: Model, measurement: Measurement, value: float
) -> tuple[Model, Measurement]:
    """Return the model with one section in the place of another one of the same name."""
    structure = model.frame_structure
    members = tuple(
        replace(m, section=new) if (m.section, m.section.name) == (old, old.name) else m
        for m in structure.frame.members
    )
    frame = replace(structure.frame, members=members)
    return Model.of(structure.rebuilt(frame)), measurement
