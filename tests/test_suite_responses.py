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
from truths.eigenmodes import attach
from truths.modes_of import assembled, mesh_of
from truths.responses import FOLDER, NAMES, accelerances, check_directly, record_responses, reduced
from truths.seats import observed
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


@pytest.mark.slow(15)
def test_responses_are_those_of_the_solid() -> None:
    """The kept table is computed anew; without the static responses the check fails."""
    structure = structures()["tee-bridge"]
    table, _ = record_responses(structure, SUITE / structure.name)
    kept = pd.read_csv(FOLDER / structure.name / "responses.csv")
    assert list(table.columns) == list(kept.columns)
    for name in table.columns[1:]:
        made, stored = (np.array([complex(v) for v in t[name]]) for t in (table, kept))
        assert np.abs(made - stored).max() < 1e-3 * np.abs(stored).max()
    coarse = assembled(structure, mesh_of(structure, structure.size[0]))
    rows, lines = observed(structure, coarse, structure.sensors), np.array([80.0, 200.0])
    system = attach(structure, coarse, structure.lumps, structure.springs)
    values, readings = reduced(system, rows, structure.guess, 240.0)
    for count in (len(values), 30):
        few = values[:count], readings[:, :count], np.zeros(count)
        found = -accelerances(*few, 3, lines).real / (2.0 * np.pi * lines[:, None]) ** 2
        if count == len(values):
            check_directly(system, rows, 3, lines, found)
            continue
        with pytest.raises(ValueError, match="a receptance at 80 Hz is off by"):
            check_directly(system, rows, 3, lines, found)
