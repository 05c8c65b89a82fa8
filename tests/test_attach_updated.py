"""Attachments to models that an update has changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from femubench.core.fem.frame import Frame, GroundSpring, Joint, Material, Member, Place, PointMass
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sections import Section, constant_kappa
from femubench.core.fem.sensors import Sensors
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import solve_modes

FrameBuilder = Callable[..., Frame]
OBLONG = Section(A=4e-4, Iy=3e-8, Iz=1.2e-8, J=1e-8, Jp=4.2e-8, kappa=constant_kappa(0.45))
MATERIAL = Material(70e9, 0.3, 2700.0)


def test_attach_keeps_a_low_rank_update(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    shapes = solve_modes(model).shapes[:, 3:6]
    stiffness = LowRank(np.asarray(model.mass @ shapes), np.diag([-4e5, 2e5, 1e5]))
    mass = LowRank(np.asarray(model.mass @ shapes), np.diag([0.02, 0.0, 0.01]))
    updated = replace(model, stiffness_change=stiffness, mass_change=mass)
    at = Place(member="EF", s=0.5)  # an existing node: the dense algebra is simple
    after = updated.attach([PointMass(at, 0.5)], [GroundSpring(at, "z", 1e6)])
    row = model.observe(Sensors(("s",), np.array([[0.2921 * 1.5, 0.2794, 0.0]]), ("z",))).toarray()
    K = model.stiffness.toarray() + stiffness.toarray() + 1e6 * row.T @ row
    M = model.mass.toarray() + mass.toarray() + 0.5 * row.T @ row
    expected = np.linalg.eigvals(np.linalg.solve(M, K)).real
    np.testing.assert_allclose(
        solve_modes(after).eigenvalues[:12], np.sort(expected)[:12], rtol=1e-7, atol=1e-2
    )


def test_attach_between_nodes_carries_the_update_to_the_old_dofs(ladder: FrameBuilder) -> None:
    model = Model.of(ladder())
    change = sp.csc_array(sp.diags_array(np.linspace(1e2, 1e3, 81)))
    basis = np.random.default_rng(0).standard_normal((81, 2))
    updated = replace(
        model, stiffness=model.stiffness + change, stiffness_change=LowRank(basis, np.eye(2))
    )
    at = Place(member="EF", s=0.4)
    after, plain = (m.attach([PointMass(at, 0.5)], []) for m in (updated, model))
    assert after.size == 84
    difference = (after.stiffness - plain.stiffness).toarray()
    assert after.stiffness_change is not None
    new = [
        i
        for i, xyz in enumerate(after.dofs.xyz)
        if np.linalg.norm(xyz - [0.2921 * 1.4, 0.2794, 0.0]) < 1e-9
    ]
    old = np.setdiff1d(np.arange(84), new)
    assert len(new) == 3
    np.testing.assert_array_equal(after.dofs.xyz[old], model.dofs.xyz)
    np.testing.assert_allclose(difference[np.ix_(old, old)], change.toarray(), atol=1e-5)
    np.testing.assert_array_equal(after.stiffness_change.basis[old], basis)
    assert not after.stiffness_change.basis[new].any()


def test_attach_to_crossing_members_finds_the_right_dofs() -> None:
    square = {
        "A": (0.0, 0.0, 0.0),
        "B": (1.0, 1.0, 0.0),
        "C": (1.0, 0.0, 0.0),
        "D": (0.0, 1.0, 0.0),
    }
    joints = tuple(Joint(name, xyz) for name, xyz in square.items())
    # AB and CD cross in the middle without touching; only CD has a node there.
    members = [Member("AB", ("A", "B"), 3, OBLONG, MATERIAL)]
    members += [
        Member(p, (p[0], p[1]), 4, OBLONG, MATERIAL) for p in ("CD", "AC", "CB", "BD", "DA")
    ]
    model = Model.of(Frame("out-of-plane", "euler-bernoulli", joints, tuple(members)))
    shapes = solve_modes(model).shapes[:, 3:5]
    updated = replace(
        model, stiffness_change=LowRank(np.asarray(model.mass @ shapes), np.diag([-1e4, 3e4]))
    )
    attached = updated.attach([PointMass(Place(member="AB", s=0.5), 1e-9)], [])
    found = solve_modes(attached).elastic.natural_frequencies[:6]
    np.testing.assert_allclose(
        found, solve_modes(updated).elastic.natural_frequencies[:6], rtol=5e-3
    )
    assert attached.stiffness_change is not None
    middle = np.flatnonzero(np.linalg.norm(attached.dofs.xyz - [0.5, 0.5, 0.0], axis=1) < 1e-9)
    own = attached.stiffness_change.basis[middle]
    assert len(own) == 6
    assert np.count_nonzero(np.abs(own).max(axis=1) > 0.0) == 3


def test_attach_repeats_parameter_changes(asymmetric_ladder: FrameBuilder) -> None:
    structure = Structure.build(asymmetric_ladder())
    parameters = [Property("E", "EI", ("EF/2",)), Property("k", "spring", ("CF@F:ry",))]
    updated = Model.of(structure.with_values(parameters, [0.5, 4e3]))
    after = updated.attach([PointMass(Place(member="EF", s=0.4), 0.5)], [])
    changed = after.frame_structure
    ratio = changed.properties.EIy / Structure.build(changed.frame).properties.EIy
    halves = [ratio[i] for i, label in enumerate(changed.labels) if label == "EF/2"]
    assert halves == pytest.approx([0.5, 0.5])
    assert changed.springs[changed.spring_labels.index("CF@F:ry")] == 4e3
    assert ratio.sum() == pytest.approx(len(ratio) - 1.0)
