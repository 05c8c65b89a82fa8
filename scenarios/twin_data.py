"""Mode shapes of the solid twins at sensor positions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

TWIN = Path(__file__).parent / "twin"
Array = npt.NDArray[np.float64]
# Along x, dw/dx = -ry; along y, dw/dy = +rx; in the x-z plane, du/dz = +ry.
_SLOPES = {("z", 0): ("ry", -1.0), ("z", 1): ("rx", 1.0), ("x", 2): ("ry", 1.0)}
_SAME = 1e-5  # m; the stations are printed with six digits


def twin_modes(file: str, sensors: Sequence[tuple[Array, str]]) -> tuple[Array, Array]:
    """Return frequencies in Hz, (m,), and shapes at sensors, (n_sensors, m), of a solid twin.

    Arguments:
        file: name of the table in the twin folder.
        sensors: (position in m, direction) pairs; at a station its displacement is taken, between
            two stations of one straight line the cubic through both displacements and rotations.

    Raises:
        ValueError: when a sensor lies on no line of stations.
    """
    table = pd.read_csv(TWIN / file)
    groups = [group.reset_index(drop=True) for _, group in table.groupby("mode")]
    frequencies = np.array([group["f_hz"].iloc[0] for group in groups])
    shapes = [[_reading(group, xyz, direction) for xyz, direction in sensors] for group in groups]
    return frequencies, np.array(shapes).T


def _reading(stations: pd.DataFrame, xyz: Array, direction: str) -> float:
    points = stations[["x", "y", "z"]].to_numpy()
    distance = np.linalg.norm(points - xyz, axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] < _SAME:
        return float(stations[f"u{direction}"].iloc[nearest])
    for along in range(3):
        across = [axis for axis in range(3) if axis != along]
        line = np.flatnonzero(np.abs(points[:, across] - xyz[across]).max(axis=1) < _SAME)
        line = line[np.argsort(points[line, along])]
        after = int(np.searchsorted(points[line, along], xyz[along]))
        if 0 < after < len(line):
            pair = stations.iloc[line[[after - 1, after]]]
            return _cubic(pair, along, float(xyz[along]), direction)
    raise ValueError(f"no twin stations around {xyz.tolist()}")


def _cubic(pair: pd.DataFrame, along: int, position: float, direction: str) -> float:
    rotation, sign = _SLOPES[direction, along]
    start, stop = pair["xyz"[along]].to_numpy()
    length = stop - start
    xi = (position - start) / length
    u, slope = pair[f"u{direction}"].to_numpy(), sign * pair[rotation].to_numpy() * length
    h = [2 * xi**3 - 3 * xi**2 + 1, xi**3 - 2 * xi**2 + xi, 3 * xi**2 - 2 * xi**3, xi**3 - xi**2]
    return float(h[0] * u[0] + h[1] * slope[0] + h[2] * u[1] + h[3] * slope[1])
