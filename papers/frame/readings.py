"""Why some columns do not follow: figures for the reasons, and the columns under each reading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from femubench.papers.frame.common import (
    CASE,
    TRUTH,
    TWIN_SHAPES,
    format_frequencies,
    modes_of,
    rigid_modes,
    strain_modes,
)
from femubench.reproduction import Extra, Ground, Workbench
from femubench.update import ElementFamily, QuasiModes

SEARCH = "docs/reproduce.md has the search"
# Readings of one column in the grid of docs/reproduce.md, and those that the page says were tried
# for all columns before the grid was chosen.
TRIED, EXPLORED = 2208, 17000
CUTOFFS = (0.1, 0.03, 0.01, 0.001, 0.0003, 0.0001, 0.00001)


def kabe_words(cutoff: float) -> str:
    """Return the words that choose a cutoff."""
    return f"kabe:cutoff={cutoff:g}"


def kabe_reason(bench: Workbench) -> str:
    """Return why the column of changed non-zeros cannot be determined from the text."""
    low, high = kabe_words(CUTOFFS[-1]), "kabe"
    ranks = [int(bench.update(CASE, words).diagnostics["rank"]) for words in (high, low)]
    entries = int(bench.update(CASE, high).diagnostics["entries"])
    higher, worse = strain_modes(bench, high)[3:], modes_of(bench, low).natural_frequencies[:8]
    return (
        f"{ranks[0]} of {entries} unknowns are determined above a cutoff of 0.03, {ranks[1]} above "
        f"0.00001; the text gives no cutoff, and it decides: rigid-body modes at "
        f"{format_frequencies(rigid_modes(bench, high))} Hz and modes 4, 5 at "
        f"{format_frequencies(higher)} Hz with the first, first eight modes at "
        f"{format_frequencies(worse)} Hz with the second ({low})"
    )


def explain_met(bench: Workbench, words: str, values: Sequence[float]) -> str:
    """Return why a column whose used modes stay near the nominal ones is no least squares.

    Arguments:
        values: the printed column in Hz.
    """
    factor, before, after = uniform_factor(bench, _first(bench))
    met = format_frequencies(strain_modes(bench, words)[:3])
    asked = f"{words}:frequencies=nominal"
    return (
        f"the described equations are met with modes 1-3 at {met} Hz, while the printed ones "
        f"stay near the nominal model; one common factor of {factor:.3f} on K0 alone, a "
        f"member of the family, takes the equation error from {before:.1f} to {after:.1f} % of the "
        "inertia forces, so no least-squares solution stays there. Asking for the nominal "
        f"frequencies, against the text, comes within {farthest(bench, asked, values):.1f} % "
        f"({asked}); but so does no update at all within "
        f"{farthest(bench, 'unchanged', values):.1f} %, which makes it no explanation; {SEARCH}"
    )


def farthest(bench: Workbench, words: str, values: Sequence[float]) -> float:
    """Return the largest deviation of the five frequencies from a printed column in percent."""
    return float(100.0 * np.abs(strain_modes(bench, words) / np.asarray(values) - 1.0).max())


def explain_higher_modes(bench: Workbench, words: str) -> Ground:
    """Return what the higher modes of the least squares solution rest on."""
    used, tied = strain_modes(bench, words)[:3], "generic-adjusted:expansion=force"
    adjusted, exact, motion = (
        format_frequencies(strain_modes(bench, other)[3:])
        for other in (tied, "generic-ls", "generic-ls:orthogonality=false")
    )
    return Ground(
        "searched",
        f"shapes expanded by (15), where the text has (16)-(17) ({words}), one of {TRIED} readings "
        f"of this column that were tried, after about {EXPLORED} with random choices "
        f"(docs/reproduce.md): it has modes 1-3 at {format_frequencies(used)} Hz, but the adjusted "
        f"solution at {adjusted} Hz; with (16)-(17) modes 4, 5 are {exact} Hz, from the equations "
        f"of motion alone {motion} Hz; {TWIN_SHAPES}; {beam_shapes(bench, words)}",
        TRIED,
    )


def beam_shapes(bench: Workbench, words: str) -> str:
    """Return modes 4 and 5 with the shapes of the beam truth in place of the twin's."""
    found = format_frequencies(strain_modes(bench, words, TRUTH)[3:])
    return f"with the beam truth and its shapes {found} Hz, so the shapes decide"


def explain_adjusted(bench: Workbench) -> str:
    """Return why sixteen parameters on expanded shapes do not give the printed column."""
    bend, shear, twist = energy_shares(bench)
    alone = strain_modes(bench, "generic-adjusted:orthogonality=false")
    return (
        "shapes expanded by (16)-(17) are combinations of the model's own, in which the shear core "
        f"k22 has {shear:.1f} % of the strain energy (bending {bend:.1f}, twist {twist:.1f} %), so "
        "it can hardly be seen; without the orthogonality equations the column is "
        f"{format_frequencies(alone)} Hz; {SEARCH}"
    )


def uniform_factor(bench: Workbench, quasi: QuasiModes) -> tuple[float, float, float]:
    """Return the best factor on K0, and the equation error without and with it in percent.

    |c K0 Phi - M0 Phi Lambda| is least over c; forces and moments by 1 / sqrt(diag K0).
    """
    model = bench.cases[CASE].model
    scale = 1.0 / np.sqrt(model.stiffness.diagonal())[:, None]
    elastic = scale * model.stiffness_times(quasi.shapes)
    inertia = scale * model.mass_times(quasi.shapes) * quasi.eigenvalues
    factor = float(np.vdot(elastic, inertia) / np.vdot(elastic, elastic))
    size = np.linalg.norm(inertia)
    errors = [100.0 * float(np.linalg.norm(c * elastic - inertia) / size) for c in (1.0, factor)]
    return factor, errors[0], errors[1]


def energy_shares(bench: Workbench) -> tuple[float, float, float]:
    """Return the share of bending, shear and twist in the strain energy of modes 1-3 in percent."""
    structure = bench.cases[CASE].model.frame_structure
    family = ElementFamily.generic(structure, plain="full", joint="full")
    shapes = _first(bench).shapes
    local = (structure.gather @ shapes).reshape(-1, 12, shapes.shape[1])[family.elements]
    energy = np.einsum("eim,eaij,ejm->am", local, family.patterns, local)[:3]
    share = 100.0 * (energy / energy.sum(axis=0)).mean(axis=1)
    return float(share[0]), float(share[1]), float(share[2])


def _first(bench: Workbench) -> QuasiModes:
    case = bench.cases[CASE]
    return QuasiModes.of(case.model, case.used_measurement())


def cutoffs(bench: Workbench) -> Extra:
    """Return what the cutoff makes of the changed non-zeros."""
    rows = []
    for cutoff in CUTOFFS:
        words = kabe_words(cutoff)
        rank = int(bench.update(CASE, words).diagnostics["rank"])
        rows.append(
            (words, str(rank), format_frequencies(modes_of(bench, words).natural_frequencies[:8]))
        )
    unknowns = bench.update(CASE, "kabe").parameter_count
    return Extra(
        "Changing non-zeros: the cutoff of small singular values decides",
        ("strategy", f"rank (of {unknowns} unknowns)", "first eight modes (Hz)"),
        tuple(rows),
        "Every row has the three used modes. The paper calls 249 equations for 231 unknowns "
        "over-determined; by rank they are not.",
    )
