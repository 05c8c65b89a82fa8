"""What is in the files of a store, and files with changed, lost or doubled records."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from femubench.core.run.store import Store


def edit(file: Path, *statements: str) -> None:
    """Change a file of records behind the back of the store."""
    with closing(sqlite3.connect(file, isolation_level=None)) as connection:
        for statement in statements:
            connection.execute(statement)


def change_data(file: Path, old: str, new: str, where: str = "kind = 'result'") -> None:
    """Change a text in the data of the first record of a kind, and no checksum."""
    first = f"number = (SELECT min(number) FROM records WHERE {where})"
    data = f"CAST(replace(CAST(data AS TEXT), '{old}', '{new}') AS BLOB)"
    edit(file, f"UPDATE records SET data = {data} WHERE {first}")


def records(store: Store) -> list[Mapping[str, Any]]:
    """Return what was recorded, with the id of the run."""
    found: list[Mapping[str, Any]] = []
    for file in store.files:
        with closing(sqlite3.connect(file)) as connection:
            for kind, data in connection.execute("SELECT kind, data FROM records ORDER BY number"):
                plain = json.loads(data)
                item = {"result": plain} if kind == "result" else plain
                found.append({"record": kind, "run": file.stem, **item})
    return found
