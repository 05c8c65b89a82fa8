"""Cut and flipped files of other programs: read, or refused in one line, in little memory."""

from __future__ import annotations

import resource
import shutil
from collections import Counter
from contextlib import nullcontext, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
from bytes_changed import broken
from test_fuzz import outcome_of
from test_model_readers import FORMATS, JOB, WRITERS, Files, base, rounded

from femubench import FemubenchError
from femubench.core.case.model_files import ModelFiles, read_model
from femubench.core.plugin.loader import load_plugins

FEW, MANY, MANY_APART = 6, 3000, 60
LARGEST = 2**30  # bytes that reading may take
REAL = ("ascii_fabiola.op4", "matrix_factory.pch", "heat_engine_housing.uff",
        "mesh_Oros-modal_uff15_uff2412.uff", "uff55_translation.uff")  # fmt: skip
APART = ("hdf5", "matlab", "matlab_73", "ansys")  # read in a process of their own
READERS = load_plugins().readers


def calculix(folder: Path) -> Files:
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        shutil.copy(JOB.with_suffix(suffix), folder)
    return {"file": "job.inp"}


def ansys(folder: Path) -> Files:
    from importlib.util import find_spec

    package = find_spec("ansys.mapdl.reader")
    assert package is not None
    assert package.origin is not None
    for name in ("file.full", "file.rst"):
        shutil.copy(Path(package.origin).parent / "examples" / name, folder)
    return {"file": "file.full", "dofs": "file.rst"}


def real(name: str, folder: Path) -> Files:
    shutil.copy(FORMATS / name, folder)
    return {"file": name}


def files_of(kind: str, folder: Path) -> Files:
    if kind in WRITERS:
        return WRITERS[kind](rounded(base()), folder)
    own = {"calculix": calculix, "ansys": ansys}
    return own[kind](folder) if kind in own else real(kind, folder)


def peak() -> int:
    """Return the most memory that this process and its children have had, in bytes."""
    own, others = (resource.getrusage(who).ru_maxrss
                   for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))  # fmt: skip
    return 1024 * max(own, others)


def read(kind: str, folder: Path, files: Files) -> None:
    named = {key: folder / name for key, name in files.items()}
    if Path(kind).suffix in (".uff",):
        READERS["universal file"].read_modes(named["file"])
    else:
        paths = ModelFiles(named["file"], named.get("mass"), named.get("dofs"))
        read_model(paths, tuple(READERS.values()))


def check(kind: str, folder: Path, count: int, seed: int) -> Counter[str]:
    """Break one file of a model at a time."""
    files = files_of(kind, folder)
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    # What is imported late is imported now; a real file may be no model.
    with suppress(FemubenchError) if kind in REAL else nullcontext():
        read(kind, folder, files)
    outcomes: Counter[str] = Counter()
    rng = np.random.default_rng(seed)
    highest = peak()
    # What other tests have left in this process is no fault of a reader.
    before = psutil.Process().memory_info().rss
    for _ in range(count):
        file = folder / names[rng.integers(len(names))]
        whole = file.read_bytes()
        file.write_bytes(broken(whole, rng))
        try:
            # A process of its own is no fault of the reader that needs it.
            outcomes[outcome_of(lambda: read(kind, folder, files), folder, kind not in APART)] += 1
        finally:
            file.write_bytes(whole)
    assert peak() <= max(highest, before + LARGEST)
    return outcomes


@pytest.mark.parametrize("kind", [*WRITERS, "calculix", *REAL])
def test_a_few(kind: str, tmp_path: Path) -> None:
    count = 1 if kind in APART else FEW
    assert check(kind, tmp_path, count, 0).total() == count


@pytest.mark.nightly
@pytest.mark.parametrize("kind", [*WRITERS, "calculix", "ansys", *REAL])
def test_many(kind: str, tmp_path: Path) -> None:
    count = MANY_APART if kind in APART else MANY
    outcomes = check(kind, tmp_path, count, 1)
    print(f"{kind}: {dict(outcomes)}")
    assert outcomes["InputError"] > 0
