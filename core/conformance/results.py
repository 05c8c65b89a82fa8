"""What a strategy hands back, looked at from one side at a time, inside its worker."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.conformance.fingerprints import fingerprint, first_difference
from femubench.core.conformance.problems import UpdatingProblem
from femubench.core.errors import FemubenchError, clipped
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import enough_modes, solve_modes, zero_tolerance
from femubench.core.modal.rigid import rigid_modes_of
from femubench.core.run.answers import pack_outcome, read_report, unpack_outcome
from femubench.core.run.jobs import JobOutcome, one_line
from femubench.core.run.model_checks import check_model, check_numbers, check_sizes
from femubench.core.schema.paired_modes import PairedMode
from femubench.core.score.scoring import frequency_error, predict_block
from femubench.core.update.promise import USED_ERROR, eigenvalue_rounding
from femubench.core.update.strategy import ParameterEstimate, UpdateResult

USED_MODES = 1e-6
_RIGID = 1e-6  # of the first elastic eigenvalue


@dataclass(frozen=True)
class Given:
    """A result and what it was made from.

    Arguments:
        problem: the nominal model and the used modes, untouched.
        promises: what the strategy says that it keeps.
    """

    problem: UpdatingProblem
    result: UpdateResult
    promises: frozenset[str]


Look = Callable[[Given], str | None]


def sizes(given: Given) -> str | None:
    """Return what is wrong with the kinds and sizes of the matrices."""
    return _fault(check_sizes, given.result.model, given.problem.model)


def finite(given: Given) -> str | None:
    """Return which matrix has entries that are no finite real numbers."""
    return None if sizes(given) else _fault(check_numbers, given.result.model)


def symmetric(given: Given) -> str | None:
    """Return which matrix is not symmetric, as the harness sees it."""
    if sizes(given) or finite(given):
        return None
    return _fault(check_model, given.result.model, given.problem.model)


def _fault(check: Callable[..., None], *models: Model) -> str | None:
    try:
        check(*models)
    except FemubenchError as error:
        return str(error)
    return None


def figures(given: Given) -> str | None:
    """Return which figure of history, diagnostics or parameters is not a finite number."""
    for name, value in _figures(given.result):
        if isinstance(value, bool) or not isinstance(value, int | float | np.number):
            return f"{name} is {_short(value)}, expected a number"
        if not np.isfinite(value):
            return f"{name} is {value}, expected a finite number"
    return None


def parameter_count(given: Given) -> str | None:
    """Return what is wrong with the number of unknowns."""
    count = given.result.parameter_count
    if isinstance(count, bool) or not isinstance(count, int | np.integer):
        return f"parameter_count is {_short(count)}, expected a whole number"
    if count < 0:
        return f"parameter_count is {count}, expected 0 or more"
    if count > 0:
        return None
    nominal, model = given.problem.model, given.result.model
    parts = ("mass", "stiffness", "mass_change", "stiffness_change")
    before, after = ([getattr(item, part) for part in parts] for item in (nominal, model))
    if first_difference(fingerprint(before, ""), fingerprint(after, "")) is None:
        return None
    return "parameter_count is 0 and the model is another one, expected the number of unknowns"


def sendable(given: Given) -> str | None:
    """Return why the updated model cannot leave the worker, or is not the same outside."""
    model = given.result.model
    nominal = given.problem.model
    if sizes(given):
        return None
    data = pack_outcome(JobOutcome("ok", model=model), nominal)
    head = read_report(data)
    if head.status != "ok":
        return f"{head.reason}, expected a model of the structure that was given"
    try:
        arrived = unpack_outcome(data, nominal).model
    except FemubenchError as error:
        return str(error)
    path = first_difference(_sent(model), _sent(arrived))
    return None if path is None else f"{path} is another one after sending, expected the same"


def _sent(model: Model | None) -> dict[str, str]:
    """Return a fingerprint of what of a model leaves a worker; the rest is that of the case."""
    found = {"model.geometry": type(getattr(model, "geometry", None)).__name__}
    for name in ("mass", "stiffness", "mass_change", "stiffness_change", "dofs"):
        part = getattr(model, name)
        part = sp.csc_array(part) if sp.issparse(part) else part
        found |= fingerprint(part, f"model.{name}")
    return found


def find_missing_mode(given: Given) -> str | None:
    """Return which used mode the updated model does not have."""
    worst, error = _worst_used(given)
    within = _within(given, worst)
    return None if error <= within else f"used-modes: {_unmet(worst, within)}"


def find_hidden_missing_mode(given: Given) -> str | None:
    """Return which used mode the updated model does not have, where the result hides it."""
    worst, error = _worst_used(given)
    stated, within = given.result.diagnostics.get(USED_ERROR), _within(given, worst)
    if error <= within or (stated is not None and abs(stated - error) <= within):
        return None
    said = "is not given" if stated is None else f"is {stated:.7g}"
    wanted = f"or diagnostics[{USED_ERROR!r}] of {error:.7g}, which {said}"
    return f"used-modes-or-stated: {_unmet(worst, within)}, {wanted}"


def _worst_used(given: Given) -> tuple[PairedMode, float]:
    pairs = predict_block(given.result.model, given.problem.measurement, None)
    worst = max(pairs, key=frequency_error)
    return worst, frequency_error(worst)


def _within(given: Given, worst: PairedMode) -> float:
    """Return how closely a frequency can be asked for, whatever rounding makes of the model."""
    model = given.result.model
    modes = solve_modes(model, enough_modes(model, len(given.problem.measurement)))
    if worst.predicted_hz is None:
        return USED_MODES
    near = int(np.abs(modes.natural_frequencies - worst.predicted_hz).argmin())
    mode = modes.take(np.array([near]))
    return max(
        USED_MODES, 0.5 * float(eigenvalue_rounding(model, mode.shapes, mode.eigenvalues)[0])
    )


def _unmet(worst: PairedMode, within: float) -> str:
    seen = "no such mode" if worst.predicted_hz is None else f"{worst.predicted_hz:.7g} Hz"
    return f"mode {worst.number}: {seen}, expected {worst.measured_hz:.7g} Hz within {within:.2g}"


def rigid_body_modes(given: Given) -> str | None:
    """Return how many rigid-body modes of the nominal model got lost."""
    nominal, model = given.problem.model, given.result.model
    wanted = rigid_modes_of(nominal).shape[1]
    floor = _RIGID / 1e-6 * zero_tolerance(solve_modes(nominal))
    found = int(np.count_nonzero(np.abs(solve_modes(model).eigenvalues) <= floor))
    if found >= wanted:
        return None
    return f"rigid-body-modes: {found} modes without frequency, expected {wanted}"


def no_negative(given: Given) -> str | None:
    """Return how many eigenvalues are negative."""
    floor = zero_tolerance(solve_modes(given.problem.model))
    values = solve_modes(given.result.model).eigenvalues
    count = int(np.count_nonzero(values < -floor))
    return f"no-negative-eigenvalue: {count} are negative, expected none" if count else None


PROMISES: Mapping[str, Look] = {
    "used-modes": find_missing_mode,
    "used-modes-or-stated": find_hidden_missing_mode,
    "rigid-body-modes": rigid_body_modes,
    "no-negative-eigenvalue": no_negative,
}


def promises(given: Given) -> str | None:
    """Return the first promise that the result breaks."""
    if sizes(given) or finite(given) or symmetric(given):
        return None
    for name in sorted(given.promises & set(PROMISES)):
        fault = PROMISES[name](given)
        if fault:
            return fault
    return None


LOOKS: Mapping[str, Look] = {
    "sizes": sizes,
    "finite": finite,
    "symmetric": symmetric,
    "figures": figures,
    "parameter-count": parameter_count,
    "picklable": sendable,
    "promises": promises,
}


def faults_of(given: Given) -> dict[str, str]:
    """Return what is wrong with a result, by the check that asks for it."""
    found: dict[str, str] = {}
    for name, look in LOOKS.items():
        try:
            fault = look(given)
        except Exception as error:  # whatever a strange object does when it is looked at
            fault = f"cannot be looked at: {one_line(error)}"
        if fault:
            found[name] = " ".join(fault.split())
    return found


def _figures(result: UpdateResult) -> Iterator[tuple[str, object]]:
    for i, entry in enumerate(result.history):
        for key, value in entry.items():
            yield f"history[{i}][{key!r}]", value
    for key, value in result.diagnostics.items():
        yield f"diagnostics[{key!r}]", value
    for item in tuple[Any, ...](result.parameters):
        if not isinstance(item, ParameterEstimate):
            yield "a parameter", item
            continue
        yield f"parameter {item.name!r} before", item.before
        yield f"parameter {item.name!r} after", item.after
        if item.std is not None:
            yield f"parameter {item.name!r} std", item.std


def _short(value: object) -> str:
    return clipped(" ".join(repr(value).split()), 60)
