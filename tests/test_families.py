"""Families of groups: sets of a case, materials of a deck, as places and as parts to scale."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import test_chain
from test_bulk_data import CLAMPED
from test_bulk_plates import bulk, card, solid_block
from test_chain import Boxes, Point, diagnose_files, write_deck, write_responses
from test_groups import MODEL, changed, measured

import femubench
from femubench import Case, InputError, Model, NotApplicable, read_case
from femubench.core.case.reducing import expand_model, reduce_case
from femubench.core.case.writing import write_case
from femubench.core.drawing.places import find_wireframe
from femubench.core.twin.disguise import disguise_case
from femubench.fem import Groups, Property
from femubench.modal import GroupPriors
from femubench.plugins.effects.material import GroupMass, GroupMaterial, MemberStiffness
from femubench.plugins.readers.solid_elements import KINDS
from femubench.plugins.strategies.factors import Global
from femubench.update import Changes

BEARINGS, SPAN = "set:bearings", "material:larch"
FAMILIES = {BEARINGS: ("foot", "head"), SPAN: ("left", "right")}
MASSES = {"left": 0.4 * MODEL.mass, "right": 0.4 * MODEL.mass, "foot": 0.2 * MODEL.mass}
BEAM = replace(MODEL, families=FAMILIES, mass_groups=MASSES)


def test_a_family_changes_as_all_of_its_groups() -> None:
    softer = changed({"left": 0.7, "right": 0.7})
    effect = MemberStiffness()
    assert effect.places(BEAM)[-2:] == (BEARINGS, SPAN)
    found = effect.extend(BEAM, SPAN, [-0.3])
    assert abs(found.stiffness - softer.stiffness).max() < 1e-6
    for name, part in softer.groups.items():
        assert abs(found.groups[name] - part).max() < 1e-6
    (term,) = effect.change(BEAM, SPAN).terms
    np.testing.assert_allclose(
        -0.3 * term.operator.apply(np.eye(BEAM.size)),
        (softer.stiffness - MODEL.stiffness).toarray(),
        atol=1e-6,
    )
    lighter = GroupMass().extend(BEAM, SPAN, [-0.5])
    np.testing.assert_allclose(lighter.mass.toarray(), 0.6 * MODEL.mass.toarray(), atol=1e-12)
    assert GroupMass().places(BEAM)[-1] == SPAN  # the mass has one group of the bearings alone
    assert GroupMaterial().places(BEAM) == ["group:left", "group:right", SPAN]
    other = GroupMaterial().extend(BEAM, SPAN, [1.9, 0.05])
    assert other.total_mass == pytest.approx(2.52 * BEAM.total_mass)
    # A group in two families that one factor is on has it once.
    both = Property("both", "E", (SPAN, "group:left"))
    once = Groups(BEAM).with_factors([both], [0.7])
    assert abs(once.stiffness - softer.stiffness).max() < 1e-6


def test_a_family_of_all_or_of_one_is_no_further_place() -> None:
    words = {"set:all": (*MODEL.groups,), "set:one": ("left",), "set:legs": FAMILIES[BEARINGS]}
    model = replace(MODEL, families=FAMILIES | words)
    assert Groups(model).families("stiffness") == (BEARINGS, SPAN)
    assert Groups(model).families("mass") == ()


def test_a_family_is_known_as_its_least_known_group() -> None:
    assert GroupPriors(BEAM).std(SPAN) == GroupPriors(BEAM).std("left")
    mixed = replace(BEAM, families={SPAN: ("left", "head")}, group_priors={"left": 1.1})
    known = GroupPriors(mixed)
    assert known.std(SPAN) == known.std("head") > known.std("left")
    assert known.std(SPAN, "mass") == known.std("left", "mass")  # the head has none
    for pair in (("left", "foot"), ("foot", "left")):  # as wide, but a joint is stiffer by little
        kinds = {"left": "joint", "foot": "support"}
        either = replace(BEAM, families={SPAN: pair}, group_kinds=kinds)
        assert GroupPriors(either).largest_factor(SPAN) == np.inf
    joints = replace(BEAM, group_kinds=dict.fromkeys(("left", "right"), "joint"))
    effect = MemberStiffness()
    assert effect.parameters(joints, SPAN) == effect.parameters(joints, "group:left")
    assert effect.parameters(BEAM, SPAN) == effect.parameters(BEAM, "group:left")
    assert effect.parameters(BEAM, BEARINGS) == effect.parameters(BEAM, "group:foot")


def test_sets_and_materials_of_groups_are_parts_to_scale() -> None:
    truth = changed({"left": 1.3, "right": 1.3, "foot": 1.0, "head": 1.0})
    data, rng = measured(truth, 4), np.random.default_rng(0)
    result = Global(changes="materials").update(BEAM, data, rng)
    (found,) = result.parameters
    assert (found.name, found.after) == (f"stiffness {SPAN}", pytest.approx(1.3, rel=1e-4))
    (held,) = Changes(BEAM).parts("sets")
    foot = Changes(BEAM).parts("groups")[2]
    assert held.places == (BEARINGS,)
    assert held.parameters[0].range == foot.parameters[0].range
    apart = {"set:one": ("left",), "set:rest": ("right", "foot")}
    alone = replace(BEAM, families={**apart, SPAN: FAMILIES[SPAN]})
    assert len(Changes(alone).parts("sets")) == 2
    with pytest.raises(NotApplicable, match=r"left is in .*one and in .*larch"):
        Changes(alone).listed("sets+materials")
    with pytest.raises(NotApplicable, match=r"foot is in .*bearings and in .*foot"):
        Changes(BEAM).listed("sets+groups")
    with pytest.raises(NotApplicable, match="groups that, have materials of the case"):
        Changes(MODEL).parts("materials")
    shared = {"set:a": ("left", "foot"), "set:b": ("foot", "head")}
    with pytest.raises(NotApplicable, match="foot is in set:a and in set:b"):
        Changes(replace(BEAM, families=shared)).parts("sets")


def case_with(model: Model) -> Case:
    own = vars(femubench.cases["frame"])
    case = Case(**{**own, "name": "beam", "model": model, "measurement": measured(MODEL, 5)})
    return replace(case, used=(1, 2, 3), held_out=(4, 5), modifications=(), reference=None)


def test_families_read_back_as_they_were_written_and_wrong_ones_are_one_line(
    tmp_path: Path,
) -> None:
    own = {"material:oak": ("left",)}
    write_case(tmp_path / "beam", case_with(replace(BEAM, families={**own, **FAMILIES})))
    file = tmp_path / "beam" / "case.toml"
    # What is of one material by its deck is a set where no deck says it.
    written = {BEARINGS: FAMILIES[BEARINGS], "set:larch": FAMILIES[SPAN]}
    assert read_case(tmp_path / "beam").model.families == written
    text = file.read_text(encoding="utf-8")
    for old, new, says in (
        ('["foot", "head"]', '["foot", "hat"]', r"groups\[1\].*there is no group 'hat'"),
        ('["foot", "head"]', '["foot", "foot"]', "'foot' is listed twice"),
        ('["foot", "head"]', "[]", "groups"),
    ):
        assert old in text
        file.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(InputError, match=says):
            read_case(tmp_path / "beam")


def test_a_file_of_members_has_no_groups(tmp_path: Path) -> None:
    (tmp_path / "portal.bdf").write_text(CLAMPED)
    for table in ("sets", "groups"):
        rows = 'groups = ["a"]' if table == "sets" else 'kind = "joint"'
        (tmp_path / "case.toml").write_text(
            '[case]\nname = "a"\n[model]\nkind = "file"\nfile = "portal.bdf"\n'
            f'[[model.{table}]]\nname = "a"\n{rows}\n'
            '[measurement]\nmodes = "modes.csv"\nused = [1]\n'
        )
        (tmp_path / "modes.csv").write_text("mode,frequency\n1,10.0\n")
        with pytest.raises(InputError, match=rf"{table}.*portal.bdf gives members"):
            read_case(tmp_path)


def test_a_basis_a_disguise_and_the_way_back_keep_families() -> None:
    case = case_with(BEAM)
    small = reduce_case(case, above=1)
    assert small.model.families == FAMILIES
    updated = Groups(small.model).with_factors([Property("E", "E", (SPAN,))], [0.7])
    whole = expand_model(small, updated)
    softer = changed({"left": 0.7, "right": 0.7})
    assert abs(whole.stiffness - softer.stiffness).max() < 1e-6 * abs(softer.stiffness).max()
    hidden = disguise_case(case, np.random.default_rng(1)).model
    assert {word.partition(":")[0] for word in hidden.families} == {"set"}
    assert sorted(len(own) for own in hidden.families.values()) == [2, 2]
    assert not {BEARINGS, SPAN} & set(hidden.families)
    for names in hidden.families.values():
        assert hidden.groups.keys() >= set(names)


GOAL: Boxes = {  # mm; were there no sill, a head as much heavier would do the same
    "SILL": ((0, 0, -30), (340, 30, 0)),
    "POST": ((0, 0, 0), (20, 30, 300)),
    "HEAD": ((0, 0, 300), (340, 30, 320)),
    "LEG": ((320, 0, 0), (340, 30, 300)),
}
ALUMINIUM, MAGNESIUM = ("alloy", 70e3, "2.7e-9"), ("alloy", 45e3, "1.8e-9")
SEEN: list[Point] = [
    (0, 10, 30, "x"), (60, 0, 310, "y"),
    *((x, 10, z, "x") for x in (0, 340) for z in (90, 160, 230)), (340, 10, 30, "x"),
    *((x, 0, z, "y") for x in (10, 330) for z in (30, 90, 160, 230)),
    *((x, 10, z, "z") for x in (60, 120, 180, 240, 300) for z in (-30, 320)),
    *((x, 0, z, "y") for x in (180, 300) for z in (-20, 310)),
]  # fmt: skip


def test_a_deck_says_which_groups_are_of_one_material(tmp_path: Path) -> None:
    alloy = dict.fromkeys(("POST", "LEG"), ALUMINIUM)
    file = write_deck(tmp_path / "model.inp", "C3D20", 60.0, 1.0, GOAL, {}, alloy)
    model = femubench.read_model(file, unit="mm")
    assert model.families["material:ALLOY"] == ("LEG", "POST")
    assert set(model.families) == {"material:ALLOY", "material:HEAD", "material:SILL"}
    text = file.read_text()
    file.write_text(text.replace("alloy", "S355/J2@20"))
    assert "material:S355-J2-20" in femubench.read_model(file, unit="mm").families
    assert Groups(model).families("mass") == ("material:ALLOY",)
    drawn = find_wireframe(model, ["material:ALLOY", "group:POST", "group:LEG"])
    whole, *parts = (drawn.place(word) for word in ("material:ALLOY", "group:POST", "group:LEG"))
    assert (whole.kind, set(whole.points)) == (
        "outline",
        {p for part in parts for p in part.points},
    )


def test_properties_of_nastran_of_one_material_are_a_family(tmp_path: Path) -> None:
    text = solid_block()
    for number in (2, 3):  # two bricks next to it, the last of another material
        at = KINDS["C3D8I"].places @ np.diag([0.4, 0.3, 0.1]) + [0.4 * (number - 1), 0.0, 0.0]
        grids = [8 * (number - 1) + n for n in range(1, 9)]
        text += "".join(card("GRID", n, "", *xyz) for n, xyz in zip(grids, at, strict=True))
        text += card("PSOLID", number, number - 1) + card("CHEXA", number, number, *grids)
    model = bulk(tmp_path, text + card("MAT1", 2, 7e10, "", 0.3, 2700.0))
    assert model.families["material:MAT1 1"] == ("PSOLID 1", "PSOLID 2")


@pytest.mark.nightly
def test_another_alloy_of_two_parts_is_found_from_files_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(test_chain, "FACES", SEEN)  # the hammer hits the first two
    for file, cell, alloy in (("model", 20.0, ALUMINIUM), ("truth", 10.0, MAGNESIUM)):
        metals = dict.fromkeys(("POST", "LEG"), alloy)
        write_deck(Path(f"{file}.inp"), "C3D20", cell, 1.0, GOAL, {}, metals)
    write_responses(Path("test.uff"), Path("truth.inp"), SEEN)
    assert diagnose_files("model.inp", "test.uff")[0] == "named"
    (found,) = json.loads(Path("found.json").read_text())["causes"]
    assert (found["effect"], found["place"]) == ("group-material", "material:ALLOY")
    mass = found["parameters"][0]
    assert abs(mass["value"] - (1.8 / 2.7 - 1.0)) < 2.0 * mass["std"] < 0.2
