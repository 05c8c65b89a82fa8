"""What a strategy must be, give, survive and leave alone."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Sequence
from functools import partial
from typing import Any

from femubench.core.child.limits import format_bytes
from femubench.core.conformance import kit
from femubench.core.conformance.fingerprints import first_difference
from femubench.core.conformance.kit import Bench, Verdict, check, fail_check, pass_check
from femubench.core.conformance.problems import CROSSED, GROUPED, PLAIN, PROBLEMS
from femubench.core.conformance.results import PROMISES
from femubench.core.conformance.trial import Observation, Want, promises_of
from femubench.core.plugin.variants import Variant
from femubench.core.roles import CAPABILITIES, StrategyRole, list_declared

_MUCH = 100.0  # times what the reference takes
_LEAST_SECONDS, _LEAST_BYTES = 1e-3, 1e4  # below which a ratio says nothing
_HONEST = "expected a result, or NotApplicable or StrategyFailure with a sentence"
_PLANES = ("grounded frame in plane", "grounded frame in space")
_FREE = ("free frame out of plane", "free frame in space")
_MISSING = ("some shape cells missing", "one mode without a shape")
_MASSLESS = ("joints without mass", "joints without mass, free")
_NOISE = tuple(name for name in PROBLEMS if " with noise, " in name)
# The problem without the feature that is looked at, where that is not the plain one.
_SIMPLER = {
    "free frame in space": "grounded frame in space",
    "joints without mass, free": "free frame out of plane",
    **{name: name.partition(" with noise, ")[0] for name in _NOISE},
}
# What every result must be, by the name of the look that each worker takes at it.
_RESULTS = {
    "sizes": "The matrices are sparse and as large as the model has dofs.",
    "finite": "The matrices hold finite real numbers.",
    "symmetric": "The matrices are symmetric.",
    "figures": "History, diagnostics and parameters hold finite numbers.",
    "parameter-count": "The number of unknowns is whole, and not 0 for another model.",
    "promises": "Every result keeps what the class attribute `promises` lists.",
}
# What must be left alone: the part of an observation that tells, and what is wrong with it.
_UNTOUCHED = {
    "inputs": (
        "Model and measurement stay as they were given.",
        "changed",
        "was changed in place, expected a copy",
    ),
    "global-state": (
        "Global state of the process is left as it was.",
        "disturbed",
        "changed, expected no trace",
    ),
}
# What must be survived, by a result or by an honest refusal, and on which problems.
_SURVIVED = {
    "planes": ("Frames in plane and in space give a result or a refusal.", _PLANES),
    "free-structure": ("A structure without supports, with singular K, is survived.", _FREE),
    "massless-dofs": ("Degrees of freedom without mass are survived.", _MASSLESS),
    "missing-shapes": ("Missing shape cells, sensors and whole shapes are survived.", _MISSING),
    "one-mode": ("One used mode is survived.", ("one used mode",)),
    "noise": ("Draws of measurement noise are survived.", _NOISE),
}


def _runs(names: Sequence[str]) -> Sequence[Want]:
    return [Want(name) for name in names]


def _wanted(_: Bench, names: Sequence[str]) -> Sequence[Want]:
    return _runs(names)


def _with_results(bench: Bench) -> Sequence[Want]:
    """Return the trials whose results every check of results looks at."""
    further = (CROSSED, "matrices alone", GROUPED, "one used mode", *bench.cases)
    return _runs((PLAIN, *_PLANES, *_FREE, *_MASSLESS, *_NOISE, *_MISSING, *further))


def _more(found: Sequence[Observation]) -> str:
    return f" (and on {len(found) - 1} more)" if len(found) > 1 else ""


def _survives(bench: Bench, names: Sequence[str]) -> Verdict:
    """Judge whether every problem gave a result or an honest refusal.

    What already fails without the feature that is looked at is no matter of that feature.
    """
    found = bench.observe(_runs(names))
    simpler = bench.observe(_runs([_SIMPLER.get(name, PLAIN) for name in names]))
    pairs = zip(names, found, simpler, strict=True)
    stated = [item for name, item, base in pairs if name == PLAIN or base.survived]
    if not stated:
        return kit.not_applicable(f"not looked at: {simpler[0].problem} fails already")
    lost = [item for item in stated if not item.survived]
    if lost:
        return fail_check(f"{lost[0].problem}: {lost[0].text}, {_HONEST}{_more(lost)}")
    if all(item.kind == "lacking" for item in stated):
        return kit.not_applicable(stated[0].text)
    refused = [item for item in stated if item.kind in ("not-applicable", "failed")]
    return pass_check(f"refused {refused[0].problem}: {refused[0].text}" if refused else "")


def _of_results(bench: Bench, name: str) -> Verdict:
    """Judge what the workers saw of every result."""
    if name == "promises" and not promises_of(bench.subject):
        return kit.not_applicable("nothing promised")
    found = [item for item in bench.observe(_with_results(bench)) if item.kind == "result"]
    if not found:
        return kit.not_applicable("there is no result to look at")
    wrong = [item for item in found if name in item.faults]
    if wrong:
        return fail_check(f"{wrong[0].problem}: {wrong[0].faults[name]}{_more(wrong)}")
    return pass_check()


for _name, _sentence in _RESULTS.items():
    check("strategy", _name, _sentence, wants=_with_results)(partial(_of_results, name=_name))


@kit.check_apart(
    "strategy",
    "described",
    "It has a citation and a docstring, and its promises are known.",
    first=True,
    code_alone=True,
)
def is_described(subject: StrategyRole) -> Verdict:
    """Look at citation, docstring and promises of a strategy."""
    strategy = subject.base if isinstance(subject, Variant) else subject
    if not str(strategy.citation).strip():
        return fail_check("citation is empty, expected author, year, title, equation")
    promises: object = list_declared(strategy, "promises")
    if not isinstance(promises, frozenset):
        return fail_check(f"promises is {promises!r}, expected a frozenset")
    unknown = sorted(str(name) for name in promises if name not in PROMISES)
    if unknown:
        return fail_check(f"promises {unknown[0]!r}, expected one of {', '.join(PROMISES)}")
    if not own_doc(type(strategy)):
        return kit.warn_of(
            f"class {type(strategy).__name__} has no docstring, expected what it does"
        )
    return pass_check()


@kit.check_apart(
    "strategy",
    "options-documented",
    "The docstring of the class names every option.",
    first=True,
    code_alone=True,
)
def names_options(subject: StrategyRole) -> Verdict:
    """Look for the fields of a strategy in its docstring and those of its bases."""
    strategy: Any = subject.base if isinstance(subject, Variant) else subject
    fields = dataclasses.fields(strategy) if dataclasses.is_dataclass(strategy) else ()
    if not fields:
        return kit.not_applicable("it has no options")
    text = " ".join(own_doc(base) for base in type(strategy).__mro__)
    names = [field.name for field in fields]
    missing = [name for name in names if not re.search(rf"\b{re.escape(name)}\b", text)]
    if missing:
        return fail_check(f"option {missing[0]!r} is not in the docstring, expected a line on it")
    return pass_check()


def own_doc(cls: type) -> str:
    """Return the docstring that somebody wrote: dataclasses make one of their signature."""
    text = cls.__dict__.get("__doc__") or ""
    return "" if text.startswith(f"{cls.__name__}(") else inspect.cleandoc(text)


@check(
    "strategy",
    "picklable",
    "It can be sent to a worker, and its result back.",
    first=True,
    wants=_with_results,
)
def picklable(bench: Bench) -> Verdict:
    """Pickle it, and look at how its results travelled."""
    sent = kit.picklable(bench, "a strategy")
    if sent.status != "pass":
        return sent
    return kit.not_applicable(bench.sound) if bench.sound else _of_results(bench, "picklable")


@check(
    "strategy",
    "deterministic",
    "Two runs with one seed agree to the last bit.",
    wants=lambda bench: _twice(),
)
def deterministic(bench: Bench) -> Verdict:
    """Run it twice, with other states of the global random generators."""
    found = bench.observe(_twice())
    for one, other in zip(found[::2], found[1::2], strict=True):
        if (one.kind, one.text) != (other.kind, other.text):
            seen = f"once {one.kind} {one.text!r}, once {other.kind} {other.text!r}"
            return fail_check(f"{one.problem}: {seen}, expected the same twice")
        path = first_difference(one.prints, other.prints)
        if path is not None:
            return fail_check(
                f"{one.problem}: {path} differs between two runs with one seed, expected equality "
                "to the last bit (randomness comes from `rng` alone)"
            )
    if all(item.kind == "lacking" for item in found):
        return kit.not_applicable(found[0].text)
    return pass_check()


def _twice() -> Sequence[Want]:
    names = (PLAIN, _FREE[0])
    return [Want(name, scramble=state) for name in names for state in (0, 1)]


def _untouched(bench: Bench, part: str, wrong: str) -> Verdict:
    """Judge what was seen of the surroundings before and after."""
    for item in bench.observe(_with_results(bench)):
        if getattr(item, part):
            return fail_check(f"{item.problem}: {getattr(item, part)} {wrong}")
    return pass_check()


for _name, (_sentence, _part, _wrong) in _UNTOUCHED.items():
    _judge = partial(_untouched, part=_part, wrong=_wrong)
    check("strategy", _name, _sentence, wants=_with_results)(_judge)


@check(
    "strategy",
    "capabilities",
    "Nothing is needed that `needs` does not list.",
    wants=lambda bench: [want for _, want in _withheld(bench)],
)
def capabilities(bench: Bench) -> Verdict:
    """Take away what it does not declare."""
    withheld = _withheld(bench)
    if not withheld:
        return kit.not_applicable("it needs everything that there is")
    plain, *found = bench.observe([Want(PLAIN), *(want for _, want in withheld)])
    for (capability, _), item in zip(withheld, found, strict=True):
        # Who refuses the plain frame as well does not refuse for what was taken away.
        refused = item.kind == "not-applicable" and plain.kind == "result"
        if refused or not item.survived:
            wanted = f"expected a result, or {capability!r} in needs"
            return fail_check(f"{item.problem}: {item.text}, {wanted}")
    return pass_check()


def _withheld(bench: Bench) -> list[tuple[str, Want]]:
    """Return what it does not declare, and a problem that does not have it."""
    needs = frozenset(list_declared(bench.subject, "needs"))
    frame = needs & {"elements", "geometry", "joints"}
    bare = GROUPED if "parts" in needs else "matrices alone"
    lacking = {"shapes": "no shapes at all", "elements": bare, "joints": "one member"}
    lacking["responses"] = "no responses"
    return [
        (capability, Want(lacking[capability]))
        for capability in CAPABILITIES
        if capability in lacking and capability not in needs
        and not (capability == "elements" and frame)
    ]  # fmt: skip


@check(
    "strategy",
    "resources",
    "Time and memory stay below 100 times those of the reference strategy.",
    wants=lambda bench: _measured(bench),
)
def resources(bench: Bench) -> Verdict:
    """Compare time and traced memory with those of the reference."""
    found = bench.observe(_measured(bench))
    if any(item.kind != "result" for item in found[:2]):
        return kit.not_applicable("there is no result on the plain case")
    seconds, peak = found[0].seconds, float(found[1].peak or 0)
    text = f"{seconds:.3g} s and {format_bytes(peak)}"
    if bench.reference is None or any(item.kind != "result" for item in found[2:]):
        return pass_check(text)
    slower = seconds / max(found[2].seconds, _LEAST_SECONDS)
    larger = peak / max(float(found[3].peak or 0), _LEAST_BYTES)
    text += f" on the {PLAIN}, {slower:.2g} and {larger:.2g} times those of {bench.reference.name}"
    if max(slower, larger) > _MUCH:
        return kit.warn_of(f"{text}, expected at most {_MUCH:g} times")
    return pass_check(text)


def _measured(bench: Bench) -> Sequence[Want]:
    own = [Want(PLAIN), Want(PLAIN, traced=True)]
    if bench.reference is None:
        return own
    return own + [dataclasses.replace(want, reference=True) for want in own]


@check(
    "strategy",
    "returns",
    "A plain case gives a result, or a refusal with its reason.",
    first=True,
    wants=lambda bench: _runs([PLAIN]),
)
def returns(bench: Bench) -> Verdict:
    """Run it on a grounded frame with complete data."""
    if isinstance(bench.code, str):
        return kit.not_applicable(kit.UNSENT)
    return _survives(bench, (PLAIN,))


for _name, (_sentence, _problems) in _SURVIVED.items():
    _judge, _wants = partial(_survives, names=_problems), partial(_wanted, names=_problems)
    check("strategy", _name, _sentence, wants=_wants)(_judge)


@check(
    "strategy",
    "cases",
    "The cases given with --case give a result or a refusal.",
    wants=lambda bench: _runs(tuple(bench.cases)),
)
def cases(bench: Bench) -> Verdict:
    """Run it on the user's cases."""
    if not bench.cases:
        return kit.not_applicable("no --case was given")
    return _survives(bench, tuple(bench.cases))
