"""No name of a particular effect, strategy or scenario stands in the core or in the reports."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from femubench.core.conformance.checking import subjects
from femubench.core.plugin.loader import Plugins, load_plugins

ROOT = Path(__file__).parents[1]
SUFFIXES = (".py", ".js", ".html", ".jinja")
# Words of models and of English that are names too, and what a line says that may have them.
ALLOWED = {
    # kind of model, a method, axes of a test
    "frame": r"kind\b|'frame' or 'matrices'|`parameters` and `frame`|axes|directions|ways",
    "density": r"rhoA|\"E\"",  # a quantity of elements, next to the others
    # likewise, and a symbol in drawings
    "spring": r"quantity|properties|lookup|weights|name|property|rigid|: \(\)|counted|marker|stiff"
    r"|symbol|\"mass\"|\"N/m\"",
    "offset": r"`offset` \(global",  # where a point mass sits
    "hframe": r"\"hframe\": _hframe",  # a structure of the challenge; in its seeds
    # the model with handbook values, and where a value of a cause comes from
    "textbook": r"[nN]ominal|handbook|record|: \[|_CAUSE_COLUMNS|source =|start|yardstick|both"
    r"|[mM]odels|item\.get|item\[",
    "physical": r"\"unphysical\"",  # a label next to its contrary
}


def names_of(plugins: Plugins) -> set[str]:
    cases = {case for scenario in plugins.scenarios.values() for case in scenario.cases}
    return {*plugins.effects, *plugins.faults, *plugins.strategies, *plugins.scenarios, *cases}


def found_in(text: str, names: set[str]) -> Iterator[tuple[int, str]]:
    """Return line numbers and names: in quotes of any kind, those with a dash also without."""
    quoted = re.compile("[\"'`](" + "|".join(map(re.escape, names)) + ")[\"'`]")
    dashed = "|".join(re.escape(name) for name in sorted(names, key=len)[::-1] if "-" in name)
    bare = re.compile(rf"(?<![\w-])({dashed})(?![\w-])")
    for number, line in enumerate(text.splitlines(), start=1):
        for match in (*quoted.finditer(line), *bare.finditer(line)):
            name = match[1]
            if name not in ALLOWED or not re.search(ALLOWED[name], line):
                yield number, name


def test_core_and_reports_know_no_plugin_by_name() -> None:
    names = names_of(load_plugins())
    assert len(names) > 40
    # What `bench plugins new` writes is a third party's, who may name what to compare with.
    written = ROOT / "core" / "library" / "templates"
    files = [p for room in ("core", "reports") for p in (ROOT / room).rglob("*")]
    files = [path for path in files if path.parent != written and path.parent.name != "vendor"]
    texts = {p: p.read_text(encoding="utf-8") for p in files if p.suffix in SUFFIXES}
    assert len(texts) > 150
    met = [
        f"{path.relative_to(ROOT)}:{number}: {name}"
        for path, text in sorted(texts.items())
        for number, name in found_in(text, names)
    ]
    assert met == []


def test_the_search_itself_finds_names() -> None:
    names = {"kabe-rigid", "frame", "density", "unchanged"}
    text = "x = 'unchanged'\nkind = \"frame\"\nlike kabe-rigid, said\ny = `frame`\nnot-kabe-rigid-2"
    assert list(found_in(text, names)) == [(1, "unchanged"), (3, "kabe-rigid"), (4, "frame")]


def test_baseline_and_cost_reference_are_roles_that_one_strategy_each_has() -> None:
    plugins = load_plugins()
    found = plugins.strategies.values()
    assert [s.name for s in found if s.baseline] == ["unchanged"]
    assert [s.name for s in found if s.cost_reference] == ["physical"]
    (subject,) = subjects("berman", plugins)
    assert subject.bench.reference is plugins.strategies["physical"]
    other = Plugins(strategies={"berman": plugins.strategies["berman"]})
    assert subjects("berman", other)[0].bench.reference is None
