"""The verdict on a printed cell: what agrees, and what an agreement is worth."""

from __future__ import annotations

from itertools import permutations

import pytest

from femubench import InputError
from femubench.core.reproduction.ground import VERDICTS
from femubench.reports.reproduction import counts_line
from femubench.reproduction import Cell, Ground, Page, Verdict
from tests.toys import reproduction_toys as toys

FREE = Ground("independent", "nothing is chosen")
STATED = Ground("under-convention", "shapes of another structure")
SEARCHED = Ground("searched", "found by trying", 12)
FITTED = Ground("fitted", "the length is fitted to it")
GIVEN = Ground("input", "the paper was given it")
UNSEEN = Ground("cannot-be-checked", "needs shapes that are not printed")
MISPRINT = Ground("misprint", "the columns next to it give another figure")
AGREEMENTS = (FREE, STATED, SEARCHED, FITTED, GIVEN, UNSEEN)


def verdict_of(*grounds: Ground, ours: float | None = 100.0, **words: Ground) -> Verdict:
    page = Page("paper", "1", grounds, unit="Hz", tolerance=0.1, **words)  # type: ignore[arg-type]
    return page.cell("mode 1", "FE", 100.0, ours).verdict


@pytest.mark.parametrize("ground", AGREEMENTS, ids=lambda ground: ground.verdict)
def test_one_ground_makes_its_own_verdict(ground: Ground) -> None:
    assert verdict_of(ground) == ground.verdict


@pytest.mark.parametrize("other", AGREEMENTS[1:], ids=lambda ground: ground.verdict)
def test_what_rests_on_anything_else_is_not_independent(other: Ground) -> None:
    """A cell that agrees after a fit, a search or by a convention, whatever else speaks for it."""
    assert verdict_of(FREE, other) == verdict_of(other, FREE) == other.verdict


def test_a_fit_outweighs_a_search_and_a_convention_in_any_order() -> None:
    for grounds in permutations((FREE, STATED, SEARCHED, FITTED)):
        assert verdict_of(*grounds) == "fitted"
    assert verdict_of(STATED, SEARCHED) == "searched"


@pytest.mark.parametrize("ours", [101.0, None, float("nan"), -100.0])
@pytest.mark.parametrize("ground", AGREEMENTS[:-1], ids=lambda ground: ground.verdict)
def test_no_ground_makes_figures_agree(ground: Ground, ours: float | None) -> None:
    assert verdict_of(ground, ours=ours) == "does-not-follow"
    assert verdict_of(ground, ours=ours, fault=MISPRINT) == "misprint"


@pytest.mark.parametrize("ours", [100.0, 180.0, None])
def test_what_cannot_be_checked_is_neither_praised_nor_accused(ours: float | None) -> None:
    assert verdict_of(FREE, UNSEEN, ours=ours) == "cannot-be-checked"


@pytest.mark.parametrize(
    ("ours", "others", "verdict"),
    [
        (110.0, (), "does-not-follow"),
        (110.0, (105.0, 120.0), "does-not-follow"),
        (90.0, (95.0, 98.0), "does-not-follow"),
        (110.0, (99.06,), "does-not-follow"),  # the tolerance is not added to the reach,
        (110.0, (99.05,), "cannot-be-checked"),  # the printed digits are
        (110.0, (float("nan"), 95.0, 140.0), "cannot-be-checked"),
        (None, (90.0, 110.0), "cannot-be-checked"),
    ],
)
def test_nothing_is_accused_that_lies_in_reach_of_what_is_not_in_print(
    ours: float | None, others: tuple[float, ...], verdict: Verdict
) -> None:
    page = Page("paper", "1", (FREE,), "Hz", decimals=1, unprinted="shapes decide")
    cell = page.cell("mode 1", "FE", 99.0, ours, lambda: others)
    assert cell.verdict == verdict
    assert cell.note.startswith("shapes decide, from ") == (verdict == "cannot-be-checked")


def test_what_agrees_asks_for_no_other_values() -> None:
    page = Page("paper", "1", (FREE,), decimals=1)
    assert page.cell("a", "b", 1.0, 1.0, lambda: 1 / 0).verdict == "independent"  # type: ignore[arg-type,return-value]


def test_a_figure_printed_again_is_no_further_evidence() -> None:
    ratio, hertz = (Page("paper", "2", (FREE,), unit, decimals=3) for unit in ("", "Hz"))
    cells = [ratio.cell(mesh, f"mode {k}", 1.0, 1.0) for mesh in "BCD" for k in range(4)]
    cells += [ratio.cell(mesh, "mode 5", 0.999, 0.999) for mesh in "BCD"]
    cells += [hertz.cell("B", "mode 1", 1.0, 1.0), hertz.cell("B", "mode 2", 2.0, 7.0)]
    assert Cell.verdict_counts(cells)["independent"] == 16
    assert Cell.count_different(cells) == 3


def test_the_note_names_every_ground_once_and_a_fault_alone() -> None:
    page = Page("paper", "1", (STATED, FITTED, STATED), fault=MISPRINT)
    assert page.cell("a", "b", 1.0, 1.0).note == f"{STATED.words}; {FITTED.words}"
    assert page.cell("a", "b", 1.0, 2.0).note == MISPRINT.words


def test_the_number_of_readings_stands_with_what_was_found_alone() -> None:
    page = Page("paper", "1", (SEARCHED,))
    assert [page.cell("a", "b", 1.0, ours).tried for ours in (1.0, 2.0)] == [12, None]
    fitted = Page("paper", "1", (SEARCHED, FITTED)).cell("a", "b", 1.0, 1.0)
    assert (fitted.verdict, fitted.tried) == ("fitted", None)


@pytest.mark.parametrize(
    ("verdict", "words", "tried"),
    [
        ("fitted", " ", None),
        ("searched", "found", None),
        ("searched", "found", 0),
        ("input", "a", 3),
    ],
)
def test_a_ground_gives_its_reason_and_a_search_its_number(
    verdict: Verdict, words: str, tried: int | None
) -> None:
    with pytest.raises(InputError, match=rf"^ground '{verdict}': .+ \(expected .+\)$"):
        Ground(verdict, words, tried)


@pytest.mark.parametrize(
    ("grounds", "fault"), [((), MISPRINT), ((MISPRINT,), MISPRINT), ((FREE,), FITTED)]
)
def test_a_page_without_grounds_is_refused(grounds: tuple[Ground, ...], fault: Ground) -> None:
    with pytest.raises(InputError, match="expected at least one ground"):
        Page("paper", "1", grounds, fault=fault)


def test_the_headline_is_the_number_of_independent_cells() -> None:
    study = toys.study()
    counts = Cell.verdict_counts(study.cells)
    assert set(counts) == set(VERDICTS)
    assert all(counts.values())
    assert sum(counts.values()) == len(study.cells)
    headline = f"{counts['independent']} of {len(study.cells)} printed cells agree independently ("
    assert counts_line([study]).startswith(headline)
