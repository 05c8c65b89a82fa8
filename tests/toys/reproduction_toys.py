"""A paper that nobody wrote, worked through: every kind of cell, and text that wants escaping."""

from __future__ import annotations

import numpy as np

from femubench.plot import Axis, Chart, Series
from femubench.reproduction import (
    Bars,
    Choice,
    Convention,
    Curve,
    Curves,
    Equation,
    Extra,
    Figure,
    Grid,
    Ground,
    Page,
    PrintedTable,
    Study,
)

GIVEN = Ground("input", "a count")
FREE = Ground("independent", "nothing is chosen for it")
EVIL = "<script>alert(1)</script> | *x* & `y` [z](w)"
CONVENTION = "with the words frame:weight=30, which the text does not give"
REASON = "the described least squares gives another column"


def study(paper: str = "frame") -> Study:
    """Return a study with every verdict once or twice, two drawings, and a table of its own."""
    under = Ground("under-convention", CONVENTION)
    missed = Ground("does-not-follow", REASON)
    plain = Page(paper, "1", (FREE,), "Hz", tolerance=0.1, decimals=1)
    stated = Page(paper, "1", (FREE, under), "Hz", tolerance=0.1, fault=missed)
    share = Page(paper, "4d", (GIVEN,), "%", tolerance=0.05, fault=Ground("misprint", EVIL))
    stiff = Page(paper, "4d", (FREE, Ground("fitted", "damped until it met")), "N/m")
    found = Page(paper, "4d", (Ground("searched", "found by trying", 2208),))
    unseen = Page(paper, "4d", (Ground("cannot-be-checked", "its shapes are not printed"),))
    count = Page(paper, "4d", (GIVEN,), tolerance=0.0)
    cells = (
        plain.cell("mode 1", "FE", 255.8, 255.83),
        plain.cell("mode 2", "FE", 500.0, 500.02),
        stated.cell("mode 3", "FE", 581.3, 581.41),
        stated.cell("mode 4", "FE", 911.3, 867.6),
        stated.cell("mode 5", "FE", 1049.4, None),
        stated.cell("rigid 1", "Kabe", -1197.6, -1197.9),
        share.cell("error <b>1</b>", "C|a", 12.8, 15.0),
        stiff.cell("k_x", "updated", 3.24e9, 3.2412e9),
        found.cell("k_z", "updated", 100.0, 100.01),
        unseen.cell("MAC", "1", 75.0, 99.0),
        count.cell("unknowns", "K", 231, 231),
    )
    extra = Extra(
        "Held-out modes",
        ("model", "error of mode 6 (%)"),
        (("C_a as built", "+5.02"), (EVIL, "-0.84")),
        note="None of them was computed.",
    )
    premises = ("The geometry was recovered.", EVIL)
    return Study(
        paper,
        f"Toys & {paper}",
        "A. Author 1999 <nowhere>",
        premises,
        cells,
        findings=("Torsion it is.",),
        extras=(extra,),
        figures=figures(paper),
        tables=(table(paper),),
        equations=(Equation("(1)", EVIL, "femubench.modal.mac", "<math><mi>x</mi></math>"),),
        conventions=lambda: (convention(),),
    )


def table(paper: str = "frame") -> PrintedTable:
    """Return table 1 without its last row, with a column that is no cell, and a chart."""
    rows = tuple((f"mode {k}", (EVIL, (f"mode {k}", "FE"))) for k in range(1, 6))
    x, y = Axis("iteration"), Axis("parameter")
    chart = Chart("line", f"{paper} {EVIL}", x, y, (Series("k", (0, 1, 2), (1.0, 0.5, 0.4)),))
    return PrintedTable("1", EVIL, (Grid(("", "measured", "FE"), rows),), chart)


def convention() -> Convention:
    """Return another way to read the text, by which mode 4 agrees and mode 3 does not."""
    other = {("1", "mode 3", "FE"): 560.0, ("1", "mode 4", "FE"): 911.35}
    return Convention("Shear <b>", "without", (Choice("with | it", other),))


def figures(paper: str) -> tuple[Figure, ...]:
    """Return a plot and a bar chart."""
    x = np.linspace(0.0, 1.0, 3)
    curve = Curves(
        f"{paper}-curve",
        "Receptance <6Z/6Z>",
        "Measured & predicted.",
        "frequency (Hz)",
        "receptance (dB)",
        (Curve("measured", x, x, "measured"),),
    )
    series = (("us", (1.0, 2.0)),)
    bars = Bars(f"{paper}-bars", "Bars", "One of two.", ("a", "b"), series, "group", "%")
    return curve, bars


def drawn(figure: Figure) -> str:
    """Return a drawing that takes no time to make."""
    return f'<svg xmlns="http://www.w3.org/2000/svg"><text>{figure.name}</text></svg>'
