"""The room in which templates of pages become text; whatever comes from data is escaped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment


def templates(folder: str, **options: Any) -> Environment:  # noqa: ANN401 - jinja2's own
    """Return the templates of a folder of this package.

    Arguments:
        folder: below `femubench.reports`.
        options: further ones of `jinja2.Environment`.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("femubench.reports", folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        **options,
    )
