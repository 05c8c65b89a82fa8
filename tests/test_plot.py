"""`femubench.plot`: what stands in every drawing, and what cannot be drawn says so in a line."""

from __future__ import annotations

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
from femubench.core.errors import InputError
from femubench.core.schema.diagnosis import LocationRow, ResidualRow
from femubench.core.schema.results import Block, JobResult
from femubench.modal import mac
from femubench.plot import wireframe_of
from femubench.results import PairedMode
from femubench.scenarios import HERE
from tests.command import run_python


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
        run_python("-c", code)


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


def test_receptance_of_the_case_and_of_models(frame: Case) -> None:
    softer = UpdateResult(replace(frame.model, stiffness=0.81 * frame.model.stiffness))
    ax = plot.receptance(frame, {"softer": softer})
    assert labels(ax) == ["measured modes", "nominal model", "softer"]
    _, nominal, soft = (line.get_xydata() for line in ax.get_lines())
    first = solve_modes(frame.model).elastic.natural_frequencies[0]
    for curve, top in ((nominal, first), (soft, 0.9 * first)):
        near = np.abs(curve[:, 0] - top) < 0.05 * top
        peak = curve[near][np.argmax(curve[near, 1]), 0]
        assert abs(peak - top) <= np.diff(curve[:2, 0])[0]


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

    def test_parameters_in_percent_with_their_deviations(self) -> None:
        ax = plot.parameters(update())
        assert [bar.get_width() for bar in ax.patches] == pytest.approx([-10.0, 25.0])
        assert [t.get_text() for t in ax.get_yticklabels()] == ["E all", "J tube"]
        (bars,) = ax.collections
        (segment,) = bars.get_segments()  # type: ignore[attr-defined]
        np.testing.assert_allclose(segment, [[-11.0, 0.0], [-9.0, 0.0]])
        assert ax.get_xlabel() == "change, %"


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
    physical, unphysical = plot.error_against_cost(run(), error="used_percent").get_lines()
    assert physical.get_xydata() == pytest.approx(np.array([[0.1, 1.0], [1.0, 2.0]]))
    assert unphysical.get_xydata() == pytest.approx(np.array([[10.0, 3.0]]))


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


class TestEvidence:
    WORDS = ("all", "type:T", "beam@J1", "beam/2", "beam", "J1", "p2", "nowhere", "beam/9")

    @pytest.mark.parametrize("plane", ["in-plane", "matrices"])
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


WRONG: list[Callable[[Case], object]] = [
    lambda case: plot.mode_shape(case, 0),
    lambda case: plot.mode_shape(case.measurement),  # type: ignore[arg-type]
    lambda case: plot.mac(case.measurement.shapes, case.model),
    lambda case: plot.mac(np.eye(3), np.eye(4)),
    lambda case: plot.receptance(case.model),  # type: ignore[arg-type]
    lambda case: plot.receptance(case, sensor="nowhere"),
    lambda case: plot.convergence(update(history=())),
    lambda case: plot.convergence(run(), quantity="other one"),
    lambda case: plot.parameters(update(parameters=())),
    lambda case: plot.parameters(
        update(parameters=(ParameterEstimate("a", 0.0, 1.0, "m"), ParameterEstimate("b", 1.0, 1.0)))
    ),
    lambda case: plot.error_against_cost(run(), error="beauty"),
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
