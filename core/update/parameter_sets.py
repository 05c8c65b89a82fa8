"""Sets of stiffness factors: one on every element, member, section, material, set or group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.group_factors import GROUP, Matrix, group_places
from femubench.core.fem.joints import all_elements
from femubench.core.fem.model import Model
from femubench.core.fem.model_parameters import MatrixSlopes, matrix_slopes, with_values
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure
from femubench.core.modal.group_prior import STRUCTURE_STD, group_prior_std, support_groups
from femubench.core.typing import FloatArray
from femubench.core.update.unknowns import Unknown

ParameterSet = Literal["elements", "members", "sections", "materials", "sets", "groups"]
OWN = "own"  # the parameters that a strategy has by itself
_MISSING = {
    "sections": "a frame whose members have sections of the case",
    "materials": "a frame whose members have materials of the case",
    "sets": "`[[model.sets]]` in the case",
    "groups": "a model from matrices for which the case declares `[[model.groups]]`",
}
_WIDEST = 3.0  # prior deviations to either side of a group's factor


def checked_set(word: str, *, own: bool = False) -> None:
    """Raise InputError for a word that names no parameter set.

    Arguments:
        word: an option as it was typed.
        own: whether a strategy has parameters of its own, under the word ``own``.

    Examples:
        >>> update.checked_set("members")
    """
    known = (*((OWN,) if own else ()), *get_args(ParameterSet))
    if word not in known:
        raise InputError(f"the parameters are {', '.join(known[:-1])} or groups, not {word!r}")


def element_sets(structure: Structure, word: str) -> Mapping[str, tuple[str, ...]]:
    """Return the elements of every part of a frame that has a factor, by the name of the part.

    Arguments:
        structure: the meshed frame.
        word: a `ParameterSet`; every element carries mass, arms of joints are none.

    Raises:
        NotApplicable: when the frame has no such parts.

    Examples:
        >>> len(update.element_sets(structure, "members"))
        7
    """
    frame, labels = structure.frame, all_elements(structure)
    if word == "elements":
        return {label: (label,) for label in labels}
    kind = {"sections": "section:", "materials": "material:"}.get(word)
    families = {f.name: f.members for f in frame.families if kind and f.name.startswith(kind)}
    members: Mapping[str, Mapping[str, tuple[str, ...]]] = {
        "members": {member.name: (member.name,) for member in frame.members},
        "sets": {f"set:{found.name}": found.members for found in frame.sets},
    }
    parts = {
        name: tuple(label for label in labels if label.rpartition("/")[0] in chosen)
        for name, chosen in members.get(word, families).items()
    }
    found = {name: elements for name, elements in parts.items() if elements}
    if not found:
        raise NotApplicable(f"there are no {word} to scale: parameters={word} needs {_need(word)}")
    _check_apart(found)
    return found


def _check_apart(parts: Mapping[str, tuple[str, ...]]) -> None:
    """Raise NotApplicable where two parts share an element: factors on both would be one."""
    owner: dict[str, str] = {}
    for name, elements in parts.items():
        for element in elements:
            if owner.setdefault(element, name) != name:
                raise NotApplicable(
                    f"{element} is in {owner[element]} and in {name}: factors need sets that share "
                    "no element"
                )


def _need(word: str) -> str:
    return _MISSING.get(word, "a frame of members")


def stiffness_factors(
    source: Model | Structure, word: str, *, prior_std: float | None = None
) -> list[Unknown]:
    """Return one unknown a part: of a frame a factor on EA, EI, GJ and GA together, or of a group.

    Arguments:
        source: the nominal model, or the structure of a frame.
        word: a `ParameterSet`.
        prior_std: of its logarithm; None for no prior. Groups have their own.

    Raises:
        NotApplicable: when the model has no such parts.

    Examples:
        >>> update.stiffness_factors(structure, "sections")[0].parameter.name
        'E section:tube'
    """
    structure = source.structure if isinstance(source, Model) else source
    if isinstance(source, Model) and (structure is None or word == "groups"):
        return _group_stiffness(source, word, own_prior=prior_std is not None)
    if structure is None or word == "groups":
        raise _without(word)
    return [
        Unknown(Parameter(f"E {name}", "E", elements), prior_std=prior_std)
        for name, elements in element_sets(structure, word).items()
    ]


def _without(word: str) -> NotApplicable:
    return NotApplicable(f"the model has no {word} to scale: parameters={word} needs {_need(word)}")


def _group_stiffness(model: Model, word: str, *, own_prior: bool) -> list[Unknown]:
    if word != "groups" or not model.groups:
        raise _without(word)
    return group_factors(model, "stiffness", own_prior=own_prior)


def group_factors(model: Model, matrix: Matrix, *, own_prior: bool) -> list[Unknown]:
    """Return one unknown a group of the stiffness or of the mass.

    Arguments:
        model: from matrices.
        matrix: ``stiffness`` or ``mass``.
        own_prior: whether each has the log-normal prior of its group; else none.

    Examples:
        >>> update.group_factors(model, "mass", own_prior=True)
        []
    """
    quantity = "E" if matrix == "stiffness" else "density"
    found = []
    for place in group_places(model, matrix):
        parameter = Parameter(f"{matrix} {place}", quantity, (place,))
        name = place.removeprefix(GROUP)
        if own_prior:
            std = group_prior_std(model, name)
            limit = max(20.0, float(np.exp(_WIDEST * std)))
            found.append(Unknown(parameter, lower=1.0 / limit, upper=limit, prior_std=std))
        else:
            limit = 100.0 if matrix == "stiffness" and name in support_groups(model) else 20.0
            found.append(Unknown(parameter, lower=1.0 / limit, upper=limit))
    return found


def groups_within_count(model: Model, count: int) -> list[Unknown]:
    """Return factors on the groups of the stiffness, at most so many: what is alike shares one.

    Every group has its own; or every support has, and the structure shares one; or the supports
    share another one; or there is one for all.

    Arguments:
        model: from matrices with groups.
        count: how many factors there may be.

    Raises:
        NotApplicable: when the model has no groups.

    Examples:
        >>> from dataclasses import replace
        >>> deck = replace(model, structure=None, groups={"deck": model.stiffness})
        >>> [unknown.parameter.name for unknown in update.groups_within_count(deck, 3)]
        ['stiffness group:deck']
    """
    every = stiffness_factors(model, "groups")
    held = {f"{GROUP}{name}" for name in support_groups(model)}
    supports = [u for u in every if u.parameter.places[0] in held]
    rest = [u for u in every if u.parameter.places[0] not in held]
    levels = (
        every,
        [*_shared("supports", supports, apart=True), *_shared("structure", rest)],
        [*_shared("supports", supports), *_shared("structure", rest)],
    )
    return next((level for level in levels if len(level) <= count), _shared("all groups", every))


def _shared(name: str, unknowns: list[Unknown], *, apart: bool = False) -> list[Unknown]:
    """Return one unknown for all of several, or each of them."""
    if apart or len(unknowns) < 2:
        return unknowns
    places = tuple(place for unknown in unknowns for place in unknown.parameter.places)
    return [replace(unknowns[0], parameter=Parameter(f"stiffness {name}", "E", places))]


@dataclass(frozen=True)
class StiffnessParts:
    """A model whose stiffness is K = K_0 + sum_j (theta_j - 1) K_j, factors theta_j.

    Arguments:
        model: the nominal one, at factors of 1.
        names: of the factors.
        parameters: the factors themselves.
        spread: prior standard deviation of each ln theta, relative to that of a structure, (p,).
    """

    model: Model
    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    spread: FloatArray

    def __len__(self) -> int:
        return len(self.names)

    def at(self, factors: Sequence[float] | FloatArray) -> Model:
        """Return the model with other factors, (p,); a frame stays one.

        Examples:
            >>> parts = update.stiffness_parts(model, "members")
            >>> parts.at(np.full(7, 2.0)).size
            81
        """
        return with_values(self.model, self.parameters, factors)

    def of(self, chosen: Sequence[int]) -> StiffnessParts:
        """Return the same model with some of the factors only."""
        return StiffnessParts(
            self.model,
            tuple(self.names[j] for j in chosen),
            tuple(self.parameters[j] for j in chosen),
            self.spread[list(chosen)],
        )

    @cached_property
    def slopes(self) -> MatrixSlopes:
        """Return the parts K_j, which are the slopes of the stiffness by the factors.

        All rigidities of an element grow with E alike, so that the stiffness is linear in them.
        """
        return matrix_slopes(self.model, self.parameters)

    def energies(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left_i' K_j right_k, (p, m_left, m_right)."""
        return self.slopes.inner(left, right)


def stiffness_parts(model: Model, word: str) -> StiffnessParts:
    """Return the parts of a model's stiffness that have a factor each.

    Arguments:
        model: a frame, or matrices with groups.
        word: a `ParameterSet`, or ``own``: the members of a frame, the groups of matrices.

    Raises:
        InputError: for another word.
        NotApplicable: when the model has no such parts.

    Examples:
        >>> update.stiffness_parts(model, "members").names[0]
        'E rung-right'
    """
    checked_set(word, own=True)
    if word == OWN:
        word = "members" if model.structure is not None else "groups"
    parameters = tuple(unknown.parameter for unknown in stiffness_factors(model, word))
    names = tuple(p.name for p in parameters)
    structure = model.structure
    if structure is None:
        std = [group_prior_std(model, name) for name in model.groups]
        spread = np.array(std) / STRUCTURE_STD
        return StiffnessParts(model, names, parameters, spread)
    return StiffnessParts(model, names, parameters, np.ones(len(names)))
