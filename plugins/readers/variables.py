"""Models in files that hold variables by name: NumPy, HDF5, MATLAB, OP4."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from femubench import InputError
from femubench.plugins.readers.reading import DIRECTIONS, directions, open_broken, words_of

if TYPE_CHECKING:
    from femubench import Measurement, Model
    from femubench.fem import SparseArray
    from femubench.modal import FrequencyResponses, TimeSignals

Variables: TypeAlias = Mapping[str, Any]  # arrays, sparse matrices, arrays of words
STIFFNESS = ("stiffness", "k", "kaa", "kgg", "kaax", "kjj", "kll", "k_whole", "k0")
MASS = ("mass", "m", "maa", "mgg", "maax", "mjj", "mll", "m_whole", "m0")
_PARTS = ("k_", "group_", "groups/")  # begin the names of parts of the stiffness
_NODES, _DIRECTIONS, _PLACES = ("node", "nodes"), ("direction", "directions"), ("xyz",)


def is_matrix(value: Any) -> bool:  # noqa: ANN401 - a variable may be anything
    """Tell whether a variable is a square matrix of numbers."""
    shape: tuple[int, ...] = getattr(value, "shape", ())
    number = getattr(value, "dtype", np.dtype("O")).kind in "fiu"
    return len(shape) == 2 and shape[0] == shape[1] > 0 and number


def choose_name(variables: Variables, known: tuple[str, ...], path: Path) -> str:
    """Return the name of the stiffness or of the mass.

    It bears one of the known names, in upper or lower case, or is the only matrix whose name
    begins with their letter.

    Raises:
        InputError: where there is none, or more than one.
    """
    matrices = [name for name, value in variables.items() if is_matrix(value)]
    for wanted in known:
        for name in matrices:
            if name.lower() == wanted:
                return name
    near = [name for name in matrices if name.lower().startswith(known[1])]
    if len(near) == 1:
        return near[0]
    what = f"no matrix is the {known[0]}; there are {', '.join(matrices[:12]) or 'none'}"
    raise InputError(what, file=path, expected=f"one called {', '.join(known)}")


def only_matrix(variables: Variables, path: Path) -> str:
    """Return the name of the one matrix that a file has.

    Raises:
        InputError: where there is none, or more than one.
    """
    found = [name for name, value in variables.items() if is_matrix(value)]
    if len(found) != 1:
        what = f"{len(found)} square matrices {', '.join(found[:12])}"
        expected = 'one; kind = "file" reads stiffness and mass of one file'
        raise InputError(what, file=path, expected=expected)
    return found[0]


def main_matrix(variables: Variables, known: tuple[str, ...], path: Path) -> str:
    """Return the name of the matrix of a pair: the only one, or that which `chosen` knows."""
    matrices = [name for name, value in variables.items() if is_matrix(value)]
    return matrices[0] if len(matrices) == 1 else choose_name(variables, known, path)


def group_variables(variables: Variables, stiffness: str) -> dict[str, str]:
    """Return from the name of a group to the variable that has its part of the stiffness."""
    size = variables[stiffness].shape
    found = {}
    for name, value in variables.items():
        start = next((p for p in _PARTS if name.lower().startswith(p)), None)
        if start and name != stiffness and is_matrix(value) and value.shape == size:
            found[name[len(start) :]] = name
    return found


def model_of(variables: Variables, path: Path) -> Model:
    """Return the model of a file: stiffness, mass, groups, and labels where it has them.

    Labels are `node` (numbers or words), `direction` (words, or 1 to 6) and `xyz`, one a row.

    Raises:
        InputError: where a matrix is missing, or labels do not fit.
    """
    # Not on top: a process that reads a file apart does without models.
    from femubench.fem import ModelError, matrix_model

    stiffness, mass = choose_name(variables, STIFFNESS, path), choose_name(variables, MASS, path)
    groups = group_variables(variables, stiffness)
    words = {name.lower(): value for name, value in variables.items()}
    nodes, along, xyz = (
        next((words[name] for name in names if name in words), None)
        for names in (_NODES, _DIRECTIONS, _PLACES)
    )
    try:
        return matrix_model(
            variables[mass],
            variables[stiffness],
            nodes=None if nodes is None else words_of(nodes),
            directions=None if along is None else _directions(along, path),
            xyz=None if xyz is None else np.asarray(xyz, dtype=float),
            groups={group: variables[name] for group, name in groups.items()},
        )
    except ModelError as error:
        raise InputError(
            str(error), file=path, expected="labels and matrices of one size"
        ) from None


def _directions(column: Any, path: Path) -> tuple[str, ...]:  # noqa: ANN401
    words = words_of(column)
    if all(word.isdigit() and len(word) < 9 for word in words):
        return directions([int(word) for word in words], path)
    for word in words:
        if word not in DIRECTIONS:
            expected = f"{', '.join(DIRECTIONS)}, or 1 to 6"
            raise InputError(f"direction {word!r}", file=path, expected=expected)
    return tuple(words)


class VariablesReader(ABC):
    """Reads and writes models of a format that holds variables by name.

    A format has a name, suffixes, and two methods of its own.
    """

    name: str
    suffixes: tuple[str, ...]

    @abstractmethod
    def variables(self, path: Path) -> dict[str, Any]:
        """Return everything in a file that may be a matrix or labels; raises InputError."""

    @abstractmethod
    def save(self, path: Path, original: Path, new: Variables) -> None:
        """Write what is in the original with some variables renewed."""

    def read_matrix(self, path: Path) -> SparseArray:
        """Return the only matrix; raises InputError."""
        found = self.variables(path)
        return sp.csc_array(found[only_matrix(found, path)])

    def read_model(self, path: Path) -> Model:
        """Return stiffness, mass, groups and labels; raises InputError."""
        return model_of(self.variables(path), path)

    def read_pair(self, stiffness: Path, mass: Path) -> Model:
        """Return a model whose mass is in a file of its own; raises InputError."""
        first, second = self.variables(stiffness), self.variables(mass)
        own = first.pop(main_matrix(first, STIFFNESS, stiffness))
        other = second[main_matrix(second, MASS, mass)]
        return model_of({**first, STIFFNESS[0]: own, MASS[0]: other}, stiffness)

    def read_modes(self, path: Path) -> Measurement:
        """Return the modes among the variables, by their common names; raises InputError."""
        return self.read_named_modes(path, {})

    def read_named_modes(self, path: Path, names: Mapping[str, str]) -> Measurement:
        """Return the modes by names that a case gives; raises InputError."""
        from femubench.plugins.readers.modal_variables import read_modal
        from femubench.plugins.readers.response_variables import holds_responses

        found = self.variables(path)
        with open_broken(path, "frequencies and mode shapes by name"):
            read = read_modal(found, path, names)
        if not len(read.sensors) and holds_responses(found):
            raise InputError("responses, and no modes", file=path, expected="`bench identify`")
        return read

    def read_responses(self, path: Path) -> FrequencyResponses | TimeSignals:
        """Return frequency responses or signals by their common names; raises InputError."""
        return self.read_named_responses(path, {})

    def read_named_responses(
        self, path: Path, names: Mapping[str, str]
    ) -> FrequencyResponses | TimeSignals:
        """Return frequency responses or signals by names that are given; raises InputError."""
        from femubench.plugins.readers.response_variables import read_response_variables

        found = self.variables(path)
        with open_broken(path, "responses by name"):
            return read_response_variables(found, path, names)

    def write_model(self, model: Model, path: Path, original: Path) -> None:
        """Write an updated model, and all else that is in the original; raises InputError."""
        found = self.variables(original)
        names = (choose_name(found, STIFFNESS, original), choose_name(found, MASS, original))
        new = {names[0]: model.stiffness, names[1]: model.mass}
        for group, name in group_variables(found, names[0]).items():
            if group in model.groups:
                new[name] = model.groups[group]
        self.save(path, original, {k: like(v, found[k], original) for k, v in new.items()})

    def write_pair(
        self, model: Model, stiffness: Path, mass: Path, originals: tuple[Path, Path]
    ) -> None:
        """Write an updated model in two files, likewise; raises InputError."""
        for matrix, known, path, original in (
            (model.stiffness, STIFFNESS, stiffness, originals[0]),
            (model.mass, MASS, mass, originals[1]),
        ):
            found = self.variables(original)
            name = main_matrix(found, known, original)
            self.save(path, original, {name: like(matrix, found[name], original)})


def like(matrix: SparseArray, original: Any, path: Path) -> Any:  # noqa: ANN401 - sparse or not
    """Return a matrix as full or as sparse as the one whose place it takes.

    Raises:
        InputError: where the sizes differ.
    """
    if matrix.shape != original.shape:
        what = f"the model has {matrix.shape[0]} rows and the file {original.shape[0]}"
        raise InputError(what, file=path, expected="the file that the model came from")
    return sp.csc_array(matrix) if sp.issparse(original) else sp.csc_array(matrix).toarray()
