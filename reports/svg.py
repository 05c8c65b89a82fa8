"""A chart inside of an HTML document, in a broad and in a narrow form."""

from __future__ import annotations

import re
from functools import partial

from markupsafe import Markup

from femubench.plot import Chart, svg

_NARROW = 3.7  # in, of a telephone


def drawing(chart: Chart, caption: str) -> Markup | None:
    """Return a chart for the middle of a page, in the colours of its style sheet.

    It is drawn twice, ``broad`` and ``narrow``; the style sheet shows what the screen has room for.

    Arguments:
        caption: what one sees in it, for who cannot see it.
    """
    if not any(series.x for series in chart.series):
        return None
    name, (broad, height) = re.sub(r"\W+", "-", chart.title), chart.size
    named = partial(svg, chart.draw, title=chart.title, caption=caption, themed=True)
    drawn = (
        f'<div class="{look}">{named(name=f"{name}-{look}", size=(width, height))}</div>'
        for look, width in (("broad", broad), ("narrow", _NARROW))
    )
    return Markup("".join(drawn))
