"""Models of other programs: read them, and write them updated in the format they came in."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.case.model_files import (
    ModelFiles,
    files_of,
    read_model as read_files,
    write_model as write_files,
)
from femubench.core.case.reducing import expand_model
from femubench.core.case.schema import LengthUnit
from femubench.core.case.units import METRES
from femubench.core.case.writing import write_case
from femubench.core.errors import InputError, ModelError, NotApplicable, StrategyFailure
from femubench.core.fem.model import Model
from femubench.core.files import folder_made
from femubench.core.library.cases import CaseLike, one_case, usable_plugins
from femubench.core.plugin.loader import Plugins
from femubench.core.plugin.validation import choose_names
from femubench.core.plugin.variants import strategy_of
from femubench.core.roles import Reader, list_declared
from femubench.core.run.jobs import missing_capability, seed_words

FileLike = str | PathLike[str]


def read_model(
    file: FileLike,
    mass: FileLike | None = None,
    dofs: FileLike | None = None,
    unit: LengthUnit = "m",
) -> Model:
    """Return the model of a file of another program, in SI.

    Arguments:
        file: with a whole model, or with the stiffness where `mass` is given.
        mass: with the mass matrix alone.
        dofs: labels or coordinates that the other files lack.
        unit: of the lengths in the files: m, cm, mm, in or ft; see `kind = "file"` of a case.

    Raises:
        InputError: for a kind of file that no reader reads, and all that is wrong in the files.

    Examples:
        >>> labels = {name: getattr(model.dofs, name) for name in ("node", "direction", "xyz")}
        >>> matrices = {"K": model.stiffness.toarray(), "M": model.mass.toarray()}
        >>> np.savez("model.npz", **matrices, **labels)
        >>> femubench.read_model("model.npz").size == model.size
        True
    """
    return read_files(_paths(file, mass, dofs), _readers(unit), unit)


def write_model(
    model: Model,
    folder: FileLike,
    like: FileLike,
    mass: FileLike | None = None,
    unit: LengthUnit = "m",
) -> None:
    """Write an updated model in the format that it came in, under the names of its files.

    Arguments:
        model: in SI, on the rows that it had when it was read.
        folder: another one than that of the files; made where it is not there.
        like: the file that the model came from, or the stiffness where `mass` is given.
        mass: the file that its mass came from.
        unit: of the lengths in the files.

    Raises:
        InputError: for a format that is not written, or files of another model.

    Examples:
        >>> np.savez("model.npz", K=model.stiffness.toarray(), M=model.mass.toarray())
        >>> femubench.write_model(result.model, "updated", like="model.npz")
        >>> bool(np.load("updated/model.npz")["K"][0, 0] == result.model.stiffness[0, 0])
        True
    """
    files, readers = _paths(like, mass, None), _readers(unit)
    with folder_made(Path(folder)):
        write_files(model, Path(folder), files, readers, unit)


def _paths(model: FileLike, mass: FileLike | None, dofs: FileLike | None) -> ModelFiles:
    further = (None if file is None else Path(file) for file in (mass, dofs))
    return ModelFiles(Path(model), *further)


def _readers(unit: LengthUnit) -> tuple[Reader, ...]:
    if unit not in METRES:
        raise InputError(f"unit = {unit!r}", expected=f"one of {', '.join(METRES)}")
    return tuple(usable_plugins().readers.values())


def update_case(
    case: CaseLike, strategy: str, seed: int, plugins: Plugins
) -> tuple[Case, Model, Sequence[Any]]:
    """Return a case, its model as a strategy updates it, from the drawn one, and its parameters.

    Arguments:
        strategy: ``NAME`` or ``NAME:OPTION=VALUE,...``.

    Raises:
        InputError: where the strategy gives no model, with its reason.
    """
    choose_names("strategy", [strategy.partition(":")[0]], plugins.strategies)
    method, read = strategy_of(strategy, plugins.strategies), one_case(case, plugins)
    measurement = read.used_measurement()
    try:
        needs = frozenset(list_declared(method, "needs"))
        if reason := missing_capability(needs, read.model, measurement):
            raise NotApplicable(reason)
        words = np.random.SeedSequence(seed_words(read.name, method.name, seed))
        with threadpool_limits(1):
            result = method.update(read.model, measurement, np.random.default_rng(words))
    except (NotApplicable, StrategyFailure) as fault:
        raise InputError(f"{strategy} gives no model: {fault}", file=read.folder) from fault
    assert isinstance(result.model, Model)
    return read, result.model, result.parameters


def write_updated(case: Case, model: Model, folder: Path, plugins: Plugins) -> None:
    """Write the updated model of a case as its model came: files, or else a case folder.

    Raises:
        InputError: for a model that its format cannot hold.
    """
    found = files_of(case.folder, case.drawing)
    if found is None:
        write_case(folder, case, model, name=f"{case.name[:60]}-updated")
        return
    files, unit = found
    try:
        model = expand_model(case, model)
    except ModelError as error:
        what, expected = str(error), "a strategy that changes factors of groups"
        raise InputError(what, file=folder, expected=expected) from None
    with folder_made(folder):
        write_files(model, folder, files, tuple(plugins.readers.values()), unit)
