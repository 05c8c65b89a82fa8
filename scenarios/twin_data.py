"""Mode shapes of the solid twins at sensor positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import scipy.linalg as la

from femubench import Model, Sensors, read_case
from femubench.fem import PointMass
from femubench.modal import rigid_modes_of

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


def read_shapes(file: str, folder: Path, sensors: Sensors) -> Array:
    """Return the shapes of a solid twin that carries the known masses of a case, (n_sensors, m).

    The twin's own modes and its rigid-body motions are coupled by the masses (structural
    modification; Avitabile 2003); the lever of an offset mass is left out. Rigid motions are those
    of the case's beam model without the masses.

    Arguments:
        file: name of the table in the twin folder.
        folder: of the case.
        sensors: where shapes are wanted.
    """
    frame = read_case(folder, folder.name, ()).model.frame_structure.frame
    bare = Model.of(replace(frame, masses=()))
    active = {"in-plane": ("x", "z"), "out-of-plane": ("z",)}[frame.plane]
    points = [(_position(bare, mass), mass.mass) for mass in frame.masses]
    spots = [(xyz, d) for xyz, _ in points for d in active]
    weights = np.array([mass for _, mass in points for _ in active])
    xyz = np.array([*sensors.xyz, *(point for point, _ in spots)])
    directions = (*sensors.directions, *(d for _, d in spots))
    everywhere = Sensors(tuple(str(i) for i in range(len(xyz))), xyz, directions)
    pairs = list(zip(xyz, directions, strict=True))
    frequencies, elastic = twin_modes(file, pairs)
    rigid = np.asarray(bare.observe(everywhere) @ rigid_modes_of(bare))
    motion = np.hstack([rigid, elastic])
    stiffness = np.square(2 * np.pi * np.append(np.zeros(rigid.shape[1]), frequencies))
    seen = motion[len(sensors) :]
    _, mixed = la.eigh(np.diag(stiffness), np.eye(len(stiffness)) + seen.T * weights @ seen)
    shapes: Array = (motion @ mixed)[: len(sensors), rigid.shape[1] :]
    return shapes


def _position(model: Model, mass: PointMass) -> Array:
    """Return where a mass is attached in m."""
    frame = model.frame_structure.frame
    if mass.at.joint is not None:
        return np.array(frame.joint(mass.at.joint).xyz)
    member = frame.members[frame.member_index[str(mass.at.member)]]
    start, stop = (np.array(frame.joint(name).xyz) for name in member.ends)
    position: Array = start + float(mass.at.s or 0.0) * (stop - start)
    return position


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
    start, stop = pair["xyz"[along]].to_numpy()
    length = stop - start
    xi = (position - start) / length
    u = pair[f"u{direction}"].to_numpy()
    if direction == "xyz"[along]:
        return float((1 - xi) * u[0] + xi * u[1])
    rotation, sign = _SLOPES[direction, along]
    slope = sign * pair[rotation].to_numpy() * length
    h = [2 * xi**3 - 3 * xi**2 + 1, xi**3 - 2 * xi**2 + xi, 3 * xi**2 - 2 * xi**3, xi**3 - xi**2]
    return float(h[0] * u[0] + h[1] * slope[0] + h[2] * u[1] + h[3] * slope[1])
