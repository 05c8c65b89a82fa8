"""Runs of several machines as one static site: ``bench publish``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from femubench.core.files import check_can_make, resolved
from femubench.core.library.cases import listed
from femubench.core.publish.publishing import Published, publish as merge
from femubench.core.schema.records import run_to_json
from femubench.core.schema.results import Run


def publish(
    folder: str | PathLike[str],
    runs: Run | str | PathLike[str] | Iterable[Run | str | PathLike[str]],
) -> Published:
    """Merge runs into a static site, all of them or none.

    Arguments:
        folder: new, empty, or made by this function: then the runs are added to it.
        runs: files that ``bench run --json`` wrote, here or on another machine, or runs.

    Raises:
        InputError: for a file that is not sound, or a folder with something else in it.

    Examples:
        >>> len(femubench.publish("site", femubench.rank(case, [nominal, scaled])).added)
        1
    """
    from femubench.reports.publish_page import pages_of

    check_can_make(resolved(Path(folder)).parent)
    with TemporaryDirectory() as scratch:
        files = []
        for number, run in enumerate(listed(runs)):
            file = Path(scratch, f"{number}.json") if isinstance(run, Run) else Path(str(run))
            if isinstance(run, Run):
                file.write_text(json.dumps(run_to_json(run), allow_nan=False), encoding="utf-8")
            files.append(file)
        return merge(Path(folder), files, pages_of)
