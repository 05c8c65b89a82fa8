"""Properties of a model that updating may scale or set, and where."""

from __future__ import annotations

from dataclasses import dataclass

from femubench.core.errors import ModelError

# What a word scales. Rigid lengths and springs are set, everything else is multiplied.
QUANTITIES: dict[str, tuple[str, ...]] = {
    "EA": ("EA",),
    "EI": ("EIy", "EIz"),
    "GJ": ("GJ",),
    "bending ry": ("EIy", "flex_z"),
    "bending rz": ("EIz", "flex_y"),
    "E": ("EA", "EIy", "EIz", "GJ", "flex_y", "flex_z"),
    "rhoA": ("rhoA",),
    "rhoJp": ("rhoJp",),
    "density": ("rhoA", "rhoJp", "rhoIy", "rhoIz"),
    "shear": ("flex_y", "flex_z"),
    "rotary": ("rhoIy", "rhoIz"),
    "rigid": (),
    "spring": (),
}
_SET = ("rigid", "spring")


@dataclass(frozen=True)
class Property:
    """One property that updating may scale or set.

    Arguments:
        name: for tables.
        quantity: a key of `QUANTITIES`.
        places: ``member/k`` for elements, ``member@joint`` for rigid ends,
            ``member@joint:direction`` for joint springs.
        unit: empty for a factor on the nominal property.
    """

    name: str
    quantity: str
    places: tuple[str, ...]
    unit: str = ""

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise ModelError(f"unknown quantity {self.quantity!r}; there are {list(QUANTITIES)}")

    @property
    def is_factor(self) -> bool:
        """Tell whether the value multiplies the nominal property."""
        return self.quantity not in _SET
