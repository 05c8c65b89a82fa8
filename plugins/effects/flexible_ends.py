"""Elements with springs at their ends, the rotations of the springs condensed.

An element of stiffness k hangs on its node by a rigid massless arm (u = A q) and a rotational
spring kappa, whose own rotation d follows the node statically: with B the rotations of its end,
(B'kB + kappa) d = -B'kA q. In the eigenvectors of B'kB = V diag(r) V' the condensed stiffness is

    A'kA - sum_i tau_i / r_i (A'kB v_i)(A'kB v_i)' ,   tau_i = r_i / (r_i + kappa)

exactly. The mass goes through the same motion (Guyan 1965): by Schwarz' inequality a mode gains at
most (omega / omega_e)^2 of its eigenvalue, with omega_e the lowest frequency of an element that
turns at one end while its nodes are held; inertia that couples motions of different rates is left
out (it is there with eccentric mass centres or coupled sections alone).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from femubench import Model
from femubench.effect import Change, ChebyshevPoints, ElementOperator, RowOperator, Term, once_for
from femubench.fem import FloatArray, Frame, IntArray, Structure
from femubench.update import Joints

_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_MOST = 24
_NODES = 20
_SAME_RATE = 1e-10
_ARMS = 6


def rate_nodes(rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rates that stand for all, and how much every one takes of each.

    Arguments:
        rates: positive, (k,).

    Returns:
        nodes (q,) and weights (k, q): f(rates) = weights @ f(nodes), exactly for up to 24
        different rates, else to about 1e-6 of the largest share over a range of 1:1000.
    """
    if not len(rates):
        return np.zeros(0), np.zeros((0, 0))
    order = np.argsort(rates)
    ordered = rates[order]
    fresh = np.concatenate([[True], np.diff(ordered) > _SAME_RATE * ordered[1:]])
    nodes = ordered[fresh]
    if len(nodes) <= _MOST:
        weights = np.zeros((len(rates), len(nodes)))
        weights[order, np.cumsum(fresh) - 1] = 1.0
        return nodes, weights
    points = ChebyshevPoints(float(np.log(nodes[0])), float(np.log(nodes[-1])), _NODES)
    return np.exp(points.points), points.shares(np.log(rates))


_Parts = tuple[FloatArray, FloatArray, FloatArray]
# The matrix of every block of an element, and the power of tau that it comes with.
_POWERS: tuple[tuple[Literal["mass", "stiffness"], int], ...] = (
    ("stiffness", 1),
    ("mass", 1),
    ("mass", 2),
)
_EMPTY = 1e-12
_ALIKE = 1e-9


@dataclass(frozen=True)
class _Item:
    """What one rate of one element gives: blocks that come with tau, tau and tau^2."""

    row: int
    rate: float
    blocks: tuple[FloatArray, FloatArray, FloatArray]


def end_arm(structure: Structure, end: str) -> float:
    """Return the length in m of the rigid arm before a new spring at a ``member@joint`` end.

    Half the depth of the crossing member, as far as the end element has room for it; 0 behind a
    spring that is there already.
    """
    return max(0.0, min(Joints(structure).half_depth(end), end_room(structure, end)))


def end_room(structure: Structure, end: str) -> float:
    """Return the longest arm in m that a new spring at a ``member@joint`` end may sit behind."""
    member, _, joint = end.rpartition("@")
    if any((s.member, s.joint) == (member, joint) for s in structure.frame.joint_springs):
        return 0.0
    element, side = structure.element_ends[end]
    p = structure.properties
    rigid = (p.rigid_1, p.rigid_2)[side][element], (p.rigid_mass_1, p.rigid_mass_2)[side][element]
    return Joints(structure).available_length(end) - max(0.0, *map(float, rigid))


def end_stiffness(frame: Frame, ends: Sequence[str]) -> tuple[float, float, float]:
    """Return the members' own stiffness against turning ends, averaged over ends, in N m/rad.

    Returns:
        4 EI/L about local y, about local z, and GJ/L; what a section does not say is as about y.
    """
    rows = []
    for end in ends:
        member = frame.members[frame.member_index[end.rpartition("@")[0]]]
        s, m, length = member.section, member.material, frame.member_length(member.name)
        bending, lateral = (4.0 * m.E * inertia / length for inertia in (s.Iy, s.Iz or s.Iy))
        rows.append((bending, lateral, m.G * s.J / length))
    own, lateral, torsion = (float(x) for x in np.mean(rows, axis=0))
    return own, lateral, torsion or own


def soften_ends(
    frame: Frame, stiffness: Mapping[str, Mapping[str, float]], arm: float = 1.0
) -> Frame:
    """Return the frame with rotational springs at member ends, in series with those there.

    Arguments:
        stiffness: from ``member@joint`` to local directions to N m/rad; infinite ones are rigid
            and leave the arm.
        arm: its length as a multiple of `end_arm`.
    """
    structure = Structure.build(frame)
    arms = {end: arm * end_arm(structure, end) for end in stiffness}
    return Joints(structure).spring_ends(stiffness, arms)


def free_arm_change(
    model: Model, ends: Sequence[str], parts: Sequence[tuple[str, ...]], longest: float
) -> Change:
    """Return what rotational springs behind arms of any length do.

    Arguments:
        model, ends, parts: as in `flexible_ends_change`.
        longest: the longest arm, as a multiple of `end_arm`, which is the last value. The matrices
            are interpolated between arms at Chebyshev points.
    """
    nodes = ChebyshevPoints(0.0, longest, _ARMS)
    fixed = [flexible_ends_change(model, ends, parts, float(node)) for node in nodes.points]

    def coefficients(values: FloatArray) -> FloatArray:
        shares = nodes.shares(values[:, -1]).T
        own = zip(shares, fixed, strict=True)
        return np.hstack([share[:, None] * c.coefficients(values[:, :-1]) for share, c in own])

    return Change(tuple(term for change in fixed for term in change.terms), coefficients)


def flexible_ends_change(
    model: Model, ends: Sequence[str], parts: Sequence[tuple[str, ...]], arm: float = 1.0
) -> Change:
    """Return what rotational springs at member ends do, in series with those that are there.

    Arguments:
        ends: ``member@joint``.
        parts: for every value of the change, the local directions of its springs. The values are
            stiffnesses in N m/rad, infinite for rigid connections, of which the arms remain.
        arm: its length as a multiple of `end_arm`.
    """
    structure = model.frame_structure
    rows = np.array(sorted({structure.element_ends[end][0] for end in ends}), dtype=np.int64)
    arms = np.zeros((len(rows), 2))
    for end in ends:
        element, side = structure.element_ends[end]
        length = once_for(model, ("arm", end), partial(end_arm, structure, end))
        arms[np.searchsorted(rows, element), side] = arm * length
    elements = _Elements.of(model, rows, arms)
    arm_terms, terms, sprung = elements.arm_terms(model), [], []
    # Of every term the rate and the power of tau, or the stiffness of the springs, and its value.
    rates: list[tuple[float, int, int]] = []
    present: list[tuple[float, int]] = []
    for column, directions in enumerate(parts):
        items = elements.items(_slots(structure, ends, directions))
        nodes, weights = rate_nodes(np.array([item.rate for item in items]))
        for node, weight in zip(nodes, weights.T, strict=True):
            used = [int(i) for i in np.flatnonzero(weight)]
            own = np.array([items[i].row for i in used], dtype=np.int64)
            for kind, (matrix, power) in enumerate(_POWERS):
                blocks = np.array([weight[i] * items[i].blocks[kind] for i in used])
                terms.append(Term(matrix, ElementOperator(structure, own, blocks)))
                rates.append((float(node), power, column))
        for term, stiffness in _series_terms(structure, ends, directions):
            sprung.append(term)
            present.append((stiffness, column))
    rate, power_of, taken = np.array(rates).reshape(-1, 3).T
    there, columns = np.array(present).reshape(-1, 2).T

    def coefficients(values: FloatArray) -> FloatArray:
        arm = np.ones((len(values), len(arm_terms)))
        share = (rate / (rate + values[:, taken.astype(int)])) ** power_of
        softer = -(there**2) / (there + values[:, columns.astype(int)])
        return np.hstack([arm, share, softer])

    return Change((*arm_terms, *terms, *sprung), coefficients)


def _slots(
    structure: Structure, ends: Sequence[str], directions: Sequence[str]
) -> dict[int, list[int]]:
    """Return from elements to their local dofs that become free, sprung ones left out."""
    slots: dict[int, list[int]] = {}
    for end in ends:
        element, side = structure.element_ends[end]
        fresh = [d for d in directions if f"{end}:{d}" not in structure.spring_index]
        own = [6 * side + _DIRECTIONS.index(d) for d in fresh]
        slots.setdefault(element, []).extend(own)
    return slots


@dataclass(frozen=True)
class _Elements:
    """Elements behind their arms.

    Arguments:
        rows: in the mesh, (k,).
        arms: lengths at both ends in m, (k, 2).
        stiffness, mass: of what lies between the arms, (k, 12, 12).
        motion: A, its ends from the nodes, (k, 12, 12).
    """

    rows: IntArray
    arms: FloatArray
    stiffness: FloatArray
    mass: FloatArray
    motion: FloatArray

    @classmethod
    def of(cls, model: Model, rows: IntArray, arms: FloatArray) -> _Elements:
        """Return elements of a model, each with given arms made once for all who ask."""
        keys = [(int(row), float(a), float(b)) for row, (a, b) in zip(rows, arms, strict=True)]
        known: dict[tuple[int, float, float], _Parts] = once_for(
            model, "elements behind arms", dict
        )
        fresh = [i for i, key in enumerate(keys) if key not in known]
        if fresh:
            made = _behind_arms(model.frame_structure, rows[fresh], arms[fresh])
            known.update((keys[i], parts) for i, parts in zip(fresh, made, strict=True))
        return cls(rows, arms, *map(np.array, zip(*(known[key] for key in keys), strict=True)))

    def arm_terms(self, model: Model) -> list[Term]:
        """Return the terms of the arms alone, whatever the springs are."""
        if not self.arms.any():
            return []
        structure, turned = model.frame_structure, np.swapaxes(self.motion, 1, 2)
        p = structure.properties
        plain_k = once_for(model, "element stiffness", lambda: p.stiffness_matrices())
        plain_m = once_for(model, "element mass", lambda: p.mass_matrices())
        stiffness = turned @ self.stiffness @ self.motion - plain_k[self.rows]
        mass = turned @ self.mass @ self.motion - plain_m[self.rows]
        return [
            Term("stiffness", ElementOperator(structure, self.rows, stiffness)),
            Term("mass", ElementOperator(structure, self.rows, mass)),
        ]

    def items(self, slots: Mapping[int, Sequence[int]]) -> list[_Item]:
        """Return what springs at some local dofs of elements do, by rate."""
        items: list[_Item] = []
        for i, row in enumerate(self.rows):
            own = slots.get(int(row))
            if own:
                matrices = self.stiffness[i], self.mass[i], self.motion[i]
                items += _element_items(int(row), *matrices, own)
        return items


def _behind_arms(structure: Structure, rows: IntArray, arms: FloatArray) -> list[_Parts]:
    """Return stiffness, mass and motion of every element behind its arms."""
    p = structure.properties.take(rows)
    p = replace(p, length=p.length - arms.sum(axis=1))
    motion = np.tile(np.eye(12), (len(rows), 1, 1))
    for side, sign in ((0, 1.0), (1, -1.0)):
        # A point at a distance a along x moves by a rz in y and by -a ry in z.
        motion[:, 6 * side + 1, 6 * side + 5] = sign * arms[:, side]
        motion[:, 6 * side + 2, 6 * side + 4] = -sign * arms[:, side]
    return list(zip(p.stiffness_matrices(), p.mass_matrices(), motion, strict=True))


def _element_items(
    row: int, k: FloatArray, m: FloatArray, motion: FloatArray, slots: Sequence[int]
) -> list[_Item]:
    inner = k[np.ix_(slots, slots)]
    rate, v = np.linalg.eigh(inner)
    kept = rate > _EMPTY * np.abs(k).max(initial=0.0)
    rate, v = rate[kept], v[:, kept]
    force = motion.T @ k[:, slots] @ v / rate
    momentum = motion.T @ m[:, slots] @ v
    inertia = v.T @ m[np.ix_(slots, slots)] @ v
    items = []
    for i, own in enumerate(rate):
        alike = np.flatnonzero(np.abs(rate - own) < _ALIKE * own)
        cross = np.outer(force[:, alike] @ inertia[alike, i], force[:, i])
        mixed = np.outer(momentum[:, i], force[:, i])
        blocks = (
            -own * np.outer(force[:, i], force[:, i]),
            -(mixed + mixed.T),
            0.5 * (cross + cross.T),
        )
        items.append(_Item(row, float(own), blocks))
    return items


def _series_terms(
    structure: Structure, ends: Sequence[str], directions: Sequence[str]
) -> list[tuple[Term, float]]:
    """Return a term for the springs of each stiffness that are there already."""
    groups: dict[float, list[int]] = {}
    for end in ends:
        for direction in directions:
            for index in structure.spring_index.get(f"{end}:{direction}", ()):
                groups.setdefault(float(structure.springs[index]), []).append(int(index))
    return [
        (
            Term("stiffness", RowOperator(structure.spring_rows[index], np.eye(len(index)))),
            stiffness,
        )
        for stiffness, index in groups.items()
        if stiffness > 0.0
    ]
