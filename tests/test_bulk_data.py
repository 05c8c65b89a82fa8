"""Nastran bulk data: what cards say as a frame, against formulas, frames and OpenSees."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import garteur_plane
import numpy as np
import pytest
from test_peer import Peer, description, peer  # noqa: F401 - a fixture

import femubench
from femubench import InputError, Model
from femubench.core.case.units import from_si, in_si
from femubench.core.run.answers import pack_outcome, unpack_outcome
from femubench.core.run.jobs import JobOutcome
from femubench.core.typing import FloatArray
from femubench.fem import Coupling, Eccentricity, GroundSpring, LowRank, Place, PointMass, Property
from femubench.plugins.readers.bulk_data import BulkDataReader
from femubench.plugins.readers.bulk_data.cards import Card
from femubench.plugins.readers.bulk_data.writing import real

READER = BulkDataReader()
E, RHO, L = 7.0e10, 2700.0, 0.8
A, I1, I2, J = 1.0e-4, 2.0e-9, 5.0e-10, 1.0e-9
BAR = f"""GRID,1,,0.,0.,0.
GRID,2,,{L},0.,0.
CBAR,1,10,1,2,0.,1.,0.
PBAR,10,1,{A},{I1},{I2},{J}
MAT1,1,{E},,.3,{RHO}
"""
CLAMPED = BAR + "SPC1,1,123456,1\n"


@pytest.fixture
def model(tmp_path: Path) -> Callable[..., Model]:
    """Return a function that writes cards to a file and reads them."""

    def read(text: str, name: str = "model.bdf") -> Model:
        file = tmp_path / name
        file.write_text(text)
        return READER.read_model(file)

    return read


def hertz(model: Model) -> FloatArray:
    eigenvalues = femubench.solve_modes(model).eigenvalues
    return np.asarray(np.sqrt(np.maximum(eigenvalues, 0.0)) / (2.0 * np.pi))


def row(model: Model, joint: str, direction: str) -> int:
    frame = model.frame_structure.frame
    node = frame.joint_index[joint]
    pairs = zip(model.dofs.node, model.dofs.direction, strict=True)
    return list(pairs).index((node, direction))


def flexibility(model: Model, joint: str, direction: str) -> float:
    i = row(model, joint, direction)
    return float(np.linalg.inv(model.stiffness.toarray())[i, i])


def near(one: Model, other: Model, tolerance: float = 1e-12) -> bool:
    pairs = (one.mass, other.mass), (one.stiffness, other.stiffness)
    return all(abs(a - b).max() <= tolerance * abs(b).max() for a, b in pairs)


SMALL = """$ a comment
GRID    1               0.      0.      0.
GRID    2               .8      0.      0.
CBAR    1       10      1       2       0.      1.      0.              +B1
+B1             56
PBAR    10      1       1.-4    2.-9    5.-10   1.-9    .1              +P1
+P1                                                                     +P2
+P2     .5      .6
MAT1    1       7.+10           .3      2700.
SPC1    1       123456  1
ENDDATA
"""
LARGE = """GRID*                  1                              0.              0.
*                     0.
GRID*   2                               .8              0.
*       0.
CBAR*   1               10              1               2
*       0.              1.              0.
*                       56
PBAR*   10              1               1.0D-4          2.E-9
*       .5-9            1.-9            .1
*
*
*       .5              .6
MAT1*   1               7.E+10                          .3
*       2700.
SPC1*   1               123456          1
"""
FREE = """grid,1,,0.,0.,0.
GRID,2,,.8,0.,0. $ behind
CBAR,1,10,1,2,0.,1.,0.,,+
+,,56
PBAR*,10,1,1.-4,2.-9
*,5.-10,1.-9,.1
,,,,,,,,
,.5,.6
MAT1,1,7.+10,,.3,2700.
SPC1,1,123456,1
"""


def test_all_field_formats_say_the_same(model: Callable[..., Model]) -> None:
    first = model(SMALL)
    assert first.size == 6 + 2  # a clamped end, a free end and two released rotations
    for text in (LARGE, FREE, SMALL.replace("\n", "\r\n"), SMALL.replace("+P1", "   ")):
        other = model(text)
        assert near(other, first, 0.0)
        assert other.frame_structure.frame == first.frame_structure.frame


@pytest.mark.parametrize(
    ("vector", "stiff"),
    [("0.,1.,0.", "y"), ("3.,2.,0.", "y"), ("0.,0.,1.", "z"), ("0.,0.,-4.", "z"), ("9", "z")],
)
def test_plane_1_holds_the_orientation_vector(
    model: Callable[..., Model], vector: str, stiff: str
) -> None:
    text = CLAMPED.replace("0.,1.,0.", vector) + "GRID,9,,0.,0.,5.\n"
    found = model(text)
    soft = {"y": "z", "z": "y"}[stiff]
    assert flexibility(found, "2", stiff) == pytest.approx(L**3 / (3 * E * I1), rel=1e-9)
    assert flexibility(found, "2", soft) == pytest.approx(L**3 / (3 * E * I2), rel=1e-9)


def test_shear_coefficients_belong_to_their_planes(model: Callable[..., Model]) -> None:
    found = model(CLAMPED.replace(f"{J}\n", f"{J},,,\n+,,,,,,,,\n+,.5,.8\n"))
    G = E / 2.6
    for direction, K, i in (("y", 0.5, I1), ("z", 0.8, I2)):
        wanted = L**3 / (3 * E * i) + L / (K * G * A)
        assert flexibility(found, "2", direction) == pytest.approx(wanted, rel=1e-9)


def test_shear_modulus_given_apart_is_that_of_torsion(model: Callable[..., Model]) -> None:
    for material, G in ((",2.+10,.3", 2e10), (",2.+10,", 2e10), (",,.3", E / 2.6)):
        found = model(CLAMPED.replace(",,.3", material))
        assert flexibility(found, "2", "rx") == pytest.approx(L / (G * J), rel=1e-9)


def test_offsets_are_rigid_arms(model: Callable[..., Model]) -> None:
    bar = CLAMPED.replace("0.,1.,0.\n", "0.,1.,0.,,+\n+,,,0.,0.,.1,0.,0.,.1\n", 1)
    found = model(bar)
    linked = BAR.replace("GRID,1,,0.,0.,0.", "GRID,1,,0.,0.,.1").replace(
        "0.,0.\nCBAR", "0.,.1\nCBAR"
    )
    linked += "GRID,8,,0.,0.,0.\nGRID,9,,.8,0.,0.\nSPC1,1,123456,8\n"
    linked += "RBE2,5,8,123456,1\nRBE2,6,9,123456,2\n"
    np.testing.assert_allclose(hertz(found), hertz(model(linked)), rtol=1e-10)
    # Pulled along x next to its axis, the bar bends: u = F L / EA + F e^2 L / EI.
    wanted = L / (E * A) + 0.1**2 * L / (E * I2)
    assert flexibility(found, "2", "x") == pytest.approx(wanted, rel=1e-9)


def test_a_pin_releases_its_rotation(model: Callable[..., Model]) -> None:
    guided = CLAMPED + "SPC1,1,46,2\n"
    tip = flexibility(model(guided), "2", "y")
    assert tip == pytest.approx(L**3 / (12 * E * I1), rel=1e-9)
    pinned = guided.replace("0.,1.,0.\n", "0.,1.,0.,,+\n+,,6\n", 1)
    assert flexibility(model(pinned), "2", "y") == pytest.approx(L**3 / (3 * E * I1), rel=1e-9)


def test_grids_in_turned_systems(model: Callable[..., Model]) -> None:
    plain = model(CLAMPED + "SPC1,1,2,2\n")
    # Local x is basic y and local y basic z, origin at x = 1: grid 2 is held along its own x.
    turned = CLAMPED.replace(f"GRID,2,,{L},0.,0.", f"GRID,2,5,0.,0.,{L - 1.0},5")
    turned += "CORD2R,5,0,1.,0.,0.,2.,0.,0.,+\n+,1.,1.,0.\nSPC1,1,1,2\n"
    assert near(model(turned), plain)
    around = CLAMPED.replace(f"GRID,2,,{L},0.,0.", f"GRID,2,6,{L},-90.,0.,6")
    around += "CORD2C,6,0,0.,0.,0.,0.,0.,1.,+\n+,0.,1.,0.\nSPC1,1,2,2\n"
    assert near(model(around), plain)


def test_point_masses_are_bodies(model: Callable[..., Model]) -> None:
    inertia = "3.-2,1.-3,4.-2,2.-3,-1.-3,5.-2"
    bare, laden = model(BAR), model(BAR + f"CONM2,7,2,,1.5,.1,.2,.3,,+\n+,{inertia}\n")
    added = (laden.mass - bare.mass).toarray()[6:, 6:]
    m, r = 1.5, np.array([0.1, 0.2, 0.3])
    moments = np.array([[3e-2, -1e-3, -2e-3], [-1e-3, 4e-2, 1e-3], [-2e-3, 1e-3, 5e-2]])
    cross = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    wanted = np.block([[m * np.eye(3), -m * cross], [m * cross, moments - m * cross @ cross]])
    np.testing.assert_allclose(added, wanted, atol=1e-12)
    # The same place given in basic coordinates, and half of all mass.
    there = f"CONM2,7,2,-1,1.5,{L + 0.1},.2,.3,,+\n+,{inertia}\n"
    assert near(model(BAR + there), laden)
    assert near(model(BAR + there + "PARAM,WTMASS,.5\n"), replace(laden, mass=0.5 * laden.mass))


@pytest.mark.parametrize("card", ["CBAR", "CBEAM", "CROD"])
def test_a_free_line_has_the_mass_of_its_body_and_six_zero_frequencies(
    model: Callable[..., Model], card: str
) -> None:
    """An L of two bars; a rod between bars is a lump of half of its mass at either end."""
    bar = BAR
    if card == "CBEAM":
        bar = BAR.replace("BAR", "BEAM").replace(f"{I2},", f"{I2},,")
    name = "CBEAM" if card == "CBEAM" else "CBAR"
    frame = model(f"{bar}GRID,3,,{L},.6,0.\n{name},2,10,2,3,0.,0.,1.\n"
                  + ("PROD,20,1,2.-5\nCROD,9,20,1,3\n" if card == "CROD" else ""))  # fmt: skip
    origin = frame.dofs.xyz.mean(axis=0)
    along = np.array([["x", "y", "z", "rx", "ry", "rz"].index(d) for d in frame.dofs.direction])
    turned = np.cross(np.eye(3)[None], (frame.dofs.xyz - origin)[:, None])
    moved = np.dstack([turned, np.tile(np.eye(3), (len(along), 1, 1))])
    rigid = np.hstack([np.eye(6)[along, :3], moved[np.arange(len(along)), :, along]])
    found = rigid.T @ (frame.mass @ rigid)
    spans = [
        (np.zeros(3), np.array([L, 0.0, 0.0])),
        (np.array([L, 0.0, 0.0]), np.array([L, 0.6, 0])),
    ]
    points, shares = [], []
    for first, last in spans:  # Simpson's rule is exact for squares
        weight = RHO * A * np.linalg.norm(last - first)
        points += [first, 0.5 * (first + last), last]
        shares += [weight / 6.0, weight / 1.5, weight / 6.0]
    if card == "CROD":
        points += [spans[0][0], spans[1][1]]
        shares += [0.5 * RHO * 2e-5 * float(np.hypot(L, 0.6))] * 2
    arms, weights = np.array(points) - origin, np.array(shares)
    assert found[0, 0] == pytest.approx(weights.sum(), rel=1e-6)
    centre = weights @ arms / weights.sum()
    turned = np.cross(np.eye(3)[:, None], arms[None])  # of the points, by each rotation
    wanted = np.einsum("p,ipk,jpk->ij", weights, turned, turned)
    own = RHO * (I1 + I2) * np.array([L, 0.6])  # of the twist of each bar
    if card == "CBEAM":  # which has shear, and rotary inertia with it
        own += RHO * np.array([0.6 * I1, L * I2])
    np.testing.assert_allclose(
        found[:3, 3:], found[0, 0] * np.cross(np.eye(3), centre).T, atol=1e-8
    )
    assert np.diag(found[3:, 3:] - wanted)[:2] == pytest.approx(own[:2], abs=1e-7)
    assert hertz(frame)[:6] == pytest.approx(np.zeros(6), abs=1e-2)
    assert hertz(frame)[6] > 1.0


def test_mass_without_stiffness_adds_to_translations(model: Callable[..., Model]) -> None:
    bare, laden = model(BAR), model(BAR.replace(f"{J}\n", f"{J},.05\n"))
    assert laden.total_mass == pytest.approx((RHO * A + 0.05) * L)
    twist = row(bare, "1", "rx")
    assert laden.mass[twist, twist] == bare.mass[twist, twist]


def test_springs_and_rods(model: Callable[..., Model]) -> None:
    ground = model(BAR + "CELAS2,5,1.+4,2,3\nCELAS1,6,8,2,5\nPELAS,8,20.,,,9,1.\n")
    held = ground.stiffness - model(BAR).stiffness
    assert held[row(ground, "2", "z"), row(ground, "2", "z")] == 1e4
    assert held[row(ground, "2", "ry"), row(ground, "2", "ry")] == 20.0
    assert held.nnz == 2
    extra = f"GRID,3,,{L},.5,0.\nSPC1,1,3,3\n"
    rod = model(CLAMPED + extra + "CROD,4,20,2,3\nPROD,20,1,2.-5,,,.2\nCELAS2,9,5.,3,1\n")
    spring = model(CLAMPED + extra + f"CELAS2,4,{E * 2e-5 / 0.5},2,2,3,2\nCELAS2,9,5.,3,1\n")
    assert near(spring, replace(rod, mass=spring.mass))
    assert rod.total_mass - spring.total_mass == pytest.approx((RHO * 2e-5 + 0.2) * 0.5)
    assert rod.size == 6 + 2  # what nothing resists is held, as Nastran does by itself


SHAPES = {
    "ROD": ("0.01", np.pi * 1e-4, np.pi / 4 * 1e-8, np.pi / 4 * 1e-8),
    "TUBE": ("0.01,0.008", np.pi * 0.36e-4, np.pi / 4 * 0.5904e-8, np.pi / 4 * 0.5904e-8),
    "BAR": ("0.02,0.01", 2e-4, 0.02 * 0.01**3 / 12, 0.01 * 0.02**3 / 12),
    "BOX": (
        "0.02,0.01,0.001,0.001",
        2e-4 - 0.018 * 0.008,
        (0.02 * 0.01**3 - 0.018 * 0.008**3) / 12,
        (0.01 * 0.02**3 - 0.008 * 0.018**3) / 12,
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes(model: Callable[..., Model], shape: str) -> None:
    sizes, area, plane_1, plane_2 = SHAPES[shape]
    numbers = f"PBAR,10,1,{A},{I1},{I2},{J}\n"
    text = CLAMPED.replace(numbers, f"PBARL,10,1,,{shape},,,,,+\n+,{sizes},.1\n")
    found = model(text)
    section = found.frame_structure.frame.members[0].section
    assert (section.A, section.Iz, section.Iy) == pytest.approx((area, plane_1, plane_2))
    assert found.total_mass == pytest.approx((RHO * area + 0.1) * L)


def test_a_constant_pbeam_is_a_pbar_with_shear(model: Callable[..., Model]) -> None:
    bar = CLAMPED.replace(f"{J}\n", f"{J},.1\n+,,,,,,,,\n+,1.,1.\n")
    beam = CLAMPED.replace("CBAR", "CBEAM").replace(
        f"PBAR,10,1,{A},{I1},{I2},{J}\n",
        f"PBEAM,10,1,{A},{I1},{I2},,{J},.1\n+,0.,0.,,,,,,\n+,NO,1.,{A},{I1},{I2},,{J},.1\n",
    )
    assert near(model(beam), model(bar), 0.0)


def test_constraints_that_case_control_chooses(model: Callable[..., Model]) -> None:
    sets = BAR + "SPC1,1,123456,1\nSPC,2,2,3,,1,123\nSPCADD,3,1,2\n"
    start = "SOL 103\nCEND\nSPC = {}\nBEGIN BULK\n"
    assert model(start.format(1) + sets).size == 6
    assert model(start.format(2) + sets).size == 8
    assert model(start.format(3) + sets).size == 5
    assert model("CEND\nBEGIN BULK\n" + sets).size == 12
    with pytest.raises(InputError, match="2 sets, and no case control"):
        model(sets)
    everywhere = (
        BAR.replace("GRID,2,", "GRID,2,,").replace(f",,{L}", f",{L}") + "GRDSET,,,,,,,126\n"
    )
    assert model(everywhere).size == 6


def test_rigid_links_take_lists_and_single_motions(model: Callable[..., Model]) -> None:
    text = CLAMPED + f"GRID,3,,{L},.2,0.\nGRID,5,,{L},.4,0.\nCONM2,8,5,,.5\n"
    whole = model(text + "RBE2,7,2,123456,3,THRU,9\n")
    assert [link.follows for link in whole.frame_structure.frame.links] == [("3", "5")]
    parts = model(text + "CONM2,9,3,,.1\nRBE2,7,2,123,3,5,1.-5\n")
    assert parts.frame_structure.frame.links[0].motions == ("x", "y", "z")


def test_files_are_included_from_their_folder_alone(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "bar.inc").write_text(BAR)
    main = tmp_path / "main.bdf"
    main.write_text("INCLUDE 'parts/bar.inc'\nSPC1,1,123456,1\n")
    assert READER.read_model(main).size == 6
    assert READER.model_files(main) == (tmp_path / "parts" / "bar.inc",)
    (tmp_path.parent / "outside.inc").write_text(BAR)
    (tmp_path / "link.inc").symlink_to(tmp_path.parent / "outside.inc")
    for name in ("../outside.inc", "link.inc", str(tmp_path.parent / "outside.inc"), "main.bdf"):
        main.write_text(f"INCLUDE '{name}'\n")
        with pytest.raises(InputError, match=r"included file|is included twice"):
            READER.read_model(main)


BROKEN = {
    "CSHEAR,5,1,1,2,3,4": "CSHEAR 5: this card is not read",
    "GRID,1,,1.,0.,0.": "GRID 1: GRID 1 is there already",
    "CBAR,2,11,1,2,0.,1.,0.": "CBAR 2, PID: there is no PBAR or PBARL 11",
    "CBAR,2,10,1,3,0.,1.,0.": "CBAR 2, GB: there is no GRID 3",
    "CBAR,2,10,1,2,1.,0.,0.": "orientation vector lies along the bar",
    "CBAR,2,10,1,2": "CBAR 2, X1: no orientation vector",
    "CBAR,2,10,1,1,0.,1.,0.": "the bar has no length",
    "CBAR,2,10,1,2,0.,1.,0.,,,,,,,,,,,,": "fields",
    "PBAR,12,1,x,1.": "PBAR 12, A: 'X'",
    "PBAR,12,1,1.,1.,1.,,,,+\n+,,,,,,,,\n+,,,.1": "PBAR 12, I12: .1",
    "PBAR,12,9,1.,1.,1.": "PBAR 12, MID: there is no MAT1 9",
    "PBARL,12,1,,HAT,,,,,+\n+,1.,1.": "PBARL 12, TYPE: shape 'HAT'",
    "MAT1,2,-7.+10,,.3\nPBAR,12,2,1.,1.,1.": "MAT1 2, E: -7e+10",
    "MAT1,2,7.+10,,.3,1.-320\nPBAR,12,2,1.-4,1.,1.,1.,1.\nCBAR,2,12,1,2,0.,1.,0.": (
        "PBAR 12, NSM: mass of a bar without density"
    ),
    "CONM2,9,3,,1.\nGRID,3,,1.,1.,1.": "GRID 3: nothing holds this grid",
    "CONM2,9,2,,1.,,,,,+\n+,9.,,1.,,,1.": "moments of inertia that no body has",
    "CELAS2,9,1.,1,1,2,2": "a spring between two grids across their line",
    "RBE2,9,1,123456,2\nRBE2,10,2,123456,1": "RBE2",
    "SPC1,1,7,1": "SPC1 1, C: '7'",
    "GRID,4,7,0.,0.,0.": "GRID 4, CP: there is no coordinate system 7",
    "CORD2R,7,7,0.,0.,0.,1.,1.,1.,+\n+,1.,0.,0.\nGRID,4,7": "no coordinate system 7",
    "CORD2R,7,,0.,0.,0.,1.,1.,1.,+\n+,2.,2.,2.\nGRID,4,7": "the points lie on one line",
    "BEGIN SUPER=1": "superelements are not read: 'BEGIN SUPER=1'",
    "=,*(1),=,*(1.),==": "(replication)",
    "INCLUDE 'parts\\bar.inc'": "'parts\\\\bar.inc' is not there",
    "1234": "'1234'",
    "MAT1,3,1.+10,,.3,,,,,+A\n+B,1.": "continuation '+B'",
}


@pytest.mark.parametrize("cards", BROKEN)
def test_a_wrong_card_is_named_with_its_line(model: Callable[..., Model], cards: str) -> None:
    with pytest.raises(InputError, match=re.escape(BROKEN[cards])) as caught:
        model(CLAMPED + cards + "\n")
    assert caught.value.line is not None
    assert caught.value.line >= len(BAR.splitlines()) - 4


def test_a_space_frame_agrees_with_opensees(
    model: Callable[..., Model],
    peer: Peer,  # noqa: F811
) -> None:
    rng = np.random.default_rng(3)
    points = np.array([[0, 0, 0], [1, 0, 0.2], [1.2, 0.9, 0], [0.1, 1, 1], [0.6, 0.5, 1.3]])
    lines = [f"GRID,{i},,{x},{y},{z}" for i, (x, y, z) in enumerate(points, 1)]
    for k, (a, b) in enumerate([(1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (1, 5)], 1):
        v = ",".join(f"{c:.3f}" for c in rng.normal(size=3))
        lines.append(f"CBAR,{k},{1 + k % 2},{a},{b},{v}")
    lines += ["PBAR,1,1,2.-4,3.-9,9.-9,12.-9", "PBAR,2,1,1.-4,5.-10,2.-9,2.5-9"]
    lines += ["MAT1,1,7.+10,,.3,2700.", "SPC1,1,123456,1,3", "CONM2,99,5,,.3"]
    found = model("\n".join(lines))
    frame = found.frame_structure.frame
    stated = description(frame, 12)
    # As numbers of the cards, not of the frame that was read.
    for element, k in zip(stated["elements"], range(1, 7), strict=True):
        i1, i2 = ((3e-9, 9e-9), (5e-10, 2e-9))[k % 2]
        element |= {"Iz": i1, "Iy": i2}
    np.testing.assert_allclose(hertz(found)[:12], peer(stated), rtol=1e-7)


def garteur() -> Model:
    return in_si(READER.read_model(garteur_plane.FILE), "mm")


def test_the_garteur_plane_is_that_of_the_frame() -> None:
    assert garteur_plane.FILE.read_text() == garteur_plane.cards()
    found, wanted = garteur(), Model.of(garteur_plane.frame())
    assert near(found, wanted)
    np.testing.assert_allclose(hertz(found)[5:20], hertz(wanted)[5:20], rtol=1e-9)
    frame = found.frame_structure.frame
    families = {family.name: len(family.members) for family in frame.families}
    assert families["section:2"] == 12  # the wing
    assert families["material:1"] == len(frame.members)


def changed(model: Model, factors: dict[tuple[str, str], float]) -> Model:
    """Return a model with factors on quantities of members."""
    structure = model.frame_structure
    for (quantity, member), factor in factors.items():
        places = tuple(s for s in structure.labels if member in ("all", s.partition("/")[0]))
        parameter = Property(f"{quantity} {member}", quantity, places)
        structure = structure.with_values([parameter], [factor])
    return Model.of(structure)


TWO = SMALL.replace("GRID    2               .8 ", "GRID    3               .8 ").replace(
    "CBAR    1       10      1       2 ", "CBAR    7       10      2       3 "
) + (
    "GRID,2,,.5,0.,0.  $ in the middle\r\n"
    "$ the first bar\nCBAR*,1,10,1,2\n*,0.,1.,0.\n"
    "CBAR    2       11      2       3               1.              $ the second\n"
    "PBARL,11,2,,TUBE,,,,,+\n+,.01,.008,.1\nMAT1,2,7.+10,,.3,2700.,1.-5\n"
    "PBEAM,13,2,1.-4,2.-9,5.-10\nEIGRL,1,,,10\n"
)
TWO = TWO.replace("ENDDATA\n", "") + "ENDDATA\nbehind the end\n"


KINDS = """SPC = 1
BEGIN BULK
GRDSET,,,,,,,456
CORD2R,5,0,1.,0.,0.,2.,0.,0.,+
+,1.,1.,0.
CORD2C,6,5,0.,0.,0.,0.,0.,1.,+
+,0.,1.,0.
GRID,1,,0.,0.,0.
GRID,2,6,.8,30.,0.,6
GRID,3,,.5,.5,.5
BAROR,,10,,,0.,1.,0.
CBAR,1,,1,2,,,,,+
+,5,,0.,.1,0.
CBEAM,2,11,2,3,1
PBAR,10,1,1.-4,2.-9,5.-10,1.-9
PBEAM,11,1,1.-4,2.-9,5.-10,,1.-9,.1,+
+,0.,0.,,,,,,,+
+,YES,1.,1.-4,2.-9,5.-10,,1.-9,.1
MAT1,1,7.+10,,.3,2700.
CROD,3,12,1,3
PROD,12,1,2.-5
CONM2,4,3,5,1.5,.1,.2,.3,,+
+,3.-2,1.-3,4.-2,2.-3,-1.-3,5.-2
CELAS1,5,8,2,3
PELAS,8,20.
RBE2,6,1,123,3
SPC1,1,123456,1,THRU,2
SPC,2,3,1
SPCADD,3,1,2
"""
TRUSS = """SPC = 1
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,3.,0.,0.
GRID,3,,0.,4.,0.
GRID,4,,3.,4.,0.
CROD,1,1,1,2
CROD,2,1,2,4
CROD,3,1,3,4
CROD,4,2,1,4
CROD,5,2,2,3
PROD,1,1,2.-4,1.-9
PROD,2,1,1.-4,,,.3
MAT1,1,7.+10,2.6+10,,2700.
SPC1,1,12345,1,3
SPC1,1,3,2,4
"""


@pytest.mark.parametrize(
    ("cards", "quantities"),
    [(KINDS, ("E", "EI", "EA", "GJ", "density", "rhoA")), (TRUSS, ("E", "EA", "density", "rhoA"))],
)
def test_what_every_kind_of_card_says_comes_back(
    tmp_path: Path, cards: str, quantities: tuple[str, ...]
) -> None:
    original, path = tmp_path / "model.bdf", tmp_path / "new.bdf"
    original.write_text(cards)
    rng = np.random.default_rng(0)
    draws = {(q, bar): rng.uniform(0.8, 1.3) for q in quantities for bar in ("E1", "E2")}
    wanted = changed(READER.read_model(original), draws)
    READER.write_model(wanted, path, original)
    assert near(READER.read_model(path), wanted, 1e-11)
    kept = [line for line in cards.splitlines() if line[:3] in ("SPC", "COR", "GRI", "RBE", "CON")]
    assert set(kept) <= set(path.read_text().splitlines())


@pytest.mark.parametrize(
    ("factors", "cards"),
    [
        ({}, []),
        ({("E", "all"): 1.1}, ["MAT1*   1", "MAT1*   2"]),
        ({("density", "E2"): 0.93}, ["MAT1*   2", "PBARL*  11"]),
        ({("E", "E1"): 1.0712345678912}, ["PBAR*   14", "MAT1*   3"]),
        ({("EI", "all"): 0.8123456789}, ["PBAR*   10", "PBAR*   11", "MAT1*   1", "MAT1*   2"]),
        ({("EA", "E1"): 1.2, ("rhoA", "E1"): 1.1}, ["PBAR*   14"]),
        ({("shear", "E1"): 1.7, ("GJ", "E7"): 1.2}, ["PBAR*   10", "PBAR*   14"]),
    ],
)
def test_an_update_changes_its_cards_and_no_other_byte(
    tmp_path: Path, factors: dict[tuple[str, str], float], cards: list[str]
) -> None:
    original, path = tmp_path / "model.bdf", tmp_path / "new" / "model.bdf"
    original.write_bytes(TWO.encode("latin-1"))
    wanted = changed(READER.read_model(original), factors)
    path.parent.mkdir()
    READER.write_model(wanted, path, original)
    back = READER.read_model(path)
    assert near(back, wanted)
    assert [m.name for m in back.frame_structure.frame.members] == ["E7", "E1", "E2"]
    before, after = (file.read_bytes().splitlines(keepends=True) for file in (original, path))
    new = [line for line in after if line not in before]
    starts = [line.decode()[:16].strip() for line in new if line[:1] == b"P" or line[:1] == b"M"]
    assert sorted(starts) == sorted(cards)
    kept = [line for line in before if line[:4] not in (b"PBAR", b"MAT1")]
    moved = sum(line.startswith(b"CBAR") for line in new)
    there = [line for line in kept if line in after]
    assert len(there) >= len(kept) - moved - 4  # with continuations of what changed
    assert not factors or b"1.-5" in b"".join(after)


def test_the_updated_plane_goes_back_out_in_its_units(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    names = [m.name for m in garteur().frame_structure.frame.members]
    draws = {(q, name): rng.uniform(0.7, 1.4) for name in names for q in ("E", "density", "GJ")}
    wanted = changed(garteur(), draws)
    path = tmp_path / "updated.bdf"
    READER.write_model(from_si(wanted, "mm"), path, garteur_plane.FILE)
    assert near(in_si(READER.read_model(path), "mm"), wanted)


def test_included_files_are_written_next_to_the_model(tmp_path: Path) -> None:
    (tmp_path / "bar.inc").write_text(BAR)
    main = tmp_path / "main.bdf"
    main.write_text("INCLUDE 'bar.inc'\nSPC1,1,123456,1\n")
    wanted = changed(READER.read_model(main), {("E", "all"): 1.1})
    with pytest.raises(InputError, match="an included file changes and would be overwritten"):
        READER.write_model(wanted, tmp_path / "other.bdf", main)
    path = tmp_path / "new" / "main.bdf"
    READER.write_model(wanted, path, main)
    assert near(READER.read_model(path), wanted)
    assert path.read_bytes() == main.read_bytes()
    assert "7.7+10" in (path.parent / "bar.inc").read_text()


@pytest.mark.parametrize("cards", [TWO, TWO.replace("\nENDDATA\nbehind the end\n", ""), KINDS])
def test_masses_and_springs_that_an_update_adds_get_cards(tmp_path: Path, cards: str) -> None:
    original, path = tmp_path / "model.bdf", tmp_path / "new.bdf"
    original.write_bytes(cards.encode("latin-1"))
    model = changed(READER.read_model(original), {("E", "E1"): 1.2})
    joint = "2" if cards != KINDS else "1.1"
    masses = (PointMass(Place(joint=joint), 0.3, (0.1, 0.0, -0.2)), PointMass(Place("3"), 0.1))
    springs = (GroundSpring(Place(joint="3"), "y", 4e3), GroundSpring(Place(joint="3"), "-rz", 9.0))
    wanted = model.attach(masses, springs)
    READER.write_model(wanted, path, original)
    assert near(READER.read_model(path), wanted)
    before, after = original.read_text(), path.read_text()
    assert (after.count("CONM2"), after.count("CELAS2")) == (before.count("CONM2") + 2, 2)
    assert "behind the end" in after or cards != TWO


def test_what_cards_of_properties_cannot_say_is_refused(tmp_path: Path) -> None:
    original = tmp_path / "model.bdf"
    original.write_bytes(TWO.encode("latin-1"))
    model = READER.read_model(original)
    frame = model.frame_structure.frame
    laden = frame.with_attachments((PointMass(Place(member="E2", s=0.4), 0.1),), ())
    basis = np.eye(model.size)[:, :1]
    for update in (
        replace(model, stiffness=1.1 * model.stiffness),
        replace(model, mass_change=LowRank(basis, np.eye(1))),
        Model.of(laden),
        Model.of(replace(frame, eccentricities=(Eccentricity("E1", y=0.01),))),
        Model.of(replace(frame, couplings=(Coupling("E2", 0.1),))),
        changed(model, {("rotary", "E1"): 1.3}),
    ):
        with pytest.raises(InputError, match=r"op4 and \.mtx"):
            READER.write_model(update, tmp_path / "new.bdf", original)
    assert not (tmp_path / "new.bdf").exists()


@pytest.mark.parametrize("power", [-14, -11, -10, -4, -1, 0, 1, 6, 12])
def test_numbers_have_the_digits_that_a_field_can_hold(power: int) -> None:
    limit = 5e-15 if power >= 0 else 5e-13 if power >= -10 else 5e-12
    for value in np.random.default_rng(power + 20).uniform(1.0, 10.0, 50) * 10.0**power:
        for number, tolerance in ((value, limit), (-value, 10.0 * limit)):
            text = real(number)
            assert len(text) <= 16
            assert "." in text
            back = Card("X", (text,), Path(), 0, 0).real(1, "x")
            assert back == pytest.approx(number, rel=tolerance, abs=0.0)


def test_coordinates_for_matrices_of_other_files(tmp_path: Path) -> None:
    file = tmp_path / "shell.bdf"
    file.write_text("GRID,1,,1.,2.,3.\nGRID,7,5,1.,0.,0.\nCQUAD4,1,1,1,7,1,7\n"
                    "CORD2R,5,0,1.,0.,0.,2.,0.,0.,+\n+,1.,1.,0.\n")  # fmt: skip
    nodes = READER.read_nodes(file)
    np.testing.assert_allclose([nodes["1"], nodes["7"]], [[1, 2, 3], [1, 1, 0]], atol=1e-12)


def test_a_bar_is_that_which_nastran_punched(model: Callable[..., Model]) -> None:
    # Numbers of the bar of NASTRAN_CoFE; its punch has these ten digits.
    found = model(
        "MDLPRM,HDF5,0\nMAT1,501,1440.E6,,.33,5.37078819\nCBAR,1,101,1,2,0.,1.,0.\n"
        "GRID,1,0,0.0,0.0,0.0,0\nGRID,2,0,1.0,0.0,0.0,0\nFORCE,1,2,,1.0E8,0.25,0.5,-1.0\n"
        "PBAR,101,501,15000.,2500.,250.,25000.,0.0\n,.1,.1,-0.1,.1,-0.1,-0.1,.1,-0.1\n,0.0,0.0\n"
    )
    stiffness = found.stiffness.toarray()
    punched = {(0, 0): 2.16e13, (1, 1): 4.32e13, (2, 2): 4.32e12, (3, 3): 1.353383459e13}
    punched |= {(2, 4): -2.16e12, (4, 4): 1.44e12, (1, 5): 2.16e13, (5, 5): 1.44e13}
    for (i, j), value in punched.items():
        assert stiffness[i, j] == pytest.approx(value, rel=5e-10)
    assert found.total_mass == pytest.approx(5.37078819 * 15000.0)


def test_a_truss_is_rods_between_hinges(model: Callable[..., Model]) -> None:
    found = model(TRUSS)
    assert sorted(found.dofs.direction) == ["x", "x", "y", "y"]
    wanted = np.zeros((4, 4))
    for unit, stiffness in (
        (np.array([1.0, 0.0, 0.0, 0.0]), 7e10 * 2e-4 / 3.0),
        (np.array([0.0, -1.0, 0.0, 1.0]), 7e10 * 2e-4 / 4.0),
        (np.array([0.0, 0.0, 1.0, 0.0]), 7e10 * 2e-4 / 3.0),
        (np.array([0.0, 0.0, 0.6, 0.8]), 7e10 * 1e-4 / 5.0),
        (np.array([0.6, -0.8, 0.0, 0.0]), 7e10 * 1e-4 / 5.0),
    ):
        wanted += stiffness * np.outer(unit, unit)
    np.testing.assert_allclose(found.stiffness.toarray(), wanted, rtol=1e-12, atol=1e-3)
    length = 3.0 + 4.0 + 3.0
    total = 2700.0 * (2e-4 * length + 1e-4 * 10.0) + 0.3 * 10.0
    assert found.total_mass == pytest.approx(total)


def test_a_rod_next_to_bars_pulls_and_twists_but_turns_with_no_joint(
    model: Callable[..., Model],
) -> None:
    portal = CLAMPED + f"GRID,3,,0.,.6,0.\nGRID,4,,{L},.6,0.\nCBAR,2,10,3,4,0.,1.,0.\n"
    portal += "SPC1,1,123456,3\nPROD,20,1,2.-5,{}\nCROD,9,20,2,4\n"
    bare, twisting = model(portal.format("")), model(portal.format("3.-9"))
    gained = (twisting.stiffness - bare.stiffness).tocoo()
    i, j = row(bare, "2", "ry"), row(bare, "4", "ry")
    k = E / 2.6 * 3e-9 / 0.6
    stiffness = np.zeros(bare.stiffness.shape)
    stiffness[np.ix_([i, j], [i, j])] = [[k, -k], [-k, k]]
    np.testing.assert_allclose(gained.toarray(), stiffness, atol=1e-6)
    alone = model(portal.format("").replace("CROD,9,20,2,4\n", ""))
    lumps = (bare.mass - alone.mass).diagonal()
    halves = [lumps[row(bare, joint, d)] for joint in "24" for d in "xyz"]
    assert halves == pytest.approx([0.5 * RHO * 2e-5 * 0.6] * 6)
    assert lumps.sum() == pytest.approx(sum(halves))
    softer = changed(bare, {("E", "E9"): 0.5})
    assert not near(softer, bare, 1e-6)


def test_systems_by_grids_and_spheres_place_grids(model: Callable[..., Model]) -> None:
    plain = model(CLAMPED)
    frame = "GRID,11,,1.,0.,0.\nGRID,12,,2.,0.,0.\nGRID,13,,1.,1.,0.\nGRID,14,,1.,0.,5.\n"
    # z along basic x, x along basic y; the second system of the card is not used.
    by_grids = CLAMPED.replace(f"GRID,2,,{L},0.,0.", f"GRID,2,5,0.,0.,{L - 1.0},5") + frame
    assert near(model(by_grids + "CORD1R,5,11,12,13,6,11,12,13\n"), plain)
    for k, (system, place) in enumerate(
        (("CORD1C", f"0.,0.,{L - 1.0}"), ("CORD1S", f"{1.0 - L},180.,0.")), 1
    ):
        text = CLAMPED.replace(f"GRID,2,,{L},0.,0.", f"GRID,2,5,{place}") + frame
        assert near(model(f"{text}{system},{k},11,12,14,5,11,12,13\n"), plain)
    # Along the radius, downwards and around at a point in the x-y plane.
    ball = CLAMPED.replace(f"GRID,2,,{L},0.,0.", f"GRID,2,7,{L},90.,0.,7") + "SPC1,1,2,2\n"
    ball += "CORD2S,7,0,0.,0.,0.,0.,0.,1.,+\n+,1.,0.,0.\n"
    assert near(model(ball), model(CLAMPED + "SPC1,1,3,2\n"))


def test_a_case_has_all_its_files_and_says_what_of_them_does_not_count(tmp_path: Path) -> None:
    idle = "FORCE,3,2,,1.,0.,0.,1.\nDESVAR,1,A,1.\nDRESP1,1,F,FREQ,,,1\nMAT4,1,204.\nDTI,X,1\n"
    idle += "PSHELL,5,1,.1\nASET1,123456,2\nMDLPRM,HDF5,0\nPARAM,POST,-1\nGRID,77,,9.,9.,9.\n"
    part = tmp_path / "parts" / "idle.inc"
    part.parent.mkdir()
    part.write_text(idle)
    (tmp_path / "truss.bdf").write_text(TRUSS + "INCLUDE 'parts/idle.inc'\n")
    (tmp_path / "modes.csv").write_text("mode,frequency,frequency_std,damping\n1,15.0,0.1,\n")
    (tmp_path / "case.toml").write_text(
        '[case]\nname = "truss"\n[model]\nkind = "file"\nfile = "truss.bdf"\n'
        '[measurement]\nmodes = "modes.csv"\nused = [1]\n'
    )
    case = femubench.read_case(tmp_path, readers=(READER,))
    assert case.notes == (
        "truss.bdf: cards left out: DESVAR (1), DRESP1 (1), DTI (1), FORCE (1), MAT4 (1), "
        "MDLPRM (1), PARAM (1), PSHELL (1)",
        "truss.bdf: nothing is reduced or held by ASET1 (1): all directions stay",
        "truss.bdf: J of PROD is left out: a joint of rods alone takes up no twist",
        "truss.bdf: masses are consistent; Nastran lumps them by default",
    )
    plain = tmp_path / "plain.bdf"
    plain.write_text(TRUSS)
    assert near(case.model, READER.read_model(plain), 0.0)
    part.write_text(idle + "MAT1,9,7.+10,,.3\n")
    assert femubench.read_case(tmp_path, readers=(READER,)).digest != case.digest
    for asked, note in (("1", ()), ("-1", ("the file asks for lumped ones (COUPMASS)",))):
        plain.write_text(CLAMPED + f"PARAM,COUPMASS,{asked}\n")
        said = tuple(f"masses are consistent; {what}" for what in note)
        assert READER.read_remarks(plain) == ("cards left out: PARAM (1)", *said)
    plain.write_text("BEGIN BULK\n" + CLAMPED + "PARAM,COUPMASS,1\n")
    assert READER.read_remarks(plain)[1] == "nothing is held by SPC: no `SPC = 1` before BEGIN BULK"


FOREIGN = {
    "/BATCH\n/COM, a model\n": "an input file of Ansys: '/BATCH'",
    "*HEADING\n beam\n": "an input file of Abaqus or CalculiX: '*HEADING'",
    CLAMPED.replace("CBAR", "CBEAM").replace("PBAR", "PBEAML"): "this property is not read",
}


@pytest.mark.parametrize("text", FOREIGN)
def test_what_is_no_frame_of_bars_is_named(model: Callable[..., Model], text: str) -> None:
    with pytest.raises(InputError, match=re.escape(FOREIGN[text])):
        model(text)


@pytest.mark.parametrize("cards", [KINDS, TRUSS])
def test_a_run_takes_over_what_a_strategy_makes_of_the_model(
    model: Callable[..., Model], cards: str
) -> None:
    nominal = model(cards)
    wanted = changed(nominal, {("E", "all"): 1.1})
    found = unpack_outcome(pack_outcome(JobOutcome("ok", model=wanted), nominal), nominal).model
    assert found is not None
    assert near(found, wanted, 0.0)
