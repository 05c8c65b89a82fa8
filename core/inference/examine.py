"""The naming itself: from a model and the used modes to weighed explanations; nothing held out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.errors import NotApplicable
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.inference.fit import Problem, State, state_at
from femubench.core.inference.hypothesis import Hypothesis, hypotheses_of
from femubench.core.inference.mesh_error import mesh_bias
from femubench.core.inference.modal_basis import Space, scatter_terms
from femubench.core.inference.noise import Noise
from femubench.core.inference.posterior import LIKELY_NOTHING, Explanation, Posterior
from femubench.core.inference.residuals import Data
from femubench.core.inference.screening import with_shortlist
from femubench.core.inference.search import Found, Search, adequacy
from femubench.core.inference.static_response import Basis, placed
from femubench.core.modal.eigen import Modes
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect
from femubench.core.typing import FloatArray

_TURNED = 1e-9


@dataclass(frozen=True)
class Examination:
    """What the used modes say of a model.

    Arguments:
        model: the nominal model.
        problem: the data in its modal coordinates.
        slopes: sensitivities of the data to the scatter of elements, (n_data, n_scatter).
        tolerance: standard deviation of that scatter.
        posterior: all explanations.
        found: the atlas of every textbook set that was searched.
    """

    model: Model
    problem: Problem
    slopes: FloatArray
    tolerance: float
    posterior: Posterior
    found: tuple[Found, ...]

    @cached_property
    def nominal(self) -> State:
        """Return the model as drawn."""
        return state_at(self.problem, (), np.zeros(0))

    @property
    def best(self) -> Explanation:
        """Return the best explanation: nothing where that is as likely as not, else a name's."""
        names = self.posterior.names
        if names.get((), 0.0) >= LIKELY_NOTHING:
            return self.posterior.best(())
        return self.posterior.best(next(key for key in names if key))

    @cached_property
    def adequacy(self) -> float:
        """Return the probability of what the best explanation leaves, were it noise."""
        best = self.best.fit.state
        return adequacy(best, len(best.x))

    @property
    def scatter(self) -> float:
        """Return the relative standard deviation of a frequency by ordinary scatter."""
        count = len(self.problem.data.measurement)
        if self.slopes.shape[1] == 0 or self.tolerance == 0.0:
            return 0.0
        m = self.problem.data.measurement
        size = np.linalg.norm(self.slopes[:count], axis=1)
        return float(self.tolerance * np.median(size * m.frequency_std / m.frequencies))

    def problem_of(self, explanation: Explanation) -> Problem:
        """Return the data in the coordinates of an explanation's textbook effects."""
        # Of a large model every explanation has coordinates of its own.
        return replace(explanation.fit.state.problem, offset=0.0)


def examine(
    model: Model,
    measurement: Measurement,
    effects: Iterable[Effect],
    *,
    tolerance: float,
    pairs: bool = True,
) -> Examination:
    """Weigh every explanation of what a model gets wrong.

    Arguments:
        model: the nominal model.
        measurement: the used modes and nothing else.
        effects: what may be missing.
        tolerance: standard deviation of the relative scatter of every element.
        pairs: whether more than one cause is sought.

    Raises:
        NotApplicable: when a used frequency has no standard deviation.
        ModelError: when the model has no modes.

    Examples:
        >>> seen = diagnosis.examine(model, measurement, [torsion], tolerance=0.005)
        >>> seen.best.base.names == (torsion.name,)
        True
    """
    known = tuple(effects)
    # Thousands of small matrices: threads would wait for each other most of the time.
    with threadpool_limits(1):
        problem, slopes = posed(model, measurement, hypotheses_of(model, known), tolerance)
        posterior, found = Search(problem, known, pairs=pairs).run()
    return Examination(model, problem, slopes, tolerance, posterior, tuple(found))


def posed(
    model: Model,
    measurement: Measurement,
    hypotheses: Iterable[Hypothesis],
    tolerance: float,
) -> tuple[Problem, FloatArray]:
    """Return data, noise and modal coordinates, and the sensitivities behind the noise."""
    if len(measurement) == 0:
        raise NotApplicable("there is no used mode")
    basis = Basis.of(model, measurement)
    bias = mesh_bias(model, 2 * len(measurement) + 8)
    data = Data(measurement, np.zeros(0) if bias is None else bias)
    plain = placed(basis, data, Noise.of(np.zeros((len(data), 0)), 0.0), tuple(hypotheses))
    slopes = np.zeros((len(data), 0))
    if model.structure is not None and tolerance > 0.0:
        slopes = _scatter_slopes(plain, model.structure, basis.modes)
    return with_shortlist(replace(plain, noise=Noise.of(slopes, tolerance))), slopes


def _scatter_slopes(problem: Problem, structure: Structure, modes: Modes) -> FloatArray:
    """Return d data / d relative change of every element's stiffness, then of its mass."""
    space: Space = problem.space
    nominal = state_at(problem, (), np.zeros(0))
    shapes = modes.take(np.argsort(~modes.rigid, kind="stable")).shapes
    # Close modes are turned to the measured ones, and their forces with them.
    turned = nominal.vectors[:, nominal.partner]
    top = int(np.flatnonzero(np.abs(turned).max(axis=1) > _TURNED)[-1]) + 1
    forces = scatter_terms(structure, shapes, space.eigenvalues[:top])
    near = np.einsum("piN,im->mNp", forces, turned[:top])
    element = structure.properties
    own = element.rhoA * (element.length - element.rigid_mass_1 - element.rigid_mass_2)
    masses = np.concatenate([np.zeros(len(element)), own])
    return nominal.rows(np.swapaxes(near, 0, 1), masses)
