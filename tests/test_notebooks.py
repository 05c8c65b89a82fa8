"""The notebooks of `examples/` run, say what is true, and are kept as they are meant to be."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from femubench.scenarios.matlab_footbridge import TEST, VARIABLE

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
# Its data are not ours to ship: who has none of them reads the outputs.
BRIDGE = ROOT / "examples" / "8-footbridge.ipynb"
BRIDGE_DATA = Path(os.environ.get(VARIABLE, ROOT.parent / "shared" / "data" / "bridge"))
ENDLESS = 600  # s of a processor, for a whole notebook


def read(path: Path) -> nbformat.NotebookNode:
    return nbformat.read(path, as_version=4)


def code(path: Path) -> list[str]:
    """Return the code cells as Python, magics left out."""
    cells = [cell.source for cell in read(path).cells if cell.cell_type == "code"]
    return ["\n".join(x for x in cell.splitlines() if x[:1] != "%") for cell in cells]


@pytest.mark.nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path: Path, tmp_path: Path) -> None:
    """Every cell ends without an error; the facts are `assert`s in the cells."""
    if path == BRIDGE and not (BRIDGE_DATA / TEST).is_file():
        pytest.skip(f"the files of the footbridge are in no folder {BRIDGE_DATA}")
    shutil.copy(path, tmp_path)
    places = {
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.getenv("PYTHONPATH", "")]),
        "OPENBLAS_NUM_THREADS": "1",
        "IPYTHONDIR": str(tmp_path / ".ipython"),
        # The kernel of this Python, whatever a user has installed under that name.
        "JUPYTER_PREFER_ENV_PATH": "1",
        VARIABLE: str(BRIDGE_DATA),
    }
    kept = {key: value for key, value in os.environ.items() if key != "FEMUBENCH_STORE"}
    # In a process of its own: nbclient leaves sockets open until its process ends.
    command = [sys.executable, "-m", "jupyter", "execute", path.name, "--output=done"]
    done = subprocess.run(
        [*command, "--timeout=-1"],
        cwd=tmp_path,
        env=kept | places,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (ENDLESS, ENDLESS)),
    )
    assert done.returncode == 0, done.stderr[-4000:]
    outputs = [o for cell in read(tmp_path / "done.ipynb").cells for o in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)


def test_they_are_kept_as_they_were_typed_and_teach_facts_by_public_names() -> None:
    """So that a difference in git is one that somebody typed."""
    assert [path.name[0] for path in NOTEBOOKS] == list("12345678")
    for path in NOTEBOOKS:
        data = json.loads(path.read_text(encoding="utf-8"))
        nbformat.validate(data)
        for cell in data["cells"]:
            assert cell.get("execution_count") is None
            assert cell["metadata"] == {}
            assert path == BRIDGE or not cell.get("outputs")
        text = "\n".join(code(path))
        assert text.count("\nassert ") + text.count("\n    assert ") >= 4
        for private in ("femubench.core", "femubench.plugins", "femubench.papers", "seconds"):
            assert private not in text
