"""The two papers worked through: printed tables, and what recomputes every cell of them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from femubench import hookimpl

if TYPE_CHECKING:
    from femubench.reproduction import Study, Workbench

# Slug: the cases that a re-run works with.
PAPERS = {"frame": ("frame", "frame-beam", "frame-solid"), "hframe": ("hframe", "hframe-solid")}
# Hundredths of a second after which a re-run had done each of its different updates, and all else
# (benchmarks/reproduce_updates.py): how much is left then, for who waits for it.
DONE = {
    "frame": (
        72, 74, 75, 80, 83, 97, 100, 104, 108, 110, 114, 118, 123, 127, 132, 136, 142,
        145, 149, 152, 157, 164, 167, 169, 178, 180, 187, 190, 194, 197, 200, 203, 206,
        209, 212, 221, 225, 228, 233, 236, 239, 241, 244, 248, 253, 262, 281, 282, 283,
        289, 294, 297, 300, 302, 308, 312, 353, 393, 402, 410, 416, 421, 463, 468, 472,
        476, 481, 485, 498,
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
