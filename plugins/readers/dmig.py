"""Read and write matrices that Nastran punches as DMIG cards, through pyYeti."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from femubench import InputError, Model
from femubench.fem import MatrixGeometry, SparseArray, matrix_model
from femubench.plugins.readers.reading import (
    DIRECTIONS,
    ProgramReader,
    directions,
    needs,
    open_broken,
)
from femubench.plugins.readers.variables import (
    MASS,
    STIFFNESS,
    choose_name,
    main_matrix,
    only_matrix,
)

if TYPE_CHECKING:
    import pandas as pd

_KIND = "DMIG cards with square matrices"
_LARGEST = 6_000  # rows; pyYeti fills the whole matrix


class DmigReader(ProgramReader):
    """Reads square matrices with grids and components, e.g. KAAX and MAAX, K10 and M10 of EXTSEOUT.

    Coordinates are not in such a file. Cards have 16 columns a number, which hold 10 digits.
    """

    name: str = "Nastran DMIG"
    suffixes: tuple[str, ...] = (".pch",)

    def read_matrix(self, path: Path) -> SparseArray:
        """Return the only matrix; raises InputError."""
        frames = _frames(path)
        return sp.csc_array(frames[only_matrix(_values(frames), path)].to_numpy())

    def read_model(self, path: Path) -> Model:
        """Return stiffness and mass on the grids that either has; raises InputError."""
        frames = _frames(path)
        stiffness, mass = (frames[_chosen(frames, known, path)] for known in (STIFFNESS, MASS))
        return _model(stiffness, mass, path)

    def read_pair(self, stiffness: Path, mass: Path) -> Model:
        """Return a model whose stiffness and mass are in files of their own."""
        first, second = _frames(stiffness), _frames(mass)
        own = first[main_matrix(_values(first), STIFFNESS, stiffness)]
        return _model(own, second[main_matrix(_values(second), MASS, mass)], stiffness)

    def write_model(self, model: Model, path: Path, original: Path) -> None:
        """Write an updated model, all other matrices as they were; raises InputError."""
        frames = _frames(original)
        names = (_chosen(frames, STIFFNESS, original), _chosen(frames, MASS, original))
        points = set(frames[names[0]].index) | set(frames[names[1]].index)
        new = dict(zip(names, _labelled(model, points, original), strict=True))
        _write({**frames, **new}, path)

    def write_pair(
        self, model: Model, stiffness: Path, mass: Path, originals: tuple[Path, Path]
    ) -> None:
        """Write an updated model in two files; raises InputError."""
        frames = [_frames(original) for original in originals]
        names = [
            main_matrix(_values(frames[i]), known, originals[i])
            for i, known in enumerate((STIFFNESS, MASS))
        ]
        points = set(frames[0][names[0]].index) | set(frames[1][names[1]].index)
        for i, frame in enumerate(_labelled(model, points, originals[0])):
            _write({**frames[i], names[i]: frame}, (stiffness, mass)[i])


def _frames(path: Path) -> dict[str, pd.DataFrame]:
    """Return every matrix by its name in lower case, labelled by grid and component."""
    needs("pyyeti", "nastran", path)
    with open_broken(path, _KIND):
        from pyyeti.nastran import bulk

        with path.open(encoding="latin-1") as stream:
            if not any(line[:4].upper() == "DMIG" for line in stream):
                raise InputError("there are no DMIG cards", file=path, expected=_KIND)
            stream.seek(0)
            frames: dict[str, pd.DataFrame] = bulk.rddmig(stream, follow_includes=False)
    if not frames:
        raise InputError("no matrix", file=path, expected=_KIND)
    return frames


def _values(frames: dict[str, pd.DataFrame]) -> dict[str, np.ndarray]:
    return {name: frame.to_numpy() for name, frame in frames.items()}


def _chosen(frames: dict[str, pd.DataFrame], known: tuple[str, ...], path: Path) -> str:
    """Return the name of the stiffness or of the mass, which may end with a number.

    EXTSEOUT calls them by the superelement, e.g. K10 or KAA10; transformations that it adds begin
    with M too.
    """
    numbered = [name for name in frames if re.fullmatch(rf"{known[1]}(aa)?x?\d+", name)]
    own = tuple(numbered) if len(numbered) == 1 else ()
    return choose_name(_values(frames), (*known, *own), path)


def _model(stiffness: pd.DataFrame, mass: pd.DataFrame, path: Path) -> Model:
    rows = stiffness.index.union(mass.index)
    if not all(frame.index.equals(frame.columns) for frame in (stiffness, mass)):
        raise InputError("rows and columns differ", file=path, expected=_KIND)
    if len(rows) > _LARGEST:
        raise InputError(f"{len(rows)} rows", file=path, expected=f"at most {_LARGEST}")
    whole, weight = (
        sp.csc_array(frame.reindex(index=rows, columns=rows, fill_value=0.0).to_numpy())
        for frame in (stiffness, mass)
    )
    grids, components = zip(*rows, strict=True)
    # Scalar points have the component 0 and one motion.
    along = directions([max(int(component), 1) for component in components], path)
    return matrix_model(weight, whole, grids, along)


def _labelled(
    model: Model, points: set[tuple[int, int]], path: Path
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return stiffness and mass of a model with the grids and components of the original."""
    import pandas as pd

    geometry = model.geometry
    assert isinstance(geometry, MatrixGeometry)
    labels = []
    for node, direction in zip(model.dofs.node, model.dofs.direction, strict=True):
        name = geometry.names[node]
        grid = int(name) if name.isdigit() and len(name) < 10 else -1
        component = 0 if (grid, 0) in points else DIRECTIONS.index(direction) + 1
        if (grid, component) not in points:
            what = f"no card has node {name!r} in {direction}"
            raise InputError(what, file=path, expected="the file that the model came from")
        labels.append((grid, component))
    rows = pd.MultiIndex.from_tuples(labels, names=["id", "dof"])
    stiffness, mass = (
        pd.DataFrame(matrix.toarray(), index=rows, columns=rows)
        for matrix in (model.stiffness, model.mass)
    )
    return stiffness, mass


def _write(frames: dict[str, pd.DataFrame], path: Path) -> None:
    from pyyeti.nastran import bulk

    bulk.wtdmig(str(path), frames)
