"""The lists of changes that strategies fit: factors on parts of a model, effects, both together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from femubench.core.change.change import Change
from femubench.core.change.parametric_model import ParametricModel
from femubench.core.change.tabulated import change_of
from femubench.core.errors import InputError, NotApplicable, UnknownNameError
from femubench.core.fem.frame import Frame
from femubench.core.fem.group_factors import GROUP, MATERIAL, SET, Groups
from femubench.core.fem.joints import JointGroup, elements_at, joint_groups
from femubench.core.fem.model import Model
from femubench.core.fem.slopes import Matrix
from femubench.core.fem.structure import Structure
from femubench.core.modal.group_prior import STRUCTURE_STD, GroupPriors
from femubench.core.plugin.loader import list_effects
from femubench.core.roles import Effect

PartSet = Literal["elements", "members", "joints", "sections", "materials", "sets", "groups"]
OWN = "own"  # the changes that a strategy has by itself
_MISSING = {
    "joints": "a frame whose members meet in joints",
    "sections": "a frame whose members have sections of the case",
    "materials": "a frame whose members, or groups that, have materials of the case",
    "sets": "`[[model.sets]]` in the case",
    "groups": "a model from matrices for which the case declares `[[model.groups]]`",
}
_KINDS = {"groups": GROUP, "sets": SET, "materials": MATERIAL}
_WIDEST = 3.0  # prior deviations to either side of a group's factor


def check_changes(words: str, *, parts_alone: bool = False) -> None:
    """Raise InputError for words that name no changes.

    Arguments:
        words: an option as it was typed: ``own``, or sets of parts and effects joined by ``+``.
        parts_alone: whether effects are none of them.
    """
    known = get_args(PartSet)
    if words == OWN:
        return
    if parts_alone and words not in known:
        raise InputError(f"the changes are one of {OWN}, {', '.join(known)}, not {words!r}")
    listed = words.split("+")
    for word in listed:
        if listed.count(word) > 1:
            raise InputError(f"changes: {word!r} stands there twice", expected="each once")
        if word in known:
            continue
        effect = word.partition("@")[0]
        if effect in (OWN, *known):
            rule = "alone" if effect == OWN else "without @: only effects have places"
            raise InputError(f"changes: {word!r}", expected=f"{effect!r} {rule}")
        # The code of others is imported where a strategy runs, not where its options are read.
        if "/" not in effect and all(found.name != effect for found in list_effects()):
            raise InputError(
                f"changes: there is no {word!r}",
                expected=f"{OWN}, {', '.join(known)} or effects that `bench plugins list` shows "
                "(those of others as PLUGIN/EFFECT), joined by +",
            )


def element_sets(structure: Structure, word: str) -> Mapping[str, tuple[str, ...]]:
    """Return the elements of every part of a frame that has a factor, by the name of the part.

    Arguments:
        word: a `PartSet`; every element carries mass, arms of joints are none.

    Raises:
        NotApplicable: when the frame has no such parts.
    """
    frame, labels = structure.frame, structure.elements
    if word == "elements":
        return {label: (label,) for label in labels}
    if word == "joints":
        found = {f"at {g.name}": elements_at(structure, g) for g in joint_groups(frame)}
    else:
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
        need = _MISSING.get(word, "a frame of members")
        raise NotApplicable(f"there are no {word} to scale: changes={word} needs {need}")
    _check_apart(found)
    return found


def _check_apart(parts: Mapping[str, Sequence[str]]) -> None:
    """Raise NotApplicable where two parts share an element: factors on both would be one."""
    owner: dict[str, str] = {}
    for name, elements in parts.items():
        for element in elements:
            if owner.setdefault(element, name) != name:
                raise NotApplicable(
                    f"{element} is in {owner[element]} and in {name}: factors need sets that share "
                    "no element"
                )


def _shared(name: str, changes: list[Change]) -> list[Change]:
    """Return one change for all of several."""
    if len(changes) < 2:
        return changes
    places = tuple(place for change in changes for place in change.places)
    return [replace(changes[0], name=f"stiffness {name}", places=places)]


def stiffness_quantity(structure: Structure) -> str:
    """Return ``EI`` in plane, as Horton et al. have it, else ``E``: bending and torsion alike."""
    return "EI" if structure.frame.plane == "in-plane" else "E"


def _places(effect: Effect, model: Model, place: str) -> list[str]:
    """Return where an effect sits: at a place that was named, or at its coarsest ones."""
    known = list(dict.fromkeys(effect.places(model)))
    if not known or (place and place not in known):
        where = f" at {place!r}, but at {', '.join(known[:8])}" if known else ""
        raise NotApplicable(f"changes: {effect.name} has no place in this model{where}")
    if place:
        return [place]
    frame = None if model.structure is None else model.structure.frame
    kinds = [_coarseness(frame, word) for word in known]
    return [word for word, kind in zip(known, kinds, strict=True) if kind == min(kinds)]


def _coarseness(frame: Frame | None, place: str) -> tuple[int, str]:
    """Return how large a place is, the largest first, and its kind among places so large."""
    prefix, _, rest = place.partition(":")
    if place == "all":
        return 0, ""
    if prefix in ("material", "section", "set", "group", "support") and rest:
        return 1, prefix
    if frame is None:
        return 3, ""
    if prefix == "type" or any(place == joint.type for joint in frame.joints):
        return 1, ""
    whole = {joint.name for joint in frame.joints} | {member.name for member in frame.members}
    return (2, "") if place in whole else (3, "")


@dataclass(frozen=True)
class Changes:
    """The changes that strategies fit to a model.

    Arguments:
        source: the nominal model, or the structure of a frame.
    """

    source: Model | Structure

    @property
    def structure(self) -> Structure | None:
        """Return the frame; None for a model that came as matrices."""
        return self.source.structure if isinstance(self.source, Model) else self.source

    @property
    def model(self) -> Model:
        """Return the model."""
        return self.source if isinstance(self.source, Model) else Model.of(self.source)

    def parts(self, word: str, *, prior_std: float | None = None) -> list[Change]:
        """Return one change a part: a factor on EA, EI, GJ and GA of a frame, or on groups.

        Arguments:
            word: a `PartSet`.
            prior_std: of its logarithm; None for no prior. Groups have their own.

        Raises:
            NotApplicable: when the model has no such parts.
        """
        structure = self.structure
        if structure is not None and word != "groups":
            return [
                Change.scale_property(f"E {name}", "E", elements, prior_std=prior_std)
                for name, elements in element_sets(structure, word).items()
            ]
        groups, kind = Groups(self.model), _KINDS.get(word)
        every = (*groups.places("stiffness"), *self.model.families)
        stiff = self.model.groups.keys()
        places = [p for p in every if kind and p.startswith(kind) and stiff & groups.names(p)]
        if not places:
            need = _MISSING.get(word, "a frame of members")
            raise NotApplicable(f"the model has no {word} to scale: changes={word} needs {need}")
        _check_apart({place: groups.names(place) for place in places})
        return self._factors("stiffness", places, own_prior=prior_std is not None)

    def groups(self, matrix: Matrix, *, own_prior: bool) -> list[Change]:
        """Return one change a group of the stiffness or of the mass.

        Arguments:
            matrix: ``stiffness`` or ``mass``.
            own_prior: whether each has the log-normal prior of its group; else none.

        Examples:
            >>> update.Changes(model).groups("mass", own_prior=True)
            []
        """
        return self._factors(matrix, Groups(self.model).places(matrix), own_prior=own_prior)

    def _factors(self, matrix: Matrix, places: Sequence[str], *, own_prior: bool) -> list[Change]:
        known, quantity = GroupPriors(self.model), "E" if matrix == "stiffness" else "density"
        found = []
        for place in places:
            name, std = place.removeprefix(GROUP), None
            if own_prior:
                std = known.std(name, matrix)
                limit = max(20.0, float(np.exp(_WIDEST * std)))
            else:
                held = known.supports.issuperset(Groups(self.model).names(place))
                limit = 100.0 if matrix == "stiffness" and held else 20.0
            at = f"{matrix} {place}", quantity, (place,)
            upper = min(limit, known.largest_factor(name)) if matrix == "stiffness" else limit
            found.append(Change.scale_property(*at, prior_std=std, lower=1.0 / limit, upper=upper))
        return found

    def groups_within(self, count: int) -> list[Change]:
        """Return factors on the groups of the stiffness, at most so many: what is alike shares one.

        Every group has its own; or every support has, and the structure shares one; or the supports
        share another one; or there is one for all.

        Arguments:
            count: how many factors there may be.

        Raises:
            NotApplicable: when the model has no groups.

        Examples:
            >>> from dataclasses import dataclass, replace
            >>> deck = replace(model, structure=None, groups={"deck": model.stiffness})
            >>> [change.name for change in update.Changes(deck).groups_within(3)]
            ['stiffness group:deck']
        """
        every = self.parts("groups")
        held = {f"{GROUP}{name}" for name in GroupPriors(self.model).supports}
        supports = [change for change in every if change.places[0] in held]
        rest = [change for change in every if change.places[0] not in held]
        levels = (
            every,
            [*supports, *_shared("structure", rest)],
            [*_shared("supports", supports), *_shared("structure", rest)],
        )
        return next(
            (level for level in levels if len(level) <= count), _shared("all groups", every)
        )

    def stiffness(self, prior_std: float | None = None) -> Change:
        """Return one factor on the stiffness of all members, of matrices on the whole stiffness.

        Arguments:
            prior_std: of its logarithm; None for no prior.

        Examples:
            >>> update.Changes(structure).stiffness().name
            'E all members'
        """
        structure = self.structure
        fatal = prior_std is None
        if structure is None:
            return Change.scale_property(
                "stiffness all", "E", ("all",), prior_std=prior_std, fatal=fatal
            )
        quantity, every = stiffness_quantity(structure), structure.elements
        name = f"{quantity} all members"
        return Change.scale_property(name, quantity, every, prior_std=prior_std, fatal=fatal)

    def joint(self, group: JointGroup, *, prior_std: float | None = None) -> Change:
        """Return one factor on the stiffness of the elements that touch joints.

        Arguments:
            group: which ends.
            prior_std: of its logarithm; None for no prior.

        Examples:
            >>> update.Changes(structure).joint(joints[0]).name
            'E at L'
        """
        structure = self.structure or self.model.frame_structure
        quantity, elements = stiffness_quantity(structure), elements_at(structure, group)
        at = f"{quantity} at {group.name}", quantity, elements
        return Change.scale_property(*at, prior_std=prior_std, lower=0.01, upper=100.0)

    @staticmethod
    def determined(levels: Sequence[Sequence[Change]], count: int) -> list[Change]:
        """Return the changes of the leading levels that so many data determine.

        Only as many parameters as measured frequencies are set free, as in the source; a level is
        taken as a whole or not at all, except that the first always gives one.

        Arguments:
            levels: changes of one parameter each, by descending importance.
            count: number of measured frequencies.

        Source: Horton et al. (1999), section 2.

        Examples:
            >>> levels = [[update.Changes(structure).stiffness()], [joint, joint]]
            >>> [len(update.Changes.determined(levels, count)) for count in (1, 2, 3)]
            [1, 1, 3]
        """
        taken: list[Change] = []
        for level in levels:
            if len(taken) + len(level) > count:
                break
            taken.extend(level)
        return taken or list(levels[0][:1])

    def listed(self, words: str, *, prior_std: float | None = None) -> list[Change]:
        """Return the changes that words name.

        A set of parts gives each part a factor on its stiffness. An effect sits at its coarsest
        places: the whole model, or joint types, sections and the like, or every joint or member, or
        what is smaller; ``effect@place`` at one place that is named. ``plugin/effect`` is one of
        somebody else.

        Arguments:
            words: sets of parts and effects joined by ``+``.
            prior_std: of the logarithm of a factor; None for no prior on anything.

        Raises:
            NotApplicable: when the model has no such parts, two factors on the same one, or no
                place for an effect.

        Examples:
            >>> names = [change.name for change in update.Changes(model).listed("sections+density")]
            >>> names
            ['E section:tube', 'density all']
        """
        found: list[Change] = []
        for word in words.split("+"):
            if word in get_args(PartSet):
                found += self.parts(word, prior_std=prior_std)
                continue
            name, _, place = word.partition("@")
            plugin, _, name = name.rpartition("/")
            try:
                known = list_effects(*([plugin] if plugin else []))
            except UnknownNameError as error:
                raise NotApplicable(f"changes: {error}") from error
            effect = next((found for found in known if found.name == name), None)
            if effect is None:
                raise NotApplicable(f"changes: there is no effect {name!r}")
            placed = [
                change_of(effect, self.model, where) for where in _places(effect, self.model, place)
            ]
            placed = [replace(c, name=f"{name} {c.places[0]}") for c in placed]
            found += placed if prior_std is not None else [c.without_prior() for c in placed]
        names = Groups(self.model).names
        _check_apart(
            {c.name: [n for p in c.places for n in names(p) or (p,)] for c in found if c.quantity}
        )
        return found

    def parameterise(self, words: str) -> ParametricModel:
        """Return a model with the changes that words name, each with a prior.

        Arguments:
            words: as of `listed`, or ``own``: the members of a frame, the groups of matrices.

        Raises:
            InputError: for other words.
            NotApplicable: when the model has no such parts, or two factors on the same one.

        Examples:
            >>> update.Changes(model).parameterise("members").names[0]
            'E rung-right'
        """
        check_changes(words)
        if words == OWN:
            words = "members" if self.structure is not None else "groups"
        return ParametricModel(self.model, tuple(self.listed(words, prior_std=STRUCTURE_STD)))
