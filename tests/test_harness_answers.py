"""What a worker hands back: every kind of model gets through, nothing else does."""

from __future__ import annotations

import pickle
import random
import re
import resource
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import harness_toys as toys
import numpy as np
import pytest
import scipy.sparse as sp
from msgspec import msgpack
from test_case_writing import CASES, assert_same_frame, case_at, frame_of, full_frames

from femubench.core.fem import frame as frames
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.parameters import Property
from femubench.core.plugin.loader import load_plugins
from femubench.core.run.answers import AnswerError, pack_outcome, read_report, unpack_outcome
from femubench.core.run.jobs import JobOutcome
from femubench.core.run.judging import judge_outcome
from femubench.core.run.plain_frame import frame_from_plain, frame_to_plain
from femubench.core.schema.records import result_to_json
from femubench.core.score.scoring import reference_of

CASE = toys.tiny_case()
NOMINAL = CASE.model
HEAD = {
    **{"reason": "", "traceback": "", "seconds": 0.5, "evaluations": 3, "discrepancy_std": None},
    **{"parameter_count": 1, "parameters": [], "history": [{"r": 0.1}], "diagnostics": {}},
    **{"model": {"mass": None, "stiffness": None}, "samples": [], "arrays": []},
}


def sent(head: Any, rest: bytes = b"", status: bytes = b"o") -> bytes:
    text = head if isinstance(head, bytes) else msgpack.encode(head)
    if isinstance(head, dict):
        model = {name: head[name] for name in ("model", "samples", "structure") if name in head}
        answer = {"report": {"status": "ok", **head}, "model": model or None}
        text = msgpack.encode([answer, head.get("arrays", [])])
    return status + len(text).to_bytes(8, "big") + text + rest


def through(model: Model, nominal: Model = NOMINAL, *samples: Model) -> JobOutcome:
    outcome = JobOutcome("ok", model=model, samples=samples)
    return unpack_outcome(pack_outcome(outcome, nominal), nominal)


def same(first: Any, second: Any) -> bool:
    """Tell whether two sparse arrays have the same bytes."""
    parts = ("data", "indices", "indptr")
    return first.format == second.format and all(
        np.array_equal(getattr(first, part), getattr(second, part)) for part in parts
    )


def check_same(found: Model | None, wanted: Model) -> None:
    assert found is not None
    assert same(found.mass, wanted.mass)
    assert same(found.stiffness, wanted.stiffness)
    assert found.dofs.direction == wanted.dofs.direction
    assert np.array_equal(found.dofs.node, wanted.dofs.node)
    for name in ("mass_change", "stiffness_change"):
        own, other = getattr(found, name), getattr(wanted, name)
        assert (own is None) == (other is None)
        if own is not None:
            for part in ("basis", "core"):
                a, b = getattr(own, part), getattr(other, part)
                assert np.array_equal(a, b)
                assert a.flags.f_contiguous == b.flags.f_contiguous


def test_models_with_every_effect_get_through() -> None:
    """Effects use all that a frame can hold; what is attached afterwards is attached alike."""
    seen, mass = 0, frames.PointMass(frames.Place(member="m", s=0.3), 0.5)
    mass = replace(mass, at=replace(mass.at, member=NOMINAL.frame_structure.frame.members[0].name))
    for effect in load_plugins().effects.values():
        for place in list(effect.places(NOMINAL))[:2]:
            values = [0.5 * (p.lower + p.upper) for p in effect.parameters(NOMINAL, place)]
            values = [value if np.isfinite(value) else 1.0 for value in values]
            model = effect.extend(NOMINAL, place, values)
            found = through(model).model
            check_same(found, model)
            assert found is not None
            sensors = CASE.measurement.sensors
            assert same(sp.csr_array(found.observe(sensors)), sp.csr_array(model.observe(sensors)))
            check_same(found.attach((mass,), ()), model.attach((mass,), ()))
            seen += 1
    assert seen > 20


def test_models_from_files_get_through() -> None:
    from femubench.core.conformance.problems import PROBLEMS, problem

    plain = [found for found in map(problem, PROBLEMS) if found.model.structure is None]
    assert plain
    for case in plain:
        rank = LowRank(np.asfortranarray(np.ones((case.model.size, 2))), np.eye(2))
        wanted = replace(case.model, stiffness=1.1 * case.model.stiffness, mass_change=rank)
        found = through(wanted, case.model).model
        check_same(found, wanted)
        assert found is not None
        assert found.geometry is case.model.geometry
        assert found.groups is case.model.groups


def test_samples_get_through() -> None:
    more = replace(NOMINAL, stiffness=NOMINAL.stiffness * 1.01)
    samples = [replace(more, mass=NOMINAL.mass * (1.0 + k / 8.0)) for k in range(3)]
    outcome = through(more, NOMINAL, *samples)
    for found, wanted in zip(outcome.samples, samples, strict=True):
        check_same(found, wanted)


def test_what_is_attached_by_a_strategy_gets_through() -> None:
    """Its nodes come last in the strategy's process, and in the order of the frame here."""
    at = frames.Place(member=NOMINAL.frame_structure.frame.members[0].name, s=0.3)
    model = NOMINAL.attach((frames.PointMass(at, 0.5),), ())
    assert model.size > NOMINAL.size
    found = through(model).model
    assert found is not None
    known = reference_of(CASE)
    who = ("s", 0, "drawn")
    one, other = (
        judge_outcome(CASE, known, who, JobOutcome("ok", model=each))
        for each in (model, found)  # type: ignore[arg-type]
    )
    assert one.status == other.status == "ok"
    for a, b in zip(one.blocks["used"].modes, other.blocks["used"].modes, strict=True):
        assert a.predicted_hz == pytest.approx(b.predicted_hz, rel=1e-9)


def test_figures_get_through_to_the_last_bit() -> None:
    outcome = JobOutcome(
        "failed",
        "why",
        "Traceback",
        seconds=0.1 + 0.2,
        evaluations=None,
        parameter_count=4,
        parameters=({"name": "E", "before": 1.0, "after": 1 / 3, "unit": "", "std": None},),
        history=({"residual": 1e-300},),
        diagnostics={"nan": float("inf")},
    )
    answer = pack_outcome(outcome)
    assert read_report(answer) == unpack_outcome(answer, NOMINAL) == outcome


def test_every_field_of_a_frame_gets_through() -> None:
    scenarios = Path(__file__).parents[1] / "scenarios"
    folders = (scenarios / "frame-beam", CASES / "in-plane", CASES / "3d")
    for _, case, frame in full_frames(*map(case_at, folders)):
        nominal = frame_of(case)
        text = msgpack.encode(frame_to_plain(frame, nominal))
        found = frame_from_plain(msgpack.decode(text), nominal, 10_000)
        # Its sets, its damping and whether it hangs free are taken from the nominal one.
        kept = {name: getattr(nominal, name) for name in ("sets", "damping", "free")}
        assert_same_frame(found, replace(frame, **kept))


# --- lies ---------------------------------------------------------------------------------------


class _Build:
    """A pickle that sets an attribute of a class, and one that imports a third party's module."""

    attribute = b"\x80\x04cfemubench.core.fem.model\nModel\nN}X\x07\x00\x00\x00plantedK\x01s\x86b."
    module = b"\x80\x04cnumpy_evil\ncsc_array\n."


@pytest.mark.parametrize("code", [_Build.attribute, _Build.module])
@pytest.mark.parametrize("head", [HEAD, {**HEAD, "status": "ok"}])
def test_a_pickle_does_nothing(
    head: dict[str, Any], code: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "numpy_evil.py").write_text("csc_array = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for data in (sent(head, code), sent(head, code)[1:], b"o" + code, code):
        with pytest.raises(AnswerError):
            unpack_outcome(data, NOMINAL)
    assert not hasattr(Model, "planted")
    assert "numpy_evil" not in sys.modules


def test_the_pickles_of_the_test_would_do_harm() -> None:
    try:
        pickle.loads(_Build.attribute)
        assert Model.planted == 1  # type: ignore[attr-defined]
    finally:
        del Model.planted  # type: ignore[attr-defined]
    with pytest.raises(ModuleNotFoundError):
        pickle.loads(_Build.module)


LONG_PARAMETER = {"name": "n" * 500, "before": 1.0, "after": 1.0, "unit": "", "std": None}
PAIR = [["<f8", [1], "C"]]
DEEP = b"\x81\xa9structure\x81\xa6fields\x81\xa1x" + b"\x91" * 100_000
BARE = {"properties": [0], "springs": 0, "parameters": [], "changes": [0, 0]}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "does not say how the job ended"),
        (b"x" + sent(HEAD)[1:], "does not say how the job ended"),
        (b"o\xff" * 20, "a head of"),
        (sent({}), "cannot be read: there is no model"),
        (sent([]), r"cannot be read: the head: 0, expected a list of length 2"),
        (sent({**HEAD, "seconds": float("inf")}), "report.seconds: out of bounds"),
        # A result without a time is one that no report of the run reads.
        (sent({**HEAD, "seconds": float("nan")}, status=b"f"), "report.seconds: out of bounds"),
        (sent({**HEAD, "evaluations": -1}), "evaluations: out of bounds, expected a whole"),
        (sent({**HEAD, "evaluations": True}), "evaluations: true or false, expected a whole"),
        (sent({**HEAD, "parameters": [LONG_PARAMETER] * 10_000}), "bytes of figures, allowed"),
        (sent({**HEAD, "parameters": [{"name": "E"}]}), r"parameters\[0\].before: missing"),
        (sent({**HEAD, "samples": [HEAD["model"]] * 65}), "samples: .* a list of length <= 64"),
        (sent({**HEAD, "history": [1]}), r"history\[0\]: a whole number, expected a table"),
        (sent({**HEAD, "diagnostics": {"x": None}}), "diagnostics.*nothing, expected a number"),
        (sent({**HEAD, "reason": 3}), "reason: a whole number, expected a text"),
        (sent({**HEAD, "history": [{str(i): 0.0 for i in range(200_001)}]}), "length <= 200000"),
        (sent(b"\x91" * 100_000), "the head"),
        (sent(b"\xdd\xff\xff\xff\xff"), "the head"),
        (sent(b"\x92\x82\xa6report\x81\xa6status\xa2ok\xa5model" + DEEP), "recursion depth"),
        (sent(b"\xc6" + bytes(33 * 2**20)), "a head of 34603009 bytes"),
        (sent({**HEAD, "arrays": [["<f8", [10**9], "C"]]}), "arrays of 8000000000 bytes in 0"),
        (sent({**HEAD, "arrays": [["|O", [1], "C"]]}, b"x" * 8), "value '|O'"),
        (sent({**HEAD, "arrays": [["<f8", [-1], "C"]]}), "out of bounds, expected a whole number"),
        (sent({**HEAD, "arrays": PAIR}, b"x" * 9), "arrays of 8 bytes in 9"),
        (sent(HEAD, pickle.dumps(3)), "arrays of 0 bytes"),
        (sent({**HEAD, "model": 3}), "model.model: a whole number, expected a table"),
        (sent({**HEAD, "model": {**HEAD["model"], "mass": 0}}), "model.mass: a whole number"),  # type: ignore[dict-item]
        (sent({**HEAD, "structure": {}}), "structure.properties: missing"),
        (sent({**HEAD, "structure": BARE}), "there is no array 0"),
    ],
)  # fmt: skip
def test_what_is_no_outcome_is_refused_in_one_line(data: bytes, says: str) -> None:
    with pytest.raises(AnswerError, match=says) as caught:
        unpack_outcome(data, NOMINAL)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 3000


@pytest.mark.parametrize("status", [b"o", b"f", b"n"])
def test_no_word_of_a_strategy_is_obeyed_by_a_terminal(status: bytes) -> None:
    evil = "\x1b[2J\x07 and\nmore \u202e"
    estimate = {**LONG_PARAMETER, "name": evil, "unit": evil}
    said = {"reason": evil, "traceback": evil, "parameters": [estimate], "diagnostics": {evil: 1.0}}
    found = unpack_outcome(sent({**HEAD, **said, "history": [{evil: 1.0}]}, status=status), NOMINAL)
    (parameter,), (figures,) = found.parameters, found.history
    texts = [found.reason, parameter["name"], parameter["unit"], *figures, *found.diagnostics]
    assert texts == ["\\x1b[2J\\x07 and more \\u202e"] * 5
    assert found.traceback == "\\x1b[2J\\x07 and\nmore \\u202e"


def test_words_of_another_encoding_arrive_in_one_that_can_be_written() -> None:
    outcome = JobOutcome("failed", "\ud800 why", "\udfff")
    assert read_report(pack_outcome(outcome)).reason == "? why"
    found = read_report(pack_outcome(JobOutcome("failed", diagnostics={"\udfff": 1.0})))
    assert list(found.diagnostics) == ["?"]
    forged = sent({**HEAD, "reason": "???"}, status=b"f").replace(b"???", b"\xed\xa0\x80")
    # In the words of msgspec before 0.22, and from then on.
    words = "cannot be read: the head cannot be read: ('utf-8' codec|Invalid UTF-8 encoded string)"
    with pytest.raises(AnswerError, match=words):
        read_report(forged)


def forged(change: Callable[[dict[str, Any], list[Any]], None]) -> bytes:
    """Return the answer of a softer model with a joint spring in which something was changed."""
    structure = NOMINAL.frame_structure
    member = structure.frame.members[0]
    spring = frames.JointSpring(member.ends[0], member.name, {"ry": 1e4, "rx": 1e4})
    frame = replace(structure.frame, joint_springs=(spring,))
    factor = Property("E", "E", (f"{member.name}/1",))
    data = pack_outcome(
        JobOutcome("ok", model=Model.of(structure.rebuilt(frame).with_values([factor], [0.9]))),
        NOMINAL,
    )
    size = int.from_bytes(data[1:9], "big")
    (answer, tables), rest, arrays = msgpack.decode(data[9 : 9 + size]), data[9 + size :], []
    head = answer["report"] | answer["model"]
    for entries, shape, order in tables:
        count = np.dtype(entries).itemsize * int(np.prod(shape))
        arrays.append(np.frombuffer(rest[:count], entries).reshape(shape, order=order).copy())
        rest = rest[count:]
    change(head, arrays)
    head["arrays"] = [[a.dtype.str, list(a.shape), "C"] for a in arrays]
    return sent(head, b"".join(a.tobytes() for a in arrays))


def _scale(name: str) -> Callable[[dict[str, Any], list[Any]], None]:
    def change(head: dict[str, Any], arrays: list[Any]) -> None:
        found = head["structure"][name]
        arrays[found[1] if isinstance(found, list) else found] *= 1.001

    return change


def _set(*path: Any) -> Callable[[dict[str, Any], list[Any]], None]:
    *above, last, value = path

    def change(head: dict[str, Any], arrays: list[Any]) -> None:
        for name in above:
            head = head[name]
        head[last] = value

    return change


def _fill(name: str, part: int, value: float) -> Callable[[dict[str, Any], list[Any]], None]:
    def change(head: dict[str, Any], arrays: list[Any]) -> None:
        arrays[head["model"][name]["parts"][part]][:] = value

    return change


FRAME_OF = ("structure", "fields")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_scale("properties"), "EA does not follow from its frame and parameters"),
        (_scale("springs"), "springs does not follow"),
        (_scale("changes"), "does not follow from its frame and parameters"),
        (_set("structure", "changes", [0, 1]), "the changes are not"),
        (_set("structure", "parameters", 0, "quantity", "magic"), "unknown quantity"),
        (_set("structure", "parameters", 0, "places", ["nowhere/1"]), "there is no place"),
        (_set(*FRAME_OF, "joint_springs", []), "its degrees of freedom are not those"),
        (_set(*FRAME_OF, "joint_springs", 0, "arm", "long"), r"joint_springs\[0\].arm: a text"),
        (_set(*FRAME_OF, "joint_springs", 0, "member", "nobody"), "updated model: "),
        (
            _set(*FRAME_OF, "joint_springs", 0, "arm", float("nan")),
            "updated model: |does not follow",
        ),
        (_set(*FRAME_OF, "plane", "3d"), "a frame has other fields"),
        (_set(*FRAME_OF, "gravity", {}), "gravity"),
        (_set("structure", "direction", "x "), "its degrees of freedom are not those"),
        (_set("structure", "node", 10**6), "there is no array"),
        (_set("structure", "properties", []), "the properties of its elements"),
        (_set("structure", None), "has shape"),
        (_set("model", "mass", "shape", [3, 3]), "mass is not a valid sparse array"),
        (_set("model", "mass", "form", "dia"), "mass.form: unknown value 'dia'"),
        (_fill("stiffness", 1, 2**30), "stiffness is not a valid sparse array"),
        (_fill("stiffness", 2, 2**30), "stiffness is not a valid sparse array"),
        (_fill("mass", 0, np.nan), "mass has .* entries that are not finite"),
    ],
)
def test_lies_fail_in_one_line(change: Callable[..., None], says: str) -> None:
    result = verdict_on(forged(change))
    assert result["status"] == "failed"
    assert "\n" not in result["reason"]
    assert re.search(says, result["reason"]), result["reason"]


def test_the_answer_that_is_forged_would_be_good() -> None:
    assert verdict_on(forged(lambda head, arrays: None))["status"] == "ok"


def test_parts_of_an_entry_that_cancel_hide_nothing() -> None:
    """Next to entries of 1e22 every lack of symmetry is small."""
    triplet = sp.coo_array(NOMINAL.stiffness)
    column, row = triplet.col, triplet.row
    data = np.where(row > column, 0.5, 1.0) * triplet.data
    hidden = np.r_[data, 1e22, -1e22], np.r_[row, 3, 3], np.r_[column, 2, 2]
    starts = np.r_[0, np.cumsum(np.bincount(hidden[2], minlength=NOMINAL.size))]
    place = np.argsort(hidden[2], kind="stable")
    matrix = sp.csc_array((hidden[0][place], hidden[1][place], starts), shape=(NOMINAL.size,) * 2)
    forged_model = replace(NOMINAL, stiffness=matrix)
    result = verdict_on(pack_outcome(JobOutcome("ok", model=forged_model), NOMINAL))
    assert (result["status"], result["reason"][:26]) == ("failed", "stiffness is not symmetric")


def verdict_on(data: bytes) -> dict[str, Any]:
    """Return what the judge makes of an answer."""
    try:
        outcome = unpack_outcome(data, NOMINAL)
    except AnswerError as error:
        outcome = JobOutcome("failed", str(error))
    return result_to_json(judge_outcome(CASE, reference_of(CASE), ("s", 0, "drawn"), outcome))


def test_members_in_billions_of_elements_are_not_meshed() -> None:
    def many(head: dict[str, Any], arrays: list[Any]) -> None:
        frame = replace(NOMINAL.frame_structure.frame)
        members = tuple(replace(member, elements=10**9) for member in frame.members)
        plain = frame_to_plain(replace(frame, members=members), frame)
        head["structure"]["fields"]["members"] = msgpack.decode(msgpack.encode(plain))["members"]

    assert "more than the" in verdict_on(forged(many))["reason"]


@pytest.mark.parametrize("count", [800, pytest.param(20_000, marks=pytest.mark.nightly)])
def test_broken_answers_are_read_or_refused_in_one_line(count: int) -> None:
    """No other exception, no module, no memory beyond that of the bytes."""
    numbers, whole = random.Random(5), forged(lambda head, arrays: None)
    size = 9 + int.from_bytes(whole[1:9], "big")
    modules, before = set(sys.modules), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    read, said = 0, list[str]()
    for _ in range(count):
        data = bytearray(whole)
        for _ in range(numbers.choice((1, 1, 2, 8))):
            # The head is where the sense is.
            at = numbers.randrange(size if numbers.random() < 0.8 else len(data))
            what = numbers.randrange(4)
            if what == 0:
                data[at] = numbers.randrange(256)
            elif what == 1:
                data[at : at + numbers.randrange(64)] = b""
            elif what == 2:
                data[at:at] = data[at : at + numbers.randrange(64)]
            else:
                data[at : at + 1] = numbers.choice((b"9", b"-", b"[", b"null", b"1e999", b'"'))
        if numbers.random() < 0.7:  # else most end at a length that is wrong
            length = len(data) - (len(whole) - size) - 9
            data[1:9] = max(length, 0).to_bytes(8, "big")
        try:
            unpack_outcome(bytes(data), NOMINAL)
            read += 1
        except AnswerError as error:
            said.append(str(error))
    print(f"answers: {count} inputs, {read} read, {len(said)} refused")
    assert read + len(said) == count
    assert not any("\n" in reason for reason in said)
    assert min(read, len(said)) > 20
    assert {name for name in set(sys.modules) - modules if "." not in name} == set()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # KiB
    assert grown < 256 * 1024
