"""Measured modes in files that hold variables by name: MATLAB, NumPy, HDF5."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femubench import InputError, Measurement, Sensors
from femubench.modal import real_modes
from femubench.plugins.readers.reading import DIRECTIONS, words_of

# What a variable may be called, without case and underscores; the first is its key in a case.
NAMES: Mapping[str, tuple[str, ...]] = {
    "frequencies": ("frequencies", "frequency", "freq", "freqs", "f", "fn", "fexp", "hz"),
    "eigenvalues": ("eigenvalues", "lambda", "lambdaexp", "lambdaexpm"),
    "shapes": ("shapes", "shape", "phi", "phiexp", "psi", "psiexp", "psiexpm", "modeshapes"),
    "frequency_std": ("frequencystd", "freqstd", "stdf", "stdfreq", "stdfrequency"),
    "eigenvalue_std": ("eigenvaluestd", "lambdastd", "stdlambda", "stdlambdaexp"),
    "shape_std": ("shapestd", "phistd", "psistd", "stdphi", "stdpsi", "stdpsiexp"),
    "damping": ("damping", "zeta", "xi", "dampingratio", "dampingratios"),
    "numbers": ("numbers", "mode", "modenumbers"),
    "labels": ("labels", "label", "sensor", "sensors", "channels"),
    "nodes": ("nodes", "node"),
    "directions": ("directions", "direction"),
    "xyz": ("xyz", "coordinates", "positions"),
}
EXPECTED = (
    "variables frequencies (Hz, m numbers) or eigenvalues (rad2/s2), shapes (sensors x m); and "
    "where there are: frequency_std, shape_std, damping, labels, or nodes and directions, xyz"
)
_MOST = 20_000_000

Array = NDArray[np.float64]


def read_modal(variables: Mapping[str, Any], path: Path, names: Mapping[str, str]) -> Measurement:
    """Return the modes that are among variables.

    Rows of the shapes without labels are called 1, 2, ...; deviations, places and directions that
    are not there are nan, nan and x.

    Arguments:
        names: from a key of `NAMES` to the name of a variable, where that is another one.

    Raises:
        InputError: where frequencies are missing, or sizes do not fit.
    """
    found = named_variables(variables, NAMES, names, path)
    hertz = _column(found, "frequencies", None, path)
    squared = _column(found, "eigenvalues", None, path)
    if hertz is None:
        if squared is None:
            raise InputError("no frequencies", file=path, expected=EXPECTED)
        hertz = np.sqrt(np.maximum(squared, 0.0)) / (2.0 * np.pi)
    if not len(hertz) or not (hertz > 0.0).all():
        raise _wrong("frequencies", "one is not positive", "numbers > 0", path)
    m = len(hertz)
    shapes = _table(found, "shapes", m, path)
    n = 0 if shapes is None else len(shapes)
    std = _table(found, "shape_std", m, path)
    if std is not None and std.shape != (n, m):
        raise _wrong("shape_std", f"{std.shape[0]} x {std.shape[1]}", f"{n} x {m} as shapes", path)
    numbers = _column(found, "numbers", m, path)
    damping = _column(found, "damping", m, path)
    sensors, hertz_std = _sensors(found, n, path), _column(found, "frequency_std", m, path)
    if hertz_std is None:
        squared_std = _column(found, "eigenvalue_std", m, path)  # of (2 pi f)^2
        if squared_std is None:
            hertz_std = np.full(m, np.nan)
        else:
            hertz_std = np.abs(squared_std) / (8.0 * np.pi**2 * hertz)
    return Measurement(
        sensors=sensors,
        numbers=tuple(range(1, m + 1) if numbers is None else (int(v) for v in numbers)),
        frequencies=hertz,
        frequency_std=np.abs(hertz_std),
        damping=np.full(m, np.nan) if damping is None else damping,
        shapes=np.zeros((0, m)) if shapes is None else real_modes(shapes, align_phase=True),
        shape_std=np.full((n, m), np.nan) if std is None else np.abs(std),
        out_of_phase=None if shapes is None else Measurement.phase_loss(shapes),
    )


def named_variables(
    variables: Mapping[str, Any],
    known: Mapping[str, tuple[str, ...]],
    names: Mapping[str, str],
    path: Path,
) -> dict[str, Any]:
    """Return variables by key, and under KEY `is called` what each is called, none of them twice.

    Arguments:
        variables: by their name; that of a part of a structure counts without the structure.
        known: what those of a key may be called.
        names: from a key to the name of a variable.

    Raises:
        InputError: for a name or a key that is not there.
    """
    plain = {name.rpartition("/")[2].lower().replace("_", ""): name for name in variables}
    found: dict[str, Any] = {}
    if strange := set(names) - set(known):
        raise InputError(f"no key {min(strange)!r}", file=path, expected=", ".join(known))
    taken = set(names.values())
    for key, words in known.items():
        wanted = names.get(key)
        if wanted is not None and wanted not in variables:
            there = ", ".join(list(variables)[:12])
            raise InputError(f"there is no variable {wanted!r}", file=path, expected=there)
        able = (plain[word] for word in words if word in plain and plain[word] not in taken)
        name = wanted or next(able, None)
        if name is not None:
            taken.add(name)
            found |= {key: variables[name], f"{key} is called": name.rpartition("/")[2].lower()}
    return found


def _numbers(found: Mapping[str, Any], key: str, path: Path) -> NDArray[Any] | None:
    if key not in found:
        return None
    value = np.asarray(found[key])
    if value.dtype.kind not in "fiuc" or value.size > _MOST or not np.isfinite(value).all():
        raise _wrong(key, "not finite numbers", "numbers", path)
    return value


def _column(found: Mapping[str, Any], key: str, count: int | None, path: Path) -> Array | None:
    value = _numbers(found, key, path)
    if value is None:
        return None
    column = np.asarray(np.real(value.reshape(-1)), dtype=float)
    if count is not None and len(column) != count:
        raise _wrong(key, f"{len(column)} numbers", f"{count}, one a mode", path)
    return column


def _table(found: Mapping[str, Any], key: str, count: int, path: Path) -> NDArray[Any] | None:
    """Return a table of one column a mode, turned where it has one row a mode."""
    value = _numbers(found, key, path)
    if value is None:
        return None
    table = value.reshape(-1, 1) if value.ndim < 2 and count == 1 else value
    if table.ndim == 2 and table.shape[1] != count and table.shape[0] == count:
        table = table.T
    if table.ndim != 2 or table.shape[1] != count:
        size = " x ".join(map(str, value.shape))
        raise _wrong(key, size, f"{count} columns, one a mode", path)
    return table


def _wrong(key: str, what: str, expected: str, path: Path) -> InputError:
    return InputError(f"{key}: {what}", file=path, expected=expected)


def _sensors(found: Mapping[str, Any], count: int, path: Path) -> Sensors:
    """Return the sensors: by their labels, by nodes and directions, or 1, 2, ..."""
    words = {key: words_of(found[key]) for key in ("labels", "nodes", "directions") if key in found}
    for key, listed in words.items():
        if len(listed) != count:
            raise _wrong(key, f"{len(listed)} entries", f"{count}, one a row of shapes", path)
    ways = [
        DIRECTIONS[int(way) - 1] if way in ("1", "2", "3", "4", "5", "6") else way
        for way in words.get("directions", ["x"] * count)
    ]
    if wrong := [way for way in ways if way.lstrip("+-") not in DIRECTIONS]:
        raise _wrong("directions", repr(wrong[0]), f"{', '.join(DIRECTIONS)}, or 1 to 6", path)
    labels = words.get("labels")
    if labels is None and "nodes" in words:
        labels = [f"{node}:{way}" for node, way in zip(words["nodes"], ways, strict=True)]
    labels = labels or [str(row + 1) for row in range(count)]
    if len(set(labels)) < count:
        twice = next(label for label in labels if labels.count(label) > 1)
        raise _wrong("labels", f"{twice!r} is listed twice", "a label of its own", path)
    xyz = np.full((count, 3), np.nan)
    places = _numbers(found, "xyz", path)
    if places is not None and "directions" in words:
        if places.shape != xyz.shape:
            size = " x ".join(map(str, places.shape))
            raise _wrong("xyz", size, f"{count} x 3, one row a row of shapes", path)
        xyz = np.asarray(np.real(places), dtype=float)
    return Sensors(tuple(labels), xyz, tuple(ways))
