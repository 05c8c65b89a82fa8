"""Shells of an input file as the solids that CalculiX makes of them."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Collection, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from test_solid_decks import read

import femubench
from femubench import InputError, Model, fem
from femubench.core.fit.mesh_error import mesh_bias
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.core.modal.rigid import rigid_body_vectors
from femubench.fem import FloatArray
from femubench.plugins.readers.shells import SHELLS

CCX = shutil.which("ccx")
STEEL = "*MATERIAL, NAME=steel\n*ELASTIC\n2.1e11, 0.3\n*DENSITY\n7850.\n"
# Of an angle of two flats, 0.4 x 0.3 x 0.004 m each, free: CalculiX 2.20.
ANGLE = {
    "S8R": (26.49753, 57.06054, 74.11680),
    "S8": (26.99527, 57.38666),
    "S6": (26.80820, 57.97321),
    "S3": (128.9360, 353.7730),
    "S4": (26.40725, 60.88990),
}


def sheet(
    path: FloatArray, depth: float = 0.3, across: int = 3
) -> tuple[FloatArray, list[list[int]]]:
    """Return places and four-cornered cells of a strip along a path in x and z, (m, 2)."""
    y = np.linspace(0.0, depth, across + 1)
    places = np.array([(x, b, z) for b in y for x, z in path])
    n = len(path)
    rows = [j * n + i for j in range(across) for i in range(n - 1)]
    return places, [[r, r + 1, r + n + 1, r + n] for r in rows]


def angle(turn: float, along: int = 4) -> FloatArray:
    """Return the path of two flats of 0.4 m that meet at an angle in rad."""
    s = np.linspace(0.0, 0.4, along + 1)
    first = np.column_stack([s, 0.0 * s])
    return np.vstack([first, first[-1] + s[1:, None] * [np.cos(turn), np.sin(turn)]])


FLAT = np.column_stack([np.linspace(0.0, 0.5, 5), np.zeros(5)])
ARC = 0.2 * np.column_stack([f(np.linspace(0.0, 0.8 * np.pi, 7)) for f in (np.cos, np.sin)])


def shell_deck(
    kind: str,
    path: FloatArray,
    held: Collection[int] = (),
    thickness: Sequence[float] = (0.004, 0.004),
    mass: float = 0.0,
    across: int = 3,
) -> str:
    """Return a deck of a strip, whose second half may be thicker, held at its first edge."""
    places, cells = sheet(path, across=across)
    half = len(path) // 2
    parts = [0 if cell[0] % len(path) < half else 1 for cell in cells]
    if SHELLS[kind].corners == 3:
        parts = [part for part in parts for _ in range(2)]
        cells = [own for a, b, c, d in cells for own in ([a, b, c], [a, c, d])]
    amid: dict[tuple[int, ...], int] = {}
    if SHELLS[kind].edges:
        for own in cells:
            pairs = [tuple(sorted(pair)) for pair in pairwise([*own, own[0]])]
            own += [amid.setdefault(pair, len(places) + len(amid)) for pair in pairs]
        places = np.vstack([places, *(places[list(pair)].mean(axis=0) for pair in amid)])
    lines = [
        "*NODE",
        *(f"{i + 1},{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(places.tolist())),
    ]
    for part, name in enumerate(("near", "far")):
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
        here = [(e, cell) for e, cell in enumerate(cells) if parts[e] == part]
        lines += [f"{e + 1},{','.join(str(n + 1) for n in cell)}" for e, cell in here]
    for name, t in zip(("near", "far"), thickness, strict=True):
        lines += [f"*SHELL SECTION, ELSET={name}, MATERIAL=steel", repr(t)]
    if mass:
        lines += [f"*ELEMENT, TYPE=MASS, ELSET=tip\n{len(cells) + 1}, 8\n*MASS, ELSET=tip\n{mass}"]
    if held:
        edge = [i + 1 for i, (x, _, z) in enumerate(places) if np.allclose((x, z), path[0])]
        lines += ["*BOUNDARY", *(f"{n}, {d}" for n in edge for d in held)]
    return "\n".join([STEEL, *lines, ""])


def solve_with_calculix(folder: Path, count: int) -> FloatArray:
    """Return the first natural frequencies (Hz) of job.inp by CalculiX."""
    deck = folder / "job.inp"
    deck.write_text(f"{deck.read_text()}*STEP\n*FREQUENCY\n{count}\n*END STEP\n")
    subprocess.run([str(CCX), "job"], cwd=folder, capture_output=True, check=False)
    lines = (folder / "job.dat").read_text().split("P A R T I C I P A T I O N")[0].splitlines()
    rows = [line.split() for line in lines if re.match(r"\s+\d+\s+\S+E\S+\s+\S+E\S+\s+\S+E", line)]
    return np.array([float(row[3]) for row in rows])


@pytest.mark.skipif(CCX is None, reason="CalculiX is not there")
@pytest.mark.parametrize("kind", SHELLS)
@pytest.mark.parametrize(
    ("path", "held", "thickness", "mass"),
    [
        (FLAT, (1, 2, 3), (0.004, 0.004), 0.0),
        (FLAT, (1, 2, 3, 4, 5, 6), (0.004, 0.006), 0.3),
        (angle(0.9), (2, 4, 5), (0.004, 0.006), 0.2),
        (angle(0.3), (), (0.004, 0.004), 0.0),
        (angle(0.5 * np.pi), (1, 2, 3, 4, 5, 6), (0.004, 0.004), 0.3),
        (ARC, (1, 2, 3, 5), (0.004, 0.004), 0.0),
    ],
    ids=["hinged", "clamped-step", "oblique-knot", "bend", "clamped-knot", "arc"],
)
def test_frequencies_are_those_of_calculix(
    kind: str,
    path: FloatArray,
    held: Collection[int],
    thickness: Sequence[float],
    mass: float,
    tmp_path: Path,
) -> None:
    """To the digits that it prints; of `S4` it keeps the inertia of modes inside elements."""
    model = read(tmp_path, shell_deck(kind, path, held, thickness, mass))
    theirs = solve_with_calculix(tmp_path, 14)
    own = solve_modes(model, count=14).natural_frequencies[: len(theirs)]
    elastic = theirs > 1.0
    off = abs(own[elastic] / theirs[elastic] - 1.0)
    assert elastic.sum() >= 8
    assert off[:4].max() < (1e-3 if kind == "S4" else 1e-6)
    assert off.max() < (0.05 if kind == "S4" else 1e-6)


@pytest.mark.parametrize("kind", SHELLS)
def test_an_angle_hangs_free_and_has_its_mass(kind: str, tmp_path: Path) -> None:
    """Six motions without strain, also of the knots, by the labels of the rows."""
    model = read(tmp_path, shell_deck(kind, angle(0.5 * np.pi)))
    rigid = rigid_body_vectors(model.dofs)
    strain = abs(model.stiffness @ rigid).max() / abs(model.stiffness).max()
    assert strain < 1e-9
    mass = rigid[:, 0] @ (model.mass @ rigid[:, 0])
    assert mass == pytest.approx(7850.0 * 0.8 * 0.3 * 0.004, rel=1e-9)
    found = elastic_modes(model, 3).natural_frequencies
    expected = ANGLE[kind]
    np.testing.assert_allclose(
        found[: len(expected)], expected, rtol=1e-4 if kind == "S4" else 1e-6
    )


def test_a_plate_on_hinges_has_the_frequencies_of_kirchhoff(tmp_path: Path) -> None:
    """Leissa (1969), equation 4.20: f = pi / 2 (1 / a^2 + 1 / b^2) sqrt(D / rho h)."""
    deck = shell_deck("S8R", np.column_stack([np.linspace(0.0, 0.5, 11), np.zeros(11)]), across=6)
    rows = [
        line.split(",") for line in deck.partition("*ELEMENT")[0].splitlines() if line[:1].isdigit()
    ]
    edge = [
        row[0]
        for row in rows[2:]
        if min(abs(float(row[1]) - x) for x in (0.0, 0.5)) < 1e-9
        or min(abs(float(row[2]) - y) for y in (0.0, 0.3)) < 1e-9
    ]
    held = "".join(f"{node}, 1, 3\n" for node in edge)
    model = read(tmp_path, f"{deck}*BOUNDARY\n{held}")
    bending = 2.1e11 * 0.004**3 / 12.0 / 0.91
    scale = 0.5 * np.pi * np.sqrt(bending / (7850.0 * 0.004))
    exact = sorted(
        scale * ((m / 0.5) ** 2 + (n / 0.3) ** 2) for m in range(1, 4) for n in range(1, 3)
    )
    found = elastic_modes(model, 3).natural_frequencies[:3]
    np.testing.assert_allclose(found, exact[:3], rtol=0.01)


def test_the_mesh_of_linear_shells_knows_by_how_much_it_is_off(tmp_path: Path) -> None:
    model = read(tmp_path, shell_deck("S4", angle(0.5 * np.pi, 6), across=4))
    fine = read(tmp_path, shell_deck("S8R", angle(0.5 * np.pi, 16), across=12))
    coarse, true = (elastic_modes(m, 5).natural_frequencies for m in (model, fine))
    bias = mesh_bias(model, 5)
    assert bias is not None
    off, left = (np.abs(f / true - 1.0).max() for f in (coarse, coarse * (1.0 + bias)))
    assert off > 0.05
    assert left < 0.3 * off


def test_a_part_of_a_plate_is_updated_and_written_as_a_deck(tmp_path: Path) -> None:
    text = shell_deck("S8R", FLAT, thickness=(0.004, 0.006))
    model = read(tmp_path, text)
    assert set(model.groups) == {"near", "far"}
    updated = fem.Groups(model).with_factors([fem.Property("far", "E", ("group:far",))], [0.7])
    (tmp_path / "new").mkdir()
    femubench.write_model(updated, tmp_path / "new", like=tmp_path / "job.inp")
    again = femubench.read_model(tmp_path / "new" / "job.inp")
    assert abs(again.stiffness - updated.stiffness).max() < 1e-12 * updated.stiffness.max()
    assert abs(again.mass - updated.mass).max() < 1e-12 * updated.mass.max()
    assert (
        "*SHELL SECTION, ELSET=far, MATERIAL=far\n0.006" in (tmp_path / "new/job.inp").read_text()
    )


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("ELSET=far, MATERIAL=steel\n0.004", "ELSET=far, MATERIAL=steel\n0.0", "no thickness"),
        ("ELSET=far, MATERIAL=steel\n0.004", "ELSET=far, MATERIAL=steel\nthin", "1 numbers"),
        ("*SHELL SECTION, ELSET=far", "*SHELL SECTION, OFFSET=0.5, ELSET=far", "with OFFSET"),
        ("*SHELL SECTION, ELSET=far", "*SOLID SECTION, ELSET=far", "no thickness"),
        ("2,0.125,0.0,0.0", "2,0.0,0.0,0.0", "element [12] has no area"),
    ],
)
def test_what_is_no_shell_is_refused_with_the_reason(
    old: str, new: str, match: str, tmp_path: Path
) -> None:
    text = shell_deck("S4", FLAT)
    assert text.count(old) == 1
    with pytest.raises(InputError, match=match):
        read(tmp_path, text.replace(old, new))


def test_solids_stand_on_shells(tmp_path: Path) -> None:
    """A brick that shares the nodes of a plate follows its middle; the body still hangs free."""
    brick = "*NODE\n101,0,0,.1\n102,.125,0,.1\n103,.125,.1,.1\n104,0,.1,.1\n"
    cells = "*ELEMENT, TYPE=C3D8, ELSET=block\n99,1,2,7,6,101,102,103,104\n"
    text = f"{shell_deck('S4', FLAT)}{brick}{cells}*SOLID SECTION, ELSET=block, MATERIAL=steel\n"
    model: Model = read(tmp_path, text)
    assert set(model.groups) == {"near", "far", "block"}
    rigid = rigid_body_vectors(model.dofs)
    assert abs(model.stiffness @ rigid).max() < 1e-9 * abs(model.stiffness).max()
    weight = 7850.0 * (0.5 * 0.3 * 0.004 + 0.125 * 0.1 * 0.1)
    assert rigid[:, 2] @ (model.mass @ rigid[:, 2]) == pytest.approx(weight, rel=1e-9)


@pytest.mark.parametrize("kind", ["S6", "S8R"])
def test_shells_with_nodes_amid_their_edges_are_cut_in_four(kind: str, tmp_path: Path) -> None:
    """A bend that hangs free and one that is clamped: half of the error of the mesh is left."""
    for held in ((), (1, 2, 3, 4, 5, 6)):
        model = read(tmp_path, shell_deck(kind, angle(0.5 * np.pi, 3), held, across=2))
        fine = read(tmp_path, shell_deck(kind, angle(0.5 * np.pi, 12), held, across=8))
        assert model.finer is not None
        whole, better = model.finer()
        rows = slice(whole.size)
        np.testing.assert_allclose(better.dofs.xyz[rows], whole.dofs.xyz, atol=1e-4)
        mass, more = (float(r @ (m.mass @ r)) for m in (whole, better) for r in [uniform(m)])
        assert more == pytest.approx(mass, rel=0.2 if held else 1e-9)
        coarse, true = (elastic_modes(m, 5).natural_frequencies[:5] for m in (model, fine))
        bias = mesh_bias(model, 5)
        assert bias is not None
        off, left = (np.abs(f / true - 1.0).max() for f in (coarse, coarse * (1.0 + bias)))
        assert left < 0.5 * off


def uniform(model: Model) -> FloatArray:
    """Return the translation along x."""
    return np.asarray(model.dofs.motions[:, 0])
