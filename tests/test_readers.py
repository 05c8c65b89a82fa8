"""Universal files that pyuff writes come out as sensors and modes."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff

from femubench import InputError, read_case
from femubench.plugins.readers.universal import UniversalReader

CASES = Path(__file__).parent / "cases"
FORMATS = Path(__file__).parent / "formats"
XYZ = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.5], [0.75, 0.0, 1.1]])
NODES = [11, 12, 20]
SHAPES = np.array([[1.0, -0.5, 0.25], [0.5, 0.25, -1.0]])  # of two modes, along x
Dataset = dict[str, Any]


def nodes_15(**changes: object) -> Dataset:
    x, y, z = XYZ.T.tolist()
    zeros = [0, 0, 0]
    dataset = {"type": 15, "node_nums": NODES, "x": x, "y": y, "z": z}
    return dataset | {"def_cs": zeros, "disp_cs": zeros, "color": zeros} | changes


def nodes_2411(scale: float = 1.0, **changes: object) -> Dataset:
    x, y, z = (scale * XYZ).T
    return nodes_15(x=x, y=y, z=z, **changes) | {"type": 2411}


def units(length: float) -> Dataset:
    factors = {"length": length, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    return dict(pyuff.prepare_164(units_code=5, units_description="mm", temp_mode=1, **factors))


def mode_55(number: int, shape: Sequence[complex], **changes: object) -> Dataset:
    zero = np.zeros(len(NODES)) * np.asarray(shape)
    dataset = {"type": 55, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 1}
    dataset |= {"mode_n": number, "freq": 10.0 * number, "modal_damp_vis": 0.01 * number}
    readings = {"node_nums": np.array(NODES), "r1": np.asarray(shape), "r2": zero, "r3": zero}
    return dataset | readings | changes


def mode_2414(number: int, shape: Sequence[float]) -> Dataset:
    return {
        **{"type": 2414, "analysis_dataset_label": number, "analysis_dataset_name": "mode"},
        **{"dataset_location": 1, "model_type": 1, "analysis_type": 2, "data_characteristic": 2},
        **{"result_type": 8, "data_type": 2, **{f"id{i}": "NONE" for i in range(1, 6)}},
        **{"number_of_data_values_for_the_data_component": 3, "record10_field6": number},
        **{"record12_field2": 10.0 * number, "record12_field6": 0.02, "node_nums": np.array(NODES)},
        **{"x": np.array(shape), "y": np.zeros(3), "z": np.zeros(3)},
        "data_at_node": [np.array([value, 0.0, 0.0]) for value in shape],
    }


def write(path: Path, *datasets: Mapping[str, object]) -> Path:
    pyuff.UFF(str(path)).write_sets([dict(dataset) for dataset in datasets], mode="overwrite")
    return path


def modes(*shapes: Sequence[complex]) -> list[Dataset]:
    return [mode_55(i + 1, shape) for i, shape in enumerate(shapes)]


@pytest.mark.parametrize("nodes", [nodes_15(), nodes_2411()])
def test_nodes_and_modes(tmp_path: Path, nodes: Dataset) -> None:
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", nodes, *modes(*SHAPES)))
    assert read.sensors.labels == ("11:x", "12:x", "20:x")
    np.testing.assert_allclose(read.sensors.xyz, XYZ)
    assert read.numbers == (1, 2)
    np.testing.assert_allclose(read.frequencies, [10.0, 20.0])
    assert np.isnan(read.frequency_std).all()  # a case gives what a file does not state
    np.testing.assert_allclose(read.damping, [0.01, 0.02])
    np.testing.assert_allclose(read.shapes, SHAPES.T)


def test_millimetres(tmp_path: Path) -> None:
    file = write(tmp_path / "a.unv", units(1000.0), nodes_2411(1000.0), *modes(*SHAPES))
    read = UniversalReader().read_modes(file)
    np.testing.assert_allclose(read.sensors.xyz, XYZ)
    np.testing.assert_allclose(read.shapes, SHAPES.T / 1000.0)


def test_six_components(tmp_path: Path) -> None:
    turns = {f"r{i}": np.array([0.0, 0.0, 2.0 * i]) for i in (4, 5, 6)}
    datasets = [nodes_15(), mode_55(1, SHAPES[0], data_ch=3, **turns)]
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", *datasets))
    assert read.sensors.labels == ("11:x", "12:x", "20:x", "20:rx", "20:ry", "20:rz")
    np.testing.assert_allclose(read.shapes[3:, 0], [8.0, 10.0, 12.0])


@pytest.mark.parametrize("phase", [0.4, np.pi / 2])
def test_complex_modes(tmp_path: Path, phase: float) -> None:
    eigenvalue = complex(-2.0, 100.0)
    scatter = np.exp(1j * np.array([0.02, -0.02, 0.0]))
    datasets = [
        mode_55(i + 1, shape * scatter * np.exp(1j * phase), analysis_type=analysis, eig=eigenvalue)
        for i, (shape, analysis) in enumerate(zip(SHAPES, (3, 7), strict=True))
    ]
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", nodes_15(), *datasets))
    np.testing.assert_allclose(read.frequencies, abs(eigenvalue) / (2 * np.pi))
    np.testing.assert_allclose(read.damping, 2.0 / abs(eigenvalue))
    sign = np.sign(read.shapes[0] * SHAPES[:, 0])
    np.testing.assert_allclose(read.shapes * sign, SHAPES.T, rtol=2e-5)
    parts = [np.c_[shape * scatter.real, shape * scatter.imag] for shape in SHAPES]
    lost = [np.linalg.svd(p, compute_uv=False)[1] / np.linalg.norm(p) for p in parts]
    np.testing.assert_allclose(read.out_of_phase, lost, rtol=1e-3)


def test_modal_masses(tmp_path: Path) -> None:
    eigenvalue = complex(-2.0, 100.0)
    scaled = {"analysis_type": 3, "eig": eigenvalue, "modal_a": 600j}  # 2 i w_d m
    both = [mode_55(1, SHAPES[0], modal_m=2.5), mode_55(2, SHAPES[1], **scaled)]
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", nodes_15(), *both))
    np.testing.assert_allclose(read.modal_mass, [2.5, 3.0])
    one = [mode_55(1, SHAPES[0], modal_m=1.0), mode_55(2, SHAPES[1], modal_m=1.0)]
    for name, datasets in {"b": one, "c": [units(1000.0), *both], "d": modes(*SHAPES)}.items():
        file = write(tmp_path / f"{name}.uff", nodes_15(), *datasets)
        assert UniversalReader().read_modes(file).modal_mass is None


def test_dataset_2414(tmp_path: Path) -> None:
    datasets = [mode_2414(i + 1, shape) for i, shape in enumerate(SHAPES.tolist())]
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", nodes_15(), *datasets))
    assert read.sensors.labels == ("11:x", "12:x", "20:x")
    np.testing.assert_allclose(read.frequencies, [10.0, 20.0])
    np.testing.assert_allclose(read.damping, 0.01)
    np.testing.assert_allclose(read.shapes, SHAPES.T)


def test_rigid_modes_and_other_results_are_left_out(tmp_path: Path) -> None:
    rigid, stress = mode_55(1, SHAPES[0], freq=0.0), mode_55(3, SHAPES[0], spec_data_type=2)
    datasets = [nodes_15(), rigid, mode_55(2, SHAPES[1]), stress]
    read = UniversalReader().read_modes(write(tmp_path / "a.uff", *datasets))
    assert read.numbers == (2,)


def system(matrix: np.ndarray, kind: int = 0) -> Dataset:
    named = {"type": 2420, "Part_UID": 1, "Part_Name": "part", "CS_names": ["cs"]}
    own = {"CS_sys_labels": [5], "CS_types": [kind], "CS_colors": [8], "CS_matrices": [matrix]}
    return named | own


TURNED = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])  # rows: local axes


def test_local_displacements_become_directions(tmp_path: Path) -> None:
    axes = system(np.vstack([TURNED, [5.0, 5.0, 5.0]]))
    file = write(tmp_path / "a.uff", axes, nodes_2411(disp_cs=[5, 5, 0]), *modes(*SHAPES))
    sensors = UniversalReader().read_modes(file).sensors
    np.testing.assert_allclose(sensors.xyz, XYZ)  # 2411 has them in the axes of the part
    np.testing.assert_allclose(sensors.axes[:2, :3], [[0.6, 0.0, 0.8]] * 2)
    assert sensors.directions[2] == "x"


def test_cylindrical_axes(tmp_path: Path) -> None:
    own = np.vstack([np.eye(3), [1.0, 2.0, 0.0]])
    nodes = nodes_15(
        x=[2.0] * 3, y=[0.0, 90.0, 180.0], z=[0.5] * 3, def_cs=[5] * 3, disp_cs=[5] * 3
    )
    file = write(tmp_path / "a.uff", system(own, kind=1), nodes, *modes(*SHAPES))
    sensors = UniversalReader().read_modes(file).sensors
    np.testing.assert_allclose(sensors.xyz, [[3, 2, 0.5], [1, 4, 0.5], [-1, 2, 0.5]], atol=1e-12)
    assert sensors.directions == ("x", "y", "-x")  # outwards


def test_system_said_in_another(tmp_path: Path) -> None:
    """Dataset 18 chains: a quarter turn about z, twice, is a half turn."""
    file = write(tmp_path / "a.uff", nodes_15(def_cs=[8] * 3, disp_cs=[8] * 3), *modes(*SHAPES))
    text = "".join(
        f"{number:10d}{0:10d}{outer:10d}{1:10d}{1:10d}\nname\n"
        "  1.00000E+00  0.00000E+00  0.00000E+00  1.00000E+00  1.00000E+00  0.00000E+00\n"
        "  1.00000E+00  0.00000E+00  1.00000E+00\n"
        for number, outer in [(7, 0), (8, 7)]
    )
    file.write_text(f"    -1\n    18\n{text}    -1\n" + file.read_text())
    sensors = UniversalReader().read_modes(file).sensors
    assert sensors.directions == ("-x",) * 3
    np.testing.assert_allclose(sensors.xyz, [1.0, 1.0, 0.0] + XYZ * [-1, -1, 1], atol=1e-12)


def test_axes_that_cannot_be(tmp_path: Path) -> None:
    nodes, same = nodes_2411(disp_cs=[5, 5, 5]), np.vstack([np.eye(3), np.zeros(3)])
    skew = same + np.eye(4)[:, [1, 2, 0]]
    for i, (others, what) in enumerate(
        [
            ([], "node 11 uses the coordinate system 5"),
            ([system(same, kind=2)], "system 5 is of type 2"),
            ([system(skew)], "not at right angles"),
        ]
    ):
        file = write(tmp_path / f"{i}.uff", *others, nodes, *modes(*SHAPES))
        with pytest.raises(InputError, match=what):
            UniversalReader().read_modes(file)


def test_outline_of_a_test() -> None:
    outline = UniversalReader().read_outline(FORMATS / "mesh_Oros-modal_uff15_uff2412.uff")
    assert outline.lines.shape == (168, 2, 3)  # 72 quadrilaterals share their sides
    length = np.linalg.norm(outline.lines[:, 0] - outline.lines[:, 1], axis=1)
    assert length.max() < 40.0  # mm, no line across the ring


def test_trace_lines_and_header(tmp_path: Path) -> None:
    trace = {"type": 82, "trace_num": 1, "id": "edge", "color": 1}
    trace["nodes"] = np.array([11, 12, 0, 12, 20, 99])
    header = pyuff.prepare_151(model_name="wing", description="GVT of June", return_full_dict=True)
    outline = UniversalReader().read_outline(
        write(tmp_path / "a.uff", header, nodes_15(), trace, *modes(*SHAPES))
    )
    assert outline.title == "wing, GVT of June"
    np.testing.assert_allclose(outline.lines, [XYZ[[0, 1]], XYZ[[1, 2]]])


@pytest.mark.parametrize("name", ["heat_engine_housing", "uff55_translation"])
def test_files_of_real_exporters(name: str) -> None:
    read = UniversalReader().read_modes(FORMATS / f"{name}.uff")
    if name == "uff55_translation":
        assert read.frequencies.tolist() == [10.0, 12.0, 13.0]
        np.testing.assert_allclose(np.abs(read.shapes[:3, 0]), 1.46518)
    else:  # nodes and a temperature, no modes; in mm
        assert len(read) == 0
        np.testing.assert_allclose(read.sensors.xyz[0], [-0.1711755676, 0.1036403427, 0.1384829102])


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    reader = UniversalReader()
    nothing = tmp_path / "nothing.uff"
    nothing.write_text("rubbish\n")
    with pytest.raises(InputError, match="neither nodes nor modes"):
        reader.read_modes(nothing)
    with pytest.raises(InputError, match="no matrix"):
        reader.read_matrix(nothing)
    for name, datasets, what in [
        ("twice", [mode_55(1, SHAPES[0]), mode_55(1, SHAPES[1])], "mode 1 is listed twice"),
        ("percent", [mode_55(1, SHAPES[0], modal_damp_vis=1.2)], "damping 1.2"),
        ("units", [units(0.0), nodes_15()], "unclear units"),
        ("nan", [mode_55(1, SHAPES[0], freq=float("nan"))], "cannot be"),
    ]:
        with pytest.raises(InputError, match=what):
            reader.read_modes(write(tmp_path / f"{name}.uff", *datasets))
    file = write(tmp_path / "cut.uff", nodes_15(), mode_55(1, SHAPES[0]))
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:-3], "  1.00000e+00", lines[-1]]))
    with pytest.raises(InputError) as caught:
        reader.read_modes(file)
    assert "dataset 55" in str(caught.value)
    assert "\n" not in str(caught.value)


def case_with(tmp_path: Path, sensors: str, measured: str, *changes: tuple[str, str]) -> Path:
    folder = Path(shutil.copytree(CASES / "in-plane", tmp_path / "case"))
    text = (folder / "case.toml").read_text().split("[[modification]]")[0]
    text = text.replace('sensors = "sensors.csv"', sensors).replace("modes.csv", measured)
    text = text.replace("held_out = [4]", "")
    (folder / "case.toml").write_text(text)
    return folder


@pytest.mark.parametrize("sensors", ['sensors = "test.uff"', ""])
def test_one_file_for_sensors_and_modes(tmp_path: Path, sensors: str) -> None:
    folder = case_with(tmp_path, sensors, "test.uff")
    sideways = {"r2": np.array([0.1, 0.1, 0.1])}  # y, which an in-plane model does not have
    datasets = [nodes_15(), mode_55(1, SHAPES[0], **sideways), mode_55(2, SHAPES[1])]
    write(folder / "test.uff", *datasets)
    case = read_case(folder, readers=(UniversalReader(),))
    assert case.measurement.sensors.labels == ("11:x", "12:x", "20:x")
    np.testing.assert_allclose(case.measurement.shapes, SHAPES.T)
    np.testing.assert_allclose(case.measurement.shape_std, 0.02)
    assert case.measurement.total_mass == (14.1, 0.05)
    assert case.model.observe(case.measurement.sensors).shape == (3, case.model.size)
    digest = case.digest
    write(folder / "test.uff", *datasets, mode_55(3, SHAPES[1]))
    assert read_case(folder, readers=(UniversalReader(),)).digest != digest


def test_table_of_sensors_picks_from_the_file(tmp_path: Path) -> None:
    folder = case_with(tmp_path, 'sensors = "sensors.csv"', "test.uff")
    (folder / "sensors.csv").write_text("label,at,direction\n20:x,girder@0.5,x\n12:x,left@0.5,x\n")
    write(folder / "test.uff", *modes(*SHAPES))
    measurement = read_case(folder, readers=(UniversalReader(),)).measurement
    np.testing.assert_allclose(measurement.shapes, SHAPES.T[[2, 1]])
    (folder / "sensors.csv").write_text("label,at,direction\nleft,left@0.5,x\n")
    with pytest.raises(InputError, match="no shape belongs to a sensor"):
        read_case(folder, readers=(UniversalReader(),))


def test_files_that_do_not_fit_the_case(tmp_path: Path) -> None:
    folder = case_with(tmp_path, "", "test.uff")
    far = nodes_15(x=[9.0, 0.0, 0.0])
    for datasets, what in [
        ([far, *modes(*SHAPES)], "off the structure"),
        (modes(*SHAPES), "sensors without places"),
        ([nodes_15()], "no modes"),
    ]:
        write(folder / "test.uff", *datasets)
        with pytest.raises(InputError, match=what):
            read_case(folder, readers=(UniversalReader(),))
    with pytest.raises(InputError, match=r"unknown kind of file 'test\.uff'"):
        read_case(folder, readers=())
