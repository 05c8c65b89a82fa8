"""From a solver's deck and measured responses to verdict and updated model, by the messages alone.

Every command but the first is the one that the message before ends with. Decks and responses are
made here: a bracket of solids welded together, its truth in a mesh that shares few nodes with it.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from frf_problems import write_universal

import femubench
from femubench import Model, Sensors
from femubench.core.case.nodes import with_mesh
from femubench.modal import FrequencyResponses, receptance
from femubench.plugins.readers.solid_elements import KINDS
from tests.command import call_bench

Boxes = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
BOXES: Boxes = {  # mm
    "BASE": ((0, 0, 0), (240, 120, 8)),
    "WELD": ((0, 0, 8), (8, 120, 16)),
    "UPRIGHT": ((0, 0, 16), (8, 120, 176)),
}
Point = tuple[float, float, float, str]
FACES: list[Point] = [(x, y, 8.0, "z") for x in (21, 83, 139, 232) for y in (11, 61, 108)]
FLATS: list[Point] = [
    *((x, y, 1.5, "z") for x in (20, 110, 200, 290) for y in (15, 70, 130, 185)),
    *((-1.5, y, z, "x") for y in (15, 100, 185) for z in (75, 145)),
]


SHEETS: Boxes = {  # mm, sheets of 3 mm with their corners
    "BASE": ((-1.5, 0, -1.5), (300, 200, 1.5)),
    "UPRIGHT": ((-1.5, 0, 1.5), (1.5, 200, 150)),
    "RIB": ((1.5, 98.5, 1.5), (100, 101.5, 50)),
}


def write_deck(
    file: Path,
    kind: str,
    cell: float,
    soft: float = 1.0,
    boxes: Boxes = BOXES,
    feet: Mapping[str, float] = MappingProxyType({}),
    metals: Mapping[str, tuple[str, float, str]] = MappingProxyType({}),
) -> Path:
    """Write boxes in mm, N and tonnes, the weld or the rib as stiff as stated.

    Feet are boxes of a modulus of their own, held from below; metals a name, a modulus and a
    density, of boxes that are of no steel of their own.
    """
    cuts = [sorted({end[a] for box in boxes.values() for end in box}) for a in range(3)]
    lines = [
        np.unique(np.concatenate([np.linspace(a, b, 1 + int(np.ceil((b - a) / cell)))
                                  for a, b in pairwise(axis)]))
        for axis in cuts
    ]  # fmt: skip
    nodes: dict[tuple[float, ...], int] = {}
    sets: list[str] = []
    number = 0
    for name, (low, high) in boxes.items():
        sets.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
        inside = [
            [(p, q) for p, q in pairwise(axis) if low[a] <= p and q <= high[a]]
            for a, axis in enumerate(lines)
        ]
        for spans in product(*inside):
            first, last = np.array(spans, dtype=float).T
            number += 1
            at = [first + s * (last - first) for s in KINDS[kind].places]
            ends = [tuple(map(float, place.round(9))) for place in at]
            cells = [number, *(nodes.setdefault(p, len(nodes) + 1) for p in ends)]
            rows = [cells[i : i + 11] for i in range(0, len(cells), 11)]
            sets.append(",\n".join(", ".join(map(str, row)) for row in rows))
    for name in boxes:
        modulus = feet.get(name, 210e3 * (soft if name in {"WELD", "RIB"} else 1.0))
        poisson, density = (0.0, "1e-9") if name in feet else (0.3, "7.85e-9")
        metal, modulus, density = metals.get(name, (name, modulus, density))
        if f"*MATERIAL, NAME={metal}" not in sets:
            sets += [f"*MATERIAL, NAME={metal}", "*ELASTIC", f"{modulus}, {poisson}"]
            sets += ["*DENSITY", density]
        sets += [f"*SOLID SECTION, ELSET={name}, MATERIAL={metal}"]
    places = [f"{n}, {x!r}, {y!r}, {z!r}" for (x, y, z), n in nodes.items()]
    ground = min(z for _, _, z in nodes)
    held = [f"{n}, 1, 3" for (_, _, z), n in nodes.items() if feet and z == ground]
    sets += ["*BOUNDARY", *held] if held else []
    file.write_text("\n".join(["*NODE", *places, *sets, ""]))
    return file


def write_shells(file: Path) -> Path:
    """Write the sheets as shells `S4` of 12.5 mm, in mm."""
    nodes: dict[tuple[float, ...], int] = {}
    lines, number = [], 0
    for name, along, up, a, b in (
        ("BASE", (1, 0, 0), (0, 1, 0), 300, 200),
        ("UPRIGHT", (0, 1, 0), (0, 0, 1), 200, 150),
        ("RIB", (1, 0, 0), (0, 0, 1), 100, 50),
    ):
        start = np.array([0.0, 100.0 if name == "RIB" else 0.0, 0.0])
        lines.append(f"*ELEMENT, TYPE=S4, ELSET={name}")
        for i, j in product(range(int(a / 12.5)), range(int(b / 12.5))):
            corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            places = [
                tuple((start + 12.5 * (x * np.array(along) + y * np.array(up))).tolist())
                for x, y in corners
            ]
            number += 1
            own = [number, *(nodes.setdefault(place, len(nodes) + 1) for place in places)]
            lines.append(", ".join(map(str, own)))
    lines += [f"*SHELL SECTION, ELSET={name}, MATERIAL=steel\n3.0" for name in SHEETS]
    lines += ["*MATERIAL, NAME=steel", "*ELASTIC", "210e3, 0.3", "*DENSITY", "7.85e-9", ""]
    rows = [f"{n}, {x!r}, {y!r}, {z!r}" for (x, y, z), n in nodes.items()]
    file.write_text("\n".join(["*NODE", *rows, *lines]))
    return file


def write_responses(
    file: Path, deck: Path | Model, points: Sequence[Point] = FACES, first: int = 6
) -> None:
    """Write accelerances of a deck at points, x, y, z and direction, with 1 % of noise.

    Arguments:
        deck: or the model of one.
        first: of the ten modes that the lines cover.
    """
    model = with_mesh(deck if isinstance(deck, Model) else femubench.read_model(deck, unit="mm"))
    rng = np.random.default_rng(4)
    modes = femubench.solve_modes(model, 40)
    xyz = 1e-3 * np.array([point[:3] for point in points])
    along = tuple(point[3] for point in points)
    sensors = Sensors(tuple(f"{k + 1}:{d}" for k, d in enumerate(along)), xyz, along)
    hit = [0, 1] if points is FACES else [0, 17]
    two = Sensors(tuple(sensors.labels[k] for k in hit), xyz[hit], tuple(along[k] for k in hit))
    hertz = modes.natural_frequencies
    lines = np.linspace(0.5 * hertz[first], 0.5 * (hertz[first + 9] + hertz[first + 10]), 3000)
    readings = model.observe(sensors)
    values = receptance(modes, readings, readings[hit], lines, 0.004)
    values = -np.square(2.0 * np.pi * lines)[:, None, None] * values
    size = 0.01 * np.sqrt(np.square(np.abs(values)).mean(axis=0) / 2.0)
    draws = rng.standard_normal((2, *values.shape))
    values = values + size * (draws[0] + 1j * draws[1])
    write_universal(file, FrequencyResponses(sensors, two, lines, values, "accelerance"))


def follow(text: str, **words: str) -> list[str]:
    """Return the words of the command that a message ends with."""
    (command,) = re.findall(r"^Next.*(bench .*)$", text, re.MULTILINE)
    return [words.get(word, word) for word in shlex.split(command)[1:]]


@pytest.mark.slow(20)
@pytest.mark.parametrize(
    ("weld", "verdict", "places"),
    [
        pytest.param(1.0, "none", [], marks=pytest.mark.nightly),
        (0.2, "named", ["group:WELD"]),
    ],
)
def test_the_messages_lead_from_deck_and_responses_to_an_updated_deck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, weld: float, verdict: str, places: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_deck(Path("model.inp"), "C3D20R", 20.0)
    write_responses(Path("test.uff"), write_deck(Path("truth.inp"), "C3D20R", 12.0, weld))

    def run(*words: str) -> str:
        return call_bench(*words).output

    said = run("identify", "test.uff", "--output", "identified")
    said = run(*follow(said, CASE="case", MODEL="model.inp"))
    assert "12 of the 12 sensors of sensors.csv lie between nodes" in " ".join(said.split())
    said = run(*follow(said), "--json", "found.json")
    found = json.loads(Path("found.json").read_text())
    assert found["verdict"] == verdict
    assert [c["place"] for c in found["causes"]] == places
    said = run(*follow(said), "-s", "bayesian", "-s", "unchanged")
    if verdict == "named":
        run(*follow(said))
        text = Path("updated/model.inp").read_text()
        modulus = float(re.findall(r"NAME=WELD\n\*ELASTIC\n([^,]+),", text)[0])
        assert modulus == pytest.approx(0.2 * 210e3, rel=0.2)


def diagnose_files(model: str, test: str) -> tuple[str, list[str]]:
    """Return verdict and places that files alone lead to, by the commands that users type."""
    for words in (
        ("identify", test, "--output", "identified"),
        ("init", "case", "--model", model, "--modes", "identified"),
        ("diagnose", "case", "--json", "found.json"),
    ):
        call_bench(*words)
    found = json.loads(Path("found.json").read_text())
    return found["verdict"], [cause["place"] for cause in found["causes"]]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("rib", "verdict", "places"), [(1.0, "none", []), (0.5, "ambiguous", ["group:RIB"])]
)
def test_a_soft_rib_is_found_by_a_model_of_shells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rib: float, verdict: str, places: list[str]
) -> None:
    """The truth is of bricks, with the corners that the middle planes of shells do not have.

    So small a part weighs too little for these data to tell another metal from lost stiffness.
    """
    monkeypatch.chdir(tmp_path)
    write_shells(Path("model.inp"))
    truth = write_deck(Path("truth.inp"), "C3D20R", 12.0, rib, SHEETS)
    write_responses(Path("test.uff"), truth, FLATS)
    found, where = diagnose_files("model.inp", "test.uff")
    assert (found, sorted({*where})) == (verdict, places)
