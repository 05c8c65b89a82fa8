"""Installed distributions with a plugin, as pip would leave them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import dedent


def install_metadata(
    folder: Path, name: str, points: Mapping[str, str], version: str = "1.0"
) -> None:
    """Write what makes a folder hold a distribution.

    Arguments:
        points: the entry points of the group femubench: name and module.
    """
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(exist_ok=True)
    metadata = f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
    (info / "METADATA").write_text(metadata, encoding="utf-8")
    lines = ["[femubench]", *(f"{point} = {module}" for point, module in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines), encoding="utf-8")


def install_module(folder: Path, name: str, source: str, module: str = "") -> None:
    """Write a distribution with one plugin, both of that name; so is its module by default."""
    (folder / f"{module or name}.py").write_text(dedent(source), encoding="utf-8")
    install_metadata(folder, name, {name: module or name})
