"""The built-in scenarios: one folder each, with a README on where every number comes from."""

from __future__ import annotations

from pathlib import Path

from femubench import Scenario, hookimpl

HERE = Path(__file__).parent

TITLES = {
    "frame": "Ladder frame of Ahmadian et al., published test",
    "hframe": "H-frame of Horton et al., published test",
    "frame-solid": "Ladder frame, everything from its solid twin",
    "hframe-solid": "H-frame, everything from its solid twin",
    "frame-beam": "Ladder frame, truth of shear-flexible beams and soft joints",
    "frame-beam-asymmetric": "The same with one half side 4 % longer and one soft joint",
    "design-change": "Eight design changes of both structures, nothing else held out",
}


def _cases(name: str) -> dict[str, Path]:
    """Return the scenario's own case, or those of its sub-folders."""
    folder = HERE / name
    if (folder / "case.toml").is_file():
        return {name: folder}
    parts = sorted(path.parent for path in folder.glob("*/case.toml"))
    return {f"{name}/{part.name}": part for part in parts}


@hookimpl
def femubench_scenarios() -> list[Scenario]:
    """Return the built-in scenarios."""
    return [Scenario(name, title, _cases(name)) for name, title in TITLES.items()]
