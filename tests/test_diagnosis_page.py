"""The page of a diagnosis: what stands on it, in which order, and that nothing of the data runs."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import diagnosis_toys as toys
import harness_toys
import pytest
from diagnosis_toys import STRUCTURE, data_of

from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.drawing.places import find_wireframe
from femubench.core.errors import InputError
from femubench.core.schema.diagnosis import (
    ErrorScale,
    LocationRow,
    LoneMode,
    ModeChange,
    Rival,
    States,
    ZeroChange,
)
from femubench.reports.diagnosis import diagnosis_html, diagnosis_markdown, diagnosis_text
from tests.command import call_bench

VERDICTS = ("named", "none", "unknown", "ambiguous", "not-confirmed")


class Page(HTMLParser):
    """Tags with their attributes, ids and the text of a page, styles and scripts left out."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.ids: list[str] = []
        self.words: list[str] = []
        self._open = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open = tag
        self.words.append(" " if tag in ("td", "th", "b", "dd") else "")
        self.tags.append((tag, dict(attrs)))
        self.ids += [value for name, value in attrs if name == "id" and value]

    def handle_data(self, data: str) -> None:
        if self._open not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join("".join(self.words).split())


def page_of(data: dict[str, Any]) -> Page:
    return Page(diagnosis_html(data))


class TestPage:
    @pytest.mark.parametrize("verdict", VERDICTS)
    def test_every_verdict(self, verdict: str) -> None:
        page = page_of(data_of(verdict))
        assert f"{verdict}: " in page.text
        assert len(page.ids) == len(set(page.ids))
        assert ("not a finding" in page.text) == (verdict in ("unknown", "not-confirmed"))
        assert ("What is missing" in page.text) == (verdict == "named")
        assert ("No place stands out" in page.text) == (verdict == "none")

    def test_nothing_is_fetched(self) -> None:
        text = diagnosis_html(data_of())
        assert "default-src 'none'" in text
        assert not re.search(r"https?:|url\(|@import|innerHTML|\bsrc=", text)
        assert all(name != "link" for name, _ in Page(text).tags)

    def test_hostile_names(self) -> None:
        joints = [{**joint, "name": toys.NASTY} for joint in STRUCTURE["joints"]]
        sensors = [{**STRUCTURE["sensors"][0], "label": toys.NASTY, "direction": toys.NASTY}]
        changes = {"joints": joints, "sensors": sensors}
        data = diagnosis_to_json(toys.nasty())
        data = diagnosis_from_json({**data, "structure": {**STRUCTURE, **changes}})
        text = diagnosis_html(data)
        page = Page(text)
        assert [name for name, _ in page.tags].count("script") == 1
        assert "<script>alert" not in text
        assert not any(key.startswith("on") for _, attributes in page.tags for key in attributes)
        assert not {"\x1b", "\u202e", "\x07"} & set(text)
        assert "alert(1)" in page.text
        assert "nan" not in re.sub(r"<(style|script)>.*?</\1>", "", text, flags=re.DOTALL).lower()

    def test_without_geometry(self) -> None:
        """Files of earlier versions hold none."""
        data = diagnosis_to_json(toys.made())
        data.pop("structure")
        text = page_of(diagnosis_from_json(data)).text
        assert "no drawing" in text
        assert "J1 1.00" in text

    def test_numbers_that_are_missing(self) -> None:
        data = data_of()
        data["gain"]["used_percent"] = [None, 1.0]
        data |= {"adequacy_p": None, "nothing": None, "seconds": None, "chi2": [None, None]}
        for row in (*data["rivals"], *data["locations"], *data["causes"], *data["advice"]):
            for key in ("probability", "value", "separation", "delta_chi2", "angle"):
                if key in row:
                    row[key] = None
        assert "None" not in page_of(data).text


class TestDrawings:
    def test_the_map_speaks_and_leads_back_to_the_list(self) -> None:
        page = page_of(data_of(locations=(LocationRow("evidence", "J1", 1.0),)))
        assert "J1: 1.00" in page.text
        assert "sensor p2, -z" in page.text
        assert "held: x, z" in page.text
        tied = [
            attributes["data-at"]
            for tag, attributes in page.tags
            if tag == "g" and "data-at" in attributes
        ]
        listed = [
            attributes["data-row"]
            for tag, attributes in page.tags
            if tag == "tr" and "data-row" in attributes
        ]
        assert set(tied) == {"0", "1"} == set(listed)


class TestStructure:
    def test_places_of_a_case(self) -> None:
        case = harness_toys.tiny_case()
        frame = case.model.frame_structure.frame
        member, joint = frame.members[0], frame.joints[0]
        words = ["all", joint.name, member.name, f"{member.name}/1", f"{member.name}@0.25:z"]
        placed = find_wireframe(case, [*words, "no such place"])
        kinds = {place.place: place.kind for place in placed.places}
        assert [kinds[word] for word in words] == ["all", "joint", "member", "element", "point"]
        assert kinds["no such place"] == "elsewhere"
        rivals = tuple(Rival("a", word, 1.0, 0.1) for word in [*words, "no such place"])
        data = diagnosis_to_json(toys.made("none", rivals=rivals), case=case)
        assert diagnosis_from_json(data) == data
        assert [m["name"] for m in data["structure"]["members"]] == [m.name for m in frame.members]

    @pytest.mark.parametrize(
        ("change", "key"),
        [
            ({"members": [{"name": "m", "ends": [0, 2], "elements": 1}]}, "structure"),
            ({"members": []}, "structure"),
            ({"plane": "flat"}, "structure.plane"),
            ({"joints": [{"name": "a", "xyz": [0.0, 1.0]}]}, "structure.joints[0].xyz"),
        ],
    )
    def test_what_is_wrong_is_named(self, change: dict[str, Any], key: str) -> None:
        data = diagnosis_to_json(toys.made())
        with pytest.raises(InputError) as caught:
            diagnosis_from_json({**data, "structure": {**STRUCTURE, **change}})
        assert caught.value.key == key


class TestCommand:
    @pytest.mark.slow(5)
    def test_writes_page_and_markdown(self, tmp_path: Path) -> None:
        for name, start in (("a.html", "<!DOCTYPE html>"), ("a.MD", "# Diagnosis of frame")):
            file = tmp_path / name
            words = ["diagnose", "frame", "--no-pairs", "--no-faults", "-q", "--report", str(file)]
            words += ["--effects", "density"]
            done = call_bench(*words, code=None)
            assert (done.exit_code, done.stdout) == (0, "")
            assert file.read_text(encoding="utf-8").startswith(start)

    def test_a_suffix_that_says_nothing(self, tmp_path: Path) -> None:
        words = ["diagnose", "frame", "--report", str(tmp_path / "a.pdf")]
        done = call_bench(*words, code=2)
        assert ".html or .md" in done.stderr


class TestStates:
    LONE = LoneMode(4, 61.5)
    MODES = (
        ModeChange(3, 3, 44.0, 45.892, 4.3, 0.2, 21.0, 0.98, 0.4),
        ModeChange(5, 6, 80.0, 80.1, 0.125, 0.2, 0.6, 0.57, 1e-9),
        ModeChange(7, 7, 90.0, 90.0, 0.0, 0.2, 0.0, 1.0, 1.0),
    )
    DIFFERS = States("differs", 1e-99, 500.0, 11, MODES, (), (LONE,), (0.6, 0.05))

    def test_antiresonances_are_said_next_to_the_modes(self) -> None:
        zeros = (
            ZeroChange("S3", "S1", 88.0, 90.64, 3.0, 4.2),
            ZeroChange("S2", "S1", 70.0, 70.0, 0.0, 0.0),
        )
        same = self.MODES[2:]
        moved = States("differs", 1e-5, 40.0, 5, same, (), (), None, zeros, 1e-4)
        text = page_of(data_of(states=moved)).text
        assert (
            "The two measurements differ: of 2 antiresonances (probability of all 0.0001) that "
            "near 90.64 Hz at S3 rose by 3 % (4.2 deviations); the modes agree."
        ) in text
        alike = States("agrees", 0.4, 4.0, 5, same, (), (), None, zeros[1:], 1.0)
        said = "The two measurements agree in 1 mode and 1 antiresonance (probability 0.4)."
        assert said in page_of(data_of(states=alike)).text

    def test_what_differs_is_said_first_then_drawn_then_the_causes(self) -> None:
        data = data_of(states=self.DIFFERS, model_error=(ErrorScale("joints", 0.05, ""),))
        said = (
            "The two measurements differ: mode 3 rose by 4.3 % (21 deviations), mode 5 changed its "
            "shape (MAC 0.57); the weighed mass rose by 0.6 kg (12 deviations); mode 4 at 61.5 Hz "
            "is new; the other agrees."
        )
        text = page_of(data).text
        first, second, third = text.split("named: ")[1].partition("What is missing")
        assert text.index(said) < text.index("The T joints rotate")
        for part in ("3: 44 Hz", "+4.3 %", "+0.12 %, MAC 0.57", "4: 61.5 Hz"):
            assert part in first, part
        assert second
        assert third.index("Something is missing") < third.index("Model error by classes")
        for report in (diagnosis_text(data), diagnosis_markdown(data)):
            assert said in " ".join(report.split())
            assert report.index("The two measurements differ") < report.index("The T joints")
