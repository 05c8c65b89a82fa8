"""Statements of the paper that contradict themselves, each with the figure that shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la

from femubench import Model, solve_modes
from femubench.fem import FloatArray, Structure
from femubench.papers.frame.common import CASE, format_frequencies, strain_modes
from femubench.reproduction import Extra, Workbench
from femubench.update import ElementFamily, QuasiModes, Symmetry

_TORSION_FACTOR = 140.0


def misprint_table(bench: Workbench) -> Extra:
    """Return what is misprinted or contradictory, and what shows it."""
    rows = (_rotation(bench), _torsional_mass(bench), _symmetry(bench), _stiffness_parameter(bench))
    return Extra(
        "Misprints and contradictions",
        ("where", "printed", "should be", "what shows it"),
        rows,
        "Everything here is computed with the right-hand version.",
    )


def rotations(bench: Workbench) -> tuple[float, float]:
    """Return |measured R - analytical| at the sensors with R = U V' and with R = V U'.

    Relative to the analytical shapes.
    """
    case = bench.cases[CASE]
    used = case.used_measurement()
    quasi = QuasiModes.of(case.model, used)
    analytical = (case.model.observe(used.sensors) @ quasi.modes.shapes)[:, quasi.partners]
    scale = np.linalg.norm(analytical, axis=0) / np.linalg.norm(used.shapes, axis=0)
    sign = np.sign(np.einsum("ij,ij->j", used.shapes, analytical))
    measured = used.shapes * scale * sign
    left, _, right = la.svd(measured.T @ analytical)
    size = np.linalg.norm(analytical)
    distance = [np.linalg.norm(measured @ r - analytical) for r in (left @ right, (left @ right).T)]
    return float(distance[0] / size), float(distance[1] / size)


def _rotation(bench: Workbench) -> tuple[str, ...]:
    right, transposed = rotations(bench)
    return (
        "below equation (16)",
        "R = V U'",
        "R = U V'",
        f"distance of the rotated shapes {100 * right:.2f} % with U V', "
        f"{100 * transposed:.2f} % with V U'",
    )


def with_printed_torsional_mass(structure: Structure) -> FloatArray:
    """Return the first five frequencies in Hz with the torsional inertia as printed, (5,)."""
    frame = structure.frame
    members = tuple(
        replace(m, section=replace(m.section, Jp=m.section.Jp / _TORSION_FACTOR))
        for m in frame.members
    )
    model = Model.of(replace(frame, members=members))
    return np.asarray(solve_modes(model).elastic.natural_frequencies[:5])


def _torsional_mass(bench: Workbench) -> tuple[str, ...]:
    printed_way = with_printed_torsional_mass(bench.cases[CASE].model.frame_structure)
    return (
        "M0, section 3",
        "m0 rg / 420, m0 rg / 840",
        f"{_TORSION_FACTOR:g} times that: m0 rg / 3, m0 rg / 6",
        "a rod's consistent mass; frequencies "
        f"{format_frequencies(strain_modes(bench, 'unchanged'))} Hz with it, "
        f"{format_frequencies(printed_way)} Hz as printed",
    )


def coupling_terms(structure: Structure) -> dict[str, tuple[str, ...]]:
    """Return which couplings a symmetric element may have, by kind of symmetry."""
    found: dict[str, tuple[str, ...]] = {}
    touched = {structure.element_ends[e][0] for ends in structure.joint_ends.values() for e in ends}
    plain = next(label for i, label in enumerate(structure.labels) if i not in touched)
    kinds: tuple[Symmetry, ...] = ("half-turn", "mirror", "full")
    for kind in kinds:
        names = ElementFamily.generic(structure, plain=kind, joint="none").names
        terms = (name.split(" ", 1)[0] for name in names if name.endswith(f" {plain}"))
        found[kind] = tuple(term for term in terms if term[1] != term[2])
    return found


def _symmetry(bench: Workbench) -> tuple[str, ...]:
    structure = bench.cases[CASE].model.frame_structure
    left = {kind: ", ".join(terms) or "none" for kind, terms in coupling_terms(structure).items()}
    full = len(ElementFamily.generic(structure, plain="full"))
    return (
        "section 4.3",
        "second and third mode antisymmetric, k12 = k23 = 0",
        "k12 = k13 = 0 (mirror), or k12 = k23 = 0 (half turn), or all three",
        f"couplings left by a mirror: {left['mirror']}, by a half turn: {left['half-turn']}, by "
        f"both: {left['full']}; a tube has both, which leaves {full} parameters, not "
        f"{len(ElementFamily.generic(structure))}",
    )


def _stiffness_parameter(bench: Workbench) -> tuple[str, ...]:
    structure = bench.cases[CASE].model.frame_structure
    p = structure.properties
    length, bending, torsion = float(p.length[0]), float(p.EIy[0]), float(p.GJ[0])
    as_printed = bending / length**3 * (torsion / bending)
    return (
        "equation (19), below (20)",
        "r, k4 = EI r / L^3 = GJ / L",
        "r L^2, k4 = EI r / L = GJ / L",
        f"with r = GJ / EI the printed sides differ by 1 / L^2: {as_printed:.4g} N/m against "
        f"{torsion / length:.4g} N m for the first element",
    )
