"""What a strategy must be and leave alone, one check a function."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Sequence
from typing import Any

from femubench.core.conformance.fingerprints import first_difference
from femubench.core.conformance.kit import (
    Bench,
    Verdict,
    Want,
    check,
    failed,
    not_applicable,
    passed,
    warned,
)
from femubench.core.conformance.problems import PLAIN
from femubench.core.conformance.result_checks import FREE, of_results, with_results
from femubench.core.conformance.results import PROMISES
from femubench.core.plugin.variants import Variant
from femubench.core.roles import CAPABILITIES, Strategy, declared
from femubench.core.run.limits import spoken_bytes

_MUCH = 100.0  # times what the reference takes
_LEAST_SECONDS, _LEAST_BYTES = 1e-3, 1e4  # below which a ratio says nothing


def _inner(bench: Bench) -> Strategy:
    subject: Strategy = bench.subject
    return subject.base if isinstance(subject, Variant) else subject


@check(
    "strategy",
    "described",
    "It has a citation and a docstring, and its promises are known.",
    first=True,
)
def described(bench: Bench) -> Verdict:
    """Look at citation, docstring and promises."""
    strategy = _inner(bench)
    if not str(strategy.citation).strip():
        return failed("citation is empty, expected author, year, title, equation")
    promises: object = declared(strategy, "promises")
    if not isinstance(promises, frozenset):
        return failed(f"promises is {promises!r}, expected a frozenset")
    unknown = sorted(str(name) for name in promises if name not in PROMISES)
    if unknown:
        return failed(f"promises {unknown[0]!r}, expected one of {', '.join(PROMISES)}")
    if not own_doc(type(strategy)):
        return warned(f"class {type(strategy).__name__} has no docstring, expected what it does")
    return passed()


@check(
    "strategy", "options-documented", "The docstring of the class names every option.", first=True
)
def options_documented(bench: Bench) -> Verdict:
    """Look for the fields of the dataclass in its docstring and those of its bases."""
    strategy: Any = _inner(bench)
    fields = dataclasses.fields(strategy) if dataclasses.is_dataclass(strategy) else ()
    if not fields:
        return not_applicable("it has no options")
    text = " ".join(own_doc(base) for base in type(strategy).__mro__)
    names = [field.name for field in fields]
    missing = [name for name in names if not re.search(rf"\b{re.escape(name)}\b", text)]
    if missing:
        return failed(f"option {missing[0]!r} is not in the docstring, expected a line on it")
    return passed()


def own_doc(cls: type) -> str:
    """Return the docstring that somebody wrote: dataclasses make one of their signature."""
    text = cls.__dict__.get("__doc__") or ""
    return "" if text.startswith(f"{cls.__name__}(") else inspect.cleandoc(text)


@check(
    "strategy",
    "picklable",
    "It can be sent to a worker, and its result back.",
    first=True,
    wants=with_results,
)
def picklable(bench: Bench) -> Verdict:
    """Pickle it, and look at how its results travelled."""
    if isinstance(bench.code, str):
        return failed(f"{bench.code}, expected a strategy that pickle can send")
    if bench.sound:
        return not_applicable(bench.sound)
    return of_results(bench, "picklable")


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
            return failed(f"{one.problem}: {seen}, expected the same twice")
        path = first_difference(one.prints, other.prints)
        if path is not None:
            return failed(
                f"{one.problem}: {path} differs between two runs with one seed, expected equality "
                "to the last bit (randomness comes from `rng` alone)"
            )
    if all(item.kind == "lacking" for item in found):
        return not_applicable(found[0].text)
    return passed()


def _twice() -> Sequence[Want]:
    names = (PLAIN, FREE[0])
    return [Want(name, scramble=state) for name in names for state in (0, 1)]


@check("strategy", "inputs", "Model and measurement stay as they were given.", wants=with_results)
def inputs(bench: Bench) -> Verdict:
    """Compare what it was given before and after."""
    found = bench.observe(with_results(bench))
    changed = [item for item in found if item.changed]
    if changed:
        first = changed[0]
        return failed(f"{first.problem}: {first.changed} was changed in place, expected a copy")
    return passed()


@check(
    "strategy",
    "global-state",
    "Global state of the process is left as it was.",
    wants=with_results,
)
def global_state(bench: Bench) -> Verdict:
    """Compare numpy's and Python's shared state before and after."""
    found = [item for item in bench.observe(with_results(bench)) if item.disturbed]
    if found:
        return failed(f"{found[0].problem}: {found[0].disturbed} changed, expected no trace")
    return passed()


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
        return not_applicable("it needs everything that there is")
    plain, *found = bench.observe([Want(PLAIN), *(want for _, want in withheld)])
    for (capability, _), item in zip(withheld, found, strict=True):
        # Who refuses the plain frame as well does not refuse for what was taken away.
        refused = item.kind == "not-applicable" and plain.kind == "result"
        if refused or not item.survived:
            wanted = f"expected a result, or {capability!r} in needs"
            return failed(f"{item.problem}: {item.text}, {wanted}")
    return passed()


def _withheld(bench: Bench) -> list[tuple[str, Want]]:
    """Return what it does not declare, and a problem that does not have it."""
    needs = frozenset(declared(bench.subject, "needs"))
    frame = needs & {"elements", "geometry", "joints"}
    lacking = {"shapes": "no shapes at all", "elements": "matrices alone", "joints": "one member"}
    return [
        (capability, Want(lacking[capability]))
        for capability in CAPABILITIES
        if capability in lacking and capability not in needs
        and not (capability == "elements" and frame)
    ]  # fmt: skip


@check(
    "strategy",
    "resources",
    "Time and memory stay below 100 times those of the yardstick strategy.",
    wants=lambda bench: _measured(bench),
)
def resources(bench: Bench) -> Verdict:
    """Compare time and traced memory with those of the reference."""
    found = bench.observe(_measured(bench))
    if any(item.kind != "result" for item in found[:2]):
        return not_applicable("there is no result on the plain case")
    seconds, peak = found[0].seconds, float(found[1].peak or 0)
    text = f"{seconds:.3g} s and {spoken_bytes(peak)}"
    if bench.reference is None or any(item.kind != "result" for item in found[2:]):
        return passed(text)
    slower = seconds / max(found[2].seconds, _LEAST_SECONDS)
    larger = peak / max(float(found[3].peak or 0), _LEAST_BYTES)
    text += f" on the {PLAIN}, {slower:.2g} and {larger:.2g} times those of {bench.reference.name}"
    if max(slower, larger) > _MUCH:
        return warned(f"{text}, expected at most {_MUCH:g} times")
    return passed(text)


def _measured(bench: Bench) -> Sequence[Want]:
    own = [Want(PLAIN), Want(PLAIN, traced=True)]
    if bench.reference is None:
        return own
    return own + [dataclasses.replace(want, reference=True) for want in own]
