"""The built-in scenarios: one folder each, with a README on where every number comes from."""

from __future__ import annotations

import tomllib
from pathlib import Path

from femubench import Scenario, hookimpl

HERE = Path(__file__).parent
SUITE = HERE / "suite"

_TUBES = ("planar frame", "hollow sections", "free")
_TESTED, _COMPUTED = (*_TUBES, "published test"), (*_TUBES, "computed truth")
# Name: title, classes.
_PUBLISHED_AND_SOLID = {
    "frame": ("Ladder frame of Ahmadian et al., published test", _TESTED),
    "hframe": ("H-frame of Horton et al., published test", _TESTED),
    "frame-solid": ("Ladder frame, everything from its solid twin", _COMPUTED),
    "hframe-solid": ("H-frame, everything from its solid twin", _COMPUTED),
}
# Not in the default set: one truth is a beam model too, the other weighs two structures again.
_FURTHER = {
    "frame-beam": ("Ladder frame, truth of shear-flexible beams and soft joints", _COMPUTED),
    "frame-beam-asymmetric": (
        "The same with one half side 4 % longer and one soft joint",
        _COMPUTED,
    ),
    "design-change": (
        "Eight design changes of both structures, nothing else held out",
        (*_COMPUTED, "design changes"),
    ),
}


def _cases(name: str) -> dict[str, Path]:
    """Return the scenario's own case, or those of its sub-folders."""
    folder = HERE / name
    if (folder / "case.toml").is_file():
        return {name: folder}
    parts = sorted(path.parent for path in folder.glob("*/case.toml"))
    return {f"{name}/{part.name}": part for part in parts}


def _suite() -> list[Scenario]:
    """Return the structures that `suite.toml` lists, each as a scenario; none without the file."""
    table = SUITE / "suite.toml"
    if not table.is_file():
        return []
    listed = tomllib.loads(table.read_text(encoding="utf-8"))
    return [
        Scenario(
            f"suite/{name}",
            item["title"],
            {f"suite/{name}": SUITE / name},
            tuple(item["classes"]),
            item["default"],
        )
        for name, item in listed.items()
    ]


def _footbridge() -> Path:
    """Return the case folder made of the user's own copy of the footbridge's data."""
    # Names are listed without what reads data.
    from femubench.scenarios.matlab_footbridge import case_folder

    return case_folder()


@hookimpl
def femubench_scenarios() -> list[Scenario]:
    """Return the built-in scenarios."""
    own = [
        Scenario(name, title, _cases(name), kinds, default)
        for listed, default in ((_PUBLISHED_AND_SOLID, True), (_FURTHER, False))
        for name, (title, kinds) in listed.items()
    ]
    footbridge = Scenario(
        "footbridge",
        "Steel pedestrian bridge, published test; needs FEMUBENCH_FOOTBRIDGE",
        {"footbridge": _footbridge},
        ("bridge", "matrices", "soft supports", "published test"),
        default=False,
    )
    garteur = Scenario(
        "garteur",
        "Aeroplane-like test bed GARTEUR SM-AG19, published test",
        _cases("garteur"),
        ("published test", "wing-like", "free"),
        default=False,
    )
    return [*own, garteur, *_suite(), footbridge]
