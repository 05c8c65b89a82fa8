"""Strategies with other options than their default ones: ``NAME:OPTION=VALUE``.

Options of options have a dotted name: ``NAME:options.damping=0.01``, ``NAME:stiffness.ry=3e6``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from femubench.core.errors import InputError
from femubench.core.plugin.validation import did_you_mean
from femubench.core.update.strategy import Strategy, UpdateResult

if TYPE_CHECKING:
    import numpy as np

    from femubench.core.fem.model import Model
    from femubench.core.modal.measurement import Measurement

_SIMPLE = (bool, int, float, str, type(None))
_UNKNOWN = object()


@dataclass(frozen=True)
class Variant(Strategy):
    """A strategy under a name that tells its options.

    Arguments:
        base: the strategy with its options set.
        name: ``strategy:option=value,...``.
    """

    base: Strategy
    name: str  # type: ignore[misc]

    @property
    def citation(self) -> str:  # type: ignore[override]
        """Return that of the strategy."""
        return self.base.citation

    @property
    def needs(self) -> frozenset[str]:  # type: ignore[override]
        """Return those of the strategy."""
        return self.base.needs

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return what the strategy returns."""
        return self.base.update(model, measurement, rng)


def strategy_of(words: str, strategies: Mapping[str, Strategy]) -> Strategy:
    """Return a strategy by its name, with the options that follow a colon.

    Arguments:
        words: ``name`` or ``name:option=value,option=value``; the name is a known one.
        strategies: the known ones.

    Raises:
        InputError: for an option that the strategy does not have, or a value of another type.
    """
    name, _, listed = words.partition(":")
    base = strategies[name]
    if not listed:
        return base
    known = options_of(base)
    changed: Any = base
    for pair in listed.split(","):
        key, found, text = (part.strip() for part in pair.partition("="))
        present = known.get(key, _entry(base, key))
        if not found or present is _UNKNOWN:
            near = did_you_mean(key, known) or f"; there are {', '.join(known) or 'none'}"
            raise InputError(f"strategy {name!r} has no option {key!r}{near}")
        try:
            changed = _with(changed, key, _value(name, key, text, present))
        except (TypeError, ValueError) as error:
            raise InputError(f"strategy {words!r}: {error}") from error
    return Variant(changed, words)


def _with(holder: Any, key: str, value: object) -> Any:  # noqa: ANN401 - a strategy, or options of one
    """Return a copy with one option set, of the thing itself or of one of its options."""
    name, _, inner = key.partition(".")
    if isinstance(holder, Mapping):
        return {**holder, key: value}
    return replace(holder, **{name: _with(getattr(holder, name), inner, value) if inner else value})


def _entry(strategy: object, key: str) -> object:
    """Return the present entry of an option that maps names to numbers."""
    name, _, inner = key.partition(".")
    holder = getattr(strategy, name, None) if is_dataclass(strategy) else None
    return float(holder.get(inner, 0.0)) if inner and isinstance(holder, Mapping) else _UNKNOWN


def options_of(strategy: object) -> dict[str, Any]:
    """Return the options that fit on a command line, with their present values."""
    if not is_dataclass(strategy) or isinstance(strategy, type):
        return {}
    present = {field.name: getattr(strategy, field.name) for field in fields(strategy)}
    simple = {name: value for name, value in present.items() if isinstance(value, _SIMPLE)}
    for name, value in present.items():
        simple |= {f"{name}.{inner}": found for inner, found in options_of(value).items()}
    return simple


def _value(strategy: str, key: str, text: str, present: object) -> object:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    numeric = isinstance(present, float) and type(value) is int
    if present is None or type(value) is type(present) or numeric:
        return float(value) if numeric else value
    raise InputError(
        f"strategy {strategy!r}: option {key} is {text!r}", expected=type(present).__name__
    )
