"""Results and runs of one mode a block, with errors of so many percent of ln f."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from femubench.core.schema.records import to_plain
from femubench.core.schema.results import Block
from femubench.core.score.ranking import rank_results
from femubench.results import JobResult, PairedMode, Rule, RunData

HERTZ = {"used": 100.0, "higher": 200.0, "modified": 300.0}


def blocks(**percent: float) -> dict[str, Block]:
    """Return blocks whose modes are off by that much; modified ones lie above the given band."""
    found = {}
    for name, off in percent.items():
        change = "mass" if name == "modified" else None
        predicted = HERTZ[name] * math.exp(off / 100.0)
        mode = PairedMode(1 + list(HERTZ).index(name), HERTZ[name], predicted, 0.95, change)
        found[name] = Block(100.0 * abs(math.expm1(off / 100.0)), 0.95, (mode,))
    return found


def result(case: str = "a", strategy: str = "s", seed: int = 0, **more: Any) -> JobResult:
    """Return a result; `used`, `higher`, `modified` are its errors in percent, else it has none."""
    errors = {name: more.pop(name) for name in HERTZ if name in more}
    found = {"status": "ok", **more}
    return JobResult(case, strategy, seed, blocks=blocks(**errors), **found)


def meta(errors: Mapping[str, Mapping[str, float]], **more: Any) -> dict[str, Any]:
    """Return the meta data of a run whose textbook models have these errors.

    Arguments:
        errors: in percent by case and block.
        more: further entries; `drawn` has the errors of models as drawn.
    """
    drawn = more.pop("drawn", {})
    models: dict[str, Any] = {
        case: {"textbook": plain(blocks(**own))} for case, own in errors.items()
    }
    for case, own in drawn.items():
        models[case]["drawn"] = plain(blocks(**own))
    reference = {
        case: {name: block.rms_percent for name, block in blocks(**own).items()}
        for case, own in errors.items()
    }
    return {
        "seeds": [0], "seed": 5, "strategies": [], "yardstick": "textbook", "yardsticks": {},
        "rule": Rule().to_json(), "models": models, "reference": reference, **more,
    }  # fmt: skip


def plain(found: Mapping[str, Block]) -> dict[str, Any]:
    """Return blocks as the meta data of a run have them."""
    made: dict[str, Any] = to_plain(found)
    return made


def run(
    errors: Mapping[str, Mapping[str, float]], results: Iterable[JobResult], **more: Any
) -> RunData:
    """Return a ranked run."""
    stated = meta(errors, **more)
    return RunData(stated, rank_results(results, stated))
