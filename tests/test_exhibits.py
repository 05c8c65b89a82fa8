"""What is kept of a result for drawing: does it show what the model does?"""

from __future__ import annotations

import base64
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from effect_checks import as_matrices
from scipy.sparse.csgraph import connected_components

from femubench import Case, UpdateResult, solve_modes
from femubench.core.case.reader import read_case
from femubench.core.drawing import prediction, thinning, wireframe
from femubench.core.drawing.element_change import relative_changes
from femubench.core.drawing.files import FOLDER, Exhibits
from femubench.core.drawing.prediction import (
    case_drawing,
    exhibit_of,
    frequency_axis,
    list_receptances,
)
from femubench.core.plugin.loader import load_plugins
from femubench.core.run.jobs import _parameter
from femubench.core.score.scoring import score_model
from femubench.scenarios import HERE

STRATEGIES = load_plugins().strategies
KEY = "0123456789abcdef"


@pytest.fixture(scope="module")
def cases() -> dict[str, Case]:
    return {name: read_case(HERE / name) for name in ("frame", "hframe", "frame-solid")}


def updated(case: Case, strategy: str) -> UpdateResult:
    data = case.used_measurement(0)
    return STRATEGIES[strategy].update(case.model, data, np.random.default_rng(0))


def shown(case: Case, strategy: str) -> dict[str, Any]:
    result = updated(case, strategy)
    stated = [_parameter(item, result.model) for item in result.parameters]
    found = exhibit_of(case, result.model, stated)
    assert found is not None
    return found


def peaks(hz: list[float], level: list[float]) -> list[float]:
    inner = range(1, len(level) - 1)
    return [hz[i] for i in inner if level[i - 1] < level[i] > level[i + 1]]


def test_a_factor_on_elements_is_the_change_of_these_elements(cases: dict[str, Case]) -> None:
    case = cases["hframe"]
    result = updated(case, "global")
    (factor,) = (item.after for item in result.parameters)
    found = relative_changes(case.model, result.model)
    assert found is not None
    # EI changes, EA does not: the change is less than that of the factor.
    assert 0.0 < max(x for x in found if x is not None) <= abs(factor - 1.0) + 1e-12
    still = relative_changes(case.model, updated(case, "unchanged").model)
    assert still == [0.0] * 64


def test_what_a_strategy_reports_is_found_at_its_place(cases: dict[str, Case]) -> None:
    case = cases["frame"]
    result = updated(case, "physical")
    found = {finding["place"]: finding for finding in shown(case, "physical")["findings"]}
    ratios = {item.name: item.after / item.before for item in result.parameters}
    assert set(found) == set(case.model.frame_structure.labels)
    for label, finding in found.items():
        changes = [ratios[f"{key} {label}"] - 1.0 for key in ("EI", "GJ")]
        assert finding["value"] == pytest.approx(max(changes, key=abs))
        assert (finding["kind"], len(finding["spans"])) == ("element", 1)


def test_a_global_factor_is_everywhere_and_springs_are_at_their_ends(
    cases: dict[str, Case],
) -> None:
    case = cases["hframe"]
    (factor,) = updated(case, "global").parameters
    (finding,) = shown(case, "global")["findings"]
    assert (finding["kind"], finding["symbol"]) == ("all", "change")
    assert finding["value"] == pytest.approx(factor.after - 1.0)
    assert finding["label"].startswith("EI all members ")
    (springs,) = (f for f in shown(case, "spring")["findings"] if f["symbol"] == "spring")
    assert {(span["member"], span["end"] - span["start"]) for span in springs["spans"]} == {
        (0, 0.125)
    }
    assert "N m/rad" in springs["label"]
    lost = shown(case, "offset")["findings"]
    turned = next(f for f in lost if f["label"].startswith("a T branch"))
    assert turned["value"] is None  # a length that changes its sign


def test_matrix_methods_have_a_difference_instead(cases: dict[str, Case]) -> None:
    found = shown(cases["frame"], "baruch")
    assert found["elements"] is None
    picture = found["difference"]
    levels = np.frombuffer(base64.b64decode(picture["values"]), np.uint8)
    levels = levels.reshape(picture["size"], picture["size"])
    assert levels.max() == 255
    assert np.array_equal(levels, levels.T)
    assert picture["highest"] - picture["lowest"] == pytest.approx(4.0)
    assert np.mean(levels > 0) > 0.9  # spread all over, as the paper says
    assert shown(cases["frame"], "unchanged")["difference"] is None


def test_modes_mac_and_receptances_are_those_of_the_model(cases: dict[str, Case]) -> None:
    case = cases["frame-solid"]
    result = updated(case, "generic-ls")
    found = exhibit_of(case, result.model)
    assert found is not None
    frequencies = solve_modes(result.model).elastic.natural_frequencies
    changed = [mode for mode in found["modes"] if mode["modification"] is not None]
    hz = [mode["hz"] for mode in found["modes"] if mode["modification"] is None]
    assert np.allclose(hz, frequencies[: len(hz)])
    blocks = score_model(case, result.model)
    for pair in (*blocks["used"].modes, *blocks["higher"].modes):
        partner = next(m for m in found["modes"] if m["paired"] == pair.number)
        assert partner["hz"] == pytest.approx(pair.predicted_hz)
        row = found["mac"]["values"][found["mac"]["rows"].index(pair.number)]
        assert row[hz.index(partner["hz"])] == pytest.approx(pair.mac, abs=1e-3)
    predicted = {pair.number: pair.predicted_hz for pair in blocks["modified"].modes}
    assert {mode["paired"]: pytest.approx(mode["hz"]) for mode in changed} == predicted
    assert all(np.abs(mode["shape"]).max() == pytest.approx(1.0) for mode in found["modes"])
    axis = frequency_axis(case).tolist()
    step = axis[1] - axis[0]
    tops = peaks(axis, found["receptance"][""])
    assert min(abs(top - hz[0]) for top in tops) <= step
    assert set(found["receptance"]) == {"", "mass and spring at 6"}


def test_what_is_too_large_is_not_drawn(
    cases: dict[str, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wireframe, "MOST_NODES", 10)
    case = cases["frame"]
    assert case_drawing(replace(case, model=as_matrices(case.model))) is None


def test_a_large_frame_is_thinned_out(
    cases: dict[str, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    case = cases["hframe"]
    whole, full = case_drawing(case), shown(case, "unchanged")
    assert whole is not None
    assert whole["thinned"] is None
    for module in (thinning, prediction):
        monkeypatch.setattr(module, "MOST_NODES", 10)
    monkeypatch.setattr(thinning, "_KEPT", 40)
    drawn, few = case_drawing(case), shown(case, "unchanged")
    assert drawn is not None
    assert drawn["thinned"] == [len(whole["nodes"]), len(whole["elements"])]
    number = [whole["nodes"].index(node) for node in drawn["nodes"]]
    assert 20 < len(number) <= 40
    # It hangs together as the structure does, and moves as it moves there.
    ends = np.array(drawn["elements"])
    links = sp.coo_array((np.ones(len(ends)), ends.T), shape=(len(number),) * 2)
    assert connected_components(links, directed=False)[0] == 1
    for one, other in zip(full["modes"], few["modes"], strict=True):
        shape, rough = np.array(one["shape"])[number], np.array(other["shape"])
        np.testing.assert_allclose(
            rough / np.abs(rough).max(), shape / np.abs(shape).max(), atol=2e-3
        )
    assert few["mac"] == full["mac"]
    assert few["elements"] is None


class TestFiles:
    def test_what_is_put_is_found(self, cases: dict[str, Case], tmp_path: Path) -> None:
        exhibits = Exhibits(tmp_path)
        put = {
            **(case_drawing(cases["frame"]) or {}),
            "receptance": list_receptances(cases["frame"]),
            "nominal": None,
        }
        exhibits.put_case(KEY * 4, put)
        exhibits.put(KEY, shown(cases["frame"], "baruch"))
        again = Exhibits(tmp_path)
        assert again.case(KEY * 4) == json.loads(json.dumps(put))
        found = again.of(KEY)
        assert found is not None
        assert found["modes"] == json.loads(json.dumps(shown(cases["frame"], "baruch")["modes"]))
        assert again.notes == []
        assert again.of("f" * 16) is None

    @pytest.mark.parametrize("text", ["", '{"modes": [], "mac": {"rows": ["x"]}}', "\0"])
    def test_what_is_broken_is_left_out_and_said(self, text: str, tmp_path: Path) -> None:
        (tmp_path / FOLDER).mkdir()
        (tmp_path / FOLDER / f"{KEY}.json").write_text(text)
        exhibits = Exhibits(tmp_path)
        assert exhibits.of(KEY) is None
        assert len(exhibits.notes) == 1
        assert "\n" not in exhibits.notes[0]

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("elements", [[0, 10_000]] * 28),
            ("element_labels", []),
            ("joints", [{"name": "1", "node": -1}]),
        ],
    )
    def test_a_drawing_that_contradicts_itself_is_left_out(
        self, key: str, value: object, cases: dict[str, Case], tmp_path: Path
    ) -> None:
        exhibits = Exhibits(tmp_path)
        exhibits.put_case(KEY * 4, {**(case_drawing(cases["frame"]) or {}), key: value})
        assert exhibits.case(KEY * 4) is None
        assert len(exhibits.notes) == 1

    def test_a_difference_that_contradicts_itself_is_left_out(
        self, cases: dict[str, Case], tmp_path: Path
    ) -> None:
        found = shown(cases["frame"], "baruch")
        found["difference"]["values"] = found["difference"]["values"][:-4]
        exhibits = Exhibits(tmp_path)
        exhibits.put(KEY, found)
        assert exhibits.of(KEY) is None

    @pytest.mark.parametrize("key", ["../../etc/passwd", "case-../x", ""])
    def test_names_are_keys_and_nothing_else(self, key: str, tmp_path: Path) -> None:
        exhibits = Exhibits(tmp_path / "store")
        exhibits.put(key, {})
        assert exhibits.of(key) is None
        assert list(tmp_path.iterdir()) == []

    def test_what_a_killed_process_left_is_removed(self, tmp_path: Path) -> None:
        folder = tmp_path / FOLDER
        folder.mkdir()
        for name in (f".{KEY}.abc", f".{KEY}.new", f"{KEY}.json"):
            (folder / name).write_text("{}")
        os.utime(folder / f".{KEY}.abc", (0.0, 0.0))
        os.utime(folder / f"{KEY}.json", (0.0, 0.0))
        Exhibits(tmp_path).tidy()
        assert sorted(p.name for p in folder.iterdir()) == [f".{KEY}.new", f"{KEY}.json"]

    def test_a_store_without_room_does_without(self, tmp_path: Path) -> None:
        (tmp_path / "store").write_text("")
        exhibits = Exhibits(tmp_path / "store")
        exhibits.put(KEY, {"modes": []})
        assert exhibits.of(KEY) is None
        assert (tmp_path / "store").read_text() == ""
