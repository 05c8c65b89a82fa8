"""News of a public leaderboard as a feed: Atom, RFC 4287."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from uuid import NAMESPACE_URL, uuid5
from xml.etree import ElementTree

from femubench.reports.cells import fixed, interval, plain

_ATOM = "http://www.w3.org/2005/Atom"
_SAYS = {"strategy": "New: {}", "version": "New version of {}", "leader": "{} leads"}


def headline_of(item: Mapping[str, Any]) -> str:
    """Return what happened in a few words."""
    return _SAYS[item["kind"]].format(plain(item["strategy"]) or "a strategy without name")


def feed_of(index: Mapping[str, Any]) -> str:
    """Return the document; all time stamps in it are those of the runs.

    Links are relative to it, as the address of the site is not known; the names of feed and entries
    are made of what they are about.

    Arguments:
        index: the content of ``index.json``.
    """
    feed = ElementTree.Element("feed", xmlns=_ATOM)
    _add(feed, "id", _name("feed", index["runs"][0]["run"]))
    _add(feed, "title", "femubench leaderboard")
    _add(feed, "updated", index["runs"][-1]["started"])
    _add(_add(feed, "author"), "name", "bench publish")
    _add(feed, "link", rel="self", type="application/atom+xml", href="feed.xml")
    _add(feed, "link", rel="alternate", type="text/html", href="index.html")
    for item in index["news"]:
        entry = _add(feed, "entry")
        about = (item[key] for key in ("kind", "strategy", "version", "femubench", "when"))
        _add(entry, "id", _name(*about))
        _add(entry, "title", headline_of(item))
        _add(entry, "updated", item["when"])
        _add(entry, "link", rel="alternate", type="text/html", href=item["page"])
        _add(entry, "content", _told(item), type="text")
    ElementTree.indent(feed)
    text = ElementTree.tostring(feed, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def _told(item: Mapping[str, Any]) -> str:
    """Return version and skill of who is in the news."""
    told = f"Version {plain(item['version'])}, femubench {plain(item['femubench'])}: "
    if item["skill"] is None:
        return f"{told}no result on today's files of the cases."
    sure = "" if item["low"] is None else f" (95 %: {interval(item['low'], item['high'])})"
    return f"{told}skill {fixed(item['skill'], 3, 7)}{sure} on today's cases."


def _add(
    parent: ElementTree.Element, tag: str, text: str | None = None, **attributes: str
) -> ElementTree.Element:
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = text
    return child


def _name(*parts: str) -> str:
    return uuid5(NAMESPACE_URL, "femubench:" + "\n".join(parts)).urn
