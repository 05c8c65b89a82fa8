"""Thickness of plates and softness of interfaces: matrices that come with powers of a value."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from diagnosis_problems import case_of, clamped_portal
from effect_checks import as_matrices
from test_bulk_plates import bulk, converted
from test_chain import (
    FLATS,
    SHEETS,
    Boxes,
    diagnose_files,
    write_deck,
    write_responses,
    write_shells,
)
from test_shells import ARC, FLAT, angle, shell_deck
from test_solid_decks import read

import femubench
from femubench import Case, Model, Sensors, fem
from femubench.core.case.reducing import expand_model, reduce_case
from femubench.core.case.similarity import Similarity, similar_matrices
from femubench.core.case.writing import write_case
from femubench.core.fem.alteration import Alteration, alter_model
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.modal.grouped_reduction import reduce_groups
from femubench.core.twin.disguise import disguise_case
from femubench.effect import FrameEffect
from femubench.fem import (
    FloatArray,
    Material,
    MatrixGeometry,
    Place,
    Preload,
    Section,
    Support,
)
from femubench.modal import GroupPriors
from femubench.plugins.effects.powers import InterfaceSoftness, PlateThickness, PreloadForce
from femubench.plugins.readers.nodes import read_nodes
from tests.simulated import modes_at

THICK, SOFT, PRELOAD = PlateThickness(), InterfaceSoftness(), PreloadForce()
SEAM = "interface:far|near"


def hertz(model: Model, count: int = 8) -> FloatArray:
    return np.asarray(elastic_modes(model, count).natural_frequencies)


@pytest.mark.parametrize("kind", ["S3", "S4", "S6", "S8", "S8R"])
@pytest.mark.parametrize(
    ("path", "held"),
    [(FLAT, (1, 2, 3)), (angle(0.9), ()), (ARC, (1, 2, 3, 4, 5, 6))],
    ids=["hinged", "knot", "arc"],
)
@pytest.mark.parametrize("change", [-0.2, 0.2])
def test_a_thickness_is_that_of_a_deck_with_it(
    kind: str, path: FloatArray, held: Sequence[int], change: float, tmp_path: Path
) -> None:
    nominal = read(tmp_path, shell_deck(kind, path, held, (0.003, 0.004)))
    assert set(THICK.places(nominal)) == {"group:near", "group:far"}
    found = THICK.extend(nominal, "group:far", [change])
    truth = read(tmp_path, shell_deck(kind, path, held, (0.003, 0.004 * (1.0 + change))))
    np.testing.assert_allclose(hertz(found), hertz(truth), rtol=1e-6)
    assert found.total_mass == pytest.approx(truth.total_mass, rel=1e-9)


def whole_sheet(thickness: float) -> str:
    """Return a deck of one group, with a point mass."""
    deck = shell_deck("S4", FLAT, (), (thickness, thickness), mass=0.3)
    return deck.replace("ELSET=far", "ELSET=near")


def test_the_only_part_is_all_of_the_plates_and_a_point_mass_stays(tmp_path: Path) -> None:
    nominal = read(tmp_path, whole_sheet(0.004))
    assert THICK.places(nominal) == ("all",)
    found, truth = THICK.extend(nominal, "all", [0.2]), read(tmp_path, whole_sheet(0.0048))
    np.testing.assert_allclose(hertz(found), hertz(truth), rtol=1e-6)
    assert found.total_mass == pytest.approx(truth.total_mass, rel=1e-9)


def test_a_coat_does_not_grow_with_the_plate(tmp_path: Path) -> None:
    text = converted(tmp_path, shell_deck("S4", FLAT, thickness=(0.004, 0.006)))
    assert set(THICK.places(bulk(tmp_path, text))) == {"group:PSHELL 1", "group:PSHELL 2"}
    coated = text.replace("PSHELL,2,1,0.006,1,,1", "PSHELL,2,1,0.006,1,,1,,5.0")
    assert THICK.places(bulk(tmp_path, coated)) == ("group:PSHELL 1",)


@pytest.fixture
def bent(tmp_path: Path) -> Model:
    """Return two flats of shells that meet at an angle, free."""
    return read(tmp_path, shell_deck("S4", angle(0.9, 8), thickness=(0.004, 0.003), across=6))


@pytest.mark.parametrize(
    ("effect", "place", "value"), [(THICK, "group:far", -0.2), (SOFT, SEAM, -0.99)]
)
def test_terms_are_what_the_model_changes_by(
    bent: Model, effect: FrameEffect, place: str, value: float
) -> None:
    assert place in effect.places(bent)
    other, change = effect.extend(bent, place, [value]), effect.change(bent, place)
    factors, unit = change.coefficients(np.array([[value]]))[0], np.eye(bent.size)
    for kind in ("stiffness", "mass"):
        terms = zip(factors, change.terms, strict=True)
        total = sum(f * term.operator.apply(unit) for f, term in terms if term.matrix == kind)
        gap = (getattr(other, kind) - getattr(bent, kind)).toarray() - total
        assert abs(gap).max() < 1e-12 * abs(getattr(bent, kind)).max()
    if effect is THICK:  # what is updated before or after that is the group as it is then
        rows = fem.Property("k", "E", (place,)), fem.Property("m", "density", (place,))
        after = fem.Groups(other).with_factors(rows, [1.1, 1.2])
        before = effect.extend(fem.Groups(bent).with_factors(rows, [1.1, 1.2]), place, [value])
        assert abs(after.mass - before.mass).max() < 1e-12 * abs(after.mass).max()
        assert abs(after.stiffness - before.stiffness).max() < 1e-12 * abs(after.stiffness).max()


def split(model: Model, left: float) -> Model:
    """Return the two flats apart, with springs at the seam of which so much is left in series."""
    softer, rows = GroupPriors(model).interfaces.edges[SEAM][:2]
    n, p = model.size, len(rows)
    own = np.arange(n)
    own[rows] = n + np.arange(p)
    move = sp.csr_array((np.ones(n), (own, np.arange(n))), shape=(n + p, n))
    stay = sp.eye_array(n + p, n, format="csr")
    apart = sp.csr_array(move - stay)[:, rows]
    inside = sp.csr_array(model.groups[softer])[rows][:, rows]
    part, heavy = model.groups[softer], model.mass_groups[softer]
    springs = left / (1.0 - left) * (apart @ inside @ apart.T)
    stiffness = stay @ (model.stiffness - part) @ stay.T + move @ part @ move.T + springs
    mass = stay @ (model.mass - heavy) @ stay.T + move @ heavy @ move.T
    nodes = [*map(str, model.dofs.node), *(f"{model.dofs.node[r]}'" for r in rows)]
    axes = np.vstack([model.dofs.motions, model.dofs.motions[rows]])
    xyz = np.vstack([model.dofs.xyz, model.dofs.xyz[rows]])
    along = [*model.dofs.direction, *(model.dofs.direction[r] for r in rows)]
    found = fem.matrix_model(sp.csc_array(mass), sp.csc_array(stiffness), nodes, along, xyz)
    return replace(found, dofs=replace(found.dofs, axes=axes))


@pytest.mark.parametrize("left", [0.5, 0.03, 1e-3])
def test_an_interface_moves_as_two_parts_on_springs(bent: Model, left: float) -> None:
    assert GroupPriors(bent).interfaces.places == (SEAM,)
    found, exact = hertz(SOFT.extend(bent, SEAM, [left - 1.0])), hertz(split(bent, left))
    np.testing.assert_allclose(found[:6], exact[:6], rtol=1e-3)
    assert (hertz(bent) > found).any()


@pytest.fixture(scope="module")
def stood(tmp_path_factory: pytest.TempPathFactory) -> tuple[Model, Model]:
    """Return a frame on two feet of one part that are held below, and the same without a hold."""
    file = tmp_path_factory.mktemp("stood") / "model.inp"
    boxes: Boxes = {
        "FEET": ((0, 0, 0), (60, 60, 20)), "POST": ((20, 20, 20), (40, 40, 200)),
        "HEAD": ((20, 20, 200), (240, 40, 220)), "LEG": ((220, 20, 20), (240, 40, 200)),
        "FEET2": ((200, 0, 0), (260, 60, 20)),
    }  # fmt: skip
    write_deck(file, "C3D8I", 20.0, 1.0, boxes, {"FEET": 7e4, "FEET2": 7e4})
    text, models = file.read_text().replace("ELSET=FEET2\n", "ELSET=FEET\n"), []
    text = text.partition("*MATERIAL, NAME=FEET2")[0] + "*BOUNDARY" + text.partition("*BOUNDARY")[2]
    for own in (text, text.partition("*BOUNDARY")[0]):
        file.write_text(own)
        models.append(femubench.read_model(file, unit="mm"))
    return models[0], models[1]


def on_springs(free: Model, at: FloatArray, left: float) -> Model:
    """Return a model that stands on springs at some nodes, of which so much is left in series."""
    rows = np.flatnonzero((abs(free.dofs.xyz[:, None] - at).max(axis=2) < 1e-9).any(axis=1))
    part = free.groups["FEET"]
    springs = sp.csc_array(free.stiffness.shape).tolil()
    springs[np.ix_(rows, rows)] = left / (1.0 - left) * part[rows][:, rows]
    return replace(free, stiffness=free.stiffness + springs.tocsc())


def test_a_foot_gives_as_one_on_springs(stood: tuple[Model, Model]) -> None:
    held, free = stood
    places = ["interface:ground 1|FEET", "interface:ground 2|FEET"]
    assert [p for p in SOFT.places(held) if "ground" in p] == places
    below = free.dofs.xyz[free.dofs.xyz[:, 2] == 0.0]
    assert free.size - held.size == len(below) > 50
    for left in (0.5, 0.03, 1e-3):
        both = SOFT.extend(SOFT.extend(held, places[0], [left - 1.0]), places[1], [left - 1.0])
        exact = on_springs(free, below, left)
        np.testing.assert_allclose(hertz(both)[:6], hertz(exact)[:6], rtol=1e-3)
    one, other = (hertz(SOFT.extend(held, place, [-0.99])) for place in places)
    np.testing.assert_allclose(one, other, rtol=1e-6)  # of one frame, seen from both sides
    assert GroupPriors(held).supports == frozenset()
    stated = SOFT.places(replace(held, group_kinds={"FEET": "support"}))
    assert stated == ("interface:LEG|HEAD", "interface:POST|HEAD")


def test_grounds_follow_their_rows(stood: tuple[Model, Model]) -> None:
    """In other units, in a basis and with some more held a foot gives the same."""
    held, place = stood[0], "interface:ground 2|FEET"
    assert isinstance(held.geometry, MatrixGeometry)
    soft = SOFT.extend(held, place, [-0.97])
    by = Similarity(2.0, 3.0, 0.5)
    similar = SOFT.extend(similar_matrices(held, held.geometry, by), place, [-0.97])
    np.testing.assert_allclose(hertz(similar), by.frequency * hertz(soft), rtol=1e-7)
    top = tuple(Support(Place(joint=name), ("x", "y")) for name in list(held.geometry.places)[-2:])
    stayed = [alter_model(model, Alteration(supports=top)) for model in (held, soft)]
    own = SOFT.extend(stayed[0], place, [-0.97])
    np.testing.assert_allclose(hertz(own), hertz(stayed[1]), rtol=1e-9)
    kept = np.arange(held.size)[:: held.size // 12]
    for left in (0.5, 0.03, 1e-3):
        found = reduce_groups(held, kept, 12)
        assert found.moved < 1e-3
        stiffness, mass = (
            whole + sum((left - 1.0) ** p * pair[i] for p, pair in found.powers[place].items())
            for i, whole in enumerate((found.stiffness, found.mass))
        )
        values = la.eigh(stiffness, mass, eigvals_only=True)[:12]
        exact = hertz(SOFT.extend(held, place, [left - 1.0]), 12)[:12]
        np.testing.assert_allclose(np.sqrt(values) / (2.0 * np.pi), exact, rtol=1e-3)


def test_joints_that_are_drawn_and_bases_have_no_interfaces(bent: Model) -> None:
    drawn = replace(bent, group_kinds={"near": "joint"})
    assert SOFT.places(drawn) == ()
    dense = {n: sp.csc_array(np.ones((bent.size,) * 2)) for n in bent.groups}
    assert SOFT.places(replace(bent, groups=dense)) == ()
    (parameter,) = SOFT.parameters(bent, SEAM)
    assert parameter.range[1] == 0.0
    assert parameter.value(parameter.range[0]) < -0.999


def test_powers_follow_their_rows(bent: Model) -> None:
    """In other units, in another order and with some held the effect does the same."""
    changed = hertz(THICK.extend(bent, "group:far", [0.3]))
    by = Similarity(2.0, 3.0, 0.5)
    assert isinstance(bent.geometry, MatrixGeometry)
    similar = similar_matrices(bent, bent.geometry, by)
    np.testing.assert_allclose(
        hertz(THICK.extend(similar, "group:far", [0.3])), by.frequency * changed, rtol=1e-7
    )
    feet = tuple(Support(Place(joint=node), ("x", "y", "z")) for node in ("1", "14", "27"))
    held, thick = (
        alter_model(model, Alteration(supports=feet))
        for model in (bent, THICK.extend(bent, "group:far", [0.3]))
    )
    assert held.size < bent.size
    np.testing.assert_allclose(
        hertz(THICK.extend(held, "group:far", [0.3])), hertz(thick), rtol=1e-9
    )


@pytest.fixture(scope="module")
def folded(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """Return the shells of the chain: base, upright and rib of one sheet."""
    file = write_shells(tmp_path_factory.mktemp("folded") / "model.inp")
    return femubench.read_model(file, unit="mm")


def made(model: Model) -> Case:
    """Return a case with a test of ten nodes of the base and the upright."""
    assert isinstance(model.geometry, MatrixGeometry)
    names = [str(n) for n in range(1, 600, 60)]
    xyz = np.array([model.geometry.places[name] for name in names])
    sensors = Sensors(tuple(names), xyz, ("z",) * len(names))
    return case_of(model, modes_at(model, sensors, 8), 6)


@pytest.fixture(scope="module")
def basis(folded: Model) -> Case:
    """Return the case of the shells with its model reduced."""
    return reduce_case(made(folded))


def test_in_a_basis_seams_have_no_thickness(folded: Model, basis: Case) -> None:
    small = basis.model
    assert set(THICK.places(small)) == set(THICK.places(folded)) == {
        "group:BASE", "group:UPRIGHT", "group:RIB"
    }  # fmt: skip
    assert set(SOFT.places(small)) == set(SOFT.places(folded))


@pytest.mark.parametrize(
    ("effect", "place", "values"),
    [
        (THICK, "group:UPRIGHT", (-0.2, 0.2)),
        (SOFT, "interface:UPRIGHT|BASE", (-0.999, -0.97, -0.5)),
        (SOFT, "interface:RIB|BASE", (-0.999, -0.5)),
    ],
)
def test_a_basis_holds_what_powers_do(
    folded: Model, basis: Case, effect: FrameEffect, place: str, values: Sequence[float]
) -> None:
    assert basis.whole is folded
    assert place in effect.places(basis.model)
    for value in values:
        own = effect.extend(basis.model, place, [value])
        whole = effect.extend(folded, place, [value])
        np.testing.assert_allclose(hertz(own, 12), hertz(whole, 12), rtol=1e-3)
    back = expand_model(basis, own)
    for kind in ("stiffness", "mass"):
        gap = abs(getattr(back, kind) - getattr(whole, kind)).max()
        assert gap < 1e-6 * abs(getattr(whole, kind)).max()


def taut(model: Model, part: str, force: float) -> sp.csc_array:
    """Return what the nodes of a part, under tension between each other, resist across, (n, n)."""
    rows = np.flatnonzero(model.groups[part].diagonal() > 0.0)
    rows = rows[[model.dofs.direction[row] == "z" for row in rows]]
    near = sp.coo_array(sp.triu(model.groups[part][rows][:, rows], 1))
    ends = rows[np.column_stack([near.row, near.col])]
    long = np.linalg.norm(np.diff(model.dofs.xyz[ends], axis=1)[:, 0], axis=1)
    ends, long = ends[long > 0.0], long[long > 0.0]
    at = (np.repeat(np.arange(len(ends)), 2), ends.ravel())
    apart = sp.csr_array((np.tile([1.0, -1.0], len(ends)), at), shape=(len(ends), model.size))
    return sp.csc_array(apart.T @ sp.diags_array(force / long) @ apart)


def test_a_basis_holds_what_a_preload_does(folded: Model) -> None:
    added = taut(folded, "UPRIGHT", 300.0)
    given = {**folded.powers, "preload:sail": {1: (added, sp.csc_array(added.shape))}}
    drawn = replace(folded, stiffness=sp.csc_array(folded.stiffness + added), powers=given)
    drawn = replace(drawn, group_kinds={**folded.group_kinds, "sail": "preload"})
    small = reduce_case(made(drawn))
    assert small.whole is drawn
    assert PRELOAD.places(small.model) == ("preload:sail",)
    assert PRELOAD.parameters(small.model, "preload:sail")[0].scale == 0.5
    for value in (-1.0, 0.5):
        own, whole = (PRELOAD.extend(m, "preload:sail", [value]) for m in (small.model, drawn))
        np.testing.assert_allclose(hertz(own, 12), hertz(whole, 12), rtol=1e-3)
        assert abs(hertz(whole, 12)[-1] / hertz(drawn, 12)[-1] - 1.0) > 5e-4
    back = expand_model(small, own)
    assert abs(back.stiffness - whole.stiffness).max() < 1e-6 * abs(whole.stiffness).max()


def test_a_preload_is_that_of_a_frame_and_stays_in_its_case(tmp_path: Path) -> None:
    section, material = Section.rectangular_tube(0.04, 0.03, 0.002), Material(70e9, 0.3, 2700.0)
    frame = clamped_portal(4, section, material)
    plain, drawn, truth = (
        Model.of(replace(frame, preloads=(Preload("beam", p),) if p else ()))
        for p in (0.0, 4e4, 6e4)
    )
    added = sp.csc_array(drawn.stiffness - plain.stiffness)
    powers = {"preload:beam": {1: (added, sp.csc_array(added.shape))}}
    model = replace(as_matrices(drawn), powers=powers)
    at = model.dofs.xyz[model.dofs.node == model.dofs.node[0]][:1]
    case = case_of(model, modes_at(model, Sensors(("a",), at, ("x",)), 4), 3)
    write_case(tmp_path / "case", case)
    read = femubench.read_case(tmp_path / "case")
    assert disguise_case(read, np.random.default_rng(0)).model.powers == {}
    model = read.model
    assert PRELOAD.places(model) == ("preload:beam",)
    assert not model.groups
    assert PRELOAD.parameters(model, "preload:beam")[0].scale == 0.5
    found = hertz(PRELOAD.extend(model, "preload:beam", [0.5]))
    np.testing.assert_allclose(found, hertz(truth), rtol=1e-7)
    assert abs(found / hertz(drawn) - 1.0).max() > 1e-3
    lost = hertz(PRELOAD.extend(model, "preload:beam", [-1.0]))
    np.testing.assert_allclose(lost, hertz(plain), rtol=1e-7)


SUITE = Path(__file__).parents[1] / "scenarios" / "suite"


def bar() -> Model:
    """Return the solids of a tapered cantilever: four bars and what clamps them, as parts."""
    return femubench.read_model(SUITE / "tapered-cantilever" / "solid.inp", unit="m")


@pytest.mark.slow(20)
@pytest.mark.parametrize(
    ("name", "factors"),
    [
        ("folded", (0.3, 0.1, 1e-2, 1e-3)),
        # 14 000 degrees of freedom, solved whole with every interface soft: minutes.
        pytest.param("bar", (0.1, 1e-3), marks=pytest.mark.nightly),
    ],
)
def test_thirty_frequencies_of_a_basis_hold_with_an_interface_a_thousandth(
    name: str, factors: Sequence[float], request: pytest.FixtureRequest
) -> None:
    model: Model = request.getfixturevalue(name) if name == "folded" else bar()
    node = model.dofs.node
    kept = np.flatnonzero(np.isin(node, np.linspace(0, node.max(), 10, dtype=int)))
    found, whole = reduce_groups(model, kept, 30), hertz(model, 30)[:30]
    assert 200 <= len(found.mass) <= 600

    def excess(stiffness: FloatArray, mass: FloatArray, whole: FloatArray) -> float:
        values = la.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 39])
        elastic = values[values > 1e-3 * (2.0 * np.pi * whole[0]) ** 2][:30]
        return float(np.abs(np.sqrt(elastic) / (2.0 * np.pi * whole) - 1.0).max())

    assert excess(found.stiffness, found.mass, whole) < 1e-5
    most = 0.0
    for place, pairs in found.powers.items():
        for left in factors if place.startswith("interface") else ():
            stiffness, mass = (
                whole + sum((left - 1.0) ** power * pair[i] for power, pair in pairs.items())
                for i, whole in enumerate((found.stiffness, found.mass))
            )
            exact = hertz(SOFT.extend(model, place, [left - 1.0]), 30)[:30]
            most = max(most, excess(stiffness, mass, exact[:30]))
    assert most < 1e-3
    assert 0.4 * most < found.moved < 1e-3  # an estimate from below, by the softest and by others


@pytest.mark.slow(5)
def test_a_thinner_sheet_is_told_from_another_material(tmp_path: Path) -> None:
    """A hat on a strip bends as a beam by its membranes, and its flats as plates."""
    profile = 0.06 * np.array(
        [(0, 0), (0.25, 0), (0.5, 0), (0.75, 0), (1, 0), (1, 0.25), (1, 0.5), (1.25, 0.5),
         (1.5, 0.5)]
    )  # fmt: skip
    nominal, truth = (
        read(tmp_path, shell_deck("S4", profile, (), (0.001, t), across=8)) for t in (1e-3, 8e-4)
    )
    nominal = replace(nominal, finer=None)  # the truth has the same mesh
    assert isinstance(nominal.geometry, MatrixGeometry)
    names = [str(n) for n in range(1, 82, 4)]
    xyz = np.repeat([nominal.geometry.places[name] for name in names], 2, axis=0)
    sensors = Sensors(tuple(n + d for n in names for d in "xz"), xyz, ("x", "z") * len(names))
    test, rng = modes_at(truth, sensors, 12), np.random.default_rng(1)
    hz = test.frequencies * (1.0 + 1e-3 * rng.standard_normal(12))
    shapes = test.shapes + 0.015 * rng.standard_normal(test.shapes.shape)
    found = femubench.diagnose(case_of(nominal, replace(test, frequencies=hz, shapes=shapes), 9))
    assert found.verdict == "named"
    assert [(c.effect, c.place) for c in found.causes] == [("plate-thickness", "group:far")]
    (size,) = found.causes[0].parameters
    assert size.value == pytest.approx(-0.2, abs=0.01)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("boxes", "soft", "verdict", "cause"),
    [
        (SHEETS | {"UPRIGHT": ((-1.5, 0, 1.5), (0.75, 200, 150)),
                   "RIB": ((0.75, 98.5, 1.5), (100, 101.5, 50))}, 1.0,
         "ambiguous", ("plate-thickness", "group:UPRIGHT")),
        ({"BASE": SHEETS["BASE"], "WELD": ((-1.5, 0, 1.5), (1.5, 200, 4.5)),
          "UPRIGHT": ((-1.5, 0, 4.5), (1.5, 200, 150)), "PLATE": SHEETS["RIB"]}, 0.02,
         "named", ("interface-softness", "interface:UPRIGHT|BASE")),
    ],
    ids=["thinner", "soft-seam"],
)  # fmt: skip
def test_what_is_wrong_with_sheets_leads_from_files_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, boxes: Boxes, soft: float, verdict: str,
    cause: tuple[str, str],
) -> None:  # fmt: skip
    """The truth is of bricks in another mesh, its seam a row of soft ones.

    A flat plate alone bends as one of another material: both names stay, the thickness first.
    """
    monkeypatch.chdir(tmp_path)
    write_shells(Path("model.inp"))
    truth = write_deck(Path("truth.inp"), "C3D20R", 12.0, soft, boxes)
    write_responses(Path("test.uff"), truth, FLATS)
    said, places = diagnose_files("model.inp", "test.uff")
    assert (said, {*places}) == (verdict, {cause[1]})
    found = json.loads(Path("found.json").read_text())
    assert found["causes"][0]["effect"] == cause[0]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("modulus", "verdict", "places"),
    [(210e3, "none", []), (20.0, "named", ["interface:ground|PLATE2"])],
)
def test_ground_that_gives_leads_from_files_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, modulus: float, verdict: str,
    places: list[str],
) -> None:  # fmt: skip
    """The truth is of finer bricks on pads of 2 mm, of which the deck has none."""
    monkeypatch.chdir(tmp_path)
    frame: Boxes = {
        "PLATE1": ((0, 0, 0), (80, 60, 10)), "POST1": ((30, 20, 10), (50, 40, 320)),
        "HEAD": ((30, 20, 320), (450, 40, 345)), "POST2": ((430, 20, 10), (450, 40, 320)),
        "PLATE2": ((400, 0, 0), (480, 60, 10)),
    }  # fmt: skip
    pads: Boxes = {"PAD1": ((0, 0, -2), (80, 60, 0)), "PAD2": ((400, 0, -2), (480, 60, 0))}
    model = write_deck(Path("model.inp"), "C3D8I", 10.0, 1.0, frame)
    held = [f"{node}, 1, 3" for node, (_, _, z) in read_nodes(model).items() if z == 0.0]
    model.write_text("\n".join([model.read_text(), "*BOUNDARY", *held, ""]))
    truth = write_deck(
        Path("truth.inp"), "C3D20R", 14.0, 1.0, frame | pads, {"PAD1": 210e3, "PAD2": modulus}
    )
    sides = [(x, 30.0, z, "x") for x in (30, 450) for z in (80.0, 160.0, 240.0)]
    fronts = [(x, 20.0, z, "y") for x in (40, 440) for z in (90.0, 200.0, 310.0)]
    tops = [(x, 30.0, 345.0, "z") for x in (60.0, 160.0, 260.0, 340.0, 430.0)]
    ridge = [(x, 20.0, 332.0, "y") for x in (120.0, 240.0, 360.0)]
    write_responses(Path("test.uff"), truth, [*sides, *fronts, *tops, *ridge], first=0)
    assert diagnose_files("model.inp", "test.uff") == (verdict, places)
