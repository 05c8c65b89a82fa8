"""Factors of least error in the constitutive relation, first of the zones where it is largest."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.optimize import minimize
from scipy.sparse.linalg import splu

from femubench import InputError, Measurement, Model, NotApplicable, UpdateResult
from femubench.fem import FloatArray
from femubench.plugins.strategies.response_error import forced_energy, response_error
from femubench.update import ParametricModel, ParametricStrategy, expand_measured_shapes

Error = Callable[..., tuple[float, FloatArray, FloatArray]]

_GAIN = 0.05  # of the error: a zone that takes less of it away is the last
_A_FEW = {"maxiter": 10.0}  # steps of a round, which the next one goes on from
_TO_THE_END = {"maxiter": 100.0, "ftol": 1e-15, "gtol": 1e-12}  # a round by responses, cheap steps


@dataclass(frozen=True)
class ConstitutiveError(ParametricStrategy):
    """Minimise the modified error in the constitutive relation over the zones that have most of it.

    Of every measured mode a pair is sought: u, near the readings, and v, whose stresses K v are in
    equilibrium with the inertia forces of u. Of the right model both are one, and the readings. The
    energy of u - v is the error of the stiffness; the zones where it is largest are corrected.

    Arguments:
        changes: as of `ParametricStrategy`; each is a zone.
        confidence: r of the readings: r/(1 - r) weighs their misfit.
        localise: zones with at least this share of the largest error are corrected, together with
            those before; 0 for all at once.
        responses: take the given frequency responses in place of the modes: a pair for every line
            and force, K v in equilibrium with the inertia and damping forces of u.
        max_solves: errors at most, a solution of the model each; a step is finished. 0 for any.

    The authors' are the pair, the error and its weight r/(1 - r), zones by their share of it (0.8)
    in turn with corrections, and forced motions with damping; ours: the mass is right, and of
    responses the damping too, which is the measured one; the norm of the readings, which is that of
    their deviations, each mode's or line's error relative to its energy, lines of even weight, and
    that zones are added until one takes away less than 5 % of the error.

    Source: Deraemaeker, Ladeveze & Leconte (2002), the basic problem and its 2 n equations.
    """

    name: ClassVar[str] = "constitutive-error"
    citation: ClassVar[str] = (
        "Deraemaeker, Ladeveze & Leconte (2002), Reduced bases for model updating in structural "
        "dynamics based on constitutive relation error, Comput. Methods Appl. Mech. Eng. 191, "
        "2427-2444; Ladeveze, Nedjar & Reynier (1994), Updating of finite element models using "
        "vibration tests, AIAA Journal 32, 1485-1491"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})

    confidence: float = 0.5
    localise: float = 0.8
    responses: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.confidence < 1.0:
            raise InputError(f"confidence is {self.confidence:g}", expected="between 0 and 1")
        if not 0.0 <= self.localise <= 1.0:
            raise InputError(f"localise is {self.localise:g}", expected="0 to 1")

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the zones of largest error corrected.

        Raises:
            NotApplicable: when the model has no such parameters, or a mode no shape or deviation,
                or responses are asked for and none is given.
        """
        parts = self.parameterise(model)
        x = np.clip(np.zeros(len(parts)), parts.lower, parts.upper)
        of: Error = self.error
        options = _A_FEW
        if self.responses:
            of = partial(response_error, weight=self.confidence / (1.0 - self.confidence))
            options = _TO_THE_END
            energy = forced_energy(parts, measurement, x)
        else:
            whole = expand_measured_shapes(parts.start, measurement)
            inertia = np.einsum("ij,ij->j", whole, parts.start.mass_times(whole))
            energy = 0.5 * measurement.eigenvalues * inertia
        cost, _, zones = of(parts, measurement, energy, x)
        history, chosen = [{"cost": cost, "zones": 0.0}], np.zeros(len(x), dtype=bool)
        bounds = np.column_stack([parts.lower, parts.upper])
        spare = (self.max_solves or sys.maxsize) - 2  # after the start, and at the end of a round
        while not chosen.all() and spare > 0:
            left = np.where(chosen, 0.0, zones)
            added = ~chosen & (left >= self.localise * left.max())
            chosen = chosen | added

            def along(
                z: FloatArray, own: npt.NDArray[np.bool_] = chosen
            ) -> tuple[float, FloatArray]:
                point = x.copy()
                point[own] = z
                value, slope, _ = of(parts, measurement, energy, point)
                return value, slope[own]

            found = minimize(
                along,
                x[chosen],
                jac=True,
                method="L-BFGS-B",
                bounds=bounds[chosen],
                options={**options, "maxfun": spare},
            )
            spare -= found.nfev + 1
            gained = 1.0 - found.fun / cost
            if gained > 0.0:
                x[chosen] = found.x
            cost, _, zones = of(parts, measurement, energy, x)
            history.append({"cost": cost, "zones": float(chosen.sum())})
            if gained < _GAIN:
                break
        return self.result(parts, x, history, cost=cost, zones=float(chosen.sum()))

    def error(
        self, parts: ParametricModel, measurement: Measurement, energy: FloatArray, x: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """Return the error, its slopes, (p,), and the share of every zone, (p,).

        The slope takes no derivative of the pair, at which the error is stationary.

        Arguments:
            parts: the nominal model and its changes.
            measurement: modes with shapes.
            energy: of every mode, (m,).
            x: coordinates, (p,).
        """
        model = parts.at(x)
        observer, weight = model.observe(measurement.sensors), self.confidence
        weight, cost, pairs = weight / (1.0 - weight), 0.0, []
        for j, eigenvalue in enumerate(measurement.eigenvalues):
            reading, std = measurement.shapes[:, j], measurement.shape_std[:, j]
            known = np.isfinite(reading) & (std > 0.0)
            if not known.any():
                what = f"no reading of mode {measurement.numbers[j]} has a standard deviation"
                raise NotApplicable(what)
            rows, reading, precision = observer[known], reading[known], std[known] ** -2.0
            precision *= 2.0 * weight * energy[j] / float(precision @ np.square(reading))
            seen, zero = rows.T @ sp.diags_array(precision), np.zeros(model.size)
            dynamic = model.stiffness - eigenvalue * model.mass
            blocks = [[seen @ rows, dynamic], [dynamic, -model.stiffness]]
            pair = splu(sp.block_array(blocks, format="csc")).solve(np.append(seen @ reading, zero))
            pairs.append(pair.reshape(2, -1))
            cost += 0.5 * float(precision @ (reading * (reading - rows @ pairs[-1][0]))) / energy[j]
        u, apart = np.array(pairs).transpose(1, 2, 0)
        slopes, steps = parts.slopes(x, model), parts.steps(x)
        pull, strain, inertia = (
            np.einsum("pjj->pj", slopes.inner(apart, right, matrix)) / energy
            for right, matrix in ((u, "stiffness"), (0.5 * apart, "stiffness"), (u, "mass"))
        )
        slope = (pull - strain - inertia * measurement.eigenvalues).sum(axis=1) * steps
        return cost, slope, np.abs(strain).sum(axis=1) * np.abs(steps)
