"""An effect of somebody else is worded, drawn, swept, advised and looked for like ours."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from blind_sweep import SweepCase, run_task
from distributions import install_metadata
from outside_effects import CAUTION, SUMMARY, Bare, Plain, Skin

import femubench
from femubench import Diagnosis, InputError, Model, diagnose
from femubench.core.case.case import Case
from femubench.core.challenge import draw
from femubench.core.challenge.draw import BlindCase, draw_case
from femubench.core.conformance.checking import findings, subjects
from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.look.look import look
from femubench.core.plugin.loader import load_plugins
from femubench.core.roles import Effect
from femubench.diagnosis import list_effects
from femubench.reports.cells import figure, format_signed
from femubench.reports.diagnosis import diagnosis_html, diagnosis_text

OURS = ("youngs-modulus", "density", "torsion-constant")


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the package of the third party, as pip would."""
    folder = tmp_path_factory.mktemp("site")
    install_metadata(folder, "newcomers", {"newcomers": "outside_effects"})
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        draw.registered_effects.cache_clear()
        yield
    draw.registered_effects.cache_clear()


def known(*names: str) -> list[Effect]:
    return [effect for effect in list_effects("newcomers") if effect.name in names]


@pytest.fixture(scope="module")
def blind() -> BlindCase:
    return draw_case(3, "A", effect=Skin.name)


@pytest.fixture(scope="module")
def found(blind: BlindCase) -> Diagnosis:
    return diagnose(blind.case, known(Skin.name, *OURS))


@pytest.mark.slow(5)
def test_it_keeps_the_rules() -> None:
    plugins = load_plugins()
    assert plugins.broken == ()
    for name in (Skin.name, Bare.name):
        (subject,) = subjects(name, plugins)
        faults = [f for f in findings(subject) if f.verdict.status in ("fail", "warn")]
        assert faults == []


def test_it_is_a_parameter_of_strategies_that_fit_changes() -> None:
    case = femubench.cases["frame"]
    real = Skin().extend(case.model, "all", [0.2])
    modes = femubench.solve_modes(real).elastic.take(np.arange(3))
    used = case.used_measurement()
    shapes = np.asarray(real.observe(used.sensors) @ modes.shapes)
    exact = replace(
        used,
        frequencies=modes.natural_frequencies,
        frequency_std=1e-4 * modes.natural_frequencies,
        shapes=shapes,
        shape_std=np.full(shapes.shape, 0.01 * np.abs(shapes).max()),
    )
    strategy = femubench.strategies["bayesian"](changes="newcomers/stiff-skin")
    result = strategy.update(case.model, exact, np.random.default_rng(0))
    (skin,) = result.parameters
    assert skin.after == pytest.approx(0.2, abs=0.004)
    assert (skin.name, skin.before, skin.places) == ("stiff-skin all", 0.0, ("all",))
    found = femubench.solve_modes(result.model).elastic.natural_frequencies[:6]
    truth = femubench.solve_modes(real).elastic.natural_frequencies[:6]
    assert found == pytest.approx(truth, rel=2e-3)


def test_an_effect_that_nobody_has_is_one_line() -> None:
    with pytest.raises(InputError, match=r"there is no 'stiff-skin'.*PLUGIN/EFFECT"):
        femubench.strategies["global"](changes="members+stiff-skin")


def test_it_is_drawn_from_its_own_range() -> None:
    sizes = [draw_case(seed, "C", effect=Skin.name).truth.causes[0].values[0] for seed in range(8)]
    assert all(0.2 <= size <= 0.3 for size in sizes)
    assert len(set(sizes)) == 8


def test_it_is_named_with_its_clause_caution_and_size_in_percent(
    blind: BlindCase, found: Diagnosis
) -> None:
    assert found.verdict == "named"
    (cause,) = found.causes
    (size,) = cause.parameters
    stated = r"The model lacks stiff-skin \(([^;]*) \+([\d.]+) ± ([\d.]+) %; probability "
    begin = re.match(stated, found.sentence)
    assert begin is not None
    assert begin[1] == size.name.removeprefix("change of ")
    numbers = [float(text) / 100.0 for text in begin.groups()[1:]]
    assert numbers == pytest.approx([size.value, size.std], rel=0.06)
    assert (cause.effect, cause.summary, size.wording) == (Skin.name, SUMMARY, "change")
    assert size.value == pytest.approx(blind.truth.causes[0].values[0], abs=0.02)
    assert CAUTION in found.notes
    data: dict[str, Any] = diagnosis_from_json(diagnosis_to_json(found, case=blind.case))
    page, text = diagnosis_html(data).replace("\xa0", " "), diagnosis_text(data)
    assert SUMMARY in " ".join(text.split())
    assert CAUTION in " ".join(text.split())
    assert f"({format_signed(100.0 * size.value)} ±" in page
    assert f"{SUMMARY[0].upper()}{SUMMARY[1:]}" in page
    (visible,) = [row for row in found.smallest_visible if row.effect == Skin.name]
    assert f"({figure(100.0 * visible.size, 2)} %)" in page


def test_its_own_look_is_taken(blind: BlindCase, found: Diagnosis) -> None:
    (warning,) = [item for item in found.looks if item.effect == Skin.name]
    assert warning.what.startswith("A skin of a tenth of the stiffness would show: it changes mode")
    # Ten per cent of bending stiffness are at most half of that in a frequency.
    changes = np.array([percent for _, percent in warning.changes])
    assert 2.0 < changes.max() <= 100.0 * (np.sqrt(1.1) - 1.0) + 1e-9
    alone = look(blind.case.model, blind.case.used_measurement(), effects=[Skin()])
    assert [item for item in alone if item.effect] == [warning]


def test_the_advice_reads_it_and_asks_for_a_second_level() -> None:
    """Another cause with the same matrices stands next to it: only a reading tells them apart."""
    case = draw_case(3, "A", effect=Skin.name).case
    both = diagnose(case, known(Skin.name, Plain.name))
    assert both.verdict == "ambiguous"
    assert {cause.effect for cause in both.causes} == {Skin.name, Plain.name}
    assert next(c for c in both.causes if c.effect == Plain.name).summary == ""
    texts = [item.measurement for item in both.advice]
    assert texts[0] == "measure the skin with a gauge"
    # What is stiffer than the model has not softened with the amplitude.
    assert not any("looks like" in text for text in texts)
    soft = softer(case)
    level = [item.measurement for item in soft.advice if "looks like" in item.measurement]
    assert level == [
        "measure at twice the excitation level: a stiffness that falls with the amplitude looks "
        "like stiff-skin"
    ]


def softer(case: Case) -> Diagnosis:
    """Return the diagnosis of data that ask for less bending stiffness than the model has."""
    frame = Skin().frame(case.model.frame_structure.frame, "all", [0.6])
    model = Model.of(case.model.frame_structure.rebuilt(frame))
    return diagnose(replace(case, model=model), known(Skin.name, Plain.name))


class TaskOfSkin(SweepCase):
    def draw(self) -> BlindCase:
        return draw_case(self.seed, self.kind, effect=Skin.name)


def test_without_being_named_it_is_neither_drawn_nor_looked_for() -> None:
    assert not {Skin.name, Bare.name, Plain.name} & {e.name for e in list_effects()}
    assert not {Skin.name, Bare.name, Plain.name} & set(draw.registered_effects())
    with pytest.raises(InputError, match="no plugin 'newcomer'; did you mean 'newcomers'"):
        list_effects("newcomer")


def test_the_sweep_judges_what_is_said_of_it() -> None:
    task = TaskOfSkin("A", 0, 503, "A", "ladder", "one", 0.0)
    record = run_task(task, lambda case: diagnose(case, known(Skin.name, *OURS)))
    assert record["effects"] == [Skin.name]
    # Another modulus with another torsion constant has almost the same bending stiffness.
    assert record["named"][0] == Skin.name
    assert record["verdict"] in ("named", "ambiguous")
    assert record["right"]
