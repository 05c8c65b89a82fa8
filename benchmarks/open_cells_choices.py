"""Which readings the search for the open columns tries."""

from __future__ import annotations

from dataclasses import replace

from equation_readings import Reading
from open_cells_numbering import DIRECTIONS, EACH, SHAPES

WEIGHTS = ((0.0, 0.0), (1.0, 1.0), (3.0, 0.0), (10.0, 2.0), (100.0, 100.0))
EXPANSIONS: tuple[dict[str, object], ...] = (
    {},
    {"expansion": "transposed"},
    {"expansion": "own"},
    {"expansion": "serep"},
    {"expansion": "dynamic", "start": "nominal"},
    *(
        {"expansion": "force", "metric": metric, "start": start, "orthogonal": orthogonal}
        for metric in ("diagonal", "paper", "raw", "mass")
        for start, orthogonal in (("current", False), ("nominal", False), ("nominal", True))
        if metric == "diagonal" or not orthogonal
    ),
    {"expansion": "all dofs", "data": "beam"},
    {"expansion": "all dofs", "data": "beam", "orthogonal": True},
)
# Single departures from the built-in reading: what an axis of the search does.
AXES: dict[str, tuple[dict[str, object], ...]] = {
    "iterations 1 to 4": tuple({"iterations": n} for n in (1, 2, 3, 4)),
    "damping 0.5, 0.8": ({"damping": 0.5}, {"damping": 0.8}),
    "pull to x = 0 (Tikhonov 1e-3 to 1)": tuple({"tikhonov": 10.0**-n} for n in range(4)),
    "cutoff 1e-3 to 0.3": tuple({"cutoff": c} for c in (1e-3, 1e-2, 3e-2, 0.1, 0.3)),
    "smallest absolute change, cutoff 1e-3 to 0.1": tuple(
        {"absolute": True, "cutoff": c} for c in (1e-3, 1e-2, 0.1)
    ),
    "orthogonality rows alone": ({"motion": False}, {"motion": False, "cross": 0.0}),
    "weights 0 to 100": tuple({"diagonal": d, "cross": c} for d, c in WEIGHTS),
    "rows": tuple({"rows": r} for r in ("raw", "mass", "stiffness", "sensors", "modal")),
    "rows divided by lambda": ({"per_mode": True},),
    "tied by kind, r fixed": ({"tied": "kind"}, {"tied": "element"}),
    "bending alone, torsion alone": ({"only": "EI"}, {"only": "GJ"}),
    "right torsion constant": ({"bredt": True},),
    "no accelerometer": ({"accelerometer": False},),
    "beam shapes, three sensor layouts": tuple(
        {"data": "beam", "layout": name} for name in ("midpoints", "quarters", "rungs")
    ),
    "noise 1 to 5 %, 20 draws": tuple(
        {"noise": sigma, "seed": seed} for sigma in (0.01, 0.02, 0.05) for seed in range(20)
    ),
    "expansion": EXPANSIONS,
    "the model's own frequencies": ({"target": "nominal"},),
    "frequencies of modes 1-2, 2-3 exchanged": (
        {"confused": "1-2"},
        {"confused": "2-3", "iterations": 1},  # the second finds no partners
    ),
    "partners of modes 1-2, 2-3 exchanged": ({"mispaired": "1-2"}, {"mispaired": "2-3"}),
    "shapes 2 to 10 % too large or small": tuple(
        {"scale": s} for s in (0.9, 0.95, 0.98, 1.02, 1.05, 1.1)
    ),
    "members numbered from the other end": tuple({"backward": b} for b in EACH),
    **{
        f"{name}, not turned, 128 numberings": tuple(
            {**words, "sharing": "numbered", "backward": b} for b in DIRECTIONS
        )
        for name, words in SHAPES.items()
    },
    **{f"{name}, mirrored": ({**words, "sharing": "mirrored"},) for name, words in SHAPES.items()},
}
# Readings that close a column, or come nearest to it, with little or nothing tuned.
_FORCED = Reading(expansion="force", start="nominal")
CLOSING = (
    Reading(target="nominal"),
    Reading(target="nominal", rows="raw", diagonal=0.0, cross=0.0),
    replace(_FORCED, metric="raw", rows="raw", diagonal=0.0, cross=0.0),
    Reading("nobari", target="nominal"),
    Reading("nobari", target="nominal", rows="raw", diagonal=0.0, cross=0.0),
    replace(_FORCED, family="generic-ls"),
    replace(_FORCED, family="kabe-rigid"),
    Reading("generic-adjusted", data="beam", expansion="all dofs"),
    Reading("generic-adjusted", data="beam", expansion="all dofs", diagonal=3.0, cross=0.0),
    Reading("generic-adjusted", data="beam", expansion="all dofs", sharing="mirrored"),
)
# Departures that exist for one family alone.
ALONE = {
    "tied by kind, r fixed": "physical",
    "bending alone, torsion alone": "physical",
    **{axis: "generic-adjusted" for axis, (first, *_) in AXES.items() if "sharing" in first},
}
