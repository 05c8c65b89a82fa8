"""docs/tutorial.md, executed word for word in a fresh virtual environment.

The text is followed in one shell: a line that begins with ``$`` is a command and must succeed; the
lines below it must appear in what it prints, in order, where ``...`` stands for anything. Blocks of
code are files, named by the comment in their first line.
"""

from __future__ import annotations

import os
import re
import resource
import secrets
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs" / "tutorial.md"
ROOMS = ("core", "femubench", "papers", "plugins", "reports", "scenarios")
ENDLESS = 600  # s of a processor, for one command of the tutorial
CACHES = shutil.ignore_patterns("__pycache__", "*.egg-info")


@dataclass(frozen=True)
class Command:
    """A line to type, and what must be seen after it."""

    line: str
    output: tuple[str, ...]


@dataclass(frozen=True)
class File:
    """A file to write, relative to where the reader is."""

    name: str
    text: str


def steps(text: str) -> Iterator[Command | File]:
    """Return what a tutorial asks for, in order."""
    for language, block in re.findall(r"^```(\w+)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        if language == "console":
            yield from commands(block)
        else:
            first, _, rest = block.partition("\n")
            assert first.startswith("# "), f"block without the name of its file: {first}"
            yield File(first.removeprefix("# "), rest)


def commands(block: str) -> Iterator[Command]:
    """Return the commands of a block with the output quoted below each."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        line, *output = part.rstrip("\n").split("\n")
        yield Command(line, tuple(output))


def missing(quoted: tuple[str, ...], printed: str) -> str:
    """Return the first quoted line that was not printed below those before it, blanks alike."""
    lines = iter([" ".join(line.split()) for line in printed.splitlines()])
    for quote in quoted:
        wanted = [re.escape(" ".join(part.split())) for part in quote.split("...")]
        pattern = re.compile(".*".join(wanted))
        if quote.strip() not in ("", "...") and not any(map(pattern.search, lines)):
            return quote
    return ""


class Shell:
    """A shell in which commands are typed one after the other."""

    def __init__(self, folder: Path, env: dict[str, str]) -> None:
        self.folder = folder
        self.process = subprocess.Popen(
            ["/bin/bash", "--norc"],
            cwd=folder,
            env=env,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            encoding="utf-8",
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (ENDLESS, ENDLESS)),
        )

    def type(self, line: str) -> tuple[int, str]:
        """Return the exit code of a command and all that it printed."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        mark = f"done-{secrets.token_hex(8)}"
        # What the command might read must not be the next command.
        self.process.stdin.write(f"{{ {line}\n}} </dev/null; code=$?; echo; echo {mark} $code\n")
        self.process.stdin.flush()
        printed: list[str] = []
        for answer in self.process.stdout:
            if answer.startswith(mark):
                return int(answer.split()[1]), "".join(printed)
            printed.append(answer)
        raise AssertionError(f"the shell ended after: {line}\n{''.join(printed)}")

    def where(self) -> Path:
        """Return the folder in which the reader is now."""
        return Path(self.type("pwd")[1].strip())

    def close(self) -> None:
        """End the shell."""
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def shell(tmp_path: Path) -> Iterator[Shell]:
    """Return a shell next to a copy of the sources, with python3 and without our own packages."""
    sources = tmp_path / "femubench"
    for room in ROOMS:
        # A copy: pip leaves its build folders in the tree that it installs.
        shutil.copytree(ROOT / room, sources / room, symlinks=True, ignore=CACHES)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, sources)
    tools = tmp_path / "tools"
    tools.mkdir()
    python = tools / "python3"
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n', encoding="utf-8")
    python.chmod(0o755)
    ours = ("PYTHON", "PYTEST", "VIRTUAL_ENV", "FEMUBENCH", "COV_", "COLUMNS", "FORCE_COLOR")
    env = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    env |= {"PATH": f"{tools}:/usr/bin:/bin", "PIP_QUIET": "1", "NO_COLOR": "1"}
    opened = Shell(tmp_path, env)
    yield opened
    opened.close()


@pytest.mark.nightly
def test_every_line_of_the_tutorial(shell: Shell) -> None:
    text = TUTORIAL.read_text(encoding="utf-8")
    # A block that is no step is not passed over in silence.
    assert text.count("```") == 2 * len(re.findall(r"^```(?:console|python)$", text, re.MULTILINE))
    for step in steps(text):
        if isinstance(step, File):
            target = shell.where() / step.name
            assert target.is_file(), f"the tutorial replaces {step.name}, which is not there"
            target.write_text(step.text, encoding="utf-8")
            continue
        code, printed = shell.type(step.line)
        if code and step.line.startswith("pip install"):
            pytest.fail(f"{step.line}: needs a package index or pip's cache\n{printed}")
        assert code == 0, f"$ {step.line}\n{printed}"
        lost = missing(step.output, printed)
        assert not lost, f"$ {step.line}\nnever printed: {lost}\nbut:\n{printed}"
