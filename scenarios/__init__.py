"""The built-in scenarios: one folder each, with a README on where every number comes from."""

from __future__ import annotations

import atexit
import os
import shutil
import tomllib
from functools import cache, partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from femubench import InputError, Scenario, hookimpl

HERE = Path(__file__).parent
SUITE, TESTS, RESPONSES = (HERE / name for name in ("suite", "tests", "suite-responses"))
OWN_FILES = "FEMUBENCH_TESTS"  # the folder of files that are read where the user keeps them


def _cases(folder: Path, name: str) -> dict[str, Path]:
    """Return the scenario's own case, or those of its sub-folders."""
    if (folder / "case.toml").is_file():
        return {name: folder}
    parts = sorted(path.parent for path in folder.glob("*/case.toml"))
    return {f"{name}/{part.name}": part for part in parts}


def _listed(folder: Path, group: str = "") -> list[Scenario]:
    """Return the scenarios that a folder's table lists; none without it."""
    table = folder / f"{folder.name}.toml"
    listed = tomllib.loads(table.read_text(encoding="utf-8")) if table.is_file() else {}
    return [
        Scenario(
            f"{group}{name}",
            item["title"],
            {f"{group}{name}": partial(_read_in_place, folder / name, **item["reads"])}
            if "reads" in item
            else _cases(folder / name, f"{group}{name}"),
            tuple(item["classes"]),
            item["default"],
        )
        for name, item in listed.items()
    ]


def _read_in_place(folder: Path, file: str, origin: str) -> Path:
    """Return a case folder, gone when the process ends, with the user's own copy of a file.

    Raises:
        InputError: when the file is not below the folder that the environment names.
    """
    named = os.environ.get(OWN_FILES)
    found = sorted(Path(named).expanduser().rglob(file)) if named else []
    if not found:
        what = f"{OWN_FILES} names no folder with {file}"
        raise InputError(what, expected=f"a copy of {origin}")
    return _joined(folder, found[0].resolve())


@cache
def _joined(folder: Path, own: Path) -> Path:
    made = TemporaryDirectory(prefix=f"femubench-{folder.name}-")
    atexit.register(made.cleanup)
    for path in (own, *folder.iterdir()):
        shutil.copy(path, made.name)
    return Path(made.name)


def _footbridge() -> Path:
    """Return the case folder made of the user's own copy of the footbridge's data."""
    # Names are listed without what reads data.
    from femubench.scenarios.matlab_footbridge import case_folder

    return case_folder()


@hookimpl
def femubench_scenarios() -> list[Scenario]:
    """Return the built-in scenarios."""
    footbridge = Scenario(
        "footbridge",
        "Steel pedestrian bridge, published test; needs FEMUBENCH_FOOTBRIDGE",
        {"footbridge": _footbridge},
        ("bridge", "matrices", "soft supports", "published test"),
        default=False,
    )
    groups = [_listed(folder, f"{folder.name}/") for folder in (TESTS, SUITE, RESPONSES)]
    return [*_listed(HERE), *chain.from_iterable(groups), footbridge]
