"""The two papers worked through: printed tables, and what recomputes every cell of them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from femubench import hookimpl

if TYPE_CHECKING:
    from femubench.reproduction import Study, Workbench

# Slug: the cases that a re-run works with.
PAPERS = {
    "frame": ("frame", "frame-beam", "frame-solid"),
    "hframe": ("hframe", "hframe-solid"),
}
# Hundredths of a second after which a re-run had done each of its different updates, and all else
# (benchmarks/reproduce_updates.py): how much is left then, for who waits for it.
DONE = {
    "frame": (
        74, 77, 78, 82, 87, 101, 103, 108, 112, 113, 118, 122, 127, 131, 136, 140, 147,
        150, 153, 157, 162, 170, 172, 175, 184, 187, 194, 198, 202, 205, 208, 212, 215,
        218, 221, 231, 235, 238, 243, 246, 249, 252, 255, 259, 265, 274, 295, 297, 297,
        303, 309, 312, 315, 317, 323, 327, 370, 409, 419, 427, 430, 434, 475, 480, 483,
        488, 491, 496, 500, 506, 510, 515, 520, 524, 528, 532, 537, 550,
    ),
    "hframe": (
        535, 545, 548, 576, 585, 600, 612, 625, 628, 634, 638, 641, 644, 792, 793, 810,
        825, 851, 865, 880, 891,
    ),
}  # fmt: skip


def study(paper: str, bench: Workbench) -> Study:
    """Return the re-run of a paper.

    Arguments:
        paper: one of `PAPERS`.
        bench: with the cases that `PAPERS` lists for it, and the built-in strategies.
    """
    found: Study = import_module(f"femubench.papers.{paper}").study(bench)
    return found


@dataclass(frozen=True)
class BuiltinPaper:
    """A paper that comes with femubench, worked through cell by cell."""

    name: str

    @property
    def cases(self) -> tuple[str, ...]:
        """Return the cases that a re-run works with."""
        return PAPERS[self.name]

    @property
    def done(self) -> tuple[int, ...]:
        """Return when a re-run had done each of its updates; see `DONE`."""
        return DONE[self.name]

    def study(self, bench: Workbench) -> Study:
        """Return the re-run."""
        return study(self.name, bench)


@hookimpl
def femubench_papers() -> list[BuiltinPaper]:
    """Return the papers that come with femubench."""
    return list(map(BuiltinPaper, PAPERS))
