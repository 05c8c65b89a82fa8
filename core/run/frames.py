"""Results as data frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import to_builtins

from femubench.core.schema.results import BLOCKS, RunData
from femubench.core.score.scoring import frequency_error
from femubench.core.study.axes import StudyAxes

if TYPE_CHECKING:
    import pandas as pd


def results_frame(run: RunData) -> pd.DataFrame:
    """Return one row a job: status, errors by block, counts, gain and rank; see `Run.table`."""
    import pandas as pd

    rows, study = [], StudyAxes.of(run) if StudyAxes.from_run(run) is not None else None
    for result in run.results:
        row = {name: getattr(result, name) for name in (*_JOB, *_COUNTS)}
        for name, block in result.blocks.items():
            row |= {f"{name}_percent": block.rms_percent, f"{name}_mac": block.mean_mac}
        if (seen := result.responses) is not None:
            row |= dict(zip(_RESPONSES, (seen.rms_db, seen.floor_db, seen.phase_deg), strict=True))
        if study is not None:
            place = study.place(result.case, result.strategy, result.nominal)
            row |= {_PLAIN.get(name, name): value for name, value in place.items()}
        rows.append(row)
    own = [] if study is None else [_PLAIN.get(name, name) for name in study.names]
    axes = [name for name in own if name not in _JOB]
    frame = pd.DataFrame(rows, columns=[*_JOB, *axes, *_ERRORS, *_COUNTS])
    whole = {name: "Int64" for name in _COUNTS if name not in ("unphysical", "gain")}
    return frame.astype({**whole, **dict.fromkeys(_FLOATS, "float64")})


def modes_frame(run: RunData) -> pd.DataFrame:
    """Return one row a measured mode of every job that is ok; see `Run.modes`."""
    import pandas as pd

    rows = [
        {
            "case": result.case,
            "strategy": result.strategy,
            "seed": result.seed,
            "nominal": result.nominal,
            "block": name,
            **to_builtins(mode),
            "error_percent": None
            if mode.predicted_hz is None or mode.predicted_hz <= 0.0
            else 100.0 * (mode.predicted_hz / mode.measured_hz - 1.0),
            "counted_percent": 100.0 * frequency_error(mode),
        }
        for result in run.results
        for name, block in result.blocks.items()
        for mode in block.modes
    ]
    floats = (
        *("measured_hz", "predicted_hz", "error_percent", "counted_percent", "mac"),
        "predicted_std_hz",
    )
    names = ("case", "strategy", "seed", "nominal", "block", "modification", "mode", *floats)
    return pd.DataFrame(rows, columns=list(names)).astype(dict.fromkeys(floats, "float64"))


_JOB = ("case", "strategy", "seed", "nominal", "status", "reason", "seconds")
_PLAIN = {"case": "plain_case", "strategy": "plain_strategy"}  # without conditions and options
_COUNTS = (
    *("rigid_body_modes", "rigid_body_modes_expected", "negative_eigenvalues", "unphysical"),
    *("parameter_count", "evaluations", "gain", "rank"),
)
_RESPONSES = ("responses_db", "responses_floor_db", "responses_deg")
_ERRORS = (*(f"{name}_{what}" for name in BLOCKS for what in ("percent", "mac")), *_RESPONSES)
_FLOATS = ("seconds", *_ERRORS, "gain")
