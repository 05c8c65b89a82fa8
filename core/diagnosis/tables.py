"""The tables of a diagnosis: residuals, rivals, causes with their numbers, smallest visible."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from femubench.core.change.hypothesis import Hypothesis
from femubench.core.diagnosis.region import Regions
from femubench.core.diagnosis.symmetry import mirror_places
from femubench.core.diagnosis.verdict import angle_between, credible, places_of
from femubench.core.display import count_noun
from femubench.core.errors import ModelError
from femubench.core.fit.modal_fit import State, state_at
from femubench.core.inference.examine import Examination
from femubench.core.inference.posterior import Explanation, Key, Posterior, fits_better
from femubench.core.inference.search import Found
from femubench.core.inference.settings import settings
from femubench.core.roles import EffectParameter
from femubench.core.schema.diagnosis import (
    Cause,
    CauseParameter,
    ErrorScale,
    Evidence,
    LeftOut,
    LocationRow,
    ResidualRow,
    Rival,
    SmallestVisible,
)
from femubench.core.ties import alike, by_probability
from femubench.core.typing import FloatArray


def error_scales(examination: Examination, explanation: Explanation) -> tuple[ErrorScale, ...]:
    """Return what an explanation takes for model error, one row a class."""
    scales = explanation.fit.state.problem.noise.scales
    if examination.error is None or scales is None:
        return ()
    return tuple(ErrorScale(*row) for row in examination.error.scales(scales))


def residual_rows(before: State, after: State) -> tuple[ResidualRow, ...]:
    """Return every datum in standard deviations of the measurement, before and after."""
    data = after.problem.data
    m = data.measurement
    mode, sensor = data.shape_rows
    rows = []
    first, last = before.problem.data.by_mode(before.raw), data.by_mode(after.raw)
    for i, number in enumerate(m.numbers):
        pair = float(first[i]), float(last[i])
        rows.append(ResidualRow("frequency", number, "", float(m.frequencies[i]), *pair))
    for k, (j, s) in enumerate(zip(mode, sensor, strict=True), start=len(m)):
        pair = float(before.raw[k]), float(after.raw[k])
        label, value = m.sensors.labels[s], float(m.shapes[s, j])
        rows.append(ResidualRow("shape", m.numbers[j], label, value, *pair))
    if data.mass is not None:
        pair = float(before.raw[-1]), float(after.raw[-1])
        rows.append(ResidualRow("mass", None, "", data.mass[0], *pair))
    return tuple(rows)


def _causes_in(
    explanation: Explanation, earned: frozenset[str], spread: FloatArray, own: tuple[float, ...]
) -> list[Cause]:
    """Return the causes of an explanation, taken as sure, with values and deviations.

    Arguments:
        explanation: fitted.
        earned: textbook effects that are part of the name.
        spread: standard deviations of the coordinates, (k,).
        own: share of a size by which it is in error, and of a spring's where the drawing is rigid.
    """
    causes = []
    book = {part.hypothesis.name: part.hypothesis for part in explanation.base.parts}
    for name, h in book.items():
        if name in earned and name not in explanation.searched:
            fixed = tuple(
                _parameter(p, float(p.textbook or 0.0), None, textbook=True) for p in h.parameters
            )
            causes.append(Cause(h.name, h.place, fixed, 1.0, _summary(h.effect)))
    x = explanation.fit.state.x
    start = 0
    for part in explanation.parts:
        h = part.hypothesis
        fitted = []
        for i, parameter in enumerate(h.parameters, start=start):
            value = float(parameter.value(np.array(x[i])))
            rigid = not np.isfinite(parameter.neutral)
            moved = own[rigid] * (value if rigid else value - parameter.neutral)
            std = float(np.hypot(spread[i] * _slope(parameter, float(x[i])), moved))
            if h.name in book and parameter.neutral == 0.0:
                # A relative change on top of the textbook's: what matters is the product.
                textbook = 1.0 + float(book[h.name].parameters[i - start].textbook or 0.0)
                value, std = textbook * (1.0 + value) - 1.0, textbook * std
            fitted.append(_parameter(parameter, value, std))
        start += len(h.parameters)
        causes.append(Cause(h.effect.name, h.place, tuple(fitted), 1.0, _summary(h.effect)))
    return causes


def find_spread(posterior: Posterior, leader: Explanation) -> FloatArray:
    """Return the standard deviations of a leader's coordinates over all explanations, (k,).

    What else may be wrong moves a size, and so does what is taken for model error: every
    explanation that has the same cause at the same place counts by its probability.

    Source: Hoeting et al. (1999), the variance of an average over models.
    """
    found, start = [], 0
    for part in leader.parts:
        width = len(part.hypothesis.parameters)
        here = leader.fit.state.x[start : start + width]
        total, weight = np.zeros(width), 0.0
        for e, p in zip(posterior.explanations, posterior.probabilities, strict=True):
            own = _coordinates(e, part.hypothesis) if p > settings.negligible else None
            if own is not None:
                total += p * (own[1] + np.square(own[0] - here))
                weight += p
        own = _coordinates(leader, part.hypothesis)
        assert own is not None
        found.append(np.sqrt(total / weight if weight > 0.0 else own[1]))
        start += width
    return np.concatenate(found) if found else np.zeros(0)


def _coordinates(
    explanation: Explanation, hypothesis: Hypothesis
) -> tuple[FloatArray, FloatArray] | None:
    """Return the coordinates of a hypothesis and their variances; None where it is no part."""
    start = 0
    for part in explanation.parts:
        width = len(part.hypothesis.parameters)
        if part.hypothesis.cause == hypothesis.cause:
            own = slice(start, start + width)
            return explanation.fit.state.x[own], explanation.fit.covariance.diagonal()[own]
        start += width
    return None


def list_causes(
    examination: Examination, explanation: Explanation, regions: Regions, held: float = 1.0
) -> list[Cause]:
    """Return the causes of an explanation, each with the probability of its name and of its place.

    Arguments:
        examination: what the explanation was weighed in.
        explanation: one of its explanations.
        regions: of what competes with it.
        held: probability that any of them holds, at most.
    """
    posterior = examination.posterior
    spread = find_spread(posterior, explanation)
    state = explanation.fit.state
    own = tuple(examination.own_error(state, rigid=rigid) for rigid in (False, True))
    passengers = find_passengers(state, spread)
    causes = _causes_in(explanation, posterior.earned, spread, own)
    first = len(causes) - len(explanation.parts)
    tied = _tied(posterior, explanation)
    found = []
    for k, cause in enumerate(causes):
        shares = places_of(posterior, explanation, k - first) if k >= first else {cause.place: 1.0}
        name = explanation.parts[k - first].hypothesis.name if k >= first else cause.effect
        alike_at = {
            part.hypothesis.place
            for other in tied
            for part in other.parts
            if part.hypothesis.name == name
        }
        others = [place for place in shares if place in alike_at and place != cause.place]
        if k >= first and passengers[k - first]:
            continue
        found.append(
            replace(
                cause,
                probability=held * posterior.known * posterior.inclusion(name),
                place_probability=shares[cause.place],
                places=credible(shares),
                mirrors=mirror_places(examination.model, cause.place, others) if others else (),
                region=regions.find(explanation, k - first, held) if k >= first else None,
            )
        )
    return found


def has_causes(examination: Examination, explanation: Explanation, names: Key) -> bool:
    """Tell whether an explanation has one of these causes as more than a passenger."""
    state = explanation.fit.state
    passengers = find_passengers(state, find_spread(examination.posterior, explanation))
    parts = zip(state.parts, passengers, strict=True)
    own = {part.hypothesis.name for part, idle in parts if not idle}
    return not own.isdisjoint(names) or not {*explanation.base.names}.isdisjoint(names)


def only_shared(causes: Iterable[Cause], explanation: Explanation, shared: Key) -> list[Cause]:
    """Return the causes that are weighed under some names: their own, or that of what they refine.

    Arguments:
        explanation: which they are of.
    """
    own = {p.hypothesis.effect.name: p.hypothesis.name for p in explanation.parts}
    return [cause for cause in causes if own.get(cause.effect, cause.effect) in shared]


def find_passengers(state: State, spread: FloatArray) -> list[bool]:
    """Return which causes may as well be left out, the rest as it is; never the only one.

    Chi-square is the same without them, or no size differs from nothing by two deviations.
    """
    parts = state.parts
    if len(parts) < 2:
        return [False] * len(parts)
    ends = np.cumsum([len(part.hypothesis.parameters) for part in parts])
    pieces = np.split(state.x, ends[:-1])
    # The arm of a joint spring is there however stiff it is.
    rigid = [p.scaling == "compliance" for part in parts for p in part.hypothesis.parameters]
    sized = np.split(rigid | (np.abs(state.x) > settings.notable_deviations * spread), ends[:-1])
    found = []
    for k in range(len(parts)):
        rest = np.concatenate([x for j, x in enumerate(pieces) if j != k])
        try:
            without = state_at(state.problem, (*parts[:k], *parts[k + 1 :]), rest)
        except ModelError:  # the others take away more mass than there is without this one
            found.append(False)
            continue
        gain = without.chi2 - state.chi2
        found.append(gain < settings.notable_deviations**2 or not sized[k].any())
    return found if not all(found) else [False] * len(parts)


def _tied(posterior: Posterior, best: Explanation) -> list[Explanation]:
    """Return the explanations with the same causes elsewhere that are exactly as probable."""
    return [
        e
        for e in posterior.explanations
        if (e.base.names, e.searched) == (best.base.names, best.searched)
        and e.place != best.place
        and alike(e.log_weight, best.log_weight)
    ]


def find_tied_places(posterior: Posterior, best: Explanation) -> tuple[str, ...]:
    """Return the other places at which the causes of an explanation are exactly as probable."""
    return tuple(dict.fromkeys(e.place for e in _tied(posterior, best)))


def _parameter(
    p: EffectParameter, value: float, std: float | None, *, textbook: bool = False
) -> CauseParameter:
    return CauseParameter(p.name, value, std, p.unit, textbook, p.wording)


def _summary(effect: object) -> str:
    return str(getattr(effect, "summary", "") or "")


def _slope(parameter: EffectParameter, x: float) -> float:
    """Return |d value / d x|."""
    step = settings.slope_step
    low, high = max(x - step, parameter.range[0]), min(x + step, parameter.range[1])
    ends = [float(parameter.value(np.array(v))) for v in (low, high)]
    return abs(ends[1] - ends[0]) / max(high - low, settings.negligible**2)


def rivals_of(
    examination: Examination, best: Explanation | None, group: Iterable[Explanation] = ()
) -> tuple[Rival, ...]:
    """Return other explanations by probability, one row a name and place.

    Arguments:
        examination: all explanations.
        best: the one that is no rival of itself.
        group: what must not be missing, however improbable.
    """
    posterior = examination.posterior
    nothing = posterior.nothing
    totals: dict[tuple[str, str], float] = {}
    first: dict[tuple[str, str], Explanation] = {}
    for explanation, p in zip(posterior.explanations, posterior.probabilities, strict=True):
        if not explanation.parts:
            continue
        label = " + ".join(explanation.searched), explanation.place
        totals[label] = totals.get(label, 0.0) + p
        first.setdefault(label, explanation)
    own = (" + ".join(best.searched), best.place) if best is not None else ("", "")
    ranked = [label for label in by_probability(totals) if label != own]
    inside = [(" + ".join(e.searched), e.place) for e in group]
    most = settings.leading
    ranked = [*ranked[:most], *(label for label in ranked[most:] if label in inside)]
    return tuple(
        Rival(
            *label,
            delta_chi2=2.0 * (first[label].log_likelihood - nothing.log_likelihood),
            probability=posterior.known * totals[label],
            angle=angle_between(best, first[label]) if best is not None else float("nan"),
        )
        for label in ranked
    )


def odds_rows(posterior: Posterior, best: Explanation) -> tuple[Evidence, ...]:
    """Return what data and prior say for an explanation, against nothing and the best rival.

    A rival that only adds to the explanation fits better in any case, and is none.
    """
    name = posterior.key(best)
    nothing = next(e for e in posterior.explanations if not e.parts and not e.base.parts)
    rivals = [key for key in posterior.names if key and not set(name) <= set(key)]
    others = [("nothing", nothing)]
    for key in rivals[:1]:
        rival = posterior.best(key)
        others.append((f"{' + '.join(key)} at {rival.place or 'all'}", rival))
    rows = []
    for label, other in others:
        data = fits_better(best, other)
        rows.append(Evidence(label, data, best.log_weight - other.log_weight - data))
    return tuple(rows)


def smallest_visible(found: Found) -> tuple[SmallestVisible, ...]:
    """Return the size of every effect at which it would have changed chi-square by 12.

    Taken from the atlas on the model as drawn, at the place where the effect shows best; for an
    effect with several parameters along the direction of its grid that shows best.
    """
    base = found.explanations[0].fit.state.residual
    best: dict[str, SmallestVisible] = {}
    for item in found.screened:
        h = item.projection.hypothesis
        effect = np.linalg.norm(item.residuals - base, axis=1) / np.sqrt(settings.too_small)
        x = _visible(item.grid[:, 0], effect)
        if x is None:
            continue
        parameter = h.parameters[0]
        value = float(parameter.value(np.array(x)))
        neutral = parameter.neutral if np.isfinite(parameter.neutral) else 0.0
        size = value if parameter.scaling == "compliance" else abs(value - neutral)
        row = SmallestVisible(h.name, h.place, size, parameter.unit, parameter.wording)
        softer = parameter.scaling == "compliance"
        old = best.get(h.name)
        better = old is None or (row.size > old.size if softer else row.size < old.size)
        if old is None or (better and not alike(row.size, old.size)):
            best[h.name] = row
    return tuple(best[name] for name in sorted(best))


def _visible(x: FloatArray, effect: FloatArray) -> float | None:
    """Return the least |x| at which an effect reaches 1, growing in proportion below the grid."""
    order = np.argsort(np.abs(x))
    last, seen = 0.0, 0.0
    for i in order:
        size, height = float(abs(x[i])), float(effect[i])
        if height >= 1.0:
            share = (1.0 - seen) / max(height - seen, settings.negligible**2)
            found = last + share * (size - last)
            return float(np.copysign(max(found, settings.negligible), x[i]))
        if height > seen:
            last, seen = size, height
    return None


def evidence_rows(examination: Examination) -> tuple[LocationRow, ...]:
    """Return the probability by place of all single causes, scaled to 1 at its largest."""
    totals: dict[str, float] = {}
    posterior = examination.posterior
    for explanation, p in zip(posterior.explanations, posterior.probabilities, strict=True):
        for part in explanation.parts:
            place = part.hypothesis.place
            totals[place] = totals.get(place, 0.0) + p
    top = max(totals.values(), default=0.0)
    ranked = by_probability(totals)
    return tuple(
        LocationRow("evidence", place, totals[place] / top)
        for place in ranked
        if top > 0.0 and totals[place] > settings.minor * top
    )


def notes_left_out(rows: Iterable[LeftOut]) -> tuple[str, ...]:
    """Return one sentence a reason, with the effects that were no candidates for it."""
    found: dict[str, list[str]] = {}
    for row in rows:
        found.setdefault(row.reason, []).append(
            f"{row.effect} at {count_noun(row.places, 'place')}"
        )
    return tuple(f"Not tried, since {why}: {', '.join(words)}." for why, words in found.items())
