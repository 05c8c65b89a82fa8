"""Identification of modes: against the truth of synthetic responses, and on input that is bad."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femubench
from femubench import Identification, InputError, identify
from femubench.core.case.response_files import join_files, locate_sensors, read_responses
from femubench.core.identify.complexity import mean_phase_deviation, phase_collinearity
from femubench.core.plugin.loader import load_plugins
from femubench.modal import FrequencyResponses, TimeSignals
from femubench.plot import mode_shape, stabilisation, synthesis
from femubench.reports.identification import identification_html
from tests.command import call_bench
from tests.frf_problems import frf_set, sensors, write_universal
from tests.identify_score import NAMES, covered, score

SMALL: dict[str, Any] = {
    "modes": 6, "pairs": 1, "references": 2, "step": 0.5, "band": (20.0, 200.0),
}  # fmt: skip


@pytest.fixture(scope="module")
def small() -> Any:
    return frf_set(4, **SMALL)


@pytest.fixture(scope="module")
def found(small: Any) -> Identification:
    return identify(small.measured)


@pytest.mark.slow(5)
def test_stated_deviations_are_those_of_repeats(small: Any) -> None:
    """The scatter over several structures, in stated deviations; chance gives 0.7 to 1.3."""
    scores = [score(s, identify(s.measured)) for s in (frf_set(k, **SMALL) for k in range(20, 25))]
    assert all(s.missed == 0 for s in scores)
    for name in NAMES:
        errors = np.concatenate([s.errors[name] for s in scores])
        assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.3
        assert covered(scores, name) > 0.7


def test_close_modes_are_set_apart(small: Any, found: Identification) -> None:
    gaps = np.diff(small.frequencies) / small.frequencies[:-1]
    k = int(gaps.argmin())
    assert gaps[k] == pytest.approx(0.01)
    pair = found.frequencies[k : k + 2]
    assert pair == pytest.approx(small.frequencies[k : k + 2], rel=5e-4)


def test_reciprocity_and_quantity_change_nothing(small: Any, found: Identification) -> None:
    jw = (2j * np.pi * small.measured.frequencies)[:, None, None]
    turned = replace(
        small.measured, values=small.measured.values / jw, quantity="mobility"
    ).transpose()
    other = identify(turned)
    assert other.sensors.labels == small.measured.responses.labels
    assert len(other) == len(found)
    apart = np.abs(other.frequencies - found.frequencies)
    assert (apart < 4.0 * found.frequency_std).all()


def test_a_channel_that_was_not_measured_is_done_without(small: Any) -> None:
    values = small.measured.values.copy()
    values[:, 5, 1] = np.nan
    judged = score(small, identify(replace(small.measured, values=values)))
    assert judged.missed == judged.extra == 0
    # One mode is hardly moved by the force that is left there, and its deviation says so.
    assert np.abs(judged.errors["shape"]).max() < 4.0


def test_noise_alone_has_no_modes(small: Any) -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((2, *small.measured.values.shape))
    with pytest.raises(InputError, match="no mode stands out of the noise"):
        identify(replace(small.measured, values=values[0] + 1j * values[1]))


def test_noise_that_follows_the_response_is_seen(small: Any) -> None:
    """1 % of every value: no mode is split, and the deviations still cover."""
    scores = []
    for seed in range(2):
        clean = frf_set(seed, noise=0.0, **{**SMALL, "step": 0.25})
        draws = np.random.default_rng(seed).standard_normal((2, *clean.measured.values.shape))
        values = clean.measured.values * (1.0 + 0.01 * (draws[0] + 1j * draws[1]) / np.sqrt(2.0))
        scores.append(score(clean, identify(replace(clean.measured, values=values))))
    assert all(s.within and s.extra <= 1 for s in scores)
    errors = np.concatenate([s.errors["frequency"] for s in scores])
    assert np.sqrt(np.mean(np.square(errors))) < 1.6


def test_complexity_of_known_shapes() -> None:
    real = np.array([1.0, -2.0, 3.0])[:, None] * np.exp(0.4j)
    round_trip = np.exp(2j * np.pi * np.arange(3) / 3.0)[:, None]
    tilted = np.array([1.0, np.exp(0.2j)])[:, None]
    shapes = np.hstack([real, round_trip])
    assert phase_collinearity(shapes) == pytest.approx([1.0, 0.0], abs=1e-12)
    assert mean_phase_deviation(real) == pytest.approx([0.0], abs=1e-5)
    assert mean_phase_deviation(tilted) == pytest.approx([np.degrees(0.1)])


def motions(seconds: float = 240.0) -> tuple[TimeSignals, Any]:
    """Return three damped modes under white forces, and their frequencies."""
    import scipy.signal

    rng, rate = np.random.default_rng(5), 64.0
    hz, ratio = np.array([4.0, 9.5, 17.0]), np.array([0.01, 0.008, 0.012])
    shapes = np.array([[1.0, 1.0, 1.0], [0.5, -0.7, -1.0], [0.2, -0.8, 0.9], [-0.9, 0.4, -0.5]])
    values = 0.02 * rng.standard_normal((int(seconds * rate), 4))
    for k, f in enumerate(hz):
        z = np.exp(2.0 * np.pi * f * (-ratio[k] + 1j) / rate)
        poly = [1.0, -2.0 * z.real, abs(z) ** 2]
        q = scipy.signal.lfilter([0.0, 0.1], poly, rng.standard_normal(len(values)))
        values += np.outer(q, shapes[:, k])
    return TimeSignals(sensors(4), rate, values), (hz, shapes)


def test_modes_of_motions_without_a_force(capfd: pytest.CaptureFixture[str]) -> None:
    signals, (hz, shapes) = motions()
    found = identify(signals, band=(1.0, 30.0), order=20)
    assert found.frequencies == pytest.approx(hz, rel=0.01)
    assert (np.abs(found.frequencies - hz) < 4.0 * found.frequency_std).all()
    assert np.diag(femubench.modal.mac(shapes, found.shapes.real)) == pytest.approx(1.0, abs=0.02)
    assert found.damping == pytest.approx([0.01, 0.008, 0.012], rel=0.5)
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""
    assert "pyOMA-2" in identification_html(found)


def test_a_missing_library_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femubench.core.errors.find_spec", lambda name: None)
    with pytest.raises(
        InputError, match=r"needs pyoma2 \(expected pip install 'femubench\[identify"
    ):
        identify(motions(40.0)[0])


def as_csv(file: Path, measured: FrequencyResponses) -> Path:
    pairs = [
        (o, i) for o in range(measured.values.shape[1]) for i in range(measured.values.shape[2])
    ]
    names = (measured.responses.labels, measured.references.labels)
    lines = [",".join(["frequency", *(f"{names[0][o]}/{names[1][i]}" for o, i in pairs)])]
    for hz, values in zip(measured.frequencies, measured.values, strict=True):
        cells = (values[o, i] for o, i in pairs)
        lines.append(
            ",".join([repr(float(hz)), *(f"{v.real!r}{v.imag:+}j" for v in map(complex, cells))])
        )
    file.write_text("\n".join(lines), encoding="utf-8")
    return file


def as_arrays(file: Path, measured: FrequencyResponses) -> Path:
    held = {
        "frequencies": measured.frequencies,
        "values": measured.values,
        "responses": np.array(measured.responses.labels),
        "references": np.array(measured.references.labels),
        "quantity": np.array(["accelerance"]),
    }
    np.savez(file, **held)
    return file


@pytest.mark.parametrize(
    ("name", "write"), [("a.uff", write_universal), ("a.csv", as_csv), ("a.npz", as_arrays)]
)
def test_files_hold_the_same(
    tmp_path: Path, small: Any, name: str, write: Callable[[Path, FrequencyResponses], Path]
) -> None:
    from femubench.core.case.response_files import read_responses
    from femubench.core.plugin.loader import load_plugins

    part = small.measured.within(20.0, 40.0)
    read = read_responses(write(tmp_path / name, part), tuple(load_plugins().readers.values()))
    assert isinstance(read, FrequencyResponses)
    assert read.quantity == "accelerance"
    assert read.responses.labels == part.responses.labels
    assert read.references.labels == part.references.labels
    assert read.frequencies == pytest.approx(part.frequencies)
    assert np.abs(read.values - part.values).max() < 1e-4 * np.abs(part.values).max()
    if name == "a.uff":
        assert read.responses.xyz == pytest.approx(part.responses.xyz, abs=1e-6)


@pytest.mark.slow(5)
def test_the_command_writes_tables_that_a_case_reads(tmp_path: Path, small: Any) -> None:
    file = write_universal(tmp_path / "test.uff", small.measured)
    done = call_bench("identify", file, "--output", tmp_path / "out")
    assert "6 modes from 20 to 200 Hz" in done.output
    assert (tmp_path / "out" / "sensors.csv").read_text(encoding="utf-8").count("\n") == 14
    table = (tmp_path / "out" / "modes.csv").read_text(encoding="utf-8").splitlines()
    assert [float(line.split(",")[1]) for line in table[1:]] == pytest.approx(
        small.frequencies, rel=5e-4
    )
    page = (tmp_path / "out" / "identification.html").read_text(encoding="utf-8")
    assert "test.uff" in page
    assert "Mode shapes" in page
    assert page.count("<script") == 1  # that saves its figures
    assert "Save this figure" in page
    again = call_bench("identify", file, "--output", tmp_path / "out", code=2)
    assert "is not empty" in again.output


@pytest.mark.slow(3)
def test_responses_of_one_test_lie_in_several_files(tmp_path: Path, small: Any) -> None:
    """One drive a file, sensors that rove, both at once: the responses are those of one file."""
    whole, cuts = small.measured, [range(5), range(5, 13)]
    drives = [part(whole, range(13), i) for i in (0, 1)]
    both = [part(whole, rows, i) for rows in cuts for i in (0, 1)]
    for held in (drives, [whole.take(rows) for rows in cuts], both):
        joined = join_files([tmp_path] * len(held), held)
        assert isinstance(joined, FrequencyResponses)
        np.testing.assert_array_equal(joined.values, whole.values)
        assert joined.responses.labels == whole.responses.labels
    files = [write_universal(tmp_path / f"{k}.uff", one) for k, one in enumerate(both)]
    done = call_bench("identify", files[0], files[-1], code=2)
    assert "no force links the response at 6:z with the first one" in done.output
    call_bench("identify", *files, "--output", tmp_path / "found")
    table = (tmp_path / "found" / "modes.csv").read_text(encoding="utf-8").splitlines()
    hertz = [float(line.split(",")[1]) for line in table[1:]]
    assert hertz == pytest.approx(small.frequencies, rel=5e-4)


def part(measured: FrequencyResponses, rows: range, force: int) -> FrequencyResponses:
    """Return some responses to one force."""
    one = measured.take(rows)
    values = one.values[:, :, force : force + 1]
    return replace(one, values=values, references=measured.references.take([force]))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, "b.uff: the response at 1:z to 1:z is in a file before it, too"),
        ({"frequencies": 1.01}, "b.uff: lines: 361, 20.2 to 202 Hz (expected 361, 20 to 200 Hz"),
        ({"quantity": "mobility"}, "b.uff: mobility (expected accelerance, as"),
        ({"responses": replace(sensors(13), xyz=np.ones((13, 3)))}, "'1:z' has two places"),
    ],
    ids=["pair", "lines", "quantity", "place"],
)
def test_files_that_do_not_belong_together(
    tmp_path: Path, small: Any, change: Any, says: str
) -> None:
    if "frequencies" in change:
        change = {"frequencies": change["frequencies"] * small.measured.frequencies}
    files = [
        write_universal(tmp_path / f"{name}.uff", replace(small.measured, **more))
        for name, more in (("a", {}), ("b", change))
    ]
    done = call_bench("identify", *files, code=2)
    assert says in done.output.replace(f"{tmp_path}/", "")
    assert done.output.count("\n") == 1


def test_forces_without_labels_need_none_where_sensors_are_listed(
    tmp_path: Path, small: Any
) -> None:
    import scipy.io

    held = {"freq": small.measured.frequencies, "FRF": small.measured.values}
    scipy.io.savemat(tmp_path / "test.mat", held)
    known, readers = sensors(13), tuple(load_plugins().readers.values())
    read = read_responses(tmp_path / "test.mat", readers, known)
    assert isinstance(read, FrequencyResponses)
    assert read.responses.labels == known.labels
    found = locate_sensors(read, known, tmp_path / "places.csv")
    assert np.isnan(found.references.xyz).all()
    with pytest.raises(InputError, match="13 channels without labels"):
        read_responses(tmp_path / "test.mat", readers, known.take(range(12)))


def test_drawings_refuse_what_they_cannot_draw(found: Identification) -> None:
    assert stabilisation(found).get_xlabel() == "frequency, Hz"
    assert synthesis(found, (2, 1)).get_ylabel() == "accelerance, dB re 1 m/(s² N)"
    assert len(mode_shape(found, 1).collections) == 1
    with pytest.raises(InputError, match="no mode 99"):
        mode_shape(found, 99)
    with pytest.raises(InputError, match="no channel"):
        synthesis(found, (13, 0))


def refusal(file: Path) -> str:
    """Return the one line that `bench identify` ends with."""
    done = call_bench("identify", file, code=2)
    assert done.output.count("\n") == 1
    return done.output


def with_a_hole(measured: FrequencyResponses) -> FrequencyResponses:
    values = measured.values.copy()
    values[9, 2, 1] = np.nan
    return replace(measured, values=values)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (with_a_hole, "not finite"),
        (lambda m: replace(m, values=0.0 * m.values), "all responses are zero"),
        (lambda m: m.within(30.0, 31.0), "3 lines above 0 Hz"),
    ],
    ids=["nan", "zero", "short"],
)  # fmt: skip
def test_bad_responses_are_one_line(tmp_path: Path, small: Any, change: Any, says: str) -> None:
    file = as_arrays(tmp_path / "bad.npz", change(small.measured))
    assert says in refusal(file)


def test_one_response_alone_is_identified_or_refused(small: Any) -> None:
    one = replace(
        small.measured,
        responses=sensors(13, slice(3, 4)),
        references=sensors(13, slice(0, 1)),
        values=small.measured.values[:, 3:4, :1],
    )
    found = identify(one)
    assert 1 <= len(found) <= 7
    nearest = np.abs(found.frequencies[:, None] / small.frequencies - 1.0).min(axis=1)
    assert (nearest < 0.01).all()


def test_universal_files_that_are_wrong(tmp_path: Path, small: Any) -> None:
    part = small.measured.within(20.0, 30.0)
    nodes = replace(part, values=part.values[:, :, :0], references=sensors(0))
    assert "no functions" in refusal(write_universal(tmp_path / "nodes.uff", nodes))
    spectra = write_universal(tmp_path / "spectra.uff", part, func_type=2)
    assert "only type 2" in refusal(spectra)
    scalar = write_universal(tmp_path / "scalar.uff", part, rsp_dir=0)
    assert "direction 0" in refusal(scalar)
    pressure = write_universal(tmp_path / "pressure.uff", part, orddenom_spec_data_type=15)
    assert "not per force" in refusal(pressure)
    whole = write_universal(tmp_path / "whole.uff", part).read_bytes()
    for share in (0.3, 0.7, 0.99):
        cut = tmp_path / "cut.uff"
        cut.write_bytes(whole[: int(share * len(whole))])
        assert "cut.uff" in refusal(cut)
    first = write_universal(tmp_path / "a.uff", part).read_bytes()
    other = write_universal(tmp_path / "b.uff", small.measured.within(20.0, 40.0)).read_bytes()
    mixed = tmp_path / "mixed.uff"
    mixed.write_bytes(first + other)
    assert "another axis" in refusal(mixed)


def test_tables_that_are_wrong(tmp_path: Path) -> None:
    file = tmp_path / "bad.csv"
    for text, says in (
        ("hz,1:z/1:z\n1,2\n", "frequency or time"),
        ("frequency,1:z\n1,2\n", "which force"),
        ("frequency,1/2\n1,2\n", "says no direction"),
        ("frequency,1:z/1:z\n2,1j\n1,1j\n", "do not rise"),
        ("time,1:z\n0,1\n1,1\n3,1\n", "uneven steps"),
    ):
        file.write_text(text, encoding="utf-8")
        assert says in refusal(file)
    assert "unknown kind of file" in refusal(file.rename(tmp_path / "a.xyz"))


def test_what_is_imaginary_of_a_shape_widens_its_deviations_in_a_case(
    found: Identification,
) -> None:
    twisted = found.shapes + 0.1j * np.linspace(-1.0, 1.0, len(found.shapes))[:, None]
    wide = replace(found, shapes=twisted).measurement.shape_std
    rms = 0.1 * np.sqrt(np.mean(np.linspace(-1.0, 1.0, len(found.shapes)) ** 2))
    assert wide == pytest.approx(rms, rel=0.2)
    kept, own = (
        np.linalg.norm(std, axis=0) for std in (found.measurement.shape_std, found.shape_std)
    )
    assert (kept < 1.5 * own).all()
