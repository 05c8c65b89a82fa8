"""What drawings lack: shares that add up, blocks that are rigid, files that are read as written."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from truths.counterfactuals import Budget, Share, constants, shapley
from truths.eigenmodes import attach, bind, solve
from truths.lacks import in_overlap
from truths.lacks_file import LACKS, Lacks, lacks_of, lacks_text, read_lacks, refusal
from truths.modes_of import assembled, mesh_of
from truths.posing import ROOT, SUITE
from truths.sections import bar, rectangular_tube
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
    area, square = constants(bar(0.02, 0.02))
    np.testing.assert_allclose(area, 4e-4, rtol=1e-9)
    np.testing.assert_allclose(square, 0.140577 * 0.02**4, rtol=1e-3)
    tube = constants(rectangular_tube(0.1, 0.1, 0.001))[1]
    np.testing.assert_allclose(tube, 0.099**3 * 0.001, rtol=0.01)


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
