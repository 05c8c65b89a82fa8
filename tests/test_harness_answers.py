"""What a worker hands back: every kind of model gets through, nothing else does."""

from __future__ import annotations

import functools
import json
import os
import pickle
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femubench.core.fem.model import Model
from femubench.core.plugin.loader import load_plugins
from femubench.core.run import answers
from femubench.core.run.answers import AnswerError, head_of, packed, unpacked
from femubench.core.run.jobs import JobOutcome

sys.path.insert(0, str(Path(__file__).parent / "toys"))
import harness_toys as toys

CASE = toys.tiny_case()
HEAD = {
    **{"status": "ok", "reason": "", "traceback": "", "seconds": 0.5, "evaluations": 3},
    **{"parameter_count": 1, "parameters": [], "history": [{"r": 0.1}], "diagnostics": {}},
}


def sent(head: Any, model: bytes = b"") -> bytes:
    text = json.dumps(head).encode()
    return len(text).to_bytes(8, "big") + text + model


def same(first: Model, second: Model) -> bool:
    return (first.mass != second.mass).nnz == 0 and (first.stiffness != second.stiffness).nnz == 0


def test_models_with_every_effect_get_through() -> None:
    """Effects use all that a frame can hold."""
    seen = 0
    for effect in load_plugins().effects.values():
        for place in list(effect.places(CASE.model))[:2]:
            values = [0.5 * (p.lower + p.upper) for p in effect.parameters(CASE.model, place)]
            values = [value if np.isfinite(value) else 1.0 for value in values]
            model = effect.extend(CASE.model, place, values)
            found = unpacked(packed(JobOutcome("ok", model=model))).model
            assert found is not None
            assert same(found, model)
            assert np.allclose(
                found.observe(CASE.measurement.sensors).toarray(),
                model.observe(CASE.measurement.sensors).toarray(),
            )
            seen += 1
    assert seen > 20


def test_models_from_files_get_through() -> None:
    from femubench.core.conformance.problems import PROBLEMS, problem

    plain = [found for found in map(problem, PROBLEMS) if found.model.structure is None]
    assert plain
    for case in plain:
        taken = unpacked(packed(JobOutcome("ok", model=case.model))).model
        assert taken is not None
        assert same(taken, case.model)
        assert type(taken.geometry) is type(case.model.geometry)


def test_figures_get_through_to_the_last_bit() -> None:
    outcome = JobOutcome(
        "failed",
        "why",
        "Traceback",
        seconds=0.1 + 0.2,
        evaluations=None,
        parameter_count=4,
        parameters=({"name": "E", "before": 1.0, "after": 1 / 3, "unit": "", "std": None},),
        history=({"residual": 1e-300},),
        diagnostics={"nan": float("inf")},
    )
    assert head_of(packed(outcome)) == unpacked(packed(outcome)) == outcome


class Bomb:
    def __init__(self, call: Callable[..., Any], *words: Any) -> None:
        self.call = call, words

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize(
    "bomb",
    [
        Bomb(os.system, "true"),
        Bomb(eval, "1"),
        Bomb(getattr, "text", "upper"),
        Bomb(functools.partial, os.system, "true"),
        Bomb(np.load, "x.npy"),
        Bomb(Model.of, None),
        toys.Unchanged(),
    ],
)
def test_nothing_but_a_model_is_taken_over(bomb: object) -> None:
    code = pickle.dumps(replace(CASE.model, groups={"x": bomb}))
    with pytest.raises(AnswerError, match="cannot be taken over"):
        unpacked(sent(HEAD, code))


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "cannot be read"),
        (b"\xff" * 20, "its own report has"),
        (sent({}), "cannot be read"),
        (sent({**HEAD, "status": "best"}), "status 'best'"),
        (sent({**HEAD, "seconds": "0"}), "'0' is no number"),
        (sent({**HEAD, "history": [1]}), "cannot be read"),
        (sent({**HEAD, "diagnostics": {"x": None}}), "None is no number"),
        (sent([]), "cannot be read"),
        (sent(HEAD, b"no pickle"), "cannot be read"),
        (sent(HEAD, pickle.dumps(3)), "the updated model is int"),
        (sent(HEAD, pickle.dumps(CASE.model)[:-50]), "cannot be read"),
        (sent({**HEAD, "history": [{str(i): 0.0 for i in range(200_001)}]}), "more figures"),
    ],
)
def test_what_is_no_outcome_is_refused_in_one_line(data: bytes, says: str) -> None:
    with pytest.raises(AnswerError, match=says) as caught:
        unpacked(data)
    assert "\n" not in str(caught.value)


def test_the_reader_knows_no_function_of_other_rooms() -> None:
    reader = answers._ModelReader.__new__(answers._ModelReader)
    for module, name in (
        ("femubench.core.fem.model", "np"),
        ("femubench.core.fem.model", "replace"),
        ("femubench.core.fem.frame", "nothing"),
        ("femubench.core.case.reader", "read_case"),
        ("numpy", "load"),
        ("numpy.lib", "dtype"),
        ("builtins", "eval"),
        ("femubench.core.fem.frame", "Frame.corners"),
    ):
        with pytest.raises((AnswerError, AttributeError)):
            reader.find_class(module, name)
