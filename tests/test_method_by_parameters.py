"""How a balanced layout is taken apart, and that the documents print what the data say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from printed_boards import as_printed
from scipy.optimize import minimize

from benchmarks.method_by_parameters import FACTORS, analyse, components, read_gains, summarise

ROOT = Path(__file__).parents[1]


def test_effects_that_are_put_in_are_found_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    parts = [rng.standard_normal(shape) for shape in ((12, 1, 1), (1, 5, 1), (1, 1, 4), (1, 5, 4))]
    parts[3] -= parts[3].mean(axis=1, keepdims=True)
    parts[3] -= parts[3].mean(axis=2, keepdims=True)
    found = analyse(sum(parts, np.zeros((12, 5, 4))))
    names = (*FACTORS, "method x parameters")
    for name, part in zip(names, parts, strict=True):
        centred = part - part.mean()
        assert found[name][1] == pytest.approx(np.square(centred).sum() * 240 / part.size), name
    assert sum(found[n][1] for n in found if n not in names) == pytest.approx(0.0, abs=1e-9)
    noise = rng.standard_normal((12, 5, 4))
    assert sum(freedom for freedom, _ in analyse(noise).values()) == noise.size - 1
    squares = sum(size for _, size in analyse(noise).values())
    assert squares == pytest.approx(np.square(noise - noise.mean()).sum())


def test_variance_components_are_those_of_restricted_likelihood() -> None:
    rng = np.random.default_rng(3)
    n, a, b = 8, 3, 2
    drawn = {(n, 1, 1): 0.5, (n, a, 1): 0.3, (n, 1, b): 0.3, (n, a, b): 0.2, (1, a, 1): 1.0}
    gains = sum(size * rng.standard_normal(shape) for shape, size in drawn.items())
    found = components(gains)
    assert found[[0, 3, 4, 6]].min() > 0.0
    # Each random effect is alike in the cells that it covers; fixed ones are the means of cells.
    structures, methods, sets = np.eye(n), np.eye(a), np.eye(b)
    covers = [np.ones((a * b, a * b)), np.kron(methods, np.ones((b, b)))]
    covers += [np.kron(np.ones((a, a)), sets), np.eye(a * b)]
    design = np.kron(np.ones((n, 1)), np.eye(a * b))
    y = gains.ravel()

    def loss(logs: np.ndarray) -> float:
        within = sum(np.exp(log) * cover for log, cover in zip(logs, covers, strict=True))
        weight = np.kron(structures, np.linalg.inv(within))
        normal = design.T @ weight @ design
        rest = y - design @ np.linalg.solve(normal, design.T @ weight @ y)
        logs_of = n * np.linalg.slogdet(within)[1] + np.linalg.slogdet(normal)[1]
        return float(logs_of + rest @ weight @ rest)

    at = np.log(found[[0, 3, 4, 6]])
    assert minimize(loss, at + 0.3, tol=1e-9).x == pytest.approx(at, abs=1e-3)


def test_a_difference_of_methods_alone_is_shown_and_noise_is_not() -> None:
    rng = np.random.default_rng(8)
    noise = 0.1 * rng.standard_normal((20, 8, 4))
    table = summarise(noise + 0.2 * rng.standard_normal((1, 8, 1))).set_index("source")
    assert table.loc["method", "low"] > 0.5 > table.loc["remainder", "high"]
    assert table.loc["method", "p"] < 1e-4 < 0.05 < table.loc["parameters", "p"]
    assert (table.loc[["structure", "parameters", "method x parameters"], "low"] < 1e-3).all()


def test_the_documents_print_what_the_data_say() -> None:
    text = (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
    printed = text.partition("<!-- method-by-parameters -->")[2].partition("<!--")[0]
    lines = [line.strip("|").split("|") for line in printed.strip().splitlines()[2:]]
    found = summarise(read_gains())
    for line, row in zip(lines, found.itertuples(index=False), strict=True):
        assert line[0].strip() == row.source
        assert int(line[1]) == row.df
        for cell, value in zip(line[2:], row[2:], strict=True):
            assert (value == as_printed(cell.strip())) if cell.strip() else np.isnan(value)
