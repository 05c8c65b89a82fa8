"""A number that was typed in another unit: GPa for MPa, g/cm3 for kg/m3, mm for m."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import ClassVar, Literal

import numpy as np

from femubench import Measurement, Model
from femubench.effect import Suspect
from femubench.fem import Frame, Material
from femubench.plugins.faults.sections import correct_section, resize_section, sections_of, sizes_of

_KILO = 1e3
# Below and above which no material of a structure lies, and no member is as thick as the whole.
_PLAUSIBLE = {"E": (3e8, 2e12), "rho": (20.0, 25e3)}
_LARGEST, _LEAST = 0.5, 1e-4


class UnitSlip:
    """Young's modulus, a density or a size of a section is wrong by a factor of 1000.

    Only what cannot be is suspected: a material softer than any, a section wider than the frame.
    """

    name: ClassVar[str] = "unit-slip"
    side: ClassVar[Literal["input"]] = "input"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return the numbers that cannot be, and could be a thousandth or thousandfold."""
        if model.structure is None:
            return []
        frame = model.structure.frame
        return [*_of_materials(frame), *_of_sections(frame)]


def _of_materials(frame: Frame) -> Iterator[Suspect]:
    for material in dict.fromkeys(member.material for member in frame.members):
        for key, (low, high) in _PLAUSIBLE.items():
            typed = getattr(material, key)
            for factor in (1.0 / _KILO, _KILO):
                if not low <= typed <= high and low <= typed / factor <= high:
                    right = replace(material, **{key: typed / factor})
                    yield Suspect(
                        f"material:{material.name or 'all'}",
                        f"{key} of {material.name or 'all'} is {factor:g} times what it is",
                        partial(_with_material, material, right),
                        known={f"{key}, typed over right": factor},
                        blatant=True,
                    )


def _of_sections(frame: Frame) -> Iterator[Suspect]:
    span = float(np.ptp(frame.corners, axis=0).max())
    for section in sections_of(frame):
        sizes = sizes_of(section)
        whole = sizes | {"wall": section.wall}
        options = {key: {key: typed} for key, typed in sizes.items()} | {"sizes": whole}
        for (key, typed), factor in product(options.items(), (1.0 / _KILO, _KILO)):
            new = {name: size / factor for name, size in typed.items()}
            right = resize_section(section, new)
            wrong = [s for s in sizes.values() if not _LEAST < s < _LARGEST * span]
            possible = [s for s in (sizes | new).values() if _LEAST < s < _LARGEST * span]
            if wrong and right is not None and len(possible) >= len(sizes):
                yield Suspect(
                    f"section:{section.name}",
                    f"{key} of section {section.name} {'are' if key == 'sizes' else 'is'} "
                    f"{factor:g} times too large",
                    partial(correct_section, section, right),
                    known={f"{key}, typed over right": factor},
                    blatant=True,
                )


def _with_material(
    wrong: Material, right: Material, model: Model, measurement: Measurement, value: float
) -> tuple[Model, Measurement]:
    structure = model.frame_structure
    members = tuple(
        replace(m, material=right) if m.material == wrong else m for m in structure.frame.members
    )
    frame = replace(structure.frame, members=members)
    return Model.of(structure.rebuilt(frame)), measurement
