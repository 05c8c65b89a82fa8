"""Keep a static site of published runs: read all, build it next to the old one, swap."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from femubench.core.errors import InputError, OutputError, harmless
from femubench.core.files import MIB, read_text, resolve_path
from femubench.core.publish.board import index_of
from femubench.core.publish.submissions import SCHEMA, Proof, Submission, Verify, read_submission
from femubench.core.schema.records import parse_json

MARKER = "femubench-site.json"
KIND = "femubench leaderboard"
DATA = "data"
MOST_RUNS, MOST_RESULTS = 1_000, 200_000
# What publish makes; everything else in the folder, such as .git or CNAME, is somebody's and stays.
_FILES = ("index.html", "index.json", "leaderboard.csv", "leaderboard.md", "site.css", "site.js")
OWN = (MARKER, DATA, *_FILES, "feed.xml", "feed.json", "strategies", "cases", "classes")
_ADDRESS = re.compile(r"(https?://[^\s\"'<>\\?#/][^\s\"'<>\\?#]*)?")
# A folder with nothing but these counts as empty.
_SPARE = frozenset({".git", ".nojekyll", "CNAME", ".gitignore", ".gitattributes"})
Render = Callable[[Mapping[str, Any]], Mapping[str, str]]


@dataclass(frozen=True)
class Published:
    """What a call of `publish` did.

    Arguments:
        added: names of the data files that are new.
        index: what ``index.json`` holds.
    """

    added: tuple[str, ...]
    index: Mapping[str, Any]


def publish(
    folder: Path,
    files: Sequence[Path],
    render: Render,
    verify: Verify | None = None,
    *,
    unverified: bool = True,
    address: str | None = None,
) -> Published:
    """Merge result files into the site in a folder, all of them or none.

    Arguments:
        folder: made by this function, empty, or not there yet.
        files: what ``bench run --json`` wrote.
        render: from the content of ``index.json`` to the pages by relative name.
        verify: checks what can be checked of a run.
        unverified: whether to take, marked as such, what that refuses.
        address: where the site will be found; None for what it was given before.

    Raises:
        InputError: for a file that is not sound, a folder with something else in it, or an address
            that is none.
        OutputError: where the site cannot be written; then it is as it was.
    """
    folder = resolve_path(folder)
    # Its files are read as carefully as those that anybody sends.
    check_site(folder)
    data = folder / DATA
    names = sorted(path for path in data.glob("*.json")) if data.is_dir() else []
    old = [read_submission(path, published=True) for path in names]
    marker, stated = folder / MARKER, address
    if stated is None and marker.exists():
        stated = parse_json(read_text(marker, MIB), file=marker, expected=KIND).get("address")
    if not _ADDRESS.fullmatch(stated := str(stated or "")):
        expected = "http or https, without a query"
        raise InputError(f"{harmless(stated)!r} is no address of a site", expected=expected)
    home = f"{stated.rstrip('/')}/" if stated else ""
    merged = _merge_runs([*old, *(_submission(file, verify, unverified) for file in files)])
    index = {**index_of(merged), "address": home}
    pages = {
        **render(index),
        **{f"{DATA}/{item.name}": item.text for item in merged},
        "index.json": json.dumps(index, indent=1, sort_keys=True, allow_nan=False) + "\n",
        MARKER: json.dumps({"kind": KIND, "schema": SCHEMA, "address": home}) + "\n",
    }
    try:
        _replace(folder, pages)
    except OSError as error:
        raise OutputError(folder, error) from error
    known = {item.name for item in old}
    return Published(tuple(item.name for item in merged if item.name not in known), index)


def _submission(file: Path, verify: Verify | None, unverified: bool) -> Submission:
    """Return a new file, checked or, where that may be, marked as unverified."""
    try:
        return read_submission(file, verify)
    except InputError:
        if not unverified:
            raise
    return read_submission(file)


def check_site(folder: Path) -> None:
    """Check that a folder may become a site or is one.

    Raises:
        InputError: when it is a file or holds what publish has not made.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise InputError("is a file", file=folder, expected="a folder")
    inside = {path.name for path in folder.iterdir()}
    if MARKER not in inside:
        if inside <= _SPARE:
            return
        what = f"not made by bench publish: there is {sorted(inside - _SPARE)[0]!r}"
        expected = "a new or empty folder, or one that bench publish made"
        raise InputError(what, file=folder, expected=expected)
    file = folder / MARKER
    data = parse_json(read_text(file, MIB), file=file, expected="what bench publish writes")
    if not isinstance(data, dict) or data.get("kind") != KIND:
        raise InputError("no site", file=file, key="kind", expected=repr(KIND))
    if data.get("schema") != SCHEMA:
        what = f"schema {data.get('schema')!r}"
        raise InputError(what, file=file, key="schema", expected=str(SCHEMA))


def _merge_runs(submissions: Iterable[Submission]) -> list[Submission]:
    """Return every run once, whatever order they came in.

    A run that another file of the same run holds whole, as one made before it was resumed or was
    checked, or by a version that kept less of it, is left out.
    """
    unique = {item.name: item for item in submissions}
    listed = sorted(unique.values(), key=lambda item: item.order)
    parts = {
        item.name: frozenset(
            json.dumps(one, sort_keys=True) for one in json.loads(item.text)["results"]
        )
        for item in listed
    }

    order = get_args(Proof).index

    def within(item: Submission, other: Submission) -> bool:
        if item.run.meta["run"] != other.run.meta["run"]:
            return False
        if (parts[item.name], item.proof) == (parts[other.name], other.proof):
            return (len(item.text), item.name) < (len(other.text), other.name)
        return parts[item.name] <= parts[other.name] and order(item.proof) <= order(other.proof)

    kept = [item for item in listed if not any(within(item, other) for other in listed)]
    results = sum(len(item.run.results) for item in kept)
    if len(kept) > MOST_RUNS or results > MOST_RESULTS:
        what = f"{len(kept)} runs with {results} results"
        raise InputError(what, expected=f"at most {MOST_RUNS} runs and {MOST_RESULTS} results")
    return kept


def _replace(folder: Path, pages: Mapping[str, str]) -> None:
    """Write a folder next to the old one and let them change places.

    Whatever happens on the way, the old site is there whole, or the new one is.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    room = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        new, old = room / "new", room / "old"
        new.mkdir()
        for name, text in pages.items():
            path = new / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode("utf-8"))
        if folder.exists():
            new.chmod(folder.stat().st_mode & 0o7777)
            folder.rename(old)
            try:
                new.rename(folder)
            except OSError:
                old.rename(folder)
                raise
            for path in sorted(old.iterdir()):
                if path.name not in OWN:
                    os.rename(path, folder / path.name)
        else:
            new.rename(folder)
    finally:
        # Somebody else's files may still be in there.
        old = room / "old"
        if not old.exists() or all(path.name in OWN for path in old.iterdir()):
            shutil.rmtree(room, ignore_errors=True)
