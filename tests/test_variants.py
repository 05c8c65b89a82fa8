"""Strategies with other options, chosen by name."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from femubench import InputError, Strategy
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.variants import Variant, strategy_of
from femubench.plugins.strategies.generic import GenericLS
from femubench.plugins.strategies.spring import Spring
from femubench.plugins.strategies.unchanged import Unchanged

KNOWN: dict[str, Strategy] = {s.name: s for s in (GenericLS(), Spring(), Unchanged())}


def test_options_are_set_and_known_by_the_name() -> None:
    words = "generic-ls:orthogonality=false, plain=full"
    found = strategy_of(words, KNOWN)
    assert isinstance(found, Variant)
    assert found.base == GenericLS(orthogonality=False, plain="full")
    assert (found.name, found.citation, found.needs) == (words, GenericLS.citation, GenericLS.needs)
    assert pickle.loads(pickle.dumps(found)) == found


def test_an_option_without_a_value_yet_takes_any_and_numbers_become_floats() -> None:
    found = strategy_of("spring:arm=0.02,arm_factor=7", KNOWN)
    assert isinstance(found, Variant)
    assert found.base == Spring(arm=0.02, arm_factor=7.0)


def test_options_of_options_have_dotted_names() -> None:
    words = "spring:options.damping=0.01,stiffness.ry=3.02e6,stiffness.x=3300000000"
    found = strategy_of(words, KNOWN)
    assert isinstance(found, Variant)
    nominal = Spring()
    assert found.base == replace(
        nominal,
        options=replace(nominal.options, damping=0.01),
        stiffness={"ry": 3.02e6, "x": 3.3e9},
    )
    assert nominal.stiffness == {}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("spring:options.dampin=1", "no option 'options.dampin'; did you mean 'options.damping'"),
        ("spring:stiffness.ry=soft", r"option stiffness.ry is 'soft' \(expected float\)"),
        ("spring:options.weighting=heavy", "weighting 'heavy' is neither"),
        ("generic-ls:orthogonalty=false", "no option 'orthogonalty'; did you mean 'orthogonality'"),
        ("generic-ls:orthogonality", "no option|orthogonality"),
        ("generic-ls:orthogonality=7", r"option orthogonality is '7' \(expected bool\)"),
        ("unchanged:x=1", "no option 'x'; there are none"),
        ("spring:options=1", "no option 'options'"),
    ],
)
def test_a_wrong_option_is_one_line(words: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        strategy_of(words, KNOWN)
    assert "\n" not in str(caught.value)


def test_other_settings_that_a_strategy_names_are_settings_and_not_the_usual_ones() -> None:
    known = load_plugins().strategies
    for name, usual in known.items():
        variants = [strategy_of(f"{name}:{set_}", known) for set_ in getattr(usual, "settings", ())]
        different = [usual, *(getattr(variant, "base", None) for variant in variants)]
        assert len(set(map(repr, different))) == len(different), name
