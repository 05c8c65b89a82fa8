"""Read nodes and mode shapes of universal files (SDRC I-DEAS), through pyuff."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femubench import InputError, Measurement, Sensors
from femubench.fem import Outline
from femubench.modal import FrequencyResponses, TimeSignals, real_modes
from femubench.plugins.readers.axes import BASIC, System
from femubench.plugins.readers.reading import DIRECTIONS, ProgramReader, open_broken
from femubench.plugins.readers.universal_datasets import Dataset, read_datasets

_COORDINATES, _UNITS, _SYSTEMS, _SHAPES = (15, 2411), 164, (18, 2420), (55, 2414)
_HEADER, _TRACES, _ELEMENTS = 151, 82, 2412
_WANTED = (*_COORDINATES, _UNITS, *_SYSTEMS, *_SHAPES, _HEADER, _TRACES, _ELEMENTS)
_NORMAL_MODE, _COMPLEX_MODES = 2, (3, 7)
_MOTIONS = (0, 1, 8, 11, 12)  # unknown, general, displacement, velocity, acceleration
_DISPLACEMENT = 8
_MOST_NUMBERS = 20_000_000  # modes times places
_GLOBAL = (0, 1)  # numbers that writers use for the global axes without defining them
_DRAWN = (_HEADER, _TRACES, _ELEMENTS)  # of no use to modes, and left out where they are broken


@dataclass(frozen=True)
class _Node:
    """Where a node is, in the unit of the file or in m, and along what it moves."""

    xyz: NDArray[np.float64]
    triad: NDArray[np.float64]  # a row a direction, (3, 3)


@dataclass(frozen=True)
class _Mode:
    """One mode of a file: complex shapes from (node, direction)."""

    number: int
    frequency: float
    damping: float
    shape: Mapping[tuple[int, str], complex]
    mass: float


class UniversalReader(ProgramReader):
    """Reads nodes, modes, units and axes, and the lines that draw a structure."""

    name: str = "universal file"
    suffixes: tuple[str, ...] = (".uff", ".unv", ".uf")

    def read_modes(self, path: Path) -> Measurement:
        """Return sensors ``node:direction`` and modes.

        A component that is zero in every mode counts as not measured. Without modes every node
        is a sensor in x, y and z; nodes without coordinates get nan, and so do deviations.

        Raises:
            InputError: when the file is broken, or holds neither nodes nor modes.
        """
        return _sensors_and_modes(path, read_datasets(path, _WANTED, _DRAWN))

    def read_outline(self, path: Path) -> Outline:
        """Return the title of a test, and the lines that draw its structure.

        Raises:
            InputError: when the file is broken.
        """
        datasets = read_datasets(path, _WANTED, _DRAWN)
        with open_broken(path, "whole datasets"):
            nodes = _nodes(path, datasets)
        pairs = dict.fromkeys(tuple(sorted(pair)) for pair in _lines(datasets, nodes))
        ends = [[nodes[number].xyz for number in pair] for pair in pairs]
        about = next(iter(_of(datasets, _HEADER)), {})
        words = (str(about.get(key, "")).strip() for key in ("model_name", "description"))
        title = ", ".join(dict.fromkeys(word for word in words if word.upper() not in ("", "NONE")))
        return Outline(title, np.array(ends, dtype=float).reshape(-1, 2, 3))

    def read_responses(self, path: Path) -> FrequencyResponses | TimeSignals:
        """Return the functions of dataset 58, with the coordinates of nodes in the same file.

        Raises:
            InputError: when the file is broken or holds no such function.
        """
        from femubench.plugins.readers.universal_functions import read_functions

        datasets = read_datasets(path, _WANTED, _DRAWN)
        has_nodes = any(_of(datasets, *_COORDINATES))
        places = _sensors_and_modes(path, datasets).sensors if has_nodes else None
        return read_functions(path, places)


def _sensors_and_modes(path: Path, datasets: Sequence[Dataset]) -> Measurement:
    # A dataset that is cut short may lack any column.
    with open_broken(path, "whole datasets"):
        nodes, factor = _nodes(path, datasets), _length_factor(path, datasets)
        modes = [mode for d in _of(datasets, 55) for mode in _mode_55(path, d, factor)]
        modes = modes or [mode for d in _of(datasets, 2414) for mode in _mode_2414(path, d, factor)]
        if any(mode.number < 1 for mode in modes):
            modes = [replace(mode, number=i + 1) for i, mode in enumerate(modes)]
        for number, count in Counter(mode.number for mode in modes).items():
            if count > 1:
                twice = f"mode {number} is listed twice"
                raise InputError(twice, file=path, key="mode number", expected="every mode once")
        modes = [mode for mode in modes if mode.frequency > 0.0]
    if not nodes and not modes:
        expected = "datasets 15 or 2411 with nodes, 55 or 2414 with modes"
        expected += "; `bench init` and `bench identify` find those of responses (58)"
        raise InputError("neither nodes nor modes", file=path, expected=expected)
    return _measurement(path, nodes, modes)


def _of(datasets: Sequence[Dataset], *numbers: int) -> Iterator[Dataset]:
    return (dataset for dataset in datasets if dataset["type"] in numbers)


def _length_factor(path: Path, datasets: Sequence[Dataset]) -> float:
    """Return what lengths must be divided by to be in m (dataset 164)."""
    factors = {float(dataset["length"]) for dataset in _of(datasets, _UNITS)} or {1.0}
    if len(factors) > 1 or not all(math.isfinite(f) and f > 0.0 for f in factors):
        raise InputError("unclear units", file=path, key="dataset 164", expected="one length > 0")
    return factors.pop()


def _systems(path: Path, datasets: Sequence[Dataset]) -> dict[int, System]:
    """Return the coordinate systems by number, in global axes."""
    systems: dict[int, System] = dict.fromkeys(_GLOBAL, BASIC)
    for dataset in _of(datasets, 2420):
        triples = zip(
            dataset["CS_sys_labels"], dataset["CS_types"], dataset["CS_matrices"], strict=True
        )
        for label, kind, matrix in triples:
            # A row of coordinates times the matrix, the origin below: rows are the axes.
            rows, origin = np.array(matrix[:3], dtype=float), np.array(matrix[3], dtype=float)
            systems[int(label)] = _system(path, 2420, int(label), int(kind), origin, rows)
    for dataset in _of(datasets, 18):
        for i, label in enumerate(dataset["cs_num"]):
            origin = np.array(dataset["ref_o"][i], dtype=float)
            first = np.array(dataset["x_point"][i], dtype=float) - origin
            plane = np.array(dataset["xz_point"][i], dtype=float) - origin
            second = np.cross(plane, first)
            rows = np.array([first, second, np.cross(first, second)])
            own = _system(path, 18, int(label), int(dataset["cs_type"][i]), origin, rows)
            outer = systems.get(int(dataset["ref_cs_num"][i]))
            if outer is None or outer.kind == "C":
                what = f"coordinate system {int(label)} is given in one that is not there"
                raise InputError(what, file=path, key="dataset 18", expected="cartesian axes")
            systems[int(label)] = System(outer.point(own.origin), own.axes @ outer.axes, own.kind)
    return systems


def _system(
    path: Path,
    dataset: int,
    label: int,
    kind: int,
    origin: NDArray[np.float64],
    rows: NDArray[np.float64],
) -> System:
    """Return a coordinate system of three axes of any length."""
    key, length = f"dataset {dataset}", np.linalg.norm(rows, axis=1)
    if kind not in (0, 1):
        what = f"coordinate system {label} is of type {kind}"
        raise InputError(what, file=path, key=key, expected="cartesian (0) or cylindrical (1)")
    axes = rows / np.where(length > 0.0, length, 1.0)[:, None]
    if not (np.isfinite(origin).all() and np.allclose(axes @ axes.T, np.eye(3), atol=1e-3)):
        what = f"the axes of coordinate system {label} are not at right angles"
        raise InputError(what, file=path, key=key, expected="three axes")
    return System(origin, axes, "C" if kind == 1 else "R")


def _nodes(path: Path, datasets: Sequence[Dataset]) -> dict[int, _Node]:
    """Return the nodes by number."""
    factor, systems = _length_factor(path, datasets), _systems(path, datasets)
    nodes: dict[int, _Node] = {}
    for dataset in _of(datasets, *_COORDINATES):
        key = f"dataset {dataset['type']}"
        names = ("node_nums", "def_cs", "disp_cs", "x", "y", "z")
        columns = [np.asarray(dataset[name], dtype=float) for name in names]
        if len({len(column) for column in columns}) > 1 or not np.isfinite(columns).all():
            raise InputError("truncated or not finite", file=path, key=key, expected="nodes")
        for number, defined, displaced, *xyz in zip(*columns, strict=True):
            # Dataset 2411 has coordinates in the axes of the part, whatever is exported.
            used = (int(defined) if dataset["type"] == 15 else 0, int(displaced))
            for system in used:
                if system not in systems:
                    what = f"node {int(number)} uses the coordinate system {system}"
                    expected = "one that dataset 18 or 2420 defines"
                    raise InputError(what, file=path, key=key, expected=expected)
            at = systems[used[0]].point(np.array(xyz))
            node = _Node(at / factor, systems[used[1]].axes_at(at))
            other = nodes.setdefault(int(number), node)
            if not np.array_equal(other.xyz, node.xyz):
                what = f"node {int(number)} lies at two places"
                raise InputError(what, file=path, key=key, expected="one place")
    return nodes


def _mode_55(path: Path, dataset: Dataset, factor: float) -> Iterator[_Mode]:
    analysis = dataset["analysis_type"]
    if analysis not in (_NORMAL_MODE, *_COMPLEX_MODES):
        return
    if dataset["spec_data_type"] not in _MOTIONS or dataset["n_data_per_node"] not in (3, 6):
        return
    if analysis == _NORMAL_MODE:
        frequency = float(dataset["freq"])
        damping = _ratio(dataset["modal_damp_vis"], dataset["modal_damp_his"])
        mass = float(dataset["modal_m"])
    else:
        frequency, damping = _from_eigenvalue(complex(dataset["eig"]))
        turning = abs(complex(dataset["eig"]).imag)  # modal A is 2 i w_d m but for its phase
        mass = abs(complex(dataset["modal_a"])) / (2.0 * turning or math.inf)
    columns = [dataset[f"r{i + 1}"] for i in range(6) if f"r{i + 1}" in dataset]
    lengths = {len(column) for column in (dataset["node_nums"], *columns)}
    if len(lengths) > 1:
        raise InputError("truncated shape", file=path, key="dataset 55", expected="all nodes")
    rows = np.array(columns, dtype=complex).T
    number = int(dataset["mode_n"])
    if dataset["spec_data_type"] != _DISPLACEMENT or factor != 1.0:  # in which unit is not clear
        mass = 0.0
    own = number, frequency, damping, mass, dataset["node_nums"], rows, factor
    yield _mode(path, "dataset 55", *own)


def _mode_2414(path: Path, dataset: Dataset, factor: float) -> Iterator[_Mode]:
    analysis, count = dataset["analysis_type"], {2: 3, 3: 6}.get(dataset["data_characteristic"])
    at_nodes = dataset["dataset_location"] == 1
    if analysis not in (_NORMAL_MODE, *_COMPLEX_MODES) or count is None or not at_nodes:
        return
    if dataset["result_type"] not in _MOTIONS:
        return
    if analysis == _NORMAL_MODE:
        frequency = float(dataset["record12_field2"])
        damping = _ratio(dataset["record12_field5"], dataset["record12_field6"])
    else:
        eigenvalue = complex(dataset["record13_field1"], dataset["record13_field2"])
        frequency, damping = _from_eigenvalue(eigenvalue)
    width = 2 * count if dataset["data_type"] in (5, 6) else count
    if any(len(values) != width for values in dataset["data_at_node"]):
        expected = f"{width} values a node"
        raise InputError("truncated shape", file=path, key="dataset 2414", expected=expected)
    values = np.array(dataset["data_at_node"], dtype=float).reshape(-1, width)
    rows = values[:, ::2] + 1j * values[:, 1::2] if width > count else values.astype(complex)
    number = int(dataset["record10_field6"])
    nodes = dataset["node_nums"]
    yield _mode(path, "dataset 2414", number, frequency, damping, 0.0, nodes, rows, factor)


def _mode(
    path: Path,
    key: str,
    number: int,
    frequency: float,
    damping: float,
    mass: float,
    nodes: Sequence[int],
    rows: NDArray[np.complex128],
    factor: float,
) -> _Mode:
    if not (math.isfinite(frequency) and frequency >= 0.0 and np.isfinite(rows).all()):
        what = f"mode {number} has numbers that cannot be"
        raise InputError(what, file=path, key=key, expected="a frequency >= 0, finite shapes")
    if damping < 0.0 or damping >= 1.0:
        what = f"mode {number} has the damping {damping:g}"
        raise InputError(what, file=path, key=key, expected="a ratio >= 0 and < 1")
    rows = rows.copy()
    rows[:, :3] /= factor
    shape = {
        (int(node), direction): complex(value)
        for node, row in zip(nodes, rows, strict=True)
        for direction, value in zip(DIRECTIONS, row, strict=False)
    }
    return _Mode(number, frequency, damping, shape, mass)


def _ratio(viscous: float, hysteretic: float) -> float:
    """Return the damping ratio; files write zero where nothing was measured."""
    return float(viscous) or 0.5 * float(hysteretic) or math.nan


def _from_eigenvalue(eigenvalue: complex) -> tuple[float, float]:
    size = abs(eigenvalue)
    return size / (2.0 * math.pi), -eigenvalue.real / size if size > 0.0 else math.nan


def _measurement(path: Path, nodes: Mapping[int, _Node], modes: Sequence[_Mode]) -> Measurement:
    if modes:
        listed = dict.fromkeys(place for mode in modes for place in mode.shape)
        if len(listed) * len(modes) > _MOST_NUMBERS:
            what = f"{len(modes)} modes at {len(listed)} places are too many numbers"
            raise InputError(what, file=path, expected=f"at most {_MOST_NUMBERS}")
        places = [p for p in listed if any(mode.shape.get(p, 0.0) != 0.0 for mode in modes)]
    else:
        places = [(node, direction) for node in nodes for direction in DIRECTIONS[:3]]
    nowhere = _Node(np.full(3, math.nan), np.eye(3))
    at = [nodes.get(node, nowhere) for node, _ in places]
    sensors = Sensors.along(
        (f"{node}:{direction}" for node, direction in places),
        np.array([node.xyz for node in at], dtype=float).reshape(-1, 3),
        np.array([_axis(node, way) for node, (_, way) in zip(at, places, strict=True)]),
    )
    empty = complex(math.nan, 0.0)
    table = [[mode.shape.get(place, empty) for mode in modes] for place in places]
    complex_shapes = np.array(table, dtype=complex).reshape(len(places), len(modes))
    # The complex scale of a mode is arbitrary: residues and velocities come out imaginary.
    shapes = real_modes(complex_shapes, align_phase=True)
    frequencies = np.array([mode.frequency for mode in modes])
    mass = np.array([mode.mass for mode in modes])
    # 0 with all modes, or 1, is what programs write that scale nothing.
    known = bool(((mass > 0.0) & (mass != 1.0) & np.isfinite(mass)).any())
    return Measurement(
        sensors=sensors,
        numbers=tuple(mode.number for mode in modes),
        frequencies=frequencies,
        frequency_std=np.full(len(modes), math.nan),
        damping=np.array([mode.damping for mode in modes]),
        shapes=shapes,
        shape_std=np.full(shapes.shape, math.nan),
        out_of_phase=Measurement.phase_loss(complex_shapes),
        modal_mass=np.where(mass > 0.0, mass, math.nan) if known else None,
    )


def _axis(node: _Node, direction: str) -> NDArray[np.float64]:
    """Return a direction of a node in (x, y, z, rx, ry, rz), (6,)."""
    axis, row = np.zeros(6), DIRECTIONS.index(direction)
    axis[3 * (row // 3) : 3 * (row // 3) + 3] = node.triad[row % 3]
    return axis


def _lines(datasets: Sequence[Dataset], nodes: Mapping[int, _Node]) -> Iterator[tuple[int, int]]:
    """Yield the pairs of nodes between which trace lines and the edges of elements run."""
    for dataset in _of(datasets, _TRACES):
        path = [int(number) for number in dataset["nodes"]]
        yield from ((a, b) for a, b in pairwise(path) if a in nodes and b in nodes and a != b)
    for dataset in _of(datasets, _ELEMENTS):
        for element in (one for kind in dataset.values() if isinstance(kind, list) for one in kind):
            ring = [int(number) for number in element["nodes_nums"] if int(number) in nodes]
            yield from pairwise(ring if len(ring) < 3 else [*ring, ring[0]])
