"""One row a job as a Parquet file, for pandas, R, Julia or a database."""

from __future__ import annotations

import io
import json
from typing import NoReturn

import femubench
from femubench import InputError
from femubench.reports.summary import notes_of
from femubench.results import RunData


class ParquetReporter:
    """One row a job, in bytes."""

    name = "parquet"
    suffix = ".parquet"

    def render(self, run: RunData) -> NoReturn:
        """Refuse: this is no text; raises InputError always."""
        raise InputError("format parquet is not a text format", expected="a file")

    def render_bytes(self, run: RunData) -> bytes:
        """Return the results; run and notes are in the file's metadata under ``femubench``.

        Raises:
            InputError: when pyarrow is not installed.
        """
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            raise InputError(
                "format parquet needs pyarrow", expected="pip install 'femubench[parquet]'"
            ) from None
        table = pyarrow.Table.from_pandas(femubench.Run.of(run).table, preserve_index=False)
        about = json.dumps({"run": run.meta.get("run"), "notes": notes_of(run)})
        table = table.replace_schema_metadata({**(table.schema.metadata or {}), "femubench": about})
        stream = io.BytesIO()
        pyarrow.parquet.write_table(table, stream)
        return stream.getvalue()
