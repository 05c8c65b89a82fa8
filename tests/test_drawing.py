"""Figures as SVG: well-formed, self-contained, the same every time, legible, escaped."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure as Canvas

from femubench.core.drawing.wireframe import DrawnJoint, DrawnMember, Wireframe
from femubench.core.plot.figure import draw_figure, render_figure
from femubench.reproduction import Bars, Curve, Curves, Figure, MatrixImage, StructureMap
from tests.command import run_python

AWKWARD = 'a < b & "c" $x_1$ $'
X = np.linspace(0.0, 1100.0, 50)
CURVES = Curves(
    "curves", "Title < & $a$", AWKWARD, "frequency, Hz", "receptance, dB re 1 m/N",
    (
        Curve(AWKWARD, X, np.cos(X), "measured"),
        Curve("predicted", X, np.sin(X), "predicted"),
        Curve("nominal", X, 0.5 * np.sin(X), "nominal"),
        Curve("second", X, 0.7 * np.sin(X), "predicted"),
    ),
)  # fmt: skip
MATRIX = MatrixImage(
    "matrix", "Matrix", "caption", np.diag([1e6, -1e3, 10.0, 0.0]), "row", "column", "size, N/m",
    (2,),
)  # fmt: skip
WIREFRAME = Wireframe(
    "out-of-plane",
    (DrawnJoint("J1", (0.0, 0.0, 0.0), node=0), DrawnJoint("J2", (1.0, 0.0, 0.0), node=1)),
    (DrawnMember("a", (0, 1), 2),),
    nodes=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.5, 0.0)), elements=((0, 1), (1, 2)),
    element_labels=("a/1", "a/2"), member_of=(0, 0),
)  # fmt: skip
MAP = StructureMap("map", "Map", "caption", WIREFRAME, np.array([0.25, 0.0123]), "change")
BARS = Bars(
    "bars", "Bars", "caption", ("one", "two"), (("a", (1.0, -2.0)), ("b & c", (0.5, 0.25))),
    "mode", "error, %", (("limit", 4.0),),
)  # fmt: skip
FIGURES = (CURVES, MATRIX, MAP, BARS)
each = pytest.mark.parametrize("figure", FIGURES, ids=lambda f: f.name)
SVG = "{http://www.w3.org/2000/svg}"


def axes_of(figure: Figure) -> Any:
    axes = Canvas(layout="constrained").subplots()
    draw_figure(figure, axes)
    return axes


def texts(figure: Figure) -> list[str]:
    return [
        "".join(node.itertext()) for node in ET.fromstring(render_figure(figure)).iter(f"{SVG}text")
    ]


@each
def test_is_one_titled_element(figure: Figure) -> None:
    text = render_figure(figure)
    assert text.startswith("<svg ")
    root = ET.fromstring(text)
    assert root.tag == f"{SVG}svg"
    assert root[0].tag == f"{SVG}title"
    assert root[0].text == figure.title
    assert root[1].text == figure.caption
    assert root.get("role") == "img"


@pytest.mark.slow(5)
def test_same_text_in_another_process() -> None:
    here = "\n".join(render_figure(figure) for figure in (MATRIX, BARS))
    code = (
        "import sys, numpy as np; from femubench.reproduction import Bars, MatrixImage;"
        "from femubench.core.plot.figure import render_figure;"
        f"array = np.array; print(render_figure({MATRIX!r}), render_figure({BARS!r}), "
        "sep=chr(10), end='')"
    )
    assert run_python("-c", code, encoding="utf-8").stdout == here


@each
def test_nothing_from_outside_and_no_date(figure: Figure) -> None:
    text = render_figure(figure)
    for link in re.findall(r'(?:xlink:)?href="([^"]*)"', text):
        assert link.startswith(("#", "data:image/png"))
    assert "<style" not in text
    assert "<metadata" not in text
    assert "<script" not in text


@each
def test_references_lead_to_ids_that_carry_the_name(figure: Figure) -> None:
    text = render_figure(figure)
    ids = re.findall(r' id="([^"]*)"', text)
    linked = set(re.findall(r'(?:url\(|href=")#([^")]+)', text))
    assert linked <= set(ids)
    assert len(ids) == len(set(ids))
    assert all(name.startswith(figure.name) for name in ids)


def test_labels_are_as_given() -> None:
    found = texts(CURVES)
    assert AWKWARD in found
    assert "Title < & $a$" in found
    assert "frequency, Hz" in found
    assert "receptance, dB re 1 m/N" in found
    assert {"J1", "0.25", "0.012", "x, m", "y, m"} <= set(texts(MAP))
    assert "b & c" in texts(BARS)
    assert "10⁶" in texts(MATRIX)


def test_structure_keeps_its_proportions_and_matrix_its_values() -> None:
    assert axes_of(MAP).get_aspect() == 1.0
    (image,) = axes_of(MATRIX).images
    values = image.get_array()
    assert values is not None
    shown = np.ma.getdata(values)
    np.testing.assert_array_equal(shown, np.abs(MATRIX.matrix))
