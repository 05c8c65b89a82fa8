"""Rigid links: exact offsets, rigid bodies, floors, hinges, and what a case may say of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femubench import InputError, Model, Sensors, read_case, solve_modes
from femubench.core.case.writing import write_case
from femubench.core.fem.frame import (
    ACTIVE,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Link,
    Material,
    Member,
    Oscillator,
    Place,
    Plane,
    PointMass,
    Preload,
    Support,
)
from femubench.fem import GeometricStiffness, ModelError, Section, Structure
from femubench.modal import rigid_modes_of
from femubench.plugins.effects.brace_spring import BraceSpring

ALUMINIUM = Material(72e9, 0.3, 2700.0)
BAR = Section.solid_rectangle(0.1, 0.02)
CLAMP = ("x", "y", "z", "rx", "ry", "rz")


def joint(name: str, *xyz: float) -> Joint:
    return Joint(name, (xyz[0], xyz[1], xyz[2]))


def member(ends: str, elements: int = 2, section: Section = BAR, **of: Any) -> Member:
    material = replace(ALUMINIUM, **of)
    return Member(ends, (ends[0], ends[1]), elements, section, material)


def times(factor: float) -> Section:
    """Return a section that is so many times stiffer than the bar, alike about both axes."""
    return Section(*(factor * v for v in (BAR.A, BAR.Iz, BAR.Iz, BAR.J, 1e-9)), kappa=BAR.kappa)


def tee(plane: Plane = "3d", *links: Link, **parts: Any) -> Frame:
    """Return a bar A-B-C and a bar D-E above it, which stands off the former by a link."""
    up = {"3d": (0.02, 0.0, 0.2), "in-plane": (0.02, 0.0, 0.2), "out-of-plane": (0.2, 0.1, 0.0)}
    x, y, z = up[plane]
    across = {"3d": (0.0, 1.0, 0.0), "in-plane": (0.4, 0.0, 0.5), "out-of-plane": (0.1, 0.7, 0.0)}
    a, b, c = across[plane]
    joints = (
        joint("A", -1.0, 0.0, 0.0),
        joint("B", 0.0, 0.0, 0.0),
        joint("C", 0.8, 0.0, 0.0),
        joint("D", x, y, z),
        joint("E", x + a, y + b, z + c),
    )
    bars = (member("AB"), member("BC"), member("DE"))
    return Frame(plane, "timoshenko", joints, bars, links=links or (Link("B", ("D",)),), **parts)


def frequencies(frame: Frame, count: int = 12) -> Any:
    return solve_modes(Model.of(frame), count).natural_frequencies


@pytest.mark.parametrize("plane", list(ACTIVE))
def test_a_body_on_links_is_as_free_as_before(plane: Plane) -> None:
    model = Model.of(tee(plane))
    modes = solve_modes(model)
    rigid = 6 if plane == "3d" else 3
    assert rigid_modes_of(model).shape[1] == rigid
    assert np.count_nonzero(modes.rigid) == rigid
    assert np.abs(modes.eigenvalues[:rigid]).max() < 1e-9 * modes.eigenvalues[rigid]
    assert modes.eigenvalues[rigid] > 0.0
    assert "D" not in {model.frame_structure.frame.joints[n].name for n in model.dofs.node if n < 5}
    assert model.total_mass == pytest.approx(model.frame_structure.total_mass, rel=1e-12)


@pytest.mark.parametrize("plane", list(ACTIVE))
def test_a_mass_at_the_end_of_a_link_is_a_mass_on_an_arm(plane: Plane) -> None:
    frame = tee(plane)
    offset = {"3d": (0.1, -0.2, 0.3), "in-plane": (0.1, 0.0, 0.3), "out-of-plane": (0.1, 0.3, 0.0)}
    end = np.array(frame.joint("E").xyz)
    tip = Joint("F", tuple(end + offset[plane]))
    linked = replace(
        frame,
        joints=(*frame.joints, tip),
        links=(*frame.links, Link("E", ("F",))),
        masses=(PointMass(Place(joint="F"), 1.5),),
    )
    armed = replace(frame, masses=(PointMass(Place(joint="E"), 1.5, offset[plane]),))
    one, other = Model.of(linked), Model.of(armed)
    for name in ("mass", "stiffness"):
        matrix = getattr(other, name)
        assert abs(getattr(one, name) - matrix).max() < 1e-14 * abs(matrix).max()


def test_the_tip_of_an_offset_moves_as_the_formula_says() -> None:
    length, a, force = 1.0, 0.3, 10.0
    joints = (joint("A", 0, 0, 0), joint("B", length, 0, 0), joint("C", length, 0, a))
    frame = Frame(
        "in-plane",
        "euler-bernoulli",
        joints,
        (member("AB", 1),),
        supports=(Support(Place(joint="A"), ("x", "z", "ry")),),
        links=(Link("B", ("C",)),),
    )
    model = Model.of(frame)
    tip = model.observe(Sensors(("x", "z"), np.tile(joints[2].xyz, (2, 1)), ("x", "z")))
    moved = tip @ np.linalg.solve(model.stiffness.toarray(), force * tip.toarray()[0])
    bending = ALUMINIUM.E * BAR.Iy
    along = force * length / (ALUMINIUM.E * BAR.A) + force * a**2 * length / bending
    across = -force * a * length**2 / (2.0 * bending)
    assert moved == pytest.approx([along, across], rel=1e-12)


def test_who_leads_and_how_long_the_chain_is_makes_no_difference() -> None:
    frame = tee("3d", Link("B", ("D",)))
    joints = (*frame.joints, joint("F", 0.0, 0.3, 0.1))
    masses = (PointMass(Place(joint="F"), 0.7),)
    frame = replace(frame, joints=joints, masses=masses)
    wanted = frequencies(replace(frame, links=(Link("B", ("D", "F")),)))
    for links in (
        (Link("D", ("F",)), Link("B", ("D",))),
        (Link("D", ("F", "B")),),
        (Link("F", ("D", "B")),),
        (Link("F", ("D",)), Link("D", ("B",), ("x", "y", "z")), Link("D", ("B",), CLAMP[3:])),
    ):
        assert frequencies(replace(frame, links=links))[6:] == pytest.approx(wanted[6:], rel=1e-9)


def floor(*extra: Link, **parts: Any) -> Frame:
    """Return four columns, one of them stronger, under a rigid floor that a bare joint leads."""
    corners = {"E": (0.0, 0.0), "F": (4.0, 0.0), "G": (4.0, 3.0), "H": (0.0, 3.0)}
    feet = tuple(joint(n, x, y, 0.0) for n, (x, y) in zip("ABCD", corners.values(), strict=True))
    heads = tuple(joint(n, x, y, 2.5) for n, (x, y) in corners.items())
    strong = Section(0.02, 4e-5, 2e-5, 3e-5, 1e-12)
    weak = Section(0.02, 2e-5, 1e-5, 1e-5, 1e-12)
    columns = tuple(
        member(foot + head, 1, strong if foot == "A" else weak, rho=1e-6)
        for foot, head in zip("ABCD", corners, strict=True)
    )
    masses = tuple(PointMass(Place(joint=n), 500.0) for n in corners)
    return Frame(
        "3d",
        "euler-bernoulli",
        (*feet, *heads, joint("M", 2.0, 1.5, 2.5)),
        columns,
        masses=masses,
        supports=tuple(Support(Place(joint=n), CLAMP) for n in "ABCD"),
        links=(Link("M", tuple(corners), ("x", "y", "rz")), *extra),
        **parts,
    )


def test_a_rigid_floor_sways_and_turns_as_a_model_made_by_hand() -> None:
    frame = floor()
    stiffness, mass = np.zeros((3, 3)), np.zeros((3, 3))
    for column, head in zip(frame.members, frame.joints[4:8], strict=True):
        s, height = column.section, 2.5
        # Heads turn freely about x and y, and twist with the floor. Of a column local z is x.
        bending = 3.0 * ALUMINIUM.E / height**3 * np.array([s.Iy, s.Iz])
        x, y = head.xyz[0] - 2.0, head.xyz[1] - 1.5
        motion = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
        stiffness += motion.T @ np.diag(bending) @ motion
        stiffness[2, 2] += ALUMINIUM.G * s.J / height
        mass += 500.0 * motion.T @ motion
    wanted = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real) / (2.0 * np.pi)
    model = Model.of(frame)
    assert [d for n, d in zip(model.dofs.node, model.dofs.direction, strict=True) if n == 8] == [
        "x",
        "y",
        "rz",
    ]
    assert frequencies(frame, 3) == pytest.approx(np.sort(wanted), rel=1e-6)


def test_nothing_hangs_on_a_motion_that_no_link_makes_use_of() -> None:
    frame, at = floor(), Place(joint="M")
    spring, hung = GroundSpring(at, "x", 1e4), Oscillator(at, "x", 1.0, 20.0)
    Model.of(replace(frame, springs=(spring,), oscillators=(hung,)))
    wrong: tuple[dict[str, Any], ...] = (
        {"springs": (replace(spring, direction="-z"),)},
        {"oscillators": (replace(hung, direction="-z"),)},
    )
    for parts in wrong:
        with pytest.raises(ModelError, match=r"no member ends at joint 'M' and no link moves it"):
            Model.of(replace(frame, **parts))
    assert not [p for p in BraceSpring().places(Model.of(frame)) if "M" in p]


def ring(plane: Plane, linked: bool, elements: int = 2) -> Frame:
    """Return a square with a diagonal, one corner of which is a body of two joints."""
    flat = plane == "out-of-plane"

    def at(name: str, x: float, y: float) -> Joint:
        return joint(name, x, y, 0.0) if flat else joint(name, x, 0.0, y)

    joints = (at("A", 0, 0), at("B", 1, 0), at("C", 1, 1), at("D", 0, 1), at("E", 0.8, 0.9))
    bars = [member(ends, elements) for ends in ("AB", "BC", "CD", "DA", "AE")]
    if not linked:
        bars.append(member("CE", 1, times(1e4), rho=1e-6))
    links = (Link("C", ("E",)),) if linked else ()
    return Frame(plane, "euler-bernoulli", joints, tuple(bars), links=links)


@pytest.mark.parametrize("plane", ["out-of-plane", "3d"])
def test_a_stressed_frame_on_links_keeps_its_rigid_modes(plane: Plane) -> None:
    structure = Structure.build(ring(plane, linked=True))
    rigid = rigid_modes_of(Model.of(structure))
    assert "AE" in GeometricStiffness(structure).redundant_members()
    matrix = GeometricStiffness(structure).of_preload("AE", 1.0)
    scale = (abs(matrix) @ np.abs(rigid)).max()
    assert np.abs(matrix @ rigid).max() < 1e-11 * scale
    changes = []
    for linked in (True, False):
        plain, tight = (
            solve_modes(Model.of(replace(ring(plane, linked), preloads=preloads)), 12).eigenvalues
            for preloads in ((), (Preload("AE", 3000.0),))
        )
        first = 6 if plane == "3d" else 3
        changes.append((tight / np.where(plain > 0, plain, 1) - 1.0)[first : first + 4])
    assert np.abs(changes[0]).max() > 1e-3
    assert changes[0] == pytest.approx(changes[1], rel=2e-3, abs=1e-6)


def test_a_joint_spring_at_a_follower_turns_against_the_body() -> None:
    frame = tee("3d")
    rigid = replace(frame, joint_springs=(JointSpring("D", "DE", {"rx": 1e9, "ry": 1e9}),))
    soft = replace(frame, joint_springs=(JointSpring("D", "DE", {"rx": 1e3, "ry": 1e3}),))
    wanted = frequencies(frame)[6:]
    assert frequencies(rigid)[6:] == pytest.approx(wanted, rel=1e-4)
    assert (frequencies(soft)[6:10] / wanted[:4]).min() < 0.95
    assert np.count_nonzero(solve_modes(Model.of(soft)).rigid) == 6


def test_no_brace_ties_what_links_or_a_straight_run_join() -> None:
    frame = tee("3d", Link("B", ("D",)))
    joints = (*frame.joints, joint("F", 0.9, 0.0, 0.05), joint("G", -1.0, 0.3, 0.0))
    bars = (*frame.members, member("AG"))
    links = (*frame.links, Link("C", ("F",)))
    model = Model.of(replace(frame, joints=joints, members=bars, links=links))
    pairs = set(BraceSpring().places(model))
    gone = {"B-D", "C-F"} | {"A-C", "A-D", "A-F", "B-F", "C-D", "D-F"}
    assert not pairs & gone
    assert {"A-E", "C-E", "E-F", "E-G", "B-G", "C-G", "D-G", "F-G"} == pairs - {"B-E"}


def test_links_that_say_too_much_are_refused() -> None:
    for links, what in (
        ((Link("B", ("X",)),), "there is no joint 'X'"),
        ((Link("B", ("D",)), Link("D", ("E",)), Link("E", ("B",))), "round in a circle"),
        ((Link("B", ("A", "D"), ("w",)),), "has the motions x, y, z, rx, ry, rz"),
    ):
        with pytest.raises(ModelError, match=what):
            Model.of(tee("3d", *links))


def test_what_follows_is_held_by_its_leader() -> None:
    frame = tee("3d", supports=(Support(Place(joint="B"), CLAMP),))
    assert rigid_modes_of(Model.of(frame)).shape[1] == 0


CASE = """
[case]
name = "tee"
[model]
kind = "frame"
plane = "in-plane"
joints = [
  {name = "A", xyz = [0.0, 0.0, 0.0]}, {name = "B", xyz = [1.0, 0.0, 0.0]},
  {name = "C", xyz = [1.0, 0.0, 0.1]}, {name = "D", xyz = [2.0, 0.0, 0.1]},
]
members = [
  {name = "low", ends = ["A", "B"], elements = 4, section = "bar", material = "steel"},
  {name = "high", ends = ["C", "D"], elements = 4, section = "bar", material = "steel"},
]
materials = {steel = {E = 2.1e11, nu = 0.3, rho = 7850.0}}
sections = {bar = {shape = "solid-rectangle", width = 0.02, height = 0.02}}
[[model.links]]
leads = "B"
follows = ["C"]
motions = ["x", "z", "ry"]
[[model.supports]]
at = "A"
fixed = ["x", "z", "ry"]
[measurement]
sensors = "sensors.csv"
modes = "modes.csv"
used = [1]
"""


def write(folder: Path, text: str = CASE) -> Path:
    folder.mkdir()
    (folder / "case.toml").write_text(text)
    (folder / "sensors.csv").write_text("label,at,direction\nS1,D,z\nS2,C,z\n")
    (folder / "modes.csv").write_text("mode,frequency,frequency_std,S1,S2\n1,5,0.05,1,0.3\n")
    return folder


def test_a_case_with_links_reads_back_to_itself(tmp_path: Path) -> None:
    turned = CASE.replace(LINK, '[[model.links]]\nleads = "C"\nfollows = ["B"]\n')
    assert read_case(write(tmp_path / "turned", turned)).model.size > 0
    case = read_case(write(tmp_path / "tee"))
    frame = case.model.frame_structure.frame
    assert frame.links == (Link("B", ("C",), ("x", "z", "ry")),)
    write_case(tmp_path / "again", case)
    assert read_case(tmp_path / "again").model.frame_structure.frame == frame
    lines = (tmp_path / "again" / "matrices" / "dofs.csv").read_text().splitlines()
    assert {line.split(",")[1] for line in lines if ",C," in line or ",B," in line} == {"B"}


LINK = '[[model.links]]\nleads = "B"\nfollows = ["C"]\nmotions = ["x", "z", "ry"]\n'


@pytest.mark.parametrize(
    ("new", "line", "key", "what", "expected"),
    [
        ('[[model.links]]\nleads = "X"\nfollows = ["C"]\n', 1, "links[0].leads", "'X'", "joint"),
        ('[[model.links]]\nleads = "B"\nfollows = ["C", "Y"]\n', 2, "follows[1]", "'Y'", "joint"),
        ('[[model.links]]\nleads = "B"\nfollows = ["B"]\n', 2, "follows[0]", "itself", "another"),
        ('[[model.links]]\nleads = "B"\nfollows = []\n', 2, "links[0].follows", "number", "list"),
        (LINK.replace('"ry"', '"y"'), 3, "links[0].motions", "'y'", "x, z, ry"),
        (LINK.replace('["C"]', '["C", "C"]'), 2, "follows[1]", "twice", "its own"),
        (LINK.replace("leads", "lead"), 1, "links[0].lead", "'leads' meant", "follows"),
        (LINK + LINK.replace('"B"', '"D"'), 4, "links[1]", "'C' follows 'B' and 'D'", "one"),
        ("", -18, "joints[2]", "not connected to 'A'", "members or links"),
    ],
)
def test_what_is_wrong_with_a_link_is_one_line(
    new: str, line: int, key: str, what: str, expected: str, tmp_path: Path
) -> None:
    folder = write(tmp_path / "tee", CASE.replace(LINK, new))
    with pytest.raises(InputError) as caught:
        read_case(folder)
    error = caught.value
    assert str(error.key).endswith(key)
    assert what in error.what
    assert expected in str(error.expected)
    first = CASE[: CASE.index(LINK)].count("\n") + 1
    if "joints" not in key:
        assert error.line == first + line
    assert "\n" not in str(error)


def test_a_support_of_a_follower_is_one_line(tmp_path: Path) -> None:
    text = CASE.replace('at = "A"', 'at = "C"')
    what = r"model\.supports\[0\]: a support holds joint 'C'"
    with pytest.raises(InputError, match=what) as caught:
        read_case(write(tmp_path / "tee", text))
    assert caught.value.line == text[: text.index("[[model.supports]]")].count("\n") + 1
