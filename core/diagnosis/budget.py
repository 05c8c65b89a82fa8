"""What a drawing gets wrong of the structure that it stands for: a budget of its frequency errors.

The handbook says what it knows. Then all that drawings of real structures lack is fitted at once to
the used modes, each with the room that the drawing leaves it; what they do not see stays as drawn.

Source: Tarantola (2005), section 3.2, the most probable point of an iterated linear-Gaussian model;
Lange, Little & Taylor (1989) for the tails; Aumann & Shapley (1974) for the shares of what is
fitted together.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import scipy.linalg as la
from msgspec import structs

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.diagnosis.entries import TAILED, Entry, extend_model, list_entries, with_slices
from femubench.core.effect.textbook import textbook_values
from femubench.core.fem.joints import JointZones, joint_groups, without_overlaps
from femubench.core.fem.model import Model
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.fit.modal_fit import Problem, State, bounds_of, fit, state_at, variance_of
from femubench.core.fit.noise import Noise
from femubench.core.fit.residuals import Data
from femubench.core.inference.coordinates import modes_for, place_data
from femubench.core.inference.model_error import general_slopes
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import zero_tolerance
from femubench.core.modal.measurement import Measurement
from femubench.core.roles import Effect
from femubench.core.schema.diagnosis import BudgetLine, BudgetMode
from femubench.core.score.responses import rms
from femubench.core.typing import FloatArray, IntArray


@dataclass(frozen=True)
class Budget:
    """A budget of errors, and the model that it leads to.

    Arguments:
        lines: by place and class, largest first.
        modes: those of the measurement.
        start: the drawing with the handbook.
        entries: all that it leaves open.
        state: on all measured modes; its parts are the entries at what the data see.
        covariance: of their coordinates, (k, k).
    """

    lines: tuple[BudgetLine, ...]
    modes: tuple[BudgetMode, ...]
    start: Model
    entries: tuple[Entry, ...]
    state: State
    covariance: FloatArray

    @cached_property
    def extended(self) -> Model:
        """Return the drawing with the handbook, and with all that the data see."""
        return self.model_at(self.state.x)

    def model_at(self, x: FloatArray) -> Model:
        """Return it with other coordinates of the entries, taken within their bounds, (k,)."""
        return extend_model(self.start, self.entries, np.clip(x, *bounds_of(self.state.parts)))

    @property
    def loose(self) -> FloatArray:
        """Return the covariance of the coordinates with what each of them idealises, (k, k)."""
        ideal = np.square(settings.own_error_of_change * self.state.x)
        return np.asarray(0.5 * (self.covariance + self.covariance.T) + np.diag(ideal))

    @property
    def hidden_percent(self) -> float:
        """Return the rms change of the frequencies below which no defect shows next to it."""
        left = [mode.left_percent for mode in self.modes if mode.used]
        return settings.visible_deviations * max(rms(left), 100.0 * settings.budget_rest[0])


def budget_of_modes(
    drawing: Model, every: Measurement, numbers: Sequence[int], effects: Iterable[Effect]
) -> Budget | None:
    """Return what a drawing lacks; None for matrices without groups.

    Arguments:
        every: measured modes.
        numbers: of those that are fitted; the others are predicted.
        effects: whose handbook values come first.

    Raises:
        NotApplicable: when a frequency has no standard deviation.
        ModelError: when the model has no modes.

    Examples:
        >>> found = diagnosis.budget_of_modes(model, measurement, [1, 2], diagnosis.list_effects())
        >>> len(found.modes) == len(measurement)
        True
    """
    if drawing.structure is None and not drawing.groups:
        return None
    if drawing.structure is not None and drawing.structure.frame.supports:
        # Scales show what is held too, such as a base plate, which moves in no mode.
        every = replace(every, total_mass=None)
    start = _as_it_is(drawing, every)
    # What the drawing has as a rigid motion has no ratio of frequencies, and which of its modes one
    # without a shape is, that no fit has seen, nobody knows where others have theirs.
    out = start.problem.space.still(start.eigenvalues[start.partner])
    shaped = np.isfinite(every.shapes).any(axis=0)
    if shaped.any():
        out |= ~shaped & ~np.isin(every.numbers, numbers)
    every = every.select([n for n, without in zip(every.numbers, out, strict=True) if not without])
    used = [number for number in numbers if number in every.numbers]
    if not used:
        return None
    if out.any():
        start = _as_it_is(drawing, every)
    drawn = last = np.log(np.abs(start.frequencies[start.partner]))
    lines = list[BudgetLine]()
    for place, name, model, unsure in _improve(drawing, effects):
        now = log_frequencies(start if model is drawing else _as_it_is(model, every))
        std = unsure * np.abs(now - last)
        lines.append(_line(place, name, now - last, np.outer(std, std)))
        last = now
    entries = list_entries(model)
    hypotheses = [entry.hypothesis for entry in entries]
    fitted = _fit_with_tails(_pose(model, every, every.select(used), hypotheses), entries)
    if fitted is None:
        return None
    x, covariance = fitted
    wide = _pose(model, every, every, hypotheses)
    state = state_at(wide, wide.space.projections, x)
    slopes, found = frequency_slopes(state), log_frequencies(state)
    fresh = _share_out(entries, state, covariance)
    # A used mode was fitted with all that its lines idealise, another was not.
    shares = np.array([line.percent for line in fresh]) / 100.0
    ideal = np.square(settings.own_error_of_change * shares).sum(axis=0)
    ideal[np.isin(every.numbers, used)] = 0.0
    deviation = np.sqrt(variance_of(slopes, covariance) + ideal)
    lines += fresh
    measured = np.log(every.frequencies)
    figures = 100.0 * np.column_stack([measured - drawn, measured - found, deviation])
    rows = zip(every.numbers, figures.tolist(), strict=True)
    modes = tuple(BudgetMode(number, number in used, *row) for number, row in rows)
    lines.sort(key=lambda line: -abs(line.rms_percent))
    return Budget(tuple(lines), modes, model, tuple(entries), state, covariance)


def _improve(model: Model, effects: Iterable[Effect]) -> Iterator[tuple[str, str, Model, float]]:
    """Yield the drawing with one thing after the other that a handbook knows.

    Each with its place, its class and the share of what it changes that is unsure.
    """
    part, ideal = settings.budget_joints[3], settings.own_error_of_change
    if model.structure is not None:
        halved = JointZones(model.structure, part).halve()
        finer = model if halved is model.structure else Model.of(halved)
        model = finer if finer.size <= settings.most_dofs else model
    yield "all", "mesh", model, 0.0
    for effect in effects:
        for place, values in textbook_values(effect, model).items():
            model = cast(Model, effect.extend(model, place, values))
            yield place, effect.name, model, settings.budget_handbook
    if model.structure is None:
        return
    for group in joint_groups(model.structure.frame):
        cut = without_overlaps(model.frame_structure, group)
        if cut is not model.structure:
            model = Model.of(cut)
            yield group.type, "overlap of members", model, ideal
    joints = defaultdict[str, list[str]](list)
    for (place, role), ends in JointZones(model.frame_structure, part).ends.items():
        joints[place] += ends if role != "foot" else ()
    for place, ends in joints.items():
        stiff = JointZones(model.frame_structure, part).stiffen(ends)
        if stiff is not model.structure:
            model = Model.of(stiff)
            yield place, "arms of joints", model, ideal


def _fit_with_tails(
    problem: Problem, entries: Sequence[Entry]
) -> tuple[FloatArray, FloatArray] | None:
    """Return the most probable coordinates, (k,), and their covariance; None where no fit stands.

    A normal prior whose width is known to its order alone is Cauchy's, of all numbers of an entry
    together: fit and widths follow in turn, each given the other.

    Source: Lange, Little & Taylor (1989), JASA 84, 881-896, for one degree of freedom.
    """
    placed, parts = with_slices(entries), problem.space.projections
    x = np.zeros(sum(len(entry.names) for entry in entries))
    width = np.ones(len(x))
    problem = _with_rest(state_at(problem, parts, x))
    for _ in range(settings.scale_steps[1]):
        scaled = [replace(e, root=e.root * width[own]).hypothesis for e, own in placed]
        posed = [replace(p, hypothesis=h) for p, h in zip(parts, scaled, strict=True)]
        found = fit(problem, posed, x / width)
        if found is None:
            return None
        x, before = width * found.state.x, width.copy()
        covariance = found.covariance * np.outer(width, width)
        # What is left beyond the noise makes all of it less sure (Birge 1932).
        excess = max(1.0, found.state.chi2 / len(problem.data))
        size = np.square(x) + covariance.diagonal()
        for entry, own in placed:
            if entry.kind in TAILED:
                width[own] = np.sqrt((1.0 + size[own].sum()) / (1.0 + len(entry.names)))
        if np.allclose(width, before, rtol=settings.budget_rest[0]):
            break
        problem = _with_rest(found.state)
    return x, covariance * excess


def _pose(
    model: Model, every: Measurement, used: Measurement, hypotheses: Sequence[Hypothesis]
) -> Problem:
    """Return used modes in the coordinates of a model, which serve every measured mode."""
    modes, bias = modes_for(model), mesh_bias(model, 2 * len(every) + settings.spare_modes)
    still = modes.rigid | (modes.eigenvalues <= zero_tolerance(modes))
    data = Data(used, np.zeros(0) if bias is None else bias, int(still.sum()))
    return place_data(model, data, Noise(np.eye(len(data))), hypotheses)


def _with_rest(state: State) -> Problem:
    """Return the problem of a state with what no class of a budget is as noise.

    It is in every reading, and it couples the modes, so that close ones have less certain shapes.
    """
    data, (rest_f, rest_s) = state.problem.data, settings.budget_rest
    mode, _ = data.shape_rows
    count, largest = len(data.measurement), np.abs(data.shapes).max(axis=0, initial=0.0)
    rest = np.zeros(len(data))
    rest[count:][: len(mode)] = rest_s * largest[mode]
    coupled = 2.0 * rest_f * general_slopes(state)
    total = np.diag(1.0 + np.square(rest / data.std)) + coupled @ coupled.T
    least = 1.0 + np.square(rest_f * data.measurement.frequencies / data.std[:count])
    at = np.arange(count)  # beyond the modes that random changes couple
    total[at, at] = np.maximum(total[at, at], least)
    return replace(state.problem, noise=Noise(np.asarray(la.cholesky(total, lower=True))))


def _as_it_is(model: Model, every: Measurement) -> State:
    return state_at(_pose(model, every, every, ()), (), np.zeros(0))


def log_frequencies(state: State) -> FloatArray:
    """Return ln of the frequency of the partner of every measured mode, (m,)."""
    hertz, _ = state.predicted
    return np.asarray(np.log(np.abs(hertz[0, state.partner])))


def frequency_slopes(state: State, modes: IntArray | None = None) -> FloatArray:
    """Return d ln f / d x of the partner of every measured mode, or of other modes, (m, k)."""
    stiff, mass = _slopes_apart(state, state.partner if modes is None else modes)
    return stiff + mass


def _slopes_apart(state: State, modes: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return what of them is by the stiffness, and by the mass."""
    values, near = state.eigenvalues[modes], state.vectors[:, modes]

    def along(eigenvalues: FloatArray) -> FloatArray:
        forces, _ = state.problem.space.forces(state.parts, state.x, near, eigenvalues)
        return np.asarray(np.einsum("nm,nmk->mk", near, forces) / (2.0 * values[:, None]))

    stiff = along(np.zeros(len(values)))
    return stiff, along(values) - stiff


def _share_out(entries: Sequence[Entry], state: State, covariance: FloatArray) -> list[BudgetLine]:
    """Return the lines of what was fitted, which add up to all that it changes.

    Each entry has the integral of its slope on the straight way from the drawing (Aumann & Shapley
    1974), by Simpson's rule; what that misses goes to the lines by their size.
    """
    x, problem, parts = state.x, state.problem, state.parts
    start, half = (state_at(problem, parts, t * x) for t in (0.0, 0.5))
    # By the stiffness, and behind it by the mass, of every coordinate.
    first, middle, slopes = (
        np.hstack(_slopes_apart(one, one.partner)) for one in (start, half, state)
    )
    each = (first + 4.0 * middle + slopes) / 6.0 * np.tile(x, 2)
    missing = log_frequencies(state) - log_frequencies(start) - each.sum(axis=1)
    total = np.abs(each).sum(axis=1)
    each += np.abs(each) * (missing / np.where(total > 0.0, total, 1.0))[:, None]
    lines: dict[tuple[str, str], list[tuple[Entry, slice, IntArray]]] = {}
    for entry, one in with_slices(entries):
        for kind, columns in zip(entry.lines, np.arange(2 * len(x)).reshape(2, -1), strict=True):
            lines.setdefault((entry.place, kind), []).append((entry, one, columns[one]))
    both = np.tile(covariance, (2, 2))
    found = []
    for (place, kind), owners in lines.items():
        own = np.concatenate([columns for *_, columns in owners])
        spread = slopes[:, own] @ both[np.ix_(own, own)] @ slopes[:, own].T
        names = {name for entry, *_ in owners for name in entry.names}
        blind = (n for e, one, _ in owners for n in e.list_unseen(covariance[one, one]))
        unseen = tuple(dict.fromkeys(blind))
        share = each[:, own].sum(axis=1)
        # A zone, or a point mass, is an idealisation of what is there.
        spread = spread + np.outer(share, share) * settings.own_error_of_change**2
        line = _line(place, kind, share, spread)
        moved = len(unseen) < len(names) or abs(line.rms_percent) > line.rms_std
        source = "data" if moved else "drawing"
        found.append(structs.replace(line, source=source, unseen=unseen))
    return found


def _line(place: str, kind: str, share: FloatArray, covariance: FloatArray) -> BudgetLine:
    """Return a handbook's line from its share in ln f of every mode, and the covariance of that."""
    size = rms(share)
    std = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
    # Of the root mean square: along the share itself; of no share, that of one drawn at random.
    along = share / np.sqrt(len(share)) / size if size > 0.0 else np.zeros(len(share))
    spread = np.sqrt(along @ covariance @ along / len(share)) if size else rms(std)
    size = -size if share.sum() < 0.0 else size
    percent = tuple((100.0 * share).tolist()), tuple((100.0 * std).tolist())
    return BudgetLine(place, kind, *percent, 100.0 * size, 100.0 * float(spread), "handbook")
