"""Factors of least difference of eigenvalues and eigenvectors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.plugins.strategies.multi_start import MultiStart


@dataclass(frozen=True)
class EigenvectorDifference(MultiStart):
    """Fit frequencies and the shapes themselves, entry by entry, from the nominal and other starts.

    A shape of the model is scaled to agree with the measured one where that is largest. In place
    of 1 - MAC, as with `multi-start`, all else is the difference of both.

    Arguments:
        changes, starts, largest, basis: as of `MultiStart`.
        shape_weight: of a difference as large as the shape against a frequency that is 100 % off.

    The authors' are the differences, their scale, least squares with exact slopes from many starts
    between bounds; ours: frequencies for eigenvalues, shapes of unit length, pairs by MAC, the
    logarithms of the factors, the number of starts, the weight of shapes, the bounds.

    Source: Dong & Wang (2018), the eigenvector difference formulation.
    """

    name: ClassVar[str] = "eigenvector-difference"
    citation: ClassVar[str] = (
        "Dong & Wang (2018), Modal property difference formulations and optimization algorithm "
        "comparison towards FE model updating, Proc. SPIE 10598; package SMU (Wang, Dong & Li)"
    )
    needs: ClassVar[frozenset[str]] = frozenset({"shapes", "parts"})
    scaled: ClassVar[str] = "largest"
