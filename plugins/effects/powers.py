"""What changes a group by powers of one value: thickness of plates, a soft interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from femubench import Model, NotApplicable
from femubench.effect import Change, FrameEffect, Parameter, Size, Term
from femubench.fem import FloatArray, Frame, Groups
from femubench.modal import GroupPriors


class PowersEffect(FrameEffect):
    """Base class of effects of which every matrix comes with a power of one value.

    Attributes:
        nominal: the value of the model as drawn, from which the parameter is counted.
    """

    nominal: ClassVar[float]

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Raise NotApplicable: a frame has no groups."""
        raise NotApplicable(f"{self.name} needs matrices in groups")

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with its matrices changed, and the group's own where it has one."""
        powers = GroupPriors(model).interfaces.powers(place)
        grown, name = self._grown(values, list(powers)), place.removeprefix(Groups.PREFIX)
        found: dict[str, Any] = {}
        for i, (whole, own) in enumerate((("stiffness", "groups"), ("mass", "mass_groups"))):
            change = sum(g * pair[i] for g, pair in zip(grown, powers.values(), strict=True))
            groups = getattr(model, own)
            found[whole] = getattr(model, whole) + change
            found[own] = groups | {name: groups[name] + change} if name in groups else groups
        return replace(model, **found)

    def change(self, model: Model, place: str) -> Change:
        """Return the matrices, each with its power."""
        powers = GroupPriors(model).interfaces.powers(place)
        pairs = ((Term.of("stiffness", k), Term.of("mass", m)) for k, m in powers.values())
        each = [power for power in powers for _ in range(2)]
        terms = tuple(term for pair in pairs for term in pair)
        return Change(terms, lambda values: self._grown(values, each))

    def _grown(self, values: FloatArray | Sequence[float], powers: Sequence[int]) -> FloatArray:
        """Return what powers of the value grow by, (k,), or by rows of values (g, 1), (g, k)."""
        value, each = self.nominal + np.asarray(values), np.array(powers)
        return np.asarray(value**each - self.nominal**each)


class PlateThickness(PowersEffect):
    """Make the plates of a group thicker or thinner: mass and membrane by t, bending by t^3."""

    name: ClassVar[str] = "plate-thickness"
    summary: ClassVar[str] = "plates of a group have another thickness"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.25, signed=True),)
    nominal: ClassVar[float] = 1.0

    def places(self, model: Model) -> Sequence[str]:
        """Return the groups of plates alone."""
        others = GroupPriors(model).interfaces.PREFIX, Groups.PRELOAD
        return tuple(place for place in model.powers if not place.startswith(others))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative change, of which the mass of a rolled sheet scatters as much."""
        std = GroupPriors(model).std(place.removeprefix(Groups.PREFIX), "mass")
        return (Parameter("change of thickness", "", std, lower=-0.9, wording="change"),)


class PreloadForce(PowersEffect):
    """Scale what a preload adds to the stiffness: cables, bolts, a part fitted under stress."""

    name: ClassVar[str] = "preload-force"
    summary: ClassVar[str] = "a preload is other than drawn"
    softens: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.2, 0.9, signed=True),)
    nominal: ClassVar[float] = 1.0

    def places(self, model: Model) -> Sequence[str]:
        """Return the preloads of which the geometric stiffness is known."""
        return tuple(place for place in model.powers if place.startswith(Groups.PRELOAD))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the change of the force over that drawn; lost, it is -1."""
        std = GroupPriors(model).std(place.removeprefix(Groups.PRELOAD))
        given = std, 0.0, -1.0, 2.0
        return (Parameter("change of preload", "", *given, wording="change"),)


class InterfaceSoftness(PowersEffect):
    """Let two parts that share nodes move apart there: a weld, bolts, glue or contact that gives.

    The springs between them are a multiple of what the softer part resists there.
    """

    name: ClassVar[str] = "interface-softness"
    summary: ClassVar[str] = "an interface of two parts gives"
    softens: ClassVar[bool] = True
    nominal: ClassVar[float] = 0.0

    def places(self, model: Model) -> Sequence[str]:
        """Return the pairs of parts that share nodes."""
        return GroupPriors(model).interfaces.places

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the change of what the softer part resists by the interface, never above zero."""
        given = GroupPriors(model).std(place), 0.0, -np.inf, 0.0
        return (Parameter("change of stiffness", "", *given, scaling="factor", wording="change"),)
