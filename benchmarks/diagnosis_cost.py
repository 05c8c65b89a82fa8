"""What a diagnosis of a large model costs, in eigen-solves of the same model, and its memory.

    python benchmarks/diagnosis_cost.py [lattice | ladder | building | frame | hframe ...]

Prints processor time of the diagnosis, that of one solution for the modes that it asks for, their
ratio, what is left of it for every hypothesis, and the largest memory of a fresh process.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from femubench.core.case.case import Case
from femubench.core.case.reader import read_case
from femubench.core.change.hypothesis import by_themselves, hypotheses_of
from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.fem.frame import Frame, Joint, Material, Member, Plane
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.plugin.loader import list_effects

USED, HELD_OUT = 8, 4
MODES = 6 + 4 * USED + 20  # that a diagnosis of so many used modes asks for
SOLVES, MILLISECONDS, MEGABYTES = 60.0, 2.0, 600.0  # what is asked for
_SEED = 16
_ALUMINIUM = Material(70e9, 0.33, 2700.0)
_SCENARIOS = Path(str(files("femubench.scenarios")))
_SECTION = Section.rectangular_tube(0.06, 0.03, 0.003)


@dataclass(frozen=True)
class Cost:
    """What one diagnosis costs.

    Arguments:
        dofs, members, hypotheses: of the case.
        solve, diagnosis: processor time in s of one solution for its modes, and in all.
        megabytes: the largest memory of the process.
        verdict, cause, size: the first name, and the value of its parameter.
    """

    dofs: int
    members: int
    hypotheses: int
    solve: float
    diagnosis: float
    megabytes: float
    verdict: str
    cause: str
    size: float

    @property
    def solves(self) -> float:
        """Return the time in solutions."""
        return self.diagnosis / self.solve

    @property
    def beyond(self) -> float:
        """Return what is asked for more than a constant number of solutions, ms a hypothesis."""
        return 1e3 * (self.diagnosis - SOLVES * self.solve) / self.hypotheses


def lattice(bays: tuple[int, int, int], elements: int) -> Frame:
    """Return a free lattice of so many bays along x, y and z, its joints a little off the grid."""
    rng = np.random.default_rng(0)
    grid = [tuple(int(i) for i in at) for at in np.ndindex(*(count + 1 for count in bays))]
    offsets = 0.03 * rng.standard_normal((len(grid), 3))
    at = np.array(grid) * (1.0, 0.8, 0.9) + offsets
    points = zip(grid, at.tolist(), strict=True)
    joints = tuple(Joint(_name(*i), (p[0], p[1], p[2])) for i, p in points)
    members = []
    for place in grid:
        for axis in range(3):
            other = tuple(i + (k == axis) for k, i in enumerate(place))
            if other[axis] <= bays[axis]:
                name = f"m{len(members) + 1}"
                ends = _name(*place), _name(*other)
                members.append(Member(name, ends, elements, _SECTION, _ALUMINIUM))
    return Frame("3d", "timoshenko", joints, tuple(members), rotary_inertia=True)


def ladder(bays: int, elements: int) -> Frame:
    """Return a free ladder that vibrates out of its plane."""
    side = np.cumsum(np.linspace(0.5, 0.7, bays + 1))
    joints = [
        Joint(f"{k}{i}", (float(x), 0.4 * k, 0.0)) for k in (0, 1) for i, x in enumerate(side)
    ]
    ends = [(f"0{i}", f"1{i}") for i in range(bays + 1)]
    ends += [(f"{k}{i}", f"{k}{i + 1}") for k in (0, 1) for i in range(bays)]
    members = tuple(
        Member(f"m{n}", pair, elements, _SECTION, _ALUMINIUM) for n, pair in enumerate(ends, 1)
    )
    plane: Plane = "out-of-plane"
    return Frame(plane, "timoshenko", tuple(joints), members, rotary_inertia=True)


def _name(*at: int) -> str:
    return "J{}.{}.{}".format(*at)


def case_of(frame: Frame, directions: str, sensors: int, damage: float = -0.15) -> Case:
    """Return a case whose truth is a member with other stiffness, simulated with scatter.

    Arguments:
        frame: the nominal structure; its middle member is the one.
        directions: in which every chosen joint is measured.
        sensors: number of joints that are measured, evenly chosen.
        damage: relative change of the stiffness.
    """
    model = Model.of(frame)
    member = frame.members[len(frame.members) // 2].name
    effect = next(e for e in list_effects() if e.name == "member-stiffness")
    truth = effect.extend(model, member, [damage])
    which = np.unique(np.linspace(0, len(frame.joints) - 1, sensors).astype(int))
    points = [(frame.joints[i], d) for i in which for d in directions]
    where = Sensors(
        tuple(f"{joint.name}:{d}" for joint, d in points),
        np.array([joint.xyz for joint, _ in points]),
        tuple(d for _, d in points),
    )
    rng, count = np.random.default_rng(_SEED), USED + HELD_OUT
    modes = solve_modes(truth, count + 10).elastic
    frequencies = modes.natural_frequencies[:count]
    shapes = np.asarray(truth.observe(where) @ modes.shapes[:, :count])
    shapes = shapes / np.abs(shapes).max(axis=0) + 0.01 * rng.standard_normal(shapes.shape)
    std = 0.001 * frequencies
    measurement = Measurement(
        where,
        tuple(range(1, count + 1)),
        frequencies + std * rng.standard_normal(count),
        std,
        np.full(count, np.nan),
        shapes,
        np.full(shapes.shape, 0.01),
    )
    used, held_out = tuple(range(1, USED + 1)), tuple(range(USED + 1, count + 1))
    return Case("cost", "", "", Path(), Model.of(frame), measurement, used, held_out)


CASES: dict[str, Callable[[], Case]] = {
    "lattice": lambda: case_of(lattice((3, 3, 3), 3), "xyz", 16),
    "lattice dense": lambda: case_of(lattice((3, 3, 3), 3), "xyz", 64),
    "ladder": lambda: case_of(ladder(3, 1000), "z", 8),
    "building": lambda: case_of(lattice((2, 4, 5), 25), "xyz", 16, -0.5),
    "frame": lambda: read_case(_SCENARIOS / "frame"),
    "hframe": lambda: read_case(_SCENARIOS / "hframe"),
}


def measured(name: str) -> tuple[Cost, Diagnosis]:
    """Return what the diagnosis of a case costs in this process, and what it says."""
    with threadpool_limits(1):
        case = CASES[name]()
        frame = case.model.frame_structure.frame
        solve = min(_seconds(lambda: solve_modes(case.model, MODES)) for _ in range(3))
        begin = time.process_time()
        found = diagnose(case)
        seconds = time.process_time() - begin
    known = hypotheses_of(case.model, by_themselves(list_effects()))
    first = found.causes[0] if found.causes else None
    return Cost(
        case.model.size,
        len(frame.members),
        len(known),
        solve,
        seconds,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        found.verdict,
        " + ".join(f"{cause.effect} at {cause.place}" for cause in found.causes),
        first.parameters[0].value if first is not None and first.parameters else float("nan"),
    ), found


def _seconds(job: Callable[[], object]) -> float:
    begin = time.process_time()
    job()
    return time.process_time() - begin


def cost_of(name: str) -> Cost:
    """Return what the diagnosis of a case costs in a fresh process, of which memory counts."""
    done = subprocess.run(
        [sys.executable, __file__, "--here", name], check=True, capture_output=True, text=True
    )
    return Cost(**json.loads(done.stdout.splitlines()[-1]))


def main(names: Sequence[str]) -> None:
    """Measure and print."""
    if names[:1] == ["--here"]:
        print(json.dumps(asdict(measured(names[1])[0])))
        return
    for name in names or list(CASES):
        cost = cost_of(name)
        print(
            f"{name}: {cost.dofs} dofs, {cost.members} members, {cost.hypotheses} hypotheses; "
            f"{cost.diagnosis:.1f} s, {cost.solves:.0f} solves of {cost.solve:.3f} s, "
            f"{cost.beyond:.2f} ms a hypothesis beyond {SOLVES:g}, {cost.megabytes:.0f} MB; "
            f"{cost.verdict}: {cost.cause} {cost.size:.4g}"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
