"""What a diagnosis says, with its tables as data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from femubench.core.case.case import Case
from femubench.core.diagnosis.budget import Budget
from femubench.core.display import Shown
from femubench.core.fem.model import Model
from femubench.core.inference.examine import Examination
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import (
    Advice,
    BudgetLine,
    BudgetMode,
    Cause,
    DiagnosisReport,
    ErrorScale,
    Evidence,
    LocationRow,
    LookWarning,
    ResidualRow,
    Rival,
    Scatter,
    SmallestVisible,
)

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False, kw_only=True)
class Diagnosis(DiagnosisReport, Shown):
    """What is missing in a model, where, how sure, and what it gains.

    Arguments:
        extended: the model with the causes in it; the nominal one where none was named.
        subject: the case itself, for drawings of its structure.
        examination: every explanation that was tried; None where it was read from a file.
        drawing: its budget with the model of that; None where it has none, or was read from a file.
        case, verdict and all others: as in `DiagnosisReport`.
    """

    extended: Model = field(repr=False)
    subject: Case | None = field(default=None, repr=False)
    examination: Examination | None = field(default=None, repr=False, compare=False)
    drawing: Budget | None = field(default=None, repr=False, compare=False)

    def rows(self) -> Sequence[tuple[str, str]]:
        """Return verdict, causes, rivals and gain."""
        found = [
            (self.case, self.verdict),
            ("", self.sentence),
            *(("cause", f"{c.effect} at {c.place}, p = {c.probability:.2f}") for c in self.causes),
            *(
                ("rival", f"{r.effect} at {r.place}, p = {r.probability:.2f}")
                for r in self.rivals[: max(0, settings.of_a_kind - len(self.causes))]
            ),
        ]
        for name, pair in asdict(self.gain_rms).items():
            if isinstance(pair, tuple) and None not in pair:
                label = f"{name.replace('_percent', '')}, rms"
                found.append((label, f"{pair[0]:.2f} % -> {pair[1]:.2f} %"))
        return [*found, ("adequacy", f"p = {self.adequacy_p:.2g}")]

    def frame(self, table: str) -> pd.DataFrame:
        """Return one of the tables as a data frame.

        Arguments:
            table: ``causes``, ``rivals``, ``evidence``, ``model_error``, ``advice``,
                ``smallest_visible``, ``residuals``, ``scatter``, ``looks``, ``locations``,
                ``budget`` or ``budget_modes``.

        Raises:
            KeyError: when there is no such table.
        """
        import pandas as pd

        if table not in _TABLES:
            raise KeyError(f"no table {table!r}; there are {', '.join(_TABLES)}")
        columns = list(_TABLES[table].__annotations__)
        rows = _flat(getattr(self, table), columns)
        return pd.DataFrame(rows, columns=columns if table != "causes" else _CAUSE_COLUMNS)


_TABLES: dict[str, Any] = {
    "causes": Cause,
    "rivals": Rival,
    "evidence": Evidence,
    "model_error": ErrorScale,
    "advice": Advice,
    "smallest_visible": SmallestVisible,
    "residuals": ResidualRow,
    "scatter": Scatter,
    "looks": LookWarning,
    "locations": LocationRow,
    "budget": BudgetLine,
    "budget_modes": BudgetMode,
}
_CAUSE_COLUMNS = ["effect", "place", "probability", "parameter", "value", "std", "unit", "textbook"]


def _flat(rows: Sequence[Any], columns: Sequence[str]) -> list[dict[str, Any]]:
    """Return one mapping a row; a cause has one row a parameter."""
    result = []
    for row in rows:
        if isinstance(row, Cause):
            head = {"effect": row.effect, "place": row.place, "probability": row.probability}
            for p in row.parameters:
                own = {key: value for key, value in asdict(p).items() if key != "name"}
                result.append({**head, "parameter": p.name, **own})
        else:
            result.append({name: getattr(row, name) for name in columns})
    return result
