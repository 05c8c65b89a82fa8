"""What an effect must keep, one check a function; all of it runs in workers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import get_args

import numpy as np

from femubench.core.conformance import kit
from femubench.core.conformance.fingerprints import fingerprint, first_difference
from femubench.core.conformance.kit import Bench, Verdict, check, fail_check, pass_check
from femubench.core.conformance.problems import GROUPED, PLAIN, problem
from femubench.core.conformance.results import Given, finite as finite_entries, sendable, symmetric
from femubench.core.conformance.strategy_checks import own_doc
from femubench.core.drawing.places import find_wireframe
from femubench.core.effect.model_places import ModelPlaces
from femubench.core.effect.places import bare_place, split_direction
from femubench.core.effect.reading import Reading
from femubench.core.effect.sizes import Site, Size
from femubench.core.errors import ModelError, NotApplicable
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.model import Model
from femubench.core.look.modes import Seen
from femubench.core.modal.eigen import solve_modes
from femubench.core.roles import Effect, EffectParameter
from femubench.core.schema.diagnosis import LookWarning
from femubench.core.typing import Wording
from femubench.core.update.strategy import UpdateResult

_PROBLEMS = (
    PLAIN, "grounded frame in plane", "grounded frame in space", "free frame out of plane",
    "matrices alone", GROUPED,
)  # fmt: skip
_SAME = 1e-6  # relative, of frequencies: stiff springs stand for rigid joints
_STEP = 1e-4  # of the scale


def _spots(effect: Effect) -> Iterator[tuple[str, Model, str]]:
    """Return the places of every model, two of each kind of word at most: first and last."""
    for name in _PROBLEMS:
        model = problem(name).model
        places = tuple(effect.places(model))
        for place in dict.fromkeys((*places[:2], *places[-1:])):
            yield f"{name}, place {place!r}", model, place


@kit.check_apart("effect", "described", "It has a summary or a docstring.", code_alone=True)
def is_described(effect: Effect) -> Verdict:
    """Look for a text of an effect that tells what the model lacks."""
    if getattr(effect, "summary", "") or own_doc(type(effect)):
        return pass_check()
    return fail_check("neither summary nor docstring, expected what the model lacks")


@check("effect", "picklable", "It can be sent to a worker, and an extended model back.")
def picklable(bench: Bench) -> Verdict:
    """Pickle the effect and what it makes."""
    sent = kit.picklable(bench, "an effect")
    return bench.apart(check_sending) if sent.status == "pass" else sent


def _values(parameters: tuple[EffectParameter, ...], x: float) -> list[float]:
    found = []
    for item in parameters:
        low, high = item.range
        at = x if low <= x <= high else -x
        found.append(float(item.value(min(max(at, low), high))))
    return found


def _extended(effect: Effect, model: Model, place: str, x: float = 1.0) -> Model:
    return _with(effect, model, place, _values(tuple(effect.parameters(model, place)), x))


def _tries(effect: Effect, *xs: float) -> Iterator[tuple[str, list[Model]]]:
    """Yield the models extended by so many scales, wherever the effect applies."""
    for where, model, place in _spots(effect):
        try:
            extended = [_extended(effect, model, place, x) for x in xs]
        except NotApplicable:
            continue
        yield where, extended


def _with(effect: Effect, model: Model, place: str, values: list[float]) -> Model:
    found = effect.extend(model, place, values)
    if not isinstance(found, Model):
        raise TypeError(f"extend gave {type(found).__name__}, expected femubench.Model")
    return found


def check_sending(effect: Effect) -> Verdict:
    """Send extended models as a worker does."""
    for where, model, place in _spots(effect):
        fault = sendable(_given(model, _extended(effect, model, place)))
        if fault:
            return fail_check(f"{where}: {fault}")
    return pass_check()


def _given(model: Model, extended: Model) -> Given:
    plain = problem(PLAIN)
    return Given(type(plain)("", model, plain.measurement), UpdateResult(extended), frozenset())


@kit.check_apart("effect", "places", "Its places are in the model, each once, and have parameters.")
def places(effect: Effect) -> Verdict:
    """Read every place of every model."""
    count = 0
    for name in _PROBLEMS:
        model = problem(name).model
        found = list(effect.places(model))
        count += len(found)
        for place in found:
            where = f"{name}, place {place!r}"
            if not isinstance(place, str) or found.count(place) > 1:
                return fail_check(f"{where}: not a text, or there twice, expected every place once")
            if not has_place(model, place):
                return fail_check(f"{where}: not in the model, expected a word of docs/effects.md")
            fault = _parameters(effect, model, place)
            if fault:
                return fail_check(f"{where}: {fault}")
    return pass_check() if count else kit.not_applicable("it has no place in any of the models")


def has_place(model: Model, place: str) -> bool:
    """Tell whether a word stands for a place of a model, by the grammar of docs/effects.md."""
    if find_wireframe(model, [place]).places[0].kind != "elsewhere":
        return True
    bare = split_direction(bare_place(place).removesuffix(":branch"))[0]
    groups = (*Groups(model).places("stiffness"), *Groups(model).places("mass"))
    if {bare, place} & {*groups, *model.families}:
        return True
    try:
        return bool(ModelPlaces(model).node_pairs(bare))
    except ModelError:
        return False


def _parameters(effect: Effect, model: Model, place: str) -> str | None:
    parameters = list(effect.parameters(model, place))
    names = [item.name for item in parameters]
    if not parameters or len(set(names)) < len(names):
        return f"parameters {names}, expected one or more, every name once"
    for item in parameters:
        if not (np.isfinite(item.scale) and item.scale > 0.0):
            return f"scale of {item.name!r} is {item.scale}, expected a number > 0"
        if not item.lower <= item.neutral <= item.upper:
            bounds = f"{item.lower} .. {item.upper}"
            return f"neutral value {item.neutral} of {item.name!r} is outside its bounds {bounds}"
    return None


@kit.check_apart("effect", "neutral", "With neutral values the model stays what it was.")
def neutral(effect: Effect) -> Verdict:
    """Extend models with neutral values."""
    spots = list(_spots(effect))
    for where, model, place in spots:
        values = [item.neutral for item in effect.parameters(model, place)]
        try:
            extended = _with(effect, model, place, values)
        except NotApplicable:
            continue
        gap = _distance(model, extended)
        if not gap <= _SAME:
            text = f"{where}: neutral values change frequencies by {gap:.2g}, expected {_SAME:g}"
            # A rigid spring may leave the arm behind which it sits.
            return fail_check(text) if np.isfinite(values).all() else kit.warn_of(text)
    return pass_check() if spots else kit.not_applicable("it has no place in any of the models")


def _distance(model: Model, other: Model) -> float:
    """Return the largest relative difference of the five lowest elastic frequencies."""
    one, two = (solve_modes(item).elastic.eigenvalues[:5] for item in (model, other))
    if len(two) < len(one):
        return float("inf")
    return float(np.abs(np.sqrt(np.abs(two[: len(one)] / one)) - 1.0).max())


@kit.check_apart(
    "effect", "finite", "The extended model and its rates of change are finite and symmetric."
)
def finite(effect: Effect) -> Verdict:
    """Extend models by one scale, and by a little more."""
    count = 0
    for where, (one, more) in _tries(effect, 1.0, 1.0 + _STEP):
        count += 1
        for extended in (one, more):
            given = _given(extended, extended)
            fault = finite_entries(given) or symmetric(given)
            if fault:
                return fail_check(f"{where}: {fault}")
        same = one.stiffness.shape == more.stiffness.shape
        if not same or not np.isfinite(_distance(one, more) / _STEP):
            return fail_check(f"{where}: no rate of change at one scale, expected a smooth change")
    return pass_check() if count else kit.not_applicable("it has no place in any of the models")


@kit.check_apart("effect", "deterministic", "Two extensions are equal to the last bit.")
def deterministic(effect: Effect) -> Verdict:
    """Extend models twice."""
    for where, extended in _tries(effect, 1.0, 1.0):
        path = first_difference(*(fingerprint(model, "model") for model in extended))
        if path:
            return fail_check(f"{where}: {path} differs between two extensions, expected equality")
    return pass_check()


@kit.check_apart("effect", "inputs", "The nominal model stays as it was given.")
def inputs(effect: Effect) -> Verdict:
    """Compare models before and after."""
    for where, model, place in _spots(effect):
        before = fingerprint(model, "model")
        with suppress(NotApplicable):
            _extended(effect, model, place)
        path = first_difference(before, fingerprint(model, "model"))
        if path:
            return fail_check(f"{where}: {path} was changed in place, expected a copy")
    return pass_check()


@kit.check_apart(
    "effect", "worded", "Sizes, hints, wording and looks are of use, where it brings any."
)
def check_words(effect: Effect) -> Verdict:
    """Read what is optional, and look at every model with its measurement."""
    hints = _hints(effect)
    if hints:
        return fail_check(hints)
    for where, model, place in _spots(effect):
        parameters = tuple(effect.parameters(model, place))
        faults = [*_wordings(effect, parameters), *_sizes(effect, model, place, parameters)]
        half = getattr(effect, "in_half", lambda values: None)(_values(parameters, 1.0))
        pairs = list(zip(half or (), parameters, strict=False))
        fits = all(item.lower <= value <= item.upper for value, item in pairs)
        if half is not None and not (len(half) == len(parameters) and fits):
            faults.append(f"in_half gives {half}, expected a value within bounds a parameter")
        if faults:
            return fail_check(f"{where}: {faults[0]}")
    for name in _PROBLEMS:
        given = problem(name)
        for item in getattr(effect, "look", lambda seen: ())(Seen(given.model, given.measurement)):
            if not isinstance(item, LookWarning) or item.effect != effect.name or not item.what:
                expected = f"expected a LookWarning of {effect.name}"
                return fail_check(f"{name}: look gives {item!r}, {expected}")
    return pass_check()


def _hints(effect: Effect) -> str:
    """Return what is wrong with the words and hints that do not depend on the place."""
    caution = getattr(effect, "caution", "")
    if not isinstance(caution, str) or (caution and caution[-1] not in ".!?"):
        return f"caution is {caution!r}, expected a sentence"
    for hint in ("softens", "innate", "acquired", "handbook"):
        if not isinstance(given := getattr(effect, hint, False), bool):
            return f"{hint} is {given!r}, expected True or False"
    refined = getattr(effect, "refines", None)
    if refined is not None and (not isinstance(refined, str) or refined == effect.name):
        return f"refines is {refined!r}, expected the slug of another effect"
    reading = getattr(effect, "reading", None)
    if reading is not None and not (isinstance(reading, Reading) and reading.std > 0.0):
        return f"reading is {reading!r}, expected a Reading with std > 0"
    sizes = getattr(effect, "sizes", ())
    if not isinstance(sizes, Sequence) or not all(isinstance(item, Size) for item in sizes):
        return f"sizes is {sizes!r}, expected a tuple of Size"
    return ""


def _wordings(effect: Effect, parameters: Sequence[EffectParameter]) -> Iterator[str]:
    known = all(item.textbook is not None for item in parameters)
    if known and not getattr(effect, "handbook", True):
        yield "its parameters have textbook values, expected handbook = True"
    for item in parameters:
        if item.wording not in get_args(Wording):
            yield f"wording {item.wording!r}, expected one of {', '.join(get_args(Wording))}"
        elif item.unit and item.wording != "value":
            yield f"{item.name!r} is a {item.wording} in {item.unit}, expected no unit"
    reading: Reading | None = getattr(effect, "reading", None)
    read = [item for item in parameters if reading and item.name == reading.parameter]
    if reading and not (read and np.isfinite(read[0].neutral)):
        yield f"it reads {reading.parameter!r}, expected a parameter with a finite neutral value"


def _sizes(
    effect: Effect, model: Model, place: str, parameters: Sequence[EffectParameter]
) -> Iterator[str]:
    """Yield what is wrong with the ranges of hidden cases at a place of a frame."""
    sizes: Sequence[Size] = getattr(effect, "sizes", ())
    if model.structure is None:
        return
    hertz = solve_modes(model).elastic.natural_frequencies
    site = Site(model.structure.frame, place, model.total_mass, hertz)
    for size, item in zip(sizes, parameters, strict=False):
        low, high = size.bounds(site)
        inside = item.lower < high and low < item.upper
        if not (0.0 <= low < high < np.inf and inside) or (size.log and low == 0.0):
            yield (
                f"sizes of {item.name!r} from {low:.3g} to {high:.3g}, expected two numbers, 0 or "
                f"more, ascending, and some between them within {item.lower:g} .. {item.upper:g}"
            )
