"""What a strategy handed back on a problem, judged in a process that runs no code of strategies.

The worker of a strategy tells what it saw too, since wrong types do not travel; what it tells can
only add faults to those that are found here.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.child.guarded_child import Ending
from femubench.core.conformance.fingerprints import fingerprint
from femubench.core.conformance.problems import UpdatingProblem
from femubench.core.conformance.results import Given, faults_of
from femubench.core.conformance.trial import Observation
from femubench.core.run.answers import AnswerError, unpack_outcome
from femubench.core.update.strategy import ParameterEstimate, UpdateResult

_TRAVELLED = "picklable"  # the check that a result has arrived


@dataclass(frozen=True)
class Handed:
    """What a strategy handed back, and what it is judged by.

    Arguments:
        answer: from the strategy's worker; nobody has looked into it yet.
        promises: what the strategy says that it keeps.
    """

    problem: UpdatingProblem
    answer: bytes
    promises: frozenset[str]


def judge_handed(handed: Handed) -> bytes:
    """Return faults and fingerprint of what was handed back as JSON; runs in a worker."""
    try:
        outcome = unpack_outcome(handed.answer, handed.problem.model)
    except AnswerError as error:
        return json.dumps([{_TRAVELLED: str(error)}, {}]).encode()
    if outcome.model is None:
        return json.dumps([{_TRAVELLED: outcome.reason or "there is no model in it"}, {}]).encode()
    result = UpdateResult(
        model=outcome.model,
        parameters=tuple(
            ParameterEstimate(p["name"], p["before"], p["after"], p["unit"], p["std"])
            for p in outcome.parameters
        ),
        history=outcome.history,
        diagnostics=outcome.diagnostics,
        parameter_count=outcome.parameter_count or 0,
    )
    with warnings.catch_warnings(), np.errstate(all="warn"):
        warnings.simplefilter("ignore")
        faults = faults_of(Given(handed.problem, result, handed.promises))
    return json.dumps([faults, fingerprint(result, "the result outside")]).encode()


def confirm_observation(seen: Observation, ending: Ending) -> Observation:
    """Return what a worker saw of a result, with what was found outside of it.

    Arguments:
        ending: of `judge_handed`.
    """
    if ending.how != "answer":
        faults, prints = {_TRAVELLED: f"it cannot be judged: {ending.reason}"}, {}
    else:
        faults, prints = json.loads(ending.answer)
    if seen.faults:  # why it did not arrive has been said
        faults.pop(_TRAVELLED, None)
    return replace(seen, faults={**faults, **seen.faults}, prints={**seen.prints, **prints})
