"""What a call costs: seconds of processor, which a busy machine changes least, and memory."""

from __future__ import annotations

import resource
from collections.abc import Callable
from typing import Any


def processor() -> float:
    """Return seconds of processor that this process and its ended children have used."""
    return sum(
        sum(resource.getrusage(whose)[:2])
        for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )


def peak() -> float:
    """Return the largest resident memory of this process so far, in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def timed(function: Callable[..., Any], *arguments: Any) -> dict[str, Any]:  # noqa: ANN401 - of any function
    """Return seconds and added memory of a call, and what it returned."""
    memory, start = peak(), processor()
    answer = function(*arguments)
    return {"seconds": processor() - start, "added_mb": peak() - memory, "answer": answer}


def least(function: Callable[[], object], repeats: int = 3) -> float:
    """Return the least seconds of a few calls."""
    return min(float(timed(function)["seconds"]) for _ in range(repeats))
