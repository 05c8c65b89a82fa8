"""Modes in MATLAB files: common names, names of the case, eigenvalues, labels."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from femubench import InputError, read_case
from femubench.core.case.case import Case
from femubench.plugins.readers.matlab import MatlabReader
from femubench.plugins.readers.modal_variables import read_modal

CASES = Path(__file__).parent / "cases"
SHAPES = np.array([[1.0, 0.5], [0.5, -1.0], [0.25, 0.75]])
HERTZ = np.array([10.0, 20.0])


def test_common_names(tmp_path: Path) -> None:
    found = modes(
        tmp_path, f=HERTZ, phi=SHAPES, zeta=[0.01, 0.02], nodes=[3, 5, 7], directions=[3, 3, 1]
    )
    np.testing.assert_array_equal(found.frequencies, HERTZ)
    np.testing.assert_array_equal(found.shapes, SHAPES)
    np.testing.assert_array_equal(found.damping, [0.01, 0.02])
    assert found.sensors.labels == ("3:z", "5:z", "7:x")
    assert np.isnan(found.frequency_std).all()
    assert np.isnan(found.shape_std).all()


def modes(folder: Path, **variables: Any) -> Any:
    """Return what is read of variables of two dimensions, as MATLAB has them."""
    return read_modal({k: np.atleast_2d(v) for k, v in variables.items()}, folder / "test.mat", {})


def test_eigenvalues_with_deviations(tmp_path: Path) -> None:
    """sigma of (2 pi f)^2 is 8 pi^2 f times that of f: checked against draws."""
    std = np.array([0.03, 0.02])
    draws = np.random.default_rng(1).normal(HERTZ, std, (200_000, 2))
    squared = np.square(2.0 * np.pi * draws)
    found = modes(
        tmp_path, lambdaExp=np.square(2 * np.pi * HERTZ), std_lambdaExp=squared.std(axis=0)
    )
    np.testing.assert_allclose(found.frequencies, HERTZ)
    np.testing.assert_allclose(found.frequency_std, std, rtol=0.01)


def test_shapes_lying_down_and_complex(tmp_path: Path) -> None:
    turned = SHAPES.T * np.exp(1j * np.array([[0.4], [1.6]]))
    found = modes(tmp_path, frequencies=HERTZ, shapes=turned)
    for k in range(2):
        cosine = found.shapes[:, k] @ SHAPES[:, k]
        assert abs(cosine) == pytest.approx(np.sum(SHAPES[:, k] ** 2))


@pytest.mark.parametrize(
    ("variables", "what"),
    [
        ({"K": np.eye(3)}, "no frequencies .*variables frequencies"),
        ({"f": [10.0, -1.0]}, "frequencies: one is not positive"),
        ({"f": HERTZ, "phi": np.ones((3, 4))}, "shapes: 3 x 4 .*2 columns"),
        ({"f": HERTZ, "phi": SHAPES, "std_phi": np.ones((2, 2))}, "shape_std: 2 x 2 .*3 x 2"),
        ({"f": HERTZ, "phi": SHAPES, "node": [1, 2]}, "nodes: 2 entries .*3"),
        ({"f": HERTZ, "phi": SHAPES, "labels": ["a", "b", "a"]}, "'a' is listed twice"),
        ({"f": HERTZ, "phi": SHAPES, "direction": ["x", "y", "q"]}, "directions: 'q'"),
        ({"f": HERTZ, "zeta": [0.1]}, "damping: 1 numbers .*2"),
        ({"f": [10.0, np.nan]}, "frequencies: not finite"),
    ],
)
def test_what_does_not_fit(tmp_path: Path, variables: dict[str, Any], what: str) -> None:
    with pytest.raises(InputError, match=what):
        modes(tmp_path, **variables)


def case_of(tmp_path: Path, keys: str, **variables: Any) -> Case:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    text = (folder / "case.toml").read_text().split("[[modification]]")[0]
    text = text.replace("modes.csv", "test.mat").replace("held_out = [4]", keys)
    (folder / "case.toml").write_text(text)
    scipy.io.savemat(folder / "test.mat", variables)
    return read_case(folder, readers=(MatlabReader(),))


def test_a_case_names_variables_and_takes_stated_deviations(tmp_path: Path) -> None:
    labels = ["turn", "left_top", "girder"]
    case = case_of(
        tmp_path,
        'variables = {frequencies = "peaks", shapes = "U", shape_std = "sU"}',
        peaks=HERTZ, U=SHAPES, sU=0.03 * np.ones((3, 2)), labels=labels, phi=np.zeros((9, 9)),
    )  # fmt: skip
    m = case.measurement
    np.testing.assert_array_equal(m.shapes[[3, 0, 2]], SHAPES)
    np.testing.assert_array_equal(m.shape_std[[3, 0, 2]], 0.03)
    np.testing.assert_allclose(m.frequency_std, 0.005 * HERTZ)
    assert np.isnan(m.shapes[1]).all()


def test_names_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no variable 'peaks' .*f"):
        case_of(tmp_path, 'variables = {frequencies = "peaks"}', f=HERTZ)


def test_the_test_of_a_real_bridge() -> None:
    path = Path(__file__).parents[2] / "shared" / "data" / "bridge" / "ExpModeInfo_FEM.mat"
    if not path.exists():
        pytest.skip("the footbridge is not next to the repository")
    found = MatlabReader().read_modes(path)
    np.testing.assert_allclose(found.frequencies, [4.063, 4.550, 6.823, 8.653, 11.498], atol=1e-3)
    np.testing.assert_allclose(found.frequency_std, [0.03, 0.02, 0.04, 0.07, 0.23], atol=6e-3)
    assert found.shapes.shape == (58, 5)
    assert found.shape_std.min() < 1e-15  # of what scales a shape
