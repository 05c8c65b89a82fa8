"""Plates and solids of Nastran bulk data, against decks of CalculiX, rigid bodies and formulas."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from test_chain import (
    FLATS,
    SHEETS,
    diagnose_files,
    write_deck,
    write_responses,
    write_shells,
)
from test_shells import FLAT, angle, shell_deck
from test_solid_decks import read, rows_of

import femubench
from femubench import InputError, Model, fem
from femubench.core.modal.frequency_changes import elastic_modes
from femubench.fem import FloatArray, SparseArray
from femubench.modal import GroupPriors
from femubench.plugins.readers.bulk_data import BulkDataReader
from femubench.plugins.readers.deck_file import SolidDeck, read_deck
from femubench.plugins.readers.nodes import read_nodes
from femubench.plugins.readers.solid_elements import KINDS

READER = BulkDataReader()
# By kind: the card, and the corners at the ends of the edges as the Quick Reference Guide has them.
SQUARE, TRIANGLE = ((1, 2), (2, 3), (3, 4), (4, 1)), ((1, 2), (2, 3), (3, 1))
CARDS: dict[str, tuple[str, tuple[tuple[int, int], ...]]] = {
    "S3": ("CTRIA3", ()),
    "S4": ("CQUAD4", ()),
    "S6": ("CTRIA6", TRIANGLE),
    "S8R": ("CQUAD8", SQUARE),
    "C3D4": ("CTETRA", ()),
    "C3D6": ("CPENTA", ()),
    "C3D8I": ("CHEXA", ()),
    "C3D10": ("CTETRA", (*TRIANGLE, (1, 4), (2, 4), (3, 4))),
    "C3D15": ("CPENTA", (*TRIANGLE, (1, 4), (2, 5), (3, 6), (4, 5), (5, 6), (6, 4))),
    "C3D20R": ("CHEXA", (*SQUARE, (1, 5), (2, 6), (3, 7), (4, 8), (5, 6), (6, 7), (7, 8), (8, 5))),
}
SHELLS = [kind for kind in CARDS if kind.startswith("S")]
SOLIDS = [kind for kind in CARDS if kind not in SHELLS]


def card(name: str, *fields: object) -> str:
    """Return a card in free fields, blanks for empty texts."""
    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
    return "".join(
        f"{'' if i else name},{','.join(f'{f}' for f in row)}\n" for i, row in enumerate(rows)
    )


def cards(deck: SolidDeck, places: dict[str, tuple[float, float, float]]) -> str:
    """Return the cards of a deck: property 1, 2, ... a section, all of material 1."""
    text = "".join(card("GRID", n, "", *xyz) for n, xyz in places.items())
    modulus, poisson, density = next(iter(deck.materials.values()))
    text += card("MAT1", 1, modulus, "", poisson, density)
    for pid, (name, (_, thickness)) in enumerate(deck.sections.items(), 1):
        shell = np.isfinite(thickness)
        text += card("PSHELL", pid, 1, thickness, 1, "", 1) if shell else card("PSOLID", pid, 1)
        for number in deck.sets[name]:
            kind, nodes = deck.elements[number]
            label, edges = CARDS[kind]
            at = {n: np.array(places[str(n)]) for n in nodes}
            corners = nodes[: len(nodes) - len(edges)]
            middles = [0.5 * (at[corners[a - 1]] + at[corners[b - 1]]) for a, b in edges]
            rest = nodes[len(corners) :]
            amid = [min(rest, key=lambda n: np.linalg.norm(at[n] - m)) for m in middles]
            text += card(label, number, pid, *corners, *amid)
    for name, mass in deck.masses.items():
        for number in deck.sets[name]:
            text += card("CONM2", number, deck.elements[number][1][0], "", mass)
    return text + "".join(card("SPC1", 1, d + 1, n) for n, d in sorted(deck.held))


def converted(folder: Path, text: str) -> str:
    """Return the cards of an input file of CalculiX, which becomes job.inp."""
    (folder / "job.inp").write_text(text)
    return cards(read_deck(folder / "job.inp"), dict(read_nodes(folder / "job.inp")))


def bulk(folder: Path, text: str) -> Model:
    """Return the model of cards."""
    (folder / "model.bdf").write_text(text)
    return femubench.read_model(folder / "model.bdf")


def hertz(model: Model, count: int = 8) -> FloatArray:
    return np.asarray(elastic_modes(model, count).natural_frequencies)


@pytest.mark.parametrize("kind", SHELLS)
@pytest.mark.parametrize("held", [(), (1, 2, 3, 4, 5, 6)], ids=["free", "clamped"])
def test_a_bend_has_the_frequencies_of_its_deck(
    kind: str, held: Collection[int], tmp_path: Path
) -> None:
    text = shell_deck(kind, angle(0.9), held, (0.004, 0.006), 0.2)
    theirs, own = read(tmp_path, text), bulk(tmp_path, converted(tmp_path, text))
    np.testing.assert_allclose(hertz(own), hertz(theirs), rtol=1e-9)
    assert list(own.groups) == ["PSHELL 1", "PSHELL 2"]


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_solid_element_has_the_matrices_of_its_deck(kind: str, tmp_path: Path) -> None:
    """One element, askew, so that a wrong order of nodes has others or no volume."""
    places = KINDS[kind].places @ np.array([[0.3, 0.02, 0.05], [0.0, 0.2, 0.03], [0.04, 0.0, 0.1]])
    rows = [f"{i},{x!r},{y!r},{z!r}" for i, (x, y, z) in enumerate(places.tolist(), 1)]
    count = list(map(str, range(1, len(places) + 1)))
    element = ",\n".join(", ".join(["1", *count][i : i + 11]) for i in range(0, len(count) + 1, 11))
    text = "\n".join(
        ["*NODE", *rows, f"*ELEMENT, TYPE={kind}, ELSET=all", element, "*MATERIAL, NAME=steel",
         "*ELASTIC", "2.1e11, 0.3", "*DENSITY", "7850.",
         "*SOLID SECTION, ELSET=all, MATERIAL=steel", ""]
    )  # fmt: skip
    theirs, own = read(tmp_path, text), bulk(tmp_path, converted(tmp_path, text))
    for name in ("mass", "stiffness"):
        whole = []
        for model in (theirs, own):
            order = sorted(range(model.size), key=rows_of(model).__getitem__)
            whole.append(getattr(model, name).toarray()[np.ix_(order, order)])
        np.testing.assert_allclose(whole[1], whole[0], rtol=0.0, atol=1e-9 * abs(whole[0]).max())


def solid_block() -> str:
    """Return the cards of one brick of eight grids."""
    places = KINDS["C3D8I"].places @ np.diag([0.4, 0.3, 0.1])
    text = "".join(card("GRID", n, "", *xyz) for n, xyz in enumerate(places, 1))
    text += card("MAT1", 1, 2.1e11, "", 0.3, 7850.0) + card("PSOLID", 1, 1)
    return text + card("CHEXA", 1, 1, *range(1, 9))


def moved(at: Sequence[float] | FloatArray) -> FloatArray:
    """Return the motion at a place from that of a rigid body at the origin, (6, 6)."""
    x, y, z = at
    found = np.eye(6)
    found[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return found


def of_body(model: Model, matrix: SparseArray) -> FloatArray:
    """Return a matrix for the motions of a body about the origin, (6, 6)."""
    motions = zip(model.dofs.xyz, model.dofs.motions, strict=True)
    rigid = np.array([axes @ moved(xyz) for xyz, axes in motions])
    return np.asarray(rigid.T @ matrix @ rigid)


K = np.array([3e5, 5e5, 7e5, 40.0, 60.0, 90.0])


@pytest.mark.parametrize("kind", [*SHELLS, "C3D8I"])
def test_springs_resist_the_motions_of_a_body(kind: str, tmp_path: Path) -> None:
    """At a flat node without what turns about its normal, at a knot all, at a solid no turn."""
    shell = kind in SHELLS
    if shell:
        text = converted(tmp_path, shell_deck(kind, angle(0.5 * np.pi)))
        flat, knot = 11, 14  # 0.1 and 0.4 along the first flat
    else:
        text, flat, knot = solid_block(), 1, 7
    feet = card("PBUSH", 7, "K", *K)
    feet += card("CBUSH", 901, 7, flat, "", "", "", "", 0)
    feet += card("CBUSH", 902, 7, knot, "", "", "", "", 0)
    free, own = bulk(tmp_path, text), bulk(tmp_path, text + feet)
    places = READER.read_nodes(tmp_path / "model.bdf")
    kept = [np.ones(6), np.ones(6)]
    kept[0][3 if not shell else 5 :] = 0.0
    if not shell:
        kept[1][3:] = 0.0
    motions = [moved(places[str(n)]) for n in (flat, knot)]
    each = [m.T @ np.diag(K * k) @ m for m, k in zip(motions, kept, strict=True)]
    expected = np.sum(each, axis=0)
    found = of_body(own, own.groups["PBUSH 7"])
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * expected.max())
    assert abs(own.stiffness - own.groups["PBUSH 7"] - free.stiffness).max() < 1e-3
    assert "PBUSH 7" in GroupPriors(own).supports


PLATE = "".join(
    [
        *(
            card("GRID", n, "", x, y, 0.0)
            for n, x, y in ((1, 0, 0), (2, 1, 0), (3, 1, 1), (4, 0, 1))
        ),
        card("CQUAD4", 1, 1, 1, 2, 3, 4),
        card("PSHELL", 1, 1, 0.01, 1, "", 1),
        card("MAT1", 1, 2.1e11, "", 0.3, 7800.0),
    ]
)
HELD = PLATE + card("SPC1", 1, 123456, 1, 2, 3, 4)
BODY = card("GRID", 50, "", 2.0, 0.0, 0.0) + card(
    "CONM2", 60, 50, "", 2.0, "", "", "", "", 0.3, "", 0.4, "", "", 0.5
)


def stiffness_at(model: Model, node: str) -> FloatArray:
    """Return the stiffness of a grid without elements, (6, 6)."""
    at = [rows_of(model).index((node, d)) for d in ("x", "y", "z", "rx", "ry", "rz")]
    return np.asarray(model.stiffness.toarray()[np.ix_(at, at)])


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_a_spring_between_grids_apart_acts_where_it_is(share: float, tmp_path: Path) -> None:
    """Arms by hand: at 2 m along x from a held grid, the spring between at a share of the line."""
    text = HELD + BODY + card("GRID", 51, "", 0.0, 0.0, 0.0) + card("SPC1", 1, 123456, 51)
    text += card("PBUSH", 7, "K", *K)
    text += card("CBUSH", 70, 7, 51, 50, 0.0, 1.0, 0.0, "", share)
    arm = -2.0 * (1.0 - share)
    found = stiffness_at(bulk(tmp_path, text), "50")
    expected = np.diag(K)
    expected[1, 5] = expected[5, 1] = K[1] * arm
    expected[2, 4] = expected[4, 2] = -K[2] * arm
    expected[5, 5] += K[1] * arm**2
    expected[4, 4] += K[2] * arm**2
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * expected.max())


def test_axes_of_a_spring_are_those_of_its_system_or_its_line(tmp_path: Path) -> None:
    """Along y of a line along y; the vector along z makes that its second axis."""
    text = HELD + BODY.replace("2.0,0.0,0.0", "0.0,2.0,0.0") + card("PBUSH", 7, "K", *K)
    text += card("GRID", 51, "", 0.0, 0.0, 0.0) + card("SPC1", 1, 123456, 51)
    by_line = text + card("CBUSH", 70, 7, 51, 50, 0.0, 0.0, 1.0, "", 1.0)
    system = card("CORD2R", 9, 0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    by_system = text + card("CBUSH", 70, 7, 51, 50, "", "", "", 9, 1.0) + system
    for way in (by_line, by_system):
        found = stiffness_at(bulk(tmp_path, way), "50")
        np.testing.assert_allclose(found, np.diag(K[[2, 0, 1, 5, 3, 4]]), rtol=0.0, atol=1e-6)


def test_scalar_springs_join_components_of_grids(tmp_path: Path) -> None:
    text = HELD + BODY + card("GRID", 51, "", 5.0, 5.0, 5.0) + card("SPC1", 1, 123456, 51)
    text += card("CELAS2", 70, 3e4, 50, 1) + card("CELAS1", 71, 8, 50, 2, 51, 3)
    text += card("PELAS", 8, 5e4) + card("PBUSH", 7, "K", *K) + card("CBUSH", 72, 7, 50)
    model = bulk(tmp_path, text)
    found = stiffness_at(model, "50")
    np.testing.assert_allclose(found, np.diag(K + np.array([3e4, 5e4, 0, 0, 0, 0])), rtol=1e-12)
    assert list(model.groups) == ["PSHELL 1", "CELAS2 70", "PELAS 8", "PBUSH 7"]


@pytest.mark.parametrize("leader", ["", "RBE2"])
def test_masses_are_of_plates_their_nonstructural_part_and_bodies(
    leader: str, tmp_path: Path
) -> None:
    """A body at an arm of a knot, or of a grid next to the plate that an RBE2 hangs on four."""
    text = converted(tmp_path, shell_deck("S4", angle(0.5 * np.pi)))
    text = text.replace("PSHELL,1,1,0.004,1,,1", "PSHELL,1,1,0.004,1,,1,,11.0")
    place, node = (0.4, 0.1, 0.0), 14
    if leader:
        place, node = (0.2, 0.1, 0.5), 950
        text += card("GRID", 950, "", *place) + card("RBE2", 940, 950, 123456, 11, 12, 15, 21)
    heavy = text + card("CONM2", 900, node, "", 2.0, 0.1, 0.2, 0.3, "", 0.3, "", 0.4, "", "", 0.5)
    without, whole = (of_body(m, m.mass) for m in (bulk(tmp_path, t) for t in (text, heavy)))
    plates = (2.0 * 7850.0 * 0.004 + 11.0) * 0.4 * 0.3
    np.testing.assert_allclose(np.diag(without)[:3], plates, rtol=1e-9)
    at = moved(np.add(place, (0.1, 0.2, 0.3)))
    body = at.T @ np.diag([2.0, 2.0, 2.0, 0.3, 0.4, 0.5]) @ at
    np.testing.assert_allclose(whole - without, body, rtol=0.0, atol=1e-9 * plates)


@pytest.mark.parametrize("kind", [*SHELLS, "C3D8I"])
def test_rigid_links_clamp_what_follows_a_held_grid(kind: str, tmp_path: Path) -> None:
    """Also where the follower is in the middle of a sheet or at a bend."""
    shell = kind in SHELLS
    text = solid_block() if not shell else converted(tmp_path, shell_deck(kind, angle(0.9)))
    nodes = (1, 4) if not shell else (1, 10, 14, 19, 28)
    grid = card("GRID", 950, "", 0.1, 0.2, 0.5) + card("SPC1", 1, 123456, 950)
    held = bulk(tmp_path, text + card("SPC1", 1, 123456 if shell else 123, *nodes))
    led = bulk(tmp_path, text + grid + card("RBE2", 940, 950, 123456, *nodes))
    assert [d for _, d in rows_of(led)] == [d for _, d in rows_of(held)]
    for one, other in ((led.stiffness, held.stiffness), (led.mass, held.mass)):
        assert abs(one - other).max() < 1e-12 * abs(other).max()


@pytest.mark.parametrize("kind", [*SHELLS, "C3D8I"])
@pytest.mark.parametrize("components", [123456, 123, 13])
def test_rigid_links_do_not_resist_a_body(kind: str, components: int, tmp_path: Path) -> None:
    """Of a grid apart and, of shells, of a node of them that leads another; the mass stays."""
    shell = kind in SHELLS
    text = solid_block() if not shell else converted(tmp_path, shell_deck(kind, angle(0.9)))
    free = bulk(tmp_path, text)
    links = card("GRID", 950, "", 0.1, 0.2, 0.5)
    links += card("RBE2", 940, 950, components, *((11, 14, 28, 1) if shell else (1, 3, 6, 8)))
    if shell:
        links += card("RBE2", 941, 10, 123456, 30) + card("RBE2", 942, 28, 123456, 36)
    led = bulk(tmp_path, text + links)
    strain = of_body(led, led.stiffness)
    assert abs(strain).max() < 1e-8 * abs(free.stiffness).max()
    np.testing.assert_allclose(of_body(led, led.mass), of_body(free, free.mass), rtol=0, atol=1e-9)
    assert hertz(led, 1)[0] > (1.01 if components == 123456 else 0.999) * hertz(free, 1)[0]


def test_a_mean_of_grids_carries_a_mass_and_stiffens_nothing(tmp_path: Path) -> None:
    """Amid four corners a quarter of each; its rotation about x is the mean of z over y."""
    grid = card("GRID", 50, "", 0.5, 0.5, 0.0)
    grid += card("RBE3", 940, "", 50, 123456, 1.0, 123, 1, 2, 3, 4)
    free, loaded = (
        bulk(tmp_path, PLATE + grid + card("CONM2", 60, 50, "", m, "", "", "", "", i, "", i))
        for m, i in ((0.0, 0.0), (8.0, 0.6))
    )
    assert abs(free.stiffness - bulk(tmp_path, PLATE).stiffness).max() == 0.0
    assert abs(free.stiffness - loaded.stiffness).max() == 0.0
    added = (loaded.mass - free.mass).toarray()
    at = [rows_of(loaded).index((n, "z")) for n in "1234"]
    turns = 0.5 * np.array([[-1.0, -1.0, 1.0, 1.0], [1.0, -1.0, -1.0, 1.0]])  # about x and y
    expected = 8.0 / 16.0 + 0.6 * turns.T @ turns
    np.testing.assert_allclose(added[np.ix_(at, at)], expected, rtol=0.0, atol=1e-12)
    stiff = PLATE + card("GRID", 50, "", 0.5, 0.5, 0.0) + card("RBE2", 940, 50, 123456, 1, 2, 3, 4)
    rigid = bulk(tmp_path, stiff + card("CONM2", 60, 50, "", 8.0, "", "", "", "", 0.6, "", 0.6))
    np.testing.assert_allclose(of_body(rigid, rigid.mass), of_body(loaded, loaded.mass), atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("CQUAD4,1,1,1,2,3,4", "CQUAD4,1,1,1,2,3", "CQUAD4 1, G: 3 grids .expected 4 grids"),
        ("CQUAD4,1,1,1,2,3,4", "CQUAD4,1,1,1,2,3,4,,0.1", "CQUAD4 1: an offset, or a thickness"),
        ("CQUAD4,1,1,1,2,3,4", "CQUAD4,1,9,1,2,3,4", "PID: there is no PSHELL 9"),
        ("PSHELL,1,1,0.01,1,,1", "PSHELL,1,1,0.01", "MID2: blank: a plate that does not bend"),
        ("PSHELL,1,1,0.01,1,,1", "PSHELL,1,1,,1,,1", "PSHELL 1, T: blank"),
        ("PSHELL,1,1,0.01,1,,1", "PSHELL,1,1,0.01,1,2.0,1", r"12I/T\*\*3: 2.0"),
        ("PSHELL,1,1,0.01,1,,1", "PSHELL,1,7,0.01,7,,7", "MID1: there is no MAT1 7"),
        ("MAT1,1,210000000000.0,,0.3", "MAT1,1,2.1+11,9.+10,.3", "MAT1 1, G: G 9e"),
        (",7800.0", "", "MAT1 1, RHO: no mass"),
        ("CQUAD4,1,1,1,2,3,4", "CQUAD4,1,1,1,3,2,4", "element 1 has no area"),
        ("", card("GRID", 50) + card("GRID", 51, "", 0, 0, 1.0) + card("PBUSH", 7, "K", *K)
         + card("CBUSH", 8, 7, 1, 50) + card("CBUSH", 9, 7, 50, 51, 1.0, 0.0, 0.0),
         "nothing resists some motion of node 5"),
        ("", card("CBAR", 9, 1, 1, 2, 0.0, 0.0, 1.0), "CBAR 9: this card is not read .expe"),
        ("PSHELL,1,1,0.01,1,,1", "PCOMP,1,,,,,,,,\n,1,.01", "PCOMP 1: this property is not read"),
        ("", card("PCOMP", 9) + card("CSHEAR", 9, 9, 1, 2, 3, 4), "CSHEAR 9: this card is not"),
        ("", card("CBUSH", 9, 9, 1), "CBUSH 9, PID: there is no PBUSH 9"),
        ("", card("CBUSH", 9, 7, 1, 2) + card("PBUSH", 7, "K", 1.0, 1.0), "CBUSH 9, X1: no vector"),
        ("", card("CBUSH", 9, 7, 1) + card("PBUSH", 7, "B", 1.0), "PBUSH 7, K: no stiffness"),
        ("", card("RBE2", 9, 1, 123456, 2) + card("RBE2", 8, 3, 1, 2), "grid 2 follows RBE2 9 alr"),
        ("", card("RBE2", 9, 1, 123, 2) + card("SPC1", 1, 3, 2), "RBE2 9, G: grid 2 is held in z"),
        ("", card("RBE2", 9, 1, 123, 2) + card("RBE2", 8, 2, 123, 1), "follows itself"),
        ("", BODY + card("RBE3", 9, "", 50, 123, 1.0, 123, 1, 2), "RBE3 9, G: the grids lie on"),
        ("", BODY + card("RBE3", 9, "", 50, 123, 1.0, 12, 1, 2, 3), "weight 1 of directions '12'"),
        ("", card("GRID", 50) + card("PBUSH", 7, "K", 1.0) + card("CBUSH", 9, 7, 50, *[""] * 4, 6)
         + card("CORD2R", 6, "", *[0.0] * 5, 1.0, 1.0, 1.0),
         "nothing resists some motion of node 50"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_in_one_line(
    old: str, new: str, match: str, tmp_path: Path
) -> None:
    text = PLATE.replace(old, new) if old else PLATE + new
    assert text != PLATE
    with pytest.raises(InputError, match=match) as error:
        bulk(tmp_path, text)
    assert "model.bdf" in str(error.value)
    assert "\n" not in str(error.value)


def test_better_elements_have_the_same_attachments(tmp_path: Path) -> None:
    """Rows begin with those of the mesh, and nodes amid edges of what follows do so too."""
    text = converted(tmp_path, shell_deck("S4", angle(0.9)))
    text += card("GRID", 950, "", 0.1, 0.2, 0.5) + card("RBE2", 940, 950, 123456, 10, 11, 19, 20)
    text += card("PBUSH", 7, "K", *K) + card("CBUSH", 901, 7, 950) + card("CBUSH", 902, 7, 36)
    model = bulk(tmp_path, text)
    assert model.finer is not None
    coarse, fine = model.finer()
    grids = READER.read_nodes(tmp_path / "model.bdf").keys()
    rows = [[(n if n in grids else "", d) for n, d in rows_of(m)] for m in (coarse, fine)]
    assert rows[1][: coarse.size] == rows[0]
    assert list(fine.groups) == list(coarse.groups) == ["PSHELL 1", "PSHELL 2", "PBUSH 7"]
    for one in (coarse, fine):
        np.testing.assert_allclose(of_body(one, one.groups["PBUSH 7"])[:3, :3], 2 * np.diag(K[:3]))
    stiff = [m.groups["PSHELL 1"].toarray()[2, 2] for m in (coarse, fine)]
    assert 0.1 * stiff[0] < stiff[1] < stiff[0]


def test_factors_of_groups_are_written_as_cards(tmp_path: Path) -> None:
    """Of plates as a material of their own, in the included file too, of springs as numbers."""
    text = converted(tmp_path, shell_deck("S8R", FLAT, thickness=(0.004, 0.006)))
    text = text.replace("PSHELL,2,1,0.006,1,,1", "PSHELL,2,1,0.006,1,,1,,5.0")
    text += card("PBUSH", 7, "K", *K) + card("CBUSH", 901, 7, 10) + card("CELAS2", 902, 5e4, 12, 3)
    text += card("PELAS", 9, 4e4) + card("CELAS1", 903, 9, 14, 1)
    (tmp_path / "springs.inc").write_text(card("PBUSH", 7, "K", *K))
    model = bulk(tmp_path, text.replace(card("PBUSH", 7, "K", *K), "INCLUDE 'springs.inc'\n"))
    factors = {"PSHELL 2": 0.7, "PBUSH 7": 1.3, "CELAS2 902": 0.25, "PELAS 9": 2.0}
    changes = [fem.Property(name, "E", (f"group:{name}",)) for name in factors]
    updated = fem.Groups(model).with_factors(changes, list(factors.values()))
    updated = replace(updated, mass=1.1 * updated.mass)
    femubench.write_model(updated, tmp_path / "new", like=tmp_path / "model.bdf")
    again = femubench.read_model(tmp_path / "new" / "model.bdf")
    assert abs(again.stiffness - updated.stiffness).max() < 1e-12 * updated.stiffness.max()
    assert abs(again.mass - updated.mass).max() < 1e-12 * updated.mass.max()
    assert "MAT1*   3" in (tmp_path / "new" / "model.bdf").read_text()
    assert "PBUSH" in (tmp_path / "new" / "springs.inc").read_text()
    other = replace(updated, stiffness=updated.stiffness + 1e6 * sp.eye_array(updated.size))
    with pytest.raises(InputError, match="no factor on properties"):
        femubench.write_model(other, tmp_path / "other", like=tmp_path / "model.bdf")
    assert not (tmp_path / "other" / "model.bdf").exists()


FEET = {  # mm, soft blocks below the corners of the base
    f"FOOT{i}": ((x - 12.5, y - 12.5, -11.5), (x + 12.5, y + 12.5, -1.5))
    for i, (x, y) in enumerate(((25.0, 25.0), (275.0, 25.0), (25.0, 175.0), (275.0, 175.0)), 1)
}
RUBBER = 32.0  # N/mm2


def feet_cards(grids: dict[str, tuple[float, float, float]]) -> str:
    """Return the cards of the feet: each a spring to ground on the mean of nine grids of a plate.

    A pad of A = 625 mm2 and h = 10 mm between flats that stop it from warping: E A / h along, in
    shear and in bending as a guided column.
    """
    text, area, height, second = "", 625.0, 10.0, 25.0**4 / 12.0
    shear = 1.0 / (height**3 / (12.0 * RUBBER * second) + height / (RUBBER / 2.0 * area))
    for i, ((x, y, _), _) in enumerate(FEET.values(), 1):
        middle = (x + 12.5, y + 12.5, -6.5)
        near = [
            n for n, at in grids.items() if np.abs(np.subtract(at, (*middle[:2], 0))).max() < 13
        ]
        assert len(near) == 9
        text += card("GRID", 9000 + i, "", *middle)
        text += card("RBE3", 9100 + i, "", 9000 + i, 123456, 1.0, 123, *near)
        bending, twist = RUBBER * second / height, RUBBER / 2.0 * 0.141 * 25.0**4 / height
        stiffness = (shear, shear, RUBBER * area / height, bending, bending, twist)
        text += card("PBUSH", 10 + i, "K", *stiffness) + card("CBUSH", 9200 + i, 10 + i, 9000 + i)
    return text


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("soft", "verdict", "places"), [(1.0, "none", []), (0.25, "named", ["group:PBUSH 12"])]
)
def test_a_soft_foot_is_found_by_shells_on_springs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, soft: float, verdict: str, places: list[str]
) -> None:
    """The truth is of bricks in another mesh, its feet are blocks; file names alone lead there."""
    monkeypatch.chdir(tmp_path)
    write_shells(Path("shells.inp"))
    grids = dict(read_nodes(Path("shells.inp")))
    text = cards(read_deck(Path("shells.inp")), grids) + feet_cards(grids)
    Path("model.bdf").write_text(text)
    moduli = {name: RUBBER * (soft if name == "FOOT2" else 1.0) for name in FEET}
    truth = write_deck(Path("truth.inp"), "C3D20R", 14.0, 1.0, SHEETS | FEET, moduli)
    write_responses(Path("test.uff"), truth, FLATS, first=0)
    assert diagnose_files("model.bdf", "test.uff") == (verdict, places)
