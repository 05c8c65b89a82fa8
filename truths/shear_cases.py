"""Cases of shear frames by SciPy, a third generator: ``python -m truths.shear_cases``.

Ten frames of three to eight storeys, hanging on rails or fixed, with three states each. The drawing
is a chain of masses and springs, some percent off the truth of `shear_frames`. Masses and soft
storeys are solved as eigenvalue problems; a bumper is a contact in time, its modes are identified
(`shear_bumpers`). Frequencies scatter by 0.2 %, shapes by 2 % of their largest reading.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from itertools import count

import numpy as np
import pandas as pd
import tomlkit
from scipy import io, sparse

from femubench.core.challenge.truth_file import KnownCase, TrueCause, is_held
from truths.opensees_cases import Observed, recorded, visible, weighed
from truths.posing import SHEAR, SHEAR_STRUCTURES
from truths.shear_bumpers import Bumper, identify
from truths.shear_frames import (
    HEIGHT,
    MASS,
    STIFFNESS,
    Array,
    Frame,
    Plan,
    built,
    drawn,
    modes,
    plans,
    readings,
    storey_matrix,
    with_loss,
    with_mass,
)
from truths.suite import write_files
from truths.truth_text import truth_text

SEED, SHAPE_SCATTER = 53_000, 0.02
# The three states of each of five frames, of development and then of the held ones.
STATES = (
    ("storey", "mass", "bumper"),
    ("storey", "clean", "stop"),
    ("storey", "mass", "clean"),
    ("storey", "mass", "clean"),
    ("storey", "mass", "bumper"),
)


@dataclass(frozen=True)
class Fault:
    """What is wrong, the frame that has it, and the bumper that touches, if one does."""

    cause: TrueCause
    frame: Frame
    bumper: Bumper | None = None


@dataclass(frozen=True)
class Draw:
    """What one case hides."""

    name: str
    plan: Plan
    seed: int
    fault: Fault | None

    @property
    def frame(self) -> Frame:
        """Return the frame as it is, without a bumper."""
        return built(self.plan) if self.fault is None else self.fault.frame


def mass_fault(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a mass of 8 to 40 % of a floor on one of them."""
    floor = int(rng.choice(plan.masses))
    mass = MASS * float(np.exp(rng.uniform(np.log(0.08), np.log(0.4))))
    what = f"{mass:.2g} kg on floor {floor}"
    cause = TrueCause(what, "added-mass", f"f{floor}", size=mass, unit="kg")
    return Fault(cause, with_mass(built(plan), floor, mass))


def storey_fault(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a storey that is softer by 10 to 50 %."""
    storey, loss = int(rng.integers(1, plan.storeys + 1)), float(rng.uniform(0.1, 0.5))
    what = f"storey {storey} softer by {100 * loss:.0f} %"
    cause = TrueCause(what, "member-stiffness", f"group:storey-{storey}", size=-loss)
    return Fault(cause, with_loss(built(plan), storey, loss))


def stop_fault(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a bumper on the ground, at any floor of a fixed frame but the first."""
    floor = int(rng.integers(2, plan.storeys + 1))
    words = f"f{floor}:x", f"f{floor}"
    return _touching(f"floor {floor} and the ground", rng, plan, (-1, floor), *words)


def bumper_fault(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a bumper between neighbouring floors, where a spring is what stiffens their storey."""
    floor = int(rng.integers(plan.masses[0] + 1, plan.storeys + 1))
    ends = floor - 1, floor
    words = f"f{ends[0]}-f{floor}", f"f{ends[0]}-f{floor}:x"
    stiffer = f"member-stiffness@group:storey-{floor}"
    return _touching(f"floors {ends[0]} and {floor}", rng, plan, ends, *words, stiffer)


def _touching(
    where: str,
    rng: np.random.Generator,
    plan: Plan,
    ends: tuple[int, int],
    place: str,
    other: str,
    *also: str,
) -> Fault:
    """Return a bumper of 0.3 to 1.5 storeys that touches at half the usual motion or always."""
    stiffness = STIFFNESS * float(np.exp(rng.uniform(np.log(0.3), np.log(1.5))))
    bumper = Bumper(*ends, stiffness, gap=float(rng.uniform(-0.5, 0.5)))
    effect = "grounding-spring" if ends[0] < 0 else "interface-spring"
    what = f"a bumper of {stiffness:.2g} N/m between {where} touches"
    cause = TrueCause(what, effect, place, (f"{effect}@{other}", *also))
    return Fault(cause, built(plan), bumper)


FAULTS: dict[str, Callable[[Plan, np.random.Generator], Fault]] = {
    "mass": mass_fault,
    "storey": storey_fault,
    "bumper": bumper_fault,
    "stop": stop_fault,
}


def draws() -> list[Draw]:
    """Return all cases, the same ones each time.

    The half follows from the name: its number is the first one that gives the half of its frame.
    """
    found: list[Draw] = []
    for i, plan in enumerate(plans()):
        for word in STATES[i % len(STATES)]:
            seed = SEED + len(found)
            held = i >= len(STATES)
            names = (f"{plan.name}-{word}-{number}" for number in count(1))
            name = next(name for name in names if is_held(name) is held)
            make = FAULTS.get(word)
            fault = None if make is None else make(plan, np.random.default_rng(seed))
            found.append(Draw(name, plan, seed, fault))
    return found


def observed(draw: Draw) -> Observed:
    """Return the elastic modes that a test reads of a case, without scatter."""
    plan, many = draw.plan, draw.plan.used + draw.plan.held_out
    bumper = None if draw.fault is None else draw.fault.bumper
    if bumper is None:
        omega, shapes = modes(draw.frame)
        omega, shapes = omega[omega > 0.0][:many], shapes[omega > 0.0][:many]
    else:
        omega, shapes = identify(draw.frame, bumper, many, draw.seed)
    return Observed(omega / (2.0 * np.pi), readings(plan, shapes))


def healthy(plan: Plan) -> Observed:
    """Return the elastic modes of a frame without fault."""
    return observed(Draw(plan.name, plan, plan.seed, None))


def files_of(draw: Draw) -> dict[str, str]:
    """Return the text of every file of a case."""
    plan, before, after = draw.plan, healthy(draw.plan), observed(draw)
    causes = () if draw.fault is None else (draw.fault.cause,)
    change = visible(plan.used, before, after, SHAPE_SCATTER) if causes else (0.0, 0.0, 0)
    truth = KnownCase(
        *(draw.name, plan.name, "defect" if causes else "clean", draw.seed, causes, *change),
        mass=weighed(draw.frame.mass, draw.seed, 3) if plan.weighed else None,
    )
    return {
        "truth.toml": truth_text(truth),
        "modes.csv": recorded(plan.labels, after, draw.seed, 1, shape_scatter=SHAPE_SCATTER),
        "healthy.csv": recorded(plan.labels, before, draw.seed, 2, shape_scatter=SHAPE_SCATTER),
    }


def case_text(plan: Plan) -> str:
    """Return `case.toml` of a frame as drawn."""
    names = [f"storey-{k}" for k in range(1, plan.storeys + 1)]
    model = {
        "kind": "matrices",
        **({"free": True} if plan.declared else {}),
        "mass": "mass.mtx",
        "stiffness": "stiffness.mtx",
        "dofs": "dofs.csv",
        "groups": [{"name": name, "stiffness": f"{name}.mtx"} for name in names],
    }
    measurement: dict[str, object] = {
        "sensors": "sensors.csv",
        "modes": "modes.csv",
        "shape_std": SHAPE_SCATTER,
        "used": list(range(1, plan.used + 1)),
        "held_out": list(range(plan.used + 1, plan.used + plan.held_out + 1)),
    }
    if plan.weighed:
        mass, std = weighed(built(plan).mass, plan.seed, 3)
        measurement["mass"] = {"value": mass, "std": std}
    title = f"Shear frame of {plan.storeys} storeys, {'on rails' if plan.hangs else 'fixed'}"
    source = "columns that bend and joints that turn (SciPy), scatter of a test added"
    about = {"name": plan.name, "title": title, "source": source}
    return tomlkit.dumps({"case": about, "model": model, "measurement": measurement})


def structure_files(plan: Plan, test: int = 0) -> dict[str, str]:
    """Return the text of every file of a frame as drawn, and of one of many tests of it."""
    masses, stiffness = drawn(plan)
    parts = {
        f"storey-{k}.mtx": storey_matrix(len(masses), k, plan.hangs, value)
        for k, value in enumerate(stiffness, 1)
    }
    parts |= {"mass.mtx": np.diag(masses), "stiffness.mtx": np.sum(list(parts.values()), axis=0)}
    dofs = [(i, f"f{floor}", "x", 0.0, 0.0, HEIGHT * floor) for i, floor in enumerate(plan.masses)]
    sensors = pd.DataFrame(plan.labels, columns=["label", "at", "direction"])
    return {
        "case.toml": case_text(plan),
        "dofs.csv": pd.DataFrame(dofs, columns=["row", "node", *"dxyz"])
        .rename(columns={"d": "direction"})
        .to_csv(index=False, float_format="%.3g"),
        "sensors.csv": sensors.to_csv(index=False),
        "modes.csv": recorded(
            plan.labels, healthy(plan), plan.seed, test, shape_scatter=SHAPE_SCATTER
        ),
        **{name: matrix_text(matrix) for name, matrix in parts.items()},
    }


def matrix_text(matrix: Array) -> str:
    """Return a symmetric matrix as Matrix Market has it."""
    stream = BytesIO()
    io.mmwrite(stream, sparse.coo_array(matrix), precision=10, symmetry="symmetric")
    return stream.getvalue().decode()


def write_all() -> None:
    """Write frames and cases anew."""
    shutil.rmtree(SHEAR, ignore_errors=True)
    for plan in plans():
        write_files(SHEAR_STRUCTURES / plan.name, structure_files(plan))
    for draw in draws():
        print(*write_files(SHEAR / draw.name, files_of(draw)), draw.seed, flush=True)


if __name__ == "__main__":
    write_all()
