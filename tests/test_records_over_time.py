"""Forces and motions over time: modes and deviations against a simulator of our own tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

import femubench
from femubench import Identification, InputError, Sensors, identify
from femubench.core.identify.averaging import average_records, guess_excitation
from femubench.modal import TimeSignals, mac
from tests import struck_structures as struck
from tests.command import call_bench
from tests.hammer_problems import RATE, Structure, frame, hit


def record(structure: Structure, point: int, seed: int, some: Any = slice(None), **how: Any) -> Any:
    force, motion = hit(structure, point, seed, **how)
    labels, xyz = np.array(structure.labels), structure.xyz

    def at(rows: Any) -> Sensors:
        names = tuple(labels[rows].tolist())
        return Sensors(names, xyz[rows], (structure.direction,) * len(names))

    return TimeSignals(at(some), RATE, motion[:, some], at([point]), force[:, None])


def check(found: Identification, structure: Structure) -> None:
    """Compare with the truth."""
    hertz, shapes = structure.modes()
    rows = [structure.labels.index(label) for label in found.sensors.labels]
    own = [int(np.abs(hertz - hz).argmin()) for hz in found.frequencies]
    assert found.frequencies == pytest.approx(hertz[own], rel=2e-4)
    assert (np.abs(found.frequencies - hertz[own]) < 5.0 * found.frequency_std).all()
    if len(rows) > 1:
        assert np.diag(mac(shapes[rows][:, own], found.shapes.real)).min() > 0.999
    assert found.damping == pytest.approx(structure.ratio, rel=0.06)


@pytest.mark.slow(16)
def test_a_roving_hammer_a_roving_sensor_and_hits_in_one_record() -> None:
    structure = frame()
    whole = record(structure, 0, 1)
    found = identify(whole)
    assert "3 hits" in found.said
    assert len(found) == 3
    check(found, structure)
    hammer = TimeSignals.joined([record(structure, p, p, [3]) for p in range(4)])
    check(identify(hammer), structure)
    assert identify(hammer).sensors.labels == tuple(structure.labels)
    sensor = TimeSignals.joined([record(structure, 0, p, [p]) for p in range(4)])
    check(identify(sensor, estimator="h2"), structure)


@pytest.mark.slow(5)
def test_the_window_is_taken_off_the_damping_and_hits_that_meet_no_rest_are_said() -> None:
    responses, said = average_records(record(frame(), 0, 2, hits=4, gap=1.5), "hits")
    assert responses.decay > 1.0  # larger than that of the first mode, 0.006 x 193 1/s
    assert "1/s of decay by the exponential window" in said
    assert "3 of a structure that was not at rest" in said
    found = identify(responses)
    assert found.damping == pytest.approx(0.006, rel=0.15)
    assert found.frequencies == pytest.approx(frame().modes()[0][1:], rel=1e-3)


@pytest.mark.slow(12)
def test_free_decays_need_no_force() -> None:
    structure = frame()
    parts = [record(structure, p, p) for p in (0, 2)]
    nothing: dict[str, Any] = {"forces": Sensors((), np.zeros((0, 3)), ())}
    nothing["force_values"] = np.zeros((0, 0))
    motions = TimeSignals.joined([replace(part, **nothing) for part in parts])
    assert guess_excitation(motions) == "decay"
    found = identify(motions)
    assert len(found) == 3
    check(found, structure)


@pytest.mark.slow(8)
@pytest.mark.parametrize("name", ["a.npz", "a.csv"])
def test_what_moves_between_marks_of_rest_is_no_decay(tmp_path: Path, name: str) -> None:
    whole = record(frame(), 0, 3)
    time = np.arange(len(whole.values)) / RATE
    rest = np.sin(2.0 * np.pi * (time - 0.1) / 4.0) < -0.2  # hits are 0.2 s after every fourth one
    knock = np.exp(-np.maximum(time % 4.0 - 2.6, 0.0) / 0.02) * rest
    motion = whole.values + 3.0 * np.abs(whole.values).max() * knock[:, None]
    if name == "a.npz":
        more = {"responses": np.array(whole.sensors.labels), "at_rest": rest}
        np.savez(tmp_path / name, fs=RATE, acc=motion, **more)
    else:
        head = ",".join(["time", *whole.sensors.labels, "Rest"])
        rows = np.column_stack([time, motion, rest])
        np.savetxt(tmp_path / name, rows, "%.9g", ",", header=head, comments="")
    found = identify(tmp_path / name)
    assert "3 free motions" in found.said
    check(found, frame())
    np.savez(tmp_path / "b.npz", fs=RATE, acc=motion, rest=0.0 * rest)
    with pytest.raises(InputError, match=r"b\.npz.*rest: no rests between motions"):
        identify(tmp_path / "b.npz")


@pytest.mark.slow(6)
def test_a_random_force_is_averaged_under_hanns_window() -> None:
    import scipy.signal

    structure, rng = frame(), np.random.default_rng(3)
    force = np.zeros((int(60.0 * RATE) * 8, 4))
    filtered = scipy.signal.butter(2, 200.0 / (4.0 * RATE))
    force[:, 0] = scipy.signal.lfilter(*filtered, rng.standard_normal(len(force)))
    every = np.column_stack([force[:, 0], structure.respond(force)])
    every = scipy.signal.decimate(every, 8, axis=0, ftype="fir")
    every += 0.01 * every.std(axis=0) * rng.standard_normal(every.shape)
    whole = replace(record(structure, 0, 1), values=every[:, 1:], force_values=every[:, :1])
    assert guess_excitation(whole) == "random"
    check(identify(whole), structure)


@pytest.mark.slow(10)
def test_stated_deviations_are_those_of_repeats() -> None:
    errors = []
    for seed in range(8):
        found = identify(record(frame(), 0, seed, hits=1, gap=3.0), band=(10.0, 120.0))
        errors.append((found.frequencies - frame().modes()[0][1:]) / found.frequency_std)
    assert 0.55 < np.sqrt(np.mean(np.square(errors))) < 1.45


def as_lvm(file: Path, time: Any, force: Any, motion: Any, structure: Structure) -> Path:
    """Write as LabVIEW does, with tabs and decimal commas."""
    names = ["X_Value", "3:x", *structure.labels, "Comment"]
    units, step = ["N", *["m/s^2"] * 4], f"Delta_X\t{1 / RATE}".replace(".", ",")
    head = [
        "LabVIEW Measurement\t", "Decimal_Separator\t,", "X_Columns\tOne", "***End_of_Header***\t",
        "", "Channels\t5", "Y_Unit_Label\t" + "\t".join(units), step,
        "***End_of_Header***\t", "\t".join(names),
    ]  # fmt: skip
    table = np.column_stack([time, force, motion])
    rows = ["\t".join(f"{v:.7g}".replace(".", ",") for v in row) for row in table]
    file.write_text("\n".join([*head, *rows]), encoding="utf-8")
    return file


def as_table(file: Path, time: Any, force: Any, motion: Any, structure: Structure) -> Path:
    """Write semicolons, decimal commas and units, as a spreadsheet does."""
    head = ";".join(
        ["Time (s)", "force 3:x [kN]", *(f"{label} [m/s2]" for label in structure.labels)]
    )
    table = np.column_stack([time, 1e-3 * force, motion])
    rows = [";".join(f"{v:.9g}".replace(".", ",") for v in row) for row in table]
    file.write_text("\n".join([head, *rows]), encoding="utf-8")
    return file


def as_struct(file: Path, time: Any, force: Any, motion: Any, structure: Structure) -> Path:
    labels = np.array(structure.labels, dtype=object)
    test = {"fs": RATE, "hammer": force, "a": motion, "responses": labels, "points": "3:x"}
    scipy.io.savemat(file, {"test": test})
    return file


def as_universal(file: Path, time: Any, force: Any, motion: Any, structure: Structure) -> Path:
    import pyuff

    columns = [(3, 13, force), *((k + 1, 12, motion[:, k]) for k in range(4))]
    sets = [
        {
            "type": 58, "func_type": 1, "rsp_node": node, "rsp_dir": 1, "ref_node": 0, "ref_dir": 0,
            "data": values, "x": time, "id1": "T", "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
            "abscissa_spacing": 1, "abscissa_spec_data_type": 17,
            "ordinate_spec_data_type": kind, "orddenom_spec_data_type": 0,
        }
        for node, kind, values in columns
    ]  # fmt: skip
    pyuff.UFF(str(file)).write_sets(sets * 2, mode="overwrite")  # the same record twice
    return file


@pytest.mark.slow(5)
@pytest.mark.parametrize(
    ("name", "write"),
    [("a.lvm", as_lvm), ("a.csv", as_table), ("a.mat", as_struct), ("a.uff", as_universal)],
)
def test_files_hold_the_same(tmp_path: Path, name: str, write: Any) -> None:
    from femubench.core.case.response_files import read_responses
    from femubench.core.plugin.loader import load_plugins

    structure = frame()
    force, motion = hit(structure, 2, 1, hits=1, gap=1.0)
    time = np.arange(len(force)) / RATE
    file = write(tmp_path / name, time, force, motion, structure)
    read = read_responses(file, tuple(load_plugins().readers.values()))
    assert isinstance(read, TimeSignals)
    assert read.rate == pytest.approx(RATE, rel=1e-4)
    assert (read.sensors.labels, read.forces.labels) == (tuple(structure.labels), ("3:x",))
    assert len(read.records) == (2 if name == "a.uff" else 1)
    whole = read.records[-1]
    assert np.abs(read.values[whole] - motion).max() < 1e-4 * np.abs(motion).max()
    assert np.abs(read.force_values[whole][:, 0] - force).max() < 1e-4 * force.max()


@pytest.mark.parametrize(
    ("held", "words", "says"),
    [
        ({"foo": np.zeros((9, 3)), "bar": 1.0}, "", "--variables motion=NAME,force=NAME"),
        ({"t": np.arange(9.0), "acc": np.zeros((8, 2))}, "", "motion=NAME says another"),
        ({"t": np.arange(9.0), "acc": np.ones((9, 2))}, "", "or --sensors, row by row"),
        ({"t": np.arange(9.0), "zz": np.ones((9, 2))}, "--variables motion=z", "no variable 'z'"),
        ({"t": np.arange(9.0), "zz": np.ones((9, 2))}, "--variables mass=zz", "no key 'mass'"),
        ({"t": np.arange(9.0), "F": np.arange(9.0), "acc": np.ones((9, 1)), "sensors": "1:z"}, "",
         "128 samples or more"),
        ({"t": np.ones(9), "acc": np.ones((9, 2))}, "", "even steps in s"),
    ],
)  # fmt: skip
def test_variables_that_cannot_be_guessed_are_one_line(
    tmp_path: Path, held: Any, words: str, says: str
) -> None:
    scipy.io.savemat(tmp_path / "a.mat", held)
    done = call_bench("identify", tmp_path / "a.mat", *words.split(), code=2)
    assert says in done.output
    assert done.output.count("\n") == 1


@pytest.mark.slow(8)
def test_what_does_not_stand_out_of_the_noise_around_it_is_no_mode(tmp_path: Path) -> None:
    """A hit before the structure is at rest leaves more next to a resonance than noise is."""
    rig = struck.frame((0, 0.44, 0)).write(tmp_path / "a.mat", (0, 2), 1063)
    found = identify(tmp_path / "a.mat")
    assert "not at rest" in found.said
    assert found.frequencies == pytest.approx(rig.modes()[0][1:], rel=3e-4)


RIGS: dict[str, tuple[Any, dict[str, Any], Any, int]] = {
    "frame": (struck.frame, {}, (0, 2), 1080),
    "strip": (struck.strip, {}, (4, 6), 1080),
    "roller": (struck.strip, {"roller": 0.497}, (2, 6), 1090),  # drawn 3 mm off
}
STATES: dict[str, tuple[str, dict[str, Any], list[str]]] = {
    "22 % of a storey": ("frame", {"loss": (0.22, 0, 0)}, ["member-stiffness at group:storey1"]),
    "44 % of another": ("frame", {"loss": (0, 0.44, 0)}, ["member-stiffness at group:storey2"]),
    "1.2 kg on a floor": ("frame", {"added": (1.2, 0, 0, 0)}, ["added-mass at 1"]),
    "44 % of a quarter": ("strip", {"loss": (0, 0.44, 0, 0)}, ["member-stiffness at section:2"]),
    "1.2 kg on the tip": ("strip", {"tip": 1.2}, ["mass-offset at 17"]),
    "93 mm": ("roller", {"roller": 0.59}, ["support-position at support:11"]),
    "20 mm back": ("roller", {"roller": 0.477}, ["support-position at support:11"]),
    "nothing": ("roller", {}, []),
}


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("state", "force"), [*((s, True) for s in STATES), *((s, False) for s in list(STATES)[:3])]
)
def test_from_records_to_the_cause_in_four_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, state: str, force: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    kind, change, causes = STATES[state]
    make, before, points, seed = RIGS[kind]
    make(**before).write(Path("before.mat"), points, seed, force=force)
    rig = make(**before | change).write(Path("after.mat"), points, seed + 3, force=force)
    xyz = np.outer(0.3 * np.arange(4), [0, 0, 1])
    if kind == "frame":
        struck.draw_frame(Path("model.mat"))
    else:
        struck.draw_strip(Path("model.bdf"), 0.5 if before else None)
        xyz = np.outer(struck.STATIONS, [1, 0, 0])
    rows = zip(rig.labels, xyz.tolist(), strict=True)
    places = [f"{label},{x},{y},{z},{rig.direction}\n" for label, (x, y, z) in rows]
    Path("places.csv").write_text("".join(["label,x,y,z,direction\n", *places]))
    (model,) = Path().glob("model.*")
    for words in (
        "identify before.mat -o before",
        "identify after.mat -o after",
        f"init case --model {model} --modes after --reference before --sensors places.csv",
    ):
        call_bench(*words.split())
    said = femubench.diagnose("case")
    assert said.verdict == ("named" if causes else "none")
    assert [f"{cause.effect} at {cause.place}" for cause in said.causes] == causes


@pytest.mark.nightly
def test_a_hammer_that_roves_along_a_strip_gives_its_modes_and_no_others() -> None:
    xyz = np.outer(struck.STATIONS, [1, 0, 0])
    for rig in (struck.strip(), struck.strip((0, 0.44, 0, 0)), struck.strip(tip=1.2)):
        parts = []
        for p in range(len(xyz)):
            force, motion = rig.record(p, p, hits=2)
            one, other = (Sensors((rig.labels[k],), xyz[[k]], ("z",)) for k in (2, p))
            parts.append(TimeSignals(one, rig.rate, motion[:, [2]], other, force[:, None]))
        found = identify(TimeSignals.joined(parts), band=(2.0, 750.0))
        hertz, shapes = rig.modes()
        own = hertz < 750.0
        assert found.frequencies == pytest.approx(hertz[own], rel=3e-4)
        assert np.diag(mac((rig.rows @ shapes)[:, own], found.shapes.real)).min() > 0.99
