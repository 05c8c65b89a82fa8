"""What a diagnosis says: verdict, causes, rivals, residuals, gain; plain data with data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal

from femubench.core.model import Model

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["named", "none", "unknown", "ambiguous", "not-confirmed"]


@dataclass(frozen=True)
class CauseParameter:
    """A parameter of a cause.

    Arguments:
        std: standard deviation; None where the value is a textbook one that was not fitted.
        textbook: whether the value was taken from the textbook.
    """

    name: str
    value: float
    std: float | None
    unit: str
    textbook: bool = False


@dataclass(frozen=True)
class Cause:
    """An effect at a place, with what it takes; `summary` says it as a clause."""

    effect: str
    place: str
    parameters: tuple[CauseParameter, ...]
    probability: float
    summary: str = ""


@dataclass(frozen=True)
class Rival:
    """Another explanation.

    Arguments:
        effect: slug, or ``a + b`` for a pair; place likewise.
        delta_chi2: by how much it lowers chi-square.
        probability: of this effect at this place.
        angle: between its sensitivity subspace and the winner's in degrees; nan where unknown.
    """

    effect: str
    place: str
    delta_chi2: float
    probability: float
    angle: float = float("nan")


@dataclass(frozen=True)
class Advice:
    """A measurement that one could make, and the distance in squared sigmas (d2) it creates."""

    measurement: str
    separation: float


@dataclass(frozen=True)
class SmallestVisible:
    """The smallest size of an effect, at its best place, that these data would have shown."""

    effect: str
    place: str
    size: float
    unit: str


@dataclass(frozen=True)
class ResidualRow:
    """One datum before and after, in standard deviations of the measurement.

    Arguments:
        kind: ``frequency``, ``shape`` or ``mass``.
        mode: label of the measured mode; None for the mass.
        sensor: its label for a shape, else empty.
        measured: in Hz, kg or the unit of the shape.
        before, after: (measured - predicted) / sigma; None where no predicted mode pairs.
    """

    kind: str
    mode: int | None
    sensor: str
    measured: float
    before: float | None
    after: float | None


@dataclass(frozen=True)
class LookWarning:
    """Something that a plain look at the model finds, before any fit.

    Arguments:
        what: one sentence.
        where: member, section or ``all``.
        effect: slug of the effect that would mend it; empty where there is none.
        changes: from the model's elastic mode number (from 1) to the change of its frequency in
            percent, were it mended.
    """

    what: str
    where: str
    effect: str
    changes: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class LocationRow:
    """An indicator of where the error sits, scaled to 1 at its largest.

    Arguments:
        indicator: ``evidence``, ``force-residual``, ``energy-error``, ``ecomac``, ...
        place: member, ``member/k``, joint or sensor label.
    """

    indicator: str
    place: str
    value: float


@dataclass(frozen=True)
class Gain:
    """Medians of absolute frequency errors over paired modes in percent, before and after.

    Arguments:
        held_out, modified: None where the case holds none back.
        cross_validated: the same over modes left out in turn, where nothing is held out.
    """

    used_percent: tuple[float, float]
    held_out_percent: tuple[float, float] | None = None
    modified_percent: tuple[float, float] | None = None
    cross_validated_percent: tuple[float, float] | None = None


@dataclass(frozen=True)
class Diagnosis:
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
        gain: before and after.
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

    def frame(self, table: str) -> pd.DataFrame:
        """Return one of the tables as a data frame.

        Arguments:
            table: ``causes``, ``rivals``, ``advice``, ``smallest_visible``, ``residuals``,
                ``looks`` or ``locations``.

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
    "advice": Advice,
    "smallest_visible": SmallestVisible,
    "residuals": ResidualRow,
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
