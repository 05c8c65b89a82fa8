"""What an answer states of names and of places, with which probability."""

from __future__ import annotations

from typing import Any

from stated_probabilities import statements

from femubench.core.challenge.answer import Answer
from femubench.core.schema.validation import read_plain


def answer(verdict: str, *causes: dict[str, Any]) -> Answer:
    return read_plain(Answer, {"verdict": verdict, "causes": list(causes)})


def test_names_and_places_are_stated_apart() -> None:
    mass = {"effect": "added-mass", "place": "A", "probability": 0.9, "place_probability": 0.5}
    pair = {"effect": "added-mass + density", "place": "B + all", "probability": 0.1}
    fault = {"effect": "sensor-sign", "place": "sensor:1", "probability": 0.7, "side": "data"}

    def of(found: Answer) -> list[tuple[str, float, bool]]:
        known = {"added-mass", "density"}
        said = statements(found, known.__contains__, lambda effect, place: place in ("B", "all"))
        return [(one.matter, one.probability, one.right) for one in said]

    assert of(answer("ambiguous", mass, pair)) == [
        ("name", 0.9, True),
        ("place", 0.45, False),
        ("name", 0.1, True),
        ("place", 0.1, True),
    ]
    # A best guess is no statement; a fault that is named next to it is.
    assert of(answer("unknown", mass, fault)) == [("name", 0.7, False), ("place", 0.7, False)]
    assert of(answer("not-confirmed", mass)) == of(answer("none")) == []
