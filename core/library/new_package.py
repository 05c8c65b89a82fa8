"""Write a package folder to start a plugin from: ``bench plugins new``."""

from __future__ import annotations

import builtins
import keyword
import re
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femubench.core.case.drawn import CASE_FILE
from femubench.core.case.example import write_example
from femubench.core.case.writing import new_folder
from femubench.core.errors import InputError
from femubench.core.plugin import validation
from femubench.core.plugin.markers import PROJECT

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins

# What can be written, and one line on it.
KINDS: Mapping[str, str] = {
    "strategy": "An updating strategy for femubench",
    "effect": "A cause that a model can lack, for the diagnosis of femubench",
    "scenario": "A measured structure as a scenario for femubench",
    "reader": "A reader of measured modes for femubench",
}
# Path in the package: template.
_COMMON = {
    "pyproject.toml": "pyproject.toml",
    "README.md": "README.md",
    ".gitignore": "gitignore",
    ".github/workflows/ci.yml": "ci.yml",
}
_FURTHER = {
    "strategy": {
        "tests/structure.py": "strategy_structure.py",
        "tests/test_speed.py": "strategy_speed.py",
    },
    "reader": {
        "tests/case/case.toml": "reader_case.toml",
        "tests/case/modes.json": "reader_modes.json",
    },
}
# Words, as the names of distributions, modules and everything on the command line are made of.
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_EXPECTED = "a word of lower-case letters, digits and dashes that begins with a letter"
_LONGEST = 40
_TEMPLATES = Path(__file__).parent / "templates"


def write_package(name: str, kind: str, output: Path, plugins: Plugins) -> tuple[Path, ...]:
    """Write a pip-installable package with one working plugin, its test, README and CI.

    Arguments:
        name: of the distribution, the folder and the plugin; the module has underscores.
        kind: a key of `KINDS`.
        output: an existing folder; the package becomes a folder in it.
        plugins: what there is already, whose names are taken.

    Returns:
        The files, in a folder that appears complete or not at all.

    Raises:
        InputError: for a name that cannot be used, or a folder that cannot be written.
    """
    check_name(name, kind, plugins)
    folder = output / name
    if not output.is_dir():
        raise InputError("folder does not exist", file=folder.parent, expected="an existing folder")
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise InputError("is in the way", file=folder, expected="no such file, or an empty folder")
    with new_folder(folder) as fresh:
        for path, text in _files(name, kind, trial_of(name, plugins)):
            target = fresh / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        if kind == "scenario":
            _write_case(fresh / "src" / module_of(name) / "case", name)
    return tuple(sorted(path for path in folder.rglob("*") if path.is_file()))


def trial_of(name: str, plugins: Plugins) -> str:
    """Return the command that runs a strategy and the baseline on the first scenario."""
    scenario = next(iter(plugins.scenarios), "")
    others = [s.name for s in plugins.strategies.values() if getattr(s, "baseline", False)]
    return " ".join(["bench", "run", scenario, *(f"-s {word}" for word in (name, *others))])


def module_of(name: str) -> str:
    """Return the name of the Python package."""
    return name.replace("-", "_")


def check_name(name: str, kind: str, plugins: Plugins) -> None:
    """Make sure that a name can be one of a distribution, a module and a plugin.

    Raises:
        InputError: with what stands against it.
    """
    if not _NAME.fullmatch(name) or len(name) > _LONGEST:
        if len(name) > _LONGEST:
            raise InputError("the name is too long", expected=f"{_LONGEST} characters at most")
        better = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
        hint = f", e.g. {better}" if _NAME.fullmatch(better) else ""
        raise InputError(f"{name!r} is not a package name", expected=f"{_EXPECTED}{hint}")
    if fault := _fault_of(name, kind, plugins):
        raise InputError(f"the name {name!r} cannot be used: {fault}", expected="another name")


def _fault_of(name: str, kind: str, plugins: Plugins) -> str:
    """Return what stands against a well-formed name; empty where nothing does."""
    module, taken = module_of(name), getattr(plugins, validation.KINDS[kind])
    if keyword.iskeyword(module):
        return "it is a keyword of Python"
    if module == PROJECT:
        return "it is the name of this program"
    if f"tests/{module}.py" in _FURTHER.get(kind, {}):
        return "a file of the package's own tests has it"
    if module in sys.stdlib_module_names:
        return "it is a module of Python's standard library"
    if name in taken:
        return f"there is a {kind} of that name (bench plugins show {name})"
    try:
        # Installing a second distribution of that name would remove the first.
        return f"{distribution(name).name} is installed, which is a different package"
    except PackageNotFoundError:
        pass
    found = find_spec(module)
    # A folder without __init__.py in the working directory counts as a module without origin.
    return f"a module {module} is installed" if found is not None and found.origin else ""


def _files(name: str, kind: str, trial: str) -> Iterator[tuple[str, str]]:
    """Return the path of every file that comes from a template, and its text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    room = Environment(
        loader=PackageLoader("femubench.core.library"),
        autoescape=False,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    module = module_of(name)
    templates = {
        **_COMMON,
        f"src/{module}/__init__.py": f"{kind}.py",
        f"tests/test_{module}.py": f"{kind}_test.py",
        **_FURTHER.get(kind, {}),
    }
    words: dict[str, Any] = {
        "name": name,
        "kind": kind,
        "module": module,
        "cls": _class_of(name, kind),
        "description": KINDS[kind],
        "trial": trial,
    }
    for path, template in templates.items():
        yield path, room.get_template(f"{template}.jinja").render(words)


def _class_of(name: str, kind: str) -> str:
    """Return a name for the class that no import of the template and no built-in has."""
    word = "".join(part.capitalize() for part in name.split("-"))
    sources = (path.read_text(encoding="utf-8") for path in _TEMPLATES.glob("*.py.jinja"))
    taken = {*dir(builtins), *(found for text in sources for found in re.findall(r"\w+", text))}
    return f"{word}{kind.capitalize()}" if word in taken or keyword.iskeyword(word) else word


def _write_case(folder: Path, name: str) -> None:
    """Write the example case under another name."""
    write_example(folder)
    case = folder / CASE_FILE
    text = case.read_text(encoding="utf-8")
    case.write_text(text.replace('name = "portal"', f'name = "{name}"', 1), encoding="utf-8")
