"""What the documents of `bench compare` and `bench publish` share: templates, style, policy."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

from femubench.reports.templating import templates

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def environment() -> Environment:
    """Return the templates, with style, script and content security policy as globals."""
    from markupsafe import Markup

    room = templates("page/assets")
    style, script = asset("site.css"), asset("site.js")
    # Nothing but this very style and this very script may take effect, whatever a name smuggles in.
    policy = f"default-src 'none'; base-uri 'none'; form-action 'none'; style-src {_hash(style)}"
    room.globals.update(
        style=Markup(style),
        script=Markup(script),
        policy=Markup(policy),
        script_policy=Markup(f"{policy}; script-src {_hash(script)}"),
    )
    return room


def asset(name: str) -> str:
    """Return the text of a file beside the templates."""
    return files("femubench.reports").joinpath("page", "assets", name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    return f"'sha256-{digest}'"
