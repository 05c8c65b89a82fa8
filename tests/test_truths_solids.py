"""The solids of the truths against theory, and against what they may know."""

from __future__ import annotations

import ast
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from femubench import read_case, read_model, solve_modes
from femubench.core.score.scoring import score_model
from truths.__main__ import main
from truths.bricks import CORNERS, brick_mesh
from truths.defect_cases import visible
from truths.defects import KINDS, OUTSIDE
from truths.drawing import case_text
from truths.eigenmodes import attach, solve
from truths.elasticity import assemble
from truths.measurement import record, sensors_csv
from truths.modes_of import assembled, mesh_of, modes_of
from truths.prestress import with_misfit
from truths.seats import rigid_fit
from truths.sections import Section, angle, bar, channel, i_beam, rectangular_tube, tee
from truths.solid import Solid
from truths.solid_drawing import DECK, DRAWN, deck_of, drawing_of, group_of
from truths.structure import STEEL, Change, Clamp, Lump, Member, Oscillator, Spring, Structure
from truths.suite import structures

pytestmark = pytest.mark.slow(20)

TRUTHS = Path(__file__).parents[1] / "truths"
# What turns solids into cases knows the project; what makes the solids does not.
POSING = {
    *("opensees_cases.py", "shear_cases.py", "posing.py", "faults.py", "defect_cases.py"),
    *("published.py", "stretch_file.py", "tables.py", "truth_text.py", "__main__.py"),
    *("counterfactuals.py", "lacks_file.py", "section_features.py"),
}


def beam(section: Section, length: float = 1.0, clamped: bool = False, **more: object) -> Structure:
    """Return one straight member along x."""
    clamp = Clamp("A", (0.0, -1.0, -1.0), (0.0, 1.0, 1.0))
    structure = Structure(
        name="beam",
        title="A beam",
        classes=(),
        story="",
        materials={"steel": STEEL},
        sections={"s": section},
        joints={"A": (0.0, 0.0, 0.0), "B": (length, 0.0, 0.0)},
        members=(Member("m", ("A", "B"), "s", "steel", 30),),
        sensors=((("m", 0.25), "yz"), (("m", 0.5), "yz"), ("B", "yz")),
        changes=(),
        used=2,
        held_out=1,
        size=(0.04, 0.02),
        guess=50.0,
        clamps=(clamp,) if clamped else (),
        graded=False,
    )
    return replace(structure, **more)  # type: ignore[arg-type]


def frequencies(structure: Structure, size: float = 0.02, count: int = 12) -> np.ndarray:
    solid = brick_mesh(structure, size)
    matrices = assemble(solid, solid.points)
    system = attach(structure, matrices, structure.lumps, structure.springs)
    return solve(system, count + 6, structure.guess).frequencies


@pytest.mark.parametrize(
    ("clamped", "roots"), [(True, (1.8751, 4.6941)), (False, (4.7300, 7.8532))]
)
def test_a_slender_bar_meets_bernoulli(clamped: bool, roots: tuple[float, ...]) -> None:
    """Both bending planes of a square bar, f = (beta L)^2 / (2 pi L^2) sqrt(E I / rho A)."""
    depth, length = 0.01, 1.0
    found = frequencies(beam(bar(depth, depth), length, clamped), count=4)
    for i, root in enumerate(roots):
        hertz = root**2 / (2 * np.pi * length**2) * np.sqrt(STEEL.E * depth**2 / 12 / STEEL.rho)
        np.testing.assert_allclose(found[2 * i : 2 * i + 2], hertz, rtol=3e-3)


@pytest.mark.nightly
@pytest.mark.parametrize("clamped", [True, False])
def test_a_tube_meets_timoshenko(clamped: bool, tmp_path: Path) -> None:
    """Bending of a rectangular tube against a drawn model with shear and rotary inertia.

    The solid's clamp also holds the section's width, which a beam does not know: on a tube of 1.2 m
    that alone makes 0.35 %.
    """
    section = rectangular_tube(0.04, 0.06, 0.003)
    structure = beam(section, 2.0, clamped, beam="timoshenko", weighed=0.0)
    (tmp_path / "case.toml").write_text(case_text(structure, 1.0))
    (tmp_path / "sensors.csv").write_text(sensors_csv(structure))
    header = "mode,frequency,frequency_std,1Y,1Z,2Y,2Z,3Y,3Z\n"
    rows = "".join(f"{i},{10 * i},0.1,1,1,1,1,1,1\n" for i in (1, 2, 3))
    (tmp_path / "modes.csv").write_text(header + rows)
    theory = solve_modes(read_case(tmp_path).model, 14)
    expected = theory.natural_frequencies[theory.natural_frequencies > 1.0][:4]
    np.testing.assert_allclose(frequencies(structure, 0.02, 4)[:4], expected, rtol=3e-3)


def test_six_rigid_modes_and_the_mass() -> None:
    structure = beam(rectangular_tube(0.04, 0.04, 0.003))
    matrices = assembled(structure, mesh_of(structure, 0.04))
    assert modes_of(structure, matrices, 3).rigid == 6
    np.testing.assert_allclose(matrices.total_mass, 7850 * (0.04**2 - 0.034**2), rtol=1e-10)


def test_a_seat_follows_a_rigid_motion() -> None:
    structure = beam(rectangular_tube(0.04, 0.06, 0.003))
    matrices = assembled(structure, mesh_of(structure, 0.04))
    place = ("m", 0.3)
    fit = rigid_fit(structure, matrices, place)
    turn, shift = np.array([0.01, -0.02, 0.03]), np.array([1.0, 2.0, -1.0])
    moved = shift[:, None] + np.cross(turn, matrices.nodes.T).T
    read = fit @ moved.T.ravel()
    np.testing.assert_allclose(read[3:], turn, atol=1e-10)
    np.testing.assert_allclose(read[:3], shift + np.cross(turn, structure.point(place)), atol=1e-10)


def test_a_lump_at_the_tip_meets_rayleigh_s_quotient() -> None:
    """A light cantilever with a heavy tip: f = sqrt(3 E I / (m + 33/140 m_beam) / L^3) / 2 pi."""
    depth, mass = 0.02, 50.0
    structure = beam(bar(depth, depth), 1.0, True, lumps=(Lump("B", mass),), guess=5.0)
    own = STEEL.rho * depth**2
    stiffness = 3 * STEEL.E * depth**4 / 12
    expected = np.sqrt(stiffness / (mass + 33 / 140 * own)) / (2 * np.pi)
    np.testing.assert_allclose(frequencies(structure, 0.02, 4)[:2], expected, rtol=3e-3)


def tetrahedra(bricks: Solid) -> Solid:
    """Return the bricks, each cut into six tetrahedra along a diagonal (Kuhn)."""
    at = {tuple(corner): i for i, corner in enumerate(CORNERS.tolist())}
    paths = [
        np.cumsum([[0, 0, 0], *np.eye(3, dtype=int)[list(p)]], 0) for p in permutations(range(3))
    ]
    cells = [bricks.cells[[at[tuple(corner)] for corner in path.tolist()]] for path in paths]
    turned = [cell[[0, 2, 1, 3]] if i in (1, 2, 5) else cell for i, cell in enumerate(cells)]
    repeated = {
        k: np.tile(getattr(bricks, k), 6) for k in ("part", "modulus", "poisson", "density")
    }
    return replace(bricks, cells=np.hstack(turned), **repeated)


def test_a_solid_drawing_is_a_deck_with_places_springs_and_lumps(tmp_path: Path) -> None:
    """A clamped bar with a drawn mass and a prop at its tip, f by Euler-Bernoulli (Blevins)."""
    depth, mass, prop = 0.05, 4.0, 2e5
    end = Lump("B", mass), Lump("B", 90.0, drawn=False)
    springs = Spring("B", "z", prop), Spring("B", "y", 1e9, drawn=False)
    structure = beam(bar(depth, depth), 1.0, True, lumps=end, springs=springs)
    drawing = drawing_of(structure, tetrahedra(brick_mesh(structure, 0.05)))
    assert deck_of(drawing) == deck_of(drawing)
    (tmp_path / "solid.inp").write_text(deck_of(drawing))
    model = read_model(tmp_path / "solid.inp")
    assert {"A", "B", "m@0.25", "m@0.5"} & set(model.geometry.names) == {"B", "m@0.25", "m@0.5"}
    assert set(model.groups) >= {"spring-B-z"}
    stiff, loaded = 3 * STEEL.E * depth**4 / 12, mass + 33 / 140 * STEEL.rho * depth**2
    expected = np.sqrt(np.array([stiff, stiff + prop]) / loaded) / (2 * np.pi)
    np.testing.assert_allclose(solve_modes(model, 2).natural_frequencies, expected, rtol=1e-2)


def test_a_clamp_in_which_nothing_lies_is_no_drawing() -> None:
    structure = beam(bar(0.05, 0.05), 1.0, True)
    mesh = tetrahedra(brick_mesh(structure, 0.05))
    loose = replace(structure, clamps=(Clamp("A", (-0.2, 0.0, 0.0), (-0.1, 0.1, 0.1)),))
    with pytest.raises(ValueError, match="no node in the clamp at A"):
        deck_of(drawing_of(loose, mesh))


@pytest.mark.parametrize("name", ["haunched-portal", "mast-lumps", "robot-arm"])
def test_a_clamp_holds_a_plate_as_far_as_its_jaws_reach(name: str) -> None:
    """One line of nodes amid a strip would be a hinge."""
    structure = structures()[name]
    deck = (TRUTHS.parent / "scenarios" / "suite" / name / DECK).read_text()
    rows = deck.partition("*NODE\n")[2].partition("*")[0].split()
    nodes = np.array([row.split(",") for row in rows], dtype=float)[:, 1:]
    for i, clamp in enumerate(structure.clamps, 1):
        words = deck.partition(f"*NSET, NSET=held-{i}\n")[2].partition("*")[0]
        held = nodes[np.array(words.replace(",", " ").split(), dtype=int) - 1]
        jaws = np.array([clamp.low, clamp.high])
        plates = (np.array([block.low, block.high]) for block in structure.blocks)
        met = [np.clip(jaws, *b) for b in plates if ((b[0] <= jaws[1]) & (b[1] >= jaws[0])).all()]
        assert held.min(axis=0) == pytest.approx(met[0][0], abs=1e-5)
        assert held.max(axis=0) == pytest.approx(met[0][1], abs=1e-5)


def test_the_solid_drawings_are_those_that_are_listed() -> None:
    suite = TRUTHS.parent / "scenarios" / "suite"
    assert sorted(file.parent.name for file in suite.glob("*/solid.toml")) == sorted(DRAWN)
    assert sum(file.stat().st_size for file in suite.glob("*/solid.inp")) < 20_000_000


@pytest.mark.parametrize("name", ["c-press", "hook-block", "two-material-tee"])
def test_a_solid_drawing_has_the_plates_and_holes_of_its_truth(name: str) -> None:
    """Other elements fill the same volume, so that what is drawn weighs the same."""
    structure = structures()[name]
    bricks = brick_mesh(structure, 1.0)
    edges = bricks.points[:, bricks.cells[[1, 2, 3]]] - bricks.points[:, bricks.cells[:1]]
    weight = float(bricks.density @ np.abs(np.linalg.det(edges.transpose(2, 0, 1))))
    weight += sum(lump.mass for lump in structure.lumps if lump.drawn)
    model = read_model(TRUTHS.parent / "scenarios" / "suite" / name / "solid.inp", unit="m")
    assert model.total_mass == pytest.approx(weight, rel=1e-3)
    assert {group_of(block) for block in structure.blocks if block.material} <= set(model.groups)


@pytest.mark.parametrize(
    ("name", "off"),
    [pytest.param("c-press", 1.5, marks=pytest.mark.nightly), ("tuning-fork", 2.5)],
)
def test_a_solid_drawing_of_the_suite_misses_the_truth_by_its_elements(
    name: str, off: float
) -> None:
    """Of two without soft welds; each mode has its partner."""
    case = read_case(TRUTHS.parent / "scenarios" / "suite" / name / "solid.toml")
    found = score_model(case, case.model)
    modes = [mode for block in ("used", "higher") for mode in found[block].modes]
    assert max(abs(mode.predicted_hz / mode.measured_hz - 1.0) for mode in modes) < off / 100.0
    assert min(mode.mac for mode in modes) > 0.95
    assert len(case.model.groups) > 5


def test_a_spring_and_an_oscillator_act_as_in_theory() -> None:
    structure = beam(bar(0.02, 0.02), 1.0, True)
    matrices = assembled(structure, mesh_of(structure, 0.04))
    bare = modes_of(structure, matrices, 4)
    held = modes_of(structure, matrices, 4, Change("", springs=(Spring("B", "z", 1e9),)))
    # A propped cantilever: its first bending is (3.9266 / 1.8751)^2 that of the free end's.
    ratio = held.frequencies[1] / bare.frequencies[0]
    np.testing.assert_allclose(ratio, (3.9266 / 1.8751) ** 2, rtol=5e-3)
    light = Oscillator("B", "z", 1e-6, 40.0)
    with_light = modes_of(replace(structure, oscillators=(light,)), matrices, 4)
    assert np.abs(with_light.frequencies - 40.0).min() < 0.01
    assert len(with_light.frequencies) == len(bare.frequencies)


def test_tension_raises_bending_as_in_theory() -> None:
    """A bar that is too short between two clamps: f^2 grows by about N L^2 / (4.73^2 ...)."""
    depth, length, strain = 0.01, 1.0, -2e-4
    ends = (
        Clamp("A", (0.0, -1.0, -1.0), (0.0, 1.0, 1.0)),
        Clamp("B", (length, -1.0, -1.0), (length, 1.0, 1.0)),
    )
    structure = beam(bar(depth, depth), length, clamps=ends)
    solid = mesh_of(structure, 0.02)
    matrices = assembled(structure, solid)
    system = attach(structure, matrices, (), ())
    cells = np.ones(solid.cells.shape[1], dtype=bool)
    misfit = np.array([strain, 0.0, 0.0])
    stressed, stress = with_misfit(solid, matrices, system, cells, misfit)
    middle = np.abs(solid.centres[0] - 0.5) < 0.3
    np.testing.assert_allclose(stress[0, 0][middle], -strain * STEEL.E, rtol=2e-3)
    before = modes_of(structure, matrices, 2).frequencies[0]
    after = modes_of(structure, stressed, 2).frequencies[0]
    force, bending = -strain * STEEL.E * depth**2, STEEL.E * depth**4 / 12
    # int w'^2 / int w''^2 of the clamped bar's first shape is 12.30 / 4.730^4.
    expected = before * np.sqrt(1 + force * length**2 * 12.30 / (bending * 4.7300**4))
    np.testing.assert_allclose(after, expected, rtol=3e-3)


@pytest.mark.parametrize(
    "section",
    [
        i_beam(0.06, 0.1, 0.004, 0.006),
        channel(0.05, 0.1, 0.004, 0.006),
        angle(0.05, 0.07, 0.005),
        tee(0.06, 0.08, 0.005, 0.006),
    ],
)
def test_open_sections_have_their_centroid_on_the_axis(section: Section) -> None:
    rectangles = [r[:4] for r in section.rectangles]
    area = sum((b - a) * (d - c) for a, b, c, d in rectangles)
    first = sum((b - a) * (d - c) * np.array([a + b, c + d]) / 2 for a, b, c, d in rectangles)
    np.testing.assert_allclose(first / area, 0.0, atol=1e-15)
    np.testing.assert_allclose(area, section.drawn["A"], rtol=1e-12)


@pytest.mark.nightly
def test_every_kind_of_defect_can_be_seen() -> None:
    """Each kind changes a frame that allows it, and leaves its drawing alone."""
    from truths.defect_cases import Healthy, damaged
    from truths.suite import structures

    known = structures()
    structure = replace(known["portal"], size=(0.04, 0.04), used=4, held_out=1)
    solid = mesh_of(structure, structure.size[0])
    matrices = assembled(structure, solid)
    base = Healthy(structure, solid, matrices, modes_of(structure, matrices, 5))
    whole = matrices.total_mass
    seen = set()
    for kind, make in {**KINDS, **OUTSIDE}.items():
        defect = make(structure, solid, np.random.default_rng(3))
        if defect is None or defect.preload is not None:
            continue
        state, causes, mass = damaged(base, (defect,))
        chi2, _, appears = visible(base, state)
        assert chi2 > 0.0 or appears, kind
        lighter = {"missing-weld", "slot", "thin-wall", "waist"}
        heavier = {"clamp-mass", "water", "strut", "instrument", "patch"}
        assert (mass < whole - 1e-9) == (kind in lighter) or kind == "wrong-material", kind
        assert (mass > whole + 1e-9) == (kind in heavier) or kind == "wrong-material", kind
        assert causes[0].what
        seen.add(kind)
    assert {"missing-weld", "slot", "thin-wall", "clamp-mass", "waist", "patch", "warm"} <= seen
    assert {"stiff-cord", "strut", "instrument", "water", "wrong-material", "gradient"} <= seen


def test_the_scatter_is_what_is_stated() -> None:
    structure = beam(bar(0.02, 0.02), scatter=0.004, shape_scatter=0.03, together=0.5)
    hertz, shapes, mesh = np.full(6, 100.0), np.ones((6, 6)), np.full(6, 0.003)
    drawn = [record(structure, hertz, shapes, mesh, seed, 1) for seed in range(400)]
    drift = np.array([d.frequencies for d in drawn]) / 100 - 1
    np.testing.assert_allclose(drift.std(), 0.004, rtol=0.06)
    between = np.corrcoef(drift[:, 0], drift[:, 1])[0, 1]
    np.testing.assert_allclose(between, 0.5, atol=0.12)
    np.testing.assert_allclose(drawn[0].frequency_std, 0.5, rtol=1e-12)


def test_the_solids_know_nothing_of_the_project() -> None:
    """No module that makes a solid imports femubench or core, not even one it imports."""
    for path in sorted(TRUTHS.rglob("*.py")):
        names = []
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names.append(node.module or "")
        roots = {name.split(".")[0] for name in names}
        if path.name not in POSING:
            assert not roots & {"femubench", "core", "plugins", "scenarios"}, path
            inner = {name.split(".")[1] + ".py" for name in names if name.startswith("truths.")}
            assert not inner & POSING, path


def test_what_lacks_and_a_structure_that_is_not_there_are_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["truths", "potral"])
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "gmsh" else name)
    assert main() == 2
    assert capsys.readouterr().err == "the truths need gmsh: pip install -e '.[truths]'\n"
    monkeypatch.setattr("importlib.util.find_spec", lambda name: name)
    assert main() == 2
    error = capsys.readouterr().err
    assert error.startswith("no structure potral; there are a-frame, ")
    assert error.count("\n") == 1


def test_a_member_that_no_brick_fits_is_named() -> None:
    askew = beam(bar(0.02, 0.02), joints={"A": (0.0, 0.0, 0.0), "B": (1.0, 0.0, 0.5)})
    with pytest.raises(ValueError, match="member m of beam runs askew"):
        brick_mesh(askew, 0.05)
