"""Truth files, the cases that are posed from them, and the committed ones of all generators."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from samples import one_of_each
from small_suite import write_suite

from femubench import InputError, read_case
from femubench.core.challenge.truth_file import KnownCase, TrueCause, is_held, read_truth
from truths.posing import DEFECTS, OPENSEES, SHEAR, SHEAR_STRUCTURES, STRUCTURES, SUITE, pose
from truths.truth_text import truth_text

pytestmark = pytest.mark.slow(20)

CAUSES = (
    TrueCause("a loose joint", "joint-rotation", "J5", ("joint-rotation@T",), 1.25e5, "N m/rad"),
    TrueCause("a tapered member", "", "front-left"),
)
TRUTH = KnownCase("two", "frame-solid", "pair", 7, CAUSES, 83.2, 61.0)


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_suite(tmp_path_factory.mktemp("suite"))


def written(folder: Path, truth: KnownCase = TRUTH, **files: str) -> Path:
    """Write a truth with files of the structure's names, a dot for every underline."""
    room = folder / truth.name
    room.mkdir(parents=True)
    (room / "truth.toml").write_text(truth_text(truth), encoding="utf-8")
    for name, text in files.items():
        (room / name.replace("_", ".")).write_text(text, encoding="utf-8")
    return room


def test_a_truth_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_truth(written(tmp_path)) == TRUTH
    clean = KnownCase("sound", "frame-solid", "clean", 8)
    assert read_truth(written(tmp_path, clean)) == clean
    assert CAUSES[0].findings == (("joint-rotation", "J5"), ("joint-rotation", "T"))
    assert CAUSES[1].findings == ()


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('kind = "pair"', 'kind = "other"', "kind: unknown kind 'other'"),
        ('kind = "pair"', 'kind = "defect"', "cause: not what 'defect' has (expected 1 tables"),
        ("seed = 7", "seed = true", "seed: true or false (expected a whole number)"),
        ("seed = 7", "", "seed: missing"),
        ("held = ", "held = not", "expected valid TOML"),
        ("chi2 = 83.2", "chi2 = nan", "visible.chi2: out of bounds"),
        ("size = 125000.0", 'size = "big"', "cause[0].size: a text (expected"),
        ('place = "J5"', 'place = "J5"\nwhere = "J5"', "cause[0].where: unknown key"),
        ('["joint-rotation@T"]', '["joint-rotation"]', "cause[0].also[0]: of another form"),
    ],
)
def test_a_faulty_key_is_one_line(tmp_path: Path, old: str, new: str, line: str) -> None:
    room = written(tmp_path)
    text = (room / "truth.toml").read_text(encoding="utf-8")
    assert old in text
    (room / "truth.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_truth(room)
    assert str(caught.value).startswith(str(room / "truth.toml"))
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_truth_in_a_folder_of_another_half_is_refused(tmp_path: Path) -> None:
    room = written(tmp_path)
    names = [str(number) for number in range(99)]
    assert [is_held(f"suite/{name}") for name in names] == [is_held(name) for name in names]
    other = next(name for name in names if is_held(name) != is_held(room.name))
    with pytest.raises(InputError, match="held: the half is another"):
        read_truth(room.rename(tmp_path / other))


def test_a_case_is_the_files_of_the_truth_over_those_of_the_structure(
    tmp_path: Path, suite: Path
) -> None:
    modes = (suite / "frame-solid" / "modes.csv").read_text(encoding="utf-8")
    changed = modes.replace("231.4113", "222.2222")
    room = written(tmp_path, modes_csv=changed, healthy_csv=modes)
    assert pose(room, tmp_path / "case", suite=suite) == TRUTH
    names = {path.name for path in (tmp_path / "case").iterdir()}
    assert names == {"case.toml", "modes.csv", "sensors.csv"}
    case = read_case(tmp_path / "case")
    assert case.measurement.frequencies[0] == 222.2222
    assert case.modifications == ()
    assert "# of the largest component" in (tmp_path / "case" / "case.toml").read_text()


def test_what_cannot_be_posed_is_one_line(tmp_path: Path, suite: Path) -> None:
    room = written(tmp_path)
    with pytest.raises(InputError, match=r"there is no reference \(expected a file healthy.csv\)"):
        pose(room, tmp_path / "case", True, suite=suite)
    with pytest.raises(InputError, match="structure: no structure 'frame-solid'"):
        pose(room, tmp_path / "case", suite=tmp_path)
    with pytest.raises(InputError, match="is not empty"):
        pose(room, room, suite=suite)


def test_a_defect_is_a_case_with_the_healthy_structure_next_to_it(tmp_path: Path) -> None:
    case_folder = tmp_path / "case"
    pose(DEFECTS / "portal-loose-joint-1", case_folder, reference=True)
    case, healthy = read_case(case_folder), read_case(SUITE / "portal")
    assert case.reference is not None
    assert case.reference_used == case.used
    # Measured once more: other noise, and the mass that was weighed.
    assert case.reference.total_mass == healthy.measurement.total_mass
    np.testing.assert_allclose(
        case.reference.frequencies, healthy.measurement.frequencies, rtol=0.03
    )
    assert not np.array_equal(case.reference.frequencies, healthy.measurement.frequencies)


def test_there_are_enough_defects_of_each_kind_and_what_is_clean_is_clean() -> None:
    truths = [read_truth(file.parent) for file in DEFECTS.glob("*/truth.toml")]
    counts = Counter(truth.kind for truth in truths)
    fewest = {"defect": 100, "pair": 15, "clean": 20, "outside": 20}
    assert all(counts[kind] >= number for kind, number in fewest.items()), counts
    for truth in truths:
        clean = truth.kind == "clean"
        assert (not truth.causes) is clean
        assert truth.chi2 == 0.0 if clean else truth.chi2 is not None


SUITES = {DEFECTS: SUITE, OPENSEES: STRUCTURES, SHEAR: SHEAR_STRUCTURES}


@pytest.mark.parametrize(
    "folder",
    one_of_each(
        (file.parent for above in SUITES for file in sorted(above.glob("*/truth.toml"))),
        lambda folder: (folder.parent, read_truth(folder).structure),
    ),
    ids=lambda folder: folder.name,
)
def test_a_truth_is_a_case(folder: Path, tmp_path: Path) -> None:
    """Both states have the same sensors, other scatter, and a case can be read of them."""
    pose(folder, tmp_path / "case", reference=True, suite=SUITES[folder.parent])
    case = read_case(tmp_path / "case")
    assert case.reference is not None
    assert not case.modifications
    assert case.measurement.total_mass is not None or folder.parent != OPENSEES
    present, healthy = (pd.read_csv(folder / name) for name in ("modes.csv", "healthy.csv"))
    assert list(present.columns) == list(healthy.columns)
    assert len(present) == len(healthy) == len(case.used) + len(case.held_out)
    assert not np.allclose(present["frequency"], healthy["frequency"], rtol=1e-9)
