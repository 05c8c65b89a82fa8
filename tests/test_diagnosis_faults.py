"""Faults of data and input: each kind is named with its place, none where there is none."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest

from femubench import Case, Diagnosis, Measurement, Model, hookimpl, read_case
from femubench.core.challenge.answer import Answer, AnswerCause
from femubench.core.challenge.draw import draw_case
from femubench.core.challenge.score import candidates
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.diagnosis.serial import diagnosis_to_json
from femubench.core.inference.charge import charges_of
from femubench.core.inference.examine import Terms, examine
from femubench.core.inference.fault_search import _Drawn, inquire, log_density
from femubench.core.plugin.loader import list_faults, load_plugins
from femubench.effect import Suspect
from femubench.plugins.faults.readings import multiply_readings, swap_readings
from femubench.plugins.faults.section_turned import SectionTurned
from femubench.plugins.faults.sections import resize_section, sections_of
from femubench.plugins.faults.unit_slip import UnitSlip
from femubench.scenarios import SUITE
from tests.diagnosis_problems import effects_named

FEW = effects_named("youngs-modulus", "added-mass", "member-stiffness", "joint-rotation")
Edit = Callable[[Case], Case]


@cache
def clean(structure: str, seed: int) -> Case:
    return draw_case(seed, "A", structure=structure, hidden="none").case


def solid(name: str) -> Case:
    """Return a structure of the suite, whose truth is a solid, without its design changes."""
    return replace(read_case(SUITE / name), modifications=())


def diagnosed(case: Case) -> Diagnosis:
    return diagnose(case, FEW, pairs=False)


def faults_of(found: Diagnosis) -> list[tuple[str, str]]:
    return [(c.effect, c.place) for c in found.causes if c.side != "model"]


def value(found: Diagnosis) -> float:
    (cause,) = (c for c in found.causes if c.side != "model")
    return cause.parameters[0].value


def edited(edit: Callable[[Measurement], Measurement], case: Case) -> Case:
    return replace(case, measurement=edit(case.measurement))


def multiply(name: str, factors: Sequence[float], measurement: Measurement) -> Measurement:
    values = getattr(measurement, name)
    rest = np.ones(len(values))
    rest[: len(factors)] = factors
    return replace(measurement, **{name: values * rest})


def exchange(i: int, j: int, measurement: Measurement) -> Measurement:
    order = np.arange(len(measurement))
    order[[i, j]] = j, i
    return replace(
        measurement,
        frequencies=measurement.frequencies[order],
        frequency_std=measurement.frequency_std[order],
    )


def of_materials(change: dict[str, float], case: Case) -> Case:
    structure = case.model.frame_structure
    members = (
        replace(
            m,
            material=replace(
                m.material, **{k: getattr(m.material, k) * f for k, f in change.items()}
            ),
        )
        for m in structure.frame.members
    )
    return replace(case, model=Model.of(replace(structure.frame, members=tuple(members))))


def turned(case: Case) -> Case:
    (suspect,) = SectionTurned().suspects(case.model, case.measurement)
    return replace(case, model=suspect.corrected(case.model, case.measurement, 0.0)[0])


def without_support(direction: str, case: Case) -> Case:
    frame = case.model.frame_structure.frame
    first, *rest = frame.supports
    left = tuple(d for d in first.fixed if d != direction)
    supports = (replace(first, fixed=left), *rest)
    return replace(case, model=Model.of(replace(frame, supports=supports)))


SIGN = partial(edited, lambda m: multiply_readings(m, "P6z", -1.0))


@cache
def with_a_wrong_sign() -> Diagnosis:
    return diagnosed(SIGN(clean("ladder", 1)))


DATA: dict[str, tuple[Edit, str, float | None]] = {
    "frequency-outlier": (
        partial(edited, partial(multiply, "frequencies", [1.0, 0.96])),
        "mode:2",
        -0.04,
    ),
    "modes-swapped": (partial(edited, partial(exchange, 3, 1)), "mode:2+4", None),
    "sensor-sign": (SIGN, "sensor:P6z", None),
    "sensor-gain": (partial(edited, lambda m: multiply_readings(m, "P4z", 0.6)), "sensor:P4z", 0.6),
    "sensors-swapped": (
        partial(edited, lambda m: swap_readings(m, ("P9z", "P12z"))),
        "sensor:P9z+P12z",
        None,
    ),
    "sigma-misstated": (
        partial(edited, lambda m: replace(m, shape_std=3.0 * m.shape_std)),
        "data",
        3.0,
    ),
}


@pytest.mark.parametrize(
    "name",
    ["sensor-sign", "sensors-swapped", "frequency-outlier"]
    + [
        pytest.param(name, marks=pytest.mark.nightly)
        for name in ("modes-swapped", "sensor-gain", "sigma-misstated")
    ],
)
def test_a_fault_of_the_data_is_named_corrected_and_nothing_else(name: str) -> None:
    edit, place, size = DATA[name]
    sound = clean("ladder", 1)
    found = with_a_wrong_sign() if name == "sensor-sign" else diagnosed(edit(sound))
    assert faults_of(found) == [(name, place)]
    assert (found.verdict, len(found.causes), found.causes[0].side) == ("named", 1, "data")
    assert found.causes[0].probability > 0.9
    if size is not None:
        (parameter,) = found.causes[0].parameters
        assert parameter.std is not None
        assert abs(parameter.value - size) < 4.0 * parameter.std
        assert parameter.std < 0.5 * max(abs(size), 0.02)
    assert found.adequacy_p > 0.01
    assert isinstance(found.subject, Case)
    if name == "sensor-sign":
        np.testing.assert_array_equal(found.subject.measurement.shapes, sound.measurement.shapes)


def test_deviations_stated_too_small_are_said_with_the_factor() -> None:
    small = partial(edited, lambda m: replace(m, shape_std=m.shape_std / 3.0))
    found = diagnosed(small(clean("ladder", 1)))
    assert faults_of(found) == [("sigma-misstated", "data")]
    assert value(found) == pytest.approx(1 / 3, rel=0.15)


@pytest.mark.slow(5)
@pytest.mark.parametrize(
    ("name", "structure", "edit", "place"),
    [
        ("unit-slip", "ladder", partial(of_materials, {"rho": 1e-3}), "material:all"),
        ("section-turned", "portal", turned, "section:"),
        ("support-missing", "portal", partial(without_support, "z"), "support:A:z"),
    ],
)
def test_a_fault_of_what_was_typed_in_is_named(
    name: str, structure: str, edit: Edit, place: str
) -> None:
    found = diagnosed(edit(clean(structure, 0)))
    assert faults_of(found) == [(name, place)]
    assert (found.verdict, found.causes[0].side) == ("named", "input")
    assert not found.gain.used_percent[1] > 0.5  # nan where the wrong model has no partners


@pytest.mark.slow(10)
@pytest.mark.parametrize("structure", ["ladder", pytest.param("portal", marks=pytest.mark.nightly)])
def test_clean_data_have_no_fault(structure: str) -> None:
    assert [faults_of(diagnosed(clean(structure, seed))) for seed in range(5)] == [[]] * 5


@pytest.mark.parametrize(
    "name",
    ["h-tube", "stiffened-strip"]
    + [pytest.param(name, marks=pytest.mark.nightly) for name in ("bracket", "gusset-truss")],
)
def test_what_a_drawing_gets_wrong_of_a_solid_is_no_fault(name: str) -> None:
    """Stubby members as if turned, frequencies off by a fifth: still no typing error."""
    assert faults_of(diagnosed(solid(name))) == []


@pytest.mark.slow(5)
def test_a_wrong_sign_stands_out_of_what_a_drawing_gets_wrong() -> None:
    name, sensor = "h-tube", "9Z"
    found = diagnosed(edited(lambda m: multiply_readings(m, sensor, -1.0), solid(name)))
    assert faults_of(found) == [("sensor-sign", f"sensor:{sensor}")]


def test_a_frequency_that_is_off_like_the_others_is_not_called_wrong() -> None:
    """Four percent next to errors of twenty is nothing; next to none it is."""
    case = solid("h-tube")
    off = edited(partial(multiply, "frequencies", [1.0, 1.0, 0.96]), case)
    assert faults_of(diagnosed(off)) == []


def test_deviations_stated_too_large_are_said_and_the_data_stay() -> None:
    sound = clean("ladder", 1)
    found = diagnosed(edited(lambda m: replace(m, shape_std=3.0 * m.shape_std), sound))
    assert isinstance(found.subject, Case)
    np.testing.assert_array_equal(
        found.subject.measurement.shape_std, 3.0 * sound.measurement.shape_std
    )
    assert found.sentence.endswith("are stated wrongly (probability > 99.9 %).")
    twice = diagnosed(edited(lambda m: replace(m, shape_std=1.5 * m.shape_std), sound))
    assert faults_of(twice) == []


def test_faults_can_be_left_out() -> None:
    found = diagnose(SIGN(clean("ladder", 1)), FEW, faults=(), pairs=False)
    assert faults_of(found) == []
    assert found.verdict == "unknown"


def test_a_cause_next_to_a_fault_is_still_named() -> None:
    blind = draw_case(3, "A", effect="added-mass")
    found = diagnosed(SIGN(blind.case))
    assert faults_of(found) == [("sensor-sign", "sensor:P6z")]
    physical = [(c.effect, c.place) for c in found.causes if c.side == "model"]
    assert physical == [(c.effect, c.place) for c in blind.truth.causes]
    assert found.verdict == "named"


@pytest.mark.slow(5)
def test_a_cause_alone_is_no_fault() -> None:
    for seed in range(2):
        found = diagnosed(draw_case(seed, "A", effect="member-stiffness").case)
        assert faults_of(found) == []


def test_the_density_is_that_of_what_was_measured() -> None:
    """Mending what was exchanged or multiplied gives the density that sound data would have."""
    case = clean("ladder", 1)
    sound = case.used_measurement()
    look: Any = partial(examine, effects=(), tolerance=0.005)
    same = log_density(look(case.model, sound), sound)
    wrong = swap_readings(sound, ("P9z", "P12z"))
    assert log_density(look(case.model, sound), wrong) == pytest.approx(same)
    # Half the reading at half the deviation: each density is twice as high.
    half = np.where(np.array(sound.sensors.labels)[:, None] == "P4z", 0.5, 1.0)
    small = replace(sound, shapes=sound.shapes * half, shape_std=sound.shape_std * half)
    seen = look(case.model, sound)
    count = int(np.isfinite(sound.shapes[sound.sensors.labels.index("P4z")]).sum())
    assert log_density(seen, small) == pytest.approx(same + count * np.log(2.0))


def test_what_can_be_is_no_slip() -> None:
    model = clean("ladder", 1).model
    assert UnitSlip().suspects(model, clean("ladder", 1).measurement) == []


def test_a_size_in_millimetres_is_a_slip() -> None:
    case = clean("ladder", 0)
    structure = case.model.frame_structure
    (section,) = sections_of(structure.frame)
    assert section.width is not None
    typed = resize_section(section, {"width": 1e3 * section.width, "height": 1e3 * section.width})
    assert typed is not None
    members = tuple(replace(m, section=typed) for m in structure.frame.members)
    wrong = replace(case, model=Model.of(replace(structure.frame, members=members)))
    assert faults_of(diagnosed(wrong)) == [("unit-slip", "section:")]
    back = resize_section(typed, {"width": section.width, "height": section.width})
    assert back is not None
    assert pytest.approx([section.A, section.J]) == [back.A, back.J]


class Octave:
    """Somebody else's fault: one frequency was read an octave too high."""

    name = "octave-slip"
    side = "data"

    def suspects(self, model: Model, measurement: Measurement) -> Iterable[Suspect]:
        return [
            Suspect(f"mode:{n}", f"mode {n} was read an octave too high", partial(self.halved, n))
            for n in measurement.numbers
        ]

    def halved(self, number: int, model: Model, measurement: Measurement, value: float) -> Any:
        factor = np.where(np.array(measurement.numbers) == number, 0.5, 1.0)
        return model, replace(measurement, frequencies=measurement.frequencies * factor)


class _Offers:
    def __init__(self, *faults: object) -> None:
        self.faults = faults

    @hookimpl
    def femubench_faults(self) -> list[object]:
        return list(self.faults)


def test_a_fault_of_others_is_found() -> None:
    (fault,) = load_plugins([], {"toy": _Offers(Octave)}).faults.values()
    sound = clean("ladder", 1)
    wrong = edited(partial(multiply, "frequencies", [1.0, 1.0, 2.0]), sound)
    found = diagnose(wrong, FEW, faults=[*list_faults(), fault], pairs=False)
    assert faults_of(found) == [("octave-slip", "mode:3")]
    assert "an octave too high" in found.sentence


def test_a_fault_without_a_side_is_refused() -> None:
    class Sideless(Octave):
        side = "model"

    (broken,) = load_plugins([], {"toy": _Offers(Sideless)}).broken
    assert broken.message.endswith("Sideless: side is 'model', neither 'data' nor 'input'")


def test_without_faults_the_examination_is_the_plain_one() -> None:
    case = clean("ladder", 1)
    used, terms = case.used_measurement(), Terms(tuple(FEW), 0.005, pairs=False)
    found = inquire(case.model, used, (), terms)
    assert found.repaired == ()
    plain = examine(case.model, used, FEW, tolerance=0.005, pairs=False)
    assert found.examination.posterior.names == plain.posterior.names


def test_the_json_says_the_side_and_a_group_keeps_its_faults() -> None:
    found = with_a_wrong_sign()
    assert [c["side"] for c in diagnosis_to_json(found)["causes"]] == ["data"]
    causes = (
        AnswerCause(effect="sensor-sign", place="sensor:S1", probability=0.9, side="data"),
        AnswerCause(effect="a", place="p", probability=0.6),
        AnswerCause(effect="b", place="q", probability=0.3),
    )
    answer = Answer(verdict="ambiguous", causes=causes)
    fault = ("sensor-sign", "sensor:S1")
    assert candidates(answer) == ((fault, ("a", "p")), (fault, ("b", "q")))
    assert answer.probability == pytest.approx(0.9)


def test_suspects_weighed_at_once_are_as_each_by_itself() -> None:
    case = clean("ladder", 0)
    used = case.measurement.select(case.used)
    charges = [c for c in charges_of(case.model, used, list_faults()) if c.fault.side == "data"]
    now = _Drawn(case.model, used, None, 1.0)
    for (charge, gain), own in zip(now.all_screened(charges), charges, strict=True):
        assert charge.suspect is own.suspect
        assert gain == pytest.approx(now.screen(own)[1], rel=1e-9, abs=1e-9), own.suspect.place
    assert len({c.fault.name for c in charges}) > 4


def test_what_is_known_to_hang_free_has_no_forgotten_support() -> None:
    case = clean("ladder", 0)
    hung = Model.of(replace(case.model.frame_structure.frame, free=True))
    fault = next(fault for fault in list_faults() if fault.name == "support-missing")
    assert fault.suspects(case.model, case.measurement)
    assert not fault.suspects(hung, case.measurement)
