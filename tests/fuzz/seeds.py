"""Whole files to break: those of the repository, and small ones of the other formats."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pyuff

from femubench.core.schema.records import to_plain
from femubench.core.schema.results import Block
from femubench.results import JobResult, PairedMode, Rule, RunData, run_to_json

ROOT = Path(__file__).parents[2]
CASES = sorted(
    path.parent
    for room in ("tests/cases", "tests/handwritten", "scenarios")
    for path in (ROOT / room).rglob("case.toml")
    # The modes of these are in files that a user has.
    if path.parent.name not in ("four-storey", "eighteen-storey")
)
_DOFS = "row,node,direction,x,y,z\n" + "".join(f"{i},n{i},x,{i}.0,0,0\n" for i in range(1, 5))
_MASS = "4 4 4\n" + "".join(f"{i} {i} {1.0 + 0.5 * i}\n" for i in range(1, 5))
_CHAIN = [(i, j, v) for i in range(1, 5) for j, v in ((i, 2.0e4), (i + 1, -1.0e4)) if j < 5]
_STIFFNESS = f"4 4 {len(_CHAIN)}\n" + "".join(f"{j} {i} {v}\n" for i, j, v in _CHAIN)
_DENSE = "4 4\n" + "".join(f"{v}\n" for v in (2, -1, 0, 0, 2, -1, 0, 2, -1, 1))
_BANNER = "%%MatrixMarket matrix {} {} {}\n%\n"
MATRICES = {
    "mass.mtx": _BANNER.format("coordinate", "real", "symmetric") + _MASS,
    "stiffness.mtx": _BANNER.format("coordinate", "real", "symmetric") + _STIFFNESS,
    "dense.mtx": _BANNER.format("array", "integer", "symmetric") + _DENSE,
    "general.mtx": _BANNER.format("coordinate", "integer", "general") + "4 4 1\n2 2 5\n",
}
_MATRIX_CASE = """\
[case]
name = "chain"
[model]
kind = "matrices"
mass = "mass.mtx"
stiffness = "stiffness.mtx"
dofs = "dofs.csv"
[[model.groups]]
name = "first"
stiffness = "general.mtx"
[[model.groups]]
name = "rest"
dofs = [2, "n3", "n4:x"]
[[model.groups]]
name = "packed"
stiffness = "packed.mtx.gz"
[[model.groups]]
name = "dense"
stiffness = "dense.mtx"
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1]
"""
_UNIVERSAL_CASE = """\
[case]
name = "universal"
[model]
kind = "frame"
plane = "in-plane"
[model.materials.steel]
E = 210e9
nu = 0.3
rho = 7850.0
[model.sections.tube]
shape = "square-tube"
width = 0.04
wall = 0.003
[[model.joints]]
name = "A"
xyz = [0.0, 0.0, 0.0]
[[model.joints]]
name = "B"
xyz = [1.0, 0.0, 0.0]
[[model.members]]
name = "m"
ends = ["A", "B"]
elements = 4
section = "tube"
material = "steel"
[measurement]
sensors = "test.uff"
modes = "test.uff"
used = [1]
held_out = [2]
"""
_RESPONSE = (
    "    -1\n    58\nfrf\n" + "NONE\n" * 4 + "    4    1    0    0 a    1  3 a 1 3\n    -1\n"
)


def matrix_case(folder: Path) -> Path:
    """Write a case of matrices: coordinate, array, packed."""
    folder.mkdir()
    for name, text in {**MATRICES, "case.toml": _MATRIX_CASE, "dofs.csv": _DOFS}.items():
        (folder / name).write_text(text)
    (folder / "packed.mtx.gz").write_bytes(gzip.compress(MATRICES["general.mtx"].encode()))
    (folder / "sensors.csv").write_text("label,at,direction\na,n1,x\nb,n3,-x\n")
    (folder / "modes.csv").write_text("mode,frequency,a,b\n1,9.5,0.2,-1\n2,20,1,0.5\n")
    return folder


def universal_case(folder: Path) -> Path:
    """Write a case whose sensors and modes are in a universal file of seven kinds of datasets."""
    folder.mkdir()
    (folder / "case.toml").write_text(_UNIVERSAL_CASE)
    nodes, zeros = np.array([1, 2, 3]), [0, 0, 0]
    shape = np.array([0.1, -0.5, 1.0])
    place = {"node_nums": nodes.tolist(), "x": [0.0, 0.5, 1.0], "y": [0.0] * 3, "z": [0.0] * 3}
    frame = {"def_cs": zeros, "disp_cs": zeros, "color": zeros}
    common = {"model_type": 1, "analysis_type": 2, "spec_data_type": 8, "load_case": 1}
    of_nodes = {"node_nums": nodes, "r1": 0 * shape, "r2": 0 * shape, "r3": shape}
    datasets = [
        {"type": 164, "units_code": 1, "units_description": "SI", "temp_mode": 1, "length": 1.0,
         "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 2420, "Part_UID": 1, "Part_Name": "part", "CS_sys_labels": [5], "CS_types": [0],
         "CS_colors": [8], "CS_names": ["cs"],
         "CS_matrices": [np.vstack([np.eye(3), np.zeros(3)])]},
        {"type": 15, **place, **frame},
        {"type": 2411, **{k: np.array(v) for k, v in {**place, **frame}.items()}},
        *({"type": 55, **common, "data_ch": 2, "mode_n": i, "freq": 20.0 * i,
           "modal_damp_vis": 0.01, **of_nodes, "r3": shape**i} for i in (1, 2)),
        {"type": 55, **common, "analysis_type": 3, "data_ch": 2, "mode_n": 3,
         "eig": complex(-2, 300), **{k: v * (1 + 0.1j) if k[0] == "r" else v
                                     for k, v in of_nodes.items()}},
        {"type": 2414, "analysis_dataset_label": 1, "analysis_dataset_name": "mode",
         "dataset_location": 1, **{f"id{i}": "NONE" for i in range(1, 6)}, "model_type": 1,
         "analysis_type": 2, "data_characteristic": 2, "result_type": 8, "data_type": 2,
         "number_of_data_values_for_the_data_component": 3, "record10_field6": 1,
         "record12_field2": 20.0, "record12_field6": 0.02, "node_nums": nodes, "x": 0 * shape,
         "y": 0 * shape, "z": shape, "data_at_node": [np.array([0.0, 0.0, v]) for v in shape]},
    ]  # fmt: skip
    pyuff.UFF(str(folder / "test.uff")).write_sets(datasets, mode="overwrite")
    with (folder / "test.uff").open("a") as stream:
        stream.write(_RESPONSE)
    return folder


def a_run() -> RunData:
    """Return a run of three strategies on two cases with all that a result can have."""
    modes = (PairedMode(1, 20.0, 20.5, 0.98), PairedMode(2, 50.0, None, None))
    changed = (PairedMode(1, 18.0, -3.0, 0.9, "mass at E"),)
    blocks = {"used": Block(1.5, 0.98, modes), "modified": Block(4.0, None, changed)}
    results = []
    for case in ("frame", "set/part"):
        for seed in (0, 1):
            ok = {"rigid_body_modes": 3, "rigid_body_modes_expected": 3, "negative_eigenvalues": 0}
            results += [
                JobResult(case, "unchanged", seed, "ok", blocks=blocks, gain=0.0, rank=1, **ok),
                JobResult(
                    case, "baruch", seed, "ok", "", 0.1, blocks, 2, 3, 1, 4, 5, 0.5, 2,
                    ({"name": "EI", "before": 1.0, "after": 1.1},), ({"step": 1.0},),
                    {"converged": 0.0}, "", "key", {"version": "1", "seed": seed},
                ),
                JobResult(case, "kabe", seed, "failed", "no solution", traceback="Traceback"),
            ]  # fmt: skip
    errors = {"used": 1.5, "modified": 4.0}
    meta = {
        "run": "20260101T000000Z-abcdef", "started": "2026-01-01T00:00:00+00:00", "seed": 0,
        "seeds": [0, 1], "jobs": 2, "timeout": None, "versions": {"python": "3.11"},
        "machine": {"cpu": "x", "cpu_count": 2}, "git_commit": None, "plan": "p",
        "cases": {"frame": {"title": "Frame", "digest": "d"}, "set/part": {"title": "P"}},
        "strategies": ["unchanged", "baruch", "kabe"], "citations": {"kabe": "K. (1985)"},
        "reference": {"frame": errors, "set/part": errors}, "rule": Rule().to_json(),
        "models": {case: {"drawn": to_plain(blocks)} for case in ("frame", "set/part")},
    }  # fmt: skip
    return RunData(meta, tuple(results))


def run_text() -> str:
    """Return the JSON of a run."""
    return json.dumps(run_to_json(a_run()), indent=1)
