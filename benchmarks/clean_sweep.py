"""Diagnose clean data next to coarse models: what is blamed though nothing is wrong.

    python benchmarks/clean_sweep.py 75             # seeds 0 to 74: 300 data sets; appends, goes on
    python benchmarks/clean_sweep.py 75 --first 1000 --seconds 480

A seed gives a shear frame and a frame of the blind cases, each without and with a reference. The
drawing is 2 to 10 % off in the frequencies of the used modes: masses, moduli and joints differ.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1]))  # the truths are not installed

from blind_sweep import Record
from sweep_data import as_markdown

from femubench import read_case
from femubench.core.case.case import Case
from femubench.core.challenge.answer import Answer
from femubench.core.challenge.measuring import QUALITY, add_mass, record, see
from femubench.core.challenge.structures import STRUCTURES, structure_named
from femubench.core.challenge.truth import finer
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.fem.frame import Factor
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import solve_modes
from truths.shear_cases import structure_files
from truths.shear_frames import Plan
from truths.suite import write_files

RESULTS = Path(__file__).parents[1] / "femubench-results" / "clean-sweep.jsonl"
LEAST, MOST = 0.02, 0.10  # rms of the drawing's error in the used frequencies


def shear_case(seed: int, coarse: float, reference: bool) -> Case:
    """Return a shear frame of 3 to 8 storeys whose drawing is off by a factor of the usual."""
    rng = np.random.default_rng((seed, 1))
    storeys, hangs = int(rng.integers(3, 9)), bool(rng.random() < 0.5)
    used = int(rng.integers(2, 5 if storeys > 3 else 4))
    floors = range(0 if hangs else 1, storeys + 1)
    read = sorted(rng.choice(floors, int(rng.integers(2, len(floors) + 1)), replace=False).tolist())
    declared = hangs and bool(rng.random() < 0.5)
    plan = Plan("clean", storeys, hangs, used, 0, tuple(read), seed, declared, hangs, coarse)
    with tempfile.TemporaryDirectory() as folder:
        write_files(Path(folder), structure_files(plan))
        case = read_case(Path(folder))
        if not reference:
            return case
        write_files(Path(folder), structure_files(plan, 7))
        before = read_case(Path(folder)).measurement
    return replace(case, reference=before, reference_used=case.used)


def frame_case(seed: int, coarse: float, reference: bool) -> Case:
    """Return a frame of the blind cases with other moduli, densities and joints than drawn."""
    rng = np.random.default_rng((seed, 2))
    specimen = structure_named(STRUCTURES[seed % len(STRUCTURES)])
    names = [member.name for member in specimen.frame.members]
    draws = np.exp(coarse * 0.1 * (rng.standard_normal((len(names), 2)) + rng.standard_normal(2)))
    factors = tuple(
        Factor(quantity, (name,), float(value))
        for name, row in zip(names, draws, strict=True)
        for quantity, value in zip(("E", "density"), row, strict=True)
    )
    frame, soft = finer(specimen.frame), float(np.exp(-coarse * rng.uniform(0.0, 0.5)))
    factors += tuple(
        Factor("E", (f"{member.name}/{end}",), soft)
        for member in frame.members
        for end in {1, member.elements}
    )
    frame = replace(frame, factors=frame.factors + factors)
    seen, quality = see(Model.of(frame), specimen), QUALITY["A"]
    count = quality.used + quality.held_out
    tests = [record(seen, specimen, "A", count, rng, shapes_up_to=quality.shapes) for _ in range(2)]
    if rng.random() < 0.5:
        tests = [add_mass(test, seen.mass, rng) for test in tests]
    used = tuple(range(1, quality.used + 1))
    return Case(
        *("clean", specimen.title, "computed", Path("clean"), specimen.model, tests[0]),
        used=used,
        held_out=tuple(range(quality.used + 1, count + 1)),
        **({"reference": tests[1], "reference_used": used} if reference else {}),  # type: ignore[arg-type]
    )


def error_of(case: Case) -> float:
    """Return the rms of the model's relative error in the used frequencies, in their order."""
    measured = case.measurement.select(case.used).frequencies
    predicted = solve_modes(case.model).elastic.natural_frequencies[: len(measured)]
    return float(np.sqrt(np.mean((predicted / measured - 1.0) ** 2)))


def made(make: Callable[[float], Case], wanted: float) -> Case:
    """Return the case whose model is nearest to so much off."""
    cases = map(make, np.geomspace(0.2, 6.0, 12))
    return min(cases, key=lambda case: abs(np.log(error_of(case) / wanted)))


def diagnosed(seed: int, family: str, reference: bool) -> Record:
    """Return what is said of one clean data set, and what of it is false."""
    wanted = float(np.random.default_rng(seed).uniform(LEAST, MOST))
    maker = {"shear": shear_case, "frame": frame_case}[family]
    case = made(partial(maker, seed, reference=reference), wanted)
    begin = time.process_time()
    with threadpool_limits(1):
        answer = Answer.of(diagnose(case))
    said = [
        (cause.effect, cause.place, cause.side, cause.probability)
        for cause in answer.causes
        if answer.verdict in ("named", "ambiguous") or cause.side != "model"
    ]
    cause = answer.verdict in ("named", "ambiguous") and any(s[2] == "model" for s in said)
    return {
        **{"seed": seed, "family": family, "reference": reference, "off": error_of(case)},
        **{"verdict": answer.verdict, "said": said, "seconds": time.process_time() - begin},
        "fault": any(side != "model" for _, _, side, _ in said),
        "cause": bool(cause and reference),
    }


def rows(records: Iterable[Record]) -> list[dict[str, str]]:
    """Return one row a family, without and with a reference."""
    groups: dict[tuple[str, bool], list[Record]] = {}
    for one in records:
        groups.setdefault((one["family"], one["reference"]), []).append(one)
    return [
        {
            "data": f"{family}, {'with' if reference else 'without'} reference",
            "sets": str(len(own)),
            "drawing off, % rms": f"{100.0 * np.mean([one['off'] for one in own]):.1f}",
            "fault of data or input named": str(sum(one["fault"] for one in own)),
            "cause named": str(sum(one["cause"] for one in own)) if reference else "-",
            "seconds": f"{sum(one['seconds'] for one in own):.0f}",
        }
        for (family, reference), own in sorted(groups.items())
    ]


def main() -> None:
    """Diagnose what is not in the results yet, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("seeds", type=int, help="number of seeds, four data sets each")
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--sets", type=int, help="at most so many data sets")
    parser.add_argument("--seconds", type=float, default=np.inf, help="of the processor, in all")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    options.results.touch()
    records = [json.loads(line) for line in options.results.read_text().splitlines()]
    known = {(one["seed"], one["family"], one["reference"]) for one in records}
    seeds = range(options.first, options.first + options.seeds)
    tasks = [(s, f, r) for s in seeds for f in ("shear", "frame") for r in (False, True)]
    with options.results.open("a") as stream:
        for task in tasks[: options.sets]:
            if task not in known and time.process_time() < options.seconds:
                records.append(diagnosed(*task))
                stream.write(json.dumps(records[-1]) + "\n")
                stream.flush()
                print(*records[-1].values(), file=sys.stderr)
    print(as_markdown(rows(one for one in records if one["seed"] in seeds)))


if __name__ == "__main__":
    main()
