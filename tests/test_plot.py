"""`femubench.plot`: what stands in every drawing, and what cannot be drawn says so in a line."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import diagnosis_toys
import harness_toys
import numpy as np
import pytest
import scored
from diagnosis_toys import STRUCTURE, data_of
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver

from femubench import (
    Case,
    Model,
    ParameterEstimate,
    Run,
    UpdateResult,
    plot,
    read_case,
    solve_modes,
)
from femubench.core.case.nodes import MatrixGeometry
from femubench.core.drawing.places import find_wireframe
from femubench.core.errors import InputError
from femubench.core.plot.findings import scale_end
from femubench.core.plot.style import COLOURS, place_names
from femubench.core.schema.diagnosis import LocationRow, ResidualRow
from femubench.core.schema.results import JobResult
from femubench.modal import mac
from femubench.plot import wireframe_of
from femubench.results import Block, PairedMode
from femubench.scenarios import HERE


@pytest.fixture(scope="module")
def frame() -> Case:
    return read_case(HERE / "frame")


@pytest.fixture(scope="module")
def hframe() -> Case:
    return read_case(HERE / "hframe")


def matrices() -> Model:
    """Return the model of the toy case as one that came as matrices with named nodes."""
    model = harness_toys.tiny_case().model
    names = tuple(f"n{k}" for k in range(int(model.dofs.node.max()) + 1))
    return replace(model, structure=None, geometry=MatrixGeometry(names, model.dofs))


def update(**changes: Any) -> UpdateResult:
    model = harness_toys.tiny_case().model
    parameters = (
        ParameterEstimate("E all", 7.0e10, 6.3e10, "Pa", 7.0e8),
        ParameterEstimate("J tube", 2.0e-8, 2.5e-8, "m4"),
    )
    history = ({"iteration": 1, "residual": 1.0}, {"iteration": 2, "residual": 0.01})
    return replace(UpdateResult(model, 2, parameters, history), **changes)


def run(**changes: Any) -> Run:
    histories: dict[str, Any] = {
        "fast": ({"residual": 3.0, "other": 1.0},),
        "slow": ({"residual": 2.0}, {"residual": 0.5}),
        "odd": (),
    }
    results = tuple(
        JobResult(
            "toy", name, 0, "ok", seconds=0.1 * 10**k, history=histories[name],
            negative_eigenvalues=int(name == "odd"),
            blocks=scored.blocks(used=100.0 * np.log1p(0.01 * (1.0 + k))),
        )
        for k, name in enumerate(histories)
    )  # fmt: skip
    meta = scored.meta({"toy": {"used": 2.0}}, strategies=list(histories))
    return replace(Run(meta, results), **changes)


def labels(ax: Any) -> list[str]:
    legend = ax.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def texts(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.texts]


def segments(ax: Any) -> list[Any]:
    return [one.get_segments() for one in ax.collections if isinstance(one, LineCollection)]


class TestModeShape:
    def test_in_its_plane(self, hframe: Case) -> None:
        ax = plot.mode_shape(hframe, [1, 3])
        undeformed, first, third = segments(ax)
        assert (len(undeformed), len(first), len(third)) == (5, 64, 64)
        assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_aspect()) == ("x, m", "z, m", 1.0)
        elastic = solve_modes(hframe.model).elastic.natural_frequencies
        assert labels(ax)[:2] == [f"mode {k}, {elastic[k - 1]:.4g} Hz" for k in (1, 3)]
        # The largest motion is 12 % of the largest side.
        still = np.array(wireframe_of(hframe).nodes)[:, [0, 2]]
        ends = np.array(wireframe_of(hframe).elements)
        away = np.linalg.norm(np.array(first) - still[ends], axis=-1).max()
        assert away == pytest.approx(0.12 * np.ptp(still, axis=0).max(), rel=0.05)

    def test_arrows_are_the_measured_shape_on_the_scale_of_the_mode(self, hframe: Case) -> None:
        """Where the test agrees (MAC 1.00), the tips of the arrows lie on the deformed line."""
        ax = plot.mode_shape(hframe, 1)
        (arrows,) = (item for item in ax.collections if isinstance(item, Quiver))
        data = hframe.measurement
        modes = solve_modes(hframe.model).elastic
        predicted = np.asarray(hframe.model.observe(data.sensors) @ modes.shapes[:, 0])
        along = np.hypot(arrows.U, arrows.V)
        assert len(along) == np.isfinite(data.shapes[:, 0]).sum()
        ratio = along / np.abs(predicted)
        strong = np.abs(predicted) > 0.3 * np.abs(predicted).max()
        assert np.ptp(ratio[strong]) < 0.1 * ratio[strong].mean()
        assert "measured mode 1 at 77.13 Hz, MAC 1.000" in ax.get_title()

    def test_out_of_its_plane_from_above_a_corner(self, frame: Case) -> None:
        ax = plot.mode_shape(frame, 1, measured=False)
        assert texts(ax)[:3:2] == ["x", "y"]
        assert labels(ax) == ["mode 1, 255.8 Hz"]
        still, moved = (np.array(part) for part in segments(ax))
        # z is up: the motion has no part across.
        view = still[0, 0]
        assert np.isin(view[0].round(9), moved[..., 0].round(9))

    def test_nodes_of_matrices(self) -> None:
        ax = plot.mode_shape(matrices(), 2)
        (moved,) = (line for line in ax.get_lines() if str(line.get_label()).startswith("mode 2,"))
        assert len(moved.get_xydata()) == len(wireframe_of(matrices()).nodes)

    def test_axes_are_those_given_and_no_figure_is_left_behind(self, hframe: Case) -> None:
        mine = Figure().subplots()
        assert plot.mode_shape(hframe.model, ax=mine) is mine
        code = (
            "import sys; from femubench import plot, read_case;"
            "from femubench.scenarios import HERE;"
            "assert 'matplotlib' not in sys.modules;"
            "plot.mode_shape(read_case(HERE / 'hframe'));"
            "sys.exit('matplotlib.pyplot' in sys.modules)"
        )
        subprocess.run([sys.executable, "-c", code], check=True)


class TestMac:
    def test_numbers_are_those_of_the_modes(self, frame: Case) -> None:
        ax = plot.mac(frame)
        elastic = solve_modes(frame.model).elastic
        tested = frame.measurement.select((*frame.used, *frame.held_out))
        at_sensors = frame.model.observe(tested.sensors) @ elastic.shapes
        wanted = mac(tested.shapes, at_sensors)[:, :5]
        (image,) = ax.images
        np.testing.assert_allclose(np.ma.getdata(image.get_array()), wanted)
        assert texts(ax) == [f"{value:.2f}" for value in wanted.ravel()]
        assert next(t.get_text() for t in ax.get_yticklabels()) == "1: 226.8"
        assert ax.get_ylabel() == "measured mode: frequency, Hz"

    def test_of_shapes_with_each_other(self, hframe: Case) -> None:
        ax = plot.mac(np.eye(4)[:, :3])
        assert texts(ax) == ["1.00", "0.00", "0.00", "0.00", "1.00", "0.00", "0.00", "0.00", "1.00"]
        # Mode 7 has a frequency alone.
        assert "–" in texts(plot.mac(hframe.measurement))

    def test_of_an_updated_model(self, frame: Case) -> None:
        found = plot.mac(frame.measurement, UpdateResult(frame.model))
        assert texts(found) == texts(plot.mac(frame.measurement, frame.model))


def test_receptance_of_the_case_and_of_models(frame: Case) -> None:
    softer = UpdateResult(replace(frame.model, stiffness=0.81 * frame.model.stiffness))
    ax = plot.receptance(frame, {"softer": softer})
    assert labels(ax) == ["measured modes", "nominal model", "softer"]
    assert (ax.get_xlabel(), ax.get_ylabel()[-11:]) == ("frequency, Hz", "dB re 1 m/N")
    _, nominal, soft = (line.get_xydata() for line in ax.get_lines())
    first = solve_modes(frame.model).elastic.natural_frequencies[0]
    for curve, top in ((nominal, first), (soft, 0.9 * first)):
        near = np.abs(curve[:, 0] - top) < 0.05 * top
        peak = curve[near][np.argmax(curve[near, 1]), 0]
        assert abs(peak - top) <= np.diff(curve[:2, 0])[0]
    other = plot.receptance(frame, sensor=frame.measurement.sensors.labels[2])
    assert frame.measurement.sensors.labels[2] in other.get_ylabel()


class TestUpdating:
    def test_convergence_of_a_result(self) -> None:
        ax = plot.convergence(update())
        (line,) = ax.get_lines()
        assert line.get_xydata().tolist() == [[1.0, 1.0], [2.0, 0.01]]
        assert (ax.get_yscale(), ax.get_xlabel(), ax.get_ylabel()) == (
            "log",
            "iteration",
            "residual",
        )
        signed = update(history=({"residual": -1.0}, {"residual": 1.0}))
        assert plot.convergence(signed).get_yscale() == "linear"

    def test_convergence_of_a_run(self) -> None:
        ax = plot.convergence(run())
        assert labels(ax) == ["fast", "slow"]
        assert labels(plot.convergence(run(), quantity="other")) == ["fast"]

    def test_parameters_in_percent_with_their_deviations(self) -> None:
        ax = plot.parameters(update())
        assert [bar.get_width() for bar in ax.patches] == pytest.approx([-10.0, 25.0])
        assert [t.get_text() for t in ax.get_yticklabels()] == ["E all", "J tube"]
        (bars,) = ax.collections
        (segment,) = bars.get_segments()  # type: ignore[attr-defined]
        np.testing.assert_allclose(segment, [[-11.0, 0.0], [-9.0, 0.0]])
        assert ax.get_xlabel() == "change, %"

    def test_parameters_from_zero_have_values(self) -> None:
        springs = (ParameterEstimate("c", 0.0, 2.0, "1/Nm", 0.5),)
        ax = plot.parameters(update(parameters=springs))
        assert [bar.get_width() for bar in ax.patches] == [2.0]
        assert ax.get_xlabel() == "after the update, 1/Nm"


def test_calibration_is_the_share_of_modes_in_each_interval() -> None:
    """One mode 0.5 and one 2 deviations off: in intervals from 0.383 and 0.954 on."""
    modes = tuple(PairedMode(k, 100.0, 100.0 + d, 1.0, None, 1.0) for k, d in ((1, 0.5), (2, 2.0)))
    blocks = {"higher": Block(1.0, 1.0, modes)}
    ax = plot.calibration(run(results=(JobResult("a", "sure", 0, "ok", blocks=blocks),)))
    (line,) = (line for line in ax.get_lines() if line.get_label() == "sure")
    levels, observed = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    assert observed == pytest.approx(0.5 * (levels > 0.383) + 0.5 * (levels > 0.954))
    with pytest.raises(InputError, match="no strategy of the run says how sure it is"):
        plot.calibration(run())


def test_error_against_cost() -> None:
    ax = plot.error_against_cost(run(), error="used_percent")
    physical, unphysical = ax.get_lines()
    assert physical.get_xydata() == pytest.approx(np.array([[0.1, 1.0], [1.0, 2.0]]))
    assert unphysical.get_xydata() == pytest.approx(np.array([[10.0, 3.0]]))
    assert unphysical.get_marker() != physical.get_marker()
    assert sorted(texts(ax)) == ["fast", "odd", "slow"]
    assert "s (median" in ax.get_xlabel()


class TestResiduals:
    def test_lie_in_the_band_or_out_of_it(self) -> None:
        rows = (
            ResidualRow("frequency", 1, "", 10.0, -1.9, 0.0),
            ResidualRow("frequency", 2, "", 20.0, 2.1, 400.0),
            ResidualRow("frequency", 3, "", 30.0, None, None),
        )
        ax = plot.residuals(diagnosis_toys.made(residuals=rows))
        before, after = (line for line in ax.get_lines() if line.get_label() in ("before", "after"))
        assert before.get_xdata() == pytest.approx([-1.9, 2.1])
        assert after.get_xdata() == pytest.approx([0.0, 400.0])
        assert before.get_marker() != after.get_marker()
        (band,) = ax.patches
        assert (band.get_x(), band.get_width()) == (-2.0, 4.0)  # type: ignore[attr-defined]
        low, high = ax.get_xlim()
        assert low < -2.0 < 400.0 < high
        companions = [t.get_text() for t in ax.child_axes[0].get_yticklabels()]
        assert companions == ["-1.9 → +0.0", "+2.1 → +400.0", "– → –"]

    def test_shapes_are_root_mean_squares(self) -> None:
        (dot,) = plot.residual_dots(diagnosis_toys.made(), "shape")
        assert (dot.before, dot.after) == pytest.approx((np.sqrt(12.5), 1.0))

    def test_of_any_size(self) -> None:
        rows = (ResidualRow("frequency", 1, "", 1.0, 1e300, -1e300),)
        assert max(map(abs, plot.residuals(diagnosis_toys.made(residuals=rows)).get_xlim())) < 1e13


class TestEvidence:
    WORDS = ("all", "type:T", "beam@J1", "beam/2", "beam", "J1", "p2", "nowhere", "beam/9")

    @pytest.mark.parametrize("plane", ["in-plane", "out-of-plane", "3d", "matrices"])
    def test_places_are_found(self, plane: str) -> None:
        rows = tuple(LocationRow("evidence", word, 0.5) for word in self.WORDS)
        data = {**data_of(locations=rows, causes=()), "structure": {**STRUCTURE, "plane": plane}}
        ax = plot.evidence(data)
        shown = {
            str(a.get_label()).partition(":")[0][1:]
            for a in ax.get_children()
            if str(a.get_gid()).startswith("at-")
        }
        found = {word.partition(":")[0] for word in self.WORDS} - {"all", "nowhere", "beam/9"}
        assert shown == found
        assert [a.get_gid() for a in ax.get_children()].count("everywhere-1") == 1
        assert {"J1", "J3", "beam"} <= set(texts(ax))

    def test_stronger_is_thicker_and_darker(self, hframe: Case) -> None:
        rows = (LocationRow("evidence", "upper-1", 1.0), LocationRow("evidence", "upper-2", 0.1))
        found = diagnosis_toys.made(locations=rows, causes=())
        ax = plot.evidence(found, case=hframe)
        strong, weak = (
            next(a for a in ax.get_children() if a.get_gid() == f"at-{k}") for k in (0, 1)
        )
        assert isinstance(strong, LineCollection)
        assert isinstance(weak, LineCollection)
        assert strong.get_linewidth()[0] > weak.get_linewidth()[0]  # type: ignore[index]
        assert sum(strong.get_color()[0][:3]) < sum(weak.get_color()[0][:3])
        sensors = [a for a in ax.get_children() if str(a.get_gid()).startswith("sensor-")]
        assert len(sensors) == len(hframe.measurement.sensors)

    def test_causes_are_numbered(self) -> None:
        cause = replace(
            diagnosis_toys.SOFT,
            place=harness_toys.tiny_case().model.frame_structure.frame.joints[0].name,
        )
        ax = plot.evidence(diagnosis_toys.made(causes=(cause,), locations=()))
        assert "1" in [t.get_text() for t in ax.texts if t.get_weight() == "bold"]

    def test_causes_stand_where_they_sit_and_are_listed(self) -> None:
        ax = plot.evidence(diagnosis_toys.made(locations=()))
        listed = labels(ax)
        causes = data_of()["causes"]
        assert listed[len(causes) :] == ["evidence by place, of all explanations"]
        assert all(any(text.startswith(f"{k} ") for text in listed) for k in range(1, len(causes)))
        marks = [a for a in ax.get_lines() if str(a.get_gid()).startswith("finding-")]
        assert all(mark.get_marker() in "DosX" for mark in marks)

    def test_a_fault_marks_its_sensor(self, hframe: Case) -> None:
        label = hframe.measurement.sensors.labels[3]
        cause = replace(
            diagnosis_toys.SOFT, effect="sensor-sign", place=f"sensor:{label}", side="data"
        )
        ax = plot.evidence(diagnosis_toys.made(causes=(cause,), locations=()), case=hframe)
        (mark,) = (a for a in ax.get_lines() if a.get_gid() == "finding-0")
        xyz = hframe.measurement.sensors.xyz[3]
        assert mark.get_xydata()[0] == pytest.approx((xyz[0], xyz[2]))
        assert mark.get_marker() == "X"

    @pytest.mark.parametrize("xyz", [[0.0, 0.0, 0.0], [1e308, -1e308, 1e308]])
    def test_no_extent_no_drawing(self, xyz: list[float]) -> None:
        joints = [{"name": "a", "xyz": xyz}, {"name": "b", "xyz": [-v for v in xyz]}]
        bare = {**STRUCTURE, "joints": joints, "sensors": [], "places": []}
        with pytest.raises(InputError, match="no extent"):
            plot.evidence({**data_of(), "structure": bare})


class TestChanges:
    def test_what_is_drawn_is_what_was_reported(self, hframe: Case) -> None:
        estimate = ParameterEstimate("E all", 1.0, 1.056, places=("all",))
        soft = ParameterEstimate("k", 1e6, 2e5, "N m/rad", places=("horizontal@T1:ry",))
        result = UpdateResult(hframe.model, 2, (estimate, soft))
        ax = plot.changes(hframe, result)
        assert labels(ax) == ["E all +5.6 %", "k 200000 N m/rad"]
        (ring,) = (a for a in ax.get_lines() if a.get_gid() == "finding-1")
        assert ring.get_marker() == "o"

    def test_one_outlier_does_not_make_the_rest_pale(self) -> None:
        assert scale_end([0.02, -0.03, 0.9]) == pytest.approx(0.09)
        assert scale_end([0.02, -0.03]) == pytest.approx(0.03)


WRONG: list[Callable[[Case], object]] = [
    lambda case: plot.mode_shape(case, 0),
    lambda case: plot.mode_shape(case, 10_000),
    lambda case: plot.mode_shape(case.measurement),  # type: ignore[arg-type]
    lambda case: plot.mac(case.measurement.shapes, case.model),
    lambda case: plot.mac(np.eye(3), np.eye(4)),
    lambda case: plot.mac("shapes"),  # type: ignore[arg-type]
    lambda case: plot.receptance(case.model),  # type: ignore[arg-type]
    lambda case: plot.receptance(case, sensor="nowhere"),
    lambda case: plot.receptance(case, modification="none such"),
    lambda case: plot.convergence(update(history=())),
    lambda case: plot.convergence(run(), case="other"),
    lambda case: plot.convergence(run(), quantity="other one"),
    lambda case: plot.parameters(update(parameters=())),
    lambda case: plot.parameters(
        update(parameters=(ParameterEstimate("a", 0.0, 1.0, "m"), ParameterEstimate("b", 1.0, 1.0)))
    ),
    lambda case: plot.error_against_cost(run(), error="beauty"),
    lambda case: plot.error_against_cost(run(results=())),
    lambda case: plot.residuals(case),  # type: ignore[arg-type]
    lambda case: plot.residuals(diagnosis_toys.made(residuals=())),
    lambda case: plot.changes(case, update()),
    lambda case: plot.evidence({"residuals": [], "locations": [], "causes": []}),
]


@pytest.mark.parametrize("draw", WRONG)
def test_what_cannot_be_drawn_says_so_in_a_line(draw: Callable[[Case], object]) -> None:
    with pytest.raises(InputError) as caught:
        draw(harness_toys.tiny_case())
    assert "\n" not in str(caught.value)


def test_names_stand_apart_and_hold_nothing_that_cannot_be_shown() -> None:
    ax = Figure(figsize=(4, 3)).subplots()
    points = np.array([[0.5, 0.5], [0.505, 0.5], [0.5, 0.505]])
    place_names(ax, points, ["first", "second", diagnosis_toys.NASTY])
    ax.get_figure().draw_without_rendering()  # type: ignore[union-attr]
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[k + 1 :])
    assert ax.texts[2].get_text().isprintable()
    assert len(ax.texts[2].get_text()) <= 22


def test_colours_of_a_themed_drawing_have_one_name_each() -> None:
    assert len(set(COLOURS.values())) == len(COLOURS)


class TestWireframe:
    def test_is_the_structure(self, hframe: Case) -> None:
        found = wireframe_of(hframe)
        frame = hframe.model.frame_structure.frame
        assert [m.name for m in found.members] == [m.name for m in frame.members]
        assert sum(m.elements for m in found.members) <= len(found.elements)
        assert sum(mass.kg for mass in found.masses) == pytest.approx(0.1024)
        for joint in found.joints:
            assert found.nodes[joint.node] == joint.xyz
        for (i, j), member in zip(found.elements, found.member_of, strict=True):
            start, end = found.lines[member]
            for k in (i, j):
                assert (
                    np.linalg.norm(np.cross(np.subtract(found.nodes[k], start), end - start)) < 1e-9
                )

    def test_a_model_has_no_sensors_and_matrices_no_members(self) -> None:
        found = wireframe_of(matrices())
        assert found.plane == "matrices"
        assert (found.members, found.sensors, found.elements) == ((), (), ())
        assert len(found.joints) == len(found.nodes) > 0

    @pytest.mark.parametrize(
        ("word", "kind", "count"),
        [
            ("T:branch", "end", 2),
            ("T", "joint", 2),
            ("upper-1/3", "element", 1),
            ("T1-T2", "pair", 2),
        ],
    )
    def test_places(self, word: str, kind: str, count: int, hframe: Case) -> None:
        found = find_wireframe(hframe, [word]).place(word)
        assert found.kind == kind
        assert len(found.spans) + len(found.points) == count
