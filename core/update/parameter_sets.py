"""Sets of stiffness factors: one on every element, member, section, material, set or group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from femubench.core.errors import InputError, NotApplicable
from femubench.core.fem.joints import all_elements
from femubench.core.fem.model import Model
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.structure import Structure
from femubench.core.typing import FloatArray, SparseArray
from femubench.core.update.unknowns import Unknown

ParameterSet = Literal["elements", "members", "sections", "materials", "sets", "groups"]
OWN = "own"  # the parameters that a strategy has by itself
_MISSING = {
    "sections": "a frame whose members have sections of the case",
    "materials": "a frame whose members have materials of the case",
    "sets": "`[[model.sets]]` in the case",
    "groups": "a model from matrices with `[[model.groups]]`",
}


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
    structure: Structure, word: str, *, prior_std: float | None = None
) -> list[Unknown]:
    """Return one unknown a part of a frame: a factor on EA, EI, GJ and GA together.

    Arguments:
        structure: the meshed frame.
        word: a `ParameterSet`.
        prior_std: of its logarithm; None for no prior.

    Raises:
        NotApplicable: when the frame has no such parts.

    Examples:
        >>> update.stiffness_factors(structure, "sections")[0].parameter.name
        'E section:tube'
    """
    parts = element_sets(structure, word)
    return [
        Unknown(Parameter(f"E {name}", "E", elements), prior_std=prior_std)
        for name, elements in parts.items()
    ]


@dataclass(frozen=True)
class StiffnessParts:
    """A model whose stiffness is K = K_0 + sum_j (theta_j - 1) K_j, factors theta_j.

    Arguments:
        model: the nominal one, at factors of 1.
        names: of the factors.
        matrices: the parts K_j, sparse (n, n) each.
        parameters: the same in the frame; empty where the parts are groups of matrices.
    """

    model: Model
    names: tuple[str, ...]
    matrices: tuple[SparseArray, ...]
    parameters: tuple[Parameter, ...] = ()

    def __len__(self) -> int:
        return len(self.names)

    def at(self, factors: Sequence[float] | FloatArray) -> Model:
        """Return the model with other factors, (p,); a frame stays one.

        Examples:
            >>> parts = update.stiffness_parts(model, "members")
            >>> parts.at(np.full(7, 2.0)).size
            81
        """
        if self.parameters:
            structure = self.model.frame_structure
            return Model.of(structure.with_values(self.parameters, factors))
        stiffness = self.model.stiffness
        for factor, part in zip(factors, self.matrices, strict=True):
            stiffness = stiffness + (factor - 1.0) * part
        return replace(self.model, stiffness=stiffness)

    def of(self, chosen: Sequence[int]) -> StiffnessParts:
        """Return the same model with some of the factors only."""
        return StiffnessParts(
            self.model,
            tuple(self.names[j] for j in chosen),
            tuple(self.matrices[j] for j in chosen),
            tuple(self.parameters[j] for j in chosen) if self.parameters else (),
        )

    def energies(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left_i' K_j right_k, (p, m_left, m_right)."""
        return np.array([left.T @ (part @ right) for part in self.matrices])


def stiffness_parts(model: Model, word: str) -> StiffnessParts:
    """Return the parts of a model's stiffness that have a factor each.

    Arguments:
        model: a frame, or matrices with groups.
        word: a `ParameterSet`.

    Raises:
        InputError: for another word.
        NotApplicable: when the model has no such parts.

    Examples:
        >>> update.stiffness_parts(model, "members").names[0]
        'E rung-right'
    """
    checked_set(word)
    if word == "groups" or model.structure is None:
        if word != "groups" or not model.groups:
            raise NotApplicable(
                f"the model has no {word} to scale: parameters={word} needs {_need(word)}"
            )
        return StiffnessParts(model, tuple(model.groups), tuple(model.groups.values()))
    structure = model.structure
    parameters = [unknown.parameter for unknown in stiffness_factors(structure, word)]
    nominal = structure.matrices()[1]
    # All rigidities of an element grow with E alike, so the stiffness is linear in the factor.
    parts = [structure.with_values([p], [2.0]).matrices()[1] - nominal for p in parameters]
    return StiffnessParts(model, tuple(p.name for p in parameters), tuple(parts), tuple(parameters))
