"""What a plugin does as it is imported costs that plugin alone, and no list and no other run."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import psutil
import pytest
from distributions import install_module

from femubench import InputError, strategies
from femubench.core.case.reader import read_case
from femubench.core.child import workers
from femubench.core.child.guarded_child import Ending
from femubench.core.child.limits import Limits
from femubench.core.child.namespaces import Walls
from femubench.core.errors import PluginError
from femubench.core.plugin import apart, loader
from femubench.core.plugin.foreign import ForeignStrategy, doc_of
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.core.plugin.variants import label_variant, strategy_of
from femubench.core.run.jobs import Job, execute, pickle_strategy
from femubench.core.run.provenance import comes_along, strategy_version

ROOT = Path(__file__).parents[1]
# Every one of them is imported whole, so that what it did is there when it is asked for its offers.
OFFERS = """
from femubench import Strategy, UpdateResult, hookimpl

class Quiet(Strategy):
    name = "of-{name}"
    citation = "A. Author 2001"

    def update(self, model, measurement, rng):
        return UpdateResult(model)

@hookimpl
def femubench_strategies():
    return [Quiet]
"""
# What each does on import, and what is said of it; None where it can still be described.
HOSTILE: Mapping[str, tuple[str, str | None]] = {
    "patch-eigh": (
        "import scipy.linalg, scipy.sparse.linalg as s\n"
        "def wrong(*a, **k): raise ValueError('patched')\n"
        "scipy.linalg.eigh = s.eigsh = scipy.linalg.eigvalsh = wrong",
        None,
    ),
    "os-exit": ("import os\nos._exit(0)", "its process ended with exit code 0"),
    "sys-exit": ("import sys\nsys.exit(0)", "SystemExit: 0"),
    "chdir": ("import os\nos.chdir('/')", None),
    "thread": (
        "import threading, time\n"
        "def on():\n    while True: time.sleep(0.01)\n"
        "threading.Thread(target=on).start()",
        None,
    ),
    "base-exception": ("class Odd(BaseException): pass\nraise Odd('no')", "Odd: no"),
    "recursion": ("import sys\nsys.setrecursionlimit(80)", None),
    "endless": ("while True: pass", "no result within 6 s"),
    "daemon": (
        "import os, time\n"
        "if os.fork() == 0:\n"
        "    os.setsid()\n"
        "    if os.fork() == 0:\n"
        "        os.execve('/bin/sleep', ['femubench-hostile-daemon', '600'], {})\n"
        "    os._exit(0)",
        None,
    ),
    "descriptors": ("import os\nos.closerange(0, 4096)", "its process ended with exit code 1"),
    "output": ("print('spam ' * 1000000)\nimport sys\nsys.stderr.write('spam ' * 1000000)", None),
    "locale-signals-warnings": (
        "import locale, os, signal, warnings\n"
        "locale.setlocale(locale.LC_ALL, 'C')\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "signal.signal(signal.SIGCHLD, signal.SIG_IGN)\n"
        "warnings.simplefilter('error')\nos.environ.clear()\nos.environ['OMP_NUM_THREADS'] = '7'",
        None,
    ),
    "builtins": (
        "import builtins\nbuiltins.len = builtins.sorted = lambda *a, **k: 3",
        "its answer is no JSON",
    ),
    "sys-modules": (
        "import sys\n"
        "for name in list(sys.modules):\n"
        "    if name.startswith(('femubench', 'numpy', 'json', 'click')): del sys.modules[name]",
        None,
    ),
    "numpy-errors": ("import numpy\nnumpy.seterr(all='raise')\nnumpy.random.seed(0)", None),
    "at-exit": (
        "import atexit\natexit.register(lambda: open(__file__ + '.left', 'w').write('left'))",
        None,
    ),
    "kill-parents": (
        "import os, signal\n"
        "for end in (lambda: os.kill(os.getppid(), 9), lambda: os.killpg(os.getppid(), 9)):\n"
        "    try: end()\n"
        "    except OSError: pass",
        # Its parent is outside and has no number: 0 is its own group.
        "its process was ended by SIGKILL",
    ),
    "memory": (
        "import mmap\nheld = [mmap.mmap(-1, 2**32) for _ in range(4096)]",
        "OSError: [Errno 12] Cannot allocate memory",
    ),
}


def install(folder: Path, name: str, source: str) -> str:
    """Put an installed distribution with one plugin module there, as pip would; return its name."""
    module = f"{name.replace('-', '_')}_hostile"
    install_module(folder, name, source, module)
    return module


RUN = """
import sys
from femubench.core.plugin import apart
apart.SECONDS = 6.0
from femubench.core.cli.main import bench
try:
    bench(sys.argv[1:])
finally:
    print("modules: " + " ".join(sys.modules), file=sys.stderr)
"""


def bench(*words: str, site: Path | None = None, cwd: Path) -> tuple[int, str, str, set[str]]:
    """Return exit code, output, what was said on stderr, and the modules that were imported."""
    paths = [str(ROOT), *([] if site is None else [str(site)])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"}
    command = [sys.executable, "-c", RUN, *words]
    done = subprocess.run(
        command, env=environment, cwd=cwd, capture_output=True, text=True, timeout=300
    )
    said, _, modules = done.stderr.rpartition("modules: ")
    assert modules, done.stderr
    return done.returncode, done.stdout, said, set(modules.split())


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which all of them are installed."""
    folder = tmp_path_factory.mktemp("hostile")
    for name, (source, _) in HOSTILE.items():
        install(folder, name, f"{source}\n{OFFERS.format(name=name)}")
    return folder


def daemons() -> list[int]:
    """Return the processes that the hostile daemon leaves where it can."""
    return [
        process.pid
        for process in psutil.process_iter(["cmdline"])
        if "femubench-hostile-daemon" in (process.info["cmdline"] or [])
    ]


def faults(said: str) -> dict[str, str]:
    """Return what is said of broken plugins, by plugin."""
    return dict(re.findall(r"^bench: plugin '(\S+)' \(\S+ 1\.0\)(?: in \S+)?: (.*)$", said, re.M))


@pytest.mark.slow(20)
def test_the_list_shows_what_each_did_to_itself_alone(hostile: Path, tmp_path: Path) -> None:
    code, plain, _, _ = bench("plugins", "list", cwd=tmp_path)
    again, listed, said, modules = bench("plugins", "list", site=hostile, cwd=tmp_path)
    assert (code, again) == (0, 0)
    whole = [name for name, (_, fault) in HOSTILE.items() if fault is None]
    rest = listed.removeprefix(plain)
    assert rest != listed
    assert rest == "".join(
        f"{name} ({name} 1.0)\n  strategies: of-{name}\n" for name in sorted(whole)
    )
    expected = {name: fault for name, (_, fault) in HOSTILE.items() if fault is not None}
    assert faults(said) == expected
    assert not {module for module in modules if module.endswith("_hostile")}
    time.sleep(0.2)
    assert daemons() == []
    assert not list(hostile.glob("*.left"))


@pytest.mark.slow(20)
def test_a_run_of_others_is_as_without_them(tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    companions = ("patch-eigh", "os-exit", "chdir", "builtins", "sys-modules", "numpy-errors")
    for name in companions:
        install(site, name, f"{HOSTILE[name][0]}\n{OFFERS.format(name=name)}")
    found = []
    for name, where in (("plain", None), ("companions", site)):
        file = tmp_path / f"{name}.json"
        words = ("run", "frame", "-s", "unchanged", "-s", "baruch", "--quiet", "--json", str(file))
        code, _, said, modules = bench(
            *words, "--store", str(tmp_path / name), site=where, cwd=tmp_path
        )
        assert code == 0, said
        assert not {module for module in modules if module.endswith("_hostile")}
        found.append(json.loads(file.read_text()))
    assert figures(found[0]) == figures(found[1])
    assert set(faults(said)) == {"os-exit", "builtins"}


def figures(run: Mapping[str, Any]) -> list[Any]:
    """Return what a run says of models, without times."""
    own = ("case", "nominal", "strategy", "status", "reason", "used", "higher", "modified", "gain")
    return [[result[key] for key in own] for result in run["results"]]


FINE = '''
from dataclasses import dataclass, field
from pathlib import Path
from femubench import InputError, Scenario, Strategy, UpdateResult, hookimpl

@dataclass(frozen=True)
class Inner:
    damping: float = 0.5

@dataclass(frozen=True)
class Scaled(Strategy):
    """Scale the stiffness.

    Arguments:
        factor: by which.
        steps: how often.
    """

    name = "scaled-by-outsider"
    citation = "A. Author 2001"
    factor: float = 1.0
    steps: int = 1
    inner: Inner = Inner()
    stiffness: dict[str, float] = field(default_factory=dict)

    def __post_init__(self):
        if self.factor <= 0.0:
            raise ValueError("factor is not positive")

    @property
    def needs(self):
        return frozenset({"shapes"} if self.steps > 1 else ())

    def update(self, model, measurement, rng):
        import dataclasses
        changed = dataclasses.replace(model, stiffness=self.factor * model.stiffness)
        return UpdateResult(changed, parameter_count=1)

class Text:
    """Write the names."""

    name = "outsider-text"
    suffix = ".names"

    def render(self, run):
        return ", ".join(sorted({result.strategy for result in run.results}))

class Bytes(Text):
    name = "outsider-bytes"
    suffix = ".bin"

    def render_bytes(self, run):
        return b"\\0" + self.render(run).encode()

class Effect:
    name = "outsider-effect"
    summary = "a bolt is loose"
    def places(self, model): return []
    def parameters(self, model, place): return []
    def extend(self, model, place, values): return model

class Reader:
    name = "third party reader"
    suffixes = (".strange",)
    def read_matrix(self, path): raise InputError("no matrix", file=path)
    def read_modes(self, path): raise InputError("no modes", file=path)
    def read_nodes(self, path): return {}

@hookimpl
def femubench_strategies(): return [Scaled]
@hookimpl
def femubench_reporters(): return [Text, Bytes]
@hookimpl
def femubench_effects(): return [Effect]
@hookimpl
def femubench_readers(): return [Reader]
@hookimpl
def femubench_scenarios():
    return [Scenario("strange", "A frame", {"strange": Path(FRAME)}, ("frame",), default=False)]
'''
MODULE = "fine_hostile"


@pytest.fixture
def fine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    site = tmp_path / "site"
    site.mkdir()
    source = FINE.replace("FRAME", repr(str(ROOT / "scenarios" / "frame")))
    install(site, "fine", source)
    monkeypatch.syspath_prepend(site)
    yield site
    sys.modules.pop(MODULE, None)


@pytest.mark.nightly
def test_no_command_imports_an_outsider(fine: Path, tmp_path: Path) -> None:
    store = ("--store", str(tmp_path / "store"))
    file = tmp_path / "run.json"
    for words in (
        ("plugins", "list"),
        ("plugins", "show", "scaled-by-outsider"),
        ("plugins", "show", "outsider-effect"),
        ("scenarios", "list"),
        ("scenarios", "show", "strange"),
        ("run", "--help"),
        ("report", "--help"),
        ("run", "strange", "-s", "unchanged", "-s", "scaled-by-outsider:factor=1.1",
         "--json", str(file), *store),
        ("report", *store),
        ("report", "-f", "outsider-text", *store),
        ("report", "-f", "outsider-bytes", "--output", str(tmp_path / "out"), *store),
        ("publish", "--unverified", str(tmp_path / "pages"), str(file)),
    ):  # fmt: skip
        code, output, said, modules = bench(*words, site=fine, cwd=tmp_path)
        assert code == 0, (words, output, said)
        assert MODULE not in modules, words
        if "outsider-text" in words:
            assert output.strip() == "scaled-by-outsider:factor=1.1, unchanged"
    (written,) = (tmp_path / "out").glob("*.bin")
    assert written.read_bytes() == b"\0scaled-by-outsider:factor=1.1, unchanged"
    results = json.loads(file.read_text())["results"]
    assert {result["status"] for result in results} == {"ok"}
    scores = {(r["strategy"], r["nominal"]): r["used"]["rms_percent"] for r in results}
    assert scores["unchanged", "drawn"] != scores["scaled-by-outsider:factor=1.1", "drawn"]


def found_here(plugins: Plugins) -> ForeignStrategy:
    found = plugins.strategies["scaled-by-outsider"]
    assert isinstance(found, ForeignStrategy)
    return found


def test_a_strategy_is_known_by_its_description(fine: Path) -> None:
    found = found_here(load_plugins())
    assert found.options == {"factor": 1.0, "steps": 1, "inner.damping": 0.5}
    assert found.open == ("stiffness",)
    assert (found.needs, found.promises, found.baseline) == (frozenset(), frozenset(), False)
    assert doc_of(found).startswith("Scale the stiffness.")
    changed = strategy_of(
        "scaled-by-outsider:damping=1,steps=2,stiffness.ry=3", {found.name: found}
    )
    assert changed.name == "scaled-by-outsider:damping=1,steps=2,stiffness.ry=3"
    inner: Any = changed
    assert inner.base.options == {
        "factor": 1.0, "steps": 2, "inner.damping": 1.0, "stiffness.ry": 3.0,
    }  # fmt: skip
    assert inner.needs == {"shapes"}
    assert (
        label_variant(inner.base).name == "scaled-by-outsider:steps=2,damping=1.0,stiffness.ry=3.0"
    )
    assert strategies["scaled-by-outsider"](factor=2.0).name == "scaled-by-outsider:factor=2.0"
    assert MODULE not in sys.modules


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("factr=1", "has no option 'factr'; did you mean 'factor'"),
        ("steps=1.5", "option steps is '1.5' (expected int)"),
        ("factor=-1", "option factor: factor is not positive"),
    ],
)
def test_options_are_checked_before_anything_runs(fine: Path, words: str, says: str) -> None:
    found = found_here(load_plugins())
    with pytest.raises(InputError, match=re.escape(says)):
        strategy_of(f"{found.name}:{words}", {found.name: found})
    assert MODULE not in sys.modules


def test_a_job_imports_it_where_it_runs_and_sends_the_same_bytes_always(fine: Path) -> None:
    found = found_here(load_plugins())
    loader._known.clear()
    assert pickle_strategy(found) == pickle_strategy(found_here(load_plugins()))
    case = read_case(ROOT / "scenarios" / "frame")
    job = Job(*map(pickle_strategy, (found, case.model, case.used_measurement())), words=(1,))
    assert execute(job).status == "ok"
    assert MODULE in sys.modules


def test_its_version_changes_with_its_source(fine: Path) -> None:
    found = found_here(load_plugins())
    before = strategy_version(found)
    assert before.startswith("1.0+")
    assert strategy_version(found) == before
    file = fine / f"{MODULE}.py"
    file.write_text(file.read_text() + "\n# another\n")
    assert strategy_version(found) != before
    assert not comes_along(found)
    assert MODULE not in sys.modules


def test_an_effect_and_a_reader_are_imported_by_who_uses_them(fine: Path) -> None:
    plugins = load_plugins()
    assert "outsider-effect" in plugins.effects
    reader: Any = next(r for r in plugins.readers.values() if r.name == "third party reader")
    assert hasattr(reader, "read_nodes")
    assert not hasattr(reader, "read_model")
    assert MODULE not in sys.modules
    assert reader.read_nodes(Path("x")) == {}
    assert MODULE in sys.modules
    sys.modules.pop(MODULE)
    effect: Any = plugins.effects["outsider-effect"]
    assert effect.summary == "a bolt is loose"
    assert MODULE in sys.modules


HOOKED = ("strategies", "scenarios", "effects", "faults", "readers", "reporters", "papers")
FORGED: Mapping[str, tuple[object, str]] = {
    "no object": ([1], "its answer is no JSON object"),
    "no offers": ({"broken": [], "loaded": True}, "its description is none: offers: missing"),
    "numbers": (
        {"broken": 3, "offers": {}},
        "its description is none: broken: a whole number, expected a list",
    ),
    "no fault": ({"fault": 3}, "its answer is no fault"),
    "half a fault": ({"fault": ["ValueError"]}, "its answer is no fault"),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_description_is_one_line(
    name: str, fine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated, says = FORGED[name]
    forged = apart._read(Ending("answer", json.dumps(stated).encode()))
    monkeypatch.setattr(apart, "ask", lambda questions: [forged for _ in questions])
    loader._known.clear()
    (fault,) = [one for one in load_plugins().broken if one.plugin == "fine"]
    loader._known.clear()
    assert fault.message.startswith(says)


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("name", 3, "name: a whole number, expected a text"),
        ("citation", "", "citation is missing"),
        ("needs", ["everything"], "needs 'everything', which is none of"),
        ("options", {"x": [1]}, "options.x: a list, expected"),
    ],
)
def test_what_a_description_says_is_checked(
    fine: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: object, says: str
) -> None:
    loader._known.clear()
    ask = apart.ask

    def forged(questions: Any) -> Any:
        answers = ask(questions)
        answers[0]["offers"]["strategies"][0][key] = value
        return answers

    monkeypatch.setattr(apart, "ask", forged)
    plugins = load_plugins()
    loader._known.clear()
    (fault,) = [one for one in plugins.broken if one.plugin == "fine"]
    assert says in fault.message
    assert "scaled-by-outsider" not in plugins.strategies
    assert "outsider-text" in plugins.reporters


def test_a_terminal_does_not_obey_what_a_plugin_says(tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    install(tmp_path / "site", "loud", "raise RuntimeError('\\x1b[2Jgone\\x07')")
    code, _, said, _ = bench("plugins", "list", "--traceback", site=tmp_path / "site", cwd=tmp_path)
    assert code == 0
    assert "RuntimeError: \\x1b[2Jgone\\x07" in said
    assert "\x1b" not in said


def test_where_there_are_no_namespaces_nothing_is_left_either(
    hostile: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(hostile)
    question = {"do": loader.DESCRIBE, "origin": ["daemon", "daemon_hostile", "daemon 1.0"]}
    task = (apart.answer_question, question)
    (ending,) = workers.run_apart({1: task}, Limits(10.0, sandbox="off"), 1).values()
    assert json.loads(ending.answer)["loaded"] is True
    time.sleep(0.2)
    assert daemons() == []


# What it could do stands in its citation: text that it read, or the error.
CURIOUS = """
import os, pathlib, socket
from femubench import Strategy, UpdateResult, hookimpl

def tried(what):
    try:
        return str(what())
    except Exception as error:
        return type(error).__name__

def daemon():
    if os.fork() == 0:
        os.setsid()
        os.execve("/bin/sleep", ["femubench-hostile-daemon", "600"], {{}})

def processes():
    return sorted(name for name in os.listdir("/proc") if name.isdigit())

DONE = [
    tried(pathlib.Path({held_out!r}).read_text),
    tried(lambda: pathlib.Path({home!r}, "left").write_text("left")),
    tried(lambda: pathlib.Path(os.path.expanduser("~"), "own").write_text("own")),
    tried(lambda: os.environ.get("SECRET", "no secret")),
    tried(lambda: len(processes()) < 5),
    tried(lambda: socket.create_connection(("127.0.0.1", {port}), 1.0) and "connected"),
    tried(daemon),
]

class Curious(Strategy):
    name = "curious"
    citation = "|".join(DONE)

    def update(self, model, measurement, rng):
        return UpdateResult(model)

@hookimpl
def femubench_strategies():
    return [Curious]
"""
BARRED = "FileNotFoundError|FileNotFoundError|3|no secret|True|ConnectionRefusedError|None"


def test_a_description_is_made_in_a_sandbox(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, site = tmp_path / "home", tmp_path / "site"
    home.mkdir()
    site.mkdir()
    held_out = home / "modes.csv"
    held_out.write_text("mode,frequency\n4,123.4\n")
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("SECRET", "stated")
    monkeypatch.syspath_prepend(site)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        install(site, "curious", CURIOUS.format(held_out=str(held_out), home=str(home), port=port))
        origin = ["curious", "curious_hostile", "curious 1.0"]
        question = {"do": loader.DESCRIBE, "origin": origin}
        (inside,) = apart.ask([{**question, "walled": True}], 20.0)
        (stated,) = inside["offers"]["strategies"]
        assert stated["citation"] == BARRED
        assert sorted(path.name for path in home.iterdir()) == ["modes.csv"]
        # The same plugin, asked for what may need files, could.
        (outside,) = apart.ask([question], 20.0)
        (stated,) = outside["offers"]["strategies"]
        assert "123.4" in stated["citation"]
        assert stated["citation"].endswith("|connected|None")
    assert daemons() == []
    assert load_plugins().strategies["curious"].citation == BARRED


def test_where_the_sandbox_cannot_be_entered_the_question_is_asked_without(
    hostile: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "walls_around", lambda *_: Walls(("/no/such/folder",)))
    monkeypatch.syspath_prepend(hostile)
    question = {"do": loader.DESCRIBE, "origin": ["chdir", "chdir_hostile", "chdir 1.0"]}
    (answer,) = apart.ask([{**question, "walled": True}], 10.0)
    assert answer["loaded"] is True


def test_many_bytes_are_not_taken(hostile: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(hostile)
    question = {"do": loader.DESCRIBE, "origin": ["chdir", "chdir_hostile", "chdir 1.0"]}
    assert apart.ask([question], 10.0, 20) == ["its result is larger than 20 B"]
    with pytest.raises(PluginError, match=r"plugin 'x' \(x 1\.0\): its process"):
        apart.Origin("x", "os_exit_hostile", "x 1.0").ask(loader.DESCRIBE, seconds=10.0, most=99)


def test_entry_points_that_are_none_cost_their_plugin_alone(tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    install(site, "odd", "")
    (info,) = site.glob("*.dist-info")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd\x1b[2J\nVersion: 1.0\x07\n")
    points = ("a = ../../x", "b = ", "c = two words", "d\x1b[2J = os:_exit")
    (info / "entry_points.txt").write_text("\n".join(("[femubench]", *points)))
    code, listed, said, _ = bench("plugins", "list", cwd=tmp_path, site=site)
    assert code == 0
    assert "unchanged" in listed
    assert said.count("expected 'module:object'") == 3
    assert not {"\x1b", "\x07"} & {*listed, *said}


def test_a_plugin_with_many_faults_tells_of_the_first(
    fine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stated = {"loaded": True, "broken": [], "offers": dict.fromkeys(HOOKED, [3] * 10_000)}
    monkeypatch.setattr(apart, "ask", lambda questions: [stated for _ in questions])
    loader._known.clear()
    faults = [one for one in load_plugins().broken if one.plugin == "fine"]
    loader._known.clear()
    assert len(faults) == 51
    assert faults[-1].message == f"and {10_000 * len(HOOKED) - 50} more faults"
