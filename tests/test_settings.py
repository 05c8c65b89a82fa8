"""The table of numbers: what it holds, other values inside a block, ``bench diagnose --set``."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from diagnosis_problems import effects_named

from femubench.core.challenge.draw import draw_case
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.errors import InputError
from femubench.core.inference.settings import (
    Setting,
    Settings,
    decisions_from,
    format_value,
    list_changed,
    overridden,
    settings,
    settings_table,
)
from tests.command import call_bench

ROOT = Path(__file__).parents[1]
ROOMS = ("inference", "look", "advise", "diagnosis")
NUMBER = re.compile(r"^_?[A-Z][A-Z_0-9, ]*(?::.*)? = .*[0-9]", re.MULTILINE)


def test_the_docs_have_every_number_and_no_other() -> None:
    text = (ROOT / "docs" / "settings.md").read_text("utf-8")
    for name, entry in settings_table().items():
        cells = f"`{name}`", format_value(entry.value), entry.unit, entry.kind, entry.why
        assert f"| {' | '.join(cells)} |" in text
    assert re.findall(r"^\| `(\w+)`", text, re.MULTILINE) == list(settings_table())
    assert len(settings_table()) < 120


def test_no_module_has_numbers_of_its_own() -> None:
    for path in (path for room in ROOMS for path in (ROOT / "core" / room).glob("*.py")):
        found = NUMBER.findall(path.read_text("utf-8"))
        assert [line for line in found if not line.startswith("_CURRENT")] == [], path


def test_other_values_last_as_long_as_their_block() -> None:
    assert list_changed() == {}
    with overridden({"sure_fault": 0.95}):
        with overridden({"largest_group": 2}):
            assert list_changed() == {"sure_fault": 0.95, "largest_group": 2}
        assert (settings.sure_fault, settings.largest_group) == (0.95, Settings().largest_group)
    with pytest.raises(KeyError), overridden({"sure_fault": 0.95}):
        raise KeyError
    assert settings.sure_fault == Settings().sure_fault
    assert settings_table()["sure_fault"] == Setting(
        0.9, "probability", "decision", "from which data or input are corrected"
    )


def test_every_decision_can_be_given_its_own_value_in_words() -> None:
    for name, value in ((n, s.value) for n, s in settings_table().items() if s.kind == "decision"):
        given = decisions_from([f"{name} = {format_value(value)}"])
        assert given == {name: value}
        assert type(given[name]) is type(value)


@pytest.mark.parametrize(
    ("word", "what", "expected"),
    [
        ("sure_fualt=0.95", "no setting 'sure_fualt'", "one of sure_fault, "),
        ("prior_fault=0.2", "prior_fault: a prior is not to be set", "a decision, one of "),
        ("sure_fault", "--set sure_fault", "name=value"),
        ("sure_fault=much", "sure_fault = no number", "a number > 0 and < 1, such as 0.9"),
        ("sure_fault=1", "sure_fault = 1", "a number > 0 and < 1, such as 0.9"),
        ("too_small=nan", "too_small = nan", "a number > 0, such as 12"),
        ("largest_group=2.5", "largest_group = 2.5", "a whole number >= 1, such as 6"),
        ("usual_std=0.1", "usual_std = 0.1", "2 numbers > 0, by comma, such as 1e-05,0.2"),
    ],
)
def test_what_cannot_be_set_gives_one_line(word: str, what: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        decisions_from([word])
    assert what in caught.value.what
    assert expected in (caught.value.expected or "")
    result = call_bench("diagnose", "frame", "--set", word, code=2)
    assert result.stderr.splitlines() == [f"bench: {caught.value}"]


def test_a_verdict_moves_with_its_decision_and_a_note_says_so() -> None:
    case = draw_case(1001, "A", structure="ladder", hidden="none").case
    sought = effects_named("added-mass", "joint-rotation")
    plain = diagnose(case, sought, pairs=False, faults=())
    assert plain.verdict == "none"
    assert not any("Settings" in note for note in plain.notes)
    with overridden({"nothing_missing": 0.999}):
        moved = diagnose(case, sought, pairs=False, faults=())
    assert moved.verdict != "none"
    assert moved.nothing == plain.nothing < 0.999
    assert moved.notes[-1] == "Settings other than the standard ones: nothing_missing = 0.999."


def test_the_option_reaches_the_diagnosis(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[dict[str, object]] = []

    def search(*_: object, **__: object) -> None:
        seen.append(dict(list_changed()))
        raise InputError("enough")

    monkeypatch.setattr("femubench.core.library.diagnose.search", search)
    words = ["--set", "sure_fault=0.95", "--set", "largest_group=2", "--set", "largest_group=3"]
    call_bench("diagnose", "frame", *words, code=2)
    assert seen == [{"sure_fault": 0.95, "largest_group": 3}]
