"""Whether data that did not name a cause bear it out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench.core.case.case import Case
from femubench.core.diagnosis.exact import extended
from femubench.core.diagnosis.examine import Examination
from femubench.core.diagnosis.explanation import Explanation, Key, Posterior
from femubench.core.diagnosis.fit import bounds_of
from femubench.core.diagnosis.gain import Unseen, held_out, modified
from femubench.core.diagnosis.verdict import inseparable
from femubench.core.model import Model

_TIED, _PLACES = 0.1, 6


def extended_by(model: Model, explanation: Explanation) -> Model:
    """Return the model with textbook effects and causes in it."""
    base = extended(model, explanation.base.parts, explanation.base.x)
    return extended(base, explanation.parts, explanation.fit.state.x)


def unseen_of(
    case: Case,
    examination: Examination,
    explanation: Explanation,
    model: Model,
    *,
    sharply: bool = True,
) -> tuple[Unseen, ...]:
    """Return the errors of an explanation on held-out modes and on the modified structures.

    Arguments:
        case: what holds them.
        examination: what the explanation was weighed in.
        explanation: base and causes.
        model: with the explanation in it.
        sharply: take the sizes of the causes for certain on the modified structures, which saves
            a solution a size; held-out modes know their uncertainty anyway.
    """
    nominal, problem = examination.problem, examination.problem_of(explanation)
    near = () if sharply else _neighbours(case.model, explanation)
    return (
        held_out(case, nominal, problem, explanation.fit, model, examination.scatter),
        modified(case, model, nominal.data.bias, examination.scatter, near),
    )


def _neighbours(model: Model, explanation: Explanation) -> list[Model]:
    """Return the model with the causes off by one deviation in independent directions."""
    found = explanation.fit
    size, turn = np.linalg.eigh(found.covariance)
    low, high = bounds_of(found.parts)
    base = extended(model, explanation.base.parts, explanation.base.x)
    steps = [
        np.clip(found.state.x + np.sqrt(s) * t, low, high)
        for s, t in zip(size, turn.T, strict=True)
    ]
    return [extended(base, found.parts, x) for x in steps]


def stands(
    case: Case,
    examination: Examination,
    explanation: Explanation,
    model: Model,
    unseen: Sequence[Unseen],
) -> bool:
    """Tell whether unseen data bear an explanation out.

    Arguments:
        case: what holds them.
        examination: what the explanation was weighed in.
        explanation: base and causes.
        model: with the explanation in it.
        unseen: its errors.
    """
    count = len(explanation.parts)
    if all(part.confirms(count) for part in unseen):
        return True
    if not count or not case.modifications:
        return False
    unseen = unseen_of(case, examination, explanation, model, sharply=False)
    return all(part.confirms(count) for part in unseen)


def another_stands(case: Case, examination: Examination) -> bool:
    """Tell whether unseen data bear out what the used data cannot tell from the best guess.

    That is another name of the group, or the same name at a place about as likely.
    """
    posterior = examination.posterior
    if not any(posterior.names) or not (case.held_out or case.modifications):
        return False
    group = inseparable(posterior)[0]
    others = [posterior.best(key) for key in group[1:]]
    others += _other_places(posterior, group[0])
    for other in others:
        model = extended_by(case.model, other)
        if stands(case, examination, other, model, unseen_of(case, examination, other, model)):
            return True
    return False


def _other_places(posterior: Posterior, key: Key) -> list[Explanation]:
    """Return the explanations of a name at other places that are not much less likely."""
    (_, most), *rest = posterior.members(key)
    return [e for e, p in rest if p >= _TIED * most][:_PLACES]
