"""What an update did: convergence of its iterations, and the parameters before and after."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from femubench.core.errors import InputError
from femubench.core.plot.style import AFTER, INK, SOFT, check_kind, curve_style, name_of, own_axes
from femubench.core.schema.results import JobResult, RunData
from femubench.core.update.strategy import UpdateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

History = Sequence[Mapping[str, float]]
_COUNTS = frozenset({"iteration", "step"})  # which say what is the axis anyway


def convergence(
    source: UpdateResult | JobResult | RunData,
    *,
    quantity: str | None = None,
    case: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw what strategies measured at every iteration, on a logarithmic scale if it is positive.

    Arguments:
        source: the result of one strategy, for all it measured, or a run, for every strategy that
            iterates: the first seed of a case.
        quantity: one key of the histories; None for all of a result, and for a run for the one
            that most strategies have.
        case: of a run; None for its first one.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when nothing iterated, or nothing has that quantity.

    Examples:
        >>> plot.convergence(result).get_xlabel()
        'iteration'
    """
    check_kind(source, (UpdateResult, JobResult, RunData), "iterations")
    whole = isinstance(source, RunData)
    histories = _histories(source, case) if isinstance(source, RunData) else {"": source.history}
    counts = Counter(
        key for history in histories.values() for key in (history or [{}])[0] if key not in _COUNTS
    )
    common = [key for key, _ in counts.most_common(1 if whole else None)]
    keys = [quantity] if quantity else common
    curves = [
        (name or key, history, key)
        for key in keys
        for name, history in histories.items()
        if history and key in history[0]
    ]
    if not curves:
        what = f"no iteration measured {quantity!r}" if quantity else "nothing iterated"
        raise InputError(what, expected="a result with a history")
    ax = own_axes(ax, (6.4, 4.0))
    lowest = np.inf
    for rank, (name, history, key) in enumerate(curves):
        values = np.array([float(step.get(key, np.nan)) for step in history])
        style = curve_style("predicted", rank, 1) | {"markevery": 1}
        steps = np.arange(1, len(values) + 1)
        ax.plot(steps, values, label=name_of(name), **{"marker": ".", **style})
        lowest = min(lowest, float(np.nanmin(values)))
    if lowest > 0.0:
        ax.set_yscale("log")
    ax.locator_params(axis="x", integer=True)
    label = name_of(keys[0]) if len(keys) == 1 else "measured at every iteration"
    ax.set(xlabel="iteration", ylabel=label)
    ax.grid(color="0.88", linewidth=0.6)
    ax.legend(fontsize=8.5, handlelength=3.0)
    return ax


def _histories(run: RunData, case: str | None) -> dict[str, History]:
    """Return the history of every strategy that iterated on one case, first seed."""
    cases = list(dict.fromkeys(result.case for result in run.results))
    if case is not None and case not in cases:
        raise InputError(f"the run has no case {case!r}", expected=f"one of {', '.join(cases)}")
    found: dict[str, History] = {}
    for result in run.ranked:
        if result.case == (case or cases[0]) and result.history:
            found.setdefault(result.strategy, result.history)
    if not found:
        raise InputError(f"no strategy iterated on {case or ', '.join(cases[:1]) or 'no case'}")
    return found


def parameters(source: UpdateResult | JobResult, *, ax: Axes | None = None) -> Axes:
    """Draw the change of every named parameter in percent, with one standard deviation as a bar.

    Where a parameter starts from zero, values after the update are drawn instead; all of them then
    have to have one unit.

    Arguments:
        source: the result of one strategy.
        ax: to draw on; None for axes of a new figure.

    Raises:
        InputError: when there is no named parameter, or no scale for all of them.

    Examples:
        >>> plot.parameters(result).get_xlabel()
        'change, %'
    """
    check_kind(source, (UpdateResult, JobResult), "parameters")
    items: list[Mapping[str, Any]] = [
        item if isinstance(item, Mapping) else asdict(item) for item in source.parameters
    ]
    if not items:
        raise InputError("the result names no parameter", expected="a strategy with parameters")
    before, after = (np.array([float(item[key]) for item in items]) for key in ("before", "after"))
    std = np.array([np.nan if item.get("std") is None else float(item["std"]) for item in items])
    units = {str(item.get("unit") or "") for item in items}
    if before.all():
        values, errors = 100.0 * (after / before - 1.0), 100.0 * std / np.abs(before)
        label = "change, %"
    elif len(units) == 1:
        values, errors = after, std
        unit = name_of(units.pop())
        label = f"after the update, {unit}" if unit else "after the update"
    else:
        what = "parameters that start from zero have no relative change"
        raise InputError(what, expected="one unit for all parameters")
    rows = np.arange(len(items))
    ax = own_axes(ax, (6.4, 1.0 + 0.26 * len(items)))
    ax.barh(rows, values, 0.7, color=AFTER, edgecolor=INK, linewidth=0.6)
    known = np.isfinite(errors)
    if known.any():
        ax.errorbar(
            values[known], rows[known], xerr=errors[known], linestyle="none", ecolor=INK,
            elinewidth=1.4, capsize=3.5, label="one standard deviation",
        )  # fmt: skip
        ax.legend(fontsize=8.5)
    ax.axvline(0.0, color=SOFT, linewidth=0.8)
    ax.set_yticks(rows, [name_of(str(item["name"])) for item in items])
    ax.invert_yaxis()
    ax.set_xlabel(label)
    ax.grid(axis="x", color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    return ax
