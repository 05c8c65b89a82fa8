"""Name hidden causes with a reference, by modes alone and by antiresonances next to them.

    python benchmarks/response_sweep.py 1 2 3    # seeds, each on every case with responses

The truth is the drawn frame on a finer mesh, with shear, elements scattered by 4 % and half of its
joints soft, before and after one cause of the catalogue that changes the used modes visibly. Both
states are tested: modes with the scatter of the case, accelerances from the same force and sensors.
"""

from __future__ import annotations

import argparse
import sys
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1]))  # the truths are not installed

from femubench import read_case
from femubench.core.case.case import Case
from femubench.core.challenge.answer import Answer
from femubench.core.challenge.draw import draw_values, registered_effects
from femubench.core.challenge.outcome import outcome, record_of, same_place
from femubench.core.challenge.truth import HiddenCause, finer, scatter_elements, with_causes
from femubench.core.challenge.truth_file import KnownCase, TrueCause
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.effect.sizes import Site
from femubench.core.errors import FemubenchError
from femubench.core.fem.frame import Frame
from femubench.core.fem.model import Model
from femubench.core.fit.residuals import Data
from femubench.core.inference.effort import Effort
from femubench.core.modal.eigen import Modes, modes_of, solve_modes
from femubench.core.modal.frf import FrequencyResponses, ResponseSplit, receptance
from femubench.core.modal.measurement import Measurement
from truths.responses import FOLDER, NAMES

Array = npt.NDArray[np.float64]
EFFECTS = registered_effects()
KINDS = (
    *("local-stiffness-loss", "joint-rotation", "member-stiffness", "added-mass", "member-mass"),
    *("support-flexibility", "wall-thickness", "grounding-spring"),
)
SCATTER, FREQUENCY_STD, MASS_STD = 0.04, 0.002, 0.002
LINES, FORCE_NOISE, MOTION_NOISE = 200, 0.0063, 0.003
VISIBLE = 15.0, 5000.0  # of chi-square of the used modes, noise-free
ATTEMPTS = 60


def drawn_otherwise(case: Case, rng: np.random.Generator) -> Frame:
    """Return the structure that the drawing of a case is of."""
    frame = scatter_elements(
        replace(finer(case.model.frame_structure.frame), beam="timoshenko"), SCATTER, rng
    )
    effect = EFFECTS["joint-rotation"]
    for place in effect.places(case.model):
        if "@" not in place or rng.random() < 0.5:
            continue
        parameters = effect.parameters(case.model, place)
        values = [
            float(np.clip(p.value(float(rng.uniform(0.02, 0.15))), p.lower, p.upper))
            for p in parameters
        ]
        try:
            frame = effect.frame(frame, place, values)
        except FemubenchError:  # no two springs at one place
            continue
    return frame


def tested(
    model: Model, case: Case, gains: Array, lines: Array, rng: np.random.Generator
) -> Measurement:
    """Return a test: modes with noise, a weighed mass, accelerances whose modes are the same."""
    count, sensors, own = len(case.used), case.measurement.sensors, solve_modes(model).elastic
    readings = np.asarray(model.observe(sensors) @ own.shapes)
    hertz, scatter = own.natural_frequencies, FREQUENCY_STD * rng.standard_normal(count)
    largest = np.nanmax(np.abs(case.measurement.shapes), axis=0)
    std = float(np.nanmedian(case.measurement.shape_std / largest))
    shapes = readings[:, :count] / np.abs(readings[:, :count]).max(axis=0)
    shapes = shapes * (1.0 + 0.5 * std * gains[:, None])
    shapes += 0.87 * std * rng.standard_normal(shapes.shape)
    damping = np.exp(rng.uniform(np.log(0.004), np.log(0.012), count))
    every, ratio = modes_of(model), np.append(1.0 + scatter, np.ones(len(own) - count))
    still = int(every.rigid.sum())
    modes = Modes(
        np.append(np.zeros(still), own.eigenvalues * ratio**2),
        np.hstack([every.shapes[:, every.rigid], own.shapes]),
        np.append(np.ones(still, dtype=bool), own.rigid),
    )
    rest = np.full(len(own) - count, np.median(damping))
    assert case.frfs is not None
    assert case.split is not None
    given = case.split.given(case.frfs)
    at = [sensors.labels.index(label) for label in given.responses.labels]
    force = sensors.take([sensors.labels.index(given.references.labels[0])])
    rows = model.observe(sensors.take(at)), model.observe(force)
    ratios = np.concatenate([np.zeros(still), damping, rest])
    clean = receptance(modes, *rows, lines, ratios)
    square = np.square(2.0 * np.pi * lines)[:, None, None]
    moved = clean * (1.0 + 0.5 * std * gains[at])[None, :, None] * square
    floor = MOTION_NOISE * float(np.median(np.abs(moved)))
    shape = len(lines), 1, 1
    push = FORCE_NOISE * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    noise = floor * (rng.standard_normal(moved.shape) + 1j * rng.standard_normal(moved.shape))
    deviations = np.hypot(FORCE_NOISE * np.abs(moved), floor) / square
    values = (moved * (1.0 + push) + noise) / square
    responses = FrequencyResponses(sensors.take(at), force, lines, values, "receptance", deviations)
    mass = model.total_mass * (1.0 + MASS_STD * float(rng.standard_normal()))
    return Measurement(
        *(sensors, tuple(range(1, count + 1)), hertz[:count] * (1.0 + scatter)),
        *(FREQUENCY_STD * hertz[:count], damping, shapes, np.full(shapes.shape, std)),
        total_mass=(mass, MASS_STD * mass),
        responses=responses,
    )


def change_of(first: Model, second: Model, test: Measurement) -> tuple[float, float]:
    """Return chi-square and the largest relative change of a frequency between two models."""
    data, seen = Data(test, np.zeros(0)), []
    for model in (first, second):
        modes = solve_modes(model).elastic
        read = np.asarray(model.observe(test.sensors) @ modes.shapes)
        hertz = modes.natural_frequencies
        partner = data.pair(hertz[None], read[None])[0]
        mass = np.array([model.total_mass])
        rows = data.residual(hertz[None, partner], read[None][:, :, partner], mass)[0]
        seen.append((rows, hertz[partner]))
    moved = seen[1][1] / seen[0][1] - 1.0
    return float(np.square(seen[1][0] - seen[0][0]).sum()), float(np.abs(moved).max())


def hidden(name: str, seed: int) -> tuple[Case, KnownCase] | None:
    """Return a case with a reference and responses of both, and what it hides; None for none."""
    case, word = read_case(FOLDER / name), zlib.crc32(name.encode())
    rng = np.random.default_rng([word, seed])
    count = len(case.used)
    gains = np.random.default_rng([word, seed, 1]).standard_normal(len(case.measurement.sensors))
    for _ in range(ATTEMPTS):
        frame = drawn_otherwise(case, np.random.default_rng([word, seed, 7]))
        kind = str(rng.choice(KINDS))
        effect = EFFECTS[kind]
        places = list(effect.places(case.model))
        if not places:
            continue
        place = str(rng.choice(places))
        parameters = tuple(effect.parameters(case.model, place))
        whole = Model.of(frame)
        hertz = solve_modes(whole).elastic.natural_frequencies
        site = Site(frame, place, case.model.total_mass, hertz)
        values = draw_values(effect.sizes, parameters, site, rng)
        names, units = (tuple(getattr(p, key) for p in parameters) for key in ("name", "unit"))
        cause = HiddenCause(kind, place, names, values, units)
        lines = np.geomspace(0.5 * hertz[0], np.sqrt(hertz[count - 1] * hertz[count]), LINES)
        try:
            changed = Model.of(with_causes(frame, [cause], EFFECTS))
            before, after = (
                tested(model, case, gains, lines, np.random.default_rng([seed, k]))
                for model, k in ((whole, 2), (changed, 3))
            )
            chi2, moved = change_of(whole, changed, before)
        except FemubenchError:
            continue
        if VISIBLE[0] <= chi2 <= VISIBLE[1] and moved <= 0.3:
            break
    else:
        return None
    posed = replace(
        case,
        measurement=replace(after, responses=None),
        used=after.numbers,
        held_out=(),
        modifications=(),
        reference=before,
        reference_used=before.numbers,
        frfs=after.responses,
        split=ResponseSplit(((0.0, 2.0 * float(lines[-1])),)),
        band=None,
    )
    causes = (TrueCause(str(cause), kind, place, (), None, ""),)
    return posed, KnownCase(f"{name}-{kind}-{seed}", name, "defect", seed, causes, chi2, 0.0, 0)


def judged(case: Case, truth: KnownCase, budget: float | None) -> Iterator[tuple[str, float]]:
    """Yield outcome and probability by modes alone, then with the responses of both states."""
    bare = replace(case, frfs=None, split=None)
    for posed in (bare, case):
        answer = Answer.of(diagnose(posed, effort=Effort(budget)))
        same = same_place(case.model.frame_structure.frame)
        yield outcome(truth, record_of(answer), same), float(answer.probability or 0.0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print one line a case, and how many of each outcome there are."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--structures", nargs="*", default=NAMES)
    parser.add_argument("--budget", type=float, help="seconds of a diagnosis; no end by default")
    options = parser.parse_args(arguments)
    totals: dict[str, list[int]] = {}
    with threadpool_limits(1):
        for seed in options.seeds:
            for name in options.structures:
                if (found := hidden(name, seed)) is None:
                    continue
                rows = list(judged(*found, options.budget))
                print(f"{found[1].name:40} {found[1].chi2:6.0f}", *rows, flush=True)
                for k, (word, _) in enumerate(rows):
                    totals.setdefault(word, [0, 0])[k] += 1
    for word, (modes, both) in sorted(totals.items()):
        print(f"{word:14} modes {modes:3}  with antiresonances {both:3}")


if __name__ == "__main__":
    main(sys.argv[1:])
