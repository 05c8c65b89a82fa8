"""Blind cases: what is drawn, what is sealed, how answers are judged."""

from __future__ import annotations

import base64
import json
import shutil
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from msgspec import structs

from femubench import FemubenchError, InputError, Model, challenge, read_case, score_challenge
from femubench.core.challenge.answer import Answer, AnswerCause, AnswerParameter, read_answer
from femubench.core.challenge.draw import draw_case, registered_effects
from femubench.core.challenge.measuring import QUALITY, chi2, see
from femubench.core.challenge.outside import OUTSIDE
from femubench.core.challenge.score import judge_answer
from femubench.core.challenge.sealed import SEALED_FILE, read_sealed, seal, unseal
from femubench.core.challenge.structures import STRUCTURES, structure_named
from femubench.core.challenge.truth import KINDS, DataKind, HiddenCause, Truth, finer
from femubench.core.challenge.truth_file import KnownCase, TrueCause
from femubench.core.challenge.visibility import delta_chi2
from femubench.core.library.cases import read_cases
from femubench.core.modal.eigen import solve_modes
from femubench.core.plugin.loader import load_plugins
from femubench.effect import FrameEffect, Parameter, Site, Size
from femubench.fem import Frame, ModelError, Place, PointMass
from femubench.plugins.effects.local_stiffness_loss import LocalStiffnessLoss
from tests.command import call_bench
from truths.truth_text import truth_text

LADDER = structure_named("ladder")


class ToyMass(FrameEffect):
    """A point mass at a joint, with a range of its own."""

    name: ClassVar[str] = "added-mass"
    sizes: ClassVar[Sequence[Size]] = (Size(0.005, 0.08, Site.mass),)

    def places(self, model: Model) -> Sequence[str]:
        return tuple(joint.name for joint in model.frame_structure.frame.joints)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("mass", "kg", 0.05, lower=0.0, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        return replace(frame, masses=(*frame.masses, PointMass(Place(joint=place), values[0])))


class ToyModulus(FrameEffect):
    """Another modulus of all members; a name without a range of its own."""

    name: ClassVar[str] = "toy-modulus"

    def places(self, model: Model) -> Sequence[str]:
        return ("all",)

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("change", "", 0.05, lower=-0.5, upper=0.5),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        stiff = 1.0 + values[0]
        members = tuple(
            replace(m, material=replace(m.material, E=stiff * m.material.E)) for m in frame.members
        )
        return replace(frame, members=members)


class Absurd(ToyModulus):
    """A modulus that moves every frequency by more than anybody would believe."""

    name: ClassVar[str] = "absurd"

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("change", "", 5.0, lower=0.0, one_sided=True),)


# A stiffness, a body at a place, a spring, and one that no structure takes; all others at night.
FEW = ("local-stiffness-loss", "added-mass", "joint-rotation", "gravity-stiffness")
TOYS = {toy.name: toy for toy in (ToyMass(), ToyModulus())}


def cause(effect: str = "added-mass", place: str = "J1", value: float = 0.1) -> HiddenCause:
    return HiddenCause(effect, place, ("mass",), (value,), ("kg",))


def truth(*causes: HiddenCause, outside: str = "") -> Truth:
    hidden = "outside" if outside else {0: "none", 1: "one"}.get(len(causes), "pair")
    return Truth(7, "A", "ladder", hidden, causes, outside)  # type: ignore[arg-type]


def answer(verdict: str, *causes: tuple[str, str] | AnswerCause, **more: Any) -> Answer:
    made = [
        c if isinstance(c, AnswerCause) else AnswerCause(effect=c[0], place=c[1]) for c in causes
    ]
    return Answer(verdict=verdict, causes=tuple(made), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", STRUCTURES)
def test_structures_are_meshed_well_enough_for_their_data(name: str) -> None:
    """The mesh error of the used modes must stay below the noise, or it is itself an effect."""
    specimen = structure_named(name)
    coarse = see(specimen.model, specimen)
    fine = see(Model.of(finer(specimen.frame)), specimen)
    error = np.abs(coarse.frequencies[:8] / fine.frequencies[:8] - 1.0)
    assert error[:6].max() < 0.0006
    assert error.max() < 0.0013
    gaps = np.diff(fine.frequencies[:10]) / fine.frequencies[:9]
    assert gaps.min() > 0.005
    assert coarse.mass == pytest.approx(fine.mass, rel=1e-12)
    specimen.model.attach(*specimen.change)


def test_an_unknown_structure_is_named() -> None:
    with pytest.raises(InputError, match="no structure 'chair'"):
        structure_named("chair")


@pytest.mark.parametrize("kind", KINDS)
def test_a_case_holds_what_its_kind_promises(kind: DataKind) -> None:
    quality = QUALITY[kind]
    case = draw_case(3, kind, effects=TOYS).case
    used = case.measurement.select(case.used)
    assert len(used) == quality.used
    assert case.held_out == tuple(range(quality.used + 1, quality.used + 5))
    assert used.frequency_std == pytest.approx(quality.frequency_std * used.frequencies)
    shaped = np.isfinite(used.shapes).all(axis=0) if len(used.sensors) else np.zeros(0)
    assert shaped.sum() == quality.shapes
    assert len(case.modifications[0].measurement) == quality.modified
    assert case.model.size == 81
    if quality.shapes:
        assert used.shape_std[:, 0] == pytest.approx(quality.shape_std)


def test_the_same_seed_gives_the_same_case_and_another_seed_another() -> None:
    one, again, other = (draw_case(seed, "A", effects=TOYS) for seed in (5, 5, 6))
    assert one.truth == again.truth
    assert np.array_equal(one.case.measurement.frequencies, again.case.measurement.frequencies)
    assert one.case.measurement.total_mass == again.case.measurement.total_mass
    assert one.truth != other.truth
    assert one.case.name != other.case.name


@pytest.mark.parametrize("kind", KINDS)
def test_the_noise_is_as_large_as_it_is_stated(kind: DataKind) -> None:
    """Clean cases against the finer model that gave them: chi-square per datum is one."""
    fine = see(Model.of(finer(LADDER.frame)), LADDER)
    totals, count = [], 0
    for seed in range(12):
        used = draw_case(seed, kind, hidden="none").case.used_measurement()
        totals.append(chi2(used, fine))
        shaped = QUALITY[kind].shapes
        count += len(used) + shaped * (len(used.sensors) - 1) + (used.total_mass is not None)
    assert sum(totals) / count == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / count) + 0.03)


def test_the_loss_in_half_an_element_is_as_flexible_as_that_in_the_whole() -> None:
    loss = 0.7
    (half,) = LocalStiffnessLoss().in_half((loss,))
    assert 0.5 * (1.0 + 1.0 / (1.0 - half)) == pytest.approx(1.0 / (1.0 - loss))


def test_an_absurd_truth_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femubench.core.challenge.draw._ATTEMPTS", 8)
    with pytest.raises(FemubenchError, match="no sensible truth in 8 draws of absurd"):
        draw_case(1, "C", effect="absurd", effects={"absurd": Absurd()})


def test_what_buckles_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    negative = solve_modes(LADDER.model)
    lowered = replace(negative, eigenvalues=negative.eigenvalues - 1e3)
    monkeypatch.setattr("femubench.core.challenge.measuring.solve_modes", lambda _: lowered)
    with pytest.raises(ModelError, match="buckles"):
        see(LADDER.model, LADDER)


def test_an_effect_that_cannot_be_hidden_is_named() -> None:
    with pytest.raises(InputError, match="'toy' cannot be hidden in ladder"):
        draw_case(1, "A", effect="toy", effects=TOYS)
    with pytest.raises(InputError, match="no effect can be hidden"):
        draw_case(1, "A", effects={})
    with pytest.raises(InputError, match="scatter nan"):
        draw_case(1, "A", hidden="none", scatter=float("nan"))


@pytest.mark.parametrize("name", list(OUTSIDE)[::3])
def test_causes_outside_the_catalogue_show(name: str) -> None:
    blind = draw_case(2, "A", hidden="outside", effect=name, effects=TOYS)
    clean = see(Model.of(finer(LADDER.frame)), LADDER)
    assert blind.truth.outside
    assert blind.truth.excess >= 30.0
    noisy = chi2(blind.case.used_measurement(), clean)
    assert noisy > 0.3 * blind.truth.excess


def test_a_sensor_fault_is_in_all_modes_and_needs_shapes() -> None:
    with pytest.raises(InputError, match="cannot be hidden"):
        draw_case(1, "C", hidden="outside", effect="swapped-sensors")
    drawn = [draw_case(seed, "C", hidden="outside", effects=TOYS) for seed in range(6)]
    names = {blind.truth.outside for blind in drawn}
    assert len(names) > 1
    assert not any("sensor" in name for name in names)


def test_a_pair_is_two_effects_that_both_show() -> None:
    blind = draw_case(4, "A", hidden="pair", effects=TOYS)
    assert {c.effect for c in blind.truth.causes} == set(TOYS)
    assert min(delta_chi2(blind.case, blind.truth, TOYS)) > 10.0


@pytest.mark.parametrize(
    "effect",
    [
        name if name in FEW else pytest.param(name, marks=pytest.mark.nightly)
        for name in sorted(registered_effects())
    ],
)
def test_every_effect_can_be_hidden_and_putting_it_back_explains_the_data(effect: str) -> None:
    """On the first structure that takes it, of three draws the best falls to the noise."""
    effects = registered_effects()
    fit = [s for s in STRUCTURES if effects[effect].places(structure_named(s).model)]
    if not fit:
        # None is slender enough to feel its weight, comes as matrices, or has parts side by side.
        elsewhere = ("gravity-stiffness", "group-mass", "group-material", "interface-softness")
        elsewhere += ("interface-spring", "plate-thickness", "preload-force")
        assert getattr(effects[effect], "needs", "") or effect in elsewhere
        return
    shares = []
    for seed in range(3):
        blind = draw_case(seed, "A", structure=fit[0], effect=effect)
        (delta,) = delta_chi2(blind.case, blind.truth, effects)
        assert np.isfinite(delta)
        shares.append(delta)
    assert max(shares) > 12.0


# --- the seal ---------------------------------------------------------------------------------


def test_a_sealed_truth_comes_back_and_tells_nothing_at_a_glance() -> None:
    hidden = truth(cause())
    text, commitment = seal(hidden)
    assert unseal(text) == (hidden, commitment)
    assert "added-mass" not in text
    assert "J1" not in json.loads(text)["sealed"][:4]
    assert seal(hidden)[1] != commitment


def test_a_changed_seal_is_refused() -> None:
    file = json.loads(seal(truth(cause()))[0])
    content = zlib.decompress(base64.b64decode(file["sealed"])).replace(b'"J1"', b'"J3"')
    file["sealed"] = base64.b64encode(zlib.compress(content)).decode()
    with pytest.raises(InputError, match="changed since it was sealed"):
        unseal(json.dumps(file))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"format": "femubench-sealed-1", "commitment": "x", "sealed": ""}',
        json.dumps({"format": "femubench-sealed-1", "commitment": 64 * "0", "sealed": "?"}),
        json.dumps({"format": "femubench-sealed-1", "commitment": 64 * "0", "sealed": "aaaa"}),
        json.dumps({"format": "femubench-sealed-2", "commitment": 64 * "0", "sealed": "aaaa"}),
        "[" * 100_000,
    ],
)
def test_what_is_no_seal_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(InputError) as caught:
        unseal(text)
    assert "\n" not in str(caught.value)


def test_a_seal_that_unpacks_to_very_much_is_refused() -> None:
    bomb = base64.b64encode(zlib.compress(b"0" * 2**26)).decode()
    file = {"format": "femubench-sealed-1", "commitment": 64 * "0", "sealed": bomb}
    with pytest.raises(InputError, match="changed since"):
        unseal(json.dumps(file))


# --- answers ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "JSON"),
        (b"\xff\xfe", "UTF-8"),
        (b"[]", "expected a table"),
        (b"{}", "verdict"),
        (b'{"verdict": "perhaps"}', "verdict"),
        (b'{"verdict": "named", "causes": [{"effect": 3}]}', r"causes\[0\]\.effect"),
        (b'{"verdict": "named", "causes": [{"effect": "a", "probability": NaN}]}', "NaN"),
        (b'{"verdict": "named", "causes": [{"effect": "a", "probability": 7}]}', "probability"),
        (b'{"verdict": "named", "causes": [{"effect": "a\\nb"}]}', "effect"),
        (b'{"verdict": "none", "causes": ' + b"[" * 5000 + b"]" * 5000 + b"}", "nested|causes"),
        (b'{"verdict": "none"}' + b" " * 2**22, "too large"),
    ],
)
def test_answers_of_others_are_checked(tmp_path: Path, content: bytes, match: str) -> None:
    path = tmp_path / "answer.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=match) as caught:
        read_answer(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_the_probability_that_an_answer_claims() -> None:
    def part(p: float) -> AnswerCause:
        return AnswerCause(effect="a", place="b", probability=p)

    assert answer("named", part(0.9), part(0.8)).probability == 0.8
    assert answer("ambiguous", part(0.5), part(0.4)).probability == pytest.approx(0.9)
    # Where members stand together, one is right no more surely than the surest of them.
    assert answer("ambiguous", part(0.9), part(0.4)).probability == 0.9
    there = AnswerCause(effect="a", place="b", probability=0.9, place_probability=0.25)
    assert answer("named", there).probability == pytest.approx(0.225)
    assert answer("none", nothing=0.97).probability == 0.97
    assert answer("unknown", part(0.9)).probability is None


# --- the judge --------------------------------------------------------------------------------

MASS, SPRING = ("added-mass", "J1"), ("grounding-spring", "J3")


@pytest.mark.parametrize(
    ("said", "delta", "right", "places"),
    [
        (answer("named", MASS), 40.0, True, True),
        (answer("named", ("added-mass", "J3")), 40.0, True, False),
        (answer("named", SPRING), 40.0, False, False),
        (answer("named", MASS, SPRING), 40.0, False, False),
        (answer("ambiguous", SPRING, MASS), 40.0, True, True),
        (answer("ambiguous", SPRING, ("joint-mass", "L")), 40.0, False, False),
        (answer("ambiguous", ("added-mass + joint-mass", "J1 + L")), 40.0, False, False),
        (answer("unknown", MASS), 40.0, False, False),
        (answer("not-confirmed", MASS), 40.0, False, False),
        (answer("none"), 40.0, False, False),
        (answer("none"), 11.9, True, None),
        (answer("none"), 12.0, False, False),
        (answer("named", MASS), 5.0, True, True),
        (answer("named", SPRING), 5.0, False, False),
    ],
)
def test_one_hidden_effect(said: Answer, delta: float, right: bool, places: bool | None) -> None:
    judged = judge_answer(truth(cause()), said, [delta])
    assert judged.right is right
    assert judged.places is places
    assert judged.too_small is (delta < 12.0)
    assert not judged.false_alarm


def test_a_group_of_everything_is_no_answer() -> None:
    names = [(f"effect-{i}", "all") for i in range(6)]
    judged = judge_answer(truth(cause()), answer("ambiguous", MASS, *names), [40.0])
    assert not judged.right
    assert judged.group == 7
    assert judge_answer(truth(cause()), answer("ambiguous", MASS, *names[:5]), [40.0]).right


def test_an_end_at_a_joint_of_two_members_is_the_joint() -> None:
    hidden = truth(cause("joint-rotation", "rung-right@J1"))
    assert judge_answer(hidden, answer("named", ("joint-rotation", "J1")), [40.0]).places
    hidden = truth(cause("joint-rotation", "rung-middle@J5"))
    assert not judge_answer(hidden, answer("named", ("joint-rotation", "J5")), [40.0]).places


@pytest.mark.parametrize(
    ("said", "deltas", "right", "found"),
    [
        (answer("named", SPRING, MASS), (40.0, 40.0), True, 2),
        (answer("named", MASS), (40.0, 40.0), False, 1),
        (answer("named", MASS), (40.0, 5.0), True, 1),
        (answer("named", SPRING), (40.0, 5.0), False, 1),
        (answer("none"), (5.0, 5.0), True, 0),
        (answer("none"), (5.0, 50.0), False, 0),
        (
            answer("ambiguous", ("added-mass + grounding-spring", "J1 + J3"), MASS),
            (40.0, 40.0),
            True,
            2,
        ),
        (answer("ambiguous", SPRING, MASS), (40.0, 40.0), True, 2),
        (answer("ambiguous", SPRING, ("joint-mass", "L")), (40.0, 40.0), False, 1),
    ],
)
def test_two_hidden_effects(
    said: Answer, deltas: tuple[float, float], right: bool, found: int
) -> None:
    hidden = truth(cause(), cause("grounding-spring", "J3", 1e4))
    judged = judge_answer(hidden, said, deltas)
    assert (judged.right, judged.found) == (right, found)


def test_nothing_hidden() -> None:
    assert judge_answer(truth(), answer("none"), ()).right
    for said in (answer("named", MASS), answer("unknown"), answer("ambiguous", MASS, SPRING)):
        judged = judge_answer(truth(), said, ())
        assert judged.false_alarm
        assert not judged.right


@pytest.mark.parametrize(
    ("verdict", "excess", "right"),
    [
        ("unknown", 90.0, True),
        ("not-confirmed", 90.0, True),
        ("named", 90.0, False),
        ("ambiguous", 90.0, False),
        ("none", 90.0, False),
        ("none", 9.0, True),
    ],
)
def test_causes_outside_the_catalogue(verdict: str, excess: float, right: bool) -> None:
    said = answer(verdict, MASS)
    assert judge_answer(truth(outside="a crack"), said, [excess]).right is right


def test_sizes_are_judged_in_standard_deviations() -> None:
    mass = AnswerParameter(name="mass", value=0.13, std=0.01, unit="kg")
    said = AnswerCause(effect="added-mass", place="J1", parameters=(mass,))
    (size,) = judge_answer(truth(cause(value=0.1)), answer("named", said), [40.0]).sizes
    assert size.deviations == pytest.approx(3.0)
    elsewhere = structs.replace(said, place="J3")
    assert judge_answer(truth(cause()), answer("named", elsewhere), [40.0]).sizes == ()


# --- folders and the command ------------------------------------------------------------------


@pytest.fixture
def blind(tmp_path: Path) -> Path:
    challenge(tmp_path / "case", 11, hidden="one", effects=TOYS)
    return tmp_path / "case"


def test_the_folder_is_the_case_and_tells_nothing_of_the_truth(blind: Path) -> None:
    drawn = draw_case(11, "A", hidden="one", effects=TOYS)
    read = read_case(blind)
    assert read.used == drawn.case.used
    assert read.held_out == drawn.case.held_out
    assert read.measurement.frequencies == pytest.approx(drawn.case.measurement.frequencies)
    assert solve_modes(read.model).natural_frequencies[:12] == pytest.approx(
        solve_modes(LADDER.model).natural_frequencies[:12], abs=1e-2
    )
    (hidden,) = drawn.truth.causes
    texts = "".join(p.read_text() for p in blind.rglob("*.*") if p.name != SEALED_FILE)
    for word in (hidden.effect, "seed", f"{hidden.values[0]:.4g}", "truth.sealed"):
        assert word not in texts


def test_an_answer_to_a_folder_is_scored(blind: Path, tmp_path: Path) -> None:
    (hidden,) = draw_case(11, "A", hidden="one", effects=TOYS).truth.causes
    path = tmp_path / "answer.json"
    causes = [{"effect": hidden.effect, "place": hidden.place}]
    path.write_text(json.dumps({"verdict": "named", "causes": causes}), encoding="utf-8")
    scored = score_challenge(blind, path, effects=TOYS)
    assert scored.judgement.right
    assert scored.judgement.places
    assert json.loads(scored.to_json())["judgement"]["right"] is True
    with pytest.raises(InputError, match="is not installed"):
        score_challenge(blind, path, effects={})
    modes = blind / "modes.csv"
    modes.write_text(modes.read_text().replace("1,", "1,", 1) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="changed since its truth was sealed"):
        score_challenge(blind, path, effects=TOYS)


def test_no_folder_with_files_is_written_into(blind: Path) -> None:
    with pytest.raises(InputError, match="is not empty"):
        challenge(blind, 1, kind="C", hidden="none")


def test_the_command_writes_and_scores(tmp_path: Path) -> None:
    case, sealed, said = tmp_path / "case", tmp_path / "secret", tmp_path / "answer.json"
    options = ["--seed", "3", "--kind", "C", "--hidden", "none", "--truth", sealed]
    done = call_bench("challenge", "new", *options, case)
    commitment = json.loads(sealed.read_text())["commitment"]
    assert commitment in done.output
    assert not (case / SEALED_FILE).exists()
    said.write_text('{"verdict": "none"}', encoding="utf-8")
    out = tmp_path / "judged.json"
    done = call_bench("challenge", "score", case, said, "--truth", sealed, "--json", out)
    assert "right: nothing is hidden" in done.output
    assert json.loads(out.read_text())["judgement"]["right"] is True
    done = call_bench("challenge", "score", case, said, code=2)
    assert "truth.sealed: cannot be read" in done.output


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """Write a folder of one truth, on a built-in structure, and one on a structure next to it."""
    room = tmp_path / "truths"
    frame = read_cases("frame-solid", load_plugins())[0].folder
    loose = TrueCause("a loose joint", "joint-rotation", "J1", ("joint-offset@J1",), 4e3, "N m/rad")
    for name, structure, causes in (("a", frame.name, (loose,)), ("b", "ours", ())):
        (room / name).mkdir(parents=True)
        kind = "defect" if causes else "clean"
        stated = KnownCase(name, structure, kind, 1, causes, 50.0, 40.0)
        (room / name / "truth.toml").write_text(truth_text(stated), encoding="utf-8")
        shutil.copyfile(frame / "modes.csv", room / name / "modes.csv")
    shutil.copytree(frame, room / "structures" / "ours")
    shutil.copyfile(frame / "modes.csv", room / "a" / "healthy.csv")
    return room


def test_truths_from_outside_are_posed_and_scored(outside: Path, tmp_path: Path) -> None:
    case = tmp_path / "case"
    made = challenge(case, 3, truths=outside, reference=True)  # only one has the healthy structure
    assert read_case(case).reference is not None
    assert not any("joint-rotation" in p.read_text() for p in case.glob("*.*") if p != made.truth)
    said = tmp_path / "answer.json"

    def scored(verdict: str, effect: str, place: str) -> tuple[bool, bool | None, bool | None]:
        sizes = [{"name": "stiffness", "value": 5e3, "std": 500.0, "unit": "N m/rad"}]
        causes = [{"effect": effect, "place": place, "parameters": sizes}]
        said.write_text(json.dumps({"verdict": verdict, "causes": causes}), encoding="utf-8")
        found = made.score(said)
        assert found.delta_chi2 == (50.0,)
        if found.judgement.sizes:
            assert found.judgement.sizes[0].deviations == pytest.approx(2.0)
        return found.judgement.right, found.judgement.names, found.judgement.places

    assert scored("named", "joint-rotation", "rung-right@J1") == (True, True, True)
    assert scored("named", "joint-offset", "J1") == (True, True, True)
    assert scored("named", "joint-rotation", "J5") == (False, True, False)
    assert scored("named", "added-mass", "J1") == (False, False, False)
    assert scored("unknown", "joint-rotation", "J1") == (False, False, False)


def test_every_truth_of_a_folder_is_drawn_by_some_seed(outside: Path, tmp_path: Path) -> None:
    found = {
        str(read_sealed(challenge(tmp_path / f"{seed}", seed, truths=outside).truth)[0])
        for seed in range(8)
    }
    assert found == {"nothing", "a loose joint: joint-rotation at J1 (4000 N m/rad)"}


def test_the_command_poses_truths_from_outside(outside: Path, tmp_path: Path) -> None:
    case, said = tmp_path / "case", tmp_path / "answer.json"
    new = ["challenge", "new", "--seed", "1", "--truths", outside]
    call_bench(*new, "--reference", case)
    said.write_text('{"verdict": "none"}', encoding="utf-8")
    done = call_bench("challenge", "score", case, said, code=None)
    assert "hidden: a loose joint: joint-rotation at J1" in done.output
    assert "wrong: none; hidden is a loose joint" in done.output
    for words, expected in (
        ([*new, "--kind", "A"], "--kind has no effect with --truths"),
        (["challenge", "new", "--seed", "1", "--reference"], "--reference goes with --truths"),
        ([*new[:-1], tmp_path / "none"], "no folder with truth.toml"),
    ):
        assert expected in call_bench(*words, tmp_path / "other", code=2).output
