"""The scripts of others that pages carry are what npm published, with licence and origin."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

import pytest

VENDOR = Path(__file__).parents[1] / "reports" / "page" / "assets" / "vendor"
ORIGIN = tomllib.loads((VENDOR / "origin.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ORIGIN)
def test_a_script_is_the_file_that_was_published(name: str) -> None:
    entry = ORIGIN[name]
    assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == entry["sha256"]
    assert entry["url"].startswith("https://registry.npmjs.org/")
    assert entry["version"] in entry["url"]
    licence = (VENDOR / entry["license_file"]).read_text(encoding="utf-8")
    assert "Permission to use, copy, modify, and/or distribute" in licence


def test_no_other_script_came_along() -> None:
    assert {path.name for path in VENDOR.glob("*.js")} == set(ORIGIN)
