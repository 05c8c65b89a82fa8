"""Public pages whose names are imported on first use: an effect needs one name of many modules."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def open_door(page: str, file: str) -> tuple[list[str], Callable[[str], Any], Callable[[], Any]]:
    """Return what a page lists, gives and shows: what it imports for type checkers, and its pages.

    Arguments:
        page: a module.
        file: its source.
    """
    tree = ast.parse(Path(file).read_bytes())
    blocks = (node for node in tree.body if isinstance(node, ast.If))
    block = next(b for b in blocks if ast.unparse(b.test) == "TYPE_CHECKING")
    home = {
        alias.name: str(node.module)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }

    package = Path(file).stem == "__init__"
    pages = {one.stem for one in Path(file).parent.glob("[!_]*.py")} if package else set()

    def give(name: str) -> Any:  # noqa: ANN401 - one door for every name
        if name in pages:
            return import_module(f"{page}.{name}")
        if name not in home:
            raise AttributeError(f"module {page!r} has no attribute {name!r}")
        found = getattr(import_module(home[name]), name)
        setattr(sys.modules[page], name, found)
        return found

    return sorted(home), give, lambda: sorted({*vars(sys.modules[page]), *home, *pages})
