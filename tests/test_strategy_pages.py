"""The other settings that a strategy names: each is one, and not the usual one."""

from __future__ import annotations

from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.variants import strategy_of
from femubench.plugins.strategies import CLASSES


def test_other_settings_are_settings_and_not_the_usual_ones() -> None:
    known = load_plugins().strategies
    for name in CLASSES:
        settings = getattr(known[name], "settings", ())
        variants = [strategy_of(f"{name}:{setting}", known) for setting in settings]
        different = [known[name], *(getattr(variant, "base", None) for variant in variants)]
        assert len(set(map(repr, different))) == len(different), name
