"""A second drawing of the structure of a case, in a file next to it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from femubench import InputError
from femubench.core.cli.main import bench
from femubench.core.library.cases import read_cases, usable_plugins
from femubench.core.run.store import Store

SUITE = Path(__file__).parents[1] / "scenarios" / "suite"


@pytest.fixture
def portal(tmp_path: Path) -> Path:
    """Return a case with a drawing of thicker walls."""
    folder = shutil.copytree(SUITE / "portal", tmp_path / "portal")
    for file in folder.glob("solid.*"):
        file.unlink()
    text = (folder / "case.toml").read_text()
    model = text[text.index("[model]") : text.index("[measurement]")]
    (folder / "thick.toml").write_text(model.replace("wall = 0.003", "wall = 0.004"))
    return folder


def test_a_drawing_is_a_case_of_the_same_structure_and_test(portal: Path) -> None:
    plain, thick = read_cases([portal, portal / "thick.toml"], usable_plugins())
    assert (thick.name, thick.drawing, thick.structure) == (
        "suite/portal:thick",
        "thick",
        "suite/portal",
    )
    assert thick.model.total_mass > 1.25 * plain.model.total_mass
    assert thick.measurement.frequencies.tolist() == plain.measurement.frequencies.tolist()
    assert len({plain.digest, thick.digest}) == 2
    for word in (portal, portal / "thick.toml"):
        assert read_cases(word, usable_plugins(), "thick")[0].digest == thick.digest


@pytest.mark.slow(10)
def test_a_run_from_a_drawing_says_so_and_repeats(portal: Path, tmp_path: Path) -> None:
    words = ["run", str(portal), "--drawing", "thick", "-s", "unchanged", "--nominal", "drawn"]
    store = ["--store", str(tmp_path / "store"), "-j", "1"]
    done = CliRunner().invoke(bench, [*words, *store])
    assert done.exit_code == 0, done.output
    run = Store(tmp_path / "store").load()
    assert {result.case for result in run.results} == {"suite/portal:thick"}
    again = CliRunner().invoke(bench, ["run", "--locked", run.meta["run"], *store])
    assert again.exit_code == 0, again.output
    assert "results: 0 differences" in again.output


@pytest.mark.parametrize("drawing", ["solid", "case", "../portal/thick"])
def test_a_case_without_the_drawing_is_refused_in_one_line(portal: Path, drawing: str) -> None:
    done = CliRunner().invoke(bench, ["diagnose", str(portal), "--drawing", drawing])
    assert done.exit_code == 2
    assert done.output.count("\n") == 1
    assert f"has no drawing {drawing!r}" in done.output
    assert "expected one of thick" in done.output


def test_a_fault_in_a_drawing_is_placed_in_its_file(portal: Path) -> None:
    file = portal / "thick.toml"
    text = file.read_text()
    for old, new, where in (
        ('section = "tube"', 'section = "pipe"', "thick.toml:"),
        ("[model]", "[moddel]", "thick.toml"),
        ("[model]\n", '[case]\nname = "x"\n[model]\n', "thick.toml:1"),
    ):
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=where):
            read_cases(file, usable_plugins())


def test_of_a_group_those_without_the_drawing_are_left_out() -> None:
    with (
        pytest.warns(UserWarning, match="left out: suite/.*it has no drawing 'none'"),
        pytest.raises(InputError, match="no case to run"),
    ):
        read_cases("suite", usable_plugins(), "none")
