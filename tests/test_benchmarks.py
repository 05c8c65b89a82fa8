"""Scripts of benchmarks: what they choose, what they keep, and the bar of identification."""

from __future__ import annotations

import json
import math
import runpy
import shlex
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import performance
import pytest
from tuning import tuned

from benchmarks.identify_sweep import one
from tests.identify_score import NAMES, covered

ROOT = Path(__file__).parents[1]
# The least that a benchmark can be asked for.
SHORT = {
    "board_checks": "--boards default --trials 5",
    "boards": "default --from docs/figures/board-default.json",
    "budget_score": "portal",
    "clean_sweep": "1 --sets 1 --results clean.jsonl",
    "cluster_cost": "--jobs 1 --workers 1",
    "diagnosis_cost": "--here frame",
    "diagnosis_sweep": "run --cases 1 --jobs 1 --groups 'clean A' --results blind.jsonl",
    "identify_sweep": "--sets 1 --references 3 --jobs 1",
    "knowledge_free": "--memory suite/a-frame",
    "line_budget": "",
    "method_by_parameters": "",
    "mutations": "--list",
    "number_sweep": "run --cases 1 --results numbers.jsonl",
    "open_cells": "--every 1000",
    "performance": "--only mesh --sizes 1",
    "reproduce_updates": "1",
    "response_sweep": "1 --structures gable --budget 0",
    "run_cost": "frame -s unchanged --null-jobs 2",
    "scaling": "'modes of a lattice' 3",
    "solid_drawings": "",
    "store": "--results 500 --times 0",
    "time_left": "frame",
    "truth_sweep": "run fixed-3-mass-2 --set shear --jobs 1 --results truth.jsonl",
    "tuning": "global --structures 3 --jobs 1",
}
# What is not for a test: packages of npm, and a browser with a store of everything.
ELSEWHERE = {"drawing_libraries", "report_speed"}


def test_a_setting_is_chosen_on_one_half_and_stated_on_the_other() -> None:
    names = ("x", "x:lucky=true", "x:good=true")
    factors = {"x": (1.0, 1.0), "x:lucky=true": (0.2, 3.0), "x:good=true": (0.5, 0.5)}
    logs = {
        name: {s: math.log(pair[i]) for i, half in enumerate(("ab", "cd")) for s in half}
        for name, pair in factors.items()
    }
    found = tuned("x", names, logs, {"a", "b"})
    assert (found.best, found.default, found.tuned) == ("lucky=true", 1.0, pytest.approx(3.0))
    assert found.best_of_all == ("good=true", pytest.approx(0.5), 1.0)
    assert found.gain == "-"  # two structures give no interval


def test_the_page_of_performance_has_the_kept_figures() -> None:
    kept = json.loads(performance.KEPT.read_text(encoding="utf-8"))
    page = performance.PAGE.read_text(encoding="utf-8")
    shown = page.partition(performance._BEGIN)[2].partition(performance._END)[0]
    assert shown == performance.page_of(kept) + "\n"


@pytest.mark.nightly
def test_a_hundred_fresh_sets_are_identified() -> None:
    with ProcessPoolExecutor(2) as pool:
        scores = list(pool.map(one, [(seed, 3) for seed in range(1000, 1100)]))
    assert sum(item.missed == 0 for item in scores) >= 95
    assert sum(item.within for item in scores) >= 95
    for name in NAMES:
        assert 0.85 <= covered(scores, name) <= 0.97


def test_every_benchmark_with_a_command_line_is_known() -> None:
    files = (ROOT / "benchmarks").glob("*.py")
    commands = {file.stem for file in files if "__main__" in file.read_text(encoding="utf-8")}
    assert commands == SHORT.keys() | ELSEWHERE


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tree with docs of its own, into which benchmarks write."""
    made = tmp_path_factory.mktemp("tree")
    shutil.copy(ROOT / "README.md", made)
    for name in ("benchmarks", "docs"):
        shutil.copytree(ROOT / name, made / name)
    for part in ROOT.iterdir():
        if not (made / part.name).exists() and not part.name.startswith("."):
            (made / part.name).symlink_to(part)
    return made


@pytest.mark.parametrize(("name", "words"), SHORT.items(), ids=SHORT)
def test_a_benchmark_runs(
    name: str,
    words: str,
    tree: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tree)
    monkeypatch.syspath_prepend(tree / "benchmarks")
    monkeypatch.setattr(sys, "argv", [name, *shlex.split(words)])
    # They import each other, and what was imported before writes to the docs of this tree.
    own = {file.stem for file in (tree / "benchmarks").glob("*.py")} - {"conftest"}
    before = {known: sys.modules.pop(known) for known in own & sys.modules.keys()}
    code: object = 0
    try:
        runpy.run_path(str(tree / "benchmarks" / f"{name}.py"), run_name="__main__")
    except SystemExit as end:
        code = end.code
    finally:
        for known in own:
            sys.modules.pop(known, None)
        sys.modules.update(before)
    assert not code
    assert any(capfd.readouterr())
