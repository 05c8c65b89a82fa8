"""The footbridge's layout on small made-up data: nothing of the real data is here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.linalg as la

import femubench
from femubench import Case, InputError, solve_modes
from femubench.core.score.scoring import reference_of
from femubench.scenarios.matlab_footbridge import GROUPS, MODEL, TEST, VARIABLE
from tests.command import call_bench

INCH, KIP = 0.0254, 4448.2216152605  # m, N
FLOORS = 12
SIZE = 2 * FLOORS
# Translations and rotations stand in no order, as an equation solver left them.
ORDER = np.random.default_rng(3).permutation(SIZE)
MOVES, TURNS = ORDER[:FLOORS], ORDER[FLOORS:]
STATED = np.array([[0.9], [1.1], [0.5], [0.8], [2.0]])  # of the eigenvalues, 1/s2
Variables = dict[str, Any]


def stiffness_groups() -> dict[str, np.ndarray]:
    """Return a beam of inches and kips on springs, cut into the groups of the real one."""
    parts = {name: np.zeros((SIZE, SIZE)) for name in GROUPS}
    length = 100.0
    rotation = np.array([[12, 6 * length], [6 * length, 4 * length**2]])
    crossed = np.array([[-12, 6 * length], [-6 * length, 2 * length**2]])
    element = 3e4 / length**3 * np.block([[rotation, crossed], [crossed.T, rotation]])
    element[2:, 2:] *= [[1, -1], [-1, 1]]
    for k in range(FLOORS - 1):
        rows = np.ix_(*[[MOVES[k], TURNS[k], MOVES[k + 1], TURNS[k + 1]]] * 2)
        for name, share in (("K_Frame", 0.6), ("K_Truss", 0.1), (f"K_Conc{k + 1}", 0.3)):
            parts[name][rows] += share * element
    for name, floor, value in (("K_y1", 1, 2), ("K_z1", 0, 5), ("K_y2", 9, 2), ("K_z2", 11, 5)):
        parts[name][MOVES[floor], MOVES[floor]] = value
    return parts


def variables() -> tuple[Variables, Variables]:
    """Return the content of both files: the test is of a structure with stiffer springs."""
    parts = stiffness_groups()
    mass = np.zeros((SIZE, SIZE))
    mass[MOVES, MOVES] = np.linspace(0.9e-3, 1.8e-3, FLOORS)
    small = {"K_y1": np.uint8, "K_y2": np.uint8, "K_z1": np.uint16}
    model = {name: part.astype(small.get(name, float)) for name, part in parts.items()}
    model |= {"K_whole": sum(parts.values()), "M0": mass}
    seen = MOVES[[0, 2, 3, 5, 7, 8, 10, 11]]
    model["measDOFs"] = (seen[None, :] + 1).astype(np.uint16)
    values, shapes = condensed(mass, model["K_whole"])
    # The test has the first two in the other order.
    values[:5] = np.array([0.8, 1.05, 1.1, 0.9, 1.04]) * values[[1, 0, 2, 3, 4]]
    shapes = shapes[seen][:, [1, 0, 2, 3, 4]]
    shapes /= shapes[np.abs(shapes).argmax(axis=0), range(5)]
    std = np.full(shapes.shape, 0.03)
    std[shapes == 1.0] = 0.0
    test = {"lambdaExp": values[:5, None], "std_lambdaExp": STATED}
    return model, test | {"psiExp_m": shapes, "std_psiExp": std}


def condensed(mass: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues and shapes in all rows, rotations eliminated as Guyan does."""
    turn = -la.solve(stiffness[np.ix_(TURNS, TURNS)], stiffness[np.ix_(TURNS, MOVES)])
    expand = np.zeros((SIZE, FLOORS))
    expand[MOVES], expand[TURNS] = np.eye(FLOORS), turn
    values, vectors = la.eigh(expand.T @ stiffness @ expand, np.diag(mass[MOVES, MOVES]))
    return values, expand @ vectors


def put(folder: Path, model: Variables, test: Variables) -> Path:
    folder.mkdir(exist_ok=True)
    scipy.io.savemat(folder / MODEL, model)
    scipy.io.savemat(folder / TEST, test)
    return folder


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = put(tmp_path / "bridge", *variables())
    monkeypatch.setenv(VARIABLE, str(folder))
    return folder


@pytest.fixture
def case(data: Path) -> Case:
    return femubench.cases["footbridge"]


def test_massless_rotations_follow_statically(case: Case) -> None:
    model, _ = variables()
    expected, _ = condensed(model["M0"], model["K_whole"])
    found = solve_modes(case.model).natural_frequencies
    assert case.model.size == SIZE
    np.testing.assert_allclose(found, np.sqrt(expected) / (2 * np.pi), rtol=1e-9)
    assert not solve_modes(case.model).rigid.any()


def test_kips_and_inches_become_newtons_and_metres(case: Case) -> None:
    spring = case.model.groups["K_z1"].toarray()
    assert spring[MOVES[0], MOVES[0]] == pytest.approx(5 * KIP / INCH)
    model, _ = variables()
    assert case.model.mass.toarray()[MOVES[0], MOVES[0]] == pytest.approx(0.9e-3 * KIP / INCH)
    moment = model["K_whole"][TURNS[4], TURNS[4]]
    assert case.model.stiffness.toarray()[TURNS[4], TURNS[4]] == pytest.approx(moment * KIP * INCH)
    force = model["K_whole"][TURNS[4], MOVES[3]]
    assert case.model.stiffness.toarray()[TURNS[4], MOVES[3]] == pytest.approx(force * KIP)


def test_modes_pair_by_shape_though_their_order_differs(case: Case) -> None:
    predicted = solve_modes(case.model).natural_frequencies
    used = reference_of(case).blocks["used"].modes
    assert [mode.predicted_hz for mode in used] == pytest.approx(list(predicted[[1, 0, 2]]))
    assert min(mode.mac for mode in used) > 0.99
    assert (case.used, case.held_out) == ((1, 2, 3), (4, 5))


def test_deviations_are_those_of_the_repeats(case: Case) -> None:
    _, test = variables()
    measured = case.measurement
    spread = np.sqrt(test["lambdaExp"] + 1e-4 * STATED) - np.sqrt(test["lambdaExp"] - 1e-4 * STATED)
    expected = spread.ravel() / (2e-4 * 2 * np.pi)
    np.testing.assert_allclose(measured.frequency_std, expected, rtol=1e-5)
    np.testing.assert_allclose(measured.shapes, test["psiExp_m"], rtol=1e-12)
    # A shape is one at a sensor of its own by definition; that is not known without error.
    assert (measured.shape_std > 0.0).all()
    assert (measured.shape_std == 0.03).sum() == (test["std_psiExp"] > 0.0).sum()


def test_a_matrix_method_meets_the_used_modes(case: Case) -> None:
    (result,) = femubench.rank(case, "kabe").results
    assert (result.status, result.reason) == ("ok", "")
    for mode in result.blocks["used"].modes:
        assert mode.predicted_hz == pytest.approx(mode.measured_hz, rel=1e-6)


def test_it_runs_by_name_and_leaves_no_copy(data: Path, tmp_path: Path) -> None:
    words = ("run", "footbridge", "-s", "unchanged", "--store", str(tmp_path / "store"))
    call_bench(*words)
    assert sorted(path.name for path in data.iterdir()) == sorted((MODEL, TEST))
    shown = call_bench("scenarios", "show", "footbridge", code=None)
    assert "24 degrees of freedom, matrices from files" in shown.stdout


def refused(*words: str) -> str:
    result = call_bench(*words, code=None)
    assert (result.exit_code, result.stdout) == (2, "")
    (line,) = result.stderr.splitlines()
    return line


def test_without_the_data_one_line_says_what_to_get_and_what_to_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    line = refused("run", "footbridge")
    for part in (VARIABLE, MODEL, TEST, "ywang-structures/Structural-Model-Updating"):
        assert part in line
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    line = refused("run", "footbridge")
    assert line.startswith(f"bench: {tmp_path / 'nowhere'}: missing file {MODEL}")
    with pytest.raises(InputError, match="names the wrong folder"):
        femubench.cases["footbridge"]


@pytest.mark.parametrize(
    ("file", "change", "says"),
    [
        (MODEL, {"M0": None}, "no variable 'M0'"),
        (MODEL, {"K_Conc7": np.eye(3)}, "K_Conc7 is float64 of 3 x 3 (expected numbers, 24 x 24)"),
        (
            MODEL,
            {"measDOFs": np.arange(1, 9)[None, :] + 20},
            f"{MODEL}: measDOFs has row 21 (expected rows with mass",
        ),
        (TEST, {"psiExp_m": np.ones((7, 5))}, "psiExp_m is float64 of 7 x 5 (expected numbers, 8"),
        (TEST, {"std_psiExp": "none"}, "std_psiExp is str"),
    ],
)
def test_wrong_variables_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, change: Variables, says: str
) -> None:
    contents = {MODEL: variables()[0], TEST: variables()[1]}
    wrong = {k: v for k, v in (contents[file] | change).items() if v is not None}
    contents[file] = wrong
    monkeypatch.setenv(VARIABLE, str(put(tmp_path / "wrong", contents[MODEL], contents[TEST])))
    assert says in refused("run", "footbridge")
    (tmp_path / "wrong" / MODEL).write_bytes(b"not from MATLAB" * 20)
    assert f"{MODEL}: cannot be read" in refused("run", "footbridge")
