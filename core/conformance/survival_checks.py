"""What a strategy must survive, one check a function: by a result or by an honest refusal."""

from __future__ import annotations

from femubench.core.conformance.kit import Bench, Verdict, check, not_applicable
from femubench.core.conformance.problems import PLAIN
from femubench.core.conformance.result_checks import (
    FREE,
    MASSLESS,
    MISSING,
    NOISE,
    PLANES,
    runs,
    survives,
)


@check(
    "strategy",
    "returns",
    "A plain case gives a result, or a refusal with its reason.",
    first=True,
    wants=lambda bench: runs(PLAIN),
)
def returns(bench: Bench) -> Verdict:
    """Run it on a grounded frame with complete data."""
    if isinstance(bench.code, str):
        return not_applicable("not looked at: it cannot be sent to a worker")
    return survives(bench, (PLAIN,))


@check(
    "strategy",
    "planes",
    "Frames in plane and in space give a result or a refusal.",
    wants=lambda bench: runs(*PLANES),
)
def planes(bench: Bench) -> Verdict:
    """Run it on the other kinds of frames."""
    return survives(bench, PLANES)


@check(
    "strategy",
    "free-structure",
    "A structure without supports, with singular K, is survived.",
    wants=lambda bench: runs(*FREE),
)
def free_structure(bench: Bench) -> Verdict:
    """Run it on free frames; the other frames are grounded."""
    return survives(bench, FREE)


@check(
    "strategy",
    "massless-dofs",
    "Degrees of freedom without mass are survived.",
    wants=lambda bench: runs(*MASSLESS),
)
def massless_dofs(bench: Bench) -> Verdict:
    """Run it on frames with springs at every member end."""
    return survives(bench, MASSLESS)


@check(
    "strategy",
    "missing-shapes",
    "Missing shape cells, sensors and whole shapes are survived.",
    wants=lambda bench: runs(*MISSING),
)
def missing_shapes(bench: Bench) -> Verdict:
    """Run it with cells missing, and with a mode that has a frequency alone."""
    return survives(bench, MISSING)


@check(
    "strategy", "one-mode", "One used mode is survived.", wants=lambda bench: runs("one used mode")
)
def one_mode(bench: Bench) -> Verdict:
    """Run it with the first mode alone."""
    return survives(bench, ("one used mode",))


@check(
    "strategy",
    "noise",
    "Draws of measurement noise are survived.",
    wants=lambda bench: runs(*NOISE),
)
def noise(bench: Bench) -> Verdict:
    """Run it on noisy data of a grounded and a free frame."""
    return survives(bench, NOISE)


@check(
    "strategy",
    "cases",
    "The cases given with --case give a result or a refusal.",
    wants=lambda bench: runs(*bench.cases),
)
def cases(bench: Bench) -> Verdict:
    """Run it on the user's cases."""
    if not bench.cases:
        return not_applicable("no --case was given")
    return survives(bench, tuple(bench.cases))
