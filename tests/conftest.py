"""Budgets of processor time, and structures that several tests share as fixtures."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from femubench.core.fem.sections import Section
from femubench.fem import Frame, Joint, JointSpring, Material, Member, Place, PointMass, RigidEnd

FrameBuilder = Callable[..., Frame]

# What a shell starts in the background ignores Ctrl-C, and so does all that it starts itself: tests
# that send one would wait for ever.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

UNMARKED = 2.0  # s of a processor that a test without the marker `slow` takes at most
# A test fails above so many times its budget: what it shares is charged to the first that asks for
# it, and a busy machine takes longer for the same.
TOLERANCE = 5.0
_STARTED = pytest.StashKey[float]()

HALF_SIDE, RUNG = 0.2921, 0.2794  # m
ALUMINIUM = Material(68.367e9, 0.33, 2700.0)  # sqrt(E / rho) = 5032 m/s
STEEL_E, EI, EA, RHO_A = 207e9, 17015.0, 7.420e7, 2.814
COMPASS = {"out-of-plane": (0, 1, 2), "3d": (0, 1, 2), "in-plane": (0, 2, 1)}  # axes of a drawing


PORTAL_JOINTS = (
    JointSpring("J1", "m0", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J1", "m1", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J1", "m8", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
    JointSpring("J3", "m3", {"x": 1e6, "ry": 2e3}),
    JointSpring("J6", "m5", {"x": 1e7, "z": 1e7, "ry": 1e4}, 0.02, 5.0),
)
PORTAL_ENDS = (RigidEnd("J4", "m4", -0.03), RigidEnd("J5", "m8", 0.03, 0.02))
PORTAL_MASSES = (
    PointMass(Place(member="m2", s=0.37), 0.5, (0.1, 0.2, -0.1)),
    PointMass(Place(joint="J0"), 0.5, (0.1, 0.2, -0.1)),
)


def build_ladder(
    beam: str = "euler-bernoulli",
    *,
    polar: bool = True,
    elements: int = 4,
    E: float = ALUMINIUM.E,
    accelerometer: bool = True,
    stretch: float = 1.0,
    plane: str = "out-of-plane",
) -> Frame:
    """Return the ladder "8" of the first paper; joints A B C on one side, D E F on the other.

    Arguments:
        polar: torsion constant equal to the polar moment, as the paper has it.
        stretch: factor on the half side between E and F.
    """
    tube = Section.rectangular_tube(0.0254, 0.0254, 0.00238)
    section = replace(tube, J=tube.Jp) if polar else tube
    material = replace(ALUMINIUM, E=E)
    x = {"A": 0.0, "B": HALF_SIDE, "C": 2 * HALF_SIDE, "D": 0.0, "E": HALF_SIDE}
    x["F"] = HALF_SIDE * (1.0 + stretch)
    flat = {name: (x[name], 0.0 if name in "ABC" else RUNG, 0.0) for name in "ABCDEF"}
    joints = tuple(
        Joint(name, tuple(xyz[i] for i in COMPASS[plane]), "T" if name in "BE" else "L")  # type: ignore[arg-type]
        for name, xyz in flat.items()
    )
    pairs = ("AB", "BC", "DE", "EF", "AD", "BE", "CF")
    members = tuple(Member(p, (p[0], p[1]), elements, section, material) for p in pairs)
    masses = (PointMass(Place(joint="A"), 0.0266),) if accelerometer else ()
    return Frame(plane, beam, joints, members, masses=masses)  # type: ignore[arg-type]


def build_hframe(
    *,
    mesh: tuple[int, int, int] = (16, 8, 16),
    accelerometers: bool = True,
    joint_springs: tuple[JointSpring, ...] = (),
    rigid_ends: tuple[RigidEnd, ...] = (),
) -> Frame:
    """Return the H-frame of the second paper; mesh = elements of horizontal, lower, upper."""
    section = Section(A=EA / STEEL_E, Iy=EI / STEEL_E, Iz=EI / STEEL_E, J=0.0, Jp=0.0)
    material = Material(STEEL_E, 0.3, RHO_A / section.A)
    joints = []
    for side, x in (("1", 0.0), ("2", 0.74)):
        joints += [
            Joint("L" + side, (x, 0.0, -0.3)),
            Joint("T" + side, (x, 0.0, 0.0), "T"),
            Joint("U" + side, (x, 0.0, 0.5)),
        ]
    members = [Member("horizontal", ("T1", "T2"), mesh[0], section, material)]
    for side in "12":
        members += [
            Member("lower" + side, ("L" + side, "T" + side), mesh[1], section, material),
            Member("upper" + side, ("T" + side, "U" + side), mesh[2], section, material),
        ]
    masses = (
        PointMass(Place(member="horizontal", s=0.23125 / 0.74), 0.0512, (0.0, 0.0, 0.0355)),
        PointMass(Place(member="lower1", s=0.0375 / 0.3), 0.0512),
    )
    return Frame(
        "in-plane",
        "euler-bernoulli",
        tuple(joints),
        tuple(members),
        masses=masses if accelerometers else (),
        joint_springs=joint_springs,
        rigid_ends=rigid_ends,
    )


def build_asymmetric(softness: float = 1.0, **options: Any) -> Frame:
    """Return the ladder with one half side 4 % longer and one softer joint.

    Arguments:
        softness: factor on the compliance of the springs at joint F.
    """
    frame = build_ladder(stretch=1.04, **options)
    springs = tuple(
        JointSpring("F", member, {"rx": 3.0e4 / softness, "ry": 1.5e4 / softness}, 0.0127)
        for member in ("EF", "CF")
    )
    return replace(frame, joint_springs=springs)


def build_portal(seed: int, beam: str = "timoshenko", elements: int = 2, **parts: Any) -> Frame:
    """Return a 3-D frame of nine members between seven random points, none along an axis."""
    rng = np.random.default_rng(seed)
    section = replace(
        Section.rectangular_tube(0.04, 0.03, 0.002), kappa=Section.constant_kappa(0.44)
    )
    material = Material(70e9, 0.3, 2700.0)
    points = rng.uniform(-0.5, 0.5, (7, 3)) + np.linspace(0.0, 2.0, 7)[:, None] * [1.0, 0.3, -0.2]
    joints = tuple(Joint(f"J{i}", (p[0], p[1], p[2])) for i, p in enumerate(points.tolist()))
    edges = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (0, 3), (2, 6), (1, 5))
    members = []
    for k, (a, b) in enumerate(edges):
        x, y, z = (float(v) for v in rng.normal(size=3))
        ends = (f"J{a}", f"J{b}")
        members.append(Member(f"m{k}", ends, elements, section, material, (x, y, z)))
    return Frame("3d", beam, joints, tuple(members), **parts)  # type: ignore[arg-type]


def processor_time() -> float:
    """Return the seconds that this process and its children that have ended took."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None]:
    item.stash[_STARTED] = processor_time()
    yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None]:
    yield
    if item.get_closest_marker("nightly"):
        return
    slow = item.get_closest_marker("slow")
    budget = slow.args[0] if slow else UNMARKED
    used = processor_time() - item.stash[_STARTED]
    if used > TOLERANCE * budget:
        pytest.fail(
            f"took {used:.0f} s of a processor, its budget is {budget:g} s: make it cheaper, or "
            "mark it with `slow(seconds)`"
        )


@pytest.fixture(scope="session", autouse=True)
def say_no_progress_by_the_clock() -> Iterator[None]:
    """Where a machine is busy, lines of progress would stand among those that tests compare."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("femubench.core.cli.progress.EVERY", 1e6)
        yield


@pytest.fixture(scope="session", autouse=True)
def one_thread() -> Iterator[None]:
    """Keep linear algebra to one thread: matrices are small, and threads only wait for another."""
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="session")
def ladder() -> FrameBuilder:
    return build_ladder


@pytest.fixture(scope="session")
def hframe() -> FrameBuilder:
    return build_hframe


@pytest.fixture(scope="session")
def asymmetric_ladder() -> FrameBuilder:
    return build_asymmetric


@pytest.fixture(scope="session")
def portal() -> FrameBuilder:
    return build_portal


@pytest.fixture(scope="session")
def fitted_portal() -> FrameBuilder:
    """Return the portal with flexible joints, partly rigid ends and offset masses."""
    return partial(
        build_portal,
        joint_springs=PORTAL_JOINTS,
        rigid_ends=PORTAL_ENDS,
        masses=PORTAL_MASSES,
    )
