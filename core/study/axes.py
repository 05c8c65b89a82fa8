"""The axes of a study, as its run keeps them: which job stands where."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from msgspec import Meta

from femubench.core.errors import InputError
from femubench.core.plugin.validation import did_you_mean
from femubench.core.schema.bounds import Name
from femubench.core.schema.records import to_plain
from femubench.core.schema.results import NOMINALS, Nominal, RunData
from femubench.core.schema.validation import read_plain

Value = bool | int | float | str | None
_NOISE, _LEFT_OUT = "noise", "sensors_left_out"
_FIXED = (_NOISE, _LEFT_OUT, "strategy", "case", "nominal")
_Factor = Annotated[float, Meta(gt=0, le=sys.float_info.max)]
_Number = Annotated[int, Meta(ge=0)]


@dataclass(frozen=True)
class CaseConditions:
    """A case under conditions.

    Arguments:
        noise: factor on the stated standard deviations.
    """

    case: Name
    noise: _Factor = 1.0
    sensors_left_out: _Number = 0


@dataclass(frozen=True)
class OptionSet:
    """A strategy with options.

    Arguments:
        options: those of the study's grid, by name.
    """

    strategy: Name
    options: Mapping[Name, Value] = field(default_factory=dict)


@dataclass(frozen=True)
class StudyAxes:
    """Where the jobs of a run stand.

    Arguments:
        cases: conditions by the name that a case has in the run.
        strategies: options by the name that a strategy has in the run.
        title: of the study, may be empty.
        heat_map: the axes of the picture; None for the first two that vary.
        nominals: the models that strategies start from.
    """

    cases: Mapping[Name, CaseConditions]
    strategies: Mapping[Name, OptionSet]
    title: Name = ""
    heat_map: tuple[Name, Name] | None = None
    nominals: tuple[Nominal, ...] = NOMINALS[1:]

    @classmethod
    def of(cls, run: RunData) -> StudyAxes:
        """Return the axes of a run; one of no study has case, strategy and nominal model.

        Raises:
            InputError: when what the run says of them is wrong.
        """
        found = cls.from_run(run) or cls({}, {})
        cases = [*(run.meta.get("cases") or ()), *(result.case for result in run.results)]
        names = [*run.meta.get("strategies", ()), *(result.strategy for result in run.results)]
        return cls(
            {name: found.cases.get(name, CaseConditions(name)) for name in dict.fromkeys(cases)},
            {name: found.strategies.get(name, OptionSet(name)) for name in dict.fromkeys(names)},
            found.title,
            found.heat_map,
            run.nominals,
        )

    @classmethod
    def from_run(cls, run: RunData) -> StudyAxes | None:
        """Return the axes that a study asked for; None for a run of no study.

        Raises:
            InputError: when what the run keeps of them is wrong.
        """
        request = run.meta.get("request")
        kept = request.get("study") if isinstance(request, Mapping) else None
        if kept is None:
            return None
        return read_plain(cls, kept, file=f"run {run.meta.get('run')}", key="request.study")

    @staticmethod
    def title_of(axis: str) -> str:
        """Return what an axis is, with its unit, for a drawing or a column."""
        known = {
            _NOISE: "noise, times the stated standard deviations",
            _LEFT_OUT: "sensors left out, number of them",
            "nominal": "nominal model",
        }
        base, dot, option = axis.partition(".")
        return known.get(axis, f"{option} of {base}" if dot else axis)

    @staticmethod
    def text_of(value: object) -> str:
        """Return a value of an axis as one would type it."""
        if isinstance(value, bool):
            return str(value).lower()
        return f"{value:.6g}" if isinstance(value, float) else str(value)

    def to_json(self) -> dict[str, Any]:
        """Return plain data for the run's `request`."""
        plain: dict[str, Any] = to_plain(self)
        return plain

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all axes, in the order in which one asks for them."""
        options = dict.fromkeys(
            f"{choice.strategy}.{name}"
            for choice in self.strategies.values()
            for name in choice.options
        )
        return (_NOISE, _LEFT_OUT, "strategy", *options, "case", "nominal")

    def values(self, axis: str) -> list[Value]:
        """Return the values along an axis, in the order of the study.

        Raises:
            InputError: when there is no such axis.
        """
        if axis not in self.names:
            near = did_you_mean(axis, self.names)
            expected = f"one of {', '.join(self.names)}"
            raise InputError(f"there is no axis {axis!r}{near}", expected=expected)
        first_case, first_strategy = next(iter(self.cases)), next(iter(self.strategies))
        places = [
            *(self.place(case, first_strategy, NOMINALS[0]) for case in self.cases),
            *(self.place(first_case, name, NOMINALS[0]) for name in self.strategies),
            *(self.place(first_case, first_strategy, nominal) for nominal in self.nominals),
        ]
        if axis == "nominal":
            places = places[-len(self.nominals) :]
        return list(dict.fromkeys(place[axis] for place in places if axis in place))

    @property
    def varied(self) -> tuple[str, ...]:
        """Return the axes with more than one value."""
        return tuple(name for name in self.names if len(self.values(name)) > 1)

    def place(self, case: str, strategy: str, nominal: Nominal) -> dict[str, Value]:
        """Return the values of all axes that a job has.

        Arguments:
            case, strategy, nominal: as in its result.
        """
        setting, choice = self.cases[case], self.strategies[strategy]
        options = {f"{choice.strategy}.{key}": value for key, value in choice.options.items()}
        return {
            _NOISE: setting.noise,
            _LEFT_OUT: setting.sensors_left_out,
            "strategy": choice.strategy,
            **options,
            "case": setting.case,
            "nominal": nominal,
        }

    @property
    def pictured(self) -> tuple[str, str]:
        """Return the axes of the heat map: as asked for, else the first two that vary."""
        if self.heat_map is not None:
            return self.heat_map
        x, y, *_ = [*self.varied, *(name for name in _FIXED if name not in self.varied)]
        return x, y
