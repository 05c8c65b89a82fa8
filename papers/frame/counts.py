"""Counts and claims in figures that stand in the text."""

from __future__ import annotations

from collections import Counter

import numpy as np
import scipy.sparse as sp

from femubench.fem import IntArray
from femubench.papers.frame.common import (
    CASE,
    PAPER,
    TRUTH,
    TWIN_SHAPES,
    format_frequencies,
    modes_of,
    rigid_modes,
    strain_modes,
)
from femubench.papers.printed import read_printed
from femubench.reproduction import Cell, Ground, Page, Workbench
from femubench.update import ElementFamily

_NAMES = {
    "joints_L": "L joints",
    "joints_T": "T joints",
    "measured_points": "measured coordinates",
    "elements": "elements",
    "joint_elements": "elements at joints",
    "symmetric_elements": "other elements, symmetric",
    "element_order": "order of an element matrix",
    "element_rank": "rank of an element stiffness matrix",
    "joint_element_parameters": "generic parameters of an element at a joint",
    "symmetric_element_parameters": "generic parameters of a symmetric element",
    "nonzeros": "non-zero entries in the upper triangle of K0",
    "equations": "equations for three modes",
    "nobari_parameters": "parameters of Nobari's method",
    "generic_parameters": "generic parameters",
    "rigid_body_modes": "rigid-body modes",
    "nobari_imaginary": "imaginary frequencies of Nobari's model",
    "nobari_zero": "zero frequencies of Nobari's model",
    "nobari_rigid_difference": "Nobari's model with rigid-body modes against the physical one",
}
_EQUAL = 1e-6  # of the frequency: what counts as the same result
_ZERO = 1e-3  # Hz
_COUNTED = Ground(
    "input",
    "a count of the structure, of its model or of what a family frees: it is what the model is "
    "built by, or follows from that by counting",
)
_PUSHED = Ground(
    "independent",
    "the matrices of (20) are free of force in a translation, whatever their factors, and the "
    "update leaves no other rigid-body motion free",
)
_THE_SAME = Ground(
    "independent",
    "with nothing chosen: any other shapes leave the two the same, since the matrices of (20) that "
    "keep the rigid-body modes are the physical ones",
)


def count_cells(bench: Workbench) -> tuple[Cell, ...]:
    """Return the cells of what the text counts or claims in figures."""
    rigid = rigid_modes(bench, "nobari")
    case = bench.cases[CASE]
    structure = case.model.frame_structure
    types = Counter(joint.type for joint in structure.frame.joints)
    at_joints = {
        structure.element_ends[e][0] for ends in structure.joint_ends.values() for e in ends
    }
    family = ElementFamily.generic(structure)
    free = (family.columns >= 0).sum(axis=1)
    touches = np.isin(family.elements, list(at_joints))
    element = ElementFamily.physical(structure).patterns[0].sum(axis=0)
    ours = {
        "joints_L": types["L"],
        "joints_T": types["T"],
        "measured_points": len(case.measurement.sensors),
        "elements": len(family.elements),
        "joint_elements": int(touches.sum()),
        "symmetric_elements": int((~touches).sum()),
        "element_order": int(structure.active_local.sum()),
        "element_rank": int(np.linalg.matrix_rank(element, hermitian=True)),
        "joint_element_parameters": _only(free[touches]),
        "symmetric_element_parameters": _only(free[~touches]),
        "nonzeros": int(sp.triu(case.model.stiffness).nnz),
        "rigid_body_modes": int(modes_of(bench, "unchanged").rigid.sum()),
    } | {
        "equations": int(bench.update(CASE, "generic-ls").diagnostics["equations"]),
        "nobari_parameters": bench.update(CASE, "nobari").parameter_count,
        "generic_parameters": bench.update(CASE, "generic-ls").parameter_count,
        "nobari_imaginary": int((rigid < -_ZERO).sum()),
        "nobari_zero": int((np.abs(rigid) <= _ZERO).sum()),
    }
    beams = format_frequencies(rigid_modes(bench, "nobari", TRUTH))
    words = f"{TWIN_SHAPES}; with the beam truth and its shapes {beams} Hz"
    apart = {"nobari_zero": _PUSHED, "nobari_imaginary": Ground("under-convention", words)}
    cells = [
        Page(PAPER, "text", (apart.get(key, _COUNTED),), tolerance=0.0).cell(
            _NAMES[key], "count", float(value), float(ours[key])
        )
        for key, value in read_printed(PAPER)["text"].items()
        if key in ours
    ]
    page = Page(PAPER, "text", (_THE_SAME,), "%", tolerance=100.0 * _EQUAL)
    one, other = strain_modes(bench, "nobari-rigid"), strain_modes(bench, "physical")
    off = 100.0 * float(np.abs(one / other - 1.0).max())
    key = "nobari_rigid_difference"
    return (
        *cells,
        page.cell(_NAMES[key], "difference", float(read_printed(PAPER)["text"][key]), off),
    )


def _only(values: IntArray) -> int:
    """Return the one value that all elements have; -1 where they differ."""
    return int(values[0]) if (values == values[0]).all() else -1
