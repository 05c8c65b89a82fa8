"""Synthetic frequency responses of known modes: a plain sum that shares no code with the fit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from femubench import Sensors
from femubench.modal import FrequencyResponses

MODES, POINTS, NOISE, APART = 25, 13, 0.01, 1.01
BAND = (40.0, 1000.0)  # Hz
DAMPING = (0.002, 0.02)


@dataclass(frozen=True)
class FrfSet:
    """Accelerances with noise, and the modes that they were made of."""

    measured: FrequencyResponses
    frequencies: Any
    damping: Any
    shapes: Any


def frf_set(
    seed: int,
    *,
    references: int = 3,
    modes: int = MODES,
    pairs: int = 2,
    noise: float = NOISE,
    step: float = 0.25,
    band: tuple[float, float] = BAND,
) -> FrfSet:
    """Return the accelerances of a random structure with real shapes.

    Natural frequencies have gaps of 0.5 to 1.5 times their mean; two neighbours of each pair lie
    1 % apart, with unrelated shapes. Damping ratios are log-uniform. One mode lies below the band
    at 7 Hz, as a suspension has it, and five anywhere from 1.05 to 1.9 times its upper end. The
    noise is white and complex, its rms a share of the rms of its own channel over the band.

    Arguments:
        seed: of everything.
        references: number of driven points.
        modes: in the band.
        pairs: of them, close ones.
        noise: its share.
        step: between lines in Hz.
        band: in Hz.
    """
    rng = np.random.default_rng(seed)
    sites = modes - pairs
    gaps = rng.uniform(0.5, 1.5, sites + 1)
    own = band[0] + (band[1] - band[0]) * np.cumsum(gaps / gaps.sum())[:-1]
    doubled = rng.choice(np.arange(1, sites - 1), pairs, replace=False)
    own = np.sort(np.r_[own, APART * own[doubled]])
    every = np.r_[own, 7.0, band[1] * rng.uniform(1.05, 1.9, 5)]
    damping = np.exp(rng.uniform(*np.log(DAMPING), len(every)))
    shapes = rng.standard_normal((POINTS, len(every)))
    driven = np.arange(references) * (POINTS // references)
    hz = np.arange(band[0], band[1] + step / 2, step)
    omega, natural = 2.0 * np.pi * hz[:, None], 2.0 * np.pi * every
    modal = -np.square(omega) / (natural**2 - omega**2 + 2j * damping * natural * omega)
    values = np.einsum("om,fm,im->foi", shapes, modal, shapes[driven])
    size = np.sqrt(np.square(np.abs(values)).mean(axis=0) / 2.0)
    draws = rng.standard_normal((2, *values.shape))
    values = values + noise * size * (draws[0] + 1j * draws[1])
    return FrfSet(
        FrequencyResponses(sensors(POINTS), sensors(POINTS, driven), hz, values, "accelerance"),
        own,
        damping[:modes],
        shapes[:, :modes],
    )


def sensors(count: int, some: Any = slice(None)) -> Sensors:
    """Return sensors in a row, or some of them."""
    at = np.arange(count)[some]
    xyz = np.stack([0.1 * at, np.zeros(len(at)), np.zeros(len(at))], axis=1)
    return Sensors(tuple(f"{k + 1}:z" for k in at), xyz, ("z",) * len(at))


def write_universal(file: Path, measured: FrequencyResponses, **more: Any) -> Path:
    """Write a universal file with nodes and a dataset 58 for every channel."""
    import pyuff

    nodes, along = [int(label.partition(":")[0]) for label in measured.responses.labels], " xyz"
    zeros = [0] * len(nodes)
    x, y, z = measured.responses.xyz.T
    ordinate = {"receptance": 8, "mobility": 11, "accelerance": 12}[measured.quantity]
    sets: list[dict[str, Any]] = [
        {
            "type": 15, "node_nums": nodes, "def_cs": zeros, "disp_cs": zeros, "color": zeros,
            "x": x, "y": y, "z": z,
        }
    ]  # fmt: skip
    for o, node in enumerate(nodes):
        for i, label in enumerate(measured.references.labels):
            sets.append(
                {
                    "type": 58, "func_type": 4, "rsp_node": node,
                    "rsp_dir": along.index(measured.responses.directions[o]),
                    "ref_node": int(label.partition(":")[0]),
                    "ref_dir": along.index(measured.references.directions[i]),
                    "data": measured.values[:, o, i], "x": measured.frequencies,
                    "id1": "FRF", "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                    "abscissa_spacing": 1, "abscissa_spec_data_type": 18,
                    "ordinate_spec_data_type": ordinate, "orddenom_spec_data_type": 13, **more,
                }
            )  # fmt: skip
    pyuff.UFF(str(file)).write_sets(sets, mode="overwrite")
    return file
