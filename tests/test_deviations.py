"""Stated deviations of 0 or 1e-16: raised to what the others have, and said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femubench
from femubench import InputError
from femubench.core.case.example import write_example
from tests.command import call_bench

LABELS = (
    *("left_mid", "left_top", "beam_quarter", "beam_mid"),
    *("beam_three_quarters", "right_top", "right_mid"),
)


def with_deviations(folder: Path, scale: str, frequency: str = "0.2") -> Path:
    """Write the example case with a stated deviation of every component, one of them `scale`."""
    write_example(folder)
    lines = (folder / "modes.csv").read_text().splitlines()
    header, *rows = (line.split(",") for line in lines)
    header += [f"{label}_std" for label in LABELS]
    for row in rows:
        row += ["0.02", "0.03", "0.01", "0.02", "0.04", "0.02", "0.02"]
        row[len(row) - 7 + header[4:11].index("left_top")] = scale
    rows[1][2] = frequency
    text = "\n".join(",".join(row) for row in [header, *rows])
    (folder / "modes.csv").write_text(text + "\n")
    return folder


@pytest.mark.parametrize("scale", ["0", "2.4e-16"])
def test_component_that_scales_gets_the_median_of_its_mode(tmp_path: Path, scale: str) -> None:
    case = femubench.read_case(with_deviations(tmp_path / "a", scale))
    np.testing.assert_allclose(case.measurement.shape_std[1], 0.02)
    np.testing.assert_array_equal(case.measurement.shape_std[4], 0.04)
    assert len(case.notes) == 1
    assert "modes.csv" in case.notes[0]
    assert "left_top (mode 1, 2, 3, 4, 5, 6)" in case.notes[0]


def test_frequency_gets_the_median_of_the_others(tmp_path: Path) -> None:
    case = femubench.read_case(with_deviations(tmp_path / "a", "0.02", "1e-16"))
    m = case.measurement
    np.testing.assert_allclose(m.frequency_std / m.frequencies, 0.001, rtol=0.02)
    assert "frequency of mode 2" in case.notes[0]


def test_no_usable_deviation_leaves_the_default(tmp_path: Path) -> None:
    folder = with_deviations(tmp_path / "a", "0")
    text = (folder / "modes.csv").read_text()
    for value in ("0.01", "0.02", "0.03", "0.04"):
        text = text.replace(f",{value}", ",0")
    (folder / "modes.csv").write_text(text)
    m = femubench.read_case(folder).measurement
    largest = np.abs(m.shapes).max(axis=0)
    np.testing.assert_allclose(m.shape_std / largest, 0.015)


def test_negative_deviation_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"left_top_std.*-0.1"):
        femubench.read_case(with_deviations(tmp_path / "a", "-0.1"))


def test_note_is_shown_by_run_and_diagnose(tmp_path: Path) -> None:
    folder = with_deviations(tmp_path / "portal", "0")
    store = ["--store", str(tmp_path / "results"), "--report", str(tmp_path / "page.md")]
    run = call_bench("run", folder, "-s", "unchanged", *store)
    assert "next to no deviation" in " ".join(run.output.split())
    page = (tmp_path / "page.md").read_text()
    assert "next to no deviation" in " ".join(page.split())
    stated = call_bench("diagnose", folder, "--effects", "density", "--no-pairs", "--no-faults")
    assert "next to no deviation" in " ".join(stated.output.split())
