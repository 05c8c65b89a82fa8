"""What sensors read of a frame: at nodes all at once, between nodes one by one."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from femubench.core.fem.kinematics import point_block
from femubench.core.fem.mesh import SAME_STATION, locate
from femubench.core.fem.meshed_frame import MeshedFrame
from femubench.core.fem.sensors import Sensors
from femubench.core.typing import SparseArray


def sensor_rows(structure: MeshedFrame, sensors: Sensors) -> SparseArray:
    """Return sensor readings from free dofs, sparse (n_sensors, n).

    Raises:
        ModelError: when a sensor lies off the structure.
    """
    transform = structure.kinematics.transform
    if not len(sensors.xyz):
        return sp.csr_array((0, transform.shape[1]))
    # At a flexible connection several nodes lie at one point, of which only the joint is sure.
    joints = len(structure.frame.joints)
    hung = set(structure.mesh.oscillators.tolist())
    found = structure.mesh.tree.query_ball_point(sensors.xyz, SAME_STATION, return_sorted=True)
    near = [[node for node in at if node not in hung] for at in found]
    # Joints are the first nodes, and of what is there the first one.
    node = np.array([at[0] if at and (len(at) == 1 or at[0] < joints) else -1 for at in near])
    axes = sensors.axes
    values = list(axes)
    columns = list(6 * np.maximum(node, 0)[:, None] + np.arange(6))
    for i in np.flatnonzero(node < 0):
        place = locate(structure.frame, sensors.xyz[i])
        block, moved = point_block(structure.frame, structure.mesh, structure.properties, place)
        values[i], columns[i] = axes[i] @ block, moved
    bounds = np.cumsum([0, *map(len, values)])
    rows = sp.csr_array(
        (np.concatenate(values), np.concatenate(columns), bounds),
        shape=(len(node), transform.shape[0]),
    )
    rows.eliminate_zeros()
    return rows @ transform
