"""A section that lies where it should stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar, Literal

from femubench import Measurement, Model
from femubench.effect import Suspect
from femubench.fem import Section
from femubench.plugins.faults.sections import correct_section, sections_of

_ALIKE = 0.02  # relative, below which a turn changes nothing that is seen


class SectionTurned:
    """A section is turned by a right angle about the axis of its members."""

    name: ClassVar[str] = "section-turned"
    side: ClassVar[Literal["input"]] = "input"

    def suspects(self, model: Model, measurement: Measurement) -> Sequence[Suspect]:
        """Return the sections that bend differently about their two axes, where both are known."""
        if model.structure is None:
            return []
        return [
            Suspect(
                f"section:{section.name}",
                f"section {section.name} is turned by a right angle".replace("  ", " "),
                partial(correct_section, section, _turn_section(section)),
            )
            for section in sections_of(model.structure.frame)
            if min(section.Iy, section.Iz) > 0.0 and abs(section.Iy / section.Iz - 1.0) > _ALIKE
        ]


def _turn_section(section: Section) -> Section:
    return replace(
        section,
        Iy=section.Iz,
        Iz=section.Iy,
        width=section.height,
        height=section.width,
        kappa=None if section.kappa is None else partial(_turn_kappa, section),
    )


def _turn_kappa(section: Section, nu: float) -> tuple[float, float]:
    assert section.kappa is not None
    along_y, along_z = section.kappa(nu)
    return along_z, along_y
