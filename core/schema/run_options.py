"""What a run may be asked for, every option once: for Python, the command line and study files."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, TypedDict

from annotated_types import Ge, Gt, Le, Lt

from femubench.core.schema.quantities import parse_size, parse_timeouts, parse_twins

DEFAULT_TIMEOUT = 600.0  # s
MOST_TWINS = 100
LARGEST_SEED = 2**62
Sandbox = Literal["auto", "require", "off"]
Overwrite = Literal["always", "missing", "failed"]
StartModels = Literal["drawn", "textbook", "both"]
Twins = int | tuple[int, int | None]  # how many, and from which seed; None draws one
Seed = Annotated[int, Ge(0), Le(LARGEST_SEED)]
Seconds = Annotated[float, Gt(0.0), Lt(float("inf"))]
Count = Annotated[int, Ge(1)]


@dataclass(frozen=True)
class Flag:
    """What the command line has for a field, whose help is what the docstring of its class says.

    Arguments:
        names: separated by blanks; the name of the field where there is none.
        metavar: what stands for the value in the help.
        parse: returns the value of a text, or raises a ValueError; None where the type says it.
        multiple: whether it may be repeated; `parse` has all texts.
        show_default: whether the help names the default.
    """

    names: str = ""
    metavar: str | None = None
    parse: Callable[[Any], Any] | None = None
    multiple: bool = False
    show_default: bool = False


def describe_fields(kind: type) -> dict[str, str]:
    """Return what the docstring of a dataclass says of its fields, each on one line."""
    listed = inspect.cleandoc(kind.__doc__ or "").partition("Arguments:\n")[2]
    entries = re.findall(r"^    (\w+): ((?:.|\n(?!    \w))*)", listed, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}


@dataclass(frozen=True)
class Where:
    """Where the jobs of a run are computed: in processes of this machine, or on a cluster.

    Arguments:
        jobs: Number of worker processes. Default: one per core. With --cluster slurm:QUEUE the
            number of Slurm jobs.
        cluster: Run the jobs on the workers of a Dask scheduler, e.g. tcp://host:8786, or of a
            cluster that is started for the run: local:N workers here, or slurm:QUEUE.
        sandbox: Run strategies where they see no case, no file of yours, no other process and no
            network (Linux): where that is possible, or not at all, or without.
    """

    jobs: Annotated[Count | None, Flag("-j --jobs", "N")] = None
    cluster: Annotated[str | None, Flag(metavar="CLUSTER")] = None
    sandbox: Annotated[Sandbox, Flag(show_default=True)] = "auto"


@dataclass(frozen=True)
class RunOptions:
    """What a run computes, within which limits, and which stored results it takes.

    Arguments:
        seeds: Run N draws of measurement noise instead of the data as recorded. Other seeds than
            1 .. N stand in the file of bench study.
        seed: What seeds count from.
        nominal: The model that all strategies start from: as drawn, or with what handbooks give
            for torsion, shear and rotary inertia, from which the ranks are.
        drawing: Start from the model of this drawing, which DRAWING.toml in the folder of a case
            holds, in place of that of case.toml; of several cases those without it are left out.
        twins: Draw N twins of every case whose truth was computed, other structures under other
            names, and say who is good on the cases but not on them; run one job of each strategy
            twice.
        twin_seed: What twins are drawn from. Default: a seed by chance.
        resume: Continue the last run of these jobs: run what is missing, and failed jobs again.
            Without CASE and -s, continue the last run in the store.
        overwrite: Which stored results of the same jobs are computed again: all, none, or the
            failures. Default: always; with --resume: failed.
        timeout: Seconds that a job may take; None for no limit.
        timeouts: Give up on a job after this time, e.g. 90s, 10m, 1h. STRATEGY=DURATION is for one
            strategy; may be repeated. Default: 10m.
        memory: Stop a job that takes more, e.g. 512M, 4G. Default: an even share of the machine's.
    """

    seeds: Annotated[Count | tuple[Seed, ...] | None, Flag(metavar="N")] = None
    seed: Seed = 0
    nominal: Annotated[StartModels, Flag(show_default=True)] = "both"
    drawing: Annotated[str, Flag(metavar="DRAWING")] = ""
    twins: Annotated[int, Ge(0), Le(MOST_TWINS), Flag("", "N[:SEED]", parse_twins)] = 0
    twin_seed: Annotated[int, Ge(0)] | None = None
    resume: Annotated[bool, Flag()] = False
    overwrite: Annotated[Overwrite | None, Flag()] = None
    timeout: Seconds | None = DEFAULT_TIMEOUT
    timeouts: Annotated[
        Mapping[str, Seconds], Flag("--timeout", "DURATION", parse_timeouts, multiple=True)
    ] = field(default_factory=dict)
    memory: Annotated[Count | None, Flag("", "SIZE", parse_size)] = None

    @property
    def all_seeds(self) -> Sequence[int]:
        """Return the seeds: 0 is the data as recorded, several are draws of noise and no other."""
        if isinstance(self.seeds, Sequence):
            return self.seeds
        first = self.seed if self.seeds is None else self.seed + 1
        return range(first, first + (self.seeds or 1))


class StudyKeywords(TypedDict, total=False):
    """Keywords for options of a run, except those that stand in a study file."""

    jobs: int | None
    cluster: str | None
    sandbox: Sandbox
    timeout: float | None
    timeouts: Mapping[str, float] | None
    memory: int | None
    overwrite: Overwrite | None


class RunKeywords(StudyKeywords, total=False):
    """Keywords for every field of `RunOptions` and `Where`, for editors and type checkers."""

    seeds: int | Sequence[int] | None
    seed: int | None
    nominal: StartModels | None
    drawing: str | None
    twins: Twins
    resume: bool


def check_keywords(given: Mapping[str, Any], kind: Any) -> None:  # noqa: ANN401 - a TypedDict
    """Make sure that keywords exist; raises TypeError naming one that does not."""
    for name in sorted(given.keys() - kind.__optional_keys__):
        raise TypeError(f"unexpected keyword argument {name!r}")


def split_keywords(given: Mapping[str, Any]) -> tuple[dict[str, Any], Where]:
    """Return the options of a run that were given, by field, and where it is computed.

    Arguments:
        given: as in `RunKeywords`; None stands for what is usual.
    """
    own: dict[str, Any] = {}
    there = {}
    for name, value in given.items():
        if value is None:
            continue
        if name in Where.__dataclass_fields__:
            there[name] = value
        elif name == "twins" and not isinstance(value, int):
            own |= zip(("twins", "twin_seed"), value, strict=True)
        elif name == "timeouts":
            limits = dict(value)  # those of all others may stand under an empty name
            own |= {"timeout": limits.pop("")} if "" in limits else {}
            own[name] = limits
        else:
            own[name] = (
                value if isinstance(value, str) or not isinstance(value, Sequence) else tuple(value)
            )
    return own, Where(**there)
