"""Which blocks of a run count in its ranks, and how much: unseen data, and nothing twice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from femubench.core.schema.results import UNSEEN

References = Mapping[str, Mapping[str, float]]
Weights = dict[tuple[str, str], float]
# Stands for the score of a case that has one, where its nominal errors are not known.
WHOLE = ""
_DIGITS = 9  # of a nominal error; two cases of a structure that share them share the data


def choose_blocks(blocks: Iterable[str]) -> tuple[str, ...]:
    """Return the blocks of a case that count: the unseen ones, all where it holds nothing back.

    Examples:
        >>> results.choose_blocks(["used", "higher"])
        ('higher',)
    """
    listed = tuple(blocks)
    return tuple(name for name in listed if name in UNSEEN) or listed


def block_weights(references: References, structures: Mapping[str, str]) -> Weights:
    """Return by case and block how much it counts.

    Where one case at least has unseen data, a case without any counts nothing. A block that
    several cases of one structure share counts once, each time a share.

    Arguments:
        references: rms error of the nominal model in percent by case and block.
        structures: by case; one that is not named is a structure of its own.

    Examples:
        >>> known = {"a": {"used": 2.0, "higher": 3.0}, "b": {"used": 4.0, "higher": 3.0}}
        >>> results.block_weights(known, {"a": "ladder", "b": "ladder"})
        {('a', 'higher'): 0.5, ('b', 'higher'): 0.5}
    """
    some = any(name in UNSEEN for errors in references.values() for name in errors)
    named = {
        (case, name): (structures.get(case, case), name, f"{errors[name]:.{_DIGITS}g}")
        for case, errors in references.items()
        for name in choose_blocks(errors)
        if name in UNSEEN or not some
    }
    often = Counter(named.values())
    return {block: 1.0 / often[data] for block, data in named.items()}


def block_shares(
    references: References, structures: Mapping[str, str]
) -> dict[str, dict[str, float]]:
    """Return by case and block how much it counts; the blocks of a structure come to 1.

    Arguments:
        references, structures: as for `block_weights`.
    """
    weights = block_weights(references, structures)
    owner = {case: structures.get(case, case) for case in references}
    shares: dict[str, dict[str, float]] = {
        case: {} for case, errors in references.items() if errors
    }
    counted: dict[str, float] = {}
    for (case, _), weight in weights.items():
        counted[owner[case]] = counted.get(owner[case], 0.0) + weight
    for (case, name), weight in weights.items():
        shares[case][name] = weight / counted[owner[case]]
    return shares
