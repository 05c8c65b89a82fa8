"""What a model lacks: ``bench diagnose``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

from threadpoolctl import threadpool_limits

from femubench.core.case.case import LARGEST_TOLERANCE, Case
from femubench.core.diagnosis.diagnose import diagnose as search
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.diagnosis.serial import diagnosis_to_json
from femubench.core.errors import InputError, NotApplicable
from femubench.core.files import check_new, make_folder
from femubench.core.inference.effort import Effort
from femubench.core.inference.settings import Value, overridden
from femubench.core.library.cases import CaseLike, as_list, one_case, usable_plugins, way_of
from femubench.core.pace import OnAdvance
from femubench.core.plugin.loader import Plugins, list_faults
from femubench.core.plugin.validation import check_effect, choose_names
from femubench.core.roles import Effect

# Verdicts that leave no model to write.
_NO_MODEL = ("none", "unknown")
_LONGEST = 70  # of 80 characters that a name may have


def diagnose(
    case: CaseLike,
    effects: str | Effect | Iterable[str | Effect] | None = None,
    *,
    pairs: bool = True,
    faults: bool = True,
    tolerance: float | None = None,
    budget: float | None = None,
    output: str | PathLike[str] | None = None,
    plugins: Iterable[str] = (),
) -> Diagnosis:
    """Return what is missing in a case's model, where, how sure, and what it gains.

    Held-out modes and modified structures never enter the naming; they confirm it or not.

    Arguments:
        case: a name, a folder or a `Case`.
        effects: what may be missing, by name or as effects; by default all that come with
            femubench.
        pairs: whether more than one cause is sought.
        faults: whether faults of the data and of what was typed in are sought too.
        tolerance: standard deviation of every element's relative scatter; the case's by default.
        budget: seconds after which it ends, and a note says what was left out; None for no end.
            What is found then depends on how fast the machine is.
        output: new folder for the extended model as a case, where one was found.
        plugins: installed plugins whose effects and faults are tried too; they are imported here.

    Raises:
        InputError: when the case or an effect is unknown, the case lacks what it takes, or a
            number is out of range.
        ModelError: when the model has no modes.

    Examples:
        >>> femubench.diagnose(case, torsion, pairs=False).causes[0].effect == torsion.name
        True
    """
    if output is not None:
        check_new(Path(output))
    found = diagnosis_of(
        *(case, effects, usable_plugins()),
        pairs=pairs,
        faults=faults,
        tolerance=tolerance,
        budget=budget,
        others=tuple(plugins),
    )
    if output is not None and has_model(found):
        write_extended(found, Path(output))
    return found


def diagnosis_of(
    case: CaseLike,
    effects: str | Effect | Iterable[str | Effect] | None,
    plugins: Plugins,
    *,
    pairs: bool = True,
    faults: bool = True,
    tolerance: float | None = None,
    budget: float | None = None,
    on_advance: OnAdvance | None = None,
    others: Sequence[str] = (),
    decisions: Mapping[str, Value] | None = None,
) -> Diagnosis:
    """Return the diagnosis; see `diagnose`.

    `on_advance` is called with the progress and the time that is left; `others` are the third-party
    plugins to use; `decisions` are settings with other values than the standard ones.
    """
    if budget is not None and not budget >= 0.0:
        raise InputError(f"budget = {budget!r}", expected="seconds >= 0")
    if tolerance is not None and not 0.0 <= tolerance <= LARGEST_TOLERANCE:
        expected = f"a number >= 0 and <= {LARGEST_TOLERANCE}"
        raise InputError(f"tolerance = {tolerance!r}", expected=expected)
    effort = Effort(budget, on_advance)
    wanted = _effects(effects, plugins, others)
    read = one_case(case, plugins)
    if tolerance is not None:
        read = replace(read, tolerance=tolerance)
    try:
        # Many small matrices: threads would only wait for each other.
        with threadpool_limits(1), overridden(decisions or {}):
            wrong = (list_faults(*others) if others else None) if faults else ()
            return search(read, effects=wanted, faults=wrong, pairs=pairs, effort=effort)
    except NotApplicable as fault:
        raise InputError(f"cannot be diagnosed: {fault}", file=read.folder) from fault


def _effects(given: object, plugins: Plugins, others: Sequence[str]) -> list[Effect]:
    """Return the effects to try: those given or those that came along, and those of the others.

    Raises:
        InputError: for an unknown one, or an unknown plugin.
    """
    choose_names("plugin", others, (plugin.plugin for plugin in plugins.loaded))
    strange = [plugin for plugin in plugins.loaded if not plugin.own]
    added = [name for p in strange if p.plugin in others for name in p.offers["effects"]]
    left = {name for p in strange for name in p.offers["effects"]}.difference(added)
    wanted = [*plugins.effects] if given is None else [*as_list(given), *added]
    wanted = [item for item in wanted if given is not None or item not in left]
    choose_names("effect", (item for item in wanted if isinstance(item, str)), plugins.effects)
    unique = [item for i, item in enumerate(wanted) if item not in wanted[:i]]
    return [plugins.effects[e] if isinstance(e, str) else check_effect(e) for e in unique]


def has_model(found: Diagnosis) -> bool:
    """Tell whether a diagnosis has an extended model."""
    named = found.verdict not in _NO_MODEL and bool(found.causes)
    return named or found.provisional is not None


def write_extended(found: Diagnosis, folder: Path) -> None:
    """Write the extended model of a diagnosis as a case.

    Raises:
        FemubenchError: when it cannot be written as a case.
    """
    from femubench.core.case.writing import write_case

    case = found.subject
    assert isinstance(case, Case)
    make_folder(folder.parent)
    comment = way_of("terminal", "diagnosis_lines")(diagnosis_to_json(found))
    # A name of its own, so that both cases can be run together.
    name = f"{case.name[:_LONGEST]}-extended"
    write_case(folder, case, found.extended, comment=comment, name=name)
