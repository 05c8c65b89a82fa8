"""Models in the memory of OpenSees: its own frequencies, labels, and the way into a case."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_peer import opensees_environment

import femubench
from femubench import fem

OnAdvance = tuple[dict[str, Any], Path]


@pytest.fixture(scope="module")
def stated(tmp_path_factory: pytest.TempPathFactory) -> OnAdvance:
    """Return what `opensees_models.py` says, and the folder with the matrices of one model."""
    output = tmp_path_factory.mktemp("models") / "stated.json"
    script = Path(__file__).with_name("opensees_models.py")
    subprocess.run(
        [sys.executable, str(script), str(output)],
        env=opensees_environment() | {"PYTHONPATH": str(Path(__file__).parents[1])},
        check=True,
        capture_output=True,
    )
    return json.loads(output.read_text()), output.parent / "matrices"


@pytest.mark.parametrize("name", ["bent", "loaded", "floor", "plate"])
def test_frequencies_are_those_of_opensees(stated: OnAdvance, name: str) -> None:
    model = stated[0][name]
    count = len(model["own"])
    assert count >= 3
    np.testing.assert_allclose(model["read"][:count], model["own"], rtol=1e-9)
    assert model["moved"] == 0.0


def test_rows_are_those_that_no_constraint_takes(stated: OnAdvance) -> None:
    labels = {name: model["labels"] for name, model in stated[0].items() if name != "refused"}
    six = ("x", "y", "z", "rx", "ry", "rz")
    assert labels["bent"] == [f"{n}:{d}" for n in (2, 3) for d in six] + [f"5:{d}" for d in six[1:]]
    assert labels["loaded"][-4:] == ["4:rz", "5:x", "5:y", "5:rz"]
    assert labels["floor"][:3] == ["11:z", "11:rx", "11:ry"]
    assert labels["floor"][-3:] == ["20:x", "20:y", "20:rz"]
    assert len(labels["plate"]) == 4 * 3 * 2 * 3


def test_what_is_no_model_of_displacements_is_refused(stated: OnAdvance) -> None:
    nothing, still, wet = stated[0]["refused"]
    assert nothing == "OpenSees has no model in memory"
    assert still == "nothing can move in the model of OpenSees"
    assert wet.startswith("node 2 has 4 degrees of freedom in 2 dimensions")


def test_it_is_kept_as_the_files_of_a_case(stated: OnAdvance, tmp_path: Path) -> None:
    known, folder = stated
    (folder / "case.toml").write_text(
        '[case]\nname = "bent"\n[model]\nkind = "matrices"\nmass = "mass.mtx"\n'
        'stiffness = "stiffness.mtx"\ndofs = "dofs.csv"\n[measurement]\nmodes = "modes.csv"\n'
        "used = [1]\n"
    )
    (folder / "modes.csv").write_text("mode,frequency,frequency_std,damping\n1,20.0,0.1,\n")
    case = femubench.read_case(folder)
    found = np.sqrt(femubench.solve_modes(case.model).eigenvalues)
    np.testing.assert_allclose(found[:6], known["bent"]["own"], rtol=1e-9)
    again = fem.write_matrices(case.model, tmp_path / "again")
    for path in again:
        assert path.read_bytes() == (folder / path.name).read_bytes()
