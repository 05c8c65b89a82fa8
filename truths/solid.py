"""A mesh of a solid: its cells, what each is made of, and where it lies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph

from truths.structure import Material

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Solid:
    """Hold a mesh of straight-sided cells with a material each.

    Arguments:
        points: (3, n) corners in the straight description, m.
        cells: (8, m) corners of bricks in scikit-fem's order, or (4, m) of tetrahedra.
        part: (m,) index into `parts`, the names of members and blocks.
        modulus, poisson, density: (m,) of each cell, Pa, 1, kg/m3.
    """

    points: Array
    cells: Integers
    part: Integers
    parts: tuple[str, ...]
    modulus: Array
    poisson: Array
    density: Array

    @property
    def centres(self) -> Array:
        """Return the (3, m) centres of the cells in the straight description, m."""
        return np.asarray(self.points[:, self.cells].mean(axis=1))

    def of_part(self, *names: str) -> npt.NDArray[np.bool_]:
        """Return which cells belong to parts of these names."""
        wanted = [i for i, part in enumerate(self.parts) if part in names]
        return np.isin(self.part, wanted)

    def scaled(
        self, cells: npt.NDArray[np.bool_], stiffness: float = 1.0, mass: float = 1.0
    ) -> Solid:
        """Return the solid with multiples of modulus and density in some cells."""
        return replace(
            self,
            modulus=np.where(cells, self.modulus * stiffness, self.modulus),
            density=np.where(cells, self.density * mass, self.density),
        )

    def of(self, cells: npt.NDArray[np.bool_], material: Material) -> Solid:
        """Return the solid with another material in some cells."""
        return replace(
            self,
            modulus=np.where(cells, material.E, self.modulus),
            poisson=np.where(cells, material.nu, self.poisson),
            density=np.where(cells, material.rho, self.density),
        )

    def without(self, cells: npt.NDArray[np.bool_]) -> Solid:
        """Return the solid with some cells cut out."""
        keep = ~cells
        used, index = np.unique(self.cells[:, keep], return_inverse=True)
        return replace(
            self,
            points=self.points[:, used],
            cells=index.reshape(self.cells.shape[0], -1),
            part=self.part[keep],
            modulus=self.modulus[keep],
            poisson=self.poisson[keep],
            density=self.density[keep],
        )

    @property
    def pieces(self) -> int:
        """Return how many pieces the cells form that share no corner."""
        count, cells = self.points.shape[1], self.cells
        ends = (np.repeat(cells[0], cells.shape[0]), cells.T.ravel())
        links = sparse.coo_array((np.ones(cells.size), ends), shape=(count, count))
        return int(csgraph.connected_components(links, directed=False)[0])

    def moved(self, points: Array) -> Solid:
        """Return the solid with its corners elsewhere."""
        return replace(self, points=points)
