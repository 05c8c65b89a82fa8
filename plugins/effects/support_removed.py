"""A support that is gone: a foot that hangs, a roller that was taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from femubench import Model
from femubench.effect import Parameter, Places, Size
from femubench.fem import FloatArray, Frame
from femubench.plugins.effects.support_flexibility import SupportFlexibility

_LEFT = 3e-3  # of what the members resist
_AXES = ("x", "y", "z", "rx", "ry", "rz")
_HELD = 1e-9


class SupportRemoved(SupportFlexibility):
    """Leave next to nothing of a support.

    What is left is by decades about a third of a percent of what the members resist, half normal
    in its compliance, so that a support that is gone costs nothing; one that merely gives, dear.
    """

    name: ClassVar[str] = "support-removed"
    summary: ClassVar[str] = "a support is gone"
    softens: ClassVar[bool] = False
    acquired: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = ()

    def places(self, model: Model) -> Sequence[str]:
        """Return the supports without which the others, and springs, still hold the structure."""
        if model.structure is None or not model.structure.frame.supports:
            return ()
        frame = model.structure.frame
        held = Places(frame).supports_of("support:all")
        firm = [word for word, own in held.items() if all(np.isinf(k) for k in own.values())]
        rows = {word: np.array([_row(frame, word, d) for d in own]) for word, own in held.items()}
        whole = _rank(list(rows.values()))
        return tuple(
            f"support:{word}"
            for word in firm
            if _rank([own for other, own in rows.items() if other != word]) == whole
        )

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the stiffnesses that are left."""
        found = super().parameters(model, place)
        return tuple(replace(p, scale=_LEFT * p.scale, lower=_LEFT * p.lower) for p in found)


def _row(frame: Frame, word: str, direction: str) -> FloatArray:
    """Return what a support sees of the six motions of a rigid body, (6,), lengths in the size."""
    size = float(np.ptp(frame.corners, axis=0).max())
    at = Places(frame).point(word)
    if at.joint is not None:
        xyz = np.array(frame.joint(at.joint).xyz)
    else:
        first, last = frame.corners[frame.member_ends[frame.member_index[str(at.member)]]]
        xyz = first + float(at.s or 0.0) * (last - first)
    unit = np.eye(6)[_AXES.index(direction)]
    return np.concatenate([unit[:3], np.cross(xyz / size, unit[:3]) + unit[3:]])


def _rank(rows: Sequence[FloatArray]) -> int:
    return int(np.linalg.matrix_rank(np.vstack(rows), tol=_HELD)) if rows else 0
