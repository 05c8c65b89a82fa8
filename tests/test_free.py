"""A structure that is known to hang free: what may not hold it, in a case and in a diagnosis."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import scipy.sparse as sp

from femubench import InputError, Measurement, Model, Sensors, cases, read_case, solve_modes
from femubench.core.case.writing import write_case
from femubench.core.change.hypothesis import hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.diagnosis.serial import diagnosis_to_json
from femubench.core.fem.model import Dofs
from femubench.core.inference.examine import examine
from femubench.core.look.look import look
from femubench.diagnosis import list_effects
from femubench.effect import Change, ModelPlaces, Parameter, RowOperator, Term
from femubench.fem import Groups, MatrixGeometry, Place, Property

CASES = Path(__file__).parent / "cases"


class Tether:
    """A third party's effect: a torsional spring to ground, or one between two joints."""

    name: ClassVar[str] = "tether"

    def places(self, model: Model) -> Sequence[str]:
        return ("A", "A-F")

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("stiffness", "N m/rad", 10.0),)

    def change(self, model: Model, place: str) -> Change:
        points = [ModelPlaces(model).motion(Place(joint=name))[[3]] for name in place.split("-")]
        row = points[0] if len(points) == 1 else points[0] - points[1]
        return Change.proportional(Term("stiffness", RowOperator(row, np.eye(1))))


TETHER: Any = (Tether(),)


def names(model: Model, *more: Any) -> Counter[str]:
    return Counter(h.name for h in hypotheses_of(model, (*list_effects(), *more)))


def test_nothing_to_ground_is_a_candidate_and_all_else_is(ladder: Any) -> None:
    plain = names(Model.of(ladder(elements=2)))
    free = names(Model.of(replace(ladder(elements=2), free=True)))
    assert plain["grounding-spring"] > 0
    assert plain["attached-oscillator"] > 0
    del plain["grounding-spring"]
    assert free == plain


def test_what_an_outsider_ties_to_ground_is_found_by_its_energy(ladder: Any) -> None:
    model = Model.of(replace(ladder(elements=2), free=True))
    own = hypotheses_of(model, TETHER)
    assert [(h.place, h.places) for h in own] == [("A-F", 1)]
    assert names(replace(model, free=False), *TETHER)["tether"] == 2


def as_matrices(tmp_path: Path) -> Path:
    """Return a case of matrices of a free frame: one whose update has changed them."""
    wanted = replace(cases["frame"], modifications=())
    model = wanted.model
    write_case(tmp_path / "matrices", wanted, replace(model, stiffness=1.1 * model.stiffness))
    return tmp_path / "matrices"


def test_matrices_that_hang_free_have_none_either(tmp_path: Path) -> None:
    model = read_case(as_matrices(tmp_path)).model
    assert model.structure is None
    assert names(model)["grounding-spring"] > 0
    assert names(replace(model, free=True))["grounding-spring"] == 0


def freed(folder: Path, kind: str) -> str:
    text = (folder / "case.toml").read_text()
    text = text.replace(f'kind = "{kind}"\n', f'kind = "{kind}"\nfree = true\n')
    (folder / "case.toml").write_text(text)
    return text


def test_supports_contradict_it(tmp_path: Path) -> None:
    shutil.copytree(CASES / "in-plane", tmp_path / "case")
    text = freed(tmp_path / "case", "frame")
    with pytest.raises(InputError, match="supports hold it") as caught:
        read_case(tmp_path / "case")
    line = 1 + text[: text.index("free = true")].count("\n")
    assert (caught.value.key, caught.value.line) == ("model.free", line)


@pytest.mark.parametrize("kind", ["frame", "matrices"])
def test_the_key_is_kept(kind: str, tmp_path: Path) -> None:
    folder = tmp_path / "frame" if kind == "frame" else as_matrices(tmp_path)
    if kind == "frame":
        case = read_case(CASES / "out-of-plane")
        frame = replace(case.model.frame_structure.frame, supports=())
        write_case(folder, replace(case, modifications=()), Model.of(frame))
    freed(folder, kind)
    found = read_case(folder)
    assert found.model.free
    write_case(tmp_path / "again", found)
    assert read_case(tmp_path / "again").model.free


def row_of_masses(weights: Sequence[float] = (1.0, 1.0, 1.0, 1.0)) -> Model:
    """Return lumped masses above each other on rails along x, a spring as a group between two."""
    count, springs = len(weights), {}
    for i in range(count - 1):
        part = np.zeros((count, count))
        part[i : i + 2, i : i + 2] = 1e6 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        springs[f"storey-{i + 1}"] = sp.csc_array(part)
    xyz = np.column_stack([np.zeros((count, 2)), 3.0 * np.arange(count)])
    dofs = Dofs(np.arange(count), ("x",) * count, xyz)
    geometry = MatrixGeometry(tuple(f"floor-{i}" for i in range(count)), dofs)
    mass = sp.csc_array(np.diag(1000.0 * np.array(weights)))
    return Model(mass, sum(springs.values()), dofs, geometry, groups=springs, free=True)


def frequencies_of(model: Model, std: float) -> Measurement:
    """Return the elastic modes of a row of masses, their shapes known poorly."""
    modes = solve_modes(model)
    f, shapes = modes.natural_frequencies[1:], modes.shapes[:, 1:]
    count = model.size
    sensors = Sensors(tuple("abcd"[:count]), model.dofs.xyz, ("x",) * count)
    numbers, wide = tuple(range(1, count)), np.full(shapes.shape, 0.3 * np.abs(shapes).max())
    return Measurement(sensors, numbers, f, std * f, np.full(len(f), np.nan), shapes, wide)


@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0, 1.0), (20.0, 1.0, 1.0, 20.0), (1.0, 1.0)])
def test_floors_on_rails_keep_their_springs_as_causes(weights: tuple[float, ...]) -> None:
    model = row_of_masses(weights)
    assert names(model)["member-stiffness"] == len(weights) - 1
    assert names(model)["youngs-modulus"] == 1
    assert names(model)["grounding-spring"] == 0
    assert not [w for w in look(model, frequencies_of(model, 1e-3)) if "hang free" in w.what]


def test_damage_is_no_matter_of_tolerance() -> None:
    """With a reference, and of groups without: their tolerance is a class of the model error."""
    model, (wanted,) = row_of_masses(), [e for e in list_effects() if e.name == "member-stiffness"]
    storey = [Property("storey-2", "E", ("group:storey-2",))]
    broken = frequencies_of(Groups(model).with_factors(storey, [0.56]), 0.03)

    def loss(reference: Measurement | None) -> float:
        seen = examine(model, broken, [wanted], tolerance=0.0, pairs=False, reference=reference)
        fits = [e.fit for e in seen.posterior.explanations if e.place == "group:storey-2"]
        return float(fits[0].parts[0].hypothesis.values(fits[0].state.x[None])[0, 0])

    for reference in (frequencies_of(model, 0.03), None):
        assert loss(reference) == pytest.approx(-0.44, abs=0.02)
    change = Parameter("change", "", 0.1, lower=-0.9, wording="change")
    assert change.widen(0.4).coordinate(-0.44) == pytest.approx(np.log(0.56) / 0.4)
    mass = Parameter("mass", "kg", 0.1, one_sided=True)
    assert mass.coordinate(1.2) == pytest.approx(12.0)  # beyond reach of what a drawing forgets
    assert mass.widen(0.4).coordinate(1.2) == pytest.approx(np.log(73.0))
    stated = [replace(change, scaling="factor"), replace(change, wording="share")]
    stated += [Parameter("length", "m", 0.1, upper=0.3, one_sided=True)]
    assert [p.widen(0.4) for p in stated] == stated


def test_what_is_no_candidate_is_said_with_its_reason() -> None:
    free = replace(cases["frame"], reference=cases["frame"].measurement)
    free = replace(free, model=replace(free.model, free=True), reference_used=free.used)
    effects = [e for e in list_effects() if e.name in ("grounding-spring", "rotary-inertia")]
    found = diagnose(free, effects, faults=(), pairs=False)
    places = names(replace(free.model, free=False))["grounding-spring"]
    assert [(row.effect, row.places) for row in found.left_out] == [
        ("grounding-spring", places),
        ("rotary-inertia", 1),
    ]
    said = [note for note in found.notes if note.startswith("Not tried")]
    assert said == [
        f"Not tried, since the structure hangs free: grounding-spring at {places} places.",
        "Not tried, since the reference has them too: rotary-inertia at 1 place.",
    ]
    assert diagnosis_to_json(found)["left_out"][1]["reason"] == "the reference has them too"
    plain = replace(free, model=replace(free.model, free=False), reference=None)
    assert diagnose(plain, effects, faults=(), pairs=False).left_out == ()
