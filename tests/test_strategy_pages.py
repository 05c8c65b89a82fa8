"""The page on the strategies: whose choices each one makes, and settings that it can take."""

from __future__ import annotations

import re
from pathlib import Path

from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.variants import strategy_of
from femubench.plugins.strategies import CLASSES

PAGE = Path(__file__).parents[1] / "docs" / "strategies.md"
ITEM = re.compile(r"^- `([a-z-]+)`\. (Authors':.+?)(?=^- |^$|\Z)", re.M | re.S)


def test_every_strategy_says_whose_its_choices_are() -> None:
    items = ITEM.findall(PAGE.read_text("utf-8"))
    assert sorted(name for name, _ in items) == sorted(CLASSES)
    for name, text in items:
        assert re.fullmatch(r"Authors': .+; ours: .+\.", " ".join(text.split())), name


def test_other_settings_are_settings_and_not_the_usual_ones() -> None:
    known = load_plugins().strategies
    for name in CLASSES:
        settings = getattr(known[name], "settings", ())
        variants = [strategy_of(f"{name}:{setting}", known) for setting in settings]
        different = [known[name], *(getattr(variant, "base", None) for variant in variants)]
        assert len(set(map(repr, different))) == len(different), name
