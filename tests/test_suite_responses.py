"""The cases with responses of solids: complete, of the suite's test, passive, and as computed."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from femubench import read_case
from femubench.core.modal.questions import question_measurement
from truths.responses import FOLDER, NAMES, record_responses
from truths.suite import SUITE, structures


def contents(file: Path) -> dict[str, Any]:
    return tomllib.loads(file.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", NAMES)
def test_a_case_is_that_of_the_suite_with_responses(name: str) -> None:
    """Nothing but name and keys is another one, and force times velocity takes no power out."""
    folder = FOLDER / name
    own, plain = (contents(path / "case.toml") for path in (folder, SUITE / name))
    split, named = own["measurement"].pop("responses"), own["case"].pop("name")
    assert own["case"].pop("structure") == plain["case"].pop("name") == f"suite/{name}"
    assert (own["measurement"].pop("frfs"), named) == ("responses.csv", f"suite-responses/{name}")
    assert own == plain
    for path in (SUITE / name).glob("*.csv"):
        assert (folder / path.name).read_bytes() == path.read_bytes()
    assert (folder / "responses.csv").stat().st_size < 200_000
    assert len(split["held_out_sensors"]) >= 2
    case = read_case(folder)
    frfs = case.frfs
    assert frfs is not None
    at = frfs.responses.labels.index(frfs.references.labels[0])
    power = (2j * np.pi * frfs.frequencies * frfs.receptances[:, at, 0]).real
    std = 2.0 * np.pi * frfs.frequencies * frfs.receptance_std[:, at, 0]
    assert (power > -5.0 * std).all()
    assert (power > 5.0 * std).any()
    assert question_measurement(case.model, case.used_measurement()) == ()
    assert not contents(FOLDER / "suite-responses.toml")[name]["default"]


def test_figures_of_the_docs_are_those_of_the_table() -> None:
    docs = SUITE.parents[1] / "docs"
    table = pd.read_csv(docs / "data" / "suite-responses.csv")
    mean = table.groupby(["case", "strategy"])[["gain", "responses_db"]].mean().unstack()
    gain, error = mean["gain"], mean["responses_db"]
    assert sorted(gain.index) == sorted(NAMES)
    text = (docs / "strategies.md").read_text(encoding="utf-8")
    for name in ("global", "local", "spring", "offset", "bayesian"):
        pair = [name, f"{name}:responses=true"]
        more = gain[pair[1]] - gain[pair[0]]
        cells = [f"`{name}`", *(f"{v:.2f}" for v in gain[pair].mean())]
        cells += [f"{more.mean():+.2f} ({more.sem():.2f})", f"{(more > 0.0).sum()}"]
        cells += [f"{v:.1f}" for v in error[pair].median()]
        assert f"| {' | '.join(cells)} |" in text
    for name in ("response-function", "dynamic-residual"):
        words = "" if name == "response-function" else "standard error "
        own = gain[name]
        assert f"has a gain of {own.mean():.2f} ({words}{own.sem():.2f})" in " ".join(text.split())
    ahead = gain["dynamic-residual"] - gain["shifted"]
    assert f"and {ahead.mean():.2f} ({ahead.sem():.2f}) more than the ratios" in text
    assert gain.mean().idxmax() == "dynamic-residual"
    one = error.loc["pi-portal"].map("{:.1f}".format)
    assert f"{one['offset']} to {one['offset:responses=true']} dB by them" in text


@pytest.mark.slow(15)
def test_responses_are_those_of_the_solid() -> None:
    """The kept table is computed anew, and as in the generator compared with direct solutions."""
    structure = structures()["tee-bridge"]
    table, _ = record_responses(structure, SUITE / structure.name)
    kept = pd.read_csv(FOLDER / structure.name / "responses.csv")
    assert list(table.columns) == list(kept.columns)
    for name in table.columns[1:]:
        made, stored = (np.array([complex(v) for v in t[name]]) for t in (table, kept))
        assert np.abs(made - stored).max() < 1e-3 * np.abs(stored).max()
