"""Questions to third-party plugins, which are never imported here: plain data out, plain data in.

The answers are what third-party code wrote: their sizes are bounded, nothing in them is executed,
and the caller checks what they say.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING, Any

from femubench.core.errors import InputError, PluginError, harmless

if TYPE_CHECKING:
    from femubench.core.child.guarded_child import Ending
    from femubench.core.child.limits import Limits

SECONDS = 20.0  # that a plugin may take to be imported and to say what it offers
MOST = 4 * 2**20  # bytes of an answer
_ANSWERS = "femubench.core.plugin.describing"
_LEAST_MEMORY = 4 * 2**30  # bytes of address space that every question may take
_ROOM, _LARGEST_FILE = 2**28, 2**30  # bytes that it may write, in a sandbox and without
_ENDLESS = 2**62  # bytes that it may print
_MOST_PROCESSES = 256


@dataclass(frozen=True)
class Origin:
    """The entry point of a plugin.

    Arguments:
        plugin, value: its name, and the module or object that it stands for.
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
            seconds, most: that it may take, and bytes of its answer.
            doing: begins the message of a fault that nobody foresaw.

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

    Without the sandbox a question is answered in a namespace of processes where that is possible:
    it can signal or look into none outside, and nothing of it is left afterwards.
    """
    if not questions:
        return []
    import psutil

    from femubench.core.child.limits import Limits
    from femubench.core.child.sandbox import enclosure
    from femubench.core.child.workers import run_apart

    physical = psutil.virtual_memory().total
    limits = Limits(
        SECONDS if seconds is None else seconds,
        max(_LEAST_MEMORY, physical // 2),
        output=_ENDLESS,
        answer=most,
        processes=_MOST_PROCESSES,
    )
    walled = replace(limits, file=_ROOM, sandbox="auto")
    plain = replace(limits, file=_LARGEST_FILE, sandbox="processes")

    def put(asked: Iterable[int], limits: Limits) -> dict[int, Ending]:
        tasks = {number: (answer_question, questions[number]) for number in asked}
        return run_apart(tasks, limits, os.cpu_count() or 1, _ANSWERS)

    inside = [i for i, one in enumerate(questions) if one.get("walled")]
    found = put(inside, walled) if enclosure("auto").sandbox != "none" else {}
    # Where the sandbox was not entered no plugin has been imported yet.
    rest = {i for i in range(len(questions)) if i not in found or found[i].how == "no-start"}
    found |= put(rest, plain)
    return [_read(found[i]) for i in range(len(questions))]


def answer_question(question: dict[str, Any]) -> bytes:
    """Return what a question asks for as JSON, or under ``fault`` what was raised.

    It is called in a process in which code of the plugin may run.
    """
    try:
        function = EntryPoint("", question["do"], "").load()
        answer = dict(function(Origin(*question["origin"]), question))
    except BaseException as fault:
        kind = "InputError" if isinstance(fault, InputError) else type(fault).__name__
        answer = {"fault": [kind, " ".join(str(fault).split())]}
    return json.dumps(answer).encode()


def _read(ending: Ending) -> Any:  # noqa: ANN401 - plain data
    """Return an answer as plain data, or why there is none."""
    if ending.how != "answer":
        return ending.reason.replace("the worker process", "its process")
    try:
        found = json.loads(ending.answer.decode("utf-8", "replace"))
    except (ValueError, RecursionError):
        return "its answer is no JSON"
    match found:
        case {"fault": [str(), str()]}:
            return found
        case {"fault": _}:
            return "its answer is no fault"
        case {}:
            return found
    return "its answer is no JSON object"
