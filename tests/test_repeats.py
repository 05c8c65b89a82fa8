"""Repeats give means and a covariance, which weights, the diagnosis and noise draws use."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from femubench import InputError, Measurement, Sensors, read_case
from femubench.core.case.case import Case
from femubench.core.case.writing import write_case
from femubench.core.fit.residuals import Data as DiagnosisData
from femubench.core.modal.correlated_errors import shrunk_correlation
from femubench.core.update.posterior_sampling import Target
from femubench.core.update.residuals import Targets as UpdateData

CASES = Path(__file__).parent / "cases"
HERTZ = np.array([10.0, 25.0, 60.0])
STD = np.array([0.1, 0.2, 0.9])
CORRELATION = np.array([[1.0, 0.8, 0.3], [0.8, 1.0, 0.5], [0.3, 0.5, 1.0]])
COVARIANCE = STD[:, None] * CORRELATION * STD


def measured(correlation: np.ndarray | None = CORRELATION) -> Measurement:
    none = np.zeros((0, 3))
    sensors = Sensors((), np.zeros((0, 3)), ())
    nan = np.full(3, np.nan)
    return Measurement(sensors, (1, 2, 3), HERTZ, STD, nan, none, none, None, correlation)


def test_residuals_of_a_diagnosis_have_the_chi_square_of_the_covariance() -> None:
    predicted = HERTZ + np.array([[0.3, -0.2, 1.0], [0.1, 0.3, -0.5]])
    data = DiagnosisData(measured(), np.zeros(0))
    found = data.residual(predicted, np.zeros((2, 0, 3)), np.zeros(2))
    apart = HERTZ - predicted
    expected = np.einsum("gi,ij,gj->g", apart, np.linalg.inv(COVARIANCE), apart)
    np.testing.assert_allclose(np.square(found).sum(axis=1), expected)
    np.testing.assert_allclose(data.by_mode(found[0]), apart[0] / STD)


def test_slopes_are_those_of_the_residuals() -> None:
    data = DiagnosisData(measured(), np.zeros(0))
    direction = np.array([[1.0], [-2.0], [0.5]])
    none = np.zeros((1, 0, 3))
    one, other = (
        data.residual((HERTZ + step * direction[:, 0])[None], none, np.zeros(1))[0]
        for step in (0.0, 1.0)
    )
    slope = data.slope(direction, none[0], np.zeros((0, 3, 1)), np.zeros(1))
    np.testing.assert_allclose(slope[:, 0], one - other)


def test_weights_of_strategies_are_those_of_the_covariance_of_what_is_paired() -> None:
    data = UpdateData(measured(), residual="frequency", statistical=True)
    apart = np.array([0.2, -0.1, 0.7])
    for there in (np.array([True, True, True]), np.array([True, False, True])):
        rows = data.independent(data.weight * apart, there)[there]
        inside = np.linalg.inv(COVARIANCE[there][:, there])
        assert rows @ rows == pytest.approx(apart[there] @ inside @ apart[there])


def test_noise_draws_have_the_covariance() -> None:
    rng = np.random.default_rng(3)
    draws = np.array([measured().with_noise(rng).frequencies for _ in range(10_000)])
    np.testing.assert_allclose(np.corrcoef(draws.T), CORRELATION, atol=0.02)
    np.testing.assert_allclose(draws.std(axis=0), STD, rtol=0.02)


def test_selection_and_errors_of_others_keep_it_whole() -> None:
    some = measured().select((3, 1)).frequency_covariance
    assert some is not None
    np.testing.assert_allclose(some, COVARIANCE[np.ix_([2, 0], [2, 0])])
    more = np.array([0.5, 0.1, 0.3])
    wide = measured().widen(more).frequency_covariance
    assert wide is not None
    np.testing.assert_allclose(wide, COVARIANCE + np.diag(more**2))
    assert measured(None).frequency_covariance is None


def test_sampling_has_the_density_of_the_covariance() -> None:
    std = STD / HERTZ
    own: Any = SimpleNamespace(measurement=measured(), data=(np.log(HERTZ), std, np.ones(3)))
    apart = np.array([[0.01, 0.02, -0.01], [0.0, 0.005, 0.02]])
    overhead = 0.01**2
    found = Target._misfit(own, apart, np.tile(std**2 + overhead, (2, 1)))
    covariance = std[:, None] * CORRELATION * std + overhead * np.eye(3)
    expected = -2.0 * multivariate_normal(cov=covariance).logpdf(apart) - 3 * np.log(2 * np.pi)
    np.testing.assert_allclose(found, expected)


def test_shrinking_pays_with_few_repeats_and_goes_with_many() -> None:
    rng, error = np.random.default_rng(5), np.zeros(2)
    truth = np.array([[0.4 ** abs(i - j) for i in range(6)] for j in range(6)])
    root = np.linalg.cholesky(truth)
    for _ in range(200):
        rows = rng.standard_normal((6, 6)) @ root.T
        found, share = shrunk_correlation(rows)
        assert np.linalg.eigvalsh(found)[0] > 0.0
        assert 0.0 <= share <= 1.0
        error += [np.square(found - truth).sum(), np.square(np.corrcoef(rows.T) - truth).sum()]
    assert error[0] < 0.6 * error[1]
    many, share = shrunk_correlation(rng.standard_normal((5000, 6)) @ root.T)
    assert share < 0.02
    np.testing.assert_allclose(many, truth, atol=0.05)


# --- in a case ------------------------------------------------------------------------------------


def folder_with(tmp_path: Path, key: str, table: str) -> Path:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    text = (folder / "case.toml").read_text()
    text = text.replace("[measurement]", f'[measurement]\n{key} = "{key}.csv"', 1)
    (folder / "case.toml").write_text(text)
    (folder / f"{key}.csv").write_text(table)
    return folder


def repeats(count: int) -> tuple[str, np.ndarray]:
    base = read_case(CASES / "in-plane").measurement
    rng = np.random.default_rng(0)
    common = rng.standard_normal((count, 1))
    rows = base.frequencies[:3] * (1.0 + 0.01 * common + 0.002 * rng.standard_normal((count, 3)))
    lines = [",".join(["repeat", *map(str, base.numbers[:3])])]
    lines += [",".join([f"day {i}", *(f"{v:.9g}" for v in row)]) for i, row in enumerate(rows)]
    return "\n".join(lines) + "\n", rows


def test_means_and_covariance_of_the_means(tmp_path: Path) -> None:
    table, rows = repeats(12)
    case = read_case(folder_with(tmp_path, "repeats", table + "late,,1,1\n"))
    m = case.measurement
    np.testing.assert_allclose(m.frequencies[:3], rows.mean(axis=0))
    np.testing.assert_allclose(m.frequency_std[:3], rows.std(axis=0, ddof=1) / np.sqrt(12))
    assert m.frequency_correlation is not None
    assert m.frequency_correlation[0, 1] > 0.8
    assert "means of 12 repeats of 3 modes (1 more lack a mode)" in case.notes[0]
    before = read_case(CASES / "in-plane").measurement
    assert m.frequencies[3] == before.frequencies[3]
    assert m.frequency_std[3] == before.frequency_std[3]
    assert not m.frequency_correlation[3, :3].any()


def test_few_repeats_are_shrunk_and_it_is_said(tmp_path: Path) -> None:
    table, _ = repeats(3)
    case = read_case(folder_with(tmp_path, "repeats", table))
    assert "correlations only roughly, which were shrunk by" in case.notes[0]
    assert case.measurement.frequency_correlation is not None
    assert np.linalg.eigvalsh(case.measurement.frequency_correlation)[0] > 0.0


def test_covariance_reads_back(tmp_path: Path) -> None:
    table, _ = repeats(8)
    case: Case = read_case(folder_with(tmp_path, "repeats", table))
    write_case(tmp_path / "again", case)
    again = read_case(tmp_path / "again").measurement
    assert again.frequency_correlation is not None
    np.testing.assert_array_equal(again.frequency_std, case.measurement.frequency_std)
    np.testing.assert_allclose(
        again.frequency_correlation, case.measurement.frequency_correlation, atol=1e-12
    )
    assert replace(again).select((1,)).frequency_covariance is not None


@pytest.mark.parametrize(
    ("key", "table", "what"),
    [
        ("repeats", "1,2\n10,30\n11,31\n", r"2 repeats with all 2 modes .*3 at least"),
        ("repeats", "1,9\n10,30\n", r"repeats.csv:1: 9: unknown column"),
        ("repeats", "repeat\na\n", r"repeats.csv:1: no mode"),
        ("repeats", "1\n-3\n", r"repeats.csv:2: 1: '-3'"),
        ("covariance", "mode,1,2\n1,1,0\n", r"rows 1 .*one row a column"),
        ("covariance", "mode,1,2\n1,1,2\n2,2,1\n", "not positive definite"),
        ("covariance", "mode,1,2\n1,1,0.5\n2,0.1,1\n", "not a symmetric matrix"),
        ("covariance", "mode,1\n1,0\n", "positive diagonal"),
    ],
)
def test_tables_that_cannot_be(tmp_path: Path, key: str, table: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read_case(folder_with(tmp_path, key, table))


def test_one_of_the_two(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, "repeats", "1\n1\n1\n1\n")
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace("repeats =", 'covariance = "c.csv"\nrepeats ='))
    with pytest.raises(InputError, match="both repeats and covariance"):
        read_case(folder)


def test_rounded_repeats_that_go_together_can_be_drawn() -> None:
    correlation, _ = shrunk_correlation(np.array([[1.0, 2.0], [1.0, 2.0], [2.0, 3.0], [2.0, 3.0]]))
    assert correlation[0, 1] == pytest.approx(1.0, abs=1e-5)
    assert np.isfinite(np.linalg.cholesky(correlation)).all()
