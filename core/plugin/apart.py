"""Questions to plugins of strangers, which are never imported here: plain data out, plain data in.

The answers are what code of a stranger wrote: their sizes are bounded, nothing in them is executed,
and whoever asks checks what they say.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from femubench.core.errors import InputError, PluginError, harmless

SECONDS = 20.0  # that a plugin may take to be imported and to say what it offers
MOST = 4 * 2**20  # bytes of an answer
_SPARE = 20.0  # s for the start of processes, beside what questions take
_START = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from femubench.core.plugin import describing, keeper
from femubench.core.run.sandbox import way_in
keeper.main(describing.answer, way_in, sys.argv[2])
"""


@dataclass(frozen=True)
class Origin:
    """The entry point of a plugin.

    Arguments:
        plugin, value: its name, and the module or object that it stands for.
        distribution: what was installed, with its version.
    """

    plugin: str
    value: str
    distribution: str

    @property
    def top(self) -> str:
        """Return the package, or the lone module, that it is imported from."""
        return self.value.partition(":")[0].partition(".")[0].strip()

    def ask(
        self, what: str, *, seconds: float, most: int, doing: str = "", **details: object
    ) -> dict[str, Any]:
        """Return the answer of the plugin in a process of its own.

        Arguments:
            what: the function of ours that answers.
            seconds, most: that it may take, and bytes of its answer.
            doing: begins the message of a fault that nobody foresaw.
            details: of the question, plain data.

        Raises:
            InputError: as the plugin raised it.
            PluginError: for every other fault.
        """
        question = {"do": what, "origin": [self.plugin, self.value, self.distribution], **details}
        (found,) = ask([question], seconds, most)
        if isinstance(found, str):
            raise PluginError(f"plugin {self.plugin!r} ({self.distribution}): {found}")
        if "fault" in found:
            kind, text = map(str, found["fault"])
            if kind == "InputError":
                raise InputError(text)
            foreseen = kind == "PluginError"
            whole = text if foreseen else ": ".join(filter(None, (doing, kind, text)))
            raise PluginError(harmless(whole))
        return dict(found)


def ask(
    questions: Sequence[Mapping[str, Any]], seconds: float | None = None, most: int = MOST
) -> list[Any]:
    """Return the answer to every question, or as text why there is none.

    Arguments:
        questions: plain data; ``do`` names the function of ours that answers, ``origin`` the
            plugin; every one is answered in a process of its own, with ``walled`` in a sandbox
            where that is possible.
        seconds, most: what each may take, `SECONDS` by default, and the bytes of its answer.
    """
    if not questions:
        return []
    seconds = SECONDS if seconds is None else seconds
    limited = [{**question, "seconds": seconds, "most": most} for question in questions]
    rounds = -(-len(limited) // (os.cpu_count() or 1))
    found = _kept(limited, seconds * rounds + _SPARE)
    if found is None and len(limited) > 1:
        # One of them has ended the process that asks; alone it does so to itself.
        return [ask([question], seconds, most)[0] for question in questions]
    if found is None:
        return ["it ended the process that asked it"]
    return [_read(item) for item in found]


def _kept(questions: Iterable[Mapping[str, Any]], seconds: float) -> list[Any] | None:
    """Return what the process that asks writes; None where it does not come to an end."""
    import subprocess
    import tempfile

    paths = json.dumps([os.path.abspath(path) for path in sys.path])
    quiet = {"PYTHONDONTWRITEBYTECODE": "1"} if sys.dont_write_bytecode else {}
    with (
        tempfile.TemporaryDirectory(prefix="femubench-apart-") as at,
        subprocess.Popen(
            [sys.executable, "-c", _START, paths, at],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **quiet},
            start_new_session=True,
        ) as process,
    ):
        try:
            said, _ = process.communicate(json.dumps(list(questions)).encode(), seconds)
        except subprocess.TimeoutExpired:
            return None
        finally:
            # Also on Ctrl-C, which does not reach that session.
            if process.poll() is None:
                process.kill()
    if process.returncode != 0:
        return None
    found = json.loads(said or b"null")
    return found if isinstance(found, list) else None


def _read(item: Mapping[str, str]) -> Any:  # noqa: ANN401 - plain data
    """Return an answer as plain data, or why there is none."""
    if "lost" in item:
        return str(item["lost"])
    text = item["said"]
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return "what it told is no JSON"
    match found:
        case {"fault": [str(), str()]}:
            return found
        case {"fault": _}:
            return "what it told is no fault"
        case {}:
            return found
    return "what it told is no JSON object"
