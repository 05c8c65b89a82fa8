"""Joints that turn elsewhere than at the face, or about one axis more than about the other."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femubench import Model, diagnose
from femubench.fem import (
    Frame,
    Joint,
    JointSpring,
    Material,
    Member,
    Place,
    Support,
    rectangular_tube,
)
from femubench.plugins.effects.joint_rotation import JointRotation

sys.path.insert(0, str(Path(__file__).parent))
from diagnosis_problems import case_of, measured

TUBE, STEEL = rectangular_tube(0.06, 0.04, 0.003), Material(207e9, 0.3, 7850.0)


def portal(elements: int) -> Frame:
    """Return a portal on clamps, its corners of sections with sizes."""
    places = {"fl": (0.0, 0.0), "fr": (1.2, 0.0), "el": (0.0, 1.0), "er": (1.2, 1.0)}
    joints = tuple(Joint(name, (x, 0.0, z)) for name, (x, z) in places.items())
    ends = {"left": ("fl", "el"), "right": ("fr", "er"), "beam": ("el", "er")}
    members = tuple(Member(name, pair, elements, TUBE, STEEL) for name, pair in ends.items())
    feet = tuple(Support(Place(joint=j), ("x", "z", "ry")) for j in ("fl", "fr"))
    return Frame("in-plane", "euler-bernoulli", joints, members, supports=feet)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_spring_at_the_axis_is_found_with_its_stiffness(seed: int) -> None:
    """The members have a depth, but the joint turns where their axes meet."""
    stiffness = 5.25e4
    spring = JointSpring("er", "beam", {"ry": stiffness})
    truth = replace(portal(12), joint_springs=(spring,))
    test = measured(Model.of(truth), portal(4), count=7, rng=np.random.default_rng(seed))
    found = diagnose(case_of(Model.of(portal(4)), test, 5))
    cause = found.causes[0]
    assert (cause.effect, cause.place) == ("joint-rotation", "er:apart")
    bending, arm = cause.parameters
    # At a joint of two members both ends have the spring, in series.
    assert bending.std is not None
    assert abs(0.5 * bending.value - stiffness) < 2.0 * 0.5 * bending.std
    assert arm.std is not None
    assert arm.value < 2.0 * arm.std < 0.5


def test_a_spring_at_the_face_needs_no_more_than_its_stiffness() -> None:
    """The data do not ask for a free arm: the simple explanation is not worse."""
    frame, effect = portal(4), JointRotation()
    truth = effect.frame(portal(12), "er", [1e5])
    test = measured(Model.of(truth), frame, count=7, rng=np.random.default_rng(2))
    found = diagnose(case_of(Model.of(frame), test, 5))
    first = found.causes[0]
    assert (first.effect, first.place) == ("joint-rotation", "er")
