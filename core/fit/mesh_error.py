"""By how much the frequencies of a mesh are off: every element cut in two, or a better one."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from femubench.core.errors import ModelError
from femubench.core.fem.frame import Frame, Place, Support
from femubench.core.fem.model import Model, common_dofs
from femubench.core.fem.structure import Structure
from femubench.core.modal.eigen import Modes, once_for
from femubench.core.modal.frequency_changes import elastic_modes, frequency_changes
from femubench.core.typing import FloatArray

_MARGIN = 4


def refine_mesh(structure: Structure) -> Frame:
    """Return the frame with every element cut in two, with all the rest of it as it was.

    The flexible part of an element is halved. Labels `member/k` keep their meaning, so factors
    and parameter changes need no translation.
    """
    frame, mesh = structure.frame, structure.mesh
    length = np.linalg.norm(mesh.xyz[mesh.ends[:, 1]] - mesh.xyz[mesh.ends[:, 0]], axis=1)
    rigid = np.maximum(np.maximum(mesh.rigid, mesh.rigid_mass), 0.0) / length[:, None]
    low = mesh.stations[:, 0] + rigid[:, 0] * np.ptp(mesh.stations, axis=1)
    high = mesh.stations[:, 1] - rigid[:, 1] * np.ptp(mesh.stations, axis=1)
    cuts = [
        # A support that holds nothing: where one is, the mesh has a node.
        Support(Place(member=frame.members[m].name, s=float(s)), ())
        for m, s, arm in zip(mesh.member, 0.5 * (low + high), mesh.arm_factor, strict=True)
        if np.isnan(arm)
    ]
    return replace(frame, supports=(*frame.supports, *cuts))


def mesh_bias(model: Model, count: int, modes: Modes | None = None) -> FloatArray | None:
    """Return f_fine / f - 1 of the first elastic modes on a mesh twice as fine, (k,), k <= count.

    Modes are paired by shape. None without a frame or better elements, and where the finer mesh
    cannot be built or solved.

    Arguments:
        modes: elastic modes of the model where they are at hand, at least `count`.
    """
    structure = model.structure
    if structure is None and model.finer is not None:
        with suppress(ModelError):
            whole, better = model.finer()
            rows, known = slice(whole.size), elastic_modes(whole, count + _MARGIN)
            return frequency_changes(whole, known, better, count, lambda shapes: shapes[rows])
    if structure is None:
        return None
    try:
        coarse = elastic_modes(model, count + _MARGIN) if modes is None else modes
        fine = once_for(model, "fine", lambda: Model.of(structure.rebuilt(refine_mesh(structure))))
        keep = common_dofs(structure, fine.frame_structure)
        return frequency_changes(model, coarse, fine, count, lambda shapes: shapes[keep])
    except ModelError:
        return None


def mesh_corrections(model: Model, hertz: FloatArray) -> FloatArray | None:
    """Return f_fine / f - 1 of some modes of a model, whatever their numbers, (k,).

    None where `mesh_bias` has none, or knows too few modes.

    Arguments:
        hertz: some of its natural frequencies, nan where there is none, (k,).
    """
    known = np.flatnonzero(np.isfinite(hertz))
    modes = elastic_modes(model, 2 * len(hertz) + 8)
    gap = np.abs(modes.natural_frequencies[:, None] - hertz[None, known])
    index = gap.argmin(axis=0)
    bias = mesh_bias(model, int(index.max(initial=-1)) + 1, modes)
    if bias is None or len(bias) <= index.max(initial=-1):
        return None
    result = np.zeros(len(hertz))
    result[known] = bias[index]
    return result
