"""Some jobs of a run, drawn by chance and run again here: do its strategies give its models?"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from femubench.core.case.case import Case
from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.publish.agreement import NO_RESULT, agree
from femubench.core.roles import StrategyRole
from femubench.core.run.executor import LocalProcesses
from femubench.core.run.provenance import strategy_version
from femubench.core.run.runner import Plan
from femubench.core.run.starts import Starts
from femubench.core.schema.results import RunData
from femubench.core.schema.run_options import RunOptions
from femubench.core.version import __version__


@dataclass(frozen=True)
class Sample:
    """What is run again of every run, and what became of it.

    Arguments:
        number: of jobs of a run.
        strategy: returns one that is installed by its name; None where there is none.
        tell: is given a line a run.
        seed: of the draw, unknown to contributors.
    """

    number: int
    strategy: Callable[[str], StrategyRole | None]
    tell: Callable[[str], None]
    seed: int = field(default_factory=lambda: secrets.randbelow(2**31))

    def check(
        self, run: RunData, cases: Mapping[str, Case], textbooks: Mapping[str, Case], file: Path
    ) -> None:
        """Run jobs of strategies again that are installed in the same version, of this femubench.

        Raises:
            InputError: for a job that does not give what the run says of it.
        """
        known = {name: one for name in run.meta["strategies"] if (one := self.strategy(name))}
        here = {name: [strategy_version(one), __version__] for name, one in known.items()}
        listed = [*run.results, *run.companions]
        jobs = [
            one
            for one in listed
            if one.status not in NO_RESULT  # which say something of a machine
            and here.get(one.strategy) == [one.provenance[n] for n in ("strategy", "femubench")]
        ]
        order = np.random.default_rng(self.seed).permutation(len(jobs))
        done = 0
        for one in (jobs[place] for place in order[: self.number]):
            options, starts = RunOptions((one.seed,)), Starts(textbooks, one.nominal)
            plan = Plan([cases[one.case]], [known[one.strategy]], options, starts)
            (found,) = plan.run(LocalProcesses(1)).results
            if found.status not in NO_RESULT and not agree(one, found):
                errors = ", ".join(f"{b} {f.rms_percent:.6g} %" for b, f in found.blocks.items())
                what = f"{one.strategy} on {one.case}, seed {one.seed}, gives another model here"
                expected = f"{errors or found.status}, as run again (draw {self.seed})"
                raise InputError(what, file=file, key="results", expected=expected)
            done += found.status not in NO_RESULT
        why = "" if jobs else ": no strategy of it is installed here in its version"
        what = f"{done} of {count_noun(len(listed), 'job')} run again, drawn from seed {self.seed}"
        self.tell(f"{file}: {what}{why}")
