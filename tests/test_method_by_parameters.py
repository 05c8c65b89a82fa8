"""How a balanced layout is taken apart, and that the documents print what the data say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from printed_boards import as_printed

from benchmarks.method_by_parameters import FACTORS, analyse, read_gains, summarise

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
    # Of noise alone no factor has a part, once chance is taken off.
    assert summarise(noise).set_index("source")["omega2"].iloc[:3].abs().max() < 0.1


def test_the_documents_print_what_the_data_say() -> None:
    text = (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
    printed = text.partition("<!-- method-by-parameters -->")[2].partition("<!--")[0]
    lines = [line.strip("|").split("|") for line in printed.strip().splitlines()[2:]]
    found = summarise(read_gains())
    for line, row in zip(lines, found.itertuples(index=False), strict=True):
        assert line[0].strip() == row.source
        assert int(line[1]) == row.df
        for cell, value in zip(line[2:5], (row.eta2, row.low, row.high), strict=True):
            assert value == as_printed(cell.strip()), row.source
