"""Bayesian updating by sampling, with a model discrepancy that is inferred with the parameters.

ln of a measured frequency is that of the model plus normal errors: of the measurement, whose
standard deviation is known; of the model, whose is not, for what no model of the kind can follow;
and of the polynomials that stand for the model while sampling.

Source: Kennedy & O'Hagan (2001), J. R. Stat. Soc. B 63, 425-464, for discrepancy and code
uncertainty; Simoen, De Roeck & Lombaert (2015), Mech. Syst. Signal Process. 56-57, 123-149, for
updating.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import ndtr, ndtri

from femubench.core.change.change import Change
from femubench.core.change.parametric_model import ParametricModel
from femubench.core.errors import ModelError, NotApplicable, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.fit.dual_least_squares import MANY
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.neighbour_modes import follow_frequencies
from femubench.core.typing import BoolArray, FloatArray
from femubench.core.update.quadratic_fit import QuadraticFit, coefficients_of
from femubench.core.update.residuals import Prediction, Targets
from femubench.core.update.sensitivity_update import (
    Iterate,
    Iteration,
    UpdateOptions,
    estimate_parameters,
)
from femubench.core.update.strategy import UpdateResult
from femubench.core.update.transitional import sample_transitional
from femubench.core.update.uncertainty import Uncertainty

_MORE = 8  # modes above the highest one that was measured, which samples may mix with it
_POINTS = 1.5  # solutions for every coefficient of the polynomials
_MORE_POINTS = 4.0  # where what the data do not know scatters the solutions
_WIDER = 1.5  # than the normal approximation, from where the first of them are taken
_ROUNDS = 3
_OFF = 0.25  # of a datum's standard deviation: rms error of the polynomials that is let pass
_USELESS = 5.0  # of it: with such polynomials a chain knows less than the normal approximation
_ALL_KNOWN = 18  # parameters, whose polynomials take 285 solutions; no frame of the suite has more
_SAMPLES = 40
_WALKERS, _FEWEST_WALKERS = 4, 96  # for each unknown, and in all: few take no less time
_BLOCK, _LONGEST = 500, 8000  # steps
_MOVE, _MOVES = 2.38, 5  # of what the data know, by the root of how many; for one draw of the rest
_SWEEPS = 5  # draws of the rest, from one start and from one draw that is kept to the next
_STILL = 1e-9  # of the largest part in a parameter: it does not move
_DRAWN = 2000  # samples of the transitional sampler
_LONG_ENOUGH = 25.0  # autocorrelation times
_WINDOW = 5.0  # of them, over which an autocorrelation is summed
_BURN_IN = 3.0  # autocorrelation times


@dataclass(frozen=True)
class Target:
    """The posterior density of scaled parameters q and of the discrepancy's coordinate v.

    Arguments:
        point: the most probable ones at the prior median of the discrepancy.
        centre: its q, off the bounds, at which there is no density, (p,).
        root: of the covariance of q about it, (p, p); its Cholesky factor where all coordinates
            are known.
        known: how many coordinates the data know of, to first order; they are the first ones.
        measurement: the modes that have a partner there.
    """

    iteration: Iteration
    point: Iterate
    centre: FloatArray
    root: FloatArray
    known: int
    measurement: Measurement
    discrepancy: Discrepancy

    def at(self, z: FloatArray) -> FloatArray:
        """Return q, (n, p), at coordinates z in which it is nearly standard normal, (n, p).

        Chains are of z. A move of theirs stretches differences of positions, by 1.3 in the rms, so
        that the last digit of a start decides on all of it after some hundred moves. Draws of z are
        the same on every processor, those of q would follow its rounding of point and root.
        """
        return self.centre + z @ self.root.T

    def variables(self, q: FloatArray) -> FloatArray:
        """Return the variables of the polynomials at q (n, p): all, or the known ones, (n, k)."""
        if self.known == len(self.centre):
            return q
        return np.asarray(np.linalg.solve(self.root, (q - self.centre).T).T[:, : self.known])

    def split(self) -> Target:
        """Return it in coordinates of which the data know, to first order, the first ones alone.

        The precision of the prior is 1 but along as many directions as there are data.
        """
        precision, size = self.iteration.parametric.precision, len(self.centre)
        _, turns = np.linalg.eigh((self.root.T * precision) @ self.root)
        known = min(size, len(self.data[0]))
        turns, _ = np.linalg.qr(np.hstack([turns[:, :known], np.eye(size)]))
        turns *= np.sign(turns[np.abs(turns).argmax(axis=0), range(size)])
        return replace(self, root=self.root @ turns, known=known)

    def redraw(self, z: FloatArray, rng: np.random.Generator) -> None:
        """Draw what the data do not know of z, (n, p), from its prior within the bounds.

        One coordinate after the other, from the normal distribution between where the first
        parameter on either side meets its bound. Its mean is not 0 where the most probable
        parameters are at a bound that the data press them against.
        """
        parametric = self.iteration.parametric
        low, high, q = parametric.lower, parametric.upper, self.at(z)
        means = -self.root.T @ (parametric.precision * self.centre)
        moves = np.abs(self.root) > _STILL * np.abs(self.root).max(axis=1)[:, None]
        for j in range(self.known, z.shape[1]):
            moving = moves[:, j]
            slope = self.root[moving, j]
            rest = q[:, moving] - z[:, j, None] * slope
            ends = (low[moving] - rest) / slope, (high[moving] - rest) / slope
            least = np.minimum(*ends).max(axis=1) - means[j]
            most = np.maximum(*ends).min(axis=1) - means[j]
            # Of two tails the one where the distribution function keeps its digits.
            side = np.where(least > 0.0, -1.0, 1.0)
            below, above = ndtr(np.sort([side * least, side * most], axis=0))
            drawn = side * ndtri(below + rng.random(len(z)) * (above - below))
            drawn = np.where((drawn > least) & (drawn < most), drawn + means[j], z[:, j])
            q += (drawn - z[:, j])[:, None] * self.root[:, j]
            z[:, j] = drawn

    def inside(self, q: FloatArray) -> BoolArray:
        """Return which points (n, p) are within the bounds, (n,)."""
        parametric = self.iteration.parametric
        return np.asarray(((q > parametric.lower) & (q < parametric.upper)).all(axis=1))

    @property
    def data(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return logarithms of the data, their standard deviations and which know discrepancy."""
        m = self.measurement
        log, std = [*np.log(m.frequencies)], [*(m.frequency_std / m.frequencies)]
        if m.total_mass is not None:
            log, std = [*log, np.log(m.total_mass[0])], [*std, m.total_mass[1] / m.total_mass[0]]
        own = np.arange(len(log)) < len(m)
        return np.array(log), np.array(std), own.astype(float)

    def predict(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return those points that give a model, (n, p), and the logarithms of its data, (n, k)."""
        prediction = self.point.prediction
        assert isinstance(prediction, Prediction)
        partner = prediction.partner[prediction.partner >= 0]
        modes = prediction.modes.take(
            np.arange(min(partner.max() + 1 + _MORE, len(prediction.modes)))
        )
        rows, kept = [], []
        self.iteration.solves.count += len(points)
        for q in points:
            try:
                model = self.iteration.model_at(q)
                row = follow_frequencies(model, modes)[partner]
            except ModelError:
                continue
            if self.measurement.total_mass is not None:
                own = self.iteration.parametric
                mass = own.mass(q, model) if own.terms else model.total_mass
                row = np.append(row, mass)
            if (row > 0.0).all():
                rows.append(np.log(row))
                kept.append(q)
        if len(rows) <= coefficients_of(self.known):
            raise StrategyFailure(f"only {len(rows)} of {len(points)} points give a model")
        return np.array(kept), np.array(rows)

    def std(self, v: FloatArray) -> FloatArray:
        """Return the rms standard deviation of every datum, discrepancy included, (k,)."""
        _, std, own = self.data
        return np.asarray(np.sqrt(std**2 + own * np.mean(np.square(self.discrepancy.std(v)))))

    def _misfit(self, apart: FloatArray, variance: FloatArray) -> FloatArray:
        """Return the squared misfit and ln of the determinant of its covariance, (n,).

        Arguments:
            apart: logarithms, measured minus predicted, (n, k).
            variance: of each by itself, (n, k).
        """
        correlation = self.measurement.frequency_correlation
        if correlation is None:
            return np.asarray((np.square(apart) / variance + np.log(variance)).sum(axis=1))
        _, std, _ = self.data
        m = len(self.measurement)
        shared = std[:m, None] * (correlation - np.eye(m)) * std[:m]
        covariance = variance[:, None] * np.eye(variance.shape[1])
        covariance[:, :m, :m] += shared
        solved = np.linalg.solve(covariance, apart[..., None])[..., 0]
        return np.asarray((apart * solved).sum(axis=1) + np.linalg.slogdet(covariance)[1])

    def log_prior(self, x: FloatArray) -> FloatArray:
        """Return ln of the prior density at q and v, (n, p + 1), but for a constant, (n,)."""
        q, v = x[:, :-1], x[:, -1]
        size = np.square(q) @ self.iteration.parametric.precision + np.square(v)
        return np.where(self.inside(q), -0.5 * size, -np.inf)

    def log_likelihood(self, fit: QuadraticFit) -> Callable[[FloatArray], FloatArray]:
        """Return a function from q and v, (n, p + 1), to ln of the likelihood, (n,).

        It lacks what depends on the number of data alone.
        """
        log, std, own = self.data
        known = np.square(std) + np.square(fit.error)

        def likelihood(x: FloatArray) -> FloatArray:
            variance = known + np.square(self.discrepancy.std(x[:, -1]))[:, None] * own
            return -0.5 * self._misfit(log - fit(self.variables(x[:, :-1])), variance)

        return likelihood


class StretchMove:
    """The stretch move of emcee with the same draws, all walkers of a half at once.

    The one of emcee decides walker by walker, which takes most of the time of a chain.

    Source: Goodman & Weare (2010), (7)-(8); Foreman-Mackey et al. (2013), section 2, with a = 2.
    """

    def propose(self, model: Any, state: Any) -> tuple[Any, BoolArray]:  # noqa: ANN401 - emcee's
        """Move the walkers of a state, one half after the other, and tell which have moved.

        Arguments:
            model: emcee's, with `log_prob_fn` from (n, p) to (n,) and `random`, a RandomState.
            state: coordinates `coords`, (n, p), and `log_prob` there, (n,); both are changed.

        Raises:
            StrategyFailure: when the density has no value at a point.
        """
        count, size = state.coords.shape
        half, random, moved = np.arange(count) % 2, model.random, np.zeros(count, dtype=bool)
        random.shuffle(half)
        for k in (0, 1):
            own, others = np.flatnonzero(half == k), np.flatnonzero(half != k)
            stretch = (random.rand(len(own)) + 1.0) ** 2.0 / 2.0
            towards = state.coords[others[random.randint(len(others), size=len(own))]]
            points = towards - (towards - state.coords[own]) * stretch[:, None]
            density = model.log_prob_fn(points)
            if np.isnan(density).any():
                raise StrategyFailure("the posterior density has no value at a point of the chain")
            gain = (size - 1.0) * np.log(stretch) + density - state.log_prob[own]
            taken = gain > np.log(random.rand(len(own)))
            at = own[taken]
            state.coords[at], state.log_prob[at], moved[at] = points[taken], density[taken], True
        return state, moved


def sample_posterior(
    source: Model | Structure,
    changes: Sequence[Change],
    measurement: Measurement,
    rng: np.random.Generator,
    *,
    discrepancy: tuple[float, float],
    options: UpdateOptions,
    sampler: str = "ensemble",
) -> UpdateResult:
    """Return the model at the posterior mean, with samples of the posterior.

    Logarithms of frequencies are taken as quadratic in those of the parameters, fitted to solutions
    near the most probable ones, and anew with more of them until the rms error over the posterior
    is at most a quarter of each datum's standard deviation, discrepancy included; what is left
    after three rounds widens the likelihood. Of more than 18 parameters polynomials and chain have
    as many coordinates as there are data: of the others the data know nothing to first order, and
    they keep their prior; where that is too little, so that the error stays larger, no chain is
    run. Nor is it where polynomials miss a datum by five times its standard deviation, as over the
    wide priors of supports. The answer then is the normal approximation about the most probable
    parameters, at the median of the discrepancy. So it is where they miss by more than a quarter,
    and the chain is too short, or where `max_solves` of the options leaves too few solutions for
    the polynomials. Of such an answer ``normal_approximation`` in the diagnostics is 1.

    Arguments:
        source: the nominal model, matrices with groups or a frame, or the latter's structure.
        changes: each parameter with a prior.
        measurement: the used modes, each with a standard deviation.
        rng: decides on every draw.
        discrepancy: of its log-normal prior the median and the standard deviation of the logarithm.
        options: of the search for the most probable parameters; statistical weighting.
        sampler: `ensemble` for chains from near these; `transitional` for samples from the prior,
            which give the evidence too, by polynomials that are first fitted all over the prior.

    Raises:
        NotApplicable: when a frequency has no standard deviation, or, for `transitional`, a
            parameter no prior.
        StrategyFailure: when no measured mode has a partner, too few points give a model, or the
            chain is too short for its autocorrelation though the polynomials are good.

    Source: Goodman & Weare (2010), Commun. Appl. Math. Comput. Sci. 5, 65-80, as implemented by
    Foreman-Mackey, Hogg, Lang & Goodman (2013), PASP 125, 306-312; for many parameters Cui, Martin,
    Marzouk, Solonen & Spantini (2014), Inverse Problems 30, 114015, section 3.

    Examples:
        >>> factor = update.Changes(structure).stiffness(prior_std=0.1)
        >>> options = update.UpdateOptions(weighting="statistical")
        >>> rng = np.random.default_rng(0)
        >>> found = update.sample_posterior(
        ...     structure, [factor], measurement, rng, discrepancy=(0.02, 0.7), options=options
        ... )
        >>> len(found.uncertainty.samples)
        40
    """
    target = most_probable(source, changes, measurement, Discrepancy(*discrepancy), options)
    kind = _SAMPLERS[sampler]
    if kind is _Ensemble and len(target.centre) > _ALL_KNOWN:
        kind, target = _Split, target.split()
    chain_of, off, rough = _fitted(kind, target, rng)
    # Wide priors may move the data beyond what the first order knows of.
    if chain_of is None or (rough and kind is _Split):
        return _normal_result(target, off)
    try:
        chain, found = chain_of.settle(_LONGEST if rough else 2 * _LONGEST)
    except StrategyFailure:
        if not rough:
            raise
        return _normal_result(target, off, chain_of.steps)
    drawn = chain[rng.choice(len(chain), _SAMPLES, replace=False), :-1]
    return _result(target, chain, drawn, {**found, "surrogate_error": off})


def _fitted(
    kind: type[_Ensemble | _Split | _Transitional], target: Target, rng: np.random.Generator
) -> tuple[Any, Any, bool]:
    """Return a sampler after its first steps, the largest error of the polynomials, if too large.

    No sampler where the polynomials are useless, or no solutions are left for them.
    """
    each = _MORE_POINTS if kind is _Split else _POINTS
    count = int(np.ceil(each * coefficients_of(target.known)))
    solves = target.iteration.solves
    if solves.left < 2 * count:
        return None, None, True
    points, values = target.predict(kind.first(target, rng, count))
    for _ in range(_ROUNDS):
        fit = QuadraticFit.of(target.variables(points), values)
        if (fit.error > _USELESS * target.std(np.zeros(1))).any():
            return None, float(fit.error.max()), True
        sampler = kind(target, fit, rng)
        drawn = sampler.draws
        drawn = drawn[rng.choice(len(drawn), count, replace=False)]
        more, exact = target.predict(drawn[:, :-1])
        off = np.sqrt(np.mean(np.square(fit(target.variables(more)) - exact), axis=0))
        rough = not (off <= _OFF * target.std(drawn[:, -1])).all()
        if not rough or solves.left < count:
            break
        points, values = np.vstack([points, more]), np.vstack([values, exact])
    return sampler, float(off.max()), rough


def most_probable(
    source: Model | Structure,
    changes: Sequence[Change],
    measurement: Measurement,
    discrepancy: Discrepancy,
    options: UpdateOptions,
) -> Target:
    """Return the posterior about its mode at the median discrepancy.

    Arguments:
        source, changes, measurement, discrepancy, options: as for `sample_posterior`.

    Raises:
        NotApplicable: when a frequency has no standard deviation, or parameters are too many.
        StrategyFailure: when no measured mode has a partner.
    """
    whole = measurement.widen(discrepancy.median * measurement.frequencies)
    model = Model.of(source) if isinstance(source, Structure) else source
    parametric = ParametricModel(model, tuple(changes))
    if len(parametric) > MANY:
        count = f"{len(parametric)} parameters"
        raise NotApplicable(f"{count}, and their covariance fills a dense matrix beyond {MANY}")
    data = Targets(whole, options.residual, True, options.shapes, True)
    iteration = Iteration(parametric, data, options)
    point = iteration.run()
    covariance = iteration.covariance(point)
    assert covariance is not None
    pairs = zip(measurement.numbers, point.prediction.partner, strict=True)
    kept = measurement.select([number for number, partner in pairs if partner >= 0])
    low, high = parametric.lower, parametric.upper
    centre = np.clip(point.q, np.where(low < 0.0, 0.99 * low, 0.01 * high), 0.99 * high)
    root = np.asarray(np.linalg.cholesky(covariance))
    return Target(iteration, point, centre, root, len(centre), kept, discrepancy)


class _Ensemble:
    """Chains of emcee from near the most probable parameters, in coordinates z and v."""

    def __init__(self, target: Target, fit: QuadraticFit, rng: np.random.Generator) -> None:
        import emcee

        size, likelihood = len(target.centre) + 1, target.log_likelihood(fit)
        walkers = max(_WALKERS * size, _FEWEST_WALKERS)
        near = rng.standard_normal((walkers, size))
        while (outside := ~target.inside(target.at(near[:, :-1]))).any():
            near[outside] /= 2.0

        def density(at: FloatArray) -> FloatArray:
            x = self._turned(at)
            return target.log_prior(x) + likelihood(x)

        own = {"vectorize": True, "moves": StretchMove()}
        self.target, self.sampler = target, emcee.EnsembleSampler(walkers, size, density, **own)
        seed = int(rng.integers(2**32))
        self.sampler.random_state = np.random.RandomState(seed).get_state()
        self.sampler.run_mcmc(near, _BLOCK)

    @staticmethod
    def first(target: Target, rng: np.random.Generator, count: int) -> FloatArray:
        """Return where the model is solved first, (count, p)."""
        return target.at(_WIDER * rng.standard_normal((count, len(target.centre))))

    def _turned(self, chain: FloatArray) -> FloatArray:
        return np.column_stack([self.target.at(chain[:, :-1]), chain[:, -1]])

    @property
    def steps(self) -> float:
        """Return how many every walker made."""
        return float(self.sampler.iteration)

    @property
    def draws(self) -> FloatArray:
        """Return those of q and v after the first steps, (n, p + 1)."""
        return self._turned(self.sampler.get_chain(discard=_BLOCK // 2, flat=True))

    def settle(self, longest: int) -> tuple[FloatArray, dict[str, float]]:
        """Return draws of q and v, (n, p + 1), after so many steps as they need, and how many.

        Raises:
            StrategyFailure: when the longest chain is too short for its autocorrelation.
        """
        go_on = partial(self.sampler.run_mcmc, None, _BLOCK)
        time = _settled(self.sampler.get_chain, go_on, longest)
        chain = self.sampler.get_chain(discard=int(np.ceil(_BURN_IN * time)), flat=True)
        return self._turned(chain), {
            "steps": self.steps,
            "autocorrelation_time": time,
            "effective_samples": len(chain) / time,
        }


class _Split:
    """Metropolis moves of what the data know; what they do not know is drawn from its prior.

    Source: Roberts, Gelman & Gilks (1997), Ann. Appl. Probab. 7, 110-120, for the size of a move;
    Gelfand & Smith (1990), J. Am. Stat. Assoc. 85, 398-409, for draws one after the other.
    """

    def __init__(self, target: Target, fit: QuadraticFit, rng: np.random.Generator) -> None:
        self.target, self.rng, self.likelihood = target, rng, target.log_likelihood(fit)
        self.z = _start(target, rng, _FEWEST_WALKERS, 1.0)
        self.v = rng.standard_normal(len(self.z))
        self.chain, self.kept = list[FloatArray](), list[FloatArray]()
        self._walk()

    @staticmethod
    def first(target: Target, rng: np.random.Generator, count: int) -> FloatArray:
        """Return where the model is solved first, (count, p)."""
        return target.at(_start(target, rng, count, _WIDER))

    def _points(self, z: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return q and v, (n, p + 1), and ln of the density there, (n,)."""
        x = np.column_stack([self.target.at(z), v])
        return x, self.target.log_prior(x) + self.likelihood(x)

    def _walk(self) -> None:
        known, (count, _) = self.target.known, self.z.shape
        for _ in range(_BLOCK):
            _, density = self._points(self.z, self.v)
            for _ in range(_MOVES):
                step = _MOVE * (known + 1) ** -0.5 * self.rng.standard_normal((count, known + 1))
                z, v = self.z.copy(), self.v + step[:, -1]
                z[:, :known] += step[:, :-1]
                _, trial = self._points(z, v)
                taken = trial - density > np.log(self.rng.random(count))
                self.z[taken], self.v[taken], density[taken] = z[taken], v[taken], trial[taken]
            self.target.redraw(self.z, self.rng)
            self.chain.append(np.column_stack([self.z[:, :known], self.v]))
            if len(self.chain) % _SWEEPS == 0:
                self.kept.append(self._points(self.z, self.v)[0])

    @property
    def steps(self) -> float:
        """Return how many every walker made."""
        return float(len(self.chain))

    @property
    def draws(self) -> FloatArray:
        """Return those of q and v after the first steps, (n, p + 1)."""
        return np.concatenate(self.kept[_BLOCK // 2 // _SWEEPS :])

    def settle(self, longest: int) -> tuple[FloatArray, dict[str, float]]:
        """Return draws of q and v, (n, p + 1), after so many steps as they need, and how many.

        Raises:
            StrategyFailure: when the longest chain is too short for its autocorrelation.
        """
        time = _settled(lambda: np.array(self.chain), self._walk, longest)
        draws = np.concatenate(self.kept[int(np.ceil(_BURN_IN * time / _SWEEPS)) :])
        return draws, {
            "steps": self.steps,
            "autocorrelation_time": time,
            "effective_samples": len(draws) * min(_SWEEPS / time, 1.0),
        }


def _start(target: Target, rng: np.random.Generator, count: int, wide: float) -> FloatArray:
    """Return coordinates z about 0 within the bounds, (count, p)."""
    z = np.zeros((count, len(target.centre)))
    z[:, : target.known] = wide * rng.standard_normal((count, target.known))
    while (outside := ~target.inside(target.at(z))).any():
        z[outside] /= 2.0
    for _ in range(_SWEEPS):
        target.redraw(z, rng)
    return z


def _settled(chain: Callable[[], FloatArray], go_on: Callable[[], object], longest: int) -> float:
    """Return the autocorrelation time of a chain that is long enough; raises StrategyFailure."""
    while True:
        made = chain()
        steps, time = len(made), autocorrelation_time(made)
        if steps >= _LONG_ENOUGH * time:
            return time
        if steps >= longest:
            raise StrategyFailure(
                f"{steps} steps are {steps / time:.0f} autocorrelation "
                f"times, expected {_LONG_ENOUGH:g} at least"
            )
        go_on()


class _Transitional:
    """Samples that go from the prior to the posterior."""

    def __init__(self, target: Target, fit: QuadraticFit, rng: np.random.Generator) -> None:
        prior = np.column_stack([self.first(target, rng, _DRAWN), rng.standard_normal(_DRAWN)])
        found = sample_transitional(prior, target.log_prior, target.log_likelihood(fit), rng)
        evidence = found.log_evidence - 0.5 * len(fit.error) * float(np.log(2.0 * np.pi))
        self.draws, self.steps = found.samples, float(found.stages)
        self.figures = {"log_evidence": evidence, "accepted": found.accepted}

    @staticmethod
    def first(target: Target, rng: np.random.Generator, count: int) -> FloatArray:
        """Return draws of the prior within the bounds, (count, p).

        Raises:
            NotApplicable: when a parameter has no prior.
        """
        parametric = target.iteration.parametric
        for name, precision in zip(parametric.names, parametric.precision, strict=True):
            if not precision > 0.0:
                raise NotApplicable(f"{name} has no prior, from which the samples start")
        drawn = np.full((count, len(parametric)), np.nan)
        while (outside := ~target.inside(drawn)).any():
            more = rng.standard_normal((int(outside.sum()), len(parametric)))
            drawn[outside] = more * parametric.precision**-0.5
        return drawn

    def settle(self, longest: int) -> tuple[FloatArray, dict[str, float]]:
        """Return draws of q and v, (n, p + 1), with the evidence."""
        return self.draws, {"steps": self.steps, **self.figures}


_SAMPLERS: dict[str, type[_Ensemble | _Split | _Transitional]] = {
    "ensemble": _Ensemble,
    "transitional": _Transitional,
}


def autocorrelation_time(chain: FloatArray) -> float:
    """Return the longest integrated autocorrelation time of the coordinates in steps.

    As `emcee.autocorr.integrated_time`, which transforms every walker there and back by itself.

    Arguments:
        chain: (steps, walkers, coordinates).

    Source: Sokal (1997), Monte Carlo methods in statistical mechanics, section 3, for the window.
    """
    steps, padded, times = len(chain), next_fast_len(2 * len(chain), real=True), []
    for series in np.moveaxis(chain, 2, 0):
        apart = series - series.mean(axis=0)
        power = np.square(np.abs(rfft(apart, padded, axis=0)))
        # What each walker has at no lag is the sum of its squares.
        mean = (power / np.square(apart).sum(axis=0)).mean(axis=1)
        sums = 2.0 * np.cumsum(irfft(mean, padded)[:steps]) - 1.0
        within = np.arange(steps) < _WINDOW * sums
        times.append(sums[np.argmin(within) if within.any() else -1])
    return float(np.max(times))


def _normal_result(target: Target, off: float | None, steps: float = 0.0) -> UpdateResult:
    """Return the most probable model and the normal approximation about it.

    Arguments:
        off: largest error of the polynomials that were tried; None where none was.
        steps: of a chain that did not settle.
    """
    iteration, point = target.iteration, target.point
    own, covariance = target.discrepancy.median, target.root @ target.root.T
    return UpdateResult(
        model=point.prediction.model,
        parameter_count=len(point.q),
        parameters=estimate_parameters(
            iteration.parametric, point.q, np.sqrt(np.diagonal(covariance))
        ),
        diagnostics={
            "discrepancy_std": own,
            "steps": steps,
            "normal_approximation": 1.0,
            **({} if off is None else {"surrogate_error": off}),
            "paired_modes": float(len(target.measurement)),
        },
        uncertainty=Uncertainty.draw(iteration.model_at, point.q, covariance, discrepancy_std=own),
    )


def _result(
    target: Target, chain: FloatArray, drawn: FloatArray, diagnostics: dict[str, float]
) -> UpdateResult:
    iteration = target.iteration
    q, std = chain[:, :-1].mean(axis=0), chain[:, :-1].std(axis=0)
    own = target.discrepancy.std(chain[:, -1])
    parameters = estimate_parameters(iteration.parametric, q, std)
    rms = float(np.sqrt(np.mean(np.square(own))))
    return UpdateResult(
        model=iteration.model_at(q),
        parameter_count=len(parameters),
        parameters=parameters,
        diagnostics={
            "discrepancy_std": rms,
            "discrepancy_median": float(np.median(own)),
            **diagnostics,
            "paired_modes": float(len(target.measurement)),
        },
        uncertainty=Uncertainty(tuple(iteration.model_at(row) for row in drawn), rms),
    )
