"""The results as JSON, in the form that other programs rely on."""

from __future__ import annotations

import json

from femubench.results import Run, run_to_json


class JsonReporter:
    """Meta data and one entry a job."""

    name = "json"
    suffix = ".json"

    def render(self, run: Run) -> str:
        """Return strict JSON: what is not a finite number is null."""
        return json.dumps(run_to_json(run), indent=1, allow_nan=False)
