"""The two papers worked through: printed tables, and what recomputes every cell of them."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from femubench.reproduction import Study, Workbench

# Slug: the cases that a re-run works with.
PAPERS = {
    "frame": ("frame", "frame-beam", "frame-solid"),
    "hframe": ("hframe", "hframe-solid"),
}
# How many different updates a re-run computes, for who waits for it.
UPDATES = {"frame": 55, "hframe": 16}


def study(paper: str, bench: Workbench) -> Study:
    """Return the re-run of a paper.

    Arguments:
        paper: one of `PAPERS`.
        bench: with the cases that `PAPERS` lists for it, and the built-in strategies.
    """
    found: Study = import_module(f"femubench.papers.{paper}").study(bench)
    return found
