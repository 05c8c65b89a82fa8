"""Where the error of a model sits, by classical indicators that know of no cause."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from femubench.core.case.nodes import MatrixGeometry
from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import Groups
from femubench.core.fem.model import Model
from femubench.core.fem.structure import Structure
from femubench.core.inference.settings import settings
from femubench.core.look.modes import Seen
from femubench.core.look.shape_expansion import Expansion, expand
from femubench.core.modal.correlation import modal_scale_factor
from femubench.core.modal.measurement import Measurement
from femubench.core.schema.diagnosis import LocationRow
from femubench.core.ties import in_order
from femubench.core.typing import FloatArray, IntArray, SparseArray

Values = Mapping[str, float]


@dataclass(frozen=True)
class Elements:
    """The elements of a frame with their strain energies, and how they make up members."""

    structure: Structure

    @cached_property
    def stiffness(self) -> FloatArray:
        """Return the local stiffness matrices, (n_elements, 12, 12)."""
        return self.structure.properties.stiffness_matrices()

    @cached_property
    def labels(self) -> tuple[tuple[str, ...], SparseArray]:
        """Return the ``member/k`` and the sum over their pieces, sparse (n_labels, n_elements)."""
        names = [label for label in self.structure.label_index if label]
        rows = [self.structure.label_index[name] for name in names]
        return tuple(names), _summation(rows, len(self.structure.properties))

    @cached_property
    def members(self) -> tuple[tuple[str, ...], SparseArray]:
        """Return the members and the sum over their elements, sparse (n_members, n_elements)."""
        names = tuple(member.name for member in self.structure.frame.members)
        mesh = self.structure.mesh
        plain = np.flatnonzero(np.isnan(mesh.arm_factor))
        shape = (len(names), len(mesh.member))
        return names, sp.csr_array((np.ones(len(plain)), (mesh.member[plain], plain)), shape=shape)

    def work(self, left: FloatArray, right: FloatArray) -> FloatArray:
        """Return left_j' K_e right_j of every element, (n_elements, m)."""
        m = left.shape[1]
        u, v = (np.asarray(self.structure.gather @ x).reshape(-1, 12, m) for x in (left, right))
        return np.asarray(np.einsum("eim,eim->em", u, self.stiffness @ v))


def _summation(rows: list[IntArray], count: int) -> SparseArray:
    index = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    target = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
    return sp.csr_array((np.ones(len(index)), (target, index)), shape=(len(rows), count))


def energy_error(elements: Elements, expansion: Expansion) -> list[Values]:
    """Return the error in constitutive relation relative to the strain energy, by kind of place.

    The sum over modes of |u - v|^2 over that of |u|^2, both in the metric of the element's or the
    member's stiffness; for flexible joints in that of their springs.

    Source: Ladeveze & Chouaki (1999).
    """
    shapes, gaps = _weighted(expansion)
    error = elements.work(gaps, gaps).sum(axis=1)
    energy = elements.work(shapes, shapes).sum(axis=1)
    found: list[Values] = []
    for names, gather in (elements.members, elements.labels):
        top, base = gather @ error, gather @ energy
        found.append(_named(names, top / (base + _mean(base))))
    springs = _springs(elements.structure, shapes, gaps)
    return [*found, springs] if springs else found


def _springs(structure: Structure, shapes: FloatArray, gaps: FloatArray) -> Values:
    """Return the same of the springs at every flexible joint."""
    joints = [c.spring.joint for c in structure.mesh.connections for _ in c.spring.stiffness]
    names = tuple(dict.fromkeys(joints))
    if not names:
        return {}
    gather = _summation([np.flatnonzero(np.array(joints) == name) for name in names], len(joints))
    error, energy = (
        gather @ (structure.springs * np.square(structure.spring_rows @ x).sum(axis=1))
        for x in (gaps, shapes)
    )
    return _named(names, error / (energy + _mean(energy)))


def force_residual(elements: Elements, seen: Seen, expansion: Expansion) -> list[Values]:
    """Return how much of the force residual every place explains, by kind of place.

    The residual r = (K - lambda M) u of every dof is what the model lacks. A change a of the
    stiffness of a member gives the forces -a k u; of the residual's energy r' K^-1 r they explain
    (r' K^-1 k u)^2 / (u' k K^-1 k u), the denominator no more than u' k u, which is taken for it:
    all modes together, since the change is the same in all. At a joint it is the energy of the
    residual on springs that are as stiff as the diagonal of K.

    Source: Fox-Kabe residual (Kabe 1985; Fissette & Ibrahim 1988, Error location using the force
    error matrix method), in the metric of the flexibility.
    """
    shapes, gaps = _weighted(expansion)
    work = elements.work(gaps, shapes).sum(axis=1)
    energy = elements.work(shapes, shapes).sum(axis=1)
    found: list[Values] = []
    for names, gather in (elements.members, elements.labels):
        explained, base = np.abs(gather @ work), gather @ energy
        floor = np.maximum(base, settings.quiet_share * _mean(base))
        root = np.sqrt(np.where(floor > 0.0, floor, 1.0))
        found.append(_named(names, explained / root))
    frame = elements.structure.frame
    at_nodes = _at_nodes(seen, gaps)
    joints = {j.name: float(at_nodes[i]) for i, j in enumerate(frame.joints) if i < len(at_nodes)}
    return [*found, joints]


def node_residual(seen: Seen, expansion: Expansion) -> list[Values]:
    """Return the energy of the force residual at the nodes of a model from files."""
    geometry = seen.model.geometry
    if not isinstance(geometry, MatrixGeometry):
        return []
    _, gaps = _weighted(expansion)
    return [_named(geometry.names, _at_nodes(seen, gaps))]


def group_energy(seen: Seen, expansion: Expansion) -> list[Values]:
    """Return the error in constitutive relation of the groups of a model from files."""
    shapes, gaps = _weighted(expansion)
    names = Groups(seen.model).places("stiffness")
    parts = seen.model.groups.values()
    error = np.array([np.einsum("nm,nm->", gaps, k @ gaps) for k in parts])
    energy = np.array([np.einsum("nm,nm->", shapes, k @ shapes) for k in parts])
    if not names:
        return []
    return [_named(names, error / (energy + _mean(energy)))]


def _at_nodes(seen: Seen, gaps: FloatArray) -> FloatArray:
    """Return sqrt(sum of r^2 / K_dd) over modes and dofs of every node, (n_nodes,)."""
    model = seen.model
    diagonal = np.abs(model.stiffness.diagonal())
    force = np.square(model.stiffness_times(gaps)).sum(axis=1)
    energy = np.divide(force, diagonal, out=np.zeros(len(force)), where=diagonal > 0.0)
    return np.sqrt(np.bincount(model.dofs.node, weights=energy))


def ecomac(seen: Seen) -> Values:
    """Return the mean difference of paired unit shapes at every sensor (1 - MAC by coordinate).

    Source: Hunt (1992), Application of an enhanced coordinate modal assurance criterion.
    """
    m = seen.measurement
    paired = np.flatnonzero(seen.pairing.index >= 0)
    if len(paired) == 0 or not len(m.sensors):
        return {}
    measured = m.shapes[:, paired]
    model = seen.readings[:, seen.pairing.index[paired]]
    known = np.isfinite(measured)
    use = known.sum(axis=0) > 1
    measured, model, known = measured[:, use], model[:, use], known[:, use]
    scaled = model * np.real(modal_scale_factor(measured, model))
    size = np.sqrt(np.where(known, np.square(measured), 0.0).sum(axis=0))
    gap = np.where(known, np.abs(measured - scaled), 0.0) / np.where(size > 0.0, size, 1.0)
    count = known.sum(axis=1)
    mean = gap.sum(axis=1) / np.maximum(2.0 * count, 1.0)
    return {label: float(v) for label, v, k in zip(m.sensors.labels, mean, count, strict=True) if k}


def mdlac(elements: Elements, seen: Seen) -> list[Values]:
    """Return how well the frequency shifts look like those of a softer place, by kind of place.

    The squared cosine between the measured relative shifts and the sensitivities of the
    frequencies to the stiffness of a place, its share of the strain energy; 1 for a perfect match.

    Source: Messina, Williams & Contursi (1998), multiple damage location assurance criterion.
    """
    shifts = seen.shifts
    paired = np.flatnonzero(np.isfinite(shifts))
    if len(paired) < settings.least_modes or np.abs(shifts[paired]).max() < settings.negligible:
        return []
    index = seen.pairing.index[paired]
    shapes = seen.modes.shapes[:, index]
    energy = elements.work(shapes, shapes) / seen.modes.eigenvalues[index]
    found: list[Values] = []
    for names, gather in (elements.members, elements.labels):
        slope = np.asarray(gather @ energy)
        size = np.square(slope).sum(axis=1) * np.square(shifts[paired]).sum()
        inner = np.square(slope @ shifts[paired])
        found.append(
            _named(names, np.divide(inner, size, out=np.zeros(len(size)), where=size > 0.0))
        )
    return found


def _weighted(expansion: Expansion) -> tuple[FloatArray, FloatArray]:
    """Return shapes and gaps over the frequency, so that every mode has unit strain energy."""
    root = np.sqrt(expansion.eigenvalues)
    return expansion.shapes / root, expansion.gaps / root


def _named(names: tuple[str, ...], values: FloatArray) -> Values:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def _mean(values: FloatArray) -> float:
    mean = float(values.mean()) if len(values) else 0.0
    return mean if mean > 0.0 else 1.0


def locate(model: Model, measurement: Measurement) -> tuple[LocationRow, ...]:
    """Return `force-residual`, `energy-error`, `ecomac` and `mdlac` at every place, highest first.

    Frames have rows for members, ``member/k`` and joints, models from files for nodes and groups,
    `ecomac` for sensors. Without shapes only `mdlac` is left. Within an indicator the largest of
    every kind of place is 1.

    Raises:
        ModelError: when the model has no modes.
    """
    seen = Seen(model, measurement)
    found: dict[str, list[Values]] = {}
    try:
        expansion = expand(seen)
    except ModelError:  # no sensor sees any motion, or every shift is singular
        expansion = None
    shaped = expansion is not None and expansion.shapes.shape[1] > 0
    if model.structure is not None:
        elements = Elements(model.structure)
        if expansion is not None and shaped:
            found["force-residual"] = force_residual(elements, seen, expansion)
            found["energy-error"] = energy_error(elements, expansion)
        found["mdlac"] = mdlac(elements, seen)
    elif expansion is not None and shaped:
        found["force-residual"] = node_residual(seen, expansion)
        found["energy-error"] = group_energy(seen, expansion)
    found["ecomac"] = [ecomac(seen)]
    return tuple(row for name, kinds in found.items() for row in _rows(name, kinds))


def _nothing(indicator: str) -> float:
    """Return below what an indicator is made of rounding errors, and says nothing."""
    if indicator == "mdlac":
        return 0.0
    return settings.negligible ** (2 if indicator == "energy-error" else 1)


def _rows(indicator: str, kinds: Iterable[Values]) -> list[LocationRow]:
    rows = []
    for values in kinds:
        largest = max(values.values(), default=0.0)
        if largest > _nothing(indicator):
            rows += [LocationRow(indicator, place, v / largest) for place, v in values.items()]
    return in_order(rows, lambda row: -row.value)
