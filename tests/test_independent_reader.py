"""Hand-written case folders through femubench and through a second reader that shares nothing."""

from __future__ import annotations

import ast
import importlib.util
import shutil
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from femubench import Case, Model, solve_modes
from femubench.core.case.reader import read_case

HERE = Path(__file__).parent
FOLDERS = ("ladder-out-of-plane", "gable-in-plane")


@pytest.fixture(scope="module")
def independent() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "independent_reader", HERE / "independent_reader.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_the_second_reader_shares_nothing() -> None:
    tree = ast.parse((HERE / "independent_reader.py").read_text())
    names = {alias.name for n in ast.walk(tree) if isinstance(n, ast.Import) for alias in n.names}
    names |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert not {name for name in names if name.startswith(("femubench", "core"))}


@pytest.fixture(params=zip(FOLDERS, ("euler-bernoulli", "timoshenko"), strict=True))
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a copy of a folder with each beam theory."""
    name, beam = request.param
    copy = tmp_path / name
    shutil.copytree(HERE / "handwritten" / name, copy)
    text = (copy / "case.toml").read_text()
    for theory in ("euler-bernoulli", "timoshenko"):
        text = text.replace(f'beam = "{theory}"', f'beam = "{beam}"')
    if beam == "timoshenko":
        text = text.replace("A = 1.0e-4\n", "A = 1.0e-4\nkappa = 0.6\n")
    (copy / "case.toml").write_text(text)
    return copy


def elastic(model: Model, count: int) -> np.ndarray:  # type: ignore[type-arg]
    modes = solve_modes(model)
    assert not modes.rigid.any()
    return modes.natural_frequencies[:count]


def test_frequencies_agree(independent: ModuleType, folder: Path) -> None:
    case = read_case(folder)
    expected = independent.IndependentCase(folder).frequencies
    assert len(expected) == case.model.size
    np.testing.assert_allclose(elastic(case.model, 25), expected[:25], rtol=1e-8)


def test_readings_agree(independent: ModuleType, folder: Path) -> None:
    case = read_case(folder)
    expected = independent.IndependentCase(folder).readings()[:, :10]
    shapes = solve_modes(case.model).shapes[:, :10]
    found = case.model.observe(case.measurement.sensors) @ shapes
    sign = np.sign(np.einsum("ij,ij->j", found, expected))
    assert np.abs(expected).max(axis=0).min() > 1e-3
    np.testing.assert_allclose(found * sign, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_modifications_agree_and_do_not_carry_over(independent: ModuleType, folder: Path) -> None:
    case: Case = read_case(folder)
    assert case.modifications
    for index, change in enumerate(case.modifications):
        modified = case.model.attach(change.masses, change.springs)
        expected = independent.IndependentCase(folder, index).frequencies
        np.testing.assert_allclose(elastic(modified, 20), expected[:20], rtol=1e-8)
