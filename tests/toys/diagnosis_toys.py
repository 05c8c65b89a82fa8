"""A diagnosis put together by hand, in every verdict, with figures that are easy to recognise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import harness_toys

from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.schema.diagnosis import (
    Advice,
    Cause,
    CauseParameter,
    Gain,
    LocationRow,
    LookWarning,
    ResidualRow,
    Rival,
    SmallestVisible,
    Verdict,
)

STRUCTURE: dict[str, Any] = {
    "plane": "in-plane",
    "joints": [
        {"name": "J1", "type": "L", "xyz": [0.0, 0.0, 0.0]},
        {"name": "J3", "type": "T", "xyz": [1.0, 0.0, 0.5]},
    ],
    "members": [{"name": "beam", "ends": [0, 1], "elements": 4}],
    "sensors": [{"label": "p2", "xyz": [0.5, 0.0, 0.25], "direction": "-z"}],
    "supports": [{"xyz": [0.0, 0.0, 0.0], "fixed": ["x", "z"]}],
    "places": [
        {"place": "type:T", "kind": "joint", "spans": [], "points": [[1.0, 0.0, 0.5]]},
        {"place": "all", "kind": "all", "spans": [], "points": []},
        {
            "place": "beam@J1",
            "kind": "end",
            "spans": [{"member": 0, "start": 0.0, "end": 0.125}],
            "points": [],
        },
    ],
}

# What a name may hold that a terminal, a browser or Markdown would obey.
NASTY = "<script>alert(1)</script> | a *b* _c_ `d` [e](http://x)\x1b[31m\n# red\u202e\x07"

SOFT = Cause(
    "joint-rotation",
    "type:T",
    (
        CauseParameter("bending", 31000.0, 1200.0, "N m/rad"),
        CauseParameter("torsion", 20500.0, None, "N m/rad"),
    ),
    0.9421,
    "the joints rotate",
)
SHEAR = Cause("shear-deformation", "all", (CauseParameter("multiple", 1.0, None, "", True),), 0.97)
RIVALS = (
    Rival("joint-offset", "type:T", 812.5, 0.031, 10.4),
    Rival("torsion-constant + added-mass", "all + J3", 801.25, 0.002),
)


def residuals() -> tuple[ResidualRow, ...]:
    return (
        ResidualRow("frequency", 4, "", 226.8, 12.34, -0.21),
        ResidualRow("shape", 4, "p1", 1.0, 3.0, 1.0),
        ResidualRow("shape", 4, "p2", 0.5, -4.0, -1.0),
        ResidualRow("shape", 4, "p3", 0.25, None, None),
        ResidualRow("frequency", 7, "", 275.2, None, 0.52),
        ResidualRow("mass", None, "", 2.125, 0.31, 0.29),
    )


def made(verdict: Verdict = "named", **changes: Any) -> Diagnosis:
    """Return a diagnosis of the toy case."""
    causes = {"none": (), "ambiguous": (SOFT, SHEAR)}.get(verdict, (SOFT,))
    found = Diagnosis(
        case="toy",
        verdict=verdict,
        sentence="The T joints rotate, 94.2 % sure.",
        causes=causes,
        rivals=RIVALS,
        reason="their sensitivities are 1.8 degrees apart" if verdict == "ambiguous" else "",
        advice=(Advice("weigh the structure", 140.25), Advice("add 0.2 kg at J3", 54.0)),
        smallest_visible=(SmallestVisible("added-mass", "J3", 0.0123, "kg"),),
        residuals=residuals(),
        gain=Gain((4.25, 0.125), (3.4, 0.75), None, None),
        gain_rms=Gain((5.5, 0.25), (3.6, 0.8)),
        chi2=(9201.0, 55.25),
        data_count=61,
        adequacy_p=0.614,
        nothing=1e-9,
        looks=(
            LookWarning(
                "J equals Jp and tube is no circle.",
                "tube",
                "torsion-constant",
                ((1, -3.25), (2, math.nan)),
            ),
        ),
        locations=(
            LocationRow("evidence", "J3", 0.5),
            LocationRow("evidence", "J1", 1.0),
            LocationRow("ecomac", "p2", 1.0),
        ),
        base=("shear-deformation", "rotary-inertia"),
        extended=harness_toys.tiny_case().model,
        notes=("Mode 9 found no partner.",),
        seconds=0.5,
    )
    return replace(found, **changes)


def nasty() -> Diagnosis:
    """Return a diagnosis in which every text is hostile, and long."""
    text = NASTY * 3
    parameter = CauseParameter(text, 1.0, 0.1, text)
    return made(
        "ambiguous",
        case=text,
        sentence=text,
        causes=(Cause(text, text, (parameter,), 0.5, text),),
        rivals=(Rival(text, text, 1.0, 0.5),),
        reason=text,
        advice=(Advice(text, 1.0),),
        smallest_visible=(SmallestVisible(text, text, 1.0, text),),
        residuals=(
            ResidualRow("frequency", 10**30, text, 1e300, -1e300, 1e300),
            ResidualRow("shape", 10**30, text, 1e300, -1e150, 1e150),
        ),
        chi2=(1e300, 1e300),
        looks=(LookWarning(text, text, text, ((10**9, 1e300),) * 30),),
        locations=(LocationRow(text, text, 1.0),),
        base=(text,),
        notes=(text,),
    )


def data_of(verdict: Any = "named", **changes: Any) -> dict[str, Any]:
    """Return a diagnosis as its JSON, with a structure of one member."""
    data = diagnosis_to_json(made(verdict, **changes))
    return diagnosis_from_json({**data, "structure": STRUCTURE})
