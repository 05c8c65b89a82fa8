"""Some jobs of a run, drawn by chance and run again here: do its strategies give its models?"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from femubench.core.case.case import Case
from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.publish.agreement import NO_RESULT, agree
from femubench.core.roles import Strategy
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.provenance import strategy_version
from femubench.core.run.runner import Plan
from femubench.core.run.starts import Starts
from femubench.core.schema.results import Run
from femubench.core.schema.run_options import RunOptions
from femubench.core.version import __version__


@dataclass(frozen=True)
class Sample:
    """What is run again of every run, and what became of it.

    Arguments:
        number: of jobs of a run.
        strategy: returns one that is installed by its name; None where there is none.
        seed: of the draw, unknown to contributors.
        said: a line a run.
    """

    number: int
    strategy: Callable[[str], Strategy | None]
    seed: int = field(default_factory=lambda: secrets.randbelow(2**31))
    said: list[str] = field(default_factory=list)

    def check(
        self, run: Run, cases: Mapping[str, Case], textbooks: Mapping[str, Case], file: Path
    ) -> None:
        """Run the sample of a run again, in the sandbox where there is one.

        Only jobs of strategies that are installed in the same version, of the same femubench, can
        be; a job that ran out of time or crashed says something of a machine.

        Arguments:
            cases, textbooks: of all jobs, by name.
            file: for messages.

        Raises:
            InputError: for a job that does not give what the run says of it.
        """
        known = {name: one for name in run.meta["strategies"] if (one := self.strategy(name))}
        here = {(name, strategy_version(one), __version__) for name, one in known.items()}
        listed = [*chain(run.results, run.companions)]
        jobs = [
            one
            for one in listed
            if one.status not in NO_RESULT
            and (one.strategy, *map(one.provenance.get, ("strategy", "femubench"))) in here
        ]
        order = np.random.default_rng(self.seed).permutation(len(jobs))
        done = 0
        for one in (jobs[place] for place in order[: self.number]):
            options = RunOptions(seeds=(one.seed,), nominal=one.nominal)
            starts = Starts(textbooks, one.nominal)
            plan = Plan([cases[one.case]], [known[one.strategy]], options, starts)
            (found,) = plan.run(LocalProcesses(1)).results
            if found.status in NO_RESULT:
                continue
            done += 1
            if not agree(one, found):
                errors = ", ".join(f"{b} {f.rms_percent:.6g} %" for b, f in found.blocks.items())
                what = f"{one.strategy} on {one.case}, seed {one.seed}, gives another model here"
                expected = f"{errors or found.status}, as run again (draw {self.seed})"
                raise InputError(what, file=file, key="results", expected=expected)
        what = f"{done} of {count_noun(len(listed), 'job')} run again, drawn from seed {self.seed}"
        why = "" if jobs else ": no strategy of these is installed here in its version"
        self.said.append(f"{file}: {what}{why}")
