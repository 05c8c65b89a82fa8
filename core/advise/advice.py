"""What to measure next, so that explanations that the data cannot tell apart come apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from femubench.core.advise.point_attachments import (
    antiresonances,
    list_supports,
    nearest,
    points_of,
    predict_loaded_frequencies,
)
from femubench.core.advise.prediction import Outlook, Points, Predicted, distance, outlook_of
from femubench.core.fem.model import Model
from femubench.core.fit.modal_fit import Fit, Problem
from femubench.core.fit.residuals import Data
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Advice
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray

_LEVEL = "measure at twice the excitation level: a stiffness that falls with the amplitude"


@dataclass(frozen=True)
class Option:
    """A measurement that one could make.

    Arguments:
        kind: options of one kind are alike.
        text: an imperative clause.
        distances: of the first explanation from each of the others.
    """

    kind: str
    text: str
    distances: tuple[float, ...]


@dataclass(frozen=True)
class Group:
    """The explanations of a group, the points where one can measure, and how well.

    Arguments:
        views: the most probable first.
        points: where masses, hammers and sensors may go.
        weight: mass of the nominal model in kg.
        hertz: relative standard deviation of a frequency, element scatter included.
        tolerance: standard deviation of the relative scatter of every element.
        elements: number of elements that scatter.
        responses: whether frequency responses are given, so that their antiresonances are known.
        stops: tells whether the time for it is spent.
    """

    views: tuple[Outlook, ...]
    points: Points
    weight: float
    hertz: float
    tolerance: float
    elements: int
    responses: bool = False
    stops: Callable[[], bool] = lambda: False

    @property
    def data(self) -> Data:
        """Return the data that the explanations share."""
        return self.views[0].state.problem.data

    def option(
        self,
        kind: str,
        text: str,
        predicted: Sequence[Predicted | None],
        std: FloatArray | float,
    ) -> Option:
        """Return an option from the predictions of all explanations."""
        first = predicted[0]
        assert first is not None
        deviation = np.broadcast_to(np.asarray(std, dtype=float), first.values.shape)
        distances = (
            0.0 if other is None else distance(first, other, deviation) for other in predicted[1:]
        )
        return Option(kind, text, tuple(distances))


def _weighing(group: Group) -> Iterator[Option]:
    if group.data.mass is None and group.views[0].state.mass > 0.0:
        predicted = [view.mass() for view in group.views]
        relative = np.hypot(settings.reachable_mass_std, group.tolerance / np.sqrt(group.elements))
        yield group.option("mass", "weigh the structure", predicted, relative * predicted[0].values)


def _more_modes(group: Group) -> Iterator[Option]:
    first = group.views[0]
    modes = first.further(settings.least_modes)
    if len(modes):
        wanted = first.frequencies(modes)
        others = [_matched(wanted.values, view) for view in group.views[1:]]
        near = " and ".join(_hertz(f) for f in wanted.values)
        text = f"measure {len(modes)} more mode{'s'[: len(modes) - 1]}, near {near} Hz"
        yield group.option("modes", text, [wanted, *others], group.hertz * wanted.values)


def _matched(wanted: FloatArray, view: Outlook) -> Predicted | None:
    """Return the modes nearest to some frequencies, of those that were not measured.

    By frequency alone: nothing was measured of them yet that `pair_measured` could pair.
    """
    frequencies, zero = view.state.frequencies, view.zero
    free = np.setdiff1d(np.flatnonzero(frequencies > zero), view.state.partner)
    if len(free) < len(wanted):
        return None
    cost = np.square(frequencies[free] / wanted[:, None] - 1.0)
    return view.frequencies(free[linear_sum_assignment(cost)[1]])


def _masses(group: Group) -> Iterator[Option]:
    if not group.points.labels or group.weight <= 0.0:
        return
    size = float(f"{settings.test_mass * group.weight:.1e}")
    kilograms = f"{size:.{max(0, 1 - int(np.floor(np.log10(size))))}f}"
    tables = [predict_loaded_frequencies(view, group.points, size) for view in group.views]
    for label, *predicted in zip(group.points.labels, *tables, strict=True):
        text = f"attach {kilograms} kg at {label} and measure again"
        yield group.option("load", text, predicted, group.hertz * predicted[0].values)


def _supports(group: Group) -> Iterator[Option]:
    """Yield a structure held otherwise, with the modes in which explanations then differ most."""
    measured = group.data.measurement
    ways = list(list_supports(group.views[0].state.problem.model, measured.sensors))
    for change, alteration, unsure in ways[:: -(-len(ways) // settings.advised) or 1]:
        first, *rest = (view.altered(alteration) for view in group.views)
        if first is not None and len(first.values) == len(measured):
            moved = first.values - np.sort(measured.frequencies)
            std = np.hypot(group.hertz * first.values, unsure * moved)
            gaps = (
                np.abs([first.values - other.values for other in rest if other]).sum(axis=0) / std
            )
            best = np.sort(np.argsort(-gaps, kind="stable")[: settings.least_modes])
            near = " and ".join(_hertz(f) for f in first.values[best])
            text = f"{change} and measure again, above all the modes near {near} Hz"
            yield group.option("support", text, [first, *rest], std)


def _antiresonances(group: Group) -> Iterator[Option]:
    """Yield the best of the lowest two antiresonances of every point and direction."""
    if not group.points.labels:
        return
    used = group.data.measurement.frequencies
    tables = [antiresonances(view) for view in group.views]
    relative = np.hypot(settings.reachable_antiresonance_std, group.hertz)
    least = settings.antiresonance_band * used.min()
    alike = 1.0 / settings.same_antiresonance, settings.same_antiresonance
    for sensor, first, *others in zip(group.points.sensors, *tables, strict=True):
        band = (first.values >= least) & (first.values <= used.max())
        found = []
        for i in np.flatnonzero(band)[:2]:
            own = first.take([int(i)])
            rivals = [nearest(float(own.values[0]), other, alike) for other in others]
            where = f"near {_hertz(own.values[0])} Hz of the point receptance"
            text = f"measure the antiresonance {where} at {sensor}"
            found.append(group.option("zero", text, [own, *rivals], relative * own.values))
        if found:
            yield in_order(found, lambda option: -min(option.distances))[0]


def _responses(group: Group) -> Iterator[Option]:
    """Yield the force at a sensor of the test whose responses have the best antiresonances.

    Those of all sensors count together. Each has a deviation of its own, and one that is common to
    all: that of a frequency. Where explanations have other ones, those that both have count.
    """
    sensors = group.data.measurement.sensors
    if group.responses or not len(group.data.shape_rows[0]):
        return
    highest, found = float(group.data.measurement.frequencies.max()), []
    zeros = zip(*(view.zeros(highest) for view in group.views), strict=True)
    for label, ((own, spread), *others) in zip(sensors.labels, zeros, strict=True):
        if group.stops():
            break
        hertz = own.frequencies
        spread = np.hstack([spread, group.hertz * hertz[:, None]])
        distances = []
        for other, wide in others:
            partner = own.pair(other)
            kept = np.flatnonzero(partner >= 0)
            pair = (
                Predicted(hertz, spread).take(kept),
                Predicted(other.frequencies, wide).take(partner[kept]),
            )
            std = settings.reachable_antiresonance_std * hertz[kept]
            distances.append(distance(*pair, std) if len(kept) else 0.0)
        text = f"record frequency responses of all sensors to a force at {label}: "
        text += f"{len(own)} antiresonances up to {_hertz(highest)} Hz"
        found.append(Option("responses", text, tuple(distances)))
    yield from in_order(found, lambda option: -min(option.distances))[:1]


def _shapes(group: Group) -> Iterator[Option]:
    if not group.points.labels:
        return
    pairs = [view.shapes() for view in group.views]
    further = ""
    if len(group.data.shape_rows[0]):
        view, further = group.views[0], "further "
        known = view.sensed[None] - view.seen[:, None], view.sensed[None] + view.seen[:, None]
        least = np.minimum(*(np.abs(gap).max(axis=2) for gap in known)).min(axis=1)
        new = least > settings.slope_step * np.abs(view.seen).max(axis=1)
        pairs = [(shapes[new], spread[new]) for shapes, spread in pairs]
    shapes = pairs[0][0]
    if len(shapes) < 2 or not shapes.any():
        return
    # A mode that does not move there says nothing, and rounding is no reading of it.
    size = np.maximum(np.abs(shapes).max(axis=0), settings.slope_step * np.abs(shapes).max())
    std = np.hypot(settings.reachable_shape_std, group.tolerance) * size
    own, *others = [align_shapes(shapes, *pair) for pair in pairs]
    yield group.option(
        "shapes",
        f"measure the shapes of the used modes at {further}joints and in the middle of members",
        [own, *others],
        np.broadcast_to(std, shapes.shape).ravel(),
    )


def align_shapes(reference: FloatArray, shapes: FloatArray, spread: FloatArray) -> Predicted:
    """Return shapes at their best scale to others, all that goes along with these left out.

    Arguments:
        reference, shapes: (s, m).
        spread: of the shapes, (s, m, p).
    """
    size = np.square(shapes).sum(axis=0)
    factor = (reference * shapes).sum(axis=0) / np.where(size > 0.0, size, 1.0)
    unit = reference / np.maximum(np.linalg.norm(reference, axis=0), 1e-300)
    values, spread = factor * shapes, factor[:, None] * spread
    values = values - unit * (unit * values).sum(axis=0)
    spread = spread - unit[..., None] * np.einsum("sm,smp->mp", unit, spread)
    return Predicted(values.ravel(), spread.reshape(values.size, spread.shape[2]))


def _readings(group: Group) -> Iterator[Option]:
    """Yield the instruments that read a parameter of one of the causes directly."""
    causes = [hypothesis for view in group.views for hypothesis, _ in view.causes]
    for reading in dict.fromkeys(getattr(cause.effect, "reading", None) for cause in causes):
        if reading is not None:
            predicted = [view.departure(reading) for view in group.views]
            yield group.option(reading.text, reading.text, predicted, reading.std)


def _deflection(group: Group) -> Iterator[Option]:
    """Yield the deflection of the softest point of a structure that is held."""
    points = group.points
    if not points.labels or any(view.state.eigenvalues[0] <= 0.0 for view in group.views):
        return
    if group.views[0].state.problem.space.rigid:
        return
    predicted = [view.flexibility() for view in group.views]
    best = int(predicted[0].values.argmax())
    text = f"measure the static deflection under a known load at {points.sensors[best]}"
    softest = [p.take([best]) for p in predicted]
    std = settings.width_sensor_gains * softest[0].values
    yield group.option("deflection", text, softest, std)


def second_level(group: Group) -> Option | None:
    """Return what twice the level of excitation would show, were a softer part one that softens.

    The loss of stiffness is taken to grow in proportion to the level: what a cause did to the
    frequencies at the present level it would do to them once more.
    """
    std = np.sqrt(2.0) * group.hertz
    found = []
    for view in group.views:
        now = np.sort(view.state.frequencies[view.state.partner])
        spread = view.frequencies(np.sort(view.state.partner)).spread / now[:, None]
        for hypothesis, columns in view.causes:
            if not getattr(hypothesis.effect, "softens", False):
                continue
            stiff = view.without(columns)
            fall = 1.0 - np.sort(stiff.frequencies[stiff.partner]) / now
            if fall.sum() >= 0.0:
                continue
            none = Predicted(np.zeros_like(now), np.zeros((len(now), 0)))
            size = distance(Predicted(fall, spread), none, np.full(len(now), std))
            text = f"{_LEVEL} looks like {hypothesis.effect.name}"
            found.append(Option("level", text, (size,)))
    return next(iter(in_order(found, lambda option: -option.distances[0])), None)


def _hertz(frequency: float) -> str:
    return f"{frequency:.0f}" if frequency >= 99.5 else f"{frequency:.3g}"


_KINDS: tuple[Callable[[Group], Iterator[Option]], ...] = (
    _weighing, _more_modes, _masses, _supports, _antiresonances, _responses, _shapes, _readings,
    _deflection,
)  # fmt: skip


def options_for(group: Group) -> list[Option]:
    """Return every measurement that one could make next, as far as there is time."""
    kinds = (kind for kind in _KINDS if kind is _weighing or not group.stops())
    return [option for kind in kinds for option in kind(group)]


def advise(
    model: Model,
    problems: Sequence[Problem],
    fits: Sequence[Fit],
    *,
    tolerance: float,
    responses: bool = False,
    stops: Callable[[], bool] = lambda: False,
) -> tuple[Advice, ...]:
    """Return the measurements that tell the first explanation best from all others.

    A separation is the squared distance of the two predictions in standard deviations, of the
    first explanation from the one that the measurement tells least from it. Where it tells the
    first from some only, the text says from which, and it gives way to all that tell the first
    from every other by three standard deviations where there is no room for all. A second level of
    excitation tells a softer structure from one that softens: it always has a place, the last.

    Arguments:
        model: the nominal model.
        problems: of each fit; the model may have textbook effects in it.
        fits: explanations that the data cannot tell apart, the most probable first.
        tolerance: standard deviation of the relative scatter of every element.
        responses: whether frequency responses are given already.
        stops: tells whether the time for it is spent: what was weighed until then is ranked.

    Returns:
        up to eight, largest separation first; at least one where anything can be measured.

    Source: Box & Hill (1967), Technometrics 9, 57-71.
    """
    if len(fits) < 2:
        return ()
    points = points_of(model)
    pairs = zip(problems, fits, strict=True)
    views = tuple(outlook_of(problem, found, points) for problem, found in pairs)
    m = problems[0].data.measurement
    scatter = np.linalg.norm(problems[0].noise.factor[: len(m)], axis=1)
    hertz = float(np.median(scatter * m.frequency_std / m.frequencies))
    structure = model.structure
    elements = len(structure.properties) if structure is not None else model.size
    group = Group(views, points, model.total_mass, hertz, tolerance, elements, responses, stops)
    return _ranked(options_for(group), [_label(view) for view in views], second_level(group))


def _ranked(
    options: Sequence[Option], labels: Sequence[str], level: Option | None
) -> tuple[Advice, ...]:
    """Return the best options; those that clearly tell the first explanation from all stay."""
    rows = [(option, *_describe(option, labels)) for option in options]
    # Clearly all comes before very clearly some.
    rows = in_order(rows, lambda row: -row[2])
    clear = settings.visible_deviations**2
    rows.sort(key=lambda row: min(row[0].distances) < clear)
    seen: dict[str, int] = {}
    chosen: list[Advice] = []
    for option, text, size in rows:
        seen[option.kind] = seen.get(option.kind, 0) + 1
        worth = size >= settings.worth_measuring
        if (worth and seen[option.kind] <= settings.of_a_kind) or not chosen:
            chosen.append(Advice(text, size))
    level_advice: list[Advice] = []
    if level is not None and min(level.distances) >= settings.worth_measuring:
        level_advice.append(Advice(level.text, min(level.distances)))
    kept = in_order(chosen[: settings.advised - len(level_advice)], lambda a: -a.separation)
    return (*kept, *level_advice)


def _describe(option: Option, labels: Sequence[str]) -> tuple[str, float]:
    """Return the text of an option and its separation from those that it tells from the first."""
    pairs = list(zip(labels[1:], option.distances, strict=True))
    stated = [(label, d) for label, d in pairs if d >= settings.worth_measuring]
    if not stated or len(stated) == len(pairs):
        return option.text, min(option.distances)
    # Explanations that differ in textbook effects alone have one name.
    names = " and ".join(dict.fromkeys(label for label, _ in stated if label != labels[0]))
    if not names:
        return option.text, min(d for _, d in stated)
    return f"{option.text} (tells {labels[0]} from {names} only)", min(d for _, d in stated)


def _label(view: Outlook) -> str:
    named = [(h.effect.name, h.place) for h, _ in view.causes]
    names = [f"{name} at {place}" if place != "all" else name for name, place in named]
    return " + ".join(names) or "nothing more"
