"""All pages: no serious fault by axe-core, light and dark; nothing wider than a small screen."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from run_edits import called, scaled


@pytest.fixture(scope="module")
def address(
    real: Any, command: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], tuple[Path, str]]:
    """Return what makes a page of a kind: file and hash."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def made(name: str) -> tuple[Path, str]:
        file = folder / f"{name}.html"
        if name == "compared":
            other = folder / "other.json"
            data = json.loads(real.json_file.read_text())
            other.write_text(json.dumps(called(scaled(data, "local", 1.5), "later")))
            command("compare", real.json_file, other, "-f", "html", "-o", file, code=1)
        elif name == "diagnosis":
            few = "shear-deformation,torsion-constant,joint-rotation"
            command("diagnose", "frame", "--no-pairs", "--effects", few, "-q", "--report", file)
        elif name == "reproduction":
            command("reproduce", "hframe", "-q", "-o", folder / name)
            file = folder / name / "reproduce.html"
        else:
            return real.page, f"#{name}" if name == "board" else f"#case/{name}"
        return file, ""

    return made


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
        *(
            pytest.param(name, scheme, marks=pytest.mark.nightly)
            for name, scheme in (
                ("diagnosis", "dark"),
                ("compared", "light"),
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
    view: Callable[..., Any], address: Callable[[str], tuple[Path, str]], name: str, scheme: str
) -> None:
    file, at = address(name)
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
    view: Callable[..., Any], address: Callable[[str], tuple[Path, str]], name: str
) -> None:
    file, at = address(name)
    page = view(file, at, size=(390, 844)).page
    width = "document.documentElement.scrollWidth"
    assert page.evaluate(width) <= 390
    unfolded(page)
    assert page.evaluate(width) <= 390
