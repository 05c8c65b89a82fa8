"""Horton, Gurgenci, Veidt & Friswell (1999): the H-frame, every table worked through."""

from __future__ import annotations

from femubench.papers.hframe.beyond import compare, draw_held_out_bars, extras
from femubench.papers.hframe.conventions import conventions
from femubench.papers.hframe.findings import findings, premises
from femubench.papers.hframe.layout import layout
from femubench.papers.hframe.meshes import mesh_cells
from femubench.papers.hframe.shapes import mac_extra, shape_cells
from femubench.papers.hframe.updates import update_cells
from femubench.papers.printed import equations
from femubench.reproduction import Study, Workbench


def study(bench: Workbench) -> Study:
    """Return the re-run of tables 2, 3 and 4, and what the paper did not compute.

    Arguments:
        bench: with the case ``hframe`` and the built-in strategies.
    """
    case = bench.cases["hframe"]
    comparison = compare(bench)
    cells = mesh_cells(case) + shape_cells(case) + update_cells(bench)
    return Study(
        paper="hframe",
        title="Finite element model updating of the welded joints in a tubular H-frame",
        citation="Horton, Gurgenci, Veidt & Friswell (1999), Proc. IMAC XVII",
        premises=premises(bench),
        cells=cells,
        findings=findings(bench, comparison),
        extras=(*extras(bench, comparison), mac_extra(case)),
        figures=(draw_held_out_bars(bench, comparison),),
        tables=layout(bench),
        equations=equations("hframe"),
        conventions=lambda: conventions(bench),
    )
