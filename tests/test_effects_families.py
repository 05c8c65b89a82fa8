"""Families of members as places, and walls of another thickness than drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from diagnosis_problems import case_of, effects_named, measured
from effect_checks import check_exact, check_neutral

from femubench import InputError, Model, diagnose, read_case
from femubench.core.case.case import Case
from femubench.core.case.writing import write_case
from femubench.core.conformance.effect_checks import has_place
from femubench.core.drawing.places import find_wireframe
from femubench.core.effect.places import split_direction
from femubench.effect import ModelPlaces, Places
from femubench.fem import Frame, MemberSet, Section
from femubench.plugins.effects.material import Density, MemberMass, MemberStiffness, YoungsModulus
from femubench.plugins.effects.wall_thickness import WallThickness

FrameBuilder = Callable[..., Frame]
RUNGS, SIDES = ("AD", "BE", "CF"), ("AB", "BC", "DE", "EF")
MODEL = """
[case]
name = "two-metals"
title = "A frame of two metals"

[model]
kind = "frame"
plane = "out-of-plane"

[model.materials.steel]
E = 207e9
nu = 0.3
rho = 7850.0
[model.materials.brass]
E = 100e9
nu = 0.35
rho = 8500.0
[model.sections.tube]
shape = "rectangular-tube"
width = 0.03
height = 0.02
wall = 0.002
[model.sections.bar]
shape = "solid-circle"
diameter = 0.02

[[model.joints]]
name = "A"
xyz = [0.0, 0.0, 0.0]
[[model.joints]]
name = "B"
xyz = [0.6, 0.0, 0.0]
[[model.joints]]
name = "C"
xyz = [0.6, 0.5, 0.0]
[[model.joints]]
name = "D"
xyz = [0.0, 0.5, 0.0]
{members}
{sets}
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
shape_std = 0.01
used = [1]
"""
MEMBERS = (("AB", "tube", "steel"), ("BC", "tube", "brass"), ("CD", "tube", "steel"))
LAST = ("DA", "bar", "brass")


def written(folder: Path, sets: str) -> Path:
    tables = [
        f'[[model.members]]\nname = "{name}"\nends = ["{name[0]}", "{name[1]}"]\nelements = 3\n'
        f'section = "{section}"\nmaterial = "{material}"\n'
        for name, section, material in (*MEMBERS, LAST)
    ]
    text = MODEL.format(members="".join(tables), sets=sets)
    (folder / "case.toml").write_text(text, encoding="utf-8")
    (folder / "sensors.csv").write_text(
        "label,x,y,z,direction\ns1,0,0,0,z\ns2,0.6,0,0,z\n", encoding="utf-8"
    )
    (folder / "modes.csv").write_text(
        "mode,frequency,frequency_std,damping,s1,s2\n1,50.0,0.1,,1.0,-1.0\n", encoding="utf-8"
    )
    return folder


SET = '[[model.sets]]\nname = "weld"\nmembers = ["AB", "BC"]\n'


@pytest.fixture
def two_metals(tmp_path: Path) -> Case:
    return read_case(written(tmp_path, SET))


def test_sets_sections_and_materials_are_places(two_metals: Case) -> None:
    frame = two_metals.model.frame_structure.frame
    assert Places(frame).members("set:weld") == ("AB", "BC")
    assert Places(frame).members("section:tube") == ("AB", "BC", "CD")
    assert Places(frame).members("material:brass") == ("BC", "DA")
    assert Places(frame).members("section:none") == ()
    # The bar is one member, which says it.
    assert Places(frame).sets() == ("set:weld", "section:tube")
    assert YoungsModulus().places(two_metals.model) == ("all", "material:steel", "material:brass")
    assert Density().places(two_metals.model) == YoungsModulus().places(two_metals.model)
    families = ("AB", "BC", "CD", "DA", "set:weld", "section:tube")
    assert MemberStiffness().places(two_metals.model) == families
    assert MemberMass().places(two_metals.model) == families
    assert WallThickness().places(two_metals.model) == families[4:] + families[:3]
    for word in ("set:weld", "section:tube", "material:brass"):
        assert has_place(two_metals.model, word)
    assert split_direction("set:x") == ("set:x", None)
    assert [m.name for m in Places(frame).members_at("set:weld")] == ["AB", "BC"]
    assert len(ModelPlaces(Model.of(frame)).elements("material:brass")) == 6
    drawn = find_wireframe(two_metals.model, ["set:weld"]).place("set:weld")
    assert [span.member for span in drawn.spans] == [0, 1]


def test_equal_families_are_one_place(ladder: FrameBuilder) -> None:
    frame = replace(
        ladder(),
        sets=(MemberSet("rungs", RUNGS), MemberSet("across", RUNGS), MemberSet("one", ("BE",))),
        families=(MemberSet("section:thick", SIDES), MemberSet("material:aluminium", SIDES)),
    )
    assert Places(frame).sets() == ("set:rungs",)
    assert Places(frame).sets(("material",)) == ("material:aluminium",)
    assert Places(frame).match("set:rungs", "set:across")
    assert Places(frame).match("set:one", "BE")
    assert Places(frame).match("section:thick", "material:aluminium")
    assert not Places(frame).match("set:rungs", "all")


def test_a_set_comes_back_from_the_file(two_metals: Case, tmp_path: Path) -> None:
    write_case(tmp_path / "again", two_metals)
    again = read_case(tmp_path / "again").model.frame_structure.frame
    frame = two_metals.model.frame_structure.frame
    assert again.sets == frame.sets == (MemberSet("weld", ("AB", "BC")),)
    assert again.families == frame.families


@pytest.mark.parametrize(
    ("table", "where", "what"),
    [
        (SET.replace("BC", "XY"), "sets[0].members[1]", "there is no member 'XY'"),
        (SET + SET, "sets[1].name", "'weld' is listed twice"),
        (SET.replace('"BC"', '"AB"'), "sets[0].members[1]", "'AB' is listed twice"),
    ],
)
def test_a_wrong_set_is_refused_in_one_line(
    tmp_path: Path, table: str, where: str, what: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_case(written(tmp_path, table))
    text = str(caught.value)
    assert where in text
    assert what in text
    assert "\n" not in text


@pytest.mark.parametrize("effect", [YoungsModulus, MemberMass])
def test_a_family_changes_as_its_members_do(effect: type, two_metals: Case) -> None:
    model, one = two_metals.model, effect()
    place = one.places(model)[-1]
    check_neutral(one, model, place)
    check_exact(one, model, place, [0.2])
    frame = model.frame_structure.frame
    changed = one.frame(frame, place, [0.2])
    assert {m.name for m, n in zip(frame.members, changed.members, strict=True) if m != n} == set(
        Places(frame).members(place)
    )


def test_a_wall_changes_all_constants_as_the_shape_does(
    ladder: FrameBuilder, portal: FrameBuilder
) -> None:
    thick = Section.rectangular_tube(0.0254, 0.0254, 1.2 * 0.00238)
    (plain,) = {m.section for m in ladder(polar=False).members}
    frame = WallThickness().frame(ladder(polar=False), "BE", [0.2])
    changed = frame.members[frame.member_index["BE"]].section
    for name in ("A", "Iy", "Iz", "J", "Jp"):
        assert getattr(changed, name) == pytest.approx(getattr(thick, name), rel=1e-12)
    assert changed.kappa is not None
    assert changed.kappa(0.33) == pytest.approx(thick.kappa(0.33))  # type: ignore[misc]
    assert (changed.width, changed.shape) == (plain.width, plain.shape)
    frames = (ladder(), ladder("timoshenko"), portal(3))
    for model in map(Model.of, frames):
        for place in WallThickness().places(model)[:2]:
            check_neutral(WallThickness(), model, place)
            for value in (-0.5, 0.07, 0.4):
                check_exact(WallThickness(), model, place, [value])


def test_a_wall_is_that_of_a_tube(ladder: FrameBuilder, hframe: FrameBuilder) -> None:
    frame = ladder()
    ring, bar = Section.round_tube(0.02, 0.002), Section.round_tube(0.02, 0.01)
    sections = {"BE": ring, "CF": bar}
    members = tuple(replace(m, section=sections.get(m.name, m.section)) for m in frame.members)
    places = WallThickness().places(Model.of(replace(frame, members=members)))
    assert places == ("AB", "BC", "DE", "EF", "AD", "BE")
    assert WallThickness().places(Model.of(hframe())) == ()
    (parameter,) = WallThickness().parameters(Model.of(replace(frame, members=members)), "BE")
    assert parameter.upper == parameter.lower * -1.0 == pytest.approx(0.9)


def test_a_thin_wall_is_set_apart_from_another_modulus(ladder: FrameBuilder) -> None:
    """Bending, torsion and mass fall by different shares; the truth is a finer mesh."""
    nominal = ladder(polar=False)
    truth = WallThickness().frame(ladder(polar=False, elements=12), "BC", [-0.3])
    exact = measured(Model.of(truth), nominal, count=7)
    test = replace(exact, frequency_std=0.0005 * exact.frequencies)
    kinds = effects_named("wall-thickness", "member-stiffness", "member-mass", "youngs-modulus")
    found = diagnose(case_of(Model.of(nominal), test, 5), kinds)
    first = found.causes[0]
    assert (first.effect, first.place) == ("wall-thickness", "BC")
    (change,) = first.parameters
    assert change.std is not None
    assert abs(change.value + 0.3) < 2.0 * change.std < 0.1
