"""Twins of stretched structures: their truth against solids in full, and whom they find."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import harness_toys as toys
import numpy as np
import pytest
from running import run_jobs
from twin_toys import Ratios

import femubench
from femubench import read_case
from femubench.core.case.case import Case
from femubench.core.errors import InputError, NotApplicable
from femubench.core.run.companions import choose_companions
from femubench.core.run.starts import Starts
from femubench.core.score.twin_gain import TwinGain, twin_gains
from femubench.core.twin.reduced_solid import ReducedSolid
from femubench.core.twin.stretched_case import FILE, draw_stretched_case, stretch_case
from femubench.core.twin.twins import FAMILIES, TruthFamily, twin_of, twins_of
from tests.command import call_bench
from truths.drawing import case_text
from truths.measurement import modes_csv, record, sensors_csv
from truths.modes_of import assembled
from truths.reduction import KnownSolid, basis_of, drawn_factors, snapshots, stretched
from truths.remade import RemadeSolid
from truths.seats import rigid_fit
from truths.sections import bar, rectangular_tube
from truths.stretch import stretch_of
from truths.stretch_file import HELD_OUT_SEED, SUITE, distance, file_of, held_out, solid_of
from truths.structure import STEEL, Change, Lump, Member, Spring, Structure
from truths.suite import mesh_differences, structures

pytestmark = pytest.mark.slow(20)

FILES = sorted(SUITE.glob(f"*/{FILE}"))
NAMES = [file.parent.name for file in FILES]
LARGEST = 13 * 1024**2  # bytes of all files
ROW = re.compile(r"^\| \d+ \| (?:used|held out) \| ([\d.]+) \|", re.MULTILINE)


def tee() -> Structure:
    """A free T of two tubes, with a mass at its foot and a change of its design."""
    return Structure(
        name="tee",
        title="A T",
        classes=(),
        story="",
        materials={"steel": STEEL},
        sections={"s": rectangular_tube(0.04, 0.04, 0.004)},
        joints={"A": (0, 0, 0), "B": (0.3, 0, 0), "C": (0.7, 0, 0), "D": (0.3, 0, -0.4)},
        members=(
            Member("left", ("A", "B"), "s", "steel", 4),
            Member("right", ("B", "C"), "s", "steel", 4),
            Member("leg", ("D", "B"), "s", "steel", 4),
        ),
        lumps=(Lump("D", 0.3, (0.0, 0.02, 0.0)),),
        sensors=(("A", "yz"), (("right", 0.5), "yz"), ("C", "yz"), ("D", "xy")),
        changes=(Change("more", (Lump("A", 0.5),), (Spring(("right", 0.5), "y", 3e5),)),),
        used=3,
        held_out=2,
        size=(0.06, 0.05),
        guess=180.0,
        graded=False,
    )


def leaning_tee() -> Structure:
    """A T of which no stretch leaves the sections alone: its members are of other materials."""
    lean = np.array([[1.0, 0.0, 0.2], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    return replace(tee(), warp=lambda points: lean @ points)


@cache
def small(leans: bool) -> tuple[Structure, KnownSolid]:
    structure = leaning_tee() if leans else tee()
    return structure, solid_of(structure)


@cache
def builtin(name: str) -> Case:
    return femubench.cases[f"suite/{name}"]


@pytest.mark.parametrize("leans", [False, True])
def test_matrices_are_those_of_an_assembly(leans: bool) -> None:
    structure, solid = small(leans)
    assert isinstance(solid, RemadeSolid) == leans
    factors = drawn_factors(solid, 1, 3)[0]
    here, mesh = stretched(structure, solid, factors), solid.solid
    if isinstance(solid, RemadeSolid):
        assert solid.stretch.names == ("drawn", "modulus-1", "modulus-2", "density-1", "density-2")
        # The first member and all else stay.
        mesh = mesh.scaled(mesh.of_part("right"), factors[1], factors[3])
        mesh = mesh.scaled(mesh.of_part("leg"), factors[2], factors[4])
    known, found = assembled(here, mesh), solid.matrices(factors)
    np.testing.assert_allclose(found.nodes, known.nodes, rtol=0, atol=1e-12)
    for one, other in ((found.stiffness, known.stiffness), (found.mass, known.mass)):
        assert abs(one - other).max() < 1e-12 * abs(other).max()
    shapes = np.random.default_rng(0).standard_normal((3 * solid.nodes.shape[1], 4))
    terms = solid.projected(shapes)
    for matrix, parts in zip((known.stiffness, known.mass), terms, strict=True):
        total = sum(np.prod(factors ** np.array(p)) * part for p, part in parts.items())
        np.testing.assert_allclose(total, shapes.T @ (matrix @ shapes), rtol=1e-9)
    weight = sum(np.prod(factors ** np.array(p)) * kg for p, kg in solid.masses().items())
    assert weight == pytest.approx(known.total_mass, rel=1e-12)


@pytest.mark.parametrize("leans", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_a_file_gives_the_modes_of_solids_in_full(leans: bool) -> None:
    structure, solid = small(leans)
    solved = held_out(structure, solid, HELD_OUT_SEED, (None, *structure.changes))
    taken = [snapshots(structure, solid, f) for f in drawn_factors(solid, 4 if leans else 12)]
    shapes = basis_of(structure, solid, np.hstack(taken), 75)
    error, alike = distance(solved, ReducedSolid(file_of(structure, solid, shapes)), 5)
    assert error < 5e-4
    assert alike > 0.999
    # With far fewer shapes it is off, so that the figures above say something.
    rough = ReducedSolid(file_of(structure, solid, basis_of(structure, solid, taken[0], 6)))
    assert distance(solved, rough, 5)[0] > 0.01


@pytest.mark.parametrize("leans", [False, True])
def test_a_seat_moves_as_its_nodes_do(leans: bool) -> None:
    structure, solid = small(leans)
    factors = drawn_factors(solid, 1, 5)[0]
    shapes = np.random.default_rng(1).standard_normal((3 * solid.nodes.shape[1], 3))
    arrays = file_of(structure, solid, shapes)
    here, matrices = stretched(structure, solid, factors), solid.matrices(factors)
    for number, place in enumerate(("A", ("right", 0.5), "C", "D")):
        known = rigid_fit(here, matrices, place) @ shapes
        found = ReducedSolid(arrays)._seat(factors, number)
        np.testing.assert_allclose(found, known, atol=2e-6 * np.abs(known).max())


def test_what_cannot_be_stretched_is_said() -> None:
    with pytest.raises(ValueError, match="only straight solids of bricks"):
        stretch_of(leaning_tee())


def test_there_are_files_and_they_stay_small() -> None:
    assert len(FILES) >= 2
    assert sum(file.stat().st_size for file in FILES) <= LARGEST
    for arrays in (ReducedSolid.read(file).arrays for file in FILES):
        assert (float(arrays["error"]) <= 1e-3, float(arrays["alike"]) >= 0.999) == (True, True)


@pytest.mark.parametrize("name", NAMES)
def test_unstretched_a_file_gives_what_was_published(name: str) -> None:
    case, solid = builtin(name), ReducedSolid.read(SUITE / name / FILE)
    one = np.ones(len(solid.names))
    hertz = [float(v) for v in ROW.findall((SUITE / name / "README.md").read_text("utf-8"))]
    found = stretch_case(case, solid, one, None)
    # Of a large solid the coarser of its two meshes is kept.
    meshes = mesh_differences(name)
    off = np.abs(found.measurement.frequencies / hertz - 1)
    assert (off <= 1e-3 + 1.01 * meshes).all()
    structure = structures()[name]
    noise = 5 * max(structure.scatter, 1e-4) + meshes.max()
    for own, known in zip(
        *((one.measurement, *(m.measurement for m in one.modifications)) for one in (found, case)),
        strict=True,
    ):
        np.testing.assert_allclose(own.frequencies, known.frequencies, rtol=noise)
        left = (own.shapes * known.shapes).sum(axis=0) ** 2
        mac = left / ((own.shapes**2).sum(axis=0) * (known.shapes**2).sum(axis=0))
        # The scatter is a share of the largest reading, the more of a shape the fewer move with it.
        peak = np.square(known.shapes).max(axis=0) / np.square(known.shapes).mean(axis=0)
        assert (mac > 1 - 2 * peak * structure.shape_scatter**2 - 1e-3).all()
    apart = abs(found.model.stiffness - case.model.stiffness).max()
    assert apart < 1e-8 * abs(case.model.stiffness).max()
    weights = [one.measurement.total_mass for one in (found, case) if one.measurement.total_mass]
    assert len(weights) == 2 * bool(structure.weighed)
    assert all(abs(value - weights[1][0]) < 4 * std for value, std in weights)


@pytest.mark.parametrize("name", NAMES)
def test_the_drawing_is_stretched_as_the_solid(name: str, tmp_path: Path) -> None:
    """The nominal model equals the one drawn from scratch of a structure with these sizes."""
    case, solid, structure = (
        builtin(name),
        ReducedSolid.read(SUITE / name / FILE),
        structures()[name],
    )
    factors = solid.draw_factors(np.random.default_rng(8))
    found = stretch_case(case, solid, factors, None).model
    joints, members, more = dict(structure.joints), list(structure.members), {}
    if len(solid.arrays["members"]):
        for i, member in enumerate(members):
            modulus, density = solid.material(factors, member.name)
            more[member.name] = structure.materials[member.material].scaled(modulus, density)
            members[i] = replace(member, material=member.name)
    else:
        move = stretch_of(structure).map(factors)
        joints = {j: tuple(move(np.array(p)[:, None])[:, 0].tolist()) for j, p in joints.items()}
    sections = {}
    for key, section in structure.sections.items():
        sizes = solid.sizes(factors, key)
        kind = section.drawn.get("shape")
        if sizes is None:
            sections[key] = section
        elif kind == "rectangular-tube":
            sections[key] = rectangular_tube(*sizes)
        elif kind == "solid-rectangle":
            sections[key] = bar(*sizes[:2])
        else:
            s = factors[solid.names.index("section")]
            power = {"A": 2, "Iy": 4, "Iz": 4, "J": 4, "Jp": 4, "kappa": 0}
            drawn = {k: float(v) * s ** power[k] for k, v in section.drawn.items()}
            sections[key] = replace(section, drawn=drawn)
    hung = [lump.at for lump in structure.lumps] + [spring.at for spring in structure.springs]
    if any(not isinstance(at, str) for at in hung):
        pytest.skip("what hangs between joints moves along its member")
    drawn = replace(
        structure,
        joints=joints,
        sections=sections,
        changes=(),
        members=tuple(members),
        materials={**structure.materials, **more},
    )
    (tmp_path / "case.toml").write_text(case_text(drawn, 1.0))
    (tmp_path / "sensors.csv").write_text(sensors_csv(drawn))
    count, sensors = structure.used + structure.held_out, len(case.measurement.sensors)
    modes = record(drawn, np.arange(1.0, count + 1), np.ones((count, sensors)), np.zeros(count), 1)
    (tmp_path / "modes.csv").write_text(modes_csv(drawn, modes))
    known = read_case(tmp_path).model
    for one, other in ((found.stiffness, known.stiffness), (found.mass, known.mass)):
        assert abs(one - other).max() < 1e-7 * abs(other).max()


@pytest.mark.nightly
def test_twins_have_ratios_of_their_own() -> None:
    case = builtin(NAMES[0])
    twins = [twin_of(case, 1, seed) for seed in range(4)]
    assert all(twin.families == ("stretched", "similar") for twin in twins)
    ratios = np.array([t.measurement.frequencies / t.measurement.frequencies[0] for t in twins])
    own = case.measurement.frequencies / case.measurement.frequencies[0]
    assert np.abs(ratios / own - 1).max(axis=1).min() > 0.02
    assert np.std(ratios, axis=0)[1:].max() > 0.02
    again = twin_of(case, 1, 2)
    assert again.digest == twins[2].digest
    assert (again.measurement.frequencies == twins[2].measurement.frequencies).all()
    assert len({twin.digest for twin in twins}) == 4


def test_the_digest_of_a_twin_follows_from_the_file(tmp_path: Path) -> None:
    case = builtin(NAMES[0])
    (tmp_path / FILE).write_bytes((case.folder / FILE).read_bytes())
    same = twin_of(replace(case, folder=tmp_path), 1, 9)
    assert same.digest == twin_of(case, 1, 9).digest
    arrays = dict(ReducedSolid.read(tmp_path / FILE).arrays)
    np.savez(tmp_path / FILE, **{**arrays, "scatter": 0.0035})
    assert twin_of(replace(case, folder=tmp_path), 1, 9).digest != same.digest
    (tmp_path / FILE).unlink()
    assert twin_of(replace(case, folder=tmp_path), 1, 9).families == ("similar",)


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04" + bytes(50)])
def test_a_damaged_file_is_one_line(content: bytes, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(InputError, match=FILE):
        twin_of(replace(builtin(NAMES[0]), folder=tmp_path), 1, 9)
    np.savez(tmp_path / FILE, names=np.array(["a"]))
    with pytest.raises(InputError, match="stretched solid"):
        twin_of(replace(builtin(NAMES[0]), folder=tmp_path), 1, 9)


def test_a_case_without_a_file_has_none_of_them() -> None:
    with pytest.raises(NotApplicable, match="no stretched solid"):
        draw_stretched_case(toys.tiny_case(), np.random.default_rng(0))


def gain(families: Mapping[str, TruthFamily]) -> dict[str, TwinGain]:
    """What twins of some families say of who knows ratios by heart, and of who does nothing."""
    case = builtin("stiffened-strip")
    twins = list(twins_of([case], 2, 13, families))
    truth = stretch_case(case, ReducedSolid.read(case.folder / FILE), np.ones(4), None)
    able = [toys.Unchanged(), Ratios(tuple(truth.measurement.frequencies))]
    starts = Starts(companions=choose_companions([case], twins, 2, 13))
    return twin_gains(run_jobs([case], able, jobs=1, starts=starts))


def test_who_knows_ratios_by_heart_gains_nothing_on_stretched_twins() -> None:
    similar, stretched_too = gain({"similar": FAMILIES["similar"]}), gain(FAMILIES)
    # It knows the frequencies and not how a change moves them.
    assert similar["ratios"].original_gain > 0.4
    assert similar["ratios"].gain == pytest.approx(similar["ratios"].original_gain, abs=1e-3)
    assert not similar["ratios"].suspicious
    assert stretched_too["ratios"].gain < 0.1 * stretched_too["ratios"].original_gain
    assert not stretched_too["unchanged"].suspicious


def test_strategies_that_reckon_are_not_marked() -> None:
    names = ["local", "eigensensitivity"]
    run = femubench.rank("suite/bracket", names, twins=(2, 21), nominal="textbook", jobs=1)
    found = twin_gains(run)
    assert sorted(found) == sorted(names)
    assert {kind for kinds in run.meta["twins"]["kinds"].values() for kind in kinds} == {
        *("stretched", "similar")
    }
    assert not any(item.suspicious for item in found.values())


def test_the_command_tells_the_kinds(tmp_path: Path) -> None:
    words = ["run", "suite/bracket", "frame-solid", "-s", "unchanged", "--twins", "1:77", "-j", "1"]
    answer = call_bench(*words, "--store", tmp_path / "s")
    text = " ".join(answer.output.split())
    assert "2 twins (seed 77; 1 " in text
    assert "2 twins (1 stretched) of 2 cases, seed 77" in text
