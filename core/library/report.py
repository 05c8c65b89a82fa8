"""Reports on runs, diagnoses, comparisons and reproductions, in any format: ``bench report``."""

from __future__ import annotations

import base64
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_from_json, diagnosis_to_json
from femubench.core.drawing.files import Exhibits
from femubench.core.errors import FemubenchError, InputError, PluginError
from femubench.core.files import check_writable, read_bytes, write_atomically
from femubench.core.library.cases import render_diagnosis, usable_plugins, way_of
from femubench.core.library.rank import Run as Tables, read_run, store_in
from femubench.core.plugin.apart import Origin
from femubench.core.plugin.importing import import_offer
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.validation import choose_names, unknown
from femubench.core.reproduction.study import Study, cells_to_json
from femubench.core.roles import Reporter
from femubench.core.run.store import Store
from femubench.core.schema.records import parse_json, run_from_json, to_plain
from femubench.core.schema.results import RunData
from femubench.core.score.comparison import Comparison

Reportable = RunData | Diagnosis | Comparison | Study | Sequence[Study]
SUFFIXES = {"terminal": ".txt", "markdown": ".md", "html": ".html", "json": ".json"}
_MOST_BYTES = 64 * 2**20
_DIAGNOSIS_KEYS = frozenset({"verdict", "causes", "rivals", "smallest_visible"})
SHORT = {"md": "markdown"}


def report(
    what: Reportable | str | PathLike[str] | None = None,
    file: str | PathLike[str] | None = None,
    *,
    style: str | None = None,
    store: Store | str | PathLike[str] | None = None,
) -> str | Path:
    """Return a report as text, or write it to a file and return its path.

    Arguments:
        what: a run, a diagnosis, a comparison or what `reproduce` gives; a file that ``bench run
            --json`` or ``bench diagnose --json`` wrote; a run id in the store; None for its last
            run.
        file: where it goes; its suffix tells the style.
        style: ``terminal`` (the default without a file), ``markdown``, ``html`` or ``json``; a run
            has also ``csv``, ``parquet`` and those of plugins.
        store: where runs and their drawings are kept.

    Raises:
        InputError: when it cannot be read or written, or has no such style.

    Examples:
        >>> femubench.report(run, "page.html").name
        'page.html'
    """
    path = None if file is None else Path(file)
    if path is not None:
        check_writable(path)
    found: object = what
    kept = None if store is None else store_in(store)
    if isinstance(what, (str, PathLike)) and os.path.isfile(what):
        found = diagnosis_in(Path(what)) or read_run(what)
    elif what is None or isinstance(what, (str, PathLike)):
        kept = store_in(store)
        found = read_run(what, kept)
    if isinstance(found, RunData):
        plugins, name = usable_plugins(), SHORT.get(style or "", style or "terminal")
        if style is None and path is not None:
            writer = reporter_for(plugins, path)
        else:
            writer = plugins.reporters[choose_names("report format", [name], plugins.reporters)[0]]
        content = render_report(writer, found, None if kept is None else kept.exhibits)
    else:
        ending = ".txt" if path is None else path.suffix.lower()
        by_suffix = {suffix: name for name, suffix in SUFFIXES.items()}
        if style is None and ending not in by_suffix:
            known = " or ".join(by_suffix)
            raise InputError("does not say its format", file=path, expected=f"a name with {known}")
        content = rendering(found, style or by_suffix[ending])
    if path is not None:
        write_atomically(path, content)
        return path
    if isinstance(content, bytes):
        raise InputError(f"style {style} is no text", expected="a file")
    return content


def diagnosis_in(path: Path) -> dict[str, Any] | None:
    """Return the diagnosis that a JSON file holds; None where it holds something else.

    Raises:
        InputError: when it cannot be read, or is a diagnosis with a wrong field.
    """
    expected = "what 'bench run --json' or 'bench diagnose --json' writes"
    data = parse_json(read_bytes(path, _MOST_BYTES), file=path, expected=expected)
    if not isinstance(data, dict) or not data.keys() >= _DIAGNOSIS_KEYS:
        return None
    return diagnosis_from_json(data, file=path)


def rendering(what: object, style: str) -> str:
    """Return a diagnosis (or its plain data), a comparison or studies of papers in a style.

    Raises:
        InputError: for a style that it does not have.
    """
    data: Any = what
    further: list[Any] = []
    if isinstance(data, Diagnosis):
        data = diagnosis_to_json(data, case=data.subject)
    if style not in SUFFIXES:
        raise InputError(f"there is no style {style!r}", expected=f"one of {', '.join(SUFFIXES)}")
    if isinstance(data, Mapping):
        return render_diagnosis(data, style)
    if isinstance(data, Comparison):
        way, data = "render_comparison", to_plain(data.to_json())
    else:
        way, data = "render_studies", [data] if isinstance(data, Study) else data
        further = [dict(drawings(data)) if style == "html" else {}]
    if style != "json":
        return str(way_of(style, way)(data, *further))
    plain, ascii_only = (cells_to_json(data), False) if further else (data, True)
    return json.dumps(plain, indent=1, ensure_ascii=ascii_only, allow_nan=False)


def drawings(studies: Sequence[Study]) -> Iterator[tuple[str, str]]:
    """Yield name and drawing, as SVG, of every figure of the studies."""
    from femubench.core.plot.figure import render_figure

    for study in studies:
        for figure in study.figures:
            yield figure.name, render_figure(figure)


def reporter(plugins: Plugins, name: str) -> Reporter:
    """Return the reporter of that name.

    Raises:
        PluginError: when there is none, which for a built-in name means a broken installation.
    """
    if name not in plugins.reporters:
        raise PluginError(str(unknown("report format", name, plugins.reporters)))
    return plugins.reporters[name]


def render_report(found: Reporter, run: RunData, exhibits: object = None) -> str | bytes:
    """Return a reporter's text, or its bytes where the format is no text.

    Arguments:
        exhibits: what the store has to draw of the run, for a reporter that can.

    Raises:
        PluginError: naming the reporter, whatever it raised.
    """
    as_bytes, with_exhibits = (
        getattr(found, name, None) for name in ("render_bytes", "render_with")
    )
    try:
        if callable(as_bytes):
            content = as_bytes(run)
        elif callable(with_exhibits):
            content = with_exhibits(run, exhibits)
        else:
            content = found.render(run)
    except FemubenchError:
        raise
    except Exception as error:
        what = f"reporter {found.name!r} failed: {type(error).__name__}: {error}"
        raise PluginError(what) from error
    expected = bytes if callable(as_bytes) else str
    if not isinstance(content, expected):
        raise PluginError(
            f"reporter {found.name!r} gave {type(content).__name__}, expected {expected.__name__}"
        )
    return content


def write_apart(origin: Origin, question: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the reporter of a third party writes; runs in a process of its own.

    Arguments:
        question: ``name`` of the reporter, ``way`` of writing, ``run``, folder of the ``store``.
    """
    found = import_offer(origin, "reporters", question["name"])
    run, way, store = Tables.of(run_from_json(question["run"])), question["way"], question["store"]
    further = [Exhibits(Path(store)) if store else None] if way == "render_with" else []
    content = getattr(found, way)(run, *further)
    if isinstance(content, bytes):
        return {"bytes": base64.b64encode(content).decode()}
    return {"text": content if isinstance(content, str) else None, "type": type(content).__name__}


def text_of(found: Reporter, content: str | bytes) -> str:
    """Return what a reporter gave, for the screen.

    Raises:
        InputError: for a format that is no text.
    """
    if isinstance(content, bytes):
        raise InputError(f"format {found.name} is no text", expected="a file")
    return content


def is_for_files(found: Reporter) -> bool:
    """Tell whether a format is of no use on the screen."""
    return found.name == "html" or callable(getattr(found, "render_bytes", None))


def reporter_for(plugins: Plugins, path: Path) -> Reporter:
    """Return the reporter that writes files of a path's suffix.

    Raises:
        InputError: when none does.
    """
    # Of two formats with one suffix the first, of two suffixes that fit the longer.
    suffixes = {found.suffix: found for found in reversed(list(plugins.reporters.values()))}
    for suffix, found in sorted(suffixes.items(), key=lambda item: -len(item[0])):
        if path.name.endswith(suffix):
            return found
    raise InputError(
        f"no report format has the suffix {path.suffix!r}",
        file=path,
        expected=f"one of {', '.join(sorted(suffixes))}",
    )


def run_name(run: RunData) -> str:
    """Return the run's id as it may stand in a file name."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", str(run.meta.get("run", "run"))).strip(".-") or "run"
