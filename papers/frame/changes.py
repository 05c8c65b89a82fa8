"""Figures 3 to 5 of the frame paper: what the updates changed in the stiffness matrices."""

from __future__ import annotations

import numpy as np

from femubench import Model, UpdateResult
from femubench.fem import FloatArray, Structure
from femubench.plot import wireframe_of
from femubench.reproduction import Figure, MatrixImage, StructureMap, Workbench
from femubench.results import element_norms, stiffness_difference
from femubench.update import ElementFamily

CASE = "frame"
SOLUTIONS = {"least squares": "generic-ls", "adjusted": "generic-adjusted"}


def change_figures(bench: Workbench) -> tuple[Figure, ...]:
    """Return figures 3 to 5, from modes 1-3 of the case ``frame``."""
    model = bench.cases[CASE].model
    baruch = bench.update(CASE, "baruch").model
    return (
        _matrix_figure(model, baruch),
        *(_element_figure(bench, 4 + i, solution) for i, solution in enumerate(SOLUTIONS)),
    )


def recover_change(family: ElementFamily, result: UpdateResult) -> FloatArray:
    """Return the change of the local element matrices from the parameters, (n_elements, 12, 12)."""
    assert family.names == tuple(p.name for p in result.parameters)
    after = np.array([p.after for p in result.parameters])
    return family.change(family.relative(after))


def relative_change(structure: Structure, change: FloatArray) -> FloatArray:
    """Return |dK_e| / |K0_e| of every element, Frobenius norms on w, L dw/dx, L theta, (n,).

    Arguments:
        structure: the nominal frame.
        change: of the local element matrices, (n, 12, 12).
    """
    nominal = structure.properties.stiffness_matrices()
    return element_norms(structure, change) / element_norms(structure, nominal)


def _matrix_figure(model: Model, updated: Model) -> MatrixImage:
    change = stiffness_difference(model, updated)
    zero = model.stiffness.toarray() == 0.0
    outside = float(np.sum(change[zero] ** 2) / np.sum(change**2))
    frame, nodes = model.frame_structure.frame, model.dofs.node
    first = len(frame.joints)
    starts = [first]
    for member in frame.members[:-1]:
        starts.append(starts[-1] + member.elements - 1)
    members = ", ".join(member.name for member in frame.members)
    return MatrixImage(
        name="frame-figure-3",
        title="Fig. 3: difference matrix K₀ − K(Baruch), modes 1-3",
        caption="On the paper's degrees of freedom w, L dw/dx, L θ with the mean element length L, "
        f"so that all entries share a unit. Blocks: the six joints, then {members}. Entries where "
        f"K₀ is zero hold {100.0 * outside:.0f} % of the squared norm.",
        matrix=change,
        row_label="degree of freedom (w, L θx, L θy of every node)",
        column_label="degree of freedom (w, L θx, L θy of every node)",
        value_label="|K₀ − K|, N/m",
        separators=tuple(int(np.searchsorted(nodes, start)) for start in starts),
    )


def element_kinds(structure: Structure) -> FloatArray:
    """Return which elements touch an L joint, a T joint, or none, as rows of ones, (3, n)."""
    kinds = np.zeros((3, len(structure.properties)))
    for row, kind in enumerate("LT"):
        for end in structure.joint_ends[kind]:
            kinds[row, structure.element_ends[end][0]] = 1.0
    kinds[2] = 1.0 - kinds[:2].max(axis=0)
    return kinds


def solution_changes(bench: Workbench, words: str) -> FloatArray:
    """Return the relative change of every element in a solution with generic elements, (n,).

    Arguments:
        bench: with the case ``frame``.
        words: ``generic-ls`` or ``generic-adjusted``.
    """
    structure = bench.cases[CASE].model.frame_structure
    family = ElementFamily.generic(structure, tied=words == "generic-adjusted")
    return relative_change(structure, recover_change(family, bench.update(CASE, words)))


def change_sentences(bench: Workbench) -> tuple[str, ...]:
    """Return where the paper finds the errors of the elements, and where they come out here."""
    structure = bench.cases[CASE].model.frame_structure
    kinds = element_kinds(structure)
    parts = []
    for name, words in SOLUTIONS.items():
        means = kinds @ solution_changes(bench, words) / kinds.sum(axis=1)
        where = ("L joints", "T joints", "plain elements")
        most = where[int(np.argmax(means))]
        listed = ", ".join(f"{w} {m:.3f}" for w, m in zip(where, means, strict=True))
        parts.append(f"{name}: {listed}, most in {most}")
    return (
        "Figures 4 and 5, mean relative change of element stiffness. The paper finds the least "
        "squares solution in connecting beams and joints, the adjusted one mainly in the joints. "
        f"Here {'; '.join(parts)}.",
    )


def _joints(structure: Structure) -> str:
    """Return which joints are of which kind."""
    joints = structure.frame.joints
    kinds = {kind: ", ".join(j.name for j in joints if j.type == kind) for kind in "LT"}
    return "; ".join(f"{kind} joints: {names}" for kind, names in kinds.items())


def _element_figure(bench: Workbench, number: int, solution: str) -> StructureMap:
    structure, words = bench.cases[CASE].model.frame_structure, SOLUTIONS[solution]
    return StructureMap(
        name=f"frame-figure-{number}",
        title=f"Fig. {number}: relative change of element stiffness, {solution} solution",
        caption=f"‖ΔKₑ‖/‖K₀ₑ‖ of every element, Frobenius norms on w, L dw/dx, L θ, strategy "
        f"{words}, modes 1-3. {_joints(structure)}. The shapes are a solid twin's, not the test's.",
        structure=wireframe_of(bench.cases[CASE].model),
        values=solution_changes(bench, words),
        value_label="‖ΔKₑ‖/‖K₀ₑ‖, no unit",
    )
