"""What to measure next, so that explanations that the data cannot tell apart come apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench.core.diagnosis.advice_options import Group, Option, options_for, second_level
from femubench.core.diagnosis.advice_outlook import Outlook, outlook_of
from femubench.core.diagnosis.advice_points import points_of
from femubench.core.diagnosis.attachment_rows import total_mass
from femubench.core.diagnosis.fit import Fit, Problem
from femubench.core.diagnosis.result import Advice
from femubench.core.model import Model

_WORTH, _CLEAR = 1.0, 9.0
_MOST, _OF_A_KIND = 8, 3


def advise(
    model: Model, problems: Sequence[Problem], fits: Sequence[Fit], *, tolerance: float
) -> tuple[Advice, ...]:
    """Return the measurements that tell the first explanation best from all others.

    A separation is the squared distance of the two predictions in standard deviations, of the
    first explanation from the one that the measurement tells least from it. Where it tells the
    first from some only, the text says from which, and it comes after all that tell the first
    from every other by three standard deviations. A second level of excitation comes last: it
    tells a softer structure from one that softens, which is no matter between the explanations.

    Arguments:
        model: the nominal model.
        problems: of each fit; the model may have textbook effects in it.
        fits: explanations that the data cannot tell apart, the most probable first.
        tolerance: standard deviation of the relative scatter of every element.

    Returns:
        up to eight, best first; at least one where anything can be measured.

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
    group = Group(views, points, total_mass(model), hertz, tolerance, elements)
    return _ranked(options_for(group), [_label(view) for view in views], second_level(group))


def _ranked(
    options: Sequence[Option], labels: Sequence[str], level: Option | None
) -> tuple[Advice, ...]:
    """Return the best options; those that clearly tell the first explanation from all lead."""
    rows = [(option, *_told(option, labels)) for option in options]
    # Clearly all comes before very clearly some.
    rows.sort(key=lambda row: (min(row[0].distances) < _CLEAR, -row[2]))
    seen: dict[str, int] = {}
    chosen: list[Advice] = []
    for option, text, size in rows:
        seen[option.kind] = seen.get(option.kind, 0) + 1
        if (size >= _WORTH and seen[option.kind] <= _OF_A_KIND) or not chosen:
            chosen.append(Advice(text, size))
    last: list[Advice] = []
    if level is not None and min(level.distances) >= _WORTH:
        last.append(Advice(level.text, min(level.distances)))
    return (*chosen[: _MOST - len(last)], *last)


def _told(option: Option, labels: Sequence[str]) -> tuple[str, float]:
    """Return the text of an option and its separation from those that it tells from the first."""
    pairs = list(zip(labels[1:], option.distances, strict=True))
    told = [(label, d) for label, d in pairs if d >= _WORTH]
    if not told or len(told) == len(pairs):
        return option.text, min(option.distances)
    # Explanations that differ in textbook effects alone have one name.
    names = " and ".join(dict.fromkeys(label for label, _ in told if label != labels[0]))
    if not names:
        return option.text, min(d for _, d in told)
    return f"{option.text} (tells {labels[0]} from {names} only)", min(d for _, d in told)


def _label(view: Outlook) -> str:
    names = [f"{h.name} at {h.place}" if h.place != "all" else h.name for h, _ in view.causes]
    return " + ".join(names) or "nothing more"
