"""What differs between a run and its repetition, and between a job and itself run again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from femubench.core.schema.records import result_to_json
from femubench.core.schema.results import JobResult, Nominal, RunData, origins_of

# What belongs to a run, or to the past, rather than to a result.
_VOLATILE = frozenset({"seconds", "rank", "gain", "key", "provenance", "traceback", "unphysical"})
# Figures of a result that depend on nothing but its provenance.
_COUNTS = (
    *("rigid_body_modes", "rigid_body_modes_expected", "negative_eigenvalues"),
    *("parameter_count", "evaluations"),
)
_MODEL = ("rigid_body_modes", "negative_eigenvalues", "parameter_count")


def environment_differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return what is not the same in the meta data of two runs, a line each.

    Arguments:
        old, new: `Run.meta`.
    """
    then, now = _environment(old), _environment(new)
    return [
        f"{name}: {then.get(name, 'nothing')} then, {now.get(name, 'nothing')} now"
        for name in dict.fromkeys((*then, *now))
        if then.get(name) != now.get(name)
    ]


def result_differences(old: RunData, new: RunData) -> list[str]:
    """Return which results are not the same to the last bit, a line each.

    Times and ranks are left out: they do not belong to a result.
    """
    before, after = _by_job(old), _by_job(new)
    both = len(old.nominals) > 1
    lines = []
    for job in sorted(before.keys() | after.keys(), key=str):
        start = " as drawn" if both and job[3] == "drawn" else ""
        name = f"{job[0]}{start}, {job[1]}, seed {job[2]}"
        if job not in after:
            lines.append(f"{name}: not run now")
        elif job not in before:
            lines.append(f"{name}: not run then")
        else:
            lines += [f"{name}: {what}" for what in _differences(before[job], after[job])]
    return lines


def unsteady(run: RunData) -> dict[str, str]:
    """Return what differs, by strategy, where a job was run twice in a run.

    It got the same data and the same random numbers, so that its answer must be the same to the
    last bit. Time limits and crashes say something of the machine, and do not count.

    Examples:
        >>> results.unsteady(run)
        {}
    """
    origins = origins_of(run.meta, "again")
    first = _by_job(run) if origins else {}
    found: dict[str, str] = {}
    for item in run.companions:
        origin = origins.get(item.case)
        known = first.get((origin or "", item.strategy, item.seed, item.nominal))
        if known is None or item.strategy in found:
            continue
        what = _answers_differ(known, item)
        if what:
            found[item.strategy] = f"{origin}: {what}"
    return found


def _answers_differ(one: JobResult, other: JobResult) -> str:
    """Return in what two answers differ; nothing where they are the same to the last bit."""
    if {"timeout", "crashed"} & {one.status, other.status}:
        return ""
    if one.status != other.status:
        return f"{one.status}, then {other.status}"
    if _stable(one)["parameters"] != _stable(other)["parameters"]:
        return "other parameters"
    for name in ("used", "higher", "modified"):
        if _stable(one)[name] != _stable(other)[name]:
            return f"another model: {name} modes at other frequencies"
    parts = [name for name in _MODEL if getattr(one, name) != getattr(other, name)]
    return f"other {parts[0].replace('_', ' ')}" if parts else ""


def _by_job(run: RunData) -> dict[tuple[str, str, int, Nominal], JobResult]:
    return {(item.case, item.strategy, item.seed, item.nominal): item for item in run.results}


def _environment(meta: Mapping[str, Any]) -> dict[str, Any]:
    machine, cases = meta.get("machine") or {}, meta.get("cases") or {}
    return {
        **(meta.get("versions") or {}),
        "platform": machine.get("platform"),
        "cpu": machine.get("cpu"),
        "blas": machine.get("blas"),
        "git commit": meta.get("git_commit"),
        **{f"case {name}": str(item.get("digest"))[:12] for name, item in cases.items()},
    }


def _differences(old: JobResult, new: JobResult) -> Iterator[str]:
    if old.provenance.get("strategy") != new.provenance.get("strategy"):
        versions = (item.provenance.get("strategy") for item in (old, new))
        yield "version of the strategy: {} then, {} now".format(*versions)
    if old.status != new.status:
        yield f"{old.status} then, {new.status} now"
        return
    stated = set()
    for block in dict.fromkeys((*old.blocks, *new.blocks)):
        first, second = (
            item.blocks[block].rms_percent if block in item.blocks else None for item in (old, new)
        )
        if first != second:
            stated.add(block)
            yield f"{block} rms {first} % then, {second} % now"
    for name in _COUNTS:
        if getattr(old, name) != getattr(new, name):
            stated.add(name)
            yield f"{name} {getattr(old, name)} then, {getattr(new, name)} now"
    before, after = _stable(old), _stable(new)
    parts = [name for name in before if before[name] != after.get(name) and name not in stated]
    if parts:
        yield f"differs in {', '.join(parts)}"


def _stable(result: JobResult) -> dict[str, Any]:
    """Return all of a result that should be the same again, in plain data."""
    return {name: value for name, value in result_to_json(result).items() if name not in _VOLATILE}
