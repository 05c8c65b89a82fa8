"""The markers that tie functions to femubench's hooks."""

from __future__ import annotations

import pluggy

PROJECT = "femubench"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
