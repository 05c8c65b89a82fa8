"""Edges that draw a model of solids and shells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_shells import FLAT, angle, shell_deck
from test_solid_decks import cantilever, read

from femubench.core.drawing.findings import changes_found
from femubench.core.drawing.places import find_wireframe
from femubench.core.drawing.wireframe import wireframe_of
from femubench.fem import FloatArray


def length_of(lines: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(lines, axis=1), axis=2).sum())


def test_a_bar_of_bricks_is_drawn_by_its_twelve_edges(tmp_path: Path) -> None:
    model = read(tmp_path, cantilever("C3D8", 5, 2))
    assert length_of(wireframe_of(model).lines) == pytest.approx(4 * (1.0 + 0.08 + 0.1))


@pytest.mark.parametrize("kind", ["S4", "S6"])
def test_sheets_are_drawn_by_their_rims_and_bends(kind: str, tmp_path: Path) -> None:
    """Held edges too; halves of a flat sheet are groups, each with its rim."""
    flat = wireframe_of(read(tmp_path, shell_deck(kind, FLAT, held=(1, 2, 3))))
    assert {outline.place for outline in flat.outlines} == {"group:near", "group:far"}
    assert length_of(flat.lines) == pytest.approx(2 * (0.5 + 2 * 0.3))
    bent = shell_deck(kind, angle(0.5 * np.pi)).replace("ELSET=far", "ELSET=near")
    whole = wireframe_of(read(tmp_path, bent))
    assert [outline.place for outline in whole.outlines] == ["all"]
    assert length_of(whole.lines) == pytest.approx(2 * 0.8 + 3 * 0.3)


def test_a_group_is_a_place_of_the_drawing(tmp_path: Path) -> None:
    model = read(tmp_path, shell_deck("S4", FLAT))
    place = find_wireframe(model, ["group:far"]).place("group:far")
    assert place.kind == "outline"
    assert np.array(place.points)[:, 0].min() == pytest.approx(0.25)
    seam = find_wireframe(model, ["interface:near|far"]).place("interface:near|far")
    np.testing.assert_allclose(np.array(seam.points)[:, 0], 0.25)
    assert length_of(np.reshape(seam.points, (-1, 2, 3))) == pytest.approx(0.3)
    ground = find_wireframe(model, ["interface:ground|far"]).place("interface:ground|far")
    assert ground.points == place.points
    item = {"name": "E of far", "before": 1.0, "after": 0.7, "unit": "", "places": "group:far"}
    (found,) = changes_found(model, [item])
    assert length_of(np.reshape(found.points, (-1, 2, 3))) == pytest.approx(0.5 + 2 * 0.3)
