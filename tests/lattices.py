"""Blocks of beams in three directions: models whose factors are as large as those of solids."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from femubench.core.fem.frame import Frame, Joint, Material, Member
from femubench.core.fem.sections import Section


def lattice(cells: int, elements: int, **options: Any) -> Frame:
    """Return a free block of beams along x, y and z with cells of 0.5 x 0.55 x 0.6 m."""
    section = Section(A=1e-4, Iy=1e-9, Iz=1.3e-9, J=2e-9, Jp=2.3e-9)
    material = Material(70e9, 0.33, 2700.0)
    corners = list(product(range(cells + 1), repeat=3))
    joints = tuple(Joint(f"J{x}{y}{z}", (0.5 * x, 0.55 * y, 0.6 * z)) for x, y, z in corners)
    steps = np.eye(3, dtype=int)
    pairs = [(c, tuple(np.add(c, step))) for c in corners for step in steps]
    members = tuple(
        Member(
            f"m{i}", (f"J{a[0]}{a[1]}{a[2]}", f"J{b[0]}{b[1]}{b[2]}"), elements, section, material
        )
        for i, (a, b) in enumerate((a, b) for a, b in pairs if max(b) <= cells)
    )
    return Frame("3d", "euler-bernoulli", joints, members, **options)
