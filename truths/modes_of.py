"""The modes of a described structure: meshed, assembled, solved, observed where sensors sit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from truths.bricks import brick_mesh
from truths.eigenmodes import attach, bind, solve
from truths.elasticity import Matrices, assemble
from truths.measurement import mac, paired
from truths.seats import observed
from truths.solid import Solid
from truths.structure import Change, Place, Structure
from truths.tetrahedra import tetrahedral_mesh

Array = npt.NDArray[np.float64]
SPARE = 6  # modes beyond those wanted, so that pairing finds its partners
SHARES = (0.0, 0.25, 0.5, 0.75)  # of members, at which shapes are compared between meshes


@dataclass(frozen=True)
class Observed:
    """Hold modes as sensors and stations see them.

    Arguments:
        frequencies: (modes,) Hz.
        sensors: (modes, sensors) at the test's sensors.
        stations: (modes, 3 stations) along x, y, z all over the structure.
        rigid: number of rigid modes that were left out.
    """

    frequencies: Array
    sensors: Array
    stations: Array
    rigid: int

    def chosen(self, modes: npt.NDArray[np.int64] | npt.NDArray[np.bool_]) -> Observed:
        """Return some of the modes."""
        return Observed(
            self.frequencies[modes], self.sensors[modes], self.stations[modes], self.rigid
        )


def mesh_of(structure: Structure, size: float) -> Solid:
    """Mesh a structure with the mesher that it names."""
    return {"bricks": brick_mesh, "tetrahedra": tetrahedral_mesh}[structure.mesher](structure, size)


def assembled(structure: Structure, solid: Solid) -> Matrices:
    """Assemble a solid in its real shape."""
    real = solid.points if structure.warp is None else structure.warped(solid.points)
    return assemble(solid, real)


def stations(structure: Structure) -> tuple[tuple[Place, str], ...]:
    """Return places all over the solid, three directions each; a drawn link has none."""
    made = structure.solid_members
    return tuple(((m.name, share), "xyz") for m in made for share in SHARES)


def in_plane(structure: Structure, modes: Observed, mixed: bool) -> Observed:
    """Leave out the modes that move mostly where the sensors of a planar drawing do not look.

    Raises:
        ValueError: where a mode moves both in and across the plane, unless `mixed` ones may.
    """
    if structure.plane == "3d":
        return modes
    motion = (modes.stations.reshape(len(modes.frequencies), -1, 3) ** 2).sum(axis=1)
    across = motion[:, 1] if structure.plane == "in-plane" else motion[:, :2].sum(axis=1)
    share = across / motion.sum(axis=1)
    seen, torn = share < 0.5, (share > 0.1) & (share < 0.9)
    listed = np.flatnonzero(seen)[: structure.used + structure.held_out]
    if not mixed and torn[listed].any():
        raise ValueError(f"{structure.name}: a mode moves in and across the plane")
    return modes.chosen(seen)


def modes_of(
    structure: Structure,
    matrices: Matrices,
    count: int,
    change: Change | None = None,
    mixed: bool = False,
    bodies: Sequence[npt.NDArray[np.int64]] = (),
) -> Observed:
    """Return the lowest elastic modes of a structure, after a change of its design if given.

    Arguments:
        bodies: sets of nodes that are rigid.
        mixed: whether modes may move both in and across the plane, as those of a defect do.

    Raises:
        ValueError: where a free structure has not six rigid modes.
    """
    lumps = structure.lumps + (change.lumps if change else ())
    springs = structure.springs + (change.springs if change else ())
    matrix = attach(structure, matrices, lumps, springs, structure.struts, structure.oscillators)
    if bodies:
        matrix = bind(matrix, matrices.nodes, bodies)
    # Half the modes of a planar structure move across its plane.
    wanted = (count + SPARE) * (1 if structure.plane == "3d" else 2) + 6
    modes = solve(matrix, wanted, structure.guess)
    if not (structure.clamps or springs) and modes.rigid != 6:
        raise ValueError(f"{structure.name}: {modes.rigid} rigid modes, 6 expected")
    read = observed(structure, matrices, structure.sensors) @ modes.shapes
    everywhere = observed(structure, matrices, stations(structure)) @ modes.shapes
    found = Observed(modes.frequencies, read.T, everywhere.T, modes.rigid)
    return in_plane(structure, found, mixed)


def mesh_difference(coarse: Observed, fine: Observed, count: int) -> tuple[Array, Array]:
    """Return relative difference of frequency and MAC of the first modes of two meshes."""
    lead = fine.chosen(np.arange(count))
    partner = paired((lead.frequencies, lead.stations), (coarse.frequencies, coarse.stations))
    alike = mac(lead.stations, coarse.stations[partner]).diagonal()
    return np.abs(coarse.frequencies[partner] / lead.frequencies - 1), alike
