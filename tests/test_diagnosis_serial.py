"""A diagnosis as JSON and as a report, on one that was put together by hand."""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import diagnosis_toys as toys
import numpy as np
import pytest

import femubench
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.errors import InputError
from femubench.core.schema.diagnosis import Gain
from femubench.reports.cells import chance
from femubench.reports.diagnosis import diagnosis_markdown, diagnosis_text, summary_lines

VERDICTS = ("named", "none", "unknown", "ambiguous", "not-confirmed")


def data_of(found: Diagnosis) -> dict[str, Any]:
    return diagnosis_to_json(found)


def leaves(data: object) -> Iterator[object]:
    """Return everything in plain data that is neither a list nor a mapping."""
    if isinstance(data, dict):
        for value in data.values():
            yield from leaves(value)
    elif isinstance(data, list):
        for value in data:
            yield from leaves(value)
    else:
        yield data


class TestJson:
    def test_contract(self) -> None:
        """Every key and form that the contract names, with the figures of the diagnosis."""
        data = data_of(toys.made())
        assert data["verdict"] == "named"
        cause = data["causes"][0]
        bending = {"name": "bending", "value": 31000.0, "std": 1200.0, "unit": "N m/rad"}
        assert cause["parameters"][0] == {**bending, "textbook": False, "wording": "value"}
        assert cause["parameters"][1]["std"] is None
        assert (cause["effect"], cause["place"]) == ("joint-rotation", "type:T")
        assert cause["probability"] == 0.9421
        assert data["rivals"][0]["delta_chi2"] == 812.5
        assert data["rivals"][1]["angle"] is None
        assert data["advice"][0] == {"measurement": "weigh the structure", "separation": 140.25}
        least = {"effect": "added-mass", "place": "J3", "size": 0.0123}
        assert data["smallest_visible"] == [{**least, "unit": "kg", "wording": "value"}]
        others = ("modified_percent", "cross_validated_percent", "change_percent")
        gains = {"used_percent": [4.25, 0.125], "held_out_percent": [3.4, 0.75]}
        assert data["gain"] == {**gains, **dict.fromkeys(others)}
        assert data["adequacy_p"] == 0.614
        percents = [(change["mode"], change["percent"]) for change in data["looks"][0]["changes"]]
        assert percents == [(1, -3.25), (2, None)]
        assert len(data["residuals"]) == 6
        assert data["version"] == femubench.__version__
        assert data["written"] is None
        assert "extended" not in data

    @pytest.mark.parametrize("verdict", VERDICTS)
    def test_round_trip(self, verdict: Any) -> None:
        data = diagnosis_to_json(toys.made(verdict), written=Path("some/where"))
        text = json.dumps(data, allow_nan=False)
        assert diagnosis_from_json(json.loads(text)) == data
        assert data["written"] == "some/where"

    def test_what_is_no_finite_number_is_null(self) -> None:
        """Whatever the engine hands over: nan, infinities, numbers of numpy."""
        found = toys.made(
            gain=Gain((math.nan, math.inf), (np.float64(1.0), np.float32(0.5))),  # type: ignore[arg-type]
            chi2=(np.float64(math.inf), 3),
            data_count=np.int64(61),
            adequacy_p=math.nan,
            nothing=-math.inf,
        )
        data = json.loads(json.dumps(data_of(found), allow_nan=False))
        assert data["gain"]["used_percent"] == [None, None]
        assert data["gain"]["held_out_percent"] == [1.0, 0.5]
        assert (data["chi2"], data["data_count"]) == ([None, 3], 61)
        assert (data["adequacy_p"], data["nothing"]) == (None, None)
        assert all(math.isfinite(leaf) for leaf in leaves(data) if isinstance(leaf, float))
        assert diagnosis_from_json(data)["chi2"] == [None, 3.0]

    def test_unknown_keys_are_left_out(self) -> None:
        data = data_of(toys.made())
        assert diagnosis_from_json({**data, "later": 1}) == data

    @pytest.mark.parametrize(
        ("path", "value", "key"),
        [
            (("verdict",), "sure", "verdict"),
            (("causes", 0, "probability"), "high", "causes[0].probability"),
            (("residuals", 5, "mode"), 1.5, "residuals[5].mode"),
            (("gain", "used_percent"), [1.0], "gain.used_percent"),
            (("gain", "held_out_percent"), [1.0, math.nan], "gain.held_out_percent[1]"),
            (("rivals",), None, "rivals"),
        ],
    )
    def test_what_is_wrong_is_named(
        self, path: tuple[str | int, ...], value: object, key: str
    ) -> None:
        data: Any = copy.deepcopy(data_of(toys.made()))
        inner = data
        for step in path[:-1]:
            inner = inner[step]
        inner[path[-1]] = value
        with pytest.raises(InputError) as caught:
            diagnosis_from_json(data, file="found.json")
        assert (caught.value.key, caught.value.file) == (key, "found.json")

    @pytest.mark.parametrize("data", [None, [], "x", {}])
    def test_what_is_no_diagnosis(self, data: object) -> None:
        with pytest.raises(InputError, match=r"found\.json"):
            diagnosis_from_json(data, file="found.json")


def words(found: Diagnosis) -> str:
    """Return the terminal's text on one line, without its wrapping."""
    return " ".join(diagnosis_text(data_of(found)).split())


class TestTerminal:
    @pytest.mark.parametrize("verdict", VERDICTS)
    def test_fits_on_the_screen(self, verdict: Any) -> None:
        lines = diagnosis_text(data_of(toys.made(verdict))).splitlines()
        assert max(map(len, lines)) <= 80
        assert not any(line != line.rstrip() for line in lines)

    def test_order_and_content(self) -> None:
        text = words(toys.made())
        parts = [
            "toy: named: one explanation stands alone",
            "joint-rotation at type:T: probability 94.2 %; the joints rotate; "
            "bending 31000 ± 1200 N m/rad; torsion 20500 N m/rad",
            "Taken at the textbook value: shear-deformation, rotary-inertia.",
            "Something is missing: > 99.9 %, probability, before any name is given",
            "weigh the structure 140 over a million to 1",
            "rms rms median median frequency error before after before after",
            "used modes 5.5 % 0.25 % 4.25 % 0.125 % 22 times smaller "
            "held-out modes 3.6 % 0.8 % 3.4 % 0.75 % 4.5 times smaller",
            "4: 226.8 Hz +12.3 -0.2 7: 275.2 Hz – +0.5 mass 2.125 kg +0.3 +0.3",
            "4: 3 sensors 3.54 1",
            "9201 before, 55.25 after, 61 data. What is left is noise: noise alone leaves as much "
            "with probability 61.4 %.",
            "J1 1.00 J3 0.50",
            "joint-offset at type:T 3.1 % 812.5 10.4",
            "torsion-constant everywhere + added-mass at 0.2 % 801.2 – J3",
            "added-mass J3 0.0123 kg",
            "ecomac: difference of measured and predicted shapes at every sensor. p2 1.00",
            "tube: J equals Jp and tube is no circle.",
            "If corrected (torsion-constant): mode 1 -3.25 %.",
            "Mode 9 found no partner.",
        ]
        found = [text.find(part) for part in parts]
        assert -1 not in found, parts[found.index(-1)]
        assert found == sorted(found)

    def test_headings_tell_findings_from_guesses(self) -> None:
        assert "What is missing" in words(toys.made("named"))
        for verdict in ("unknown", "not-confirmed"):
            text = words(toys.made(verdict))
            assert "Best guess" in text
            assert "What is missing" not in text
        group = words(toys.made("ambiguous"))
        assert "these data cannot decide" in group
        assert "shear-deformation everywhere: probability 97.0 %; multiple 1, textbook" in group
        assert "Their sensitivities are 1.8 degrees apart" in group
        assert "joint-rotation" not in words(toys.made("none"))

    def test_hostile_names(self) -> None:
        text = diagnosis_text(data_of(toys.nasty()))
        lines = text.splitlines()
        assert max(map(len, lines)) <= 80
        assert all(character.isprintable() for line in lines for character in line)
        assert "alert(1)" in text


class TestMarkdown:
    @pytest.mark.parametrize("verdict", VERDICTS)
    def test_tables_are_whole(self, verdict: Any) -> None:
        text = diagnosis_markdown(data_of(toys.made(verdict)))
        assert text.startswith("# Diagnosis of toy\n\nThe T joints rotate, 94.2 % sure.\n\n")
        rows_are_even(text)

    def test_hostile_names(self) -> None:
        """Nothing of a name is obeyed: no tag, no link, no emphasis, no new row or heading."""
        text = diagnosis_markdown(data_of(toys.nasty()))
        rows_are_even(text)
        assert "<" not in text
        assert "\x1b" not in text
        assert "\u202e" not in text
        unescaped = re.sub(r"\\.", "", text)
        assert "alert(1)" in unescaped
        assert "[" not in unescaped
        assert "`" not in unescaped
        bold = re.compile(r"^(- )?\*\*[^*]+\*\*: [^*]*$|^[^*]*$")
        assert all(bold.match(line) for line in unescaped.splitlines())
        assert len(re.findall(r"^# ", text, re.MULTILINE)) == 1

    def test_sentence_is_no_structure(self) -> None:
        for start in ("# heading", "- item", "1) first", "==="):
            text = diagnosis_markdown(data_of(toys.made(sentence=start)))
            assert text.split("\n\n")[1].replace("\\", "") == start
            assert not re.match(r"[#+=-]|\d+[.)]", text.split("\n\n")[1])


def rows_are_even(text: str) -> None:
    """Every row of a Markdown table has as many cells as its header."""
    blocks = [block for block in text.split("\n\n") if block.startswith("|")]
    assert len(blocks) >= 2
    for block in blocks:
        counts = {len(re.findall(r"(?<!\\)\|", line)) for line in block.splitlines()}
        assert len(counts) == 1


def test_no_certainty_is_claimed() -> None:
    for probability, text in ((None, "–"), (1.0, "> 99.9 %"), (0.5, "50.0 %"), (0.0, "< 0.1 %")):
        assert chance(probability) == text


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (104183.0, 51234.0, "104000 ± 51000"),
        (0.0039021, 0.00068, "0.00390 ± 0.00068"),
        (2.5, None, "2.5"),
        (1e-12, 3e-14, "1e-12 ± 3e-14"),
        (math.nan, 1.0, "–"),
    ],
)
def test_digits_follow_the_deviation(value: float, std: float | None, text: str) -> None:
    parameter = replace(toys.SOFT.parameters[0], name="k", value=value, std=std, unit="")
    cause = replace(toys.SOFT, parameters=(parameter,))
    assert summary_lines(data_of(toys.made(causes=(cause,))))[1].endswith(f"; k {text}")
