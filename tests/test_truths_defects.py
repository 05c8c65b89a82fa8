"""The committed defects of solids: complete, drawn over kinds and sizes, posable as cases."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from samples import one_of_each

from femubench import read_case
from femubench.core.challenge.truth_file import read_truth
from truths.posing import DEFECTS, pose

pytestmark = pytest.mark.slow(20)

FOLDERS = sorted(path.parent for path in DEFECTS.glob("*/truth.toml"))
TRUTHS = [read_truth(folder) for folder in FOLDERS]
FEWEST = {"defect": 100, "pair": 15, "clean": 20, "outside": 20}


def test_there_are_enough_of_each_kind() -> None:
    counts = Counter(truth.kind for truth in TRUTHS)
    assert all(counts[kind] >= number for kind, number in FEWEST.items()), counts


def test_a_clean_case_is_clean() -> None:
    for truth in TRUTHS:
        if truth.kind == "clean":
            assert truth.chi2 == 0.0
            assert not truth.causes
        else:
            assert truth.causes
            assert truth.chi2 is not None


@pytest.mark.parametrize(
    "folder",
    one_of_each(FOLDERS, lambda folder: read_truth(folder).structure),
    ids=lambda folder: folder.name,
)
def test_a_defect_is_a_case(folder: Path, tmp_path: Path) -> None:
    """Both states have the same sensors, other scatter, and a case can be read of them."""
    pose(folder, tmp_path / "case")
    case = read_case(tmp_path / "case")
    assert not case.modifications
    present, healthy = (pd.read_csv(folder / name) for name in ("modes.csv", "healthy.csv"))
    assert list(present.columns) == list(healthy.columns)
    assert len(present) == len(healthy) == len(case.used) + len(case.held_out)
    assert not np.allclose(present["frequency"], healthy["frequency"], rtol=1e-9)
