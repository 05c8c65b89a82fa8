"""What a test would record of a solid: frequencies and shapes at sensors, with a test's scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import optimize

from truths.drawing import place
from truths.structure import Structure

Array = npt.NDArray[np.float64]
DAMPING = (0.001, 0.01)  # drawn between, log-uniform
GAIN_SHARE = 0.5  # of the variance of the largest reading: a sensor's gain, alike in every mode
GAINS = 7919  # keeps the draw of the gains apart from those of single states


@dataclass(frozen=True)
class Recording:
    """Hold modes as recorded.

    Arguments:
        frequencies, frequency_std: (modes,) in Hz.
        shapes: (modes, sensors), each mode's largest component 1.
        damping: (modes,) ratios.
    """

    frequencies: Array
    frequency_std: Array
    shapes: Array
    damping: Array


def labels(structure: Structure) -> list[tuple[str, str, str]]:
    """Return label, place and direction of each sensor: `3Y` is along y at the third station."""
    return [
        (f"{number}{direction.upper()}", place(at), direction)
        for number, (at, directions) in enumerate(structure.sensors, 1)
        for direction in directions
    ]


def sensors_csv(structure: Structure) -> str:
    """Return `sensors.csv`."""
    return pd.DataFrame(labels(structure), columns=["label", "at", "direction"]).to_csv(index=False)


def scaled(shapes: Array) -> Array:
    """Return shapes (modes, sensors) with the largest component of each at +1."""
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=1)[:, None], axis=1)
    return np.asarray(shapes / largest)


def record(
    structure: Structure, frequencies: Array, shapes: Array, mesh: Array, *seed: int
) -> Recording:
    """Add a test's scatter to computed modes.

    Arguments:
        shapes: (modes, sensors) as computed.
        mesh: (modes,) relative difference of two meshes; part of the stated deviation, not drawn.
        seed: numbers that make the draw; the sensors' gains come from the first alone.
    """
    rng, gains = np.random.default_rng(seed), np.random.default_rng((seed[0], GAINS))
    modes, sensors = shapes.shape
    shared, own = np.sqrt(structure.together), np.sqrt(1 - structure.together)
    scatter = structure.scatter * (
        shared * rng.standard_normal() + own * rng.standard_normal(modes)
    )
    gain = 1 + structure.shape_scatter * np.sqrt(GAIN_SHARE) * gains.standard_normal(sensors)
    # What the gain leaves of the stated variance, so that every reading scatters as stated.
    own_share = np.sqrt(1 - GAIN_SHARE * scaled(shapes) ** 2)
    noise = structure.shape_scatter * own_share * rng.standard_normal(shapes.shape)
    return Recording(
        frequencies=frequencies * (1 + scatter),
        frequency_std=frequencies * np.hypot(structure.scatter, mesh),
        shapes=scaled(scaled(shapes) * gain + noise),
        damping=np.geomspace(*DAMPING, 1000)[rng.integers(0, 1000, modes)],
    )


def modes_csv(structure: Structure, recording: Recording) -> str:
    """Return `modes.csv` with the digits that a test would print."""
    columns = {
        "mode": range(1, len(recording.frequencies) + 1),
        "frequency": [f"{v:.6g}" for v in recording.frequencies],
        "frequency_std": [f"{v:.2g}" for v in recording.frequency_std],
        "damping": [f"{v:.2g}" for v in recording.damping],
    }
    for (label, *_), column in zip(labels(structure), recording.shapes.T, strict=True):
        columns[label] = [f"{v:.4f}" for v in column]
    return pd.DataFrame(columns).to_csv(index=False)


def mac(first: Array, second: Array) -> Array:
    """Return the modal assurance criterion of shapes (modes, sensors) (Allemang & Brown 1982)."""
    cross = (first @ second.T) ** 2
    return np.asarray(cross / np.outer((first**2).sum(axis=1), (second**2).sum(axis=1)))


def paired(
    first: tuple[Array, Array], second: tuple[Array, Array], closeness: float = 20.0
) -> npt.NDArray[np.int64]:
    """Return for each mode of the first set the one of the second that it is.

    Arguments:
        first, second: frequencies (modes,) and shapes (modes, stations) each.
        closeness: weight of frequencies; two meshes differ in them by far less than two states.
    """
    apart = np.abs(np.log(second[0][None, :] / first[0][:, None]))
    # Shapes of close modes turn into each other: by 20, 5 % count as much as shape alone.
    cost = 1 - mac(first[1], second[1]) + closeness * apart
    return np.asarray(optimize.linear_sum_assignment(cost)[1])
