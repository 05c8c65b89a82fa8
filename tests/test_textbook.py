"""The textbook model: what handbooks give without a measurement, as a start and as a row."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import harness_toys as toys
import numpy as np
import pytest
from distributions import install_module
from effect_checks import as_matrices

import femubench
from femubench import NotApplicable
from femubench.core.plugin.loader import list_effects, load_plugins
from femubench.core.run.store import Store
from femubench.core.score.scoring import score_model
from femubench.effect import textbook_model
from femubench.fem import Section
from femubench.results import run_from_json, run_to_json
from tests.command import call_bench

EFFECTS = list_effects()


def test_it_has_bredts_torsion_constant_shear_and_rotary_inertia() -> None:
    case = femubench.cases["frame"]
    frame = textbook_model(case.model, EFFECTS).frame_structure.frame
    tube = frame.members[0].section
    wall = (0.0254 - np.sqrt(0.0254**2 - tube.A)) / 2.0
    assert pytest.approx(Section.bredt(0.0254 - wall, 0.0254 - wall, wall), rel=2e-3) == tube.J
    assert frame.beam == "timoshenko"
    assert frame.rotary_share == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["frame", "hframe", "suite/gantry"])
def test_what_is_repaired_stays_as_it_is(name: str) -> None:
    once = textbook_model(femubench.cases[name].model, EFFECTS)
    twice = textbook_model(once, EFFECTS)
    for one, two in ((once.mass, twice.mass), (once.stiffness, twice.stiffness)):
        assert abs(one - two).max() <= 1e-12 * abs(one).max()


def test_effects_with_textbook_values_say_so() -> None:
    model = femubench.cases["frame"].model
    for effect in EFFECTS:
        found = [effect.parameters(model, place) for place in effect.places(model)]
        known = any(p.textbook is not None for parameters in found for p in parameters)
        assert getattr(effect, "handbook", None) is known, effect.name


def test_matrices_have_no_textbook() -> None:
    model = as_matrices(femubench.cases["frame"].model)
    with pytest.raises(NotApplicable, match="matrices"):
        textbook_model(model, EFFECTS)


def test_as_a_strategy_it_looks_at_no_data() -> None:
    case = femubench.cases["frame"]
    update = femubench.strategies["textbook"]().update
    rng = np.random.default_rng(0)
    one = update(case.model, case.used_measurement(), rng).model
    other = update(case.model, case.used_measurement().select(case.used[:1]), rng).model
    assert abs(one.stiffness - other.stiffness).max() == 0.0
    errors = {name: block.rms_percent for name, block in score_model(case, one).items()}
    assert errors["used"] < 0.5 * score_model(case, case.model)["used"].rms_percent


def test_a_run_starts_from_both_models_and_ranks_from_the_textbook_one(tmp_path: Path) -> None:
    case = femubench.cases["frame"]
    plain = replace(case, name="plain", model=as_matrices(case.model))
    both = femubench.rank([case, plain], "unchanged", jobs=1, store=tmp_path)
    found = [(item.case, item.nominal, round(item.gain or 0.0, 6)) for item in both.results]
    # Matrices have no textbook: they are run once.
    assert found[0] == ("frame", "textbook", 0.0)
    assert found[1][:2] == ("frame", "drawn")
    assert found[2:] == [("plain", "textbook", 0.0)]
    row = both.leaderboard.iloc[0]
    assert row["gain"] == pytest.approx(0.0, abs=1e-9)
    assert row["gain_drawn"] == pytest.approx((found[1][2] or 0.0) / 2.0, abs=1e-5)
    assert [item.case for item in both.started_from("drawn")] == ["frame", "plain"]
    again = femubench.rank([case, plain], "unchanged", jobs=1, store=tmp_path, resume=True)
    assert again.results == both.results


OUTSIDER = """
import femubench

class Lead:
    name = "lead-filling"
    citation = "A. Third party (2026), Lead."

    def places(self, model):
        return ["all"]

    def parameters(self, model, place):
        raise AssertionError("asked for its textbook values")

    def extend(self, model, place, values):
        return model

@femubench.hookimpl
def femubench_effects():
    return [Lead()]
"""


def test_no_plugin_moves_what_all_are_measured_against(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = femubench.rank("frame", "unchanged", jobs=1).meta["reference"]
    monkeypatch.syspath_prepend(tmp_path)
    install_module(tmp_path, "lead", OUTSIDER)
    assert "lead-filling" in load_plugins().effects
    assert femubench.rank("frame", "unchanged", jobs=1).meta["reference"] == plain


def test_who_is_not_applicable_counts_as_who_leaves_the_model_as_it_is(tmp_path: Path) -> None:
    still = femubench.strategies["unchanged"]
    both = [still, toys.Declining()]
    run = femubench.rank(["frame", "suite/bracket"], both, jobs=1, store=tmp_path)
    own = {(r.case, r.strategy, r.nominal): r for r in run.results}
    for case, _, nominal in own:
        found, companions = own[case, "declining", nominal], own[case, "unchanged", nominal]
        assert (found.status, found.blocks) == ("not-applicable", {})
        assert found.gain == pytest.approx(companions.gain, rel=1e-9)
        assert found.rank == companions.rank == 1
    assert own["frame", "declining", "textbook"].gain == 0.0
    assert own["frame", "declining", "drawn"].gain < -0.5
    assert ("suite/bracket", "declining", "drawn") not in own  # matrices have no textbook
    board = run.leaderboard.set_index("strategy")
    assert board.loc["declining", "gain_drawn"] == pytest.approx(
        board.loc["unchanged", "gain_drawn"]
    )
    again = Store(tmp_path).load(run.meta["run"])
    assert again.results == run.results
    assert run_from_json(run_to_json(run)).results == run.results


def test_a_locked_run_takes_no_start_of_its_own() -> None:
    locked = call_bench("run", "--locked", "x", "--nominal", "textbook", code=2)
    assert "nominal cannot be given with it" in locked.output
