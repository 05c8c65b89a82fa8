"""The reader of bulk data: a frame from cards, and cards from an updated frame."""

from __future__ import annotations

from pathlib import Path

from femubench import Model
from femubench.plugins.readers.bulk_data.cards import Deck
from femubench.plugins.readers.bulk_data.frame import BulkFrame
from femubench.plugins.readers.bulk_data.plates import BulkPlates, has_plates
from femubench.plugins.readers.bulk_data.structure import grids_of
from femubench.plugins.readers.bulk_data.writing import write_cards
from femubench.plugins.readers.reading import ProgramReader
from femubench.plugins.readers.solid_elements import BYTES


class BulkDataReader(ProgramReader):
    """Reads frames of CBAR and CBEAM, trusses of CROD, plates and solids in Nastran bulk data."""

    name: str = "Nastran bulk data"
    suffixes: tuple[str, ...] = (".bdf", ".dat", ".nas")

    def read_model(self, path: Path) -> Model:
        """Return the model that a file describes, in the units of the file.

        Raises:
            InputError: at the line of the first card that is wrong or is not read.
        """
        return _reading(path).model()

    def read_remarks(self, path: Path) -> tuple[str, ...]:
        """Return what the model leaves out or takes otherwise, one sentence each.

        Raises:
            InputError: as `read_model`.
        """
        reading = _reading(path)
        if isinstance(reading, BulkFrame):
            reading.frame()
        return reading.remarks()

    def read_nodes(self, path: Path) -> dict[str, tuple[float, float, float]]:
        """Return where the grids are, whatever the elements are; raises InputError."""
        grids = grids_of(Deck(path)).values()
        return {g.name: (float(g.xyz[0]), float(g.xyz[1]), float(g.xyz[2])) for g in grids}

    def model_files(self, path: Path) -> tuple[Path, ...]:
        """Return the files that a file includes; raises InputError."""
        return tuple(file for file in Deck(path).lines if file != path)

    def read_memory(self, path: Path) -> int | None:
        """Return the bytes that plates and solids take, whose lines are full matrices."""
        deck = Deck(path)
        size = sum(len(line) for lines in deck.lines.values() for line in lines)
        return BYTES * size if has_plates(deck) else None

    def write_model(self, model: Model, path: Path, original: Path) -> None:
        """Write an updated model: other property and material cards, all else byte for byte.

        Arguments:
            model: of what is in `original`, its properties multiplied, in the units of that.
            original: the file that the model comes from.

        Raises:
            InputError: for what cards of properties cannot say.
        """
        write_cards(model, path, original)


def _reading(path: Path) -> BulkFrame | BulkPlates:
    """Return what a file describes: a frame, or plates and solids where it has one; not both."""
    deck = Deck(path)
    return BulkPlates(deck) if has_plates(deck) else BulkFrame(deck)
