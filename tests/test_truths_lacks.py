"""What drawings lack: shares that add up, blocks that are rigid, files that are read as written."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femubench import Model, fem
from truths.counterfactuals import Budget, Share, shapley
from truths.eigenmodes import attach, bind, solve
from truths.lacks import in_overlap
from truths.lacks_file import LACKS, Lacks, lacks_of, lacks_text, read_lacks, refusal
from truths.modes_of import assembled, mesh_of
from truths.posing import ROOT, SUITE
from truths.section_features import ECCENTRIC, SHEAR_CENTRE, WARPING, Sections, constants
from truths.sections import angle, bar, channel, i_beam, rectangular_tube
from truths.structure import Member
from truths.suite import structures


@pytest.fixture(scope="module")
def found() -> list[Lacks]:
    return [read_lacks(file) for file in sorted(LACKS.glob("*.toml"))]


def test_features_and_remainder_are_the_misfit(found: list[Lacks]) -> None:
    for item in found:
        parts = np.array([part.contribution for part in item.features])
        misfit = np.log(np.array(item.solid) / item.drawing)
        rounding = 1e-5 * (len(parts) + 2)
        np.testing.assert_allclose(item.misfit, misfit, atol=rounding)
        np.testing.assert_allclose(parts.sum(axis=0) + item.remainder, misfit, atol=rounding)
        net = np.array([part.contribution for part in item.net])
        np.testing.assert_allclose(net.sum(axis=0), parts.sum(axis=0), atol=rounding)
        judged = refusal(*(np.array(v) for v in (item.misfit, item.remainder, item.mac)))
        assert judged == item.refused, item.structure


@pytest.mark.slow(3)
def test_an_overlap_that_is_bound_holds_no_energy() -> None:
    structure = structures()["bracket"]
    solid = mesh_of(structure, 0.05)
    matrices = assembled(structure, solid)
    body = np.flatnonzero(in_overlap(structure, "B", matrices.straight))
    inside = np.isin(np.arange(matrices.nodes.shape[1]), body)
    block = solid.without(~in_overlap(structure, "B", solid.centres))
    own = assembled(structure, block)
    where = np.array([np.abs(matrices.nodes - p[:, None]).sum(0).argmin() for p in own.nodes.T])
    assert inside[where].all()
    dofs = (3 * where[:, None] + np.arange(3)).ravel()
    system = attach(structure, matrices, structure.lumps, structure.springs)
    energy = []
    for state in (system, bind(system, matrices.nodes, [body])):
        shapes = solve(state, 6, structure.guess).shapes
        part, all_of_it = shapes[dofs], matrices.stiffness @ shapes
        energy.append(
            np.einsum("ij,ij->j", part, own.stiffness @ part)
            / np.einsum("ij,ij->j", shapes, all_of_it)
        )
    assert energy[0].max() > 1e-2
    assert energy[1].max() < 1e-9


def test_features_of_a_group_share_its_effect() -> None:
    """Two that only work together have half of it each; one that works alone has its own."""
    value = {(): 9.0, (0,): 3.0, (1,): 3.0, (0, 1): 2.0, (2,): 7.0}

    def shares(out: frozenset[int]) -> float:
        return value[tuple(sorted(out))]

    assert [shapley(shares, i, {0, 1}, ()) for i in (0, 1)] == [3.5, 3.5]
    assert shapley(shares, 2, {2}, ()) == 2.0


def test_a_torsion_constant_is_st_venant_s() -> None:
    square = constants(bar(0.02, 0.02).rectangles)
    np.testing.assert_allclose(square.area, 4e-4, rtol=1e-9)
    np.testing.assert_allclose(square.torsion, 0.140577 * 0.02**4, rtol=1e-3)
    tube = constants(rectangular_tube(0.1, 0.1, 0.001).rectangles)
    np.testing.assert_allclose(tube.torsion, 0.099**3 * 0.001, rtol=0.01)


def test_open_sections_have_the_constants_of_thin_walls() -> None:
    """Of centre lines b wide and h deep: Timoshenko (1945), J. Franklin Inst. 239."""
    b, h, t = 0.05, 0.1, 0.001
    u = constants(channel(b + t / 2, h + t, t, t).rectangles)
    beyond = 3.0 * b**2 / (6.0 * b + h)  # the web, away from the flanges
    web = b * b / (2.0 * b + h)  # from it to the centroid
    np.testing.assert_allclose(u.centre, [-beyond - web, 0.0], atol=0.01 * b)
    warped = t * b**3 * h**2 / 12.0 * (3.0 * b + 2.0 * h) / (6.0 * b + h)
    np.testing.assert_allclose(u.warping, warped, rtol=0.03)
    i = constants(i_beam(b, h + t, t, t).rectangles)
    np.testing.assert_allclose(i.warping, t * b**3 / 12.0 * h**2 / 2.0, rtol=0.02)
    np.testing.assert_allclose(i.centre, 0.0, atol=1e-9)
    a = constants(angle(b, b, t).rectangles)
    np.testing.assert_allclose(a.centre, -(b / 4) * np.ones(2), rtol=0.05)
    np.testing.assert_allclose(a.second[0, 1], -t * b**3 / 8.0, rtol=0.05)


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    shares = (
        Share("joint-stiffness", "type:tee", "walls", "solid", np.array([-0.1, 0.0]), np.zeros(2)),
        Share("joint-stiffness", "type:tee", "arms", "drawing", np.full(2, 0.04), np.full(2, 0.02)),
    )
    budget = Budget(np.array([9.0, 20.0]), np.array([10.0, 20.0]), shares, np.array([0.8, 1.0]))
    item = lacks_of(structures()["portal"], budget)
    assert item.refused == "the remainder is 0.86 of the misfit and the ideal MAC of mode 1 is 0.80"
    assert [part.contribution for part in item.net] == [(-0.02, 0.03)]
    assert [part.spread for part in item.net] == [(0.04, 0.01)]
    (tmp_path / "portal.toml").write_text(lacks_text(item))
    assert read_lacks(tmp_path / "portal.toml") == item


def test_no_case_holds_what_its_drawing_lacks() -> None:
    """Cases are read from their folders and shipped with the package; these truths are not."""
    assert not LACKS.resolve().is_relative_to(SUITE.resolve())
    for file in SUITE.rglob("*"):
        if file.suffix in (".toml", ".csv", ".md"):
            assert "remainder" not in file.read_text(encoding="utf-8"), file
    for room in ("core", "plugins", "reports", "papers", "scenarios"):
        for module in (ROOT / room).rglob("*.py"):
            text = module.read_text(encoding="utf-8")
            assert not re.search(r"^\s*(from|import) truths|data/lacks", text, re.MULTILINE), module


def test_a_force_at_its_centroid_twists_a_channel_by_less_where_its_end_cannot_warp() -> None:
    shape, span = channel(0.05, 0.09, 0.006, 0.007), 1.0
    own = constants(shape.rectangles)
    (yy, _), (_, zz) = own.second
    steel, ends = fem.Material(210e9, 0.3, 7850.0), {"A": (0.0, 0.0, 0.0), "B": (span, 0.0, 0.0)}
    drawn = fem.Section(own.area, zz, yy, own.torsion, yy + zz)
    frame = fem.Frame(
        *("3d", "euler-bernoulli"),
        joints=tuple(fem.Joint(name, at) for name, at in ends.items()),
        members=(fem.Member("m", ("A", "B"), 4, drawn, steel),),
        supports=(fem.Support(fem.Place("A"), ("x", "y", "z", "rx", "ry", "rz")),),
    )
    member = Member("m", ("A", "B"), "u", "steel")
    like = structures()["ladder-channel"]
    made = replace(like, sections={"u": shape}, members=(member,), joints=ends, plane="3d")
    sections = Sections(made, frame, ["A"])
    plain, p = Model.of(frame), span * np.sqrt(steel.G * own.torsion / (steel.E * own.warping))
    tip = [plain.dofs.direction.index(d) for d in ("z", "rx")]  # A is held, so that B comes first
    twist = -own.centre[0] * span / (steel.G * own.torsion)
    for names, share in ((SHEAR_CENTRE,), 1.0), ((SHEAR_CENTRE, WARPING), 1.0 - np.tanh(p) / p):
        stiffness = sections.refine(plain, names).stiffness.toarray()
        moved = np.linalg.solve(stiffness, np.eye(plain.size)[tip[0]])
        np.testing.assert_allclose(moved[tip[1]], share * twist, rtol=1e-3)
    shifted = tuple((a + 0.03, b + 0.03, *rest) for a, b, *rest in shape.rectangles)
    off = replace(made, sections={"u": replace(shape, rectangles=shifted)})
    stiffness = Sections(off, frame, ()).refine(plain, [ECCENTRIC]).stiffness.toarray()
    pull, turn = (plain.dofs.direction.index(d) for d in ("x", "rz"))
    moved = np.linalg.solve(stiffness, np.eye(plain.size)[pull])
    np.testing.assert_allclose(moved[turn], 0.03 * span / (steel.E * yy), rtol=1e-6)
