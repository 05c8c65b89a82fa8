"""All pages: no serious fault by axe-core, light and dark; nothing wider than a small screen."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from run_edits import called, scaled

CASES = ("frame", "hframe", "frame-solid")


@pytest.fixture(scope="module")
def addresses(
    real: Any, command: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[Path, str]]:
    """Make every kind of page; file and hash by name."""
    folder = tmp_path_factory.mktemp("pages")
    data = json.loads(real.json_file.read_text())
    other = folder / "other.json"
    other.write_text(json.dumps(called(scaled(data, "local", 1.5), "later")))
    compared, diagnosis = folder / "compared.html", folder / "diagnosis.html"
    command("compare", real.json_file, other, "-f", "html", "-o", compared, code=1)
    command("diagnose", "hframe", "--no-pairs", "-q", "--report", diagnosis)
    command("reproduce", "hframe", "-q", "-o", folder / "reproduced")
    return {
        "board": (real.page, "#board"),
        **{case: (real.page, f"#case/{case}") for case in CASES},
        "compared": (compared, ""),
        "diagnosis": (diagnosis, ""),
        "reproduction": (folder / "reproduced" / "reproduce.html", ""),
    }


def unfolded(page: Any) -> None:
    """Show what is folded away, so that it is looked at too."""
    page.evaluate(
        """() => {
          for (const one of document.querySelectorAll("details:not(.menu)")) one.open = true;
          document.querySelector("details.menu")?.setAttribute("open", "");
          document.querySelector(".expand")?.click();
        }"""
    )
    page.wait_for_timeout(50)


@pytest.mark.parametrize(
    ("name", "scheme"),
    [
        ("board", "light"),
        ("diagnosis", "dark"),
        ("compared", "light"),
        *(
            pytest.param(name, scheme, marks=pytest.mark.nightly)
            for name, scheme in (
                # A change of the whole matrix, and one element by element.
                ("hframe", "dark"),
                ("frame", "light"),
                ("board", "dark"),
                ("diagnosis", "light"),
                ("compared", "dark"),
                ("reproduction", "light"),
                ("reproduction", "dark"),
            )
        ),
    ],
)
def test_axe_finds_nothing_serious(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]], name: str, scheme: str
) -> None:
    file, at = addresses[name]
    found = view(file, at, color_scheme=scheme)
    unfolded(found.page)
    found.assert_accessible()
    assert found.messages == []
    assert not [url for url in found.requests if not url.startswith(("file:", "data:"))]


@pytest.mark.parametrize(
    "name",
    ["board", "hframe", "diagnosis"]
    + [
        pytest.param(name, marks=pytest.mark.nightly)
        for name in ("compared", "reproduction", "frame", "frame-solid")
    ],
)
def test_fits_a_small_screen(
    view: Callable[..., Any], addresses: dict[str, tuple[Path, str]], name: str
) -> None:
    file, at = addresses[name]
    page = view(file, at, size=(390, 844)).page
    width = "document.documentElement.scrollWidth"
    assert page.evaluate(width) <= 390
    unfolded(page)
    assert page.evaluate(width) <= 390
