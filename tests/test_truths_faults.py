"""Every fault of the data is what its truth says, and comes out the same every time."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_suite import write_suite

from femubench import Case, InputError, read_case
from femubench.core.challenge.posing import overlay
from femubench.core.challenge.truth_file import TRUTH_FILE, KnownCase, read_truth
from truths.faults import FAULT_KINDS, Draft, Structure, drafts, files_of, visibility
from truths.posing import FAULTS, SUITE, first_folders

pytestmark = pytest.mark.slow(20)

Drawn = tuple[Structure, KnownCase, Draft]


def structures_of(suite: Path) -> list[Structure]:
    return [Structure(folder) for folder in first_folders(suite)]


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_suite(tmp_path_factory.mktemp("suite"))


@pytest.fixture(scope="module")
def drawn(suite: Path) -> list[Drawn]:
    return list(drafts(structures_of(suite)))


@pytest.fixture
def of_kind(drawn: list[Drawn]) -> Callable[[str], list[Drawn]]:
    return lambda effect: [one for one in drawn if one[1].causes[0].effect == effect]


def faulty(folder: Path, one: Drawn) -> Case:
    """Return the case of a fault."""
    structure, truth, draft = one
    room = folder / truth.name
    room.mkdir()
    for name, text in draft.files.items():
        (room / name).write_text(text, encoding="utf-8")
    overlay(structure.folder, room, folder / f"{truth.name}-case")
    return read_case(folder / f"{truth.name}-case")


def edited(one: Drawn) -> list[tuple[tuple[str, ...], Any, Any]]:
    """Return key, old and new value of every number of `case.toml` that differs."""

    def leaves(value: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
        if not isinstance(value, dict):
            return {path: value}
        return {k: v for key in value for k, v in leaves(value[key], (*path, key)).items()}

    old, new = leaves(one[0].spec), leaves(tomllib.loads(one[2].files["case.toml"]))
    return [(k, old.get(k), new.get(k)) for k in {**old, **new} if old.get(k) != new.get(k)]


def test_sixty_faults_of_nine_kinds_over_all_structures(drawn: list[Drawn], suite: Path) -> None:
    assert len({truth.name for _, truth, _ in drawn}) == len(drawn) == 60
    counts = Counter(truth.causes[0].effect for _, truth, _ in drawn)
    assert counts == {kind.effect: kind.count for kind in FAULT_KINDS}
    load = Counter(truth.structure for _, truth, _ in drawn)
    assert set(load) == {structure.name for structure in structures_of(suite)}
    assert max(load.values()) - min(load.values()) <= 2
    alike = Counter((truth.structure, *sorted(draft.files.items())) for _, truth, draft in drawn)
    assert max(alike.values()) == 1


def test_an_outlier_is_one_frequency(of_kind: Any, tmp_path: Path) -> None:
    sizes = []
    for one in of_kind("frequency-outlier"):
        cause, sound = one[1].causes[0], one[0].sound
        case = faulty(tmp_path, one)
        ratio = case.measurement.frequencies / sound.measurement.frequencies - 1.0
        mode = int(cause.place.removeprefix("mode:"))
        off = sound.measurement.numbers.index(mode)
        assert mode in sound.used
        assert np.flatnonzero(ratio).tolist() == [off]
        assert ratio[off] == pytest.approx(cause.size, abs=1e-6)
        np.testing.assert_array_equal(case.measurement.shapes, sound.measurement.shapes)
        sizes.append(cause.size)
    assert min(sizes) < 0.0 < max(sizes)
    assert all(0.01 <= abs(size) <= 0.1 for size in sizes)
    assert min(map(abs, sizes)) < 0.02


@pytest.mark.parametrize("effect", ["sensor-sign", "sensor-gain"])
def test_one_sensor_is_scaled_in_every_mode(of_kind: Any, tmp_path: Path, effect: str) -> None:
    for one in of_kind(effect):
        cause, sound, found = one[1].causes[0], one[0].sound, faulty(tmp_path, one)
        label = cause.place.removeprefix("sensor:")
        factor = cause.size if effect == "sensor-gain" else -1.0
        assert factor == -1.0 or 0.3 <= factor <= 3.0
        expected = sound.measurement.shapes.copy()
        expected[sound.measurement.sensors.labels.index(label)] *= factor
        np.testing.assert_allclose(found.measurement.shapes, expected, rtol=1e-6)


def test_a_unit_slips_in_one_number(of_kind: Any) -> None:
    seen = Counter()
    for one in of_kind("unit-slip"):
        cause, ((path, old, new),) = one[1].causes[0], edited(one)
        assert new == pytest.approx(cause.size * old, rel=1e-9)
        assert cause.place == f"{path[1].removesuffix('s')}:{path[2]}"
        seen[path[3], cause.size] += 1
        assert cause.also == {"E": ("youngs-modulus@all",), "rho": ("density@all",)}.get(
            path[3], ()
        )
    assert (seen["E", 1e-3], seen["E", 1e3], seen["rho", 1e-3]) == (1, 1, 2)
    assert seen["width", 1e3] + seen["height", 1e3] == 2


def test_a_forgotten_support_lets_the_frame_move(of_kind: Any, tmp_path: Path) -> None:
    whole = 0
    for one in of_kind("support-missing"):
        cause, sound, found = one[1].causes[0], one[0].sound, faulty(tmp_path, one)
        joint, _, direction = cause.place.removeprefix("support:").partition(":")
        free = 1 if direction else 3
        assert found.model.size == sound.model.size + free
        assert cause.also == ((f"grounding-spring@{joint}:{direction}",) if direction else ())
        left = [s.fixed for s in found.model.frame_structure.frame.supports if s.at.joint == joint]
        assert all(direction and direction not in fixed for fixed in left)
        whole += not direction
    assert whole == 3


def test_visibility_of_faults_in_the_data(of_kind: Any) -> None:
    one = of_kind("frequency-outlier")[0]
    used = one[0].sound.used_measurement()
    cause = one[1].causes[0]
    k = used.numbers.index(int(cause.place.removeprefix("mode:")))
    expected = (cause.size * used.frequencies[k] / used.frequency_std[k]) ** 2
    assert visibility(*one) == pytest.approx((expected, expected), rel=1e-4)

    one = of_kind("sensor-sign")[0]
    used = one[0].sound.used_measurement()
    row = used.sensors.labels.index(one[1].causes[0].place.removeprefix("sensor:"))
    turned = used.shapes.copy()
    turned[row] *= -1.0
    left = 0.0
    for m in range(len(used)):
        a, b = used.shapes[:, m] / used.shape_std[:, m], turned[:, m] / used.shape_std[:, m]
        left += a @ a - (a @ b) ** 2 / (b @ b)
    assert visibility(*one) == pytest.approx((left, 0.0), rel=1e-6)
    assert left > 0.0


def test_a_suite_without_room_for_a_kind_says_so(suite: Path) -> None:
    with pytest.raises(InputError, match="no structure can have support-missing number 1"):
        list(drafts([Structure(suite / "frame-solid")]))


def test_committed_faults_are_what_the_generator_writes() -> None:
    structures = structures_of(SUITE)
    made = list(drafts(structures)) if structures else []
    folders = {path.parent.name: path.parent for path in FAULTS.glob(f"*/{TRUTH_FILE}")}
    assert set(folders) == {truth.name for _, truth, _ in made}
    seen: set[str] = set()
    for structure, truth, draft in made:
        committed = files_of(folders[truth.name])
        assert committed.pop(TRUTH_FILE)
        assert committed == draft.files
        said = read_truth(folders[truth.name])
        assert replace(said, chi2=None, chi2_frequencies=None) == truth
        effect = truth.causes[0].effect
        # What a fault changes takes a case to read: once for each kind.
        if effect not in seen:
            whole, part = visibility(structure, truth, draft)
            assert (said.chi2 is None) == (whole is None)
            if whole is not None:
                stated = (said.chi2, said.chi2_frequencies)
                assert stated == pytest.approx((whole, part), rel=1e-3)
            seen.add(effect)
