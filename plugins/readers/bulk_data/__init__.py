"""Nastran bulk data of bars: cards, the frame that they describe, and an updated frame as cards."""

from __future__ import annotations

from femubench.plugins.readers.bulk_data.reader import BulkDataReader

__all__ = ["BulkDataReader"]
