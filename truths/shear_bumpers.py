"""A bumper that touches: the motion with contact in time, and the modes that a test reads of it.

The frame is shaken at its top floor by a periodic force of random phases. One period of the
accelerations over that force, when the transient has gone, is the response; modes with real shapes
are fitted to the mean of several. Contact bends it: they are those of the best linear description
at that level of force, as a modal test would report them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import optimize
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from truths.shear_frames import Array, Frame, floor_row, modes

DAMPING = 0.015  # of every elastic mode
DRAG = 2.0  # of the rails, rad/s: what the rigid motion loses of its speed
LINES = 4  # of the spectrum within the half-power width of the lowest mode
FORCES = 2  # with phases of their own
OVER = 12  # samples a cycle of the highest line
TOLERANCE = 1e-5
Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Bumper:
    """A spring that acts when two floors come closer than its gap.

    Arguments:
        first, second: floors; a first of -1 is the ground.
        stiffness: N/m.
        gap: in root mean squares of the motion without it; negative where it is pressed on.
    """

    first: int
    second: int
    stiffness: float
    gap: float


@dataclass(frozen=True)
class Shaken:
    """A frame in modal coordinates, and the lines that shake it.

    Arguments:
        omega: (q,) in rad/s.
        shapes: (q, floors that move), of unit mass.
        lines: (n,) angular frequencies of the force, of equal size each.
        step: number of the first line.
    """

    omega: Array
    shapes: Array
    lines: Array
    step: int

    @property
    def drag(self) -> Array:
        """Return what every mode loses, 2 zeta omega."""
        return np.where(self.omega > 0.0, 2.0 * DAMPING * self.omega, DRAG)

    @property
    def receptance(self) -> Complex:
        """Return the motion of all floors over the force without contact, (n, floors)."""
        s = 1j * self.lines[:, None]
        return np.asarray(
            (self.shapes[:, -1] / (s**2 + self.drag * s + self.omega**2)) @ self.shapes
        )


def shake(frame: Frame, highest: int) -> Shaken:
    """Return a frame and lines from half its lowest elastic mode to beyond an elastic mode."""
    omega, shapes = modes(frame)
    elastic = omega[omega > 0.0]
    step = 2.0 * DAMPING * elastic[0] / LINES
    top = 1.25 * elastic[min(highest, len(elastic)) - 1]
    numbers = np.arange(int(0.5 * elastic[0] / step), int(top / step) + 1)
    return Shaken(omega, shapes, step * numbers, int(numbers[0]))


def respond(shaken: Shaken, bumper: Bumper, rng: np.random.Generator) -> Complex:
    """Return accelerations of all floors over the force, (n, floors): one force's."""
    count, numbers = len(shaken.omega), shaken.step + np.arange(len(shaken.lines))
    base = shaken.lines[0] / shaken.step
    samples = OVER * int(numbers[-1])
    spectrum = np.zeros(samples // 2 + 1, dtype=complex)
    spectrum[numbers] = np.exp(2j * np.pi * rng.random(len(numbers)))
    period = 2.0 * np.pi / base
    times = period * np.arange(samples + 1) / samples
    force = np.fft.irfft(spectrum, samples) * samples / 2.0  # amplitude 1 N a line
    pull = CubicSpline(
        times, np.append(force, force[0]), bc_type="periodic", extrapolate="periodic"
    )
    floors = shaken.shapes.shape[1]
    hangs = bool(shaken.omega[0] == 0.0)
    row = floor_row(floors, hangs, bumper.first, bumper.second)
    apart = shaken.receptance @ row
    gap = bumper.gap * float(np.sqrt(0.5 * (np.abs(apart) ** 2).sum()))
    state_matrix = np.block(
        [
            [np.zeros((count, count)), np.eye(count)],
            [-np.diag(shaken.omega**2), -np.diag(shaken.drag)],
        ]
    )
    still = np.zeros(count)
    along, shaker = np.append(still, shaken.shapes @ row), np.append(still, shaken.shapes[:, -1])
    reach = np.append(along[count:], still)

    def slope(t: float, state: Array) -> Array:
        pressed = bumper.stiffness * max(0.0, -gap - float(reach @ state))
        found: Array = state_matrix @ state + shaker * float(pull(t)) + along * pressed
        return found

    # In one period the lowest mode decays to exp(-pi LINES).
    found = solve_ivp(
        slope,
        (0.0, 2.0 * period),
        np.zeros(2 * count),
        t_eval=period + times[:-1],
        method="DOP853",
        rtol=TOLERANCE,
        atol=TOLERANCE * float(np.abs(apart).max()),
        max_step=period / int(numbers[-1]) / 2.0,
    )
    motion = np.fft.rfft(found.y[:count].T @ shaken.shapes, axis=0)[numbers]
    response = -(shaken.lines[:, None] ** 2) * motion / (samples / 2.0)
    return np.asarray(response / spectrum[numbers][:, None])


def fit_modes(shaken: Shaken, response: Complex, start: Array) -> tuple[float, Array, Array]:
    """Return the misfit, frequencies in rad/s, and real shapes of modes fitted to a response.

    Arguments:
        response: (n, sensors), of accelerations.
        start: (m,) frequencies in rad/s.

    Source: residues are linear and solved for in every step (Golub & Pereyra 1973).
    """
    lines, many = shaken.lines, len(start)

    def basis(values: Array) -> Array:
        omega, zeta = np.exp(values[:many]), np.exp(values[many:])
        below = omega**2 - lines[:, None] ** 2
        each = -(lines[:, None] ** 2) / (below + 2j * zeta * omega * lines[:, None])
        # Of modes below the lines the mass stays, of those above the stiffness.
        rest = np.stack([np.ones_like(lines), -(lines**2)], axis=1)
        columns = np.concatenate((each, rest), axis=1)
        columns = columns / np.abs(columns).max(axis=0)
        return np.concatenate((columns.real, columns.imag))

    target = np.concatenate((response.real, response.imag))

    def left(values: Array) -> Array:
        whole = basis(values)
        found: Array = target - whole @ np.linalg.lstsq(whole, target, rcond=None)[0]
        return found.ravel()

    values = np.log(np.concatenate((start, np.full(many, DAMPING))))
    spread = np.concatenate((np.full(many, 0.5), np.full(many, 1.5)))
    result = optimize.least_squares(
        left, values, bounds=(values - spread, values + spread), xtol=1e-12, ftol=1e-12
    )
    residues = np.asarray(np.linalg.lstsq(basis(result.x), target, rcond=None)[0][:many])
    order = np.argsort(result.x[:many])
    omega: Array = np.exp(result.x[:many])[order]
    return float(result.cost), omega, residues[order]


def identify(frame: Frame, bumper: Bumper, used: int, seed: int) -> tuple[Array, Array]:
    """Return angular frequencies and shapes at all floors of the lowest elastic modes.

    The fit starts from the modes with several shares of the bumper as a spring; the best counts.
    """
    shaken = shake(frame, used + 1)
    rng = np.random.default_rng(seed)
    response = np.mean([respond(shaken, bumper, rng) for _ in range(FORCES)], axis=0)
    inside = shaken.lines[-1] / 1.05
    fits = []
    for share in (0.0, 0.25, 0.5, 1.0):
        spring = (bumper.first, bumper.second, share * bumper.stiffness)
        omega, _ = modes(replace(frame, springs=(spring,)))
        start = omega[(omega > shaken.lines[0]) & (omega < inside)][: used + 1]
        if len(start) >= used:
            fits.append(fit_modes(shaken, response, start))
    _, omega, shapes = min(fits, key=lambda one: one[0])
    return omega[:used], shapes[:used]
