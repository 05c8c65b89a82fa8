"""Supports that give: what they do to a model, and that a diagnosis finds them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from continuous_beams import Cantilever
from diagnosis_problems import case_of, measured
from effect_checks import changed_matrices, check_neutral

from femubench import Model, diagnose
from femubench.core.conformance.effect_checks import has_place
from femubench.core.drawing.places import find_wireframe
from femubench.core.effect.places import split_direction
from femubench.core.fem.model import common_dofs
from femubench.effect import Places, Site
from femubench.fem import (
    Frame,
    GroundSpring,
    Joint,
    Material,
    Member,
    ModelError,
    Place,
    Section,
    Support,
)
from femubench.plugins.effects.support_flexibility import SupportFlexibility

FrameBuilder = Callable[..., Frame]
EFFECT = SupportFlexibility()
SPACE = ("x", "y", "z", "rx", "ry", "rz")


@pytest.fixture(scope="module")
def held(ladder: FrameBuilder, hframe: FrameBuilder, portal: FrameBuilder) -> list[Model]:
    """Return a frame of each plane on supports, some between joints, some springs."""
    clamp, pin = ("z", "rx", "ry"), ("x", "z")
    ladder_supports = (Support(Place(joint="A"), clamp), Support(Place(member="BC", s=0.4), ("z",)))
    cord = (GroundSpring(Place(joint="F"), "z", 1e4),)
    lies = replace(ladder(), supports=ladder_supports, springs=cord)
    feet = (Support(Place(joint="L1"), ("x", "z", "ry")), Support(Place(joint="L2"), pin))
    stands = replace(hframe(mesh=(4, 2, 4)), supports=feet)
    ends = (Support(Place(joint="J0"), SPACE), Support(Place(joint="J6"), ("x", "y", "z")))
    return [Model.of(frame) for frame in (lies, stands, replace(portal(3), supports=ends))]


def test_places_are_supports_and_springs_whole_and_by_direction(held: list[Model]) -> None:
    lies, stands, space = (EFFECT.places(model) for model in held)
    a = ("support:A", "support:A:z", "support:A:rx", "support:A:ry")
    assert lies == ("support:all", "support:F:z", *a, "support:BC@0.4:z")
    assert stands[-3:] == ("support:L2", "support:L2:x", "support:L2:z")
    assert len(space) == 1 + 7 + 4
    for model in held:
        assert all(has_place(model, place) for place in EFFECT.places(model))
        assert not has_place(model, "support:J3")


def test_change_is_the_released_support_condensed(held: list[Model]) -> None:
    for model in held:
        for place in EFFECT.places(model):
            check_neutral(EFFECT, model, place)
            scales = [p.scale for p in EFFECT.parameters(model, place)]
            values = [factor * scale for factor, scale in zip((0.4, 2.0), scales, strict=False)]
            mass, stiffness = changed_matrices(model, EFFECT.change(model, place), values)
            extended = EFFECT.extend(model, place, values)
            keep = common_dofs(model.frame_structure, extended.frame_structure)
            rest = np.setdiff1d(np.arange(extended.size), keep)
            k, m = extended.stiffness.toarray(), extended.mass.toarray()
            motion = np.zeros((extended.size, model.size))
            motion[keep] = np.eye(model.size)
            motion[rest] = -np.linalg.solve(k[np.ix_(rest, rest)], k[np.ix_(rest, keep)])
            for found, exact in ((stiffness, motion.T @ k @ motion), (mass, motion.T @ m @ motion)):
                np.testing.assert_allclose(found, exact, rtol=0, atol=1e-10 * np.abs(exact).max())


def test_a_support_in_series_with_a_spring_is_a_spring(held: list[Model]) -> None:
    frame = held[0].frame_structure.frame
    softer = EFFECT.frame(frame, "support:F:z", [3e4])
    assert [s.stiffness for s in softer.springs] == [pytest.approx(1e4 * 3e4 / 4e4)]
    gone = EFFECT.frame(frame, "support:A", [np.inf, 2e3])
    assert gone.supports[0].fixed == ("z",)
    assert {(s.direction, s.stiffness) for s in gone.springs if s.at.joint == "A"} == {
        ("rx", 2e3),
        ("ry", 2e3),
    }
    assert EFFECT.frame(frame, "support:all", [np.inf, np.inf]) == frame


def test_no_mass_comes_or_goes(held: list[Model]) -> None:
    """The condensed inertia is no mass that a balance would show."""
    for model in held:
        for term in EFFECT.change(model, EFFECT.places(model)[0]).terms:
            assert term.matrix == "stiffness" or term.weight == 0.0


def test_words_of_supports(held: list[Model]) -> None:
    frame = held[0].frame_structure.frame
    assert split_direction("support:A:rz") == ("support:A", "rz")
    assert split_direction("support:x") == ("support:x", None)
    assert Places(frame).match("support:F", "support:F:z")
    assert not Places(frame).match("support:A", "support:A:z")
    assert not Places(frame).match("support:A:rx", "A:rx")
    assert Places(frame).supports_of("support:A:z") == {"A": {"z": np.inf}}
    assert [m.name for m in Places(frame).members_at("support:A:z")] == ["AB", "AD"]
    for word in ("support:C", "support:F:rx", "F"):
        with pytest.raises(ModelError, match="no support"):
            Places(frame).supports_of(word)
    site = Site(frame, "support:BC@0.4:z", 1.0, np.array([1.0]))
    assert [m.name for m in site.members] == ["BC"]
    drawn = find_wireframe(held[0], Places(frame).supports())
    corner = drawn.place("support:A:ry")
    assert corner.kind == "point"
    assert corner.points == ((0.0, 0.0, 0.0),)
    assert len(drawn.place("support:all").points) == 3


LENGTH, SECTION, STEEL = 1.2, Section.solid_rectangle(0.03, 0.012), Material(207e9, 0.3, 7850.0)
EI = STEEL.E * SECTION.Iy


def clamped(elements: int = 12) -> Frame:
    joints = (Joint("foot", (0.0, 0.0, 0.0)), Joint("tip", (LENGTH, 0.0, 0.0)))
    beam = Member("beam", ("foot", "tip"), elements, SECTION, STEEL)
    clamp = (Support(Place(joint="foot"), ("x", "z", "ry")),)
    return Frame("in-plane", "euler-bernoulli", joints, (beam,), supports=clamp)


def test_a_foot_that_turns_is_no_damage_next_to_it() -> None:
    """The equation is exact, the model has twelve elements and a rigid clamp."""
    seed = 0
    spring = 20.0 * EI / LENGTH
    stations = tuple(LENGTH * np.linspace(0.1, 1.0, 10))
    beam = Cantilever(LENGTH, SECTION, STEEL, stations, spring)
    test = beam.measure(7, 0.0005, 0.01, np.random.default_rng(seed))
    found = diagnose(case_of(Model.of(clamped()), test, 5))
    assert found.verdict in ("named", "ambiguous")
    (cause,) = [c for c in found.causes if c.effect == "support-flexibility"]
    assert cause.place in ("support:foot:ry", "support:foot")
    turning = cause.parameters[-1]
    assert turning.unit == "N m/rad"
    assert abs(turning.value - spring) < 2.0 * turning.std
    assert turning.std < 0.1 * spring
    assert found.causes[0] is cause


@pytest.mark.nightly
def test_one_soft_foot_of_two_is_found_in_a_finer_model(hframe: FrameBuilder) -> None:
    feet = tuple(Support(Place(joint=j), ("x", "z", "ry")) for j in ("L1", "L2"))
    nominal = replace(hframe(mesh=(8, 4, 8)), supports=feet)
    (parameter,) = EFFECT.parameters(Model.of(nominal), "support:L2:ry")
    fine = replace(hframe(mesh=(24, 12, 24)), supports=feet)
    truth = EFFECT.frame(fine, "support:L2:ry", [parameter.scale])
    test = measured(Model.of(truth), nominal, count=7, rng=np.random.default_rng(3))
    found = diagnose(case_of(Model.of(nominal), test, 5))
    first = found.causes[0]
    assert (first.effect, first.place) == ("support-flexibility", "support:L2:ry")
    (stiffness,) = first.parameters
    assert abs(stiffness.value - parameter.scale) < 2.0 * stiffness.std
    assert stiffness.std < 0.1 * parameter.scale
