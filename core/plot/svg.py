"""A drawing as SVG text that stands in a document: titled, the same text for the same data."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable
from html import escape

from femubench.core.errors import harmless
from femubench.core.plot.style import COLOURS, figure_of, own_axes, report_style

# DejaVu is wide: what is laid out for it has room for the others.
_PAGE = ("max-width", "height")  # the style sheet of the page has them
_FONTS = "'DejaVu Sans', Verdana, Arial, sans-serif"


def svg(
    draw: Callable[..., object],
    *,
    name: str,
    title: str,
    caption: str,
    size: tuple[float, float] = (7.3, 4.4),
    themed: bool = False,
) -> str:
    """Return a drawing as one ``<svg>`` element that needs no other file.

    An artist with a gid ``KEY-3`` becomes a group with ``data-KEY="3"``, its label, less a leading
    underscore, the group's title.

    Arguments:
        draw: draws on its argument `ax`.
        name: the stem of all ids in it.
        title, caption: what it is, and what one sees in it, for who cannot see it.
        size: in inch.
        themed: for the middle of a page: colours are those of the page's style sheet, by the names
            in `COLOURS`, and nothing is cut off at the edge of the axes.

    Examples:
        >>> from functools import partial
        >>> text = plot.svg(
        ...     partial(plot.mac, case), name="mac", title="MAC", caption="Measured and nominal."
        ... )
        >>> text.startswith("<svg")
        True
    """
    text = io.StringIO()
    with report_style(name), warnings.catch_warnings():
        # Letters that the font lacks are drawn by the reader's font.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        # Names that are too long for the drawing stand next to it.
        warnings.filterwarnings("ignore", message="constrained_layout not applied")
        ax = own_axes(None, size)
        draw(ax=ax)
        metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure_of(ax).savefig(text, format="svg", metadata=metadata, transparent=themed)
    titles = {
        str(artist.get_gid()): harmless(str(artist.get_label())).removeprefix("_")
        for artist in ax.get_children()
        if artist.get_gid()
    }
    found = _element(text.getvalue(), name, title, caption, titles)
    if not themed:
        return found
    # For the middle of a page, whose style sheet has the colours.
    found = re.sub(r' (?:xmlns(?::\w+)?|clip-path)="[^"]*"', "", found)
    for role, colour in COLOURS.items():
        found = found.replace(colour, f"var(--{role})")
    return re.sub(r' style="([^"]*)"', _as_attributes, found)


def _element(text: str, name: str, title: str, caption: str, titles: dict[str, str]) -> str:
    """Return the root element alone, titled, with no id that another drawing of a page has too."""
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    linked = set(re.findall(r'(?:url\(|href=")#([^")]+)', text))
    text = text.replace("'DejaVu Sans'", _FONTS)
    slug = re.sub(r"\W+", "-", name)

    def grouped(found: re.Match[str]) -> str:
        if found[1] not in titles:
            return found[0]
        key, _, value = found[1].rpartition("-")
        return f'<g data-{key}="{value}"><title>{escape(titles[found[1]])}</title>'

    def renamed(found: re.Match[str]) -> str:
        return f' id="{slug}-{found[1]}"' if found[1] in linked else ""

    text = re.sub(r'<g id="([^"]*)">', grouped, text)
    text = re.sub(r' id="([^"]*)"', renamed, text)
    text = re.sub(r'(url\(|href=")#([^")]+)', rf"\g<1>#{slug}-\g<2>", text)
    head, body = text.split(">", 1)
    named = (
        f'{head} role="img" aria-labelledby="{slug}-title {slug}-desc" '
        'style="stroke-linejoin: round; stroke-linecap: butt; max-width: 100%; height: auto">\n'
        f' <title id="{slug}-title">{escape(harmless(title))}</title>\n'
        f' <desc id="{slug}-desc">{escape(harmless(caption))}</desc>'
    )
    return f"{named}{body}\n"


def _as_attributes(style: re.Match[str]) -> str:
    """Return a style as attributes, which no content security policy refuses."""
    rules = (rule.partition(":") for rule in style[1].split(";") if ":" in rule)
    known = {key.strip(): value.strip() for key, _, value in rules}
    return "".join(f' {key}="{value}"' for key, value in known.items() if key not in _PAGE)
