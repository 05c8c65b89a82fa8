"""Joints that turn elsewhere than at the face, or about one axis more than about the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_problems import case_of, clamped_portal, measured
from effect_checks import compare

from femubench import Model, diagnose
from femubench.fem import Frame, Joint, JointSpring, Material, Member, Place, Section, Support
from femubench.plugins.effects.joint_flexibility import JointFlexibility
from femubench.plugins.effects.joint_rotation import JointRotation

TUBE, STEEL = Section.rectangular_tube(0.06, 0.04, 0.003), Material(207e9, 0.3, 7850.0)


def portal(elements: int) -> Frame:
    """Return a portal on clamps, its corners of sections with sizes."""
    return clamped_portal(elements, TUBE, STEEL)


def test_a_spring_at_the_axis_is_found_with_its_stiffness() -> None:
    """The members have a depth, but the joint turns where their axes meet."""
    seed = 0
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


@pytest.mark.nightly
def test_a_spring_at_the_face_needs_no_more_than_its_stiffness() -> None:
    """The data do not ask for a free arm: the simple explanation is not worse."""
    frame, effect = portal(4), JointRotation()
    truth = effect.frame(portal(12), "er", [1e5])
    test = measured(Model.of(truth), frame, count=7, rng=np.random.default_rng(2))
    found = diagnose(case_of(Model.of(frame), test, 5))
    first = found.causes[0]
    assert (first.effect, first.place) == ("joint-rotation", "er")


def braced_portal(elements: int) -> Frame:
    """Return the portal with a sill in half its height: two corners, two tees, on clamps."""
    places = {
        "fl": ((0.0, 0.0), ""),
        "fr": ((1.2, 0.0), ""),
        "ml": ((0.0, 0.5), "tee"),
        "mr": ((1.2, 0.5), "tee"),
        "el": ((0.0, 1.0), "corner"),
        "er": ((1.2, 1.0), "corner"),
    }
    joints = tuple(Joint(name, (x, 0.0, z), kind) for name, ((x, z), kind) in places.items())
    pairs = ("fl ml", "ml el", "fr mr", "mr er", "el er", "ml mr")
    members = tuple(
        Member(pair.replace(" ", "-"), (pair.split()[0], pair.split()[1]), elements, TUBE, STEEL)
        for pair in pairs
    )
    feet = tuple(Support(Place(joint=j), ("x", "z", "ry")) for j in ("fl", "fr"))
    return Frame("in-plane", "euler-bernoulli", joints, members, supports=feet)


def test_all_joints_turn_on_multiples_of_their_members() -> None:
    """By hand: 4 EI/L of the ends of a type, times the common multiple, times its own factor."""
    effect, frame = JointFlexibility(), braced_portal(4)
    springs = {
        f"{s.member}@{s.joint}": s
        for s in effect.frame(frame, "all:apart", [2.0, -0.2, 0.3]).joint_springs
    }
    assert set(springs) == {
        *("ml-el@el", "el-er@el", "mr-er@er", "el-er@er"),
        *("ml-mr@ml", "ml-mr@mr"),  # the legs pass
    }
    bending = 4.0 * STEEL.E * TUBE.Iy
    corner = 0.5 * (bending / 0.5 + bending / 1.2)
    assert springs["el-er@el"].stiffness == pytest.approx({"ry": 2.0 * np.exp(0.3) * corner})
    own = 2.0 * np.exp(-0.2) * bending / 1.2
    assert springs["ml-mr@mr"].stiffness == pytest.approx({"ry": own})
    assert springs["ml-mr@mr"].arm == pytest.approx(0.02)
    alike = effect.frame(frame, "all", [2.0])
    assert alike == effect.frame(frame, "all:apart", [2.0, 0.0, 0.0])


def test_what_all_joints_do_is_what_the_model_does() -> None:
    effect = JointFlexibility()
    model = Model.of(braced_portal(4))
    assert tuple(effect.places(model)) == ("all",)
    for place, values in (("all", [0.5]), ("all", [20.0]), ("all:apart", [1.5, 0.7, -0.4])):
        # Springs are condensed: a mode gains the square of its frequency over the element's.
        assert compare(effect, model, place, values, count=6).frequency < 2e-3
    assert compare(effect, model, "all", [1.5], count=6).effect > 0.03


def test_joints_of_one_type_and_elements_between_two_are_left_to_others() -> None:
    effect = JointFlexibility()
    frame, knee = braced_portal(4), braced_portal(1)
    assert effect.places(Model.of(knee)) == ("all",)
    kinds = tuple(replace(j, type="knee") if j.name == "er" else j for j in knee.joints)
    assert effect.places(Model.of(replace(knee, joints=kinds))) == ()
    one = tuple(replace(j, type="weld" if j.name[0] == "e" else "") for j in frame.joints)
    sill = tuple(m for m in frame.members if m.name != "ml-mr")
    assert effect.places(Model.of(replace(frame, joints=one, members=sill))) == ("all",)  # splices
    assert effect.places(Model.of(portal(4))) == ("all",)  # without a type each is its own
    weld = tuple(replace(j, type="weld") for j in portal(4).joints)
    assert effect.places(Model.of(replace(portal(4), joints=weld))) == ()


@pytest.mark.slow(5)
def test_all_joints_that_give_are_found_as_one_cause() -> None:
    """Tees half as stiff as corners: one cause with a factor a type, not two or four."""
    effect = JointFlexibility()
    truth = effect.frame(braced_portal(12), "all:apart", [3.0, -0.35, 0.35])
    frame = braced_portal(4)
    test = measured(Model.of(truth), frame, count=8, rng=np.random.default_rng(5))
    found = diagnose(case_of(Model.of(frame), test, 6))
    (cause,) = (c for c in found.causes if c.effect == "joint-flexibility")
    assert cause.place in ("all", "all:apart")
    common = cause.parameters[0]
    assert common.std is not None
    assert abs(np.log(common.value / 3.0)) < 3.0 * common.std / common.value
