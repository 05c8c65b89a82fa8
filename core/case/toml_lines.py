"""Which line of a TOML text holds which key: what `tomllib` does not tell."""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_right

from femubench.core.case.faults import KeyPath

_BLANK = re.compile(r"[ \t\r\n]*(?:#[^\n]*[ \t\r\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_ONE_LINE = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_MANY_LINES = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}', re.DOTALL)
_SCALAR = re.compile(r"[^,\]}#\n]*")


def key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line, from 1, of every key and list entry of a valid TOML text."""
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


def line_of(lines: dict[KeyPath, int], path: KeyPath) -> int | None:
    """Return the line of a key path, or of the nearest table above it that has one."""
    while path:
        if path in lines:
            return lines[path]
        path = path[:-1]
    return None


class _Scanner:
    """Walks over a text that `tomllib` has accepted and notes where keys stand."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.breaks = [i for i, letter in enumerate(text) if letter == "\n"]
        self.lines: dict[KeyPath, int] = {}
        self.counts: dict[KeyPath, int] = {}

    def note(self, path: KeyPath, position: int) -> None:
        self.lines.setdefault(path, bisect_right(self.breaks, position) + 1)

    def skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        found = match.group() if match else ""
        self.at += len(found)
        return found

    def peek(self, length: int = 1) -> str:
        return self.text[self.at : self.at + length]

    def document(self) -> None:
        table: KeyPath = ()
        self.skip(_BLANK)
        while self.at < len(self.text):
            if self.peek() == "[":
                table = self.header()
            else:
                self.pair(table)
            self.skip(_BLANK)

    def header(self) -> KeyPath:
        start, listed = self.at, self.peek(2) == "[["
        self.at += 2 if listed else 1
        *above, last = self.key()
        self.at += 2 if listed else 1
        path: KeyPath = ()
        for part in above:
            path = self.newest((*path, part))
        path = (*path, last)
        if listed:
            self.counts[path] = self.counts.get(path, 0) + 1
        self.note(path, start)
        path = self.newest(path)
        self.note(path, start)
        return path

    def newest(self, path: KeyPath) -> KeyPath:
        """Return the path of a table, or of the last entry of a list of tables."""
        return (*path, self.counts[path] - 1) if path in self.counts else path

    def key(self) -> list[str]:
        parts = []
        while True:
            self.skip(_BLANK)
            quoted = self.peek() in ("'", '"')
            raw = self.skip(_ONE_LINE if quoted else _BARE)
            parts.append(tomllib.loads(f"k = {raw}")["k"] if quoted else raw)
            self.skip(_BLANK)
            if self.peek() != ".":
                return parts
            self.at += 1

    def pair(self, table: KeyPath) -> None:
        start = self.at
        path = table
        for part in self.key():
            path = (*path, part)
            self.note(path, start)
        self.at += 1  # the equals sign
        self.value(path)

    def value(self, path: KeyPath) -> None:
        self.skip(_BLANK)
        opening = self.peek()
        if opening in ("[", "{"):
            self.at += 1
            self.entries(path, "]" if opening == "[" else "}")
        elif self.peek(3) in ('"""', "'''"):
            self.skip(_MANY_LINES)
        else:
            self.skip(_ONE_LINE if opening in ("'", '"') else _SCALAR)

    def entries(self, path: KeyPath, closing: str) -> None:
        """Walk over the entries of a list or of an inline table."""
        index = 0
        self.skip(_BLANK)
        while self.peek() != closing and self.at < len(self.text):
            if closing == "]":
                self.note((*path, index), self.at)
                self.value((*path, index))
                index += 1
            else:
                self.pair(path)
            self.skip(_BLANK)
            if self.peek() == ",":
                self.at += 1
                self.skip(_BLANK)
        self.at += 1
