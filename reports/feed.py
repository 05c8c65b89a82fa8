"""News of a public leaderboard as feeds: Atom, RFC 4287, and JSON Feed 1.1."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from uuid import NAMESPACE_URL, uuid5

from femubench.reports.cells import format_fixed, interval, plain
from femubench.reports.templating import templates

TITLE = "femubench leaderboard"
_ABOUT = ("kind", "strategy", "version", "femubench", "when")
_SAYS = {"strategy": "New: {}", "version": "New version of {}", "leader": "{} leads"}


def headline_of(item: Mapping[str, Any]) -> str:
    """Return what happened in a few words."""
    return _SAYS[item["kind"]].format(plain(item["strategy"]) or "a strategy without name")


def feeds_of(index: Mapping[str, Any]) -> dict[str, str]:
    """Return the feeds by file name; all time stamps in them are those of the runs.

    Without the address of the site there is Atom alone, with links relative to itself: JSON Feed
    has no such links. The names of feed and entries are made of what they are about.

    Arguments:
        index: the content of ``index.json``.
    """
    home, name = index["address"], _name("feed", index["runs"][0]["run"])
    items = [
        {
            "id": _name(*(item[key] for key in _ABOUT)),
            "url": home + item["page"],
            "title": headline_of(item),
            "content_text": _news_text(item),
            "date_published": item["when"],
        }
        for item in index["news"]
    ]
    atom = templates().get_template("feed.xml").render(
        home=home, name=name, title=TITLE, updated=index["runs"][-1]["started"], items=items
    )  # fmt: skip
    if not home:
        return {"feed.xml": atom}
    feed = {
        "version": "https://jsonfeed.org/version/1.1", "title": TITLE, "language": "en",
        "home_page_url": f"{home}index.html", "feed_url": f"{home}feed.json", "items": items,
    }  # fmt: skip
    return {"feed.xml": atom, "feed.json": json.dumps(feed, indent=1) + "\n"}


def _news_text(item: Mapping[str, Any]) -> str:
    """Return version and gain of who is in the news."""
    stated = f"Version {plain(item['version'])}, femubench {plain(item['femubench'])}: "
    failed = [f"{item['failures']} jobs failed"] if item["failures"] else []
    known = "; ".join([f"errors {item['marks'][0]}", *item["marks"][1:], *failed])
    if item["gain"] is None:
        return f"{stated}no result on today's files of the cases; {known}."
    sure = "" if item["low"] is None else f" (95 %: {interval(item['low'], item['high'])})"
    off = ""
    if item["error_percent"] is not None:
        off = (
            f", {item['error_percent']:.1f} % off out of the given band, "
            f"handbooks {item['textbook_percent']:.1f} %,"
        )
    gain = format_fixed(item["gain"], 3, 7)
    return f"{stated}gain {gain}{sure}{off} on today's cases; {known}."


def _name(*parts: str) -> str:
    return uuid5(NAMESPACE_URL, "femubench:" + "\n".join(parts)).urn
