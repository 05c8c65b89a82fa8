"""What changes a group by powers of one value: thickness of plates, a soft interface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from femubench import Model, NotApplicable
from femubench.effect import Change, FrameEffect, Parameter, Size, Term
from femubench.fem import FloatArray, Frame, Groups, Powers
from femubench.modal import GroupPriors, Interfaces


class PowersEffect(FrameEffect):
    """Base class of effects of which every matrix comes with a power of one value.

    Attributes:
        nominal: the value of the model as drawn, from which the parameter is counted.
    """

    nominal: ClassVar[float]

    @abstractmethod
    def powers(self, model: Model, place: str) -> Powers:
        """Return stiffness and mass at a place by the power that they come with."""

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Raise NotApplicable: a frame has no groups."""
        raise NotApplicable(f"{self.name} needs matrices in groups")

    def extend_matrices(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with its matrices changed, and the group's own where it has one."""
        powers, name = self.powers(model, place), place.removeprefix(Groups.PREFIX)
        value = self.nominal + values[0]
        grown = {p: value**p - self.nominal**p for p in powers}
        found: dict[str, Any] = {}
        for i, (whole, own) in enumerate((("stiffness", "groups"), ("mass", "mass_groups"))):
            change = sum(grown[p] * pair[i] for p, pair in powers.items())
            groups = getattr(model, own)
            found[whole] = getattr(model, whole) + change
            found[own] = groups | {name: groups[name] + change} if name in groups else groups
        if self.nominal:
            now = {p: (value**p * k, value**p * m) for p, (k, m) in powers.items()}
            found["powers"] = {**model.powers, place: now}
        return replace(model, **found)

    def change(self, model: Model, place: str) -> Change:
        """Return the matrices, each with its power."""
        powers = self.powers(model, place)
        pairs = ((Term.of("stiffness", k), Term.of("mass", m)) for k, m in powers.values())
        terms = tuple(term for pair in pairs for term in pair)

        def coefficients(values: FloatArray) -> FloatArray:
            value = self.nominal + values[:, :1]
            return np.hstack([value**p - self.nominal**p for p in powers for _ in range(2)])

        return Change(terms, coefficients)


class PlateThickness(PowersEffect):
    """Make the plates of a group thicker or thinner: mass and membrane by t, bending by t^3."""

    name: ClassVar[str] = "plate-thickness"
    summary: ClassVar[str] = "plates of a group have another thickness"
    sizes: ClassVar[Sequence[Size]] = (Size(0.05, 0.25, signed=True),)
    nominal: ClassVar[float] = 1.0

    def places(self, model: Model) -> Sequence[str]:
        """Return the groups of plates alone."""
        return tuple(p for p in model.powers if not p.startswith(Interfaces.PREFIX))

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the relative change, of which the mass of a rolled sheet scatters as much."""
        std = GroupPriors(model).std(place.removeprefix(Groups.PREFIX), "mass")
        return (Parameter("change of thickness", "", std, lower=-0.9, wording="change"),)

    def powers(self, model: Model, place: str) -> Powers:
        """Return what comes with powers of the thickness over that drawn."""
        return model.powers[place]


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
        return Interfaces(model).places

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the change of what the softer part resists by the interface, never above zero."""
        given = GroupPriors(model).std(place), 0.0, -np.inf, 0.0
        return (Parameter("change of stiffness", "", *given, scaling="factor", wording="change"),)

    def powers(self, model: Model, place: str) -> Powers:
        """Return what comes with powers of the change."""
        return Interfaces(model).powers(place)
