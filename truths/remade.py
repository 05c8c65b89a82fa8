"""Solids of which members are of other materials: for those whose shape no stretch leaves alone.

Mass and stiffness of any mesh are sums of those of its members, times factors of their densities
and moduli. Blocks, which only the solid has, stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from truths.affine import Power
from truths.elasticity import Matrices, assemble
from truths.solid import Solid
from truths.stretch import DENSITY, LENGTHS, MODULUS, SAME, Stretch
from truths.structure import Structure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RemadeSolid:
    """A mesh of which mass and stiffness are known for other materials of its members.

    Members of the first kind stay, with the blocks: a factor of all is a similar structure.

    Arguments:
        structure: in any shape.
        solid: its mesh.
    """

    structure: Structure
    solid: Solid

    @cached_property
    def kinds(self) -> dict[str, int]:
        """Return the kind of each member that the solid has: by section, of one by member."""
        made = self.structure.solid_members
        several = len({member.section for member in made}) > 1
        keys = [member.section if several else member.name for member in made]
        order = list(dict.fromkeys(keys))
        return {m.name: order.index(key) % LENGTHS for m, key in zip(made, keys, strict=True)}

    @cached_property
    def stretch(self) -> Stretch:
        """Return the factors; all lengths have the first, which is 1."""
        names = [f"{what}-{i}" for what in (MODULUS, DENSITY) for i in range(1, self._count)]
        knots, same = np.array([0.0, 1.0]), np.zeros(1, dtype=np.int64)
        return Stretch((knots,) * 3, (same,) * 3, (SAME, *names))

    @property
    def factors_of(self) -> dict[str, tuple[int, int]]:
        """Return the factors of modulus and density of the members that have some."""
        more = self._count - 1
        return {name: (kind, kind + more) for name, kind in self.kinds.items() if kind}

    @property
    def _count(self) -> int:
        return max(self.kinds.values()) + 1

    @cached_property
    def _parts(self) -> list[tuple[Power, Power, Matrices]]:
        """Return the powers of stiffness and mass, and the matrices, of each kind."""
        real = self.structure.warped(self.solid.points)
        kind = np.array([self.kinds.get(name, 0) for name in self.solid.parts])[self.solid.part]
        unit, found = np.eye(2 * self._count - 1, dtype=int).tolist(), []
        for i in range(self._count):
            part = assemble(self.solid.scaled(kind != i, 0.0, 0.0), real)
            part.stiffness.eliminate_zeros()
            part.mass.eliminate_zeros()
            found.append((tuple(unit[i]), tuple(unit[i + (i > 0) * (self._count - 1)]), part))
        return found

    @property
    def nodes(self) -> Array:
        """Return the nodes where they really lie, (3, n), m."""
        return self._parts[0][2].nodes

    def matrices(self, factors: Array) -> Matrices:
        """Return the matrices of the solid with factors of its materials."""
        first = self._parts[0][2]
        stiffness, mass = 0.0 * first.stiffness, 0.0 * first.mass
        for stiff, heavy, part in self._parts:
            stiffness = stiffness + float(np.prod(factors ** np.array(stiff))) * part.stiffness
            mass = mass + float(np.prod(factors ** np.array(heavy))) * part.mass
        return Matrices(first.nodes, first.straight, stiffness, mass)

    def masses(self) -> dict[Power, float]:
        """Return the mass of the solid in kg as a sum over factors."""
        return {power: part.total_mass for _, power, part in self._parts}

    def projected(self, vectors: Array) -> tuple[dict[Power, Array], dict[Power, Array]]:
        """Return stiffness and mass seen by vectors (dofs, n), by power of the factors, (n, n)."""
        return (
            {power: vectors.T @ (part.stiffness @ vectors) for power, _, part in self._parts},
            {power: vectors.T @ (part.mass @ vectors) for _, power, part in self._parts},
        )
