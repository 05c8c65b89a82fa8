"""What is known of the groups of a model from matrices before any measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.model import Model
from femubench.core.fem.slopes import Matrix
from femubench.core.modal.eigen import cache_by_model
from femubench.core.modal.interfaces import Interfaces
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.core.typing import FloatArray, SparseArray

QUARTILE = 0.6744897501960817  # of the standard normal distribution


@dataclass(frozen=True)
class GroupKind:
    """What is known of a group of some kind before any measurement.

    Arguments:
        std: standard deviation of ln(factor).
        most: the largest factor that is believed.
        mass_std: standard deviation of ln(factor) of its mass.
    """

    std: float
    most: float
    mass_std: float
    why: str


_LOOSE = float(np.log(5.0) / QUARTILE)  # a factor of five is as likely as not
KINDS = {
    "part": GroupKind(0.1, np.inf, 0.03, "moduli and walls have tolerances, masses can be weighed"),
    "joint": GroupKind(_LOOSE, 2.0, 0.5, "a joint is drawn whole: it gapes or slips, stiffens by "
                       "no more than a fillet, and is as heavy as what nobody drew on it"),
    "support": GroupKind(_LOOSE, np.inf, _LOOSE, "ground and clamps are hardly ever known"),
    "preload": GroupKind(0.5, np.inf, 0.0, "bolts tightened by torque scatter by a third, cords "
                         "creep; it may be lost, and of what presses little more would buckle"),
}  # fmt: skip
STRUCTURE_STD = KINDS["part"].std
_FREE = 1e-8  # of the energy that the entries would have without cancelling each other
_HELD = 0.1  # of it; a part of the structure with some dofs removed has less


def _energy(part: SparseArray, rigid: FloatArray) -> float:
    """Return the largest energy of a rigid-body motion, relative to that of its entries."""
    whole = np.einsum("nr,nr->r", np.abs(rigid), abs(part) @ np.abs(rigid))
    energy = np.abs(np.einsum("nr,nr->r", rigid, part @ rigid))
    return float((energy / np.where(whole > 0.0, whole, 1.0)).max(initial=0.0))


@dataclass(frozen=True)
class GroupPriors:
    """What is known of the groups of a model from matrices before any measurement."""

    model: Model

    @property
    def supports(self) -> frozenset[str]:
        """Return the groups of the stiffness that hold the structure to ground.

        What the case states; else a group is a support where its matrix couples no two dofs, or
        where a rigid-body motion costs it a tenth of the energy that its entries would have without
        cancelling each other. The latter is asked only where positions and directions of the dofs
        are known to be right: where some group that couples dofs has no energy in any rigid-body
        motion. A part of which it is known what its held nodes do is none.

        Examples:
            >>> modal.GroupPriors(model).supports
            frozenset()
        """
        return frozenset(name for name in self.model.groups if self.kind(name) == "support")

    @property
    def interfaces(self) -> Interfaces:
        """Return where groups meet that have tolerances: no joints, nothing that holds to ground.

        Examples:
            >>> modal.GroupPriors(model).interfaces.places
            ()
        """
        sure = (name for name in self.model.groups if self.std(name) < 2.0 * STRUCTURE_STD)
        return Interfaces(self.model, tuple(sure))

    def std(self, name: str, matrix: Matrix = "stiffness") -> float:
        """Return the standard deviation of ln(factor) of a group.

        What the case states: a factor of so much up or down is as likely as not. Else that of its
        kind (`KINDS`), stated or, for what holds to ground, found.

        Arguments:
            name: of a group of the stiffness or the mass; of a family, whose least known group
                it is.
            matrix: of which of them.

        Examples:
            >>> modal.GroupPriors(model).std("deck")
            0.1
        """
        name = self._least_known(name, matrix)
        if name in self.model.group_priors:
            return float(np.log(self.model.group_priors[name]) / QUARTILE)
        kind = KINDS[self.kind(name)]
        return kind.std if matrix == "stiffness" else kind.mass_std

    def largest_factor(self, name: str) -> float:
        """Return the largest factor on a group that is believed; infinite for most kinds.

        Arguments:
            name: of a group of the stiffness or the mass, or of a family.

        Examples:
            >>> modal.GroupPriors(model).largest_factor("deck")
            inf
        """
        return KINDS[self.kind(self._least_known(name, "stiffness"))].most

    def kind(self, name: str) -> str:
        """Return the kind of a group, a key of `KINDS`: what the case states, else what is found.

        ``interface:A|B``, where two parts meet, is a joint.

        Examples:
            >>> modal.GroupPriors(model).kind("deck")
            'part'
        """
        if name.startswith(Interfaces.PREFIX):
            return "joint"
        stated = self.model.group_kinds.get(name)
        return stated or ("support" if name in _supports(self.model) else "part")

    def _least_known(self, name: str, matrix: Matrix) -> str:
        groups = self.model.groups if matrix == "stiffness" else self.model.mass_groups
        family = [n for n in self.model.families.get(name, ()) if n in groups]
        known = {n: (self.std(n, matrix), self.largest_factor(n)) for n in family}
        return name if name in groups else max(family, key=lambda n: known[n], default=name)


@cache_by_model
def _supports(model: Model) -> frozenset[str]:
    rest = {
        k: part
        for k, part in model.groups.items()
        if (part - sp.diags_array(part.diagonal())).count_nonzero()
    }
    rigid = rigid_body_vectors(model.dofs)
    energy = {name: _energy(part, rigid) for name, part in rest.items()}
    known = any(share < _FREE for share in energy.values())
    free = {name for name, share in energy.items() if not (known and share > _HELD)}
    free |= {edge.part for edge in model.grounds.values()}
    return frozenset(set(model.groups) - free)
