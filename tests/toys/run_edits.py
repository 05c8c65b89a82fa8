"""Edits of the JSON of a run, as another version, another machine or a liar would give it."""

from __future__ import annotations

import copy
import hashlib
from typing import Any

Data = dict[str, Any]


def scaled(data: Data, strategy: str, factor: float) -> Data:
    """Return a run in which all frequency errors of a strategy are larger by a factor."""
    made = copy.deepcopy(data)
    for result in made["results"]:
        if result["strategy"] != strategy or result["status"] != "ok":
            continue
        for name in ("used", "higher", "modified"):
            block = result[name]
            for mode in block["modes"] if block else ():
                error = mode["predicted_hz"] / mode["measured_hz"] - 1.0
                mode["predicted_hz"] = mode["measured_hz"] * (1.0 + factor * error)
            if block:
                block["rms_percent"] *= factor
    return made


def failed(data: Data, strategy: str, status: str = "failed") -> Data:
    """Return a run in which a strategy gives no result."""
    made = copy.deepcopy(data)
    for result in made["results"]:
        if result["strategy"] == strategy:
            result |= {"status": status, "reason": "made up", "used": None, "higher": None}
            result |= {"modified": None, "gain": None}
    return made


def called(data: Data, run: str, day: int = 1, **machine: str) -> Data:
    """Return a run of another name, day of January 2027 and machine."""
    made = copy.deepcopy(data)
    made["meta"] |= {"run": run, "started": f"2027-01-{day:02d}T00:00:00+00:00"}
    made["meta"]["machine"] |= machine
    return made


def versioned(data: Data, strategy: str, version: str) -> Data:
    """Return a run with another version of a strategy, which gives its jobs other keys."""
    made = copy.deepcopy(data)
    for result in made["results"]:
        if result["strategy"] == strategy:
            result["provenance"]["strategy"] = version
            result["key"] = _key(result["key"] + version)
    return made


def renamed(data: Data, strategy: str, name: str) -> Data:
    """Return a run in which a strategy has another name."""
    made = copy.deepcopy(data)
    for result in made["results"]:
        if result["strategy"] == strategy:
            result["strategy"], result["key"] = name, _key(result["key"] + name)
    made["meta"]["strategies"] = [
        name if item == strategy else item for item in made["meta"]["strategies"]
    ]
    return made


def moved(data: Data, case: str, digest: str) -> Data:
    """Return a run on other files of a case."""
    made = copy.deepcopy(data)
    made["meta"]["cases"][case]["digest"] = digest
    for result in made["results"]:
        if result["case"] == case:
            result["provenance"]["case"] = digest
            result["key"] = _key(result["key"] + digest)
    return made


def _key(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()[:32]
