"""What a diagnosis says, with its tables as data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

from femubench.core.case.case import Case
from femubench.core.display import Shown
from femubench.core.fem.model import Model
from femubench.core.inference.examine import Examination
from femubench.core.inference.settings import settings
from femubench.core.schema.diagnosis import (
    Advice,
    Cause,
    ErrorScale,
    Evidence,
    Gain,
    LocationRow,
    LookWarning,
    ResidualRow,
    Rival,
    Scatter,
    SmallestVisible,
    Verdict,
)

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """What is missing in a model, where, how sure, and what it gains.

    Arguments:
        case: name of the case.
        verdict: see the case for each in docs/diagnosis.md.
        sentence: the verdict in one sentence.
        causes: named effects; with ``ambiguous`` the members of the inseparable group, with
            ``unknown`` and ``not-confirmed`` a best guess, with ``none`` nothing.
        rivals: every other explanation worth a look, most probable first.
        reason: why the members of a group cannot be told apart; empty without a group.
        advice: measurements that would separate them, best first.
        smallest_visible: one row an effect.
        residuals: every datum.
        gain: medians before and after.
        gain_rms: the same as root mean squares, as `bench run` has them; None in older files.
        chi2: before and after, in the metric of the noise model.
        data_count: number of data behind chi2.
        adequacy_p: probability of a chi-square as large as the one after.
        nothing: probability that the model lacks nothing.
        looks: what the plain look found.
        locations: where the error sits.
        base: textbook effects that the names rest on, as ``effect`` slugs.
        extended: the model with the causes in it; the nominal one where none was named.
        notes: further remarks, one sentence each.
        seconds: spent.
        evidence: what the data say for the first explanation, and what the prior adds.
        model_error: what the drawing gets wrong, beside the first explanation; empty where the
            structure is taken for a beam model.
        like_a_beam: probability that it is one, but for ordinary scatter.
        subject: the case itself, for drawings of its structure.
        scatter: whether what is left is as much as the stated deviations let expect.
        examination: every explanation that was tried; None where it was read from a file.
    """

    case: str
    verdict: Verdict
    sentence: str
    causes: tuple[Cause, ...]
    rivals: tuple[Rival, ...]
    reason: str
    advice: tuple[Advice, ...]
    smallest_visible: tuple[SmallestVisible, ...]
    residuals: tuple[ResidualRow, ...]
    gain: Gain
    chi2: tuple[float, float]
    data_count: int
    adequacy_p: float
    nothing: float
    looks: tuple[LookWarning, ...]
    locations: tuple[LocationRow, ...]
    base: tuple[str, ...]
    extended: Model = field(repr=False)
    notes: tuple[str, ...] = ()
    seconds: float = 0.0
    evidence: tuple[Evidence, ...] = ()
    model_error: tuple[ErrorScale, ...] = ()
    like_a_beam: float = 1.0
    gain_rms: Gain | None = None
    scatter: tuple[Scatter, ...] = ()
    subject: Case | None = field(default=None, repr=False)
    examination: Examination | None = field(default=None, repr=False, compare=False)

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
        for name, pair in asdict(self.gain_rms or self.gain).items():
            if isinstance(pair, tuple) and None not in pair:
                measure = "median" if self.gain_rms is None else "rms"
                label = f"{name.replace('_percent', '')}, {measure}"
                found.append((label, f"{pair[0]:.2f} % -> {pair[1]:.2f} %"))
        return [*found, ("adequacy", f"p = {self.adequacy_p:.2g}")]

    def frame(self, table: str) -> pd.DataFrame:
        """Return one of the tables as a data frame.

        Arguments:
            table: ``causes``, ``rivals``, ``evidence``, ``model_error``, ``advice``,
                ``smallest_visible``, ``residuals``, ``scatter``, ``looks`` or ``locations``.

        Raises:
            KeyError: when there is no such table.
        """
        import pandas as pd

        if table not in _TABLES:
            raise KeyError(f"no table {table!r}; there are {', '.join(_TABLES)}")
        columns = [f.name for f in fields(_TABLES[table])]
        rows = _flat(getattr(self, table))
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
}
_CAUSE_COLUMNS = ["effect", "place", "probability", "parameter", "value", "std", "unit", "textbook"]


def _flat(rows: Sequence[Any]) -> list[dict[str, Any]]:
    """Return one mapping a row; a cause has one row a parameter."""
    result = []
    for row in rows:
        if isinstance(row, Cause):
            head = {"effect": row.effect, "place": row.place, "probability": row.probability}
            for p in row.parameters:
                own = {key: value for key, value in asdict(p).items() if key != "name"}
                result.append({**head, "parameter": p.name, **own})
        else:
            result.append({f.name: getattr(row, f.name) for f in fields(row)})
    return result
