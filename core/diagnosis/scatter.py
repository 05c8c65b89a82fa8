"""Whether what is left is as much as the stated standard deviations let expect."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from scipy.special import chdtr, chdtrc

from femubench.core.fit.modal_fit import State
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import Scatter

Kind = Literal["all", "frequencies", "shapes"]


def scatter_of(state: State, kind: Kind = "all") -> Scatter | None:
    """Return how probable so little, and so much, is of one kind of data; None where none is.

    Which data a fitted value was spent on is not known: of one kind alone, so little is judged as
    if all were spent on it, so much as if none were.

    Arguments:
        state: after the fit.
        kind: of the data.
    """
    data = state.problem.data
    first, last = len(data.measurement), len(data.measurement) + len(data.shape_rows[0])
    rows = {"all": slice(None), "frequencies": slice(first), "shapes": slice(first, last)}[kind]
    rest = state.residual[rows]
    free = len(rest) - (0 if kind == "frequencies" else data.scale_count)
    dof, chi2 = free - len(state.x), float(rest @ rest)
    if dof < 1:
        return None
    more = chdtrc(dof if kind == "all" else free, chi2)
    factor = float(np.sqrt(dof / max(chi2, settings.negligible**2)))
    return Scatter(kind, chi2, dof, float(chdtr(dof, chi2)), float(more), factor)


def scatter_rows(state: State) -> tuple[Scatter, ...]:
    """Return every kind of data, with a warning on what chance hardly leaves.

    All data together are warned of where no kind by itself is; of too little only where somebody
    has measured the scatter.
    """
    known = [row for kind in get_args(Kind) if (row := scatter_of(state, kind)) is not None]
    assumed = state.problem.data.measurement.assumed
    stated = [replace(row, warning=_warning(row, assumed)) for row in known]
    if any(row.warning for row in stated[1:]):
        stated[0] = replace(stated[0], warning="")
    return tuple(stated)


def _warning(row: Scatter, assumed: bool) -> str:
    # One test shows no scatter from test to test, so that less than was assumed of it is no fault.
    if min(1.0 if assumed else row.less_p, row.more_p) >= settings.noise_p:
        return ""
    of = "all data together" if row.kind == "all" else f"the {row.kind}"
    few = row.less_p < row.more_p
    p = max(min(row.less_p, row.more_p), 1e-300)
    size, times = ("little", row.factor) if few else ("much", 1.0 / row.factor)
    seem = f"seem about {times:.2g} times too {'large' if few else 'small'}"
    so = "which hides causes and widens every margin" if few else "or something else is missing"
    return (
        f"What is left of {of} is far too {size}: chi-square is {row.chi2:.3g} where the stated "
        f"scatter lets expect {row.dof} ± {np.sqrt(2.0 * row.dof):.2g}, and chance leaves so "
        f"{size} with probability {p:.1g}. The standard deviations (or the tolerance) {seem}, {so}."
    )
