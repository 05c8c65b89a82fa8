"""Cases by OpenSees, a second generator: ``python -m truths.opensees_cases``.

The truth is a frame of beams three times finer than the drawn one, solved by OpenSeesPy; nothing of
femubench makes it. Structures, effects, places and sizes are drawn from a seed.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd
import tomlkit

from femubench.core.challenge.truth_file import KnownCase, TrueCause
from truths.measurement import mac, paired, scaled
from truths.opensees_faults import OUTSIDE, SINGLES, Fault
from truths.opensees_frames import AXES, FREE, NU, RHO, Beams, E, Plan, cut, plans
from truths.opensees_modes import modes
from truths.posing import OPENSEES, STRUCTURES
from truths.suite import write_files
from truths.truth_text import rounded, truth_text

Array = npt.NDArray[np.float64]
SEED = 41_000
SCATTER, SHAPE_SCATTER, WEIGHED = 0.002, 0.015, 0.002
LEAST_HZ = 1.0  # below, a mode is a rigid motion
NEW_MODE, CLOSENESS = 0.5, 2.0  # as with the solids
COUNTS = {"defect": 14, "pair": 4, "outside": 3, "clean": 3}


@dataclass(frozen=True)
class Draw:
    """What one case hides."""

    name: str
    kind: str
    plan: Plan
    seed: int
    faults: tuple[Fault, ...] = ()


def draws() -> list[Draw]:
    """Return all cases, the same ones each time: kinds and structures in turn."""
    known = list(plans().values())
    found: list[Draw] = []
    for kind, count in COUNTS.items():
        words = list(OUTSIDE if kind == "outside" else SINGLES)
        for i in range(count):
            seed = SEED + len(found)
            rng = np.random.default_rng(seed)
            many = {"pair": 2, "clean": 0}.get(kind, 1)
            chosen = [words[(i + 4 * j) % len(words)] for j in range(many)]
            plan = known[len(found) % len(known)]
            faults = _faults(plan, chosen, rng)
            if not all(faults):  # a rod needs another plane
                plan = known[(len(found) + 1) % len(known)]
                faults = _faults(plan, chosen, rng)
            name = "-".join((plan.name, *(chosen or ["clean"]), str(i + 1)))
            parts = tuple(fault for fault in faults if fault is not None)
            found.append(Draw(name, kind, plan, seed, parts))
    return found


def _faults(plan: Plan, words: Sequence[str], rng: np.random.Generator) -> list[Fault | None]:
    return [(SINGLES | OUTSIDE)[word](plan, rng) for word in words]


@dataclass(frozen=True)
class Observed:
    """Elastic modes: frequencies in Hz, (m,), and readings at the sensors, (m, sensors)."""

    frequencies: Array
    shapes: Array


def observed(beams: Beams) -> Observed:
    """Return the modes of some beams at the sensors of their plan."""
    plan = beams.plan
    count = plan.used + plan.held_out
    found = modes(beams.frame(count + 4))
    hertz = np.sqrt(np.abs(np.array(found["eigenvalues"]))) / (2.0 * np.pi)
    motion = np.array(found["motion"])
    reads = [(beams.node(at), AXES.index(direction)) for _, at, direction in plan.labels]
    nodes, directions = (list(part) for part in zip(*reads, strict=True))
    keep = np.flatnonzero(hertz > LEAST_HZ)
    keep = keep[np.argsort(hertz[keep])][:count]
    return Observed(hertz[keep], motion[keep][:, nodes, directions])


def with_faults(draw: Draw) -> Beams:
    """Return the beams of a case."""
    beams = cut(draw.plan)
    for fault in draw.faults:
        fault.edit(beams)
    return beams


def recorded(
    labels: Sequence[tuple[str, str, str]],
    state: Observed,
    *seed: int,
    shape_scatter: float = SHAPE_SCATTER,
) -> str:
    """Return `modes.csv`: modes with the scatter of a test, as stated."""
    rng = np.random.default_rng(seed)
    frequencies = state.frequencies * (1.0 + SCATTER * rng.standard_normal(len(state.frequencies)))
    shapes = scaled(state.shapes) + shape_scatter * rng.standard_normal(state.shapes.shape)
    columns: dict[str, object] = {
        "mode": range(1, len(frequencies) + 1),
        "frequency": [f"{value:.6g}" for value in frequencies],
        "frequency_std": [f"{SCATTER * value:.2g}" for value in state.frequencies],
    }
    for (label, *_), column in zip(labels, scaled(shapes).T, strict=True):
        columns[label] = [f"{value:.4f}" for value in column]
    return pd.DataFrame(columns).to_csv(index=False)


def visible(
    used: int, before: Observed, after: Observed, shape_scatter: float = SHAPE_SCATTER
) -> tuple[float, float, int]:
    """Return chi-square of the change, its part of the frequencies, and how many modes appear."""
    one = before.frequencies[:used], before.shapes[:used]
    partner = paired(one, (after.frequencies, after.shapes), CLOSENESS)
    drift = (after.frequencies[partner] / one[0] - 1.0) / SCATTER
    healthy, changed = scaled(one[1]), after.shapes[partner]
    fit = (healthy * changed).sum(axis=1) / (changed**2).sum(axis=1)
    turned = (changed * fit[:, None] - healthy) / shape_scatter
    appears = int((mac(after.shapes[:used], before.shapes).max(axis=1) < NEW_MODE).sum())
    part = float((drift**2).sum())
    return part + float((turned**2).sum()), part, appears


def weighed(mass: float, *seed: int) -> tuple[float, float]:
    """Return what a balance reads in kg, and its deviation."""
    read = mass * (1.0 + WEIGHED * np.random.default_rng(seed).standard_normal())
    return float(f"{read:.5g}"), float(f"{mass * WEIGHED:.2g}")


def mass_of(beams: Beams) -> float:
    """Return the mass of all beams and lumps in kg."""
    total = sum(mass for _, mass in beams.masses)
    for bar in beams.elements:
        first, last = (np.array(beams.nodes[node]) for node in bar["ends"])
        total += float(bar["rhoA"] * np.linalg.norm(last - first))
    return total


def files_of(draw: Draw) -> dict[str, str]:
    """Return the text of every file of a case."""
    plan, beams = draw.plan, with_faults(draw)
    before, after = observed(cut(plan)), observed(beams)
    chi2, part, appears = visible(plan.used, before, after) if draw.faults else (0.0, 0.0, 0)
    causes = tuple(
        TrueCause(
            *(f.what, f.effect, f.place, f.also),
            size=None if f.size is None else rounded(f.size),
            unit=f.unit,
        )
        for f in draw.faults
    )
    truth = KnownCase(
        *(draw.name, plan.name, draw.kind, draw.seed, causes, chi2, part, appears),
        mass=weighed(mass_of(beams), draw.seed, 3),
    )
    return {
        "truth.toml": truth_text(truth),
        "modes.csv": recorded(plan.labels, after, draw.seed, 1),
        "healthy.csv": recorded(plan.labels, before, draw.seed, 2),
    }


def case_text(plan: Plan) -> str:
    """Return `case.toml` of a structure as drawn."""
    tubes = {
        name: {"shape": "round-tube", "diameter": tube.diameter, "wall": tube.wall}
        for name, tube in plan.tubes.items()
    }
    fixed = [f"{'r' if d > len(AXES) else ''}{AXES[(d - 1) % 3]}" for d in FREE[plan.plane]]
    mass, std = weighed(plan.mass, SEED)
    modes_in_all = plan.used + plan.held_out
    model = {
        "kind": "frame",
        "plane": plan.plane,
        "beam": "euler-bernoulli",
        "materials": {"steel": {"E": E, "nu": NU, "rho": RHO}},
        "sections": tubes,
        "joints": [
            {"name": name, "xyz": list(xyz), "type": kind}
            for name, (xyz, kind) in plan.joints.items()
        ],
        "members": [
            {
                "name": bar.name,
                "ends": list(bar.ends),
                "elements": bar.elements,
                "section": bar.tube,
                "material": "steel",
            }
            for bar in plan.bars
        ],
        "supports": [{"at": joint, "fixed": fixed} for joint in plan.clamped],
    }
    measurement = {
        "sensors": "sensors.csv",
        "modes": "modes.csv",
        "shape_std": SHAPE_SCATTER,
        "used": list(range(1, plan.used + 1)),
        "held_out": list(range(plan.used + 1, modes_in_all + 1)),
        "mass": {"value": mass, "std": std},
    }
    source = "beams three times finer (OpenSeesPy), scatter of a test added"
    about = {"name": plan.name, "title": plan.title, "source": source}
    return tomlkit.dumps({"case": about, "model": model, "measurement": measurement})


def structure_files(plan: Plan) -> dict[str, str]:
    """Return the text of every file of a structure."""
    sensors = pd.DataFrame(plan.labels, columns=["label", "at", "direction"])
    return {
        "case.toml": case_text(plan),
        "sensors.csv": sensors.to_csv(index=False),
        "modes.csv": recorded(plan.labels, observed(cut(plan)), SEED),
    }


def write_all() -> None:
    """Write structures and cases anew."""
    shutil.rmtree(OPENSEES, ignore_errors=True)
    for plan in plans().values():
        write_files(STRUCTURES / plan.name, structure_files(plan))
    for draw in draws():
        write_files(OPENSEES / draw.name, files_of(draw))


if __name__ == "__main__":
    write_all()
