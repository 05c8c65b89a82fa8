"""The built-in scenarios: their data can be made again, and their models are the papers'."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from femubench.core.case.reader import read_case
from femubench.core.modal.eigen import solve_modes
from femubench.scenarios import HERE, femubench_scenarios
from femubench.scenarios.generate import FRAME_HZ, HFRAME_HZ, write_all
from truths.responses import NAMES as DRIVEN

# Those whose measured side is generated here.
ELSEWHERE = ("suite/", "suite-responses/", "tests/", "garteur", "footbridge")
OWN = [s for s in femubench_scenarios() if not s.name.startswith(ELSEWHERE)]
CASES = {name: scenario.folder(name) for scenario in OWN for name in scenario.cases}
DATA = sorted(
    path.relative_to(HERE) for scenario in OWN for path in (HERE / scenario.name).glob("**/*.csv")
)
MODEL_HZ = {
    "frame": (255.8, 277.5, 581.3, 911.3, 1049.4),
    "hframe": (78.51, 147.31, 298.90, 408.03, 523.31, 957.34, 1013.35, 1310.70),
}


def test_every_scenario_has_a_case_and_a_readme() -> None:
    for scenario in femubench_scenarios():
        assert scenario.cases, scenario.name
        assert scenario.classes, scenario.name
        assert (HERE / scenario.name / "README.md").is_file(), scenario.name


@pytest.mark.slow(10)
def test_data_are_what_their_generator_writes(tmp_path: Path) -> None:
    for folder in CASES.values():
        (tmp_path / folder.relative_to(HERE)).mkdir(parents=True)
    write_all(tmp_path)
    assert {p.relative_to(tmp_path) for p in tmp_path.glob("**/*.csv")} == set(DATA)
    for file in DATA:
        stored, made = pd.read_csv(HERE / file), pd.read_csv(tmp_path / file)
        assert list(stored.columns) == list(made.columns)
        for column in stored.columns:
            if stored[column].dtype.kind in "fi":
                np.testing.assert_allclose(stored[column], made[column], rtol=2e-6, atol=2e-6)
            else:
                assert list(stored[column]) == list(made[column])


@pytest.mark.parametrize("name", CASES)
def test_a_case_reads(name: str) -> None:
    case = read_case(CASES[name], name)
    assert case.name == name
    assert not set(case.used) & set(case.held_out)
    assert case.measurement.select(case.used).has_shapes
    assert bool(solve_modes(case.model).rigid[:3].all())


@pytest.mark.parametrize(("name", "tolerance"), [("frame", 1e-3), ("hframe", 5e-5)])
def test_nominal_model_has_the_printed_frequencies(name: str, tolerance: float) -> None:
    printed = np.array(MODEL_HZ[name])
    found = solve_modes(read_case(CASES[name]).model).elastic.natural_frequencies
    np.testing.assert_allclose(found[: len(printed)], printed, rtol=tolerance)


def test_published_frequencies_are_the_measured_ones() -> None:
    assert tuple(read_case(CASES["frame"]).measurement.frequencies) == FRAME_HZ
    assert tuple(read_case(CASES["hframe"]).measurement.frequencies) == HFRAME_HZ


def test_the_twin_interpolation_agrees_with_a_left_out_station() -> None:
    from femubench.scenarios import twin_data

    table = pd.read_csv(twin_data.TWIN / "frame_twin_outofplane.csv")
    first = table[table["mode"] == 3].reset_index(drop=True)
    station = first.index[(first["x"] == 0.11020) & (first["y"] == 0.0)][0]
    left_out = first.drop(index=station).reset_index(drop=True)
    xyz = first.loc[station, ["x", "y", "z"]].to_numpy(dtype=float)
    interpolated = twin_data._reading(left_out, xyz, "z")
    peak = first["uz"].abs().max()
    assert interpolated == pytest.approx(first.loc[station, "uz"], abs=5e-4 * peak)


def test_cases_of_one_structure_say_so() -> None:
    """All of them, so that no built-in case counts twice as evidence."""
    shared: dict[str, set[str]] = {}
    for file in HERE.glob("**/case.toml"):
        stated = tomllib.loads(file.read_text(encoding="utf-8"))["case"]
        shared.setdefault(stated.get("structure", stated["name"]), set()).add(stated["name"])
    assert {label: names for label, names in shared.items() if len(names) > 1} == {
        "ladder": {
            *("frame", "frame-solid", "frame-beam", "frame-beam-asymmetric"),
            *("design-change/ladder-beam", "design-change/ladder-solid"),
        },
        "h-frame": {"hframe", "hframe-solid", "design-change/hframe-solid"},
        "suite/garteur": {"garteur", "suite/garteur"},
        **{
            f"suite/{name}": {f"suite{kind}/{name}" for kind in ("", "-responses")}
            for name in DRIVEN
        },
    }
    assert read_case(CASES["frame"], "frame").structure == "ladder"
