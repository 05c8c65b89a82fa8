"""The footbridge's MATLAB files, read where the user keeps them, as a case folder of matrices."""

from __future__ import annotations

import atexit
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse as sp
from numpy.typing import NDArray

from femubench import InputError
from femubench.fem import FloatArray
from femubench.scenarios.nodes_from_stiffness import Row, label_rows

VARIABLE = "FEMUBENCH_FOOTBRIDGE"
MODEL, TEST = "SteelPedestrianBridgeExp.mat", "ExpModeInfo_FEM.mat"
_SLABS = tuple(f"K_Conc{i}" for i in range(1, 12))
GROUPS = ("K_Frame", "K_Truss", *_SLABS, "K_y1", "K_z1", "K_y2", "K_z2")
USED, HELD_OUT = (1, 2, 3), (4, 5)
_EXPECTED = (
    f"the folder with {MODEL} and {TEST} of github.com/ywang-structures/"
    "Structural-Model-Updating, Examples/SteelPedestrianBridge"
)
_EXACT = 1e-9  # of a shape: no reading is known better
_INCH, _KIP = 0.0254, 4448.2216152605  # m, N
_CASE = """\
[case]
name = "footbridge"
title = "Steel pedestrian bridge, published test"
source = "ywang-structures/Structural-Model-Updating, Examples/SteelPedestrianBridge (GPL-3.0)"

[model]
kind = "matrices"
mass = "mass.mtx"
stiffness = "stiffness.mtx"
dofs = "dofs.csv"
{groups}
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = {used}
held_out = {held_out}

[diagnosis]
model_error = 1.0
"""


def case_folder() -> Path:
    """Return a case folder, gone when the process ends, with what the user's files hold.

    Raises:
        InputError: when the environment does not name the folder of the files, or for what is
            wrong in one of them.
    """
    named = os.environ.get(VARIABLE)
    if not named:
        raise InputError(f"{VARIABLE} is not set", expected=_EXPECTED)
    data = Path(named).expanduser()
    for file in (MODEL, TEST):
        if not (data / file).is_file():
            what = f"missing file {file}, {VARIABLE} names the wrong folder"
            raise InputError(what, file=data, expected=_EXPECTED)
    return _written(data.resolve())


@cache
def _written(data: Path) -> Path:
    model, test = (_Variables(data / file) for file in (MODEL, TEST))
    contents = {**_matrices(model), **_measured(model, test)}
    folder = TemporaryDirectory(prefix="femubench-footbridge-")
    atexit.register(folder.cleanup)
    for name, content in contents.items():
        path = Path(folder.name, name)
        if isinstance(content, str):
            path.write_text(content, encoding="utf-8")
        else:
            scipy.io.mmwrite(path, sp.coo_array(content), symmetry="symmetric")
    return Path(folder.name)


class _Variables:
    """The arrays of a MATLAB file."""

    def __init__(self, file: Path) -> None:
        self.file = file
        try:
            self.found: Mapping[str, Any] = scipy.io.loadmat(file)
        except Exception as error:  # of whatever kind, with a broken file
            what = f"cannot be read: {error}"
            raise InputError(what, file=file, expected="a MATLAB file up to version 7") from None

    def array(self, name: str, *shape: int) -> FloatArray:
        """Return a variable of that shape, of any without one."""
        if name not in self.found:
            raise InputError(f"no variable {name!r}", file=self.file, expected=_EXPECTED)
        array = np.asarray(self.found[name])
        if array.dtype.kind not in "fiu" or (shape and array.shape != shape):
            what = f"{name} is {array.dtype.name} of {' x '.join(map(str, array.shape))}"
            expected = f"numbers, {' x '.join(map(str, shape))}" if shape else "numbers"
            raise InputError(what, file=self.file, expected=expected)
        return array.astype(float)


def _matrices(model: _Variables) -> dict[str, str | FloatArray]:
    """Return mass, stiffness, its groups, and the dofs.

    The files have kips, inches and seconds. Rows without mass are rotations.
    """
    size = len(model.array("K_whole"))
    mass = model.array("M0", size, size)
    turns = np.asarray(~mass.any(axis=0))
    # From inches to metres in what moves and in what pushes; rotations stay.
    scale = np.sqrt(_KIP * _INCH) * np.where(turns, 1.0, 1.0 / _INCH)
    square = np.outer(scale, scale)
    names = {"stiffness.mtx": "K_whole", **{f"{name}.mtx": name for name in GROUPS}}
    parts = {file: square * model.array(name, size, size) for file, name in names.items()}
    rows = [
        f"{i},{row.node + 1},{row.direction},{','.join(f'{_INCH * v:.6g}' for v in row.xyz)}"
        for i, row in enumerate(_rows(model, turns), start=1)
    ]
    groups = "".join(
        f'\n[[model.groups]]\nname = "{name}"\nstiffness = "{name}.mtx"\n' for name in GROUPS
    )
    text = _CASE.format(groups=groups, used=list(USED), held_out=list(HELD_OUT))
    dofs = "\n".join(["row,node,direction,x,y,z", *rows])
    return {"mass.mtx": square * mass, **parts, "dofs.csv": dofs, "case.toml": text}


def _rows(model: _Variables, turns: NDArray[np.bool_]) -> list[Row]:
    """Return what the rows are, which the files do not say and the stiffness does, in inches.

    Where it does not either, every row is a node of its own on a line.
    """
    size = len(turns)
    springs = {name: model.array(name, size, size) for name in GROUPS[-4:]}
    free = model.array("K_whole", size, size) - sum(springs.values())
    y1, z1, y2, z2 = (np.flatnonzero(part.diagonal()).tolist() for part in springs.values())
    found = label_rows(free, turns, [*y1, *y2], [*z1, *z2])
    if found is not None:
        return found
    return [Row(i, "rx" if turn else "z", (i / _INCH, 0.0, 0.0)) for i, turn in enumerate(turns)]


def _measured(model: _Variables, test: _Variables) -> dict[str, str | FloatArray]:
    """Return sensors and modes; where a shape is one by definition its deviation is left out."""
    dofs = model.array("measDOFs").ravel().astype(int).tolist()
    moving = np.flatnonzero(model.array("M0").any(axis=0)) + 1
    if unknown := [dof for dof in dofs if dof not in moving]:
        expected = f"rows with mass, from 1 to {moving.max(initial=0)}"
        raise InputError(f"measDOFs has row {unknown[0]}", file=model.file, expected=expected)
    count = len(USED + HELD_OUT)
    values, value_std = (test.array(name, count, 1) for name in ("lambdaExp", "std_lambdaExp"))
    shape = (len(dofs), count)
    shapes, shape_std = test.array("psiExp_m", *shape), test.array("std_psiExp", *shape)
    frequencies = np.sqrt(values.ravel()) / (2.0 * np.pi)
    # lambda = (2 pi f)^2, to first order.
    frequency_std = value_std.ravel() / (8.0 * np.pi**2 * frequencies)
    rows = _rows(model, np.asarray(~model.array("M0").any(axis=0)))
    labels = [f"S{dof},{rows[dof - 1].node + 1},{rows[dof - 1].direction}" for dof in dofs]
    sensors = ["label,at,direction", *labels]
    modes = [",".join(["mode,frequency,frequency_std", *(f"S{d},S{d}_std" for d in dofs)])]
    for m, (frequency, std) in enumerate(zip(frequencies, frequency_std, strict=True)):
        pairs = zip(shapes[:, m], shape_std[:, m], strict=True)
        cells = (f"{value:.17g},{f'{std:.17g}' if std > _EXACT else ''}" for value, std in pairs)
        modes.append(f"{m + 1},{frequency:.17g},{std:.17g},{','.join(cells)}")
    return {"sensors.csv": "\n".join(sensors), "modes.csv": "\n".join(modes)}
