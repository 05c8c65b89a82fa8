"""Plugins are loaded from real distributions; what is broken is named and touches nothing else."""

from __future__ import annotations

import importlib
import re
import sys
import textwrap
from collections.abc import Iterator
from importlib.metadata import EntryPoint, distributions
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from distributions import install_metadata

from femubench import (
    Measurement,
    Model,
    Scenario,
    Strategy,
    UpdateResult,
    hookimpl,
    solve_modes,
)
from femubench.core import roles
from femubench.core.case.reader import read_case
from femubench.core.errors import PluginError
from femubench.core.plugin import hookspecs
from femubench.core.plugin.importing import HOOKS
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.plugin.validation import (
    check_effect,
    check_reader,
    check_reporter,
    check_scenario,
    check_strategy,
)

ROOT = Path(__file__).parents[1]

GOOD = """
    from femubench import Strategy, UpdateResult, hookimpl

    class Nothing(Strategy):
        name = "{name}"
        citation = "A. Author 2001, On doing nothing, (1)"

        def update(self, model, measurement, rng):
            return UpdateResult(model)

    @hookimpl
    def femubench_strategies():
        return [Nothing]
"""


def distribution(folder: Path, name: str, source: str, *, version: str = "1.0") -> None:
    """Put an installed distribution with one plugin module there, as pip would."""
    module = f"{name.replace('-', '_')}_plugin"
    (folder / f"{module}.py").write_text(textwrap.dedent(source), encoding="utf-8")
    install_metadata(folder, name, {f"{name}-entry": module}, version)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


def from_site(site: Path) -> Plugins:
    """Load the plugins of one folder, by their real metadata."""
    found = sorted(distributions(path=[str(site)]), key=lambda dist: dist.name)
    return load_plugins([point for dist in found for point in dist.entry_points])


def test_third_party_loads_next_to_broken_ones(site: Path) -> None:
    distribution(site, "fine-one", GOOD.format(name="nothing-at-all"))
    distribution(site, "no-import", "import a_module_that_nobody_has\n")
    distribution(site, "exits", "import sys\nsys.exit(3)\n")
    distribution(site, "typo", GOOD.format(name="typo").replace("_strategies", "_stratgies"))
    distribution(
        site, "wants", GOOD.format(name="wants").replace("strategies()", "strategies(rng)")
    )
    # through the entry-point group of the whole environment, as `bench` does
    plugins = load_plugins()
    assert isinstance(plugins.strategies["nothing-at-all"], roles.StrategyRole)
    assert "fine_one_plugin" not in sys.modules
    assert not {"typo", "wants"} & set(plugins.strategies)
    faults = {fault.plugin: fault for fault in plugins.broken}
    assert set(faults) >= {"no-import-entry", "exits-entry", "typo-entry", "wants-entry"}
    assert faults["no-import-entry"].distribution == "no-import 1.0"
    assert "a_module_that_nobody_has" in faults["no-import-entry"].message
    assert "no_import_plugin.py" in faults["no-import-entry"].traceback
    assert "SystemExit" in faults["exits-entry"].message
    assert faults["typo-entry"].hook == "femubench_stratgies"
    assert "did you mean 'femubench_strategies'" in faults["typo-entry"].message
    assert faults["wants-entry"].hook == "femubench_strategies"
    assert "rng" in faults["wants-entry"].message
    for fault in faults.values():
        assert "\n" not in str(fault)
        assert fault.plugin in str(fault)


def test_third_party_cannot_take_a_builtin_name(site: Path) -> None:
    """`aaa` sorts before `femubench`, and who takes its name has not its rights."""
    distribution(site, "aaa", GOOD.format(name="unchanged"))
    distribution(site, "femubench", GOOD.format(name="unchanged"))
    own = EntryPoint("strategies", "femubench.plugins.strategies", "femubench")
    found = [point for dist in distributions(path=[str(site)]) for point in dist.entry_points]
    plugins = load_plugins([*found, own])
    assert [plugin.plugin for plugin in plugins.loaded] == [
        "strategies", "aaa-entry", "femubench-entry",
    ]  # fmt: skip
    assert [plugin.own for plugin in plugins.loaded] == [True, False, False]
    assert [fault.plugin for fault in plugins.broken] == ["aaa-entry", "femubench-entry"]
    assert not {"aaa_plugin", "femubench_plugin"} & set(sys.modules)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("return None", "None instead of a list"),
        ("return 3", "returned 3 instead of a list"),
        ("return 'baruch'", "returned 'baruch' instead of a list"),
        ("raise RuntimeError('no licence')", "RuntimeError: no licence"),
        ("raise SystemExit", "SystemExit"),
        ("yield Nothing\n        raise OSError('half way')", "OSError: half way"),
        ("return [object()]", "a object is not a femubench.Strategy: update() is missing"),
        ("return [Strategy]", "class Strategy does not override update()"),
    ],
)
def test_hook_that_misbehaves_breaks_its_own_plugin(site: Path, body: str, expected: str) -> None:
    distribution(site, "bad", GOOD.format(name="bad").replace("return [Nothing]", body))
    distribution(site, "good", GOOD.format(name="good"))
    plugins = from_site(site)
    assert list(plugins.strategies) == ["good"]
    (fault,) = plugins.broken
    assert (fault.plugin, fault.hook) == ("bad-entry", "femubench_strategies")
    assert expected in fault.message


def test_one_bad_entry_leaves_the_others(site: Path) -> None:
    source = GOOD.format(name="fine").replace("[Nothing]", "[Nothing, int, Nothing()]")
    distribution(site, "mixed", source)
    plugins = from_site(site)
    assert list(plugins.strategies) == ["fine"]
    assert [fault.message for fault in plugins.broken] == [
        "class int is not a femubench.Strategy: update() is missing",
        "the name 'fine' is taken by another of the strategies",
    ]


def given(source: str) -> Plugins:
    """Load a plugin that somebody has imported."""
    module = ModuleType("later_plugin")
    exec(textwrap.dedent(source), module.__dict__)
    return load_plugins([], {"later": module})


REFERENCES = GOOD.replace("[Nothing]", "{{'nothing': __name__ + ':Nothing'}}")


def test_an_offer_by_reference_is_loaded_when_it_is_used(site: Path) -> None:
    plugins = given(REFERENCES.format(name="nothing").replace("__name__", "'heavy'"))
    assert list(plugins.strategies) == ["nothing"]
    assert dict(plugins.loaded[0].offers)["strategies"] == ("nothing",)
    assert plugins.broken == ()
    with pytest.raises(PluginError, match=re.escape("plugin 'later' (given by hand) in femu")):
        plugins.strategies["nothing"]
    source = textwrap.dedent(GOOD.format(name="nothing"))
    (site / "heavy.py").write_text(source, encoding="utf-8")
    importlib.invalidate_caches()
    assert isinstance(plugins.strategies["nothing"], Strategy)
    assert plugins.strategies["nothing"] is plugins.strategies["nothing"]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("'nothing':", "'other':"), "is named 'nothing' and offered as 'other'"),
        ((":Nothing'", ":Strategy'"), "class Strategy does not override update()"),
        ((":Nothing'", ":Nobody'"), "has no attribute 'Nobody'"),
    ],
)
def test_a_wrong_reference_is_said_when_it_is_used_and_of_an_outsider_at_once(
    site: Path, change: tuple[str, str], says: str
) -> None:
    source = REFERENCES.format(name="nothing").replace(*change)
    distribution(site, "wrong", source)
    (fault,) = from_site(site).broken
    assert says in fault.message
    plugins = given(source.replace("__name__", "'wrong_plugin'"))
    assert plugins.broken == ()
    (name,) = plugins.strategies
    with pytest.raises(PluginError, match=re.escape(says)):
        plugins.strategies[name]


@pytest.mark.parametrize("value", ["3", "'no module'", "Nothing"])
def test_what_is_no_reference_is_refused_at_once(site: Path, value: str) -> None:
    source = GOOD.format(name="nothing").replace("[Nothing]", f"{{'nothing': {value}}}")
    distribution(site, "wrong", source)
    (fault,) = from_site(site).broken
    assert fault.hook == "femubench_strategies"
    assert "'nothing' is offered as" in fault.message


def test_function_without_decorator_is_said() -> None:
    module = ModuleType("forgetful")
    exec("def femubench_readers(): return []", module.__dict__)
    (fault,) = load_plugins([], {"forgetful": module}).broken
    assert fault.message == "femubench_readers() lacks the decorator @femubench.hookimpl"


def test_imported_module_with_our_prefix_is_no_hook() -> None:
    module = ModuleType("package")
    module.__dict__["femubench_helpers"] = ModuleType("femubench_helpers")
    plugins = load_plugins([], {"package": module})
    assert plugins.broken == ()
    assert [plugin.plugin for plugin in plugins.loaded] == ["package"]


class Fine(Strategy):
    name = "fine"
    citation = "B. Author 2002"
    needs = frozenset({"shapes"})

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        return UpdateResult(model)


class Unit:
    """Fills the roles of reader, reporter and effect at once."""

    name = "unit"
    suffix = ".unit"
    suffixes = (".unit",)

    def read_matrix(self, path: Path) -> None: ...
    def read_modes(self, path: Path) -> None: ...
    def render(self, run: object) -> str:
        return "unit"

    def places(self, model: object) -> list[str]:
        return []

    def parameters(self, model: object, place: str) -> list[object]:
        return []

    def extend(self, model: object, place: str, values: list[float]) -> object:
        return model


def variant(base: type, **members: object) -> type:
    return type("Variant", (base,), members)


def test_objects_with_methods_are_plugins_too(tmp_path: Path) -> None:
    class Several:
        @hookimpl
        def femubench_scenarios(self) -> list[object]:
            return [Scenario("s", "title", {"s": tmp_path, "s/part": tmp_path})]

        @hookimpl
        def femubench_effects(self) -> list[object]:
            return [Unit]

        @hookimpl(specname="femubench_reporters")
        def formats(self) -> list[object]:
            return [Unit]

    plugins = load_plugins([], {"several": Several()})
    assert plugins.broken == ()
    assert isinstance(plugins.reporters["unit"], Unit)
    offers = {kind: names for kind, names in dict(plugins.loaded[0].offers).items() if names}
    assert offers == {"scenarios": ("s",), "effects": ("unit",), "reporters": ("unit",)}


@pytest.mark.parametrize(
    ("members", "expected"),
    [
        ({"name": ""}, "name is missing"),
        ({"name": "two words"}, "'two words' is not one word"),
        ({"citation": None}, "citation is missing"),
        ({"needs": frozenset({"shape"})}, "did you mean 'shapes'"),
        ({"needs": "shapes"}, "not a set of capabilities"),
        ({"__init__": lambda self, width: None}, "cannot be made without arguments"),
    ],
)
def test_strategy_is_checked(members: dict[str, object], expected: str) -> None:
    with pytest.raises(PluginError, match=re.escape(expected)):
        check_strategy(variant(Fine, **members))


def test_other_roles_are_checked(tmp_path: Path) -> None:
    with pytest.raises(PluginError, match=r"neither 's' nor 's/PART'"):
        check_scenario(Scenario("s", "t", {"other": tmp_path}))
    with pytest.raises(PluginError, match="not a mapping"):
        check_scenario(Scenario("s", "t", {}))
    with pytest.raises(PluginError, match=r"not a pathlib\.Path"):
        check_scenario(Scenario("s", "t", {"s": str(tmp_path)}))  # type: ignore[dict-item]
    with pytest.raises(PluginError, match=r"not a femubench\.Scenario"):
        check_scenario({"name": "s"})
    with pytest.raises(PluginError, match=r"suffix '\.UNV'"):
        check_reader(variant(Unit, suffixes=(".UNV",)))
    with pytest.raises(PluginError, match=r"suffixes is '\.unv'"):
        check_reader(variant(Unit, suffixes=".unv"))
    with pytest.raises(PluginError, match=r"read_modes\(\) is missing"):
        check_reader(variant(Unit, read_modes=None))
    with pytest.raises(PluginError, match="suffix 'md'"):
        check_reporter(variant(Unit, suffix="md"))
    with pytest.raises(PluginError, match=r"render\(\) is missing"):
        check_reporter(object())
    with pytest.raises(PluginError, match=r"extend\(\) is missing"):
        check_effect(variant(Unit, extend=3))


def test_example_of_the_docs_works(site: Path) -> None:
    """The strategy in docs/plugins.md, as printed: loads, and scales the stiffness as it says."""
    text = (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")
    (source,) = re.findall(r"```python\n# my_updating\.py\n(.*?)```", text, re.DOTALL)
    distribution(site, "my-updating", source)
    plugins = from_site(site)
    assert plugins.broken == ()
    case = read_case(ROOT / "scenarios" / "frame")
    used = case.used_measurement()
    changed = plugins.strategies["softer"].update(case.model, used, np.random.default_rng(0)).model
    before, after = (solve_modes(m).elastic.natural_frequencies for m in (case.model, changed))
    ratio = np.mean((used.frequencies / before[: len(used)]) ** 2)
    np.testing.assert_allclose(after, np.sqrt(ratio) * before, rtol=1e-8)


def test_hooks_are_all_in_the_specification() -> None:
    assert set(HOOKS) == {name for name in vars(hookspecs) if name.startswith("femubench_")}
