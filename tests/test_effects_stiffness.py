"""Effects on stiffness, mass and joints, and the words for their places."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from effect_checks import as_matrices, changed_matrices, check_exact, check_neutral, compare

from femubench import Model, NotApplicable, solve_modes
from femubench.core.effect.places import split_direction
from femubench.core.fem.frame import Coupling, Factor
from femubench.core.fem.model import LowRank
from femubench.effect import FrameEffect, ModelPlaces, Places
from femubench.fem import Frame, JointSpring, ModelError, Place, PointMass, RigidEnd, Structure
from femubench.plugins.effects.flexible_ends import rate_nodes
from femubench.plugins.effects.joint_offset import JointOffset
from femubench.plugins.effects.joint_rotation import JointRotation
from femubench.plugins.effects.local_stiffness_loss import LocalStiffnessLoss
from femubench.plugins.effects.material import Density, MemberMass, MemberStiffness, YoungsModulus
from femubench.plugins.effects.rotary_inertia import RotaryInertia
from femubench.plugins.effects.shear_deformation import ShearDeformation
from femubench.plugins.effects.torsion_constant import TorsionConstant, shape_torsion_constant

FrameBuilder = Callable[..., Frame]
EXACT: dict[type, tuple[float, ...]] = {
    YoungsModulus: (-0.3, 0.2),
    Density: (-0.3, 0.2),
    TorsionConstant: (-0.4, 0.5),
    ShearDeformation: (0.0, 0.4, 1.0, 3.0),
    RotaryInertia: (0.0, 0.4, 1.0, 3.0),
    MemberStiffness: (-0.5, 0.3),
    MemberMass: (-0.5, 0.3),
    LocalStiffnessLoss: (0.1, 0.8),
    JointOffset: (0.004, 0.02),
}
FRAMES = ("ladder", "hframe", "portal")


@pytest.fixture(scope="module")
def models(ladder: FrameBuilder, hframe: FrameBuilder, portal: FrameBuilder) -> dict[str, Model]:
    """Return a frame of each plane; the portal has shear and rotary inertia already."""
    space = portal(3)
    kinds = {"J1": "knee", "J2": "knee", "J3": "hub"}
    joints = tuple(replace(j, type=kinds.get(j.name, "")) for j in space.joints)
    frames = (ladder(), hframe(mesh=(4, 2, 4)), replace(space, joints=joints))
    return {name: Model.of(frame) for name, frame in zip(FRAMES, frames, strict=True)}


def some(places: Sequence[str]) -> Sequence[str]:
    """Return all of a few places, some of many."""
    return places if len(places) <= 3 else places[:: len(places) // 3]


@pytest.mark.parametrize("name", FRAMES)
@pytest.mark.parametrize("effect", EXACT, ids=lambda effect: effect.name)
def test_change_is_what_extend_does(models: dict[str, Model], name: str, effect: type) -> None:
    model, one = models[name], effect()
    places = some(one.places(model))
    if not places:
        assert (name, effect) == ("hframe", TorsionConstant)
    for place in places:
        check_neutral(one, model, place)
        for value in EXACT[effect]:
            check_exact(one, model, place, [value])
    if name == "ladder":  # not the agreement of nothing with nothing
        assert compare(one, model, places[0], [EXACT[effect][-1]]).effect > 0.01


def test_shear_in_every_kind_of_frame(portal: FrameBuilder, ladder: FrameBuilder) -> None:
    """Mass matrices that know of shear, beams that have it, more rates than terms, no kappa."""
    bare = ladder(elements=3)
    numbers = tuple(replace(m, section=replace(m.section, kappa=None)) for m in bare.members)
    frames = (
        portal(5),
        replace(portal(5), bending_mass="cubic"),
        replace(ladder(), bending_mass="cubic"),
        replace(portal(4), factors=(Factor("shear", ("all",), 0.5), Factor("E", ("m1",), 0.8))),
        replace(bare, members=numbers),
    )
    for frame in frames:
        model = Model.of(frame)
        check_neutral(ShearDeformation(), model, "all")
        for value in (0.0, 0.7, 1.0, 2.5):
            check_exact(ShearDeformation(), model, "all", [value])
    (halved,) = ShearDeformation().parameters(Model.of(frames[3]), "all")
    assert (halved.neutral, halved.textbook, halved.one_sided) == (0.5, None, False)
    (guessed,) = ShearDeformation().parameters(model, "all")
    assert (guessed.neutral, guessed.textbook, guessed.one_sided) == (0.0, None, True)
    extended = ShearDeformation().extend(model, "all", [1.0]).frame_structure.frame
    assert {m.section.kappa(0.3) for m in extended.members if m.section.kappa} == {(5 / 6, 5 / 6)}
    assert extended.rotary_share == 0.0


def test_textbook_values(ladder: FrameBuilder, models: dict[str, Model]) -> None:
    (torsion,) = TorsionConstant().parameters(models["ladder"], "all")
    assert torsion.textbook is not None
    assert torsion.textbook == pytest.approx(-0.2579, abs=1e-4)
    own = ladder(polar=False)
    repaired = TorsionConstant().extend(models["ladder"], "all", [torsion.textbook])
    section = repaired.frame_structure.frame.members[0].section
    np.testing.assert_allclose(section.J, own.members[0].section.J, rtol=1e-12)
    assert TorsionConstant().parameters(Model.of(own), "all")[0].textbook is None
    for effect in (ShearDeformation(), RotaryInertia()):
        assert effect.parameters(models["ladder"], "all")[0].textbook == 1.0
        assert effect.parameters(models["portal"], "all")[0].textbook is None
    # Sizes of one shape with the area of another: nothing is known.
    assert shape_torsion_constant(replace(own.members[0].section, A=1e-4)) is None
    assert shape_torsion_constant(replace(own.members[0].section, shape="")) is None


def test_couplings_and_massless_arms_go_with_their_member(
    ladder: FrameBuilder, portal: FrameBuilder
) -> None:
    model = Model.of(replace(ladder(), couplings=(Coupling("AB", 0.2), Coupling("BE", -0.3))))
    for value in (-0.3, 0.4):
        check_exact(TorsionConstant(), model, "all", [value])
    spring = JointSpring("J6", "m5", {"ry": 1e4}, 0.02, 5.0)
    structure = Structure.build(portal(3, joint_springs=(spring,)))
    model = Model.of(structure)
    for effect, at in ((YoungsModulus(), 0), (MemberStiffness(), 5), (TorsionConstant(), 0)):
        check_exact(effect, model, effect.places(model)[at], [0.4])
    assert len(ModelPlaces(Model.of(structure)).elements("m5")) == 2
    assert len(ModelPlaces(Model.of(structure)).elements("m5", arms=True)) == 3
    assert len(ModelPlaces(Model.of(structure)).elements("m5/2", arms=True)) == 1


def test_places(models: dict[str, Model]) -> None:
    members = ("AB", "BC", "DE", "EF", "AD", "BE", "CF")
    ends = ("AB@B", "BC@B", "BE@B", "DE@E", "EF@E", "BE@E")
    for effect, branch in ((JointRotation(), ("T:branch",)), (JointOffset(), ())):
        assert effect.places(models["ladder"]) == ("L", "T", *branch, *"ABCDEF", *ends)
        # Free ends are no joints; a type with one joint is that joint.
        joints = [p for p in effect.places(models["hframe"]) if p[0] == "T" and p not in branch]
        assert joints == ["T", "T1", "T2"]
        assert "hub" not in effect.places(models["portal"])
        assert "knee" in effect.places(models["portal"])
    assert MemberStiffness().places(models["ladder"]) == members
    assert MemberMass().places(models["ladder"]) == members
    assert LocalStiffnessLoss().places(models["ladder"])[:5] == (
        *(f"AB/{k}" for k in (1, 2, 3, 4)),
        "BC/1",
    )


def test_one_member_is_all(ladder: FrameBuilder) -> None:
    frame = ladder(accelerometer=False)
    model = Model.of(replace(frame, members=frame.members[:1], joints=frame.joints[:2]))
    for effect in (MemberStiffness(), MemberMass(), JointRotation(), JointOffset()):
        assert effect.places(model) == ()
    assert Places(model.frame_structure.frame).match("AB", "all")


def held_element_frequency(model: Model) -> float:
    """Return the lowest frequency in Hz of an element that turns at one end, its nodes held."""
    properties = model.frame_structure.properties
    turning = [3] if model.frame_structure.frame.plane != "in-plane" else []
    turning += [4, 5] if model.frame_structure.frame.plane == "3d" else [4]
    stiffness, mass = properties.stiffness_matrices(), properties.mass_matrices()
    ratio = [stiffness[:, i, i] / mass[:, i, i] for i in turning]
    return float(np.sqrt(np.min(ratio)) / (2.0 * np.pi))


@pytest.mark.parametrize("name", FRAMES)
def test_joint_rotation_agrees_with_its_springs(models: dict[str, Model], name: str) -> None:
    """Condensed springs against springs with dofs of their own, at stiffnesses of all sizes.

    By Schwarz' inequality a mode loses at most (omega / omega_e)^2 of its eigenvalue.
    """
    model, effect = models[name], JointRotation()
    highest = solve_modes(model).elastic.natural_frequencies[2]
    bound = 0.5 * (highest / held_element_frequency(model)) ** 2
    assert bound < 0.05
    for place in effect.places(model)[:9:2]:
        parameters = effect.parameters(model, place)
        for x in (0.02, 2.0):
            values = [float(p.value(x)) for p in parameters]
            found = compare(effect, model, place, values, count=3)
            assert found.frequency < (bound if name == "portal" else 2e-5), (place, x, found)
            assert found.effect > 1e-5


def test_condensed_stiffness_is_exact(models: dict[str, Model]) -> None:
    """A static load sees no inertia: condensed springs are springs."""
    effect = JointRotation()
    for name, place in (("ladder", "T"), ("hframe", "T1"), ("portal", "m8@J1")):
        model = models[name]
        values = [float(p.value(0.4)) for p in effect.parameters(model, place)]
        extended = effect.extend(model, place, values)
        inner = np.flatnonzero(model.dofs.node >= len(model.frame_structure.frame.joints))
        index = [dof_keys(extended).index(dof_keys(model)[i]) for i in inner]
        load = np.random.default_rng(1).normal(size=len(inner))
        answers = []
        for matrix, dofs in (
            (changed_matrices(model, effect.change(model, place), values)[1], inner),
            (extended.stiffness.toarray(), index),
        ):
            ground, force = np.zeros(len(matrix)), np.zeros(len(matrix))
            ground[dofs], force[dofs] = 1e6, load
            answers.append(np.linalg.solve(matrix + np.diag(ground), force)[dofs])
        mine, theirs = answers
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


def dof_keys(model: Model) -> list[tuple[object, ...]]:
    """Return position and direction of every dof."""
    nanometres = np.round(model.dofs.xyz * 1e9).astype(int).tolist()
    return [(*xyz, d) for xyz, d in zip(nanometres, model.dofs.direction, strict=True)]


def test_springs_in_series(portal: FrameBuilder) -> None:
    springs = (
        JointSpring("J1", "m0", {"rx": 3e3, "ry": 2e3, "rz": 1e3}, 0.02),
        JointSpring("J1", "m1", {"ry": 2e3}),
    )
    model = Model.of(portal(3, joint_springs=springs))
    extended = JointRotation().extend(model, "J1", [2e3]).frame_structure.frame
    assert len(extended.joint_springs) == 3
    assert extended.joint_springs[0].stiffness == {"rx": 1200.0, "ry": 1000.0, "rz": 2e3 / 3}
    assert extended.joint_springs[0].arm == 0.02
    assert extended.joint_springs[1].stiffness == {"ry": 1000.0, "rx": 2e3, "rz": 2e3}
    check_exact(JointRotation(), model, "m0@J1", [2e3])
    assert compare(JointRotation(), model, "J1", [2e3], count=3).frequency < 2e-3


def test_offset_adds_to_rigid_ends(portal: FrameBuilder) -> None:
    rigid = (RigidEnd("J1", "m1", 0.03, 0.01), RigidEnd("J2", "m1", -0.02))
    model = Model.of(portal(3, rigid_ends=rigid))
    extended = JointOffset().extend(model, "J1", [0.02]).frame_structure.frame
    first = next(r for r in extended.rigid_ends if (r.member, r.joint) == ("m1", "J1"))
    assert (first.stiffness_length, first.mass_length) == (0.05, 0.01)
    assert len(extended.rigid_ends) == 4
    for place in ("J1", "m1@J1", "J2"):
        check_exact(JointOffset(), model, place, [0.05])


def matrix_model(model: Model) -> Model:
    """Return a model as matrices alone, with two groups and a low-rank change."""
    stiffness = model.stiffness
    half = sp.diags_array(np.where(np.arange(model.size) < 40, 1.0, 0.0))
    group = sp.csc_array(half @ stiffness @ half)
    basis = np.random.default_rng(0).normal(size=(model.size, 2))
    change = LowRank(basis, np.diag([1e3, 2e3]))
    groups = {"left": group, "rest": sp.csc_array(stiffness - group)}
    return replace(as_matrices(model), stiffness_change=change, groups=groups)


def test_matrices_without_a_frame(models: dict[str, Model]) -> None:
    model = matrix_model(models["ladder"])
    assert MemberStiffness().places(model) == ("group:left", "group:rest")
    elsewhere: list[FrameEffect] = [TorsionConstant(), ShearDeformation(), RotaryInertia()]
    elsewhere += [MemberMass(), JointRotation(), JointOffset(), LocalStiffnessLoss()]
    for effect in elsewhere:
        assert effect.places(model) == ()
    with pytest.raises(NotApplicable, match="joint-rotation needs a frame"):
        JointRotation().extend(model, "A", [1.0])
    unit = np.eye(model.size)
    for one, place in (
        (YoungsModulus(), "all"),
        (MemberStiffness(), "group:left"),
        (Density(), "all"),
    ):
        change, extended = one.change(model, place), one.extend(model, place, [0.25])
        factors = change.coefficients(np.array([[0.25]]))[0]
        sums = {"mass": model.mass_times(unit), "stiffness": model.stiffness_times(unit)}
        for factor, term in zip(factors, change.terms, strict=True):
            sums[term.matrix] = sums[term.matrix] + factor * term.operator.apply(unit)
        for kind, total in sums.items():
            other = getattr(extended, f"{kind}_times")(unit)
            np.testing.assert_allclose(total, other, rtol=0, atol=1e-12 * np.abs(other).max())
    stiffer = YoungsModulus().extend(model, "all", [0.21])
    old, new = (solve_modes(m, 9).natural_frequencies[4:] for m in (model, stiffer))
    np.testing.assert_allclose(new, 1.1 * old, rtol=1e-9)
    with pytest.raises(ModelError, match="no group 'group:right'"):
        MemberStiffness().extend(model, "group:right", [0.1])


def test_loss_takes_split_elements_whole(ladder: FrameBuilder) -> None:
    masses = (PointMass(Place(member="AB", s=0.3), 0.05),)
    model = Model.of(replace(ladder(), masses=masses))
    rows = ModelPlaces(model).elements("AB/2")
    assert len(rows) == 2
    assert len(ModelPlaces(model).elements("AB")) == 5
    assert len(ModelPlaces(model).elements("all")) == 29
    check_exact(LocalStiffnessLoss(), model, "AB/2", [0.4])
    for half in LocalStiffnessLoss().finer(model, "AB/2"):  # tabulated
        found = compare(LocalStiffnessLoss(), model, half, [0.4])
        assert max(found.frequency, found.reading) < 1e-3 < found.effect
    assert not LocalStiffnessLoss().finer(model, "AB/2:first")
    for wrong in ("AB/9", "AB/x", "XY", "XY/1"):
        with pytest.raises(ModelError, match="there is no place"):
            ModelPlaces(model).elements(wrong)


def test_words_for_joints_and_ends(ladder: FrameBuilder, hframe: FrameBuilder) -> None:
    frame = ladder()
    assert frame.joint_types == {"L": ("A", "C", "D", "F"), "T": ("B", "E")}
    assert Places(frame).ends_of("B") == ("AB@B", "BC@B", "BE@B")
    assert len(Places(frame).ends_of("T")) == len(Places(frame).ends_of("type:T")) == 6
    assert Places(frame).ends_of("BE@E") == ("BE@E",)
    for wrong in ("X", "type:X", "AB@F", "AB", "all"):
        with pytest.raises(ModelError, match="no member ends at"):
            Places(frame).ends_of(wrong)
    assert Places(frame).types()[0] == "L"
    joints = tuple(replace(j, type="A" if j.type == "L" else j.type) for j in frame.joints)
    clash = replace(frame, joints=joints)
    assert Places(clash).types()[0] == "type:A"
    assert len(Places(clash).ends_of("A")) == 2
    assert len(Places(clash).ends_of("type:A")) == 8
    assert JointRotation().places(Model.of(clash))[:2] == ("type:A", "T")
    assert hframe().joint_types == {"T": ("T1", "T2")}


def test_words_for_points(models: dict[str, Model]) -> None:
    frame = models["ladder"].frame_structure.frame
    assert Places(frame).point("A:z") == Place(joint="A")
    assert Places(frame).point("AB@0.25:-rx") == Place(member="AB", s=0.25)
    assert Places(frame).point("AB@0") == Places(frame).point("AB@A") == Place(joint="A")
    assert Places(frame).point("AB@1") == Place(joint="B")
    assert split_direction("AB@0.25:-rx") == ("AB@0.25", "-rx")
    assert split_direction("type:x") == ("type:x", None)
    assert split_direction("type:x:z") == ("type:x", "z")
    assert split_direction("A") == ("A", None)
    for wrong in ("AB@1.5", "XY@0.5", "AB@half", "AB", "X"):
        with pytest.raises(ModelError):
            Places(frame).point(wrong)
    places = ModelPlaces(models["ladder"]).points()
    assert places[:9] == (*"ABCDEF", "AB@0.25", "AB@0.5", "AB@0.75")
    # Stations between mesh nodes are of no use: they would split an element.
    thirds = replace(frame, members=tuple(replace(m, elements=3) for m in frame.members))
    assert ModelPlaces(Model.of(thirds)).points()[6:8] == ("AB@0.333333", "AB@0.666667")
    assert Places(thirds).point("AB@0.333333").s == 1 / 3
    tenths = replace(frame, members=tuple(replace(m, elements=10) for m in frame.members))
    assert ModelPlaces(Model.of(tenths)).points()[6:9] == ("AB@0.2", "AB@0.5", "AB@0.8")
    assert ModelPlaces(matrix_model(models["ladder"])).points()[:2] == ("n0", "n1")


def test_same_place_in_other_words(ladder: FrameBuilder, portal: FrameBuilder) -> None:
    frame = ladder()
    same = "A=AB@A AB@A=AD@A type:L=L A:z=AB@0:-z A-E=E-A AB@0.250001=AB@0.25"
    other = "B=AB@B AB@B=BC@B L=A A=A:z A:z=A:x AB=AB/1 AB/1=AB/2 AB=all A-E=A-F AB@0.25=AB@0.5"
    for a, b in (pair.split("=") for pair in same.split()):
        assert Places(frame).match(a, b), (a, b)
        assert Places(frame).match(b, a), (a, b)
    for a, b in (pair.split("=") for pair in other.split()):
        assert not Places(frame).match(a, b), (a, b)
    joints = tuple(replace(j, type="lone" if j.name == "J3" else "") for j in portal(3).joints)
    lone = replace(portal(3), joints=joints)
    assert Places(lone).match("lone", "J3")
    assert Places(lone).match("m0@J0", "J0")
    dashed = replace(frame, joints=tuple(replace(j, name=f"p-{j.name}") for j in frame.joints))
    members = tuple(replace(m, ends=(f"p-{m.ends[0]}", f"p-{m.ends[1]}")) for m in frame.members)
    dashed = replace(dashed, members=members, masses=())
    assert Places(dashed).pair("p-A-p-E") == ("p-A", "p-E")
    with pytest.raises(ModelError, match="no pair of joints"):
        Places(dashed).pair("A-E")


def test_many_rates_are_interpolated() -> None:
    rates = np.exp(np.random.default_rng(2).uniform(np.log(1e-3), 0.0, 200))
    nodes, weights = rate_nodes(rates)
    assert weights.shape == (200, len(nodes))
    assert len(nodes) == 20
    for softness in (1e-2, 1.0, 1e2, 1e4):
        for power in (1, 2):
            share = (softness * nodes / (1.0 + softness * nodes)) ** power
            exact = (softness * rates / (1.0 + softness * rates)) ** power
            assert np.abs(weights @ share - exact).max() < 2e-5
    few = np.array([2.0, 1.0, 2.0 * (1 + 1e-14), 5.0])
    nodes, weights = rate_nodes(few)
    np.testing.assert_allclose(nodes, [1.0, 2.0, 5.0])
    np.testing.assert_array_equal(weights @ nodes, [2.0, 1.0, 2.0, 5.0])


def test_directions_apart_and_a_free_arm(
    models: dict[str, Model], ladder: FrameBuilder, portal: FrameBuilder
) -> None:
    """Interpolated between arms, the change is the model's as well as with the arm of the book."""
    effect = JointRotation()
    assert effect.finer(models["hframe"], "T:branch") == ()  # numbers: no depth, one direction
    stiff = (1.0, 0.5, 2.0)
    for model, place, units in (
        (models["ladder"], "BE@B:apart", 3),
        (models["ladder"], "T:branch:apart", 3),
        (Model.of(ladder(plane="out-of-plane", elements=6)), "L:apart", 3),
        (Model.of(portal(4)), "m1@J1:apart", 4),
    ):
        simple = place.removesuffix(":apart")
        assert effect.finer(model, simple) == (place,)
        assert effect.finer(model, place) == ()
        parameters = effect.parameters(model, place)
        assert [p.unit for p in parameters] == ["N m/rad"] * (units - 1) + [""]
        assert (parameters[-1].textbook, parameters[-1].upper) == (1.0, 2.0)
        own = [factor * p.scale for factor, p in zip(stiff, parameters[:-1], strict=False)]
        for arm in (0.0, 0.37, 1.9):
            found = compare(effect, model, place, [*own, arm], count=5)
            assert found.frequency < 1e-3, (place, arm, found)
        assert compare(effect, model, place, [*own, 1.0], count=5).effect > 0.005
    frame = models["ladder"].frame_structure.frame
    (spring,) = effect.frame(frame, "BE@B:apart", [3e3, 4e2, 0.5]).joint_springs
    assert spring.stiffness == {"ry": 3e3, "rx": 4e2}
    assert spring.arm == pytest.approx(0.5 * 0.0127)
    assert Places(frame).match("BE@B:apart", "BE@B")
    assert Places(frame).match("A:apart", "AB@A")
    assert not Places(frame).match("BE@B:apart", "BE@E")
    assert Places(frame).ends_of("BE@B:apart") == ("BE@B",)
