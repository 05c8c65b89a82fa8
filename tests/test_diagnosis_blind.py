"""Blind cases: an effect is hidden in a finer model and has to be found; some hide nothing.

A fast subset of the sweep: every effect, every kind of place, data and structure at least once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import pytest

from femubench import diagnose
from femubench.core.challenge.answer import Answer
from femubench.core.challenge.draw import BlindCase, draw_case, registered_effects
from femubench.core.challenge.score import Judgement, judge_answer
from femubench.core.challenge.structures import STRUCTURES, structure_named
from femubench.core.challenge.truth import DataKind, Hidden
from femubench.core.challenge.visibility import delta_chi2

CLEAR = 30.0  # of chi-square: what lowers it by more is no matter of luck


@dataclass(frozen=True)
class Blind:
    """What is drawn."""

    seed: int
    effect: str | None = None
    kind: DataKind = "A"
    structure: str = "ladder"
    hidden: Hidden = "one"
    scatter: float = 0.0

    def __str__(self) -> str:
        return f"{self.effect or self.hidden}-{self.kind}-{self.structure}-{self.seed}"

    def draw(self) -> BlindCase:
        return _drawn(self)


@cache
def _drawn(blind: Blind) -> BlindCase:
    return draw_case(
        blind.seed,
        blind.kind,
        structure=blind.structure,
        hidden=blind.hidden,
        effect=blind.effect,
        scatter=blind.scatter,
    )


SINGLES = (
    Blind(1, "youngs-modulus"),
    Blind(1, "density"),
    Blind(1, "torsion-constant", kind="C"),
    Blind(1, "shear-deformation"),
    Blind(2, "rotary-inertia"),
    Blind(0, "joint-rotation"),
    Blind(1, "joint-rotation"),
    Blind(1, "joint-offset"),
    Blind(0, "joint-mass"),
    Blind(0, "added-mass"),
    Blind(1, "grounding-spring"),
    Blind(1, "member-stiffness"),
    Blind(1, "member-mass", kind="B"),
    Blind(1, "local-stiffness-loss"),
    Blind(1, "axial-preload"),
    Blind(1, "mass-eccentricity"),
    Blind(1, "bending-torsion-coupling"),
    Blind(1, "brace-spring", structure="hframe"),
    Blind(1, "attached-oscillator"),
    Blind(21, "temperature"),
    Blind(1, "joint-flexibility"),
    Blind(4, "member-mass", scatter=0.005),
    Blind(0, "joint-mass", structure="portal"),
    Blind(1, "wall-thickness"),
    Blind(1, "support-flexibility", structure="portal"),
    Blind(2, "support-flexibility", structure="table"),
)
# Stress by a lack of fit in one side of a cell is that in the other side.
ALIKE = {"axial-preload"}


def judged(blind: Blind) -> tuple[Judgement, Answer, tuple[float, ...]]:
    drawn = blind.draw()
    delta = delta_chi2(drawn.case, drawn.truth, registered_effects())
    answer = Answer.of(diagnose(drawn.case))
    return judge_answer(drawn.truth, answer, delta), answer, delta


@pytest.mark.parametrize(
    "blind",
    [
        one if k % 5 == 0 else pytest.param(one, marks=pytest.mark.nightly)
        for k, one in enumerate(SINGLES)
    ],
    ids=str,
)
def test_a_hidden_effect_is_found_at_its_place(blind: Blind) -> None:
    verdict, answer, (delta,) = judged(blind)
    assert delta > CLEAR
    assert verdict.right, verdict.reason
    assert answer.verdict in ("named", "ambiguous")
    if blind.effect not in ALIKE:
        assert verdict.places, verdict.reason
        for size in verdict.sizes:
            if answer.verdict == "named" and size.deviations is not None:
                assert abs(size.deviations) < 4.5, size


def test_singles_hide_every_effect_that_can_be_hidden() -> None:
    fit = {
        name
        for name, effect in registered_effects().items()
        if effect.refines is None
        and any(effect.places(structure_named(s).model) for s in STRUCTURES)
    }
    assert {blind.effect for blind in SINGLES} == fit


@pytest.mark.parametrize(
    "structure",
    [
        name if name in ("ladder", "portal") else pytest.param(name, marks=pytest.mark.nightly)
        for name in STRUCTURES
        if name != "table"
    ],
)
def test_a_structure_without_fault_lacks_nothing(structure: str) -> None:
    verdict, answer, _ = judged(Blind(1, structure=structure, hidden="none"))
    assert verdict.right, verdict.reason
    assert not verdict.false_alarm
    assert answer.causes == ()


@pytest.mark.slow(5)
@pytest.mark.parametrize("seed", [3, pytest.param(5, marks=pytest.mark.nightly)])
def test_two_hidden_effects_are_both_found(seed: int) -> None:
    verdict, _, delta = judged(Blind(seed, hidden="pair"))
    assert min(delta) > CLEAR
    assert verdict.found == 2
    assert verdict.right, verdict.reason


@pytest.mark.nightly
def test_an_oscillator_whose_frequency_no_grid_has_is_found_at_its_place() -> None:
    """It sits at R1 and resonates between two points of the grid, where others promise more."""
    verdict, answer, _ = judged(Blind(10_019, structure="table", hidden="pair"))
    assert verdict.right, verdict.reason
    assert ("attached-oscillator", "R1:y") in {(c.effect, c.place) for c in answer.causes}


@pytest.mark.slow(10)
@pytest.mark.parametrize(
    ("blind", "few"),
    [
        (Blind(4, structure="ladder", hidden="outside"), True),
        pytest.param(
            Blind(1, structure="ladder", hidden="outside"), False, marks=pytest.mark.nightly
        ),
        pytest.param(
            Blind(3, structure="ladder", hidden="outside"), True, marks=pytest.mark.nightly
        ),
    ],
    ids=str,
)
def test_a_cause_outside_the_catalogue_is_no_sure_name(blind: Blind, few: bool) -> None:
    """Two of them with a part of the catalogue and one at a time, which explains still less.

    Where three causes together imitate one, they are stated as less likely than not.
    """
    drawn = blind.draw()
    names = ("member-stiffness", "member-mass", "added-mass", "torsion-constant", "density")
    effects = [registered_effects()[name] for name in names] if few else None
    found = diagnose(drawn.case, effects, pairs=not few)
    assert drawn.truth.excess > CLEAR
    verdict = judge_answer(drawn.truth, Answer.of(found), (drawn.truth.excess,))
    stated = [cause.probability for cause in found.causes]
    assert verdict.right or (len(stated) > 2 and max(stated) < 0.5)
