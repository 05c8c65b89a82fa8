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
        79, 81, 82, 87, 90, 105, 108, 112, 117, 119, 124, 127, 131, 134, 137, 141, 144, 148,
        151, 155, 159, 161, 164, 178, 180, 181, 182, 187, 192, 194, 196, 198, 204, 208, 250,
        286, 295, 301, 304, 307, 340, 343, 347, 351, 355, 359, 363, 368, 372, 378, 382, 386,
        390, 395, 399, 411,
    ),
    "hframe": (531, 541, 545, 576, 587, 600, 613, 627, 631, 637, 641, 645, 648, 821, 824, 851, 863),
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
