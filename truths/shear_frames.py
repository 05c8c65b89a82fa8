"""Shear frames as they are, with columns that bend and joints that turn, and as they are drawn.

A storey's columns are one bending beam with its own mass, floors are lumps whose girders resist
their rotation; the drawing has a mass a floor and a spring a storey. Nothing of femubench is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import linalg

Array = npt.NDArray[np.float64]
PIECES = 4  # elements a storey
HEIGHT = 0.4  # of a storey, m
MASS, STIFFNESS = 6.0, 8e4  # of a floor in kg, of a storey in N/m, before both are drawn


@dataclass(frozen=True)
class Plan:
    """A frame, how it is tested, and the seed of its sizes.

    Arguments:
        name: of its folder.
        storeys: number of them.
        hangs: whether it hangs on rails, its base a floor more; fixed to the ground otherwise.
        used, held_out: numbers of modes.
        floors: with a sensor along x; 0 is the base.
        seed: of its sizes.
        declared: whether the drawing says ``free = true``.
        weighed: whether a balance has read its mass.
        coarse: factor on what the drawing is off.
    """

    name: str
    storeys: int
    hangs: bool
    used: int
    held_out: int
    floors: tuple[int, ...]
    seed: int
    declared: bool = False
    weighed: bool = False
    coarse: float = 1.0

    @property
    def masses(self) -> range:
        """Return the floors that move."""
        return range(0 if self.hangs else 1, self.storeys + 1)

    @property
    def labels(self) -> list[tuple[str, str, str]]:
        """Return label, place and direction of every sensor."""
        return [(f"{floor}X", f"f{floor}", "x") for floor in self.floors]


@dataclass(frozen=True)
class Frame:
    """A frame as it is.

    Arguments:
        hangs: as in `Plan`.
        masses: of the floors that move, kg.
        stiffness: of the storeys between floors that do not turn, N/m.
        columns: mass of the columns of each storey, kg.
        girders: what resists the rotation of each floor but the base, in EI / h of the columns
            in the mean; infinite where no floor turns.
        springs: first and second floor, and N/m: -1 is the ground.
        pieces: elements a storey.
    """

    hangs: bool
    masses: Array
    stiffness: Array
    columns: Array
    girders: float
    springs: tuple[tuple[int, int, float], ...] = ()
    pieces: int = PIECES

    @property
    def mass(self) -> float:
        """Return the mass of floors and columns in kg."""
        return float(self.masses.sum() + self.columns.sum())


def built(plan: Plan) -> Frame:
    """Return the frame of a plan, its sizes drawn."""
    rng = np.random.default_rng(plan.seed)
    masses = MASS * rng.uniform(0.85, 1.15, len(plan.masses))
    stiffness = STIFFNESS * rng.uniform(0.8, 1.25, plan.storeys)
    columns = MASS * rng.uniform(0.02, 0.06, plan.storeys)
    return Frame(plan.hangs, masses, stiffness, columns, float(rng.uniform(120.0, 400.0)))


def drawn(plan: Plan) -> tuple[Array, Array]:
    """Return the masses and storey stiffnesses of the drawing: up to 3 and 10 % off, or more."""
    frame, rng = built(plan), np.random.default_rng((plan.seed, 1))
    lumped = np.zeros(plan.storeys + 1)
    lumped[list(plan.masses)] = frame.masses
    lumped[1:] += frame.columns / 2.0
    lumped[:-1] += frame.columns / 2.0
    off = rng.uniform(-0.03, 0.03, len(plan.masses)), rng.uniform(-0.1, 0.1, plan.storeys)
    masses = lumped[list(plan.masses)] * (1.0 + plan.coarse * off[0])
    # Whole N/m, so that files with ten digits hold what hangs by nothing.
    return masses, np.round(frame.stiffness * (1.0 + plan.coarse * off[1]))


def with_mass(frame: Frame, floor: int, mass: float) -> Frame:
    """Return a frame with a mass on a floor."""
    masses = frame.masses.copy()
    masses[floor if frame.hangs else floor - 1] += mass
    return replace(frame, masses=masses)


def with_loss(frame: Frame, storey: int, loss: float) -> Frame:
    """Return a frame with a storey, counted from 1, whose columns are softer."""
    stiffness = frame.stiffness.copy()
    stiffness[storey - 1] *= 1.0 - loss
    return replace(frame, stiffness=stiffness)


def storey_matrix(count: int, storey: int, hangs: bool, stiffness: float) -> Array:
    """Return the stiffness of one storey of a drawing, a row a floor that moves."""
    row = floor_row(count, hangs, storey - 1, storey)
    return stiffness * np.outer(row, row)


def floor_row(count: int, hangs: bool, first: int, second: int) -> Array:
    """Return how far two floors move apart, of the motion of all; -1 is the ground."""
    row = np.zeros(count)
    for floor, sign in ((first, -1.0), (second, 1.0)):
        if (index := floor if hangs else floor - 1) >= 0:
            row[index] += sign
    return row


def _matrices(frame: Frame) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """Return mass and stiffness, and which of their rows is the motion of each floor.

    Source: Euler-Bernoulli element with consistent mass, Przemieniecki 1968, chapters 5 and 11.
    """
    storeys, pieces = len(frame.stiffness), frame.pieces
    size = 2 * (storeys * pieces + 1)  # displacement and rotation of every node
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    h = HEIGHT / pieces
    turn = np.array([1.0, h, 1.0, h])
    bend = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
    swing = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
    rigidity = frame.stiffness * HEIGHT**3 / 12.0
    for i in range(storeys * pieces):
        own, storey = slice(2 * i, 2 * i + 4), i // pieces
        stiffness[own, own] += rigidity[storey] / h**3 * bend * np.outer(turn, turn)
        part = frame.columns[storey] / pieces
        mass[own, own] += part / 420.0 * swing * np.outer(turn, turn)
    moves = 2 * pieces * np.arange(storeys + 1)
    at = moves if frame.hangs else moves[1:]
    mass[at, at] += frame.masses
    turns = moves[1:] + 1
    held = [1] if frame.hangs else [0, 1]  # rails and clamp let the base not turn
    if np.isfinite(frame.girders):
        stiffness[turns, turns] += frame.girders * rigidity.mean() / HEIGHT
    else:
        held += turns.tolist()
    for first, second, spring in frame.springs:
        row = np.zeros(size)
        row[at] = floor_row(len(at), frame.hangs, first, second)
        stiffness += spring * np.outer(row, row)
    free = np.setdiff1d(np.arange(size), held)
    return mass[np.ix_(free, free)], stiffness[np.ix_(free, free)], np.searchsorted(free, at)


def modes(frame: Frame) -> tuple[Array, Array]:
    """Return angular frequencies, the rigid one 0, and shapes of unit mass at all moving floors.

    As many modes as floors: those above are of columns between floors that hardly move.
    """
    mass, stiffness, rows = _matrices(frame)
    squared, vectors = linalg.eigh(stiffness, mass, subset_by_index=(0, len(rows) - 1))
    if frame.hangs and not any(-1 in ends[:2] for ends in frame.springs):
        squared[0] = 0.0
    return np.asarray(np.sqrt(squared)), np.asarray(vectors[rows].T)


def readings(plan: Plan, shapes: Array) -> Array:
    """Return shapes (modes, floors that move) at the sensors of a plan."""
    return shapes[:, [plan.masses.index(floor) for floor in plan.floors]]


def plans() -> Sequence[Plan]:
    """Return the frames: the first five of development, the others held."""
    kinds: tuple[tuple[str, int, bool, int, int, tuple[int, ...], bool, bool], ...] = (
        ("free-3", 3, True, 2, 0, (1, 2, 3), True, False),
        ("fixed-5", 5, False, 3, 0, (1, 3, 5), False, False),
        ("free-4", 4, True, 3, 0, (0, 1, 2, 3, 4), False, True),
        ("fixed-8", 8, False, 3, 1, (2, 4, 6, 7, 8), False, False),
        ("fixed-3", 3, False, 2, 0, (1, 2, 3), False, False),
        ("free-3-short", 3, True, 2, 0, (0, 2, 3), False, False),
        ("fixed-6", 6, False, 3, 0, (1, 2, 3, 4, 5, 6), False, False),
        ("free-5", 5, True, 3, 1, (0, 2, 4, 5), True, True),
        ("fixed-7", 7, False, 4, 0, (1, 3, 5, 7), False, False),
        ("fixed-4", 4, False, 2, 0, (2, 4), False, False),
    )
    return [Plan(*row[:6], 52_000 + i, *row[6:]) for i, row in enumerate(kinds)]
