"""Modifications that move supports, take parts away or exchange them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import femubench
from femubench import InputError, Model, NotApplicable, fem
from femubench.core.case.reader import read_case
from femubench.core.case.writing import write_case
from femubench.core.modal.eigen import modes_of
from femubench.core.score.predicted_spread import Spread
from femubench.core.score.scoring import pair_modified, score_model
from femubench.fem import Frame, LowRank, Place, Property, Support

HEAD = """
[case]
name = "beam"
[model]
kind = "frame"
plane = "in-plane"
joints = [
  {name = "A", xyz = [0, 0, 0]}, {name = "B", xyz = [0.6, 0, 0]}, {name = "C", xyz = [1.0, 0, 0]},
  {name = "D", xyz = [0.6, 0, -0.3]},
]
members = [
  {name = "span", ends = ["A", "B"], elements = 6, section = "bar", material = "steel"},
  {name = "arm", ends = ["B", "C"], elements = 4, section = "bar", material = "steel"},
  {name = "strut", ends = ["B", "D"], elements = 4, section = "bar", material = "steel"},
]
supports = [{at = "A", fixed = ["x", "z", "ry"]}, {at = "D", fixed = ["x", "z"]}]
masses = [{at = "C", mass = 0.2}]
springs = [{at = "arm@0.5", direction = "z", stiffness = 2e4}]
sets = [{name = "beam", members = ["span", "arm"]}]
materials.steel = {E = 210e9, nu = 0.3, rho = 7850.0}
materials.titanium = {E = 114e9, nu = 0.33, rho = 4500.0}
sections.bar = {shape = "solid-rectangle", width = 0.04, height = 0.008}
sections.tube-2 = {shape = "rectangular-tube", width = 0.04, height = 0.02, wall = 0.002}
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1]
[[modification]]
name = "changed"
modes = "changed.csv"
"""
SENSORS = "label,at,direction\ns1,span@0.5,z\ns2,C,z\ns3,arm@0.5,z\ns4,strut@0.5,x\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sensors.csv").write_text(SENSORS)
    for file in ("modes.csv", "changed.csv"):
        (tmp_path / file).write_text("mode,frequency,s1,s2,s3,s4\n1,20.0,0.3,1.0,0.7,\n")
    return tmp_path


def case_with(folder: Path, keys: str) -> femubench.Case:
    (folder / "case.toml").write_text(f"{HEAD}{keys}\n")
    return read_case(folder)


def frame_of(case: femubench.Case) -> Frame:
    return case.model.frame_structure.frame


def hertz(model: Model, count: int = 4) -> np.ndarray:
    return modes_of(model).natural_frequencies[:count]


def ways() -> Iterator[tuple[str, object]]:
    """Yield keys of a modification, and what they make of the frame, written out by hand."""
    yield (
        'remove = [{support = "D"}]\nsupports = [{at = "strut@0.43", fixed = ["x", "z"]}]',
        lambda f: replace(
            f,
            supports=(f.supports[0], Support(Place(member="strut", s=0.43), ("x", "z"))),
        ),
    )
    yield (
        'remove = [{mass = "C"}, {spring = {member = "arm", s = 0.5}}]',
        lambda f: replace(f, masses=(), springs=()),
    )
    yield (
        'set = [{set = "beam", section = "tube-2"}, {member = "strut", material = "titanium"}]',
        lambda f: replace(
            f,
            members=tuple(
                replace(m, section=fem.Section.rectangular_tube(0.04, 0.02, 0.002))
                if m.name != "strut"
                else replace(m, material=fem.Material(114e9, 0.33, 4500.0))
                for m in f.members
            ),
        ),
    )
    yield (
        'remove = [{member = "strut"}]\nmasses = [{at = "B", mass = 0.3}]',
        lambda f: replace(
            f,
            joints=f.joints[:3],
            members=f.members[:2],
            supports=f.supports[:1],
            masses=(*f.masses, fem.PointMass(Place(joint="B"), 0.3)),
        ),
    )


WAYS = dict(zip(("support", "mass-and-spring", "exchange", "member"), ways(), strict=True))


@pytest.mark.parametrize("way", list(WAYS))
def test_a_modified_structure_is_the_frame_written_out(folder: Path, way: str) -> None:
    keys, by_hand = WAYS[way]
    case = case_with(folder, keys)
    change = case.modifications[0]
    wanted = Model.of(by_hand(frame_of(case)))  # type: ignore[operator]
    np.testing.assert_allclose(hertz(change.modify(case.model)), hertz(wanted), rtol=1e-9)
    assert abs(hertz(wanted)[0] / hertz(case.model)[0] - 1.0) > 0.02
    # Parameters of an update stay where there is something left of them.
    stiffer = [Property("span", "E", ("span/1", "span/2")), Property("strut", "E", ("strut/2",))]
    updated = Model.of(case.model.frame_structure.with_values(stiffer, [1.5, 0.6]))
    kept = stiffer[: 1 if way == "member" else 2]
    again = wanted.frame_structure.with_values(kept, [1.5, 0.6][: len(kept)])
    np.testing.assert_allclose(hertz(change.modify(updated)), hertz(Model.of(again)), rtol=1e-9)
    measured = replace(change.measurement, frequencies=hertz(wanted, 1))
    change = replace(change, measurement=measured)
    case = replace(case, modifications=(change,))
    assert score_model(case, updated)["modified"].modes[0].predicted_hz == pytest.approx(
        hertz(Model.of(again))[0], rel=1e-9
    )
    spread = Spread(updated, (case.model,), 0.0)
    pair = pair_modified(updated, change, spread)[0]
    apart = hertz(wanted)[0] - hertz(Model.of(again))[0]
    std = float(np.hypot(apart, change.measurement.frequency_std[0]))
    assert pair.predicted_std_hz == pytest.approx(std, rel=1e-6)


@pytest.mark.parametrize("way", list(WAYS))
def test_a_written_case_reads_back_with_its_modification(folder: Path, way: str) -> None:
    case = case_with(folder, WAYS[way][0])
    write_case(folder / "copy", case)
    back = read_case(folder / "copy")
    for model in (case.model, back.model):
        one, other = (c.modifications[0].modify(model) for c in (case, back))
        np.testing.assert_allclose(hertz(one), hertz(other), rtol=1e-12)
    assert str(back.modifications[0]) == str(case.modifications[0])


def test_changed_matrices_keep_their_change_under_other_supports(folder: Path) -> None:
    case = case_with(folder, WAYS["support"][0])
    rng = np.random.default_rng(1)
    basis = rng.normal(size=(case.model.size, 2))
    updated = replace(case.model, stiffness_change=LowRank(basis, 1e3 * np.eye(2)))
    dense = replace(case.model, stiffness=case.model.stiffness + updated.stiffness_change.toarray())
    change = case.modifications[0]
    found = [hertz(change.modify(model)) for model in (updated, dense)]
    np.testing.assert_allclose(found[0], found[1], rtol=1e-8)
    assert np.all(found[0] > hertz(change.modify(case.model)))
    for way in ("member", "exchange"):
        other = case_with(folder, WAYS[way][0]).modifications[0]
        with pytest.raises(NotApplicable, match="updated as a whole, in which no member"):
            other.modify(updated)


def test_matrices_take_supports(folder: Path) -> None:
    case = case_with(folder, 'supports = [{at = "arm@0.5", fixed = ["z"]}]')
    change = case.modifications[0]
    scaled = replace(case.model, stiffness=1.1 * case.model.stiffness)
    write_case(folder / "matrices", replace(case, model=scaled))
    back = read_case(folder / "matrices")
    assert back.model.structure is None
    found = back.modifications[0].modify(back.model)
    assert found.size == back.model.size - 1
    np.testing.assert_allclose(hertz(found), hertz(change.modify(scaled)), rtol=1e-9)
    seen = np.abs(found.observe(back.measurement.sensors)).sum(axis=1)
    assert list(seen > 0.0) == [True, True, False, True]
    with pytest.raises(InputError, match="takes or exchanges parts, and the matrices were updated"):
        write_case(folder / "no", replace(case_with(folder, WAYS["member"][0]), model=scaled))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("", "nothing is changed (expected masses, springs, supports, remove or set)"),
        ('remove = [{support = "B"}]', "there is no support 'B' (expected A, D)"),
        ('remove = [{member = "span"}, {member = "arm"}, {member = "strut"}]', "no member is left"),
        ('remove = [{mass = "C", spring = "C"}]', "mass and spring at once"),
        ("remove = [{}]", "nothing is named"),
        ('set = [{member = "arm"}]', "nothing is set (expected section or material)"),
        ('set = [{member = "arm", section = "x"}]', "no section 'x' (expected bar, tube-2)"),
        ('set = [{set = "arm", section = "bar"}]', "there is no set 'arm' (expected beam)"),
        (
            'set = [{set = "beam", section = "bar"}, {member = "arm", material = "titanium"}]',
            "'arm' is listed twice",
        ),
        ('supports = [{at = "C", fixed = ["rx"]}]', "direction 'rx' is not there"),
        ('remove = [{member = "arm"}]', "sensor 's2' sat on what was removed"),
    ],
    ids=range(11),
)
def test_faults_are_one_line(folder: Path, keys: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        case_with(folder, keys)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
