"""What the parts of this paper share: its case, its conventions, frequencies by strategy."""

from __future__ import annotations

import numpy as np

from femubench import Modes, solve_modes
from femubench.fem import FloatArray
from femubench.reproduction import Ground, Workbench

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


def format_frequencies(values: FloatArray, digits: int = 1) -> str:
    """Return frequencies as text, imaginary ones with an i."""
    return " ".join(one(float(v), digits) for v in values)


def one(value: float, digits: int = 1) -> str:
    """Return a frequency as text, an imaginary one with an i."""
    return f"{value:.{digits}f}" if value >= 0.0 else f"{-value:.{digits}f} i"
