"""From a solver's deck and measured responses to verdict and updated model, by the messages alone.

Every command but the first is the one that the message before ends with. Decks and responses are
made here: a bracket of solids welded together, its truth in a mesh that shares few nodes with it.
"""

from __future__ import annotations

import json
import re
import shlex
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from frf_problems import write_universal

import femubench
from femubench import Sensors
from femubench.core.case.nodes import with_mesh
from femubench.modal import FrequencyResponses, receptance
from femubench.plugins.readers.solid_elements import KINDS
from tests.command import call_bench

BOXES = {  # mm
    "BASE": ((0, 0, 0), (240, 120, 8)),
    "WELD": ((0, 0, 8), (8, 120, 16)),
    "UPRIGHT": ((0, 0, 16), (8, 120, 176)),
}
FACES = [(x, y, 8.0) for x in (21, 83, 139, 232) for y in (11, 61, 108)]  # hit along z


def write_deck(file: Path, kind: str, cell: float, weld: float = 1.0) -> Path:
    """Write the bracket in mm, N and tonnes, its weld as stiff as stated."""
    cuts = [sorted({end[a] for box in BOXES.values() for end in box}) for a in range(3)]
    lines = [
        np.unique(np.concatenate([np.linspace(a, b, 1 + int(np.ceil((b - a) / cell)))
                                  for a, b in pairwise(axis)]))
        for axis in cuts
    ]  # fmt: skip
    nodes: dict[tuple[float, ...], int] = {}
    sets: list[str] = []
    number = 0
    for name, (low, high) in BOXES.items():
        sets.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
        inside = [
            [(p, q) for p, q in pairwise(axis) if low[a] <= p and q <= high[a]]
            for a, axis in enumerate(lines)
        ]
        for spans in product(*inside):
            first, last = np.array(spans, dtype=float).T
            number += 1
            ends = [tuple(map(float, first + s * (last - first))) for s in KINDS[kind].places]
            cells = [number, *(nodes.setdefault(p, len(nodes) + 1) for p in ends)]
            rows = [cells[i : i + 11] for i in range(0, len(cells), 11)]
            sets.append(",\n".join(", ".join(map(str, row)) for row in rows))
    for name in BOXES:
        modulus = 210e3 * (weld if name == "WELD" else 1.0)
        sets += [f"*MATERIAL, NAME={name}", "*ELASTIC", f"{modulus}, 0.3"]
        sets += ["*DENSITY", "7.85e-9", f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"]
    places = [f"{n}, {x!r}, {y!r}, {z!r}" for (x, y, z), n in nodes.items()]
    file.write_text("\n".join(["*NODE", *places, *sets, ""]))
    return file


def write_responses(file: Path, deck: Path) -> None:
    """Write accelerances of a deck at points of the base, with 1 % of noise."""
    model = with_mesh(femubench.read_model(deck, unit="mm"))
    rng = np.random.default_rng(4)
    modes = femubench.solve_modes(model, 40)
    xyz = 1e-3 * np.array(FACES)
    sensors = Sensors(tuple(f"{k + 1}:z" for k in range(len(xyz))), xyz, ("z",) * len(xyz))
    two = Sensors(sensors.labels[:2], xyz[:2], ("z", "z"))
    hertz = modes.natural_frequencies
    lines = np.linspace(0.5 * hertz[6], 0.5 * (hertz[15] + hertz[16]), 3000)
    readings = model.observe(sensors)
    values = receptance(modes, readings, readings[:2], lines, 0.004)
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
    ("weld", "verdict", "places"), [(1.0, "none", []), (0.2, "named", ["group:WELD"])]
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
