"""A model with many modes where the structure has one is no prediction: pickets around a mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

import femubench
from femubench.core.case.case import Case
from femubench.core.fem.model import Model
from femubench.core.schema.results import JobResult
from femubench.core.score.partners import surplus_partners
from femubench.core.score.ranking import score_of
from femubench.core.score.scoring import Reference, judge, reference_of


@pytest.fixture(scope="module")
def case() -> Case:
    return femubench.cases["frame"]


@pytest.fixture(scope="module")
def reference(case: Case) -> Reference:
    return reference_of(case)


def fence(case: Case, teeth: int, around: Sequence[int], step: float = 0.01) -> Model:
    """Return a model with further modes of the shapes of some elastic modes, a step apart.

    Its high modes are made of what sensors take for those shapes; mass and stiffness are what has
    these modes.
    """
    model = case.model
    mass, stiffness = (np.asarray(m.todense()) for m in (model.mass, model.stiffness))
    root = np.linalg.cholesky(mass)
    inner = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inner @ stiffness @ inner.T)
    shapes = inner.T @ vectors
    first = reference_of(case).rigid.shape[1]
    high = iter(range(len(values) - 1, first + 8, -1))
    for mode in around:
        for tooth in range(1, teeth + 1):
            column = next(high)
            side = (tooth + 1) // 2 * (1 if tooth % 2 else -1)
            values[column] = values[first + mode] * (1.0 + step * side) ** 2
            shapes[:, column] = shapes[:, first + mode] + 0.05 * shapes[:, column]
    back = np.linalg.inv(shapes)
    made = back.T @ (values[:, None] * back)
    return replace(
        model,
        mass=csr_array(back.T @ back),
        stiffness=csr_array(0.5 * (made + made.T)),
    )


def result_of(case: Case, model: Model, reference: Reference) -> JobResult:
    judgement = judge(case, model, reference)
    kept = replace(
        JobResult(case.name, "fence", 0, "ok", "", 0.1),
        rigid_body_modes_expected=3,
        **vars(judgement),
    )
    return replace(kept, score=score_of(replace(kept, surplus_partners=0), reference.rms_percent))


@pytest.mark.parametrize(
    ("teeth", "around"),
    [(8, range(5)), (3, range(5)), (1, range(5)), (8, (3, 4)), (2, (3, 4)), (4, (4,))],
)
def test_pickets_are_unphysical(
    teeth: int, around: Sequence[int], case: Case, reference: Reference
) -> None:
    found = result_of(case, fence(case, teeth, around), reference)
    assert found.unphysical
    assert found.surplus_partners
    assert "could be partners of" in found.reason


def test_pickets_would_score_better_than_they_deserve(case: Case, reference: Reference) -> None:
    found = result_of(case, fence(case, 12, range(5), 0.01), reference)
    assert found.score is not None
    assert found.score < 0.5
    assert found.surplus_partners


def test_the_nominal_model_has_no_surplus(case: Case, reference: Reference) -> None:
    found = judge(case, case.model, reference)
    assert (found.surplus_partners, found.reason) == (0, "")


def test_few_more_partners_are_allowed() -> None:
    known = np.array([1, 1, 1, 1, 1, 1, 0, 1, 2])

    def more(own: Sequence[int], with_mass: Sequence[int] = (0, 1, 2)) -> int:
        return surplus_partners(np.array([*own, *with_mass]), known)[0]

    assert more([2, 2, 2, 2, 2, 2]) == 0
    assert more([2, 2, 2, 2, 2, 2], [0, 2, 2]) == 7
    assert more([1, 1, 1, 1, 1, 8]) == 7
    # Close modes that the sensors mix up make up for each other; modes that are lost do not.
    assert more([2, 2, 2, 2, 2, 2], [1, 2, 1]) == 0
    assert more([0, 0, 0, 3, 3, 4]) == 7


def test_one_is_always_allowed() -> None:
    known = np.ones(1, dtype=np.int64)
    assert surplus_partners(np.array([2]), known)[0] == 0
    assert surplus_partners(np.array([3]), known)[0] == 2
