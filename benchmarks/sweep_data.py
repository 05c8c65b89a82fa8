"""What sweeps share: cases in processes, and tables in docs/data, of which a run owns rows."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import starmap
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
PAGE = ROOT / "docs" / "diagnosis-accuracy.md"


def each(call: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[Any]:
    """Yield what a function makes of tasks as they are done, one job's in this process."""
    if jobs == 1:
        yield from starmap(call, tasks)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        for future in as_completed([pool.submit(call, *task) for task in tasks]):
            if future.exception() is not None:
                pool.shutdown(cancel_futures=True)
            yield future.result()


def write_rows(path: Path, run: str, rows: Iterable[Mapping[str, str]]) -> None:
    """Replace the rows of a run in a table, and keep those of all other runs.

    Arguments:
        path: of the table, which need not exist.
        run: the value of the first column.
        rows: cells by their column.
    """
    table = pd.DataFrame([{"run": run, **row} for row in rows])
    if path.is_file():
        known = pd.read_csv(path, dtype=str, keep_default_na=False)
        table = pd.concat([known[known["run"] != run], table])
    if len(table):
        table = table.fillna("").sort_values("run", kind="stable")
        table.to_csv(path, index=False, lineterminator="\n")


def filled(page: str, text: str, mark: str) -> str:
    """Return a page with a text between its markers."""
    head, rest = page.split(f"<!-- {mark} -->\n", 1)
    tail = rest.split(f"<!-- /{mark} -->", 1)[1]
    return f"{head}<!-- {mark} -->\n\n{text}\n\n<!-- /{mark} -->{tail}"


def as_markdown(rows: Iterable[Mapping[str, str]]) -> str:
    """Return a table of texts, empty where a row has no such cell."""
    table = pd.DataFrame(list(rows)).fillna("")
    return str(table.to_markdown(index=False, disable_numparse=True))
