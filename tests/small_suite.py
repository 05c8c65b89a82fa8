"""A few structures in the form of the suite, for tests of what is made of one."""

from __future__ import annotations

import shutil
from pathlib import Path

import tomlkit

SCENARIOS = Path(__file__).parents[1] / "scenarios"
SUPPORTED = ("bench", "deck", "grille", "stand", "table")


def write_suite(folder: Path) -> Path:
    """Write two free structures of square tubes, and five of rectangular ones on two supports."""
    shutil.copytree(SCENARIOS / "frame-solid", folder / "frame-solid")
    shutil.copytree(SCENARIOS / "hframe-solid", folder / "hframe-solid")
    for name in SUPPORTED:
        shutil.copytree(SCENARIOS / "frame-solid", folder / name)
        file = folder / name / "case.toml"
        document = tomlkit.parse(file.read_text(encoding="utf-8"))
        tube = document["model"]["sections"]["tube"]  # type: ignore[index]
        tube.update({"shape": "rectangular-tube", "height": 0.0152})  # type: ignore[union-attr]
        supports = tomlkit.aot()
        for joint in ("J1", "J9"):
            support = tomlkit.table()
            support.update({"at": joint, "fixed": ["z", "rx", "ry"]})
            supports.append(support)
        document["model"]["supports"] = supports  # type: ignore[index]
        file.write_text(tomlkit.dumps(document), encoding="utf-8")
    return folder
