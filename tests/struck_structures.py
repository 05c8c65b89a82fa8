"""Hammer tests over time of a frame on rails and of a strip of steel, with the models of them.

SciPy integrates the hits; nothing of the package is used. Damping couples the modes, the strip has
a vice that gives and a block that resists a turn. What is recorded has an anti-aliasing filter,
drift, noise and the steps of a converter; no two hits are alike, nor two days.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.linalg
import scipy.signal
from scipy.integrate import solve_ivp

STATIONS = np.array([0.1, 0.2, 0.35, 0.45, 0.6, 0.75, 0.8])  # m along the strip
LENGTH, WIDTH, DEPTH = 0.8, 0.05, 0.01  # m
FINER = 4  # steps of the motion between samples


@dataclass(frozen=True)
class Rig:
    """What is struck, and how it is recorded.

    Arguments:
        mass, stiffness, damping: (n, n).
        rows: displacements of the sensors, (s, n).
        direction: of all of them.
        rate: of the samples in Hz.
        pulse: of a hit in s.
    """

    mass: Any
    stiffness: Any
    damping: Any
    rows: Any
    direction: str
    rate: float
    pulse: float

    @property
    def labels(self) -> Any:
        return np.array([f"{k + 1}:{self.direction}" for k in range(len(self.rows))], dtype=object)

    def modes(self) -> tuple[Any, Any]:
        """Return frequencies without damping in Hz, below 1.5 rates, and shapes (n, m)."""
        squares, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
        hertz = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
        return hertz[hertz < 1.5 * self.rate], shapes[:, hertz < 1.5 * self.rate]

    def move(self, point: int, rng: np.random.Generator, hits: int, gap: float) -> tuple[Any, Any]:
        """Return force and accelerations at fine steps: pulses in time, then damped modes."""
        hertz, shapes = self.modes()
        damping, n = shapes.T @ self.damping @ shapes, len(hertz)
        drive = np.concatenate([np.zeros(n), self.rows[point] @ shapes])
        squares = np.diag((2.0 * np.pi * hertz) ** 2)
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-squares, -damping]])
        poles, own = scipy.linalg.eig(system)
        read = self.rows @ shapes @ system[n:]
        time = np.arange(int((hits * gap + 0.5) * FINER * self.rate)) / (FINER * self.rate)
        force, motion = np.zeros(len(time)), np.zeros((len(time), len(self.rows)))
        state, last = np.zeros(2 * n), 0.0
        for k in range(hits):
            begin = 0.3 + k * gap + 0.1 * rng.random()
            peak, width = 120.0 + 160.0 * rng.random(), self.pulse * (0.8 + 0.4 * rng.random())

            def pulse(
                t: Any, begin: float = begin, peak: float = peak, width: float = width
            ) -> Any:
                return peak * np.sin(np.pi * (t - begin) / width) ** 2

            def rate(t: float, y: Any, pulse: Any = pulse) -> Any:
                return system @ y + pulse(t) * drive

            state = (own @ (np.exp(poles * (begin - last)) * np.linalg.solve(own, state))).real
            last, (struck,) = begin + width, np.nonzero((time > begin) & (time < begin + width))
            at = [*time[struck], last]
            done = solve_ivp(rate, (begin, last), state, "DOP853", at, rtol=1e-9, atol=1e-12)
            force[struck] = pulse(time[struck])
            motion[struck] = (read @ done.y[:, :-1]).T
            motion[struck] += np.outer(force[struck], self.rows @ shapes @ drive[n:])
            state, after = done.y[:, -1], time >= last
            each = read @ own * np.linalg.solve(own, state)
            motion[after] = sum(
                np.outer(np.exp(pole * (time[after] - last)), one).real
                for pole, one in zip(poles, each.T, strict=True)
            )
        return force, motion

    def record(self, point: int, seed: int, hits: int = 3, gap: float = 5.0) -> tuple[Any, Any]:
        """Return what an analyser stores of force and accelerations: (n,) in N, (n, s) in m/s2."""
        rng = np.random.default_rng(seed)
        every = np.column_stack(self.move(point, rng, hits, gap))
        low = scipy.signal.ellip(8, 0.05, 80.0, 1.6 / FINER, fs=FINER, output="sos")
        every = scipy.signal.sosfilt(low, every, axis=0)[::FINER]
        size, time = np.abs(every).max(axis=0), np.arange(len(every)) / self.rate
        waves = np.stack([np.ones(len(time)), time / time[-1], np.sin(0.4 * time)], axis=1)
        every += size * (waves @ rng.normal(0.0, 0.002, (3, len(size))))
        every += 5e-4 * size * rng.standard_normal(every.shape)
        step = 2.0 * np.r_[size[0], np.full(len(size) - 1, size[1:].max())] / 2**15
        every = step * np.round(every / step)
        return every[:, 0], every[:, 1:]

    def write(self, file: Path, points: Sequence[int], seed: int, *, force: bool = True) -> Rig:
        """Write MATLAB's file with a record of every point that is struck, on all sensors.

        Sensors are put on anew, with gains of their own, on a day of its own temperature: the
        structure of that day is returned.
        """
        rng = np.random.default_rng(seed)
        warm = replace(self, stiffness=self.stiffness * (1.0 + 0.001 * rng.standard_normal()))
        gains = 1.0 + 0.01 * rng.standard_normal(len(self.rows))
        forces, motions = zip(*(warm.record(p, 100 * seed + p) for p in points), strict=True)
        held = {"fs": self.rate, "acc": gains[:, None] * np.stack(motions, axis=2)}
        held["responses"] = self.labels
        if force:
            held |= {"hammer": np.stack(forces, axis=1), "points": self.labels[list(points)]}
        scipy.io.savemat(file, held)
        return warm


def frame(loss: Sequence[float] = (0.0,) * 3, added: Sequence[float] = (0.0,) * 4) -> Rig:
    """Return four floors of 6 kg on three storeys, which roll on rails with drag."""
    stiffness = np.zeros((4, 4))
    for k, spring in enumerate(np.array([3.9e5, 4.2e5, 4.0e5]) * (1.0 - np.array(loss))):
        stiffness[k : k + 2, k : k + 2] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    mass = np.diag(np.array([6.6, 6.3, 6.4, 6.1]) + added)
    damping = 3e-5 * stiffness + np.diag([5.0, 1.0, 0.6, 0.4])
    return Rig(mass, stiffness, damping, np.eye(4), "x", 1024.0, 0.006)


def strip(loss: Sequence[float] = (0.0,) * 4, tip: float = 0.0, roller: float | None = None) -> Rig:
    """Return a strip of steel, clamped in a vice: 40 cubic elements, integrated by Gauss.

    Arguments:
        loss: of stiffness of every quarter.
        tip: a block there in kg.
        roller: where one lies under it in m.
    """
    count, points, weights = 40, *np.polynomial.legendre.leggauss(4)
    a, area, inertia = LENGTH / count, WIDTH * DEPTH, WIDTH * DEPTH**3 / 12.0
    whole = np.array([[1, 0, -3, 2], [0, a, -2 * a, a], [0, 0, 3, -2], [0, 0, -a, a]])

    def cubic(s: float, order: int = 0) -> Any:
        powers = [np.polynomial.Polynomial(row).deriv(order)(s) for row in whole]
        return np.array(powers) / a**order

    def at(x: float) -> Any:
        k, row = min(int(x / a), count - 1), np.zeros(2 * count + 2)
        row[2 * k : 2 * k + 4] = cubic(x / a - k)
        return row

    mass, stiffness = np.zeros((2, 2 * count + 2, 2 * count + 2))
    for k in range(count):
        rows = np.ix_(range(2 * k, 2 * k + 4), range(2 * k, 2 * k + 4))
        for s, w in zip((1.0 + points) / 2.0, a * weights / 2.0, strict=True):
            u, slope, bend = (np.outer(cubic(s, d), cubic(s, d)) for d in range(3))
            mass[rows] += w * 7830.0 * (area * u + inertia * slope)
            stiffness[rows] += w * 206e9 * inertia * (1.0 - loss[4 * k // count]) * bend
    stiffness[1, 1] += 4.0e4  # the vice, Nm/rad
    sensors = np.array([at(x) for x in STATIONS])
    mass += 0.004 * sensors.T @ sensors  # of the accelerometers
    mass[-2:, -2:] += tip * np.diag([1.0, 0.02**2])  # of gyration in m
    fixed = [at(0.0), *([] if roller is None else [at(roller)])]
    free = scipy.linalg.null_space(np.array(fixed))
    mass, stiffness = (free.T @ part @ free for part in (mass, stiffness))
    damping = mass + 2e-6 * stiffness + 0.3 * free[[-2]].T @ free[[-2]]
    return Rig(mass, stiffness, damping, sensors @ free, "z", 2048.0, 0.002)


def draw_frame(file: Path) -> None:
    """Write MATLAB's matrices of the frame, three equal storeys as groups, 4 % off and more."""
    parts = np.zeros((3, 4, 4))
    for k in range(3):
        parts[k, k : k + 2, k : k + 2] = 4.2e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    held = {"K": parts.sum(axis=0), "M": 6.5 * np.eye(4), "xyz": np.outer(range(4), [0, 0, 0.3])}
    held |= {"node": np.array(list("1234"), dtype=object), "direction": np.array(["x"] * 4, object)}
    scipy.io.savemat(file, held | {f"K_storey{k + 1}": part for k, part in enumerate(parts)})


def draw_strip(file: Path, roller: float | None = None) -> None:
    """Write Nastran's bars of the strip, a property a quarter, clamped, 2 % off in stiffness."""
    flat, upright = WIDTH * DEPTH**3 / 12.0, WIDTH**3 * DEPTH / 12.0
    cards = ["SPC = 1", "BEGIN BULK", "MAT1,1,2.1+11,,.3,7850."]
    cards += [f"PBAR,{q},1,{WIDTH * DEPTH:g},{upright:.6g},{flat:.6g},1.4-8" for q in (1, 2, 3, 4)]
    cards += [f"GRID,{k + 1},,{0.05 * k:g},0.,0." for k in range(17)]
    cards += [f"CBAR,{k + 1},{k // 4 + 1},{k + 1},{k + 2},0.,1.,0." for k in range(16)]
    held = [] if roller is None else [f"SPC1,1,3,{round(roller / 0.05) + 1}"]
    file.write_text("\n".join([*cards, "SPC1,1,123456,1", *held, "ENDDATA", ""]))
