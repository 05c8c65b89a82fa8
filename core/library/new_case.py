"""A case from the files that are at hand: ``bench init FOLDER --model FILE --modes FILE``."""

from __future__ import annotations

from pathlib import Path

from femubench.core.case.case import Case
from femubench.core.case.starting import Beginning, start_case
from femubench.core.plugin.loader import Plugins


def begin_case(folder: Path, given: Beginning, plugins: Plugins) -> Case:
    """Write a case folder from files, with a picture of the match.

    Arguments:
        folder: new or empty.
        given: the files, and what was given of them.
        plugins: whose readers read them.

    Raises:
        InputError: when the folder holds anything, or for what is wrong in the files.
    """
    readers = tuple(plugins.readers.values())
    return start_case(folder, given, readers, _draw)


def _draw(case: Case, file: Path) -> None:
    from femubench.core.plot.matching import matching
    from femubench.core.plot.style import figure_of

    figure_of(matching(case)).savefig(str(file), dpi=150)
