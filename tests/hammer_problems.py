"""Hammer tests over time of a lumped frame: own matrices, exact steps of SciPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.signal

RATE, FINER, WIDTH = 1024.0, 8, 0.004  # Hz; steps of the sum between samples; of a hit in s


@dataclass(frozen=True)
class Structure:
    """Matrices with modal damping, and what moves along which direction where."""

    mass: Any
    stiffness: Any
    direction: str
    xyz: Any
    ratio: float = 0.006

    @property
    def labels(self) -> list[str]:
        return [f"{k + 1}:{self.direction}" for k in range(len(self.xyz))]

    def modes(self) -> tuple[Any, Any]:
        """Return natural frequencies in Hz, and shapes at the labels."""
        squares, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
        return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi), shapes[: len(self.xyz)]

    def respond(self, force: Any) -> Any:
        """Return accelerations at fine steps, mode by mode."""
        hz, _ = self.modes()
        shapes = scipy.linalg.eigh(self.stiffness, self.mass)[1]
        step, found = 1.0 / (RATE * FINER), np.zeros((len(force), len(self.xyz)))
        for w, shape in zip(2.0 * np.pi * hz, shapes.T, strict=True):
            drive = force @ shape[: force.shape[1]]
            if w > 1.0:  # a rigid motion is the drive itself
                system = [1.0, 0.0, 0.0], [1.0, 2.0 * self.ratio * w, w**2]
                above, below, _ = scipy.signal.cont2discrete(system, step, "foh")
                drive = scipy.signal.lfilter(above[0], below, drive)
            found += np.outer(drive, shape[: len(self.xyz)])
        return found


def frame(
    loss: Sequence[float] = (0.0, 0.0, 0.0), added: Sequence[float] = (0.0,) * 4
) -> Structure:
    """Return three storeys on rails: four masses, three springs."""
    stiffness = np.zeros((4, 4))
    for k, spring in enumerate(4e5 * np.array([1.0, 1.05, 0.95]) * (1.0 - np.array(loss))):
        stiffness[k : k + 2, k : k + 2] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    mass = np.diag(np.array([6.5, 6.4, 6.3, 6.2]) + np.array(added))
    xyz = np.outer(np.arange(4.0), [0.0, 0.0, 0.3])
    return Structure(mass, stiffness, "x", xyz)


def hit(
    structure: Structure,
    point: int,
    seed: int,
    *,
    hits: int = 3,
    gap: float = 4.0,
    noise: float = 0.01,
) -> tuple[Any, Any]:
    """Return force and motions of one record with several hits, noise of a share on both."""
    rng = np.random.default_rng(seed)
    time = np.arange(int((hits * gap + 0.3) * RATE) * FINER) / (RATE * FINER)
    force = np.zeros((len(time), len(structure.xyz)))
    for k in range(hits):
        since = time - 0.2 - k * gap - 0.05 * rng.random()
        pulse = np.sin(np.pi * since / WIDTH) ** 2 * (150.0 + 100.0 * rng.random())
        force[:, point] += np.where((since > 0.0) & (since < WIDTH), pulse, 0.0)
    every = np.column_stack([force[:, point], structure.respond(force)])
    every = scipy.signal.decimate(every, FINER, axis=0, ftype="fir")
    every += noise * every.std(axis=0) * rng.standard_normal(every.shape)
    return every[:, 0] + 0.2, every[:, 1:] - 0.1
