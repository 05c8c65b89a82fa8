"""Search the explanations: nothing, one cause, two, and more, on top of textbook physics."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from femubench.core.change.hypothesis import (
    Hypothesis,
    by_themselves,
    finer,
    hypotheses_of,
)
from femubench.core.fem.model import Model
from femubench.core.fit.extended_model import check_joint_fit, extend_model
from femubench.core.fit.modal_fit import Fit, Problem, State, fit, log_evidence, state_at
from femubench.core.fit.projection import Projection, Projector
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.effort import Effort, of_a_search
from femubench.core.inference.grid_search import Screened, likely, residuals_at, screen
from femubench.core.inference.posterior import Explanation, by_weight
from femubench.core.inference.prior import Base, selection_cost, textbook_bases
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import keep_last
from femubench.core.roles import Effect
from femubench.core.ties import in_order, least
from femubench.core.typing import FloatArray


def adequacy(state: State, unknowns: int) -> float:
    """Return the probability of residuals as large as these, were they noise.

    The smallest of the probabilities of all data, of the frequencies, of the shape of any one
    mode and of any one sensor, times the number of these looks (Bonferroni): a sensor that reads
    wrong is hidden in the sum over many good ones.

    Arguments:
        state: after the fit.
        unknowns: number of values that were fitted.
    """
    data = state.problem.data
    count, modes = len(data.measurement), len(state.partner)
    residual = state.residual
    mode, sensor = data.shape_rows
    total = _tail(residual, unknowns + data.scale_count)
    looks = [total, _tail(residual[:count], 0)]
    shape = residual[count : count + len(mode)]
    by_mode = [_tail(shape[mode == j], 1) for j in range(modes) if (mode == j).sum() > 2]
    by_sensor = [_tail(shape[sensor == s], 0) for s in np.unique(sensor)]
    parts = [min(ps) * len(ps) for ps in (by_mode, by_sensor) if ps]
    return float(min(1.0, total, len(looks + parts) * min(looks + parts)))


def _tail(residual: FloatArray, unknowns: int) -> float:
    dof = max(len(residual) - unknowns, 1)
    return float(chdtrc(dof, residual @ residual)) if len(residual) else 1.0


@dataclass(frozen=True)
class Found:
    """What a search found on one base.

    Arguments:
        base: textbook effects.
        problem: with the base in the modal coordinates.
        explanations: every one that was tried.
        screened: the atlas.
    """

    base: Base
    problem: Problem
    explanations: tuple[Explanation, ...]
    screened: tuple[Screened, ...]

    @property
    def best(self) -> Explanation:
        """Return the most probable explanation."""
        return _best(self.explanations)


class Search:
    """State of one search.

    Arguments:
        problem: data and modal coordinates of the nominal model.
        effects: what may be missing.
        pairs: whether more than one cause is sought.
        floor: of ln weight; where no single cause comes near it, no pairs are sought.
        effort: counts the pieces; what is not needed ends with its time.
    """

    def __init__(
        self,
        problem: Problem,
        effects: Sequence[Effect],
        *,
        pairs: bool = True,
        floor: float = -np.inf,
        effort: Effort | None = None,
    ) -> None:
        self.problem, self.effects, self.pairs, self.floor = problem, effects, pairs, floor
        self.effort = effort or Effort()
        places = {p.hypothesis.name: p.hypothesis.places for p in problem.space.projections}
        self.names = len(places)
        self.places = sum(places.values()) / max(self.names, 1)
        self.coarse: dict[int, int] = {}  # from hypotheses with more values to those with one
        self.highest = floor + settings.lag  # ln weight so far

    def run(self) -> tuple[list[Explanation], list[Found]]:
        """Return all explanations and the atlas of every base that was searched."""
        bases = textbook_bases(self.problem.space.projections)
        several = self.pairs and bool(self.names)
        with self.effort.scope(of_a_search(len(bases), several)):
            return self._run(bases)

    def _run(self, bases: Sequence[Base]) -> tuple[list[Explanation], list[Found]]:
        found = [self.on(bases[0])]
        bare = [self.bare(base) for base in bases[1:]]
        self.effort.note_adequacy(self.enough(found) or any(map(self.adequate, bare)))
        promising = self.promising(bare, found[0])
        self.effort.expect("single", len(promising))
        for base in promising:
            if self.effort.stops():
                break
            found.append(self.on(base))
            self.effort.note_adequacy(self.enough(found) or any(map(self.adequate, bare)))
        explanations = [e for item in found for e in item.explanations]
        searched = {item.base.names for item in found}
        explanations += [e for e in bare if e.base.names not in searched]
        if self.pairs and self.names and _best(explanations).log_weight > self.floor:
            explanations += self.combine(found)
            for best in by_weight(explanations)[: settings.candidates]:
                explanations += self.carry(best, found)
            self.effort.expect("together", 0)
            self.effort.expect("more", 0)
            for best in by_weight(explanations)[: settings.candidates]:
                if self.effort.stops():
                    break
                with self.effort.piece("values"):
                    explanations += self.split(best)
        return explanations, found

    def bare(self, base: Base) -> Explanation:
        """Return a textbook set with nothing on top, in the coordinates of the model as drawn."""
        state = state_at(self.problem, base.parts, base.x)
        alone = replace(state, parts=(), x=np.zeros(0))
        return Explanation(base, Fit(alone, log_evidence(alone)), self.names)

    def carry(self, explanation: Explanation, found: Iterable[Found]) -> list[Explanation]:
        """Return the causes of an explanation on the other textbook sets, as far as they are none.

        Where a change is large only one set may have led the search to it.
        """
        book = explanation.base.names
        counts = [len(part.hypothesis.parameters) for part in explanation.parts]
        pairs = zip(
            (part.hypothesis for part in explanation.parts),
            np.split(explanation.fit.state.x, np.cumsum(counts)[:-1]),
            strict=True,
        )
        kept = [(h.cause, x) for h, x in pairs if h.name not in book] if counts else []
        result = []
        for item in found:
            known = {p.hypothesis.cause: p for p in item.problem.space.projections}
            if item.base.names == book or not kept or any(key not in known for key, _ in kept):
                continue
            parts = [known[key] for key, _ in kept]
            fitted = fit(item.problem, parts, np.concatenate([x for _, x in kept]))
            if fitted is not None:
                result.append(Explanation(item.base, fitted, self.names))
        return result

    def split(self, explanation: Explanation) -> list[Explanation]:
        """Return an explanation with more values at one of its places, where there are more."""
        result, problem = [], replace(explanation.fit.state.problem, offset=0.0)
        for i, part in enumerate(explanation.parts):
            for own in self.finer(problem.model, part.hypothesis):
                parts = list(explanation.parts)
                parts[i] = own
                fitted = _fit_from_grid(problem, parts, i, explanation.fit)
                self.coarse[id(own.hypothesis)] = id(part.hypothesis)
                result += self.bear_out(explanation.base, fitted)
        return result

    def finer(self, model: Model, hypothesis: Hypothesis) -> list[Projection]:
        """Return what tells more of a hypothesis where it sits, in the coordinates of a model."""

        def make() -> list[Projection]:
            project = Projector(model, modes_for(model).shapes)
            return [project(own) for own in finer(hypothesis, model, self.effects)]

        return keep_last(model, ("finer", hypothesis.cause), hypothesis, make)

    def bear_out(self, base: Base, found: Fit | None) -> list[Explanation]:
        """Return the explanation by a fit that its own model bears out, if it is any.

        Several causes far behind count for nothing either way; one may have scales of its own.
        """
        if found is not None:
            ahead = Explanation(base, found, self.names).log_weight > self.highest - settings.lag
            found = check_joint_fit(found) if ahead or len(found.parts) < 2 else found
        result = [] if found is None else [Explanation(base, found, self.names)]
        self.highest = max([self.highest, *(e.log_weight for e in result)])
        return result

    def promising(self, bare: Sequence[Explanation], plain: Found) -> list[Base]:
        """Return the textbook sets that come nearer to the data than the model as drawn."""
        least = plain.explanations[0].chi2 - 2.0 * settings.as_well
        ranked = in_order(bare, lambda e: e.chi2 - 2.0 * e.base.log_prior)
        better = [e.base for e in ranked if e.chi2 < least]
        return better[: 1 if self.adequate(plain.best) else settings.candidates]

    def adequate(self, explanation: Explanation) -> bool:
        """Tell whether an explanation leaves no more than noise."""
        state = explanation.fit.state
        return adequacy(state, len(state.x)) > settings.adequate_p

    def on(self, base: Base) -> Found:
        """Return nothing and every single cause on top of a textbook set."""
        with self.effort.piece("single"):
            problem = self.ground(base) if base.parts else self.problem
            start = fit(problem, (), np.zeros(0))
            assert start is not None
            atlas = screen(problem, start.state, problem.space.projections)
            fits = self.refine(problem, start, atlas)
            explanations = [Explanation(base, item, self.names) for item in (start, *fits)]
            self.highest = max(self.highest, _best(explanations).log_weight)
            ranked = by_weight(explanations[1:])
            # What tells more may carry most of it: the best of what it refines count anywhere.
            refined = {getattr(effect, "refines", None) for effect in self.effects}
            own = [e for e in ranked[settings.finer_singles :] if refined.intersection(e.searched)]
            most = settings.finer_singles
            for one in (*ranked[:most], *own[:most]):
                explanations += [] if self.effort.stops() else self.split(one)
            return Found(base, problem, tuple(explanations), tuple(atlas))

    def ground(self, base: Base) -> Problem:
        """Return the data in the modal coordinates of the model with textbook effects in it.

        All effects are sought there anew: what they do depends on what is there, and a textbook
        value may be off.
        """
        model = extend_model(self.problem.model, base.parts, base.x)
        known = hypotheses_of(model, by_themselves(self.effects))
        return place_data(model, self.problem.data, self.problem.noise, known)

    def refine(self, problem: Problem, start: Fit, screened: Sequence[Screened]) -> list[Fit]:
        """Return exact fits of the hypotheses that the atlas does not rule out."""
        if not screened:
            return []
        lowest = min(s.cost for s in screened)
        explained = start.state.chi2 - lowest
        limit = lowest + 2.0 * settings.near + settings.approximation * max(explained, 0.0)
        near = in_order(
            (s for s in screened if s.cost <= limit),
            lambda s: np.log(s.projection.hypothesis.places) - s.log_evidence,
        )[: settings.shortlist]
        known = {id(item) for item in near}
        chances = [item for item in _first_of_a_name(screened) if id(item) not in known]
        # Where large changes exchange modes the atlas may err by any amount.
        if chdtrc(len(start.state.residual), lowest) > settings.adequate_p:
            chances = []
        fits: list[Fit] = []
        best = start.state.cost
        queue = [(item, item.x) for item in (*near, *chances)]
        for number, (item, x) in enumerate(queue, 1):
            if fits and self.effort.stops():
                break
            self.effort.step(number - 1, len(queue))
            give_up = best + settings.given_up if id(item) in known else np.inf
            result = fit(problem, (item.projection,), x, give_up=give_up)
            if result is not None:
                fits.append(result)
                best = min(best, result.state.cost)
            if fits and number == len(near) + len(chances):
                first = min(fits, key=lambda found: found.state.cost)
                # The grid missed it by more than it may: the same effect elsewhere, of this size.
                if first.state.cost < 2.0 * lowest - limit:
                    tried = {id(other) for other, _ in queue}
                    more = (s for s in screened if id(s) not in tried and _are_alike(s, first))
                    queue += [(s, first.state.x) for s in more]
                    known |= {id(other) for other, _ in queue}
        leading = {id(f) for f in in_order(fits, _by_evidence)[: settings.candidates]}
        return [_from_both_sides(problem, f) if id(f) in leading else f for f in fits]

    def combine(self, found: Sequence[Found]) -> list[Explanation]:
        """Return explanations with two causes, then greedily more while that is worth it."""
        by_base = {item.base.names: item for item in found}
        singles = by_weight(e for item in found for e in item.explanations if e.parts)
        places = {self.at(e.parts[0].hypothesis): e for e in reversed(singles)}
        enough = self.enough(found)
        seeds = by_weight(places.values())[: 1 if enough else settings.seeds]
        self.effort.expect("together", len(seeds) + 2 * (not enough))
        result: list[Explanation] = []
        tried: set[tuple[object, ...]] = set()
        for seed in seeds:
            result += self.grow(by_base[seed.base.names], seed, tried)
            self.effort.note_adequacy(enough or (bool(result) and self.adequate(_best(result))))
        if not result:
            return result
        best = _best(result)
        self.effort.expect("together", len(best.parts))
        result += self.swap(by_base[best.base.names], best, tried)
        self.effort.expect("together", 0)
        while True:
            best = _best(result)
            self.effort.note_adequacy(enough or self.adequate(best))
            if len(best.parts) >= settings.most_causes or self.adequate(best):
                return result
            result += self.grow(by_base[best.base.names], best, tried)
            if _best(result) is best:
                return result

    def at(self, hypothesis: Hypothesis) -> int:
        """Return what is the same for hypotheses that differ in their number of values alone."""
        return self.coarse.get(id(hypothesis), id(hypothesis))

    def enough(self, found: Sequence[Found]) -> bool:
        """Tell whether nothing or one cause leaves no more than noise."""
        return any(self.adequate(e) for item in found for e in item.explanations)

    def grow(
        self, found: Found, seed: Explanation, tried: set[tuple[object, ...]]
    ) -> list[Explanation]:
        """Return an explanation with one cause more, for every partner that is worth it."""
        if self.effort.stops():
            return []
        with self.effort.piece("together" if len(seed.parts) == 1 else "more"):
            return self._grown(found, seed, tried)

    def _grown(
        self, found: Found, seed: Explanation, tried: set[tuple[object, ...]]
    ) -> list[Explanation]:
        problem, state = found.problem, seed.fit.state
        floor = 0.5 * selection_cost(self.names, self.places)
        above = worthwhile(found, seed, settings.promise_share * floor)
        space = above.space.rebase(seed.parts, state.x)
        above = replace(above, space=space, offset=state.problem.offset)
        start = fit(above, (), np.zeros(0))
        assert start is not None
        originals = {id(p.hypothesis): p for p in problem.space.projections}
        taken = {id(part.hypothesis) for part in seed.parts}
        taken |= {self.at(part.hypothesis) for part in seed.parts}
        free = [p for p in above.space.projections if id(p.hypothesis) not in taken]
        ranked = in_order(screen(above, start.state, free, state.jacobian), lambda s: s.cost)
        result = []
        for item in ranked[: settings.partners]:
            if start.state.chi2 - item.cost < floor or self.effort.stops():
                break
            partner = originals.get(id(item.projection.hypothesis), item.projection)
            joint = self.joint(problem, (*seed.parts, partner), state.x, item.x, tried)
            result += self.bear_out(found.base, joint)
        return result

    def joint(
        self,
        problem: Problem,
        parts: tuple[Projection, ...],
        first: FloatArray,
        last: FloatArray,
        tried: set[tuple[object, ...]],
    ) -> Fit | None:
        """Return the joint fit of several causes, None where it was tried before or fails."""
        order = np.argsort([id(part.hypothesis) for part in parts])
        key = (id(problem), *(id(parts[i].hypothesis) for i in order))
        if key in tried:
            return None
        tried.add(key)
        return fit(problem, parts, np.concatenate([first, last]))

    def swap(
        self, found: Found, pair: Explanation, tried: set[tuple[object, ...]]
    ) -> list[Explanation]:
        """Return pairs in which either cause of the best pair has another partner."""
        result = []
        for i, part in enumerate(pair.parts):
            counts = [len(p.hypothesis.parameters) for p in pair.parts]
            first = sum(counts[:i])
            x = pair.fit.state.x[first : first + counts[i]]
            alone = fit(found.problem, (part,), x, steps=0)
            if alone is not None:
                seed = Explanation(found.base, alone, self.names)
                result += self.grow(found, seed, tried)
        return result


def _by_evidence(found: Fit) -> float:
    return -found.log_evidence


def _from_both_sides(problem: Problem, found: Fit) -> Fit:
    """Return the best fit of a cause from where it is and from its neighbours on the grid.

    Where modes change places in between, chi-square rises, and no step leads over that. What is
    as good stays as it is.
    """
    grid, x = found.parts[0].hypothesis.grid, found.state.x
    if len(x) > 1:
        return found
    near = int(np.abs(grid - x).argmin())
    starts = (grid[i] for i in (near - 1, near + 1) if 0 <= i < len(grid))
    more = (fit(problem, found.parts, x, give_up=found.state.cost) for x in starts)
    better = [
        new for new in more if new and new.log_evidence > found.log_evidence + settings.as_well
    ]
    return in_order(better, _by_evidence)[0] if better else found


def _first_of_a_name(screened: Sequence[Screened]) -> list[Screened]:
    """Return the best places of every effect."""
    found: dict[str, list[Screened]] = {}
    for item in in_order(screened, lambda s: s.cost):
        found.setdefault(item.projection.hypothesis.name, []).append(item)
    return [item for own in found.values() for item in own[: settings.candidates]]


def _are_alike(item: Screened, fitted: Fit) -> bool:
    """Tell whether a hypothesis is the effect that was fitted alone, with as many values."""
    (part,) = fitted.parts
    one, other = item.projection.hypothesis, part.hypothesis
    return one.effect.name == other.effect.name and len(one.parameters) == len(other.parameters)


def _fit_from_grid(
    problem: Problem, parts: Sequence[Projection], new: int, known: Fit
) -> Fit | None:
    """Return the fit of causes one of which is new, from the best point of its grid."""
    first = sum(len(part.hypothesis.parameters) for part in parts[:new])
    last = first + len(known.parts[new].hypothesis.parameters)
    before, _, after = np.split(known.state.x, [first, last])
    there = replace(problem.space, projections=(parts[new],))
    # The others stay as they are: in the modes with them in it one hypothesis is tried alone.
    there = there.rebase((*parts[:new], *parts[new + 1 :]), np.append(before, after))
    few = there.condense(there.projections, problem.compared)
    grid = parts[new].hypothesis.grid
    grid, raw = residuals_at(replace(problem, space=few.space), few.parts[0], grid)
    if not len(grid):
        return None
    residual = problem.noise.residual(raw + problem.offset)
    cost = np.square(residual).sum(axis=1) + np.square(grid).sum(axis=1)
    return fit(problem, parts, np.concatenate([before, grid[least(cost)], after]))


def _best(explanations: Sequence[Explanation]) -> Explanation:
    return by_weight(explanations)[0]


def worthwhile(found: Found, seed: Explanation, least: float) -> Problem:
    """Return the data with those hypotheses alone that may be worth something together with a seed.

    Arguments:
        found: the atlas without the seed.
        seed: causes.
        least: what chi-square must promise to fall by.
    """
    problem = found.problem
    taken = {id(part.hypothesis) for part in seed.parts}
    others = [item for item in found.screened if id(item.projection.hypothesis) not in taken]
    still = found.explanations[0].fit.state.residual
    chosen = likely(others, still, seed.fit.state, least)
    return replace(problem, space=replace(problem.space, projections=tuple(chosen)))
