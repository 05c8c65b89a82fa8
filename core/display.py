"""How data show themselves: a few lines on a screen, a table in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from femubench.core.errors import clipped

WIDTH, LINES = 100, 10


class Shown:
    """Base of data classes whose `repr` is short; they say what is to be seen."""

    def rows(self) -> Sequence[tuple[str, str]]:
        """Return what is worth knowing, each under a word; the first row is the title."""
        raise NotImplementedError

    def __repr__(self) -> str:
        (word, title), *rows = self.rows()
        name = type(self).__name__
        width = max((len(key) for key, _ in rows), default=0)
        lines = [f"{name} {word}: {title}" if word else f"{name}: {title}"]
        lines += [f"  {key:{width}}  {text}" for key, text in rows]
        if len(lines) > LINES:
            lines[LINES - 1 :] = [f"  ... {len(lines) - LINES + 1} more"]
        return "\n".join(clip_text(line) for line in lines)

    def _repr_html_(self) -> str:
        (word, title), *rows = self.rows()
        body = "".join(
            f"<tr><th>{escape(first)}</th><td>{escape(text)}</td></tr>" for first, text in rows
        )
        caption = escape(f"{type(self).__name__} {word}: {title}")
        return f"<table><caption>{caption}</caption><tbody>{body}</tbody></table>"


def clip_text(text: str) -> str:
    """Return text on one line that is not longer than `WIDTH`."""
    return clipped(text.replace("\n", " ").rstrip(), WIDTH)


def count_noun(number: int, noun: str) -> str:
    """Return ``1 case``, ``3 cases``, ``2 strategies``."""
    if number == 1:
        return f"1 {noun}"
    stem, ending = (noun[:-1], "ies") if noun.endswith("y") else (noun, "s")
    return f"{number} {stem}{'es' if noun.endswith('s') else ending}"


def modes_line(numbers: Iterable[int], frequencies: Iterable[float]) -> str:
    """Return modes as ``modes 1 2 3 at 226.8 275.2 537.4 Hz``."""
    labels = [str(number) for number in numbers]
    figures = [f"{hertz:.5g}" for hertz in frequencies]
    noun = "mode" if len(labels) == 1 else "modes"
    return f"{noun} {' '.join(labels)} at {' '.join(figures)} Hz"
