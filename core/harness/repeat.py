"""What differs between a run and its repetition."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from femubench.core.harness.results import JobResult, Run

# Figures of a result that depend on nothing but its provenance.
_COUNTS = (
    *("rigid_body_modes", "rigid_body_modes_expected", "negative_eigenvalues"),
    *("parameter_count", "evaluations"),
)


def environment_differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return what is not the same in the meta data of two runs, a line each.

    Arguments:
        old, new: `Run.meta`.
    """
    return [
        f"{name}: {before} then, {after} now"
        for name, before, after in _pairs(_environment(old), _environment(new))
    ]


def result_differences(old: Run, new: Run) -> list[str]:
    """Return which results are not the same to the last bit, a line each.

    Times and ranks are left out: they do not belong to a result.
    """
    before, after = _by_job(old), _by_job(new)
    lines = []
    for job in sorted(before.keys() | after.keys(), key=str):
        name = f"{job[0]}, {job[1]}, seed {job[2]}"
        if job not in after:
            lines.append(f"{name}: not run now")
        elif job not in before:
            lines.append(f"{name}: not run then")
        else:
            lines += [f"{name}: {what}" for what in _differences(before[job], after[job])]
    return lines


def _by_job(run: Run) -> dict[tuple[str, str, int], JobResult]:
    return {(item.case, item.strategy, item.seed): item for item in run.results}


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


def _pairs(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, object, object]]:
    for name in dict.fromkeys((*old, *new)):
        if old.get(name) != new.get(name):
            yield name, old.get(name, "nothing"), new.get(name, "nothing")


def _differences(old: JobResult, new: JobResult) -> Iterator[str]:
    if old.provenance.get("strategy") != new.provenance.get("strategy"):
        versions = (item.provenance.get("strategy") for item in (old, new))
        yield "version of the strategy: {} then, {} now".format(*versions)
    if old.status != new.status:
        yield f"{old.status} then, {new.status} now"
        return
    for block in dict.fromkeys((*old.blocks, *new.blocks)):
        first, second = (
            item.blocks[block].rms_percent if block in item.blocks else None for item in (old, new)
        )
        if first != second:
            yield f"{block} rms {first} % then, {second} % now"
    for name in _COUNTS:
        if getattr(old, name) != getattr(new, name):
            yield f"{name} {getattr(old, name)} then, {getattr(new, name)} now"
    if old.parameters != new.parameters and str(old.parameters) != str(new.parameters):
        yield "other parameter values"
