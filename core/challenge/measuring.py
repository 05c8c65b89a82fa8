"""Measure a model: the modes that a test of it would give, with noise of stated size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from femubench.core.case.modes import NO_SENSORS
from femubench.core.challenge.structures import Specimen, sensors_on
from femubench.core.challenge.truth import DataKind
from femubench.core.errors import ModelError
from femubench.core.fem.kinematics import node_at
from femubench.core.fem.model import Model
from femubench.core.fem.sensors import DIRECTIONS
from femubench.core.fit.residuals import Data
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.ties import least
from femubench.core.typing import FloatArray, SparseArray

MODES = 16  # elastic modes kept of every model
MASS_STD = 0.002  # of the mass


@dataclass(frozen=True)
class DataQuality:
    """What a kind of data holds.

    Arguments:
        used: number of frequencies that a diagnosis is given.
        shapes: number of used modes with a shape.
        frequency_std: standard deviation of a frequency, of itself.
        shape_std: of a shape, of its largest component; shapes are measured where it is > 0.
        held_out: number of modes held out.
        modified: number of modes of the modified structure.
    """

    used: int
    shapes: int
    frequency_std: float
    shape_std: float
    held_out: int = 4
    modified: int = 6


QUALITY: Mapping[DataKind, DataQuality] = {
    "A": DataQuality(6, 5, 0.002, 0.015),
    "B": DataQuality(6, 5, 0.003, 0.05),
    "C": DataQuality(8, 0, 0.002, 0.0),
}


@dataclass(frozen=True)
class Ideal:
    """What an ideal test sees of a model.

    Arguments:
        frequencies: elastic ones in Hz, ascending, (q,).
        readings: their shapes at the sensors, (n_sensors, q).
        mass: of the structure in kg.
    """

    frequencies: FloatArray
    readings: FloatArray
    mass: float


def see(model: Model, specimen: Specimen) -> Ideal:
    """Return the elastic modes of a model at the measuring points of a specimen.

    The points sit on joints and members, wherever these are in this model.

    Raises:
        ModelError: when the model buckles, or cannot be solved.
    """
    modes = solve_modes(model)
    if modes.eigenvalues[0] < 0.0:
        raise ModelError("the structure buckles")
    elastic = modes.elastic
    if elastic.eigenvalues[0] <= 0.0:
        raise ModelError("the structure is a mechanism")
    rows = _reading_rows(model, specimen)
    readings = np.asarray(rows @ elastic.shapes[:, :MODES])
    return Ideal(elastic.natural_frequencies[:MODES], readings, model.total_mass)


def _reading_rows(model: Model, specimen: Specimen) -> SparseArray:
    """Return sensor readings from dofs; measuring points are nodes on all but odd meshes."""
    structure = model.frame_structure
    rows = []
    for place, direction in specimen.points.values():
        node = node_at(structure.frame, structure.mesh, place)
        if node is None:
            return model.observe(sensors_on(structure.frame, specimen.points))
        rows.append(6 * node + DIRECTIONS.index(direction))
    return sp.csr_array(structure.kinematics.transform)[rows]


def record(
    seen: Ideal,
    specimen: Specimen,
    kind: DataKind,
    count: int,
    rng: np.random.Generator | None,
    *,
    shapes_up_to: int | None = None,
) -> Measurement:
    """Return a test of a model: labelled modes, noise, deviations as the owner would state them.

    Arguments:
        seen: the model.
        specimen: the structure.
        kind: of the data.
        count: number of modes.
        rng: of the noise; None for an ideal test.
        shapes_up_to: modes 1..n have shapes, the others a frequency alone until `used` is
            reached; None for shapes of all.
    """
    quality = QUALITY[kind]
    frequencies = seen.frequencies[:count]
    sensors = specimen.sensors if quality.shape_std > 0.0 else NO_SENSORS
    shapes = np.zeros((0, len(frequencies)))
    if len(sensors):
        raw = seen.readings[:, :count]
        # Of two mirrored points that move alike the first, or rounding would choose the sign.
        largest = np.take_along_axis(raw.T, least(-np.abs(raw.T), 0.0)[:, None], axis=1).T
        shapes = raw / largest
    if rng is not None:
        noise = rng.standard_normal(len(frequencies)), rng.standard_normal(shapes.shape)
        frequencies = frequencies * (1.0 + quality.frequency_std * noise[0])
        shapes = shapes + quality.shape_std * noise[1]
    if shapes_up_to is not None:
        shapes[:, shapes_up_to : quality.used] = np.nan
    std = np.where(np.isnan(shapes), np.nan, quality.shape_std)
    return Measurement(
        sensors=sensors,
        numbers=tuple(range(1, len(frequencies) + 1)),
        frequencies=frequencies,
        frequency_std=quality.frequency_std * frequencies,
        damping=np.full(len(frequencies), np.nan),
        shapes=shapes,
        shape_std=std,
    )


def add_mass(measurement: Measurement, mass: float, rng: np.random.Generator) -> Measurement:
    """Return the measurement with the mass of the structure, as a scale shows it."""
    value = mass * (1.0 + MASS_STD * float(rng.standard_normal()))
    return replace(measurement, total_mass=(value, MASS_STD * value))


def chi2(measurement: Measurement, seen: Ideal) -> float:
    """Return the squared residuals of a model in standard deviations, modes paired by them."""
    data = Data(measurement, np.zeros(0))
    readings = seen.readings if len(measurement.sensors) else seen.readings[:0]
    index = data.pair(seen.frequencies[None], readings[None])[0]
    residual = data.residual(
        seen.frequencies[None, index], readings[None][:, :, index], np.array([seen.mass])
    )
    return float(np.square(residual).sum())
