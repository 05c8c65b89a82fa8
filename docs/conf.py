"""How `make docs` builds the site: Sphinx reads docs/*.md, the texts at the root, and docstrings.

The source folder is the root of the repository, so that every link between the texts leads to the
same place on the site as in a clone. Pages of the API are written into docs/api/ before each build,
one for every module of public names that there is.
"""

from __future__ import annotations

import inspect
import os
import re
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

from sphinx.application import Sphinx
from sphinx.util.inspect import TypeAliasForwardRef

DOCS = Path(__file__).parent
ROOT = DOCS.parent
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(ROOT))

import femubench  # noqa: E402 - from this clone, whatever else is installed

# The modules of public names: the package itself, then its own modules in the order of the work.
_ORDER = ["fem", "modal", "update", "effect", "diagnosis", "results", "plot"]
_FOUND = [m.name for m in iter_modules(femubench.__path__) if not m.ispkg and m.name[0] != "_"]
MODULES = [
    "femubench",
    *(f"femubench.{name}" for name in _ORDER if name in _FOUND),
    *(f"femubench.{name}" for name in _FOUND if name not in _ORDER),
]

project = "femubench"
author = "The femubench developers"
version = release = femubench.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "docs/index"
include_patterns = [
    *("*.md", "docs/*.md", "docs/development/*.md", "docs/api/*.rst"),
    *("scenarios/*/README.md", "scenarios/*/*/README.md"),
]
exclude_patterns = ["build", "femubench", ".*"]

myst_heading_anchors = 4
myst_links_external_new_tab = False
default_role = "code"  # docstrings write `name`, as Markdown does
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name
    for name in (
        *("AnyArray", "BoolArray", "FloatArray", "IntArray", "SparseArray"),
        "Coefficients",
    )
}
# Inside another type, as in tuple[FloatArray, ...], Sphinx writes the repr of an alias.
TypeAliasForwardRef.__repr__ = lambda self: self.name  # type: ignore[method-assign]
python_maximum_signature_line_length = 80
python_use_unqualified_type_names = True
add_module_names = False
# A type in a signature that is public under two names leads to one of them; which one is no fault.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"femubench {version}"
html_copy_source = False
html_extra_path = ["site"]  # index.html, which leads from the root of the site to docs/index.html
pygments_style, pygments_dark_style = "friendly", "monokai"


def public_names(module: ModuleType) -> list[str]:
    """Return the public names of a module in the order of its `__all__`."""
    listed = getattr(module, "__all__", None)
    helpers = {"TYPE_CHECKING", "Any", "annotations", "import_module"}
    return listed or [n for n in dir(module) if not n.startswith("_") and n not in helpers]


def entry(module: ModuleType, name: str) -> str:
    """Return the directive that documents one public name."""
    value = getattr(module, name)
    if isinstance(value, type):
        return f".. autoclass:: {module.__name__}.{name}\n   :members:\n"
    if inspect.isroutine(value):
        return f".. autofunction:: {module.__name__}.{name}\n"
    text = " ".join(repr(value).split())
    shown = f"   :value: {text}\n" if len(text) < 60 else ""
    return f".. py:data:: {module.__name__}.{name}\n{shown}"


def write_api(app: Sphinx) -> None:
    """Write docs/api/: a page for every module of public names."""
    folder = DOCS / "api"
    folder.mkdir(exist_ok=True)
    pages = {}
    for name in MODULES:
        module = import_module(name)
        heading = f"`{name}`"
        entries = [entry(module, public) for public in public_names(module)]
        about = inspect.getdoc(module) or ""
        pages[f"{name}.rst"] = "\n".join([heading, "=" * len(heading), "", about, "", *entries])
    for stale in folder.iterdir():
        if stale.name not in pages:
            stale.unlink()
    for file, text in pages.items():
        path = folder / file
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def add_navigation(app: Sphinx, docname: str, source: list[str]) -> None:
    """Turn the headings and links of docs/index.md into the navigation of the site.

    The page then reads as well in a repository as on the site, and says its order once. The pages
    of the scenarios come below docs/scenarios.md, which links to them.
    """
    if docname == root_doc:
        api = "".join(f"[{name}](api/{name}.rst)\n" for name in MODULES)
        sections = f"{source[0]}\n## API reference\n{api}".split("\n## ")[1:]
    elif docname == "docs/scenarios":
        links = re.findall(r"\[[^\]]+\]\(\.\./scenarios/[^)]+\)", source[0])
        sections = ["\n".join(["Scenarios", *links])]
    else:
        return
    for section in sections:
        caption, _, body = section.partition("\n")
        links = re.findall(r"\[([^\]]+)\]\(([\w./-]+)\.(?:md|rst)\)", body)
        entries = {page: f"{text.replace('`', '')} <{page}>" for text, page in reversed(links)}
        tree = "\n".join(reversed(entries.values()))
        source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{tree}\n```\n"


def as_restructured_text(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Escape what is plain text in a docstring of ours and markup to Sphinx, such as |x|."""
    plain, mark, examples = "\n".join(lines).partition("\nExamples:\n")
    text = re.sub(r"(`[^`]*`)(\w?)|[|*\\]|(?<=\w)_(?!\w)", _escaped, plain) + mark + examples
    lines[:] = re.sub(r"^Source: ", "**Source:** ", text, flags=re.MULTILINE).split("\n")


def _escaped(match: re.Match[str]) -> str:
    if match[1]:  # `Case`s
        return f"{match[1]}\\ {match[2]}" if match[2] else match[0]
    return f"\\{match[0]}"


def setup(app: Sphinx) -> None:
    """Connect the steps of this build."""
    app.connect("builder-inited", write_api)
    app.connect("source-read", add_navigation)
    app.connect("autodoc-process-docstring", as_restructured_text, priority=400)  # 500: napoleon
