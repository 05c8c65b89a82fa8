"""Broken bulk data: read, or refused in one line; never anything else, and never without end."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from pathlib import Path

import garteur_plane
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from mutations import NUMBERS, Edit, edits, mutated
from test_bulk_data import KINDS, LARGE, TWO
from test_fuzz import outcome_of

from femubench import InputError
from femubench.core.errors import FemubenchError
from femubench.plugins.readers.bulk_data import BulkDataReader

READER = BulkDataReader()
SEEDS = (garteur_plane.cards(), TWO, LARGE, KINDS)
FEW, MANY = 60, 20_000


@st.composite
def columns(draw: st.DrawFn) -> Edit | tuple[str, int, int, str]:
    """Return another number for a field of fixed width, in place."""
    return (
        "field",
        draw(st.integers(0, 10**6)),
        draw(st.integers(0, 9)),
        draw(st.sampled_from([n[:8] for n in NUMBERS])),
    )


def with_field(text: str, line: int, column: int, new: str) -> str:
    lines = text.split("\n")
    i = line % len(lines)
    wide = lines[i].ljust(80)
    lines[i] = f"{wide[: 8 * column]}{new:<8}{wide[8 * column + 8 :]}"
    return "\n".join(lines)


broken = st.builds(
    lambda seed, fields, changes: mutated(_with(SEEDS[seed], fields), changes),
    st.integers(0, len(SEEDS) - 1),
    st.lists(columns(), max_size=2),
    edits(2),
)


def _with(text: str, fields: list[tuple[str, int, int, str]]) -> str:
    for _, line, column, new in fields:
        text = with_field(text, line, column, new)
    return text


def check(folder: Path, examples: int) -> None:
    file = folder / "model.bdf"
    for seed in SEEDS:
        file.write_text(seed)
        READER.read_model(file)
    outcomes: Counter[str] = Counter()

    @settings(
        max_examples=examples,
        derandomize=examples == FEW,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(broken)
    def one(content: bytes) -> None:
        file.write_bytes(content)
        outcomes[outcome_of(lambda: READER.read_model(file), folder)] += 1

    one()
    print(f"bulk data: {dict(outcomes)}")
    assert set(outcomes) <= {"read", "InputError"}
    assert 0.02 < outcomes["read"] / outcomes.total() < 0.9


@pytest.mark.slow(5)
def test_a_few(tmp_path: Path) -> None:
    check(tmp_path, FEW)


@pytest.mark.nightly
def test_many(tmp_path: Path) -> None:
    check(tmp_path, MANY)


def test_a_modulus_that_rounds_to_nothing_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "model.bdf"
    file.write_text(_with(LARGE, [("field", 12, 3, "1e-320")]))
    with pytest.raises(FemubenchError, match="'E1': its stiffness is nothing to rounding"):
        READER.read_model(file)


def test_cut_files_are_refused_or_whole(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    file, seed = tmp_path / "model.bdf", garteur_plane.cards()
    for cut in rng.integers(0, len(seed), 20):
        file.write_text(seed[:cut])
        outcome_of(lambda: READER.read_model(file), tmp_path)


@pytest.mark.parametrize(
    "cards",
    [
        "SPC1,1,123456,1,THRU,99999999\n" * 2000,
        "RBE2,9,1,123456,1,THRU,99999999\n",
        "GRID,{i},,0.,0.,0.\n",
        "CORD2R,{i},{j},0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0.\nGRID,{i},{i}\n",
        "$\n" * 600_000,
        "PBEAM,1,1,1.,1.,1.,,,,+\n" + "+,NO,.5,,,,,,,+\n" * 10_000,
    ],
)
def test_a_small_file_takes_little_memory(tmp_path: Path, cards: str) -> None:
    file = tmp_path / "model.bdf"
    text = "".join(cards.format(i=i, j=i + 1) for i in range(1, 1500)) if "{i}" in cards else cards
    file.write_text("CBAR,1,1,1,2,0.,1.,0.\n" + text)
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            READER.read_model(file)
        assert tracemalloc.get_traced_memory()[1] < 200e6
    finally:
        tracemalloc.stop()
