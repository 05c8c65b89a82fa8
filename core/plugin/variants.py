"""Strategies with other options than their default ones: ``NAME:OPTION=VALUE``.

Options of options have a dotted name: ``NAME:options.damping=0.01``, ``NAME:stiffness.ry=3e6``;
where only one option ends in a name, that name will do: ``NAME:damping=0.01``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, is_dataclass
from typing import Any, cast

from femubench.core.errors import InputError
from femubench.core.plugin.options import SIMPLE, StatedOptions, entry_of, options_of, with_options
from femubench.core.plugin.validation import did_you_mean
from femubench.core.roles import StrategyRole, list_declared

_UNKNOWN = object()


@dataclass(frozen=True)
class Variant:
    """A strategy under a name that tells its options.

    Arguments:
        name: ``strategy:option=value,...``.
    """

    base: StrategyRole
    name: str

    @property
    def citation(self) -> str:
        """Return that of the strategy."""
        return self.base.citation

    @property
    def needs(self) -> frozenset[str]:
        """Return those of the strategy."""
        return list_declared(self.base, "needs")

    @property
    def promises(self) -> frozenset[str]:
        """Return those of the strategy."""
        return list_declared(self.base, "promises")

    def update(self, model: Any, measurement: Any, rng: Any) -> Any:  # noqa: ANN401
        """Return what the strategy returns, mostly an `UpdateResult`."""
        return self.base.update(model, measurement, rng)

    def __call__(self, **options: object) -> Variant:
        """Return the strategy with other options, under a name that tells them.

        Arguments:
            options: by name; dotted names as ``**{"options.damping": 0.01}``.

        Raises:
            InputError: for an option that it does not have, or a value of another type.
        """
        return label_variant(_changed(self.base, options), self.base)


def strategy_of(words: str, strategies: Mapping[str, StrategyRole]) -> StrategyRole:
    """Return a strategy by its name, with the options that follow a colon.

    Arguments:
        words: ``name`` or ``name:option=value,option=value``; the name is a known one.

    Raises:
        InputError: for an option that the strategy does not have, or a value of another type.
    """
    name, _, listed = words.partition(":")
    base = strategies[name]
    if not listed:
        return base
    pairs = [pair.partition("=") for pair in listed.split(",")]
    for key, found, _ in pairs:
        if not found:
            raise _no_option(name, key.strip(), options_of(base))
    return Variant(_changed(base, {key.strip(): _Typed(text) for key, _, text in pairs}), words)


def label_variant(strategy: StrategyRole, default: StrategyRole | None = None) -> Variant:
    """Return a strategy under its name and the options that are not the default ones.

    Arguments:
        default: the same with default options; None for what its class makes without arguments.
    """
    if default is None and isinstance(strategy, StatedOptions):
        default = strategy.usual
    if default is None:
        try:
            default = type(strategy)()
        except TypeError:  # it has none
            default = strategy
    usual, present = _settings(default), _settings(strategy)
    changed = {key: value for key, value in present.items() if usual.get(key, _UNKNOWN) != value}
    words = [
        f"{_shortest(key, usual)}={str(value).lower() if isinstance(value, bool) else str(value)}"
        for key, value in changed.items()
    ]
    return Variant(strategy, strategy.name + (f":{','.join(words)}" if words else ""))


def _settings(strategy: StrategyRole) -> dict[str, Any]:
    """Return options, or where they are none of a dataclass the attributes of an instance."""
    own = getattr(strategy, "__dict__", {}) if not is_dataclass(strategy) else {}
    return options_of(strategy) or {
        key: value
        for key, value in own.items()
        if isinstance(value, SIMPLE) and key[:1] != "_" and key not in ("name", "citation")
    }


class _Typed(str):
    """An option as it was typed, not yet a value."""


def _changed(base: StrategyRole, options: Mapping[str, object]) -> StrategyRole:
    """Return a strategy with options set by name.

    Raises:
        InputError: for an option that it does not have, or a value of another type.
    """
    known = options_of(base)
    wanted: dict[str, object] = {}
    for name, given in options.items():
        ends = [key for key in known if key.endswith(f".{name}")]
        if name in known or not ends:
            key = name
        else:
            if len(ends) > 1:
                raise InputError(f"strategy {base.name!r}: option {name!r} is {' or '.join(ends)}")
            key = ends[0]
        present = known.get(key, entry_of(base, key, _UNKNOWN))
        if present is _UNKNOWN:
            raise _no_option(base.name, name, known)
        wanted[key] = _value(base.name, key, given, present)
    return with_options(base, wanted)


def _no_option(strategy: str, key: str, known: Mapping[str, object]) -> InputError:
    words = dict.fromkeys([*known, *(name.rpartition(".")[2] for name in known)])
    near = did_you_mean(key, words) or f"; there are {', '.join(known) or 'none'}"
    return InputError(f"strategy {strategy!r} has no option {key!r}{near}")


def _shortest(key: str, known: Iterable[str]) -> str:
    """Return the last part of a dotted name where it stands for no other option."""
    last = key.rpartition(".")[2]
    found = [other for other in known if other == last or other.endswith(f".{last}")]
    return last if found == [key] else key


def _value(strategy: str, key: str, given: object, present: object) -> object:
    """Return a value of the type of the present one, from a text where it was typed."""
    value = given
    if isinstance(given, _Typed):
        value = text = given.strip()
        with suppress(tomllib.TOMLDecodeError):
            value = tomllib.loads(f"value = {text}")["value"]
    numeric = isinstance(present, float) and type(value) is int
    if present is None or type(value) is type(present) or numeric:
        return float(cast("int", value)) if numeric else value
    raise InputError(
        f"strategy {strategy!r}: option {key} is {str(given)!r}", expected=type(present).__name__
    )
