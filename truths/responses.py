"""Frequency responses of the suite's solids, as a test by stepped sines would record them.

Chosen by kind and size before any strategy saw them: small solids of every sort of structure.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import linalg as dense, sparse
from scipy.sparse import linalg

from truths.drawing import text
from truths.eigenmodes import System, attach, factorised, shift_at
from truths.measurement import GAIN_SHARE, GAINS
from truths.modes_of import assembled, mesh_of
from truths.seats import observed
from truths.structure import Structure
from truths.suite import SUITE, index_text, structures, write_files

Array = npt.NDArray[np.float64]
FOLDER = SUITE.parent / "suite-responses"
NAMES = (
    *("arch", "bracket", "chair", "gable", "mast-on-pad", "pi-portal", "pipe-loop", "propeller"),
    *("skew-grid", "tee-bridge", "tuning-fork", "two-material-tee"),
)
LINES, CHANNELS, HIDDEN = 320, 12, 3
BEYOND = 1.5  # times the highest line: modes up to there are exact
RECORDS = 10  # averaged at every line
FORCE_NOISE = 0.02  # of the force, real and imaginary part, in each record
MOTION_NOISE = 0.01  # of the median accelerance
STILL = 0.03  # of the driven sensor's level: a channel below it records little but noise
ROUNDING = 1e-10  # of the largest: a vector that adds no more lies in the span of the others
DIRECT = 1e-6  # of a direct solution at a line, by which the reduced ones are checked
_MODE = re.compile(r"^\| \d+ \| (?:used|held out) \| ([\d.]+) \|", re.MULTILINE)


def reduced(
    system: System, rows: sparse.csr_array, guess: float, highest: float
) -> tuple[Array, Array]:
    """Return eigenvalues and readings at rows of a reduced solid: (m,), (rows, m).

    Its space holds the modes to 1.5 times the highest line in Hz, rigid ones too, and the static
    responses to forces along the rows, once and once more with their inertia.
    """
    K, M, shift, count = system.stiffness, system.mass, shift_at(guess), 30
    factor, start = factorised(K + shift * M), np.random.default_rng(0).standard_normal(K.shape[0])
    inverse = linalg.LinearOperator(K.shape, matvec=factor.solve)
    while True:
        values, vectors = linalg.eigsh(K, count, M, sigma=-shift, OPinv=inverse, v0=start)
        if values.max() > (BEYOND * 2.0 * np.pi * highest) ** 2:
            break
        count *= 2
    own = rows @ system.observe
    static = factor.solve(own.T.toarray())
    basis = vectors
    for more in (static, factor.solve(M @ static)):
        for _ in range(2):  # the second time what rounding left of the others
            more = more - basis @ (basis.T @ (M @ more))
            more /= np.sqrt(np.einsum("ij,ij->j", more, M @ more))
            size, turn = np.linalg.eigh(more.T @ (M @ more))
            kept = size > ROUNDING * size[-1]
            more = more @ (turn[:, kept] / np.sqrt(size[kept]))
        basis = np.hstack([basis, more])
    values, turn = dense.eigh(basis.T @ (K @ basis), basis.T @ (M @ basis))
    return values, np.asarray(own @ basis @ turn)


def check_directly(
    system: System, rows: sparse.csr_array, drive: int, lines: Array, found: Array
) -> None:
    """Compare undamped receptances, (lines, rows), with those of direct solutions at some lines.

    Raises:
        ValueError: where they differ by more than a millionth of the largest.
    """
    own = rows @ system.observe
    for hertz, answer in zip(lines, found, strict=True):
        matrix = system.stiffness - shift_at(hertz) * system.mass
        exact = own @ linalg.spsolve(sparse.csc_matrix(matrix), own[[drive]].toarray()[0])
        error = float(np.abs(answer - exact).max() / np.abs(exact).max())
        if error > DIRECT:
            raise ValueError(f"a receptance at {hertz:.6g} Hz is off by {error:.1e}")


def driven_sensor(shapes: Array, used: int) -> int:
    """Return the sensor at which the weakest of the used modes is strongest.

    Arguments:
        shapes: as recorded, (modes, sensors).
        used: how many of the modes are.
    """
    return int(np.abs(shapes[:used]).min(axis=0).argmax())


def chosen_channels(levels: Array, drive: int) -> tuple[list[int], list[int]]:
    """Return the sensors that are read, the driven one among them, and those that are held back.

    Arguments:
        levels: median accelerance of every sensor; what symmetry keeps still is not read.
    """
    moved = np.flatnonzero(levels > STILL * levels[drive])
    spread = np.linspace(0, len(moved) - 1, min(CHANNELS, len(moved))).round().astype(int)
    read = sorted({drive, *map(int, moved[spread])})
    others = [sensor for sensor in read if sensor != drive]
    return read, others[1 :: max(len(others) // HIDDEN, 1)][:HIDDEN]


def accelerances(
    values: Array, readings: Array, damping: Array, drive: int, lines: Array
) -> npt.NDArray[np.complex128]:
    """Return acceleration over force of modes at every line and row, (lines, rows)."""
    omega = 2.0 * np.pi * lines[:, None]
    root = np.sqrt(np.abs(values))
    compliance = 1.0 / (values - omega**2 + 2j * damping * root * omega)
    return np.asarray(-(omega**2) * ((compliance * readings[drive]) @ readings.T))


def record_responses(structure: Structure, folder: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Return responses that were recorded in the test of a folder, and the key that splits them."""
    modes = pd.read_csv(folder / "modes.csv")
    names = list(modes.columns[4:])
    hertz, shapes = modes["frequency"].to_numpy(), modes[names].to_numpy()
    drive = driven_sensor(shapes, structure.used)
    first, last = 0.5 * hertz[0], 1.05 * hertz[-1]
    lines = np.array([float(f"{v:.6g}") for v in np.geomspace(first, last, LINES)])
    matrices = assembled(structure, mesh_of(structure, structure.size[1]))
    rows = observed(structure, matrices, structure.sensors)
    hung = (structure.lumps, structure.springs, structure.struts, structure.oscillators)
    system = attach(structure, matrices, *hung)
    values, readings = reduced(system, rows, structure.guess, last)
    some = lines[[LINES // 5, LINES - 2]]
    plain = accelerances(values, readings, np.zeros(len(values)), drive, some)
    check_directly(system, rows, drive, some, -plain.real / (2.0 * np.pi * some[:, None]) ** 2)
    # The test of the folder: its frequencies and dampings, and the gains of its sensors.
    listed = _MODE.findall((folder / "README.md").read_text(encoding="utf-8"))
    solid = np.array(listed, dtype=float)
    own = np.sqrt(np.abs(values)) / (2.0 * np.pi)
    mode = np.abs(own[:, None] / solid - 1.0).argmin(axis=0)
    if (np.abs(own[mode] / solid - 1.0) > 1e-4).any() or len(set(mode)) < len(mode):
        raise ValueError(f"{structure.name}: its README lists other modes")
    ratio = np.full(len(values), np.median(hertz / solid))
    ratio[mode] = hertz / solid
    damping = np.full(len(values), modes["damping"].median())
    damping[mode] = modes["damping"]
    clean = accelerances(values * ratio**2, readings, damping, drive, lines)
    read, hidden = chosen_channels(np.median(np.abs(clean), axis=0), drive)
    gains = np.random.default_rng((structure.seed, GAINS)).standard_normal(len(names))
    share = structure.shape_scatter * np.sqrt(GAIN_SHARE)
    clean = (clean * (1.0 + share * gains))[:, read]
    floor = float(f"{MOTION_NOISE * np.median(np.abs(clean)) / np.sqrt(RECORDS):.2g}")
    rng = np.random.default_rng((structure.seed, 36))
    noise = rng.standard_normal((2, 2, RECORDS, LINES, len(read)))
    force = 1.0 + FORCE_NOISE * (noise[0, 0, ..., :1] + 1j * noise[0, 1, ..., :1])
    motion = clean + floor * np.sqrt(RECORDS) * (noise[1, 0] + 1j * noise[1, 1])
    found = (motion * force.conj()).mean(axis=0) / np.square(np.abs(force)).mean(axis=0)  # H1
    table = pd.DataFrame({"frequency": [f"{v:.6g}" for v in lines]})
    for sensor, column in zip(read, found.T, strict=True):
        cells = [f"{v.real:.4e}{v.imag:+.4e}j" for v in column]
        table[f"{names[sensor]}/{names[drive]}"] = cells
    split = np.sqrt(hertz[structure.used - 1] * hertz[structure.used])
    below, above = lines[lines <= split][-1], lines[lines > split][0]
    keys = {
        "used": [[float(lines[0]), float(below)]],
        "held_out": [[float(above), float(lines[-1])]],
        "held_out_sensors": [names[sensor] for sensor in hidden],
        "std": float(f"{np.hypot(FORCE_NOISE / np.sqrt(RECORDS), share / np.sqrt(2.0)):.2g}"),
        "floor": floor,
    }
    return table, keys


def readme(structure: Structure, keys: Mapping[str, Any], channels: Sequence[str]) -> str:
    """Return the README of a case: where its responses come from."""
    drive = channels[0].partition("/")[2]
    (low, middle), (above, high) = keys["used"][0], keys["held_out"][0]
    hidden = ", ".join(keys["held_out_sensors"])
    return f"""# suite-responses/{structure.name}: {structure.title}

The case of [suite/{structure.name}](../../suite/{structure.name}/README.md) with accelerances of
the same solid in the same test: its recorded frequencies, damping ratios and gains of sensors.

**Origin.** `truths/responses.py`; `make truths ARGS="{structure.name} --only responses"` computes
them again. The solid is reduced to its modes up to {BEYOND:g} times the highest line and, for all
above, its static responses to forces at the sensors, with their inertia; at two lines this is
compared with a direct solution, to {DIRECT:g}. Modes beyond the listed ones have the median damping
ratio, and the median shift of the recorded frequencies.

**Test.** Sines at {LINES} lines from {low:g} to {high:g} Hz, driven at {drive}, read at
{len(channels)} sensors; what symmetry keeps still is not read. {RECORDS} records a line (seed
{structure.seed}, 36) with noise of the force ({FORCE_NOISE:g} of it) and of the motion, averaged as
cross over force spectrum (H1). `std` has the noise of the force and the gains of the sensors,
`floor` the noise of the motion.

**Split.** Lines to {middle:g} Hz, between the used and the held-out modes, are given; those from
{above:g} Hz on and all of {hidden} are held out.
"""


def write(structure: Structure, suite: Path = SUITE) -> list[str]:
    """Write the case of a structure with responses; return what differs from what was there."""
    folder = suite / structure.name
    table, keys = record_responses(structure, folder)
    case = (folder / "case.toml").read_text(encoding="utf-8")
    lines = f'name = "suite-responses/{structure.name}"\nstructure = "suite/{structure.name}"\n'
    case = case.replace(f'name = "suite/{structure.name}"\n', lines, 1)
    more = f'[measurement]\nfrfs = "responses.csv"\nresponses = {text(keys)}\n'
    files = {
        name: (folder / name).read_text(encoding="utf-8")
        for name in sorted(path.name for path in folder.glob("*.csv"))
        if name in ("sensors.csv", "modes.csv") or name.startswith("change-")
    }
    files["case.toml"] = case.replace("[measurement]\n", more, 1)
    files["responses.csv"] = table.to_csv(index=False)
    files["README.md"] = readme(structure, keys, list(table.columns[1:]))
    return write_files(FOLDER / structure.name, files)


def write_index() -> None:
    """Write the table of the group: titles and classes of the suite, none in the default set."""
    known = structures()
    listed = index_text({name: known[name] for name in NAMES}).replace("= true", "= false")
    (FOLDER / "suite-responses.toml").write_text(listed, encoding="utf-8")
