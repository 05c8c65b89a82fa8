"""What the parts of this paper share: its case, its conventions, frequencies by strategy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from femubench import Modes, StrategyFailure, solve_modes
from femubench.fem import FloatArray
from femubench.reproduction import Ground, Workbench
from femubench.update import QuasiModes

PAPER = "frame"
CASE = "frame"
TRUTH = "frame-beam"
RECOVERED = Ground(
    "fitted",
    "centre lines, E/rho and an accelerometer of 26.6 g at coordinate 1 are fitted to the printed "
    "FE frequencies, so that this is no independent check",
)
TWIN_SHAPES = (
    "on the recovered model, with shapes of the solid twin that carries the accelerometer; the "
    "paper prints none of the test's"
)
SHAPES = (
    "the test's shapes decide, which are not in print: with combinations of the model's own that "
    "have a MAC of 0.9 with them, and with those of the beam truth, there are values of ours"
)
_PAIR = 0.9  # MAC from which on two shapes are commonly taken for those of one mode
TURNS = tuple(f"{CASE} turned {way}" for way in ("12", "13", "23", "21", "31", "32"))
GIVEN = Ground(
    "input",
    "a measured frequency that the update is given, and that a method which meets its equations "
    "gives back",
)


def modes_of(bench: Workbench, words: str, case: str = CASE) -> Modes:
    """Return the modes of an updated model."""
    return solve_modes(bench.update(case, words).model)


def strain_modes(bench: Workbench, words: str, case: str = CASE) -> FloatArray:
    """Return the first five frequencies beyond the rigid-body modes in Hz, (5,)."""
    return modes_of(bench, words, case).elastic.natural_frequencies[:5]


def rigid_modes(bench: Workbench, words: str, case: str = CASE) -> FloatArray:
    """Return the frequencies of what were the rigid-body modes in Hz, imaginary ones negative.

    The same number of modes as there are in the nominal model, wherever they went.
    """
    modes = modes_of(bench, words, case)
    return np.sort(modes.natural_frequencies[modes.rigid])


def format_frequencies(values: FloatArray) -> str:
    """Return frequencies as text, imaginary ones with an i."""
    return " ".join(one(float(v)) for v in values)


def one(value: float, digits: int = 1) -> str:
    """Return a frequency as text, an imaginary one with an i."""
    return f"{value:.{digits}f}" if value >= 0.0 else f"{-value:.{digits}f} i"


def with_turned_shapes(bench: Workbench) -> Workbench:
    """Return the bench with the cases `TURNS`: used shapes that are rotated ones of the model.

    By equations (16)-(17) a rotation of the model's own shapes is all that the test's can do.
    """
    case = bench.cases[CASE]
    data, quasi = case.measurement, QuasiModes.of(case.model, case.used_measurement())
    readings = case.model.observe(data.sensors) @ quasi.modes.shapes[:, quasi.partners]
    cases = dict(bench.cases)
    for name in TURNS:
        i, j = (int(axis) - 1 for axis in name[-2:])
        rotation = np.eye(len(readings.T))
        rotation[i, i] = rotation[j, j] = np.sqrt(_PAIR)
        rotation[i, j], rotation[j, i] = np.sqrt(1.0 - _PAIR) * np.array([1.0, -1.0])
        shapes = data.shapes.copy()
        shapes[:, np.isin(data.numbers, case.used)] = readings @ rotation
        cases[name] = replace(case, measurement=replace(data, shapes=shapes))
    return replace(bench, cases=cases)


def under_other_shapes(
    bench: Workbench, words: str, figure: Callable[[Modes], float]
) -> Iterator[float]:
    """Yield a figure of the updated modes under every other set of shapes that gives a model."""
    for case in (TRUTH, *TURNS):
        with suppress(StrategyFailure):
            yield figure(modes_of(bench, words, case))
