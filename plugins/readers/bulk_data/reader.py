"""The reader of bulk data: a frame from cards, and cards from an updated frame."""

from __future__ import annotations

from pathlib import Path

from femubench import Model
from femubench.plugins.readers.bulk_data.cards import Deck
from femubench.plugins.readers.bulk_data.structure import BulkFrame, grids_of
from femubench.plugins.readers.bulk_data.writing import write_cards
from femubench.plugins.readers.reading import ProgramReader


class BulkDataReader(ProgramReader):
    """Reads and writes frames of CBAR and CBEAM, and trusses of CROD, in Nastran bulk data."""

    name: str = "Nastran bulk data"
    suffixes: tuple[str, ...] = (".bdf", ".dat", ".nas")

    def read_model(self, path: Path) -> Model:
        """Return the model of the frame that a file describes, in the units of the file.

        Raises:
            InputError: at the line of the first card that is wrong or is not read.
        """
        return BulkFrame(Deck(path)).model()

    def read_remarks(self, path: Path) -> tuple[str, ...]:
        """Return what the model leaves out or takes otherwise, one sentence each.

        Raises:
            InputError: as `read_model`.
        """
        reading = BulkFrame(Deck(path))
        reading.frame()
        return reading.remarks()

    def read_nodes(self, path: Path) -> dict[str, tuple[float, float, float]]:
        """Return where the grids are, whatever the elements are; raises InputError."""
        grids = grids_of(Deck(path)).values()
        return {g.name: (float(g.xyz[0]), float(g.xyz[1]), float(g.xyz[2])) for g in grids}

    def model_files(self, path: Path) -> tuple[Path, ...]:
        """Return the files that a file includes; raises InputError."""
        return tuple(file for file in Deck(path).lines if file != path)

    def write_model(self, model: Model, path: Path, original: Path) -> None:
        """Write an updated frame: other property and material cards, all else byte for byte.

        Arguments:
            model: of the frame in `original`, its properties multiplied, in the units of that.
            path: the new file.
            original: the file that the model comes from.

        Raises:
            InputError: for what cards of properties cannot say.
        """
        write_cards(model, path, original)
