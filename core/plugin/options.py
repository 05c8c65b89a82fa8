"""The options of a strategy: what can be set on a command line, and the strategy with it set."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from femubench.core.errors import InputError
from femubench.core.roles import StrategyRole

SIMPLE = (bool, int, float, str, type(None))


class StatedOptions(ABC):
    """A strategy whose options are known and set without its code."""

    options: Mapping[str, Any]  # those that fit on a command line, with their present values
    open: tuple[str, ...]  # those that take further entries by name

    @property
    @abstractmethod
    def usual(self) -> Any:  # noqa: ANN401 - a strategy of the same kind
        """Return it with the options that it has by itself."""

    @abstractmethod
    def with_options(self, options: Mapping[str, object]) -> Any:  # noqa: ANN401 - likewise
        """Return it with other options; raises InputError for a value that it refuses."""


def options_of(strategy: object) -> dict[str, Any]:
    """Return the options that fit on a command line, with their present values."""
    if isinstance(strategy, StatedOptions):
        return dict(strategy.options)
    if not is_dataclass(strategy) or isinstance(strategy, type):
        return {}
    present = {field.name: getattr(strategy, field.name) for field in fields(strategy)}
    simple = {name: value for name, value in present.items() if isinstance(value, SIMPLE)}
    for name, value in present.items():
        inner = value if isinstance(value, Mapping) else options_of(value)
        simple |= {f"{name}.{k}": v for k, v in inner.items() if isinstance(v, SIMPLE)}
    return simple


def with_options(base: StrategyRole, options: Mapping[str, object]) -> StrategyRole:
    """Return a strategy with options set by their full names.

    Raises:
        InputError: for a value that it refuses.
    """
    if isinstance(base, StatedOptions):
        whole: Any = base
        found: StrategyRole = whole.with_options(options) if options else whole
        return found
    changed = base
    for key, value in options.items():
        try:
            changed = _with(changed, key, value)
        except (TypeError, ValueError) as error:
            raise InputError(f"strategy {base.name!r}: option {key}: {error}") from error
    return changed


def _with(holder: Any, key: str, value: object) -> Any:  # noqa: ANN401 - a strategy, or options of one
    """Return a copy with one option set, of the thing itself or of one of its options."""
    name, _, inner = key.partition(".")
    if isinstance(holder, Mapping):
        return {**holder, key: value}
    return replace(holder, **{name: _with(getattr(holder, name), inner, value) if inner else value})


def entry_of(strategy: object, key: str, missing: object) -> object:
    """Return the present entry of an option that maps names to numbers, else what is missing."""
    name, _, inner = key.partition(".")
    if isinstance(strategy, StatedOptions):
        return 0.0 if inner and name in strategy.open else missing
    holder = getattr(strategy, name, None) if is_dataclass(strategy) else None
    return float(holder.get(inner, 0.0)) if inner and isinstance(holder, Mapping) else missing
