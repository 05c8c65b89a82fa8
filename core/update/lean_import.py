"""Importing a package without what it would load beside itself and is not asked for."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def importing_without(*packages: str) -> Iterator[None]:
    """Hide packages from what is imported meanwhile, which must do without where they are missing.

    Some packages take half a second to load what draws or stores their results. What is loaded
    already is not hidden.

    Arguments:
        packages: what the imported one asks for in a ``try``.

    Examples:
        >>> with update.importing_without("matplotlib"):
        ...     import cma
    """
    nothing: Any = None
    hidden = [name for name in packages if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden, nothing))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that it is without
            yield
    finally:
        for name in hidden:
            del sys.modules[name]
