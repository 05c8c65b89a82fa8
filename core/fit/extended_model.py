"""Explanations as models of their own: extended one effect after the other, and solved anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femubench.core.errors import FemubenchError, ModelError
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fit.modal_fit import Fit, Problem, fit, signed_hz
from femubench.core.fit.projection import Projection
from femubench.core.modal.eigen import enough_modes, modes_of
from femubench.core.typing import FloatArray

_ROUNDS = 3
_RIGID = 1e4  # of what a spring is measured by, above which it is taken for rigid
_AGREES = 0.3  # deviations in all, below which a fit and its model are the same to the data


def extend_model(model: Model, parts: Sequence[Projection], x: FloatArray) -> Model:
    """Return the model with effects in it, at their coordinates.

    Raises:
        ModelError: when an effect gives something else.
    """
    start, structure = 0, model.structure
    waiting: Frame | None = None  # meshed once for all that is written into it one after the other
    for part in parts:
        h = part.hypothesis
        own = h.values(x[None, start : start + len(h.parameters)])[0]
        start += len(h.parameters)
        # A stiffness that hardly gives costs digits alone.
        values = [
            np.inf if p.scaling == "compliance" and v > _RIGID * p.scale else float(v)
            for p, v in zip(h.parameters, own, strict=True)
        ]
        write = getattr(h.effect, "writes", None)
        if structure is not None and write is not None:
            waiting = write(structure.frame if waiting is None else waiting, h.place, values)
            continue
        if structure is not None and waiting is not None:
            model, waiting = Model.of(structure.rebuilt(waiting)), None
        found = h.effect.extend(model, h.place, values)
        if not isinstance(found, Model):
            what = f"effect {h.effect.name!r} gave {type(found).__name__}"
            raise ModelError(f"{what}, expected femubench.Model")
        model, structure = found, found.structure
    if structure is None or waiting is None:
        return model
    return Model.of(structure.rebuilt(waiting))


def raw_residual(problem: Problem, model: Model) -> FloatArray:
    """Return the residuals of a model in standard deviations of the measurement, (n_data,).

    Raises:
        ModelError: when the model has no modes.
    """
    data = problem.data
    modes = modes_of(model, enough_modes(model, 2 * len(data.measurement)))
    order = np.argsort(modes.eigenvalues)
    hertz = signed_hz(modes.eigenvalues[order])[None]
    seen = np.asarray(model.observe(data.measurement.sensors) @ modes.shapes[:, order])[None]
    seen = data.align(hertz, seen, problem.space.zero)
    hertz, seen = data.predict(hertz, seen, problem.space.zero)
    partner = data.pair(hertz, seen)[0]
    residual = data.residual(hertz[:, partner], seen[:, :, partner], np.array([model.total_mass]))
    return np.asarray(residual[0])


def check_joint_fit(found: Fit) -> Fit | None:
    """Return a fit of several causes that its own model bears out; None where there is no such.

    Each cause may be possible and all together not: two rigid ends that fill an element.

    In modal coordinates the changes of several causes add up; in a model the second one changes
    what the first one left. The difference at the best fit is taken as constant nearby and the
    fit repeated (deferred correction; Stetter 1978).
    """
    problem, best = found.state.problem, found
    for _ in range(_ROUNDS):
        state = best.state
        try:
            exact = raw_residual(problem, extend_model(problem.model, best.parts, state.x))
        except FemubenchError:
            return None
        offset = exact - (state.raw - state.problem.offset)
        if not np.isfinite(offset).all():
            return found
        gap = np.linalg.norm(state.problem.noise.whiten(offset - state.problem.offset))
        if gap < _AGREES:
            break
        again = fit(replace(problem, offset=offset), best.parts, state.x)
        if again is None:
            break
        best = again
    return best


def departure(found: Fit, model: Model | None = None) -> float:
    """Return how far a fit is from what its own model gives, in deviations of the data in all.

    Arguments:
        model: its own, where it is made already.

    Raises:
        FemubenchError: when that model cannot be built or solved.
    """
    state = found.state
    if model is None:
        model = extend_model(state.problem.model, state.parts, state.x)
    exact = raw_residual(state.problem, model)
    return float(np.linalg.norm(state.problem.noise.whiten(exact - state.raw)))
