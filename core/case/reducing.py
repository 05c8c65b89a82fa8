"""A large model in groups, reduced once when its case is read, and results taken back to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from femubench.core.case.case import Case
from femubench.core.case.nodes import MatrixGeometry, add_node
from femubench.core.case.spans import find_spans
from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import PRELOAD, Groups
from femubench.core.fem.model import Dofs, Model
from femubench.core.modal.eigen import DENSE_LIMIT
from femubench.core.modal.group_prior import GroupPriors
from femubench.core.modal.grouped_reduction import GroupedReduction, reduce_groups
from femubench.core.modal.interfaces import Interfaces
from femubench.core.typing import FloatArray, IntArray, SparseArray

_INNER = "~"  # the node of coordinates that lie nowhere
_MODES = 6  # that have to be right in addition to the measured ones
_MOST_KEPT = DENSE_LIMIT // 2
_LARGE = 2 * DENSE_LIMIT  # dofs: a basis has up to half as many coordinates
_SAME = 1e-9  # of the diagonal: what rounding makes of an unchanged entry
_TOLERANCE = 1e-3


def reduce_case(case: Case, above: int = _LARGE) -> Case:
    """Return a case with a small model of the same groups, where its own is large and has some.

    The nodes of sensors and of attached masses and springs stay; what strategies and effects
    change acts on the small model as on the whole, which `case.whole` keeps.

    Arguments:
        case: as it was read.
        above: degrees of freedom from which a model is large.
    """
    model = case.model
    if model.size <= above or not (model.groups or model.mass_groups):
        return case
    counts = [len(case.measurement), *(len(m.measurement) for m in case.modifications)]
    try:
        found = reduce_groups(model, _kept_rows(case), max(counts) + _MODES, tolerance=_TOLERANCE)
    except ModelError as error:
        note = f"the model is not reduced to its groups: {error}"
        return replace(case, notes=(*case.notes, note))
    small = len(found.mass)
    note = f"the model is solved in {small} coordinates instead of {model.size} degrees of freedom"
    if found.moved > _TOLERANCE:
        note += f": with groups far from their values frequencies are {found.moved:.1%} off"
    return replace(case, model=_small_model(model, found), whole=model, notes=(*case.notes, note))


def _kept_rows(case: Case) -> IntArray:
    """Return the rows of all nodes with sensors and attachments; where too many, those read."""
    geometry = case.model.geometry
    assert isinstance(geometry, MatrixGeometry)
    read = np.unique(sp.csr_array(case.model.observe(case.measurement.sensors)).indices)
    attached = [
        geometry.rows_of[geometry.node(place)]
        for change in case.modifications
        for place in change.places
    ]
    whole = np.flatnonzero(np.isin(geometry.dofs.node, geometry.dofs.node[read]))
    kept = np.concatenate([whole, *map(np.array, attached)]).astype(np.int64)
    return np.unique(kept if len(kept) <= _MOST_KEPT else np.concatenate([read, *attached]))


def _small_model(model: Model, found: GroupedReduction) -> Model:
    """Return the reduced model, with nodes of their own names where rows were kept."""
    geometry, dofs, count = model.geometry, model.dofs, len(found.mass)
    assert isinstance(geometry, MatrixGeometry)
    inner = count - len(found.kept)
    nodes, numbers = np.unique(dofs.node[found.kept], return_inverse=True)
    small = Dofs(
        np.append(numbers, np.full(inner, len(nodes))),
        (*(dofs.direction[i] for i in found.kept), *(str(i + 1) for i in range(inner))),
        np.vstack([dofs.xyz[found.kept], np.tile(dofs.xyz.mean(axis=0), (inner, 1))]),
        np.vstack([dofs.motions[found.kept], np.zeros((inner, 6))]),
    )
    names = (*(geometry.names[i] for i in nodes), *([_INNER] if inner else []))

    mesh = None
    if geometry.mesh is not None:  # readings stay the same, though the node amid them may be gone
        near = geometry.mesh[nodes]
        mesh = sp.csr_array(near @ near.T)
        mesh.resize((len(names), len(names)))

    place = {name: i for i, name in enumerate(names)}
    kept = MatrixGeometry(names, small).rows_of
    whole = (n for n in geometry.placed if n in kept and len(kept[n]) == len(geometry.rows_of[n]))
    pairs = find_spans(model, whole)
    spans = tuple((place[a], place[b]) for a, b in pairs)

    def sparse(parts: dict[str, FloatArray]) -> dict[str, SparseArray]:
        return {name: sp.csc_array(part) for name, part in parts.items()}

    return replace(
        model,
        mass=sp.csc_array(found.mass),
        stiffness=sp.csc_array(found.stiffness),
        dofs=small,
        geometry=MatrixGeometry(names, small, mesh=mesh, spans=spans),
        # What holds to ground, and what not, is not to be seen in coordinates that lie nowhere.
        group_kinds={
            **model.group_kinds,  # of preloads, too
            **{n: GroupPriors(model).kind(n) for n in {**model.groups, **model.mass_groups}},
        },
        groups=sparse(found.groups),
        mass_groups=sparse(found.mass_groups),
        powers=replace(model, powers=found.powers).map_powers(sp.csc_array, sp.csc_array),
        grounds={},
    )


def expand_model(case: Case, updated: Model) -> Model:
    """Return the whole model with what an update made of the reduced one.

    Factors of groups are the same there, and what was added at kept nodes is added at these.

    Arguments:
        case: as it was read.
        updated: on the rows of `case.model`.

    Raises:
        ModelError: where the matrices changed otherwise.
    """
    whole, small = case.whole, case.model
    if whole is None or updated is small:
        return updated if whole is None else whole
    geometry, dofs = updated.geometry, updated.dofs
    assert isinstance(geometry, MatrixGeometry)
    for row in range(small.size, updated.size):  # what hangs on the structure and swings
        added = geometry.names[dofs.node[row]], dofs.direction[row], dofs.xyz[row]
        small, whole = (add_node(model, *added) for model in (small, whole))
    if updated.size != small.size or updated.mass_change or updated.stiffness_change:
        raise ModelError(_AS_A_WHOLE)
    assert isinstance(whole.geometry, MatrixGeometry)
    outer = np.flatnonzero(~small.dofs.internal)
    rows = np.array([whole.geometry.rows[key] for key in geometry.rows if key[0] != _INNER])
    # What comes with the first power of a thickness is the rest of its group.
    keys = [(place, power) for place, own in small.powers.items() for power in own
            if power > 1 or place.startswith((Interfaces.PREFIX, PRELOAD))]  # fmt: skip
    found: dict[str, Any] = {"powers": {}}
    for i, (matrix, kind) in enumerate((("stiffness", "groups"), ("mass", "mass_groups"))):
        before, parts = getattr(small, matrix), getattr(small, kind)
        powers = [small.powers[place][power][i] for place, power in keys]
        bases = [part.toarray() for part in (before, *parts.values(), *powers)]
        change = getattr(updated, matrix).toarray() - bases[0]
        factors, rest = _factors(bases, change, outer)
        total, own = getattr(whole, matrix), getattr(whole, kind)
        grown = (1.0 + factors[0]) * total
        for factor, name in zip(factors[1:], parts, strict=False):
            grown = grown + factor * own[name]
        scale = 1.0 + factors[0] + factors[1:]
        found[kind] = {name: f * own[name] for f, name in zip(scale, parts, strict=False)}
        for factor, (place, power) in zip(factors[1 + len(parts) :], keys, strict=True):
            if abs(factor) > _SAME:
                of = whole.powers.get(place) or GroupPriors(whole).interfaces.powers(place)
                more, name = factor * of[power][i], place.removeprefix(Groups.PREFIX)
                grown = grown + more
                found[kind] |= {name: found[kind][name] + more} if name in parts else {}
        added = sp.coo_array(rest)
        at = (rows[added.row], rows[added.col])
        found[matrix] = sp.csc_array(grown + sp.coo_array((added.data, at), shape=total.shape))
    return replace(whole, **found)


_AS_A_WHOLE = "the matrices are changed as a whole, which a model that was reduced cannot take back"


def _factors(
    bases: list[FloatArray], change: FloatArray, outer: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return by how much a change multiplies matrices, and what is left of it at kept rows.

    Arguments:
        bases: the matrix and its groups, (N, N) each.
        change: of the matrix, (N, N).
        outer: the kept rows, (b,).

    Raises:
        ModelError: where something is left elsewhere.
    """
    inside = np.ones(change.shape, dtype=bool)
    inside[np.ix_(outer, outer)] = False
    columns = np.array([base[inside] for base in bases])
    size = np.sqrt(np.einsum("ij,ij->i", columns, columns))
    columns = columns[size > 0.0] / size[size > 0.0, None]
    factors = np.zeros(len(bases))
    factors[size > 0.0] = np.linalg.lstsq(columns.T, change[inside])[0] / size[size > 0.0]
    rest = change - np.tensordot(factors, np.array(bases), axes=1)
    size = np.sqrt(np.abs(bases[0].diagonal()) + np.abs(change.diagonal()))
    large = np.abs(rest) > _SAME * np.outer(size, size)
    if large[inside].any():
        raise ModelError(_AS_A_WHOLE)
    return factors, np.where(large, rest, 0.0)[np.ix_(outer, outer)]
