"""A model from matrices in a Ritz basis in which every group stays a group.

A diagnosis solves a model hundreds of times with its groups softer, stiffer or heavier. In one
basis V that holds what all of these do, V' K_g V of every group is enough: the reduced model is a
small one with the same groups, whatever the mesh.

A factor on a group scales its stiffness as a whole. What moves inside a group with its border, and
how it vibrates with its border held, is therefore the same for every factor. So the inside of every
group goes first, and the borders keep their softest motions: some thousand coordinates, in which a
group is a dense block of those that it touches. There the model is solved with each group softened
and stiffened for itself: all that a factor adds to the modes are answers to forces on the group.
Few motions of borders hold what a soft interface makes of modes: the forces that such modes leave
around it say what is missing, and give it. The motions that carry most energy of all these modes
stay, next to the modes of the whole model.

The kept degrees of freedom stay coordinates, so that sensors, masses and springs act on the
reduced model as on the whole one. No rigid motion moves the other coordinates.

Source: Craig & Bampton (1968), AIAA Journal 6, for modes of a part whose border is held; Castanier,
Tan & Pierre (2001), AIAA Journal 39, for motions of borders; Sirovich (1987), Quart. Appl. Math.
45, for those that carry most energy; Benner, Gugercin & Willcox (2015), SIAM Review 57, for bases
in which parameters stay affine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import ArpackError, LinearOperator, cg, eigsh

from femubench.core.errors import ModelError
from femubench.core.fem.group_factors import GROUP, PRELOAD
from femubench.core.fem.model import Model, Powers
from femubench.core.modal.eigen import DENSE_LIMIT, solve_modes
from femubench.core.modal.factorisation import factorise_definite
from femubench.core.modal.group_prior import GroupPriors
from femubench.core.modal.interfaces import Interfaces, loose_inverse
from femubench.core.modal.rigid import orthonormal, rigid_body_vectors, rigid_modes_of
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

# What a joint or a clamp, of which little is known, may turn out to be; and any other part.
JOINT_FACTORS = (1e-3, 0.03, 3.0)
PART_FACTORS = (0.3, 3.0)
INTERFACE_FACTORS = (1e-3, 0.03, 0.3)  # drawn as one piece, it is never stiffer
PRELOAD_FACTORS = (0.0, 1.5)  # lost, or three deviations of bolts more
_UNKNOWN = 1.0  # deviation of the logarithm of a group from which on it is one of the former
_SHIFT = 0.5  # of the first elastic eigenvalue, below zero
_FLOATING = 1e-11  # of the largest k/m: a shift that makes what floats definite
_SPARE = 6  # modes above those that have to be right
_NOMINAL = 30  # elastic modes that are there as they are, at least
_APART = 1e-10  # of the energy of a mode: what the coordinates may lack of it
_DEPENDENT = 1e-13  # square of the sine below which a vector lies in the span of the others
_BORDERS = 2400  # coordinates of all borders
_BORDER = (12, 48)  # and of one, least and most
_PATCH, _SEAM, _MOST_NEAR = 16, 8, 10_000  # rows around a border, an interface: times its own
_FAINT = 1e-5  # of the strongest motion of a border
_HELD = 3.0  # times the highest eigenvalue: modes of a group whose border is held
_MOST_HELD = 64
_DENSE = 300  # rows that are solved densely
_DISTINCT = 0.01  # of the strongest rigid motion at the kept rows: the weakest one
_STRONG = 1e-3  # of the energy of a mode, its root, from which on an inside has it
_SHARE = 1e-4  # of the energy of an answer to forces on a group that the group itself has
_WEAK = 1e-6  # of the energy of a mode, below which a group adds no motion
_SOFT = 0.1  # times its stiffness: a joint when motions are weighed
_PARTS = 8  # of rows of a matrix of all coordinates, one after the other
_STEPS = 128  # of conjugate gradients: more add a hundredth of the energy
_MISSED = 0.1  # of the tolerance: energy that a mode lacks near a soft interface, and gets
_LOST = 1e-3  # of the tolerance: energy of motions that are left out


@dataclass(frozen=True)
class GroupedReduction:
    """The matrices of a model in a basis, and how good the basis is.

    Arguments:
        kept: rows of the whole model that are the first coordinates, (b,).
        stiffness, mass: (N, N).
        groups, mass_groups: parts of them by name, (N, N) each.
        powers: what comes with powers of a thickness or of an interface's softness, by place.
        moved: how far off a frequency is, relative: by what the borders of groups lack of modes,
            by what there was no room for, and by what is missing around a soft interface; the
            largest of all groups, interfaces, factors and modes.
    """

    kept: IntArray
    stiffness: FloatArray
    mass: FloatArray
    groups: dict[str, FloatArray]
    mass_groups: dict[str, FloatArray]
    powers: dict[str, Powers]
    moved: float


def reduce_groups(
    model: Model, kept: IntArray, count: int, *, tolerance: float = 1e-3, most: int = DENSE_LIMIT
) -> GroupedReduction:
    """Return a model with groups in a basis that holds what its groups do.

    Arguments:
        model: sparse, with groups of stiffness or mass, and no low-rank change.
        kept: rows that stay coordinates, those of sensors and attachments, (b,).
        count: number of elastic modes that have to be right.
        tolerance: of their frequencies, relative, with one group at a thousandth or thirty times.
        most: coordinates.

    Raises:
        ModelError: when kept rows and modes alone are more than the coordinates, the model has no
            modes, or a factor on a group leaves no model.
    """
    rigid = rigid_body_vectors(model.dofs)
    kept = _hold_rigid(kept, rigid, model.dofs.node)
    meet = GroupPriors(model).interfaces
    try:
        whole, highest = _reduce_to_borders(model, kept, rigid, count, most)
        span, shift = whole.span, whole.shift
        # With as many coordinates as borders may have these would take as long as all the rest.
        wanting = meet.places if span.count < _BORDERS else ()
        lacked = [_enlarge(whole, meet, place, count, highest, tolerance) for place in wanting]
    except la.LinAlgError:
        raise ModelError("the stiffness is not definite in coordinates of its groups") from None
    if lacked:
        whole.add(np.hstack(lacked))
    for place in meet.places:
        whole.blocks[_POWERS, place] = _soften(whole, meet, place)
    for place, given in model.powers.items():
        first = 0 if place.startswith(PRELOAD) else 1  # of a thickness the rest of the group
        varied = sum(k for power, (k, _) in given.items() if power > first)
        whole.blocks[_POWERS, place] = span.reduce(varied)
    pieces: list[FloatArray] = []
    settled: dict[tuple[_Name, float], FloatArray] = {}
    for name, block in whole.blocks.items():
        factors = PART_FACTORS if name[0] == "mass" else _factors(model, name[1])
        try:
            values, motions = whole.vary(block, name[0] == "mass", factors, count, highest)
        except la.LinAlgError:
            what = f"the {name[0]} of group {name[1]!r} leaves no model"
            words = " or ".join(f"{factor:g}" for factor in factors)
            raise ModelError(f"{words} times {what}") from None
        if name[1] not in meet.places:  # whose mass moves with it
            settled |= {(name, factor): own for factor, own in zip(factors, values, strict=True)}
        pieces.append(motions)
    joints = [n for n in model.groups if _factors(model, n) is JOINT_FACTORS]
    vectors = whole.strongest(pieces, joints, most, _LOST * tolerance)
    small = {name: block.within(vectors) for name, block in whole.blocks.items()}
    small[_K] = vectors.T @ whole.stiffness @ vectors
    small[_M] = vectors.T @ whole.mass @ vectors
    moved = 0.0
    for (name, factor), reference in settled.items():
        change, is_mass = (factor - 1.0) * small[name], name[0] == "mass"
        heavy = small[_M] + change if is_mass else small[_M]
        stiff = small[_K] if is_mass else small[_K] + change
        own = _ritz(heavy, stiff + shift * heavy, shift, len(reference))[0]
        moved = max(moved, float((np.sqrt(own / reference) - 1.0).max(initial=0.0)))
    body = span.forces(whole.energy(rigid))
    turn = _physical_coordinates(span.shapes[kept] @ vectors, vectors.T @ body)
    small = {n: turn.T @ part @ turn for n, part in small.items() if n[0] != _POWERS}
    vectors = vectors @ turn
    powers = {
        p: meet.powers(p, lambda force: np.asarray(vectors.T @ span.forces(force)))
        for p in meet.places
    }
    # Rounding of large entries leaves halves that differ, of which solvers read one or both.
    small = {name: 0.5 * (part + part.T) for name, part in small.items()}
    for group in ("", *model.groups):
        part = replace(model, stiffness=model.groups.get(group, model.stiffness))
        key, free = ("stiffness", group), rigid_modes_of(part)[kept]
        small[key] = _loose(small[key], free)
        if not group:
            for at in meet.places:
                powers[at] = {p: (_loose(k, free), m) for p, (k, m) in powers[at].items()}
        place = f"{GROUP}{group}"
        pairs = model.powers.get(place, {})
        if pairs:  # the stiffness of the first is the rest of the group, also by rounding
            masses = {p: span.reduce(m).within(vectors) for p, (_, m) in pairs.items()}
            bent = {p: _loose(span.reduce(pairs[p][0]).within(vectors), free) for p in pairs}
            bent[1] = small[key] - sum(part for p, part in bent.items() if p > 1)
            powers[place] = {p: (bent[p], masses[p]) for p in pairs}
    for place in (p for p in model.powers if p.startswith(PRELOAD)):
        force, inertia = model.powers[place][1]
        free = rigid_modes_of(replace(model, stiffness=force))[kept]
        pair = (span.reduce(part).within(vectors) for part in (force, inertia))
        powers[place] = {1: (_loose(next(pair), free), next(pair))}
    stiffness, mass = (
        {name: small[kind, name] for name in own}
        for kind, own in (("stiffness", model.groups), ("mass", model.mass_groups))
    )
    moved += whole.lacking
    shifted = small[_K] + shift * small[_M]
    for place in meet.places:
        patch = _Patch(model, meet, place, shift)
        basis = span, vectors, shifted, small[_M], powers[place]
        for left, force in patch.unbalance(*basis, count):
            moved = max(moved, 0.5 * patch.energy(left, force))
    return GroupedReduction(kept, small[_K], small[_M], stiffness, mass, powers, moved)


def _reduce_to_borders(
    model: Model, kept: IntArray, rigid: FloatArray, count: int, most: int
) -> tuple[_Reduced, float]:
    """Return a model in coordinates of its groups, and the eigenvalue that has to be right last."""
    nominal = max(count + _SPARE, min(_NOMINAL, most - len(kept) - 2 * rigid.shape[1]))
    modes = solve_modes(model, nominal + int(rigid.shape[1]))
    least = len(kept) + len(modes) + rigid.shape[1]
    if least > most:
        raise ModelError(f"sensors, attachments and modes take {least} coordinates of {most}")
    elastic = modes.elastic
    shift = _SHIFT * abs(float(elastic.eigenvalues[0]))
    highest = float(elastic.eigenvalues[: count + _SPARE][-1])
    known = elastic.shapes / np.sqrt(np.abs(elastic.eigenvalues))
    span = _Substructures(model, kept, rigid, known, highest)
    exact = np.hstack([rigid, modes.shapes])
    return _Reduced(span, model, exact, exact.shape[1] - len(elastic), shift), highest


class _Patch:
    """The surroundings of an interface, in which modes of a basis with it softened lack something.

    Arguments:
        model: the whole one.
        place: one of the interfaces.
        shift: s of A = K + s M, in rad^2/s^2.
    """

    def __init__(self, model: Model, meet: Interfaces, place: str, shift: float) -> None:
        self.meet, self.place, self.shift = meet, place, shift
        edge, stiffness = meet.edges[place], sp.csr_array(model.stiffness)
        self.rows = _neighbourhood(stiffness, edge.near, _SEAM)[-1]
        self._across = stiffness[self.rows], sp.csr_array(model.mass)[self.rows]
        whole = self._across[0] + shift * self._across[1]
        self._reach, self._whole = np.unique(whole.indices), whole[:, self.rows]
        self._pulled, self._held = sp.csc_array(edge.pulled)[self.rows], edge.stiff.toarray()

    def unbalance(
        self, span: _Substructures, vectors: FloatArray, shifted: FloatArray, mass: FloatArray,
        powers: Powers, count: int,
    ) -> Iterator[tuple[float, FloatArray]]:  # fmt: skip
        """Yield what may be left of the interface, and forces that modes of unit energy then leave.

        Arguments:
            vectors: the basis, in coordinates, (N, k).
            shifted, mass: in the basis, (k, k).
            powers: what comes with powers of the softness, in the basis.
        """
        grow = self.meet.forces(self.place)
        for left in INTERFACE_FACTORS:
            grown = [((left - 1.0) ** p, *pair) for p, pair in powers.items()]
            heavy = mass + sum(c * m for c, _, m in grown)
            stiff = shifted + sum(c * (k + self.shift * m) for c, k, m in grown)
            values, x = _ritz(heavy, stiff, self.shift, count)
            shapes = span.lift(vectors @ (x / np.sqrt(values)), self._reach)
            pull, inertia = (
                part @ shapes + more[self.rows]
                for part, more in zip(self._across, grow(left, shapes), strict=True)
            )
            yield left, inertia * values - pull

    def answers(self) -> Callable[[float, FloatArray], FloatArray]:
        """Return what moves the patch, held outside, by forces, with so much of the interface left.

        Source: Woodbury (1950), for the change of few rows by the interface.
        """
        solve = factorise_definite(sp.csc_array(self._whole)).solve
        follow = solve(self._pulled.toarray())

        def answer(left: float, force: FloatArray) -> FloatArray:
            moved = solve(force)
            gap = self._held - (1.0 - left) * (self._pulled.T @ follow)
            apart = loose_inverse(gap) @ (self._pulled.T @ moved)
            return np.asarray(moved + (1.0 - left) * (follow @ apart))

        return answer

    def energy(self, left: float, force: FloatArray) -> float:
        """Return the energy of the patch by those of forces that move it most, nearly and at most.

        Source: Hestenes & Stiefel (1952), J. Res. Nat. Bur. Stand. 49.
        """
        size, follow = self._whole.diagonal(), (1.0 - left) * loose_inverse(self._held)
        worst = force[:, np.argmax(np.einsum("ij,ij->j", force, force / size[:, None]))]
        softened = LinearOperator(
            self._whole.shape, dtype=float,
            matvec=lambda x: self._whole @ x - self._pulled @ (follow @ (self._pulled.T @ x)),
        )  # fmt: skip
        found, _ = cg(softened, worst, rtol=0.0, maxiter=_STEPS, M=sp.diags_array(1.0 / size))
        return float(worst @ found)


def _enlarge(
    whole: _Reduced, meet: Interfaces, place: str, count: int, highest: float, tolerance: float
) -> FloatArray:
    """Return what coordinates lack of modes with an interface softened, of unit energy, (n, k)."""
    span, patch = whole.span, _Patch(whole.model, meet, place, whole.shift)
    block = _soften(whole, meet, place)
    added = whole.vary(block, False, INTERFACE_FACTORS, count, highest)[1]
    vectors = np.hstack([whole.base, added])
    vectors = orthonormal(vectors, vectors.T @ (whole.shifted @ vectors), _DEPENDENT)
    powers = meet.powers(place, lambda force: np.asarray(vectors.T @ span.forces(force)))
    shifted, mass = (vectors.T @ (part @ vectors) for part in (whole.shifted, whole.mass))
    found, answer = [], patch.answers()
    for left, force in patch.unbalance(span, vectors, shifted, mass, powers, count):
        lacked = answer(left, force)
        energy, turn = la.eigh(lacked.T @ force)
        strong = energy > _MISSED * tolerance
        found.append(lacked @ (turn[:, strong] / np.sqrt(energy[strong])))
    near = np.hstack(found)
    motions = np.zeros((whole.model.size, near.shape[1]))
    motions[patch.rows] = near
    return motions


def _soften(whole: _Reduced, meet: Interfaces, place: str) -> _PartialMatrix:
    """Return what the softer part of an interface resists by it, in the coordinates."""
    at = whole.blocks["stiffness", meet.edges[place].part].at
    return _PartialMatrix(at, meet.powers(place, lambda f: whole.span.forces(f)[at])[1][0])


_Name = tuple[str, str]
_K, _M, _POWERS = ("stiffness", ""), ("mass", ""), "powers"


def _factors(model: Model, name: str) -> tuple[float, ...]:
    """Return what a group of the stiffness or an interface may turn out to be, softest first."""
    if name.startswith(Interfaces.PREFIX):
        return INTERFACE_FACTORS
    if name.startswith(PRELOAD):
        return PRELOAD_FACTORS
    return PART_FACTORS if GroupPriors(model).std(name) < _UNKNOWN else JOINT_FACTORS


@dataclass(frozen=True)
class _PartialMatrix:
    """A symmetric matrix that is zero but for some coordinates.

    Arguments:
        at: these coordinates, (k,).
        inside: the matrix there, (k, k).
    """

    at: IntArray
    inside: FloatArray

    def within(self, vectors: FloatArray) -> FloatArray:
        """Return the matrix in coordinates of some vectors, (m, m)."""
        own = vectors[self.at]
        return np.asarray(own.T @ (self.inside @ own))

    def add_to(self, matrix: FloatArray, factor: float = 1.0) -> None:
        """Add a multiple of it to a matrix, (N, N)."""
        matrix[np.ix_(self.at, self.at)] += factor * self.inside

    def bordered(self, sides: FloatArray) -> _PartialMatrix:
        """Return the matrix with the last coordinates, from what it does with these, (N, m)."""
        size, new = sides.shape
        at = np.append(self.at, np.arange(size - new, size))
        inside = np.pad(self.inside, ((0, new), (0, new)))
        inside[:, -new:] = sides[at]
        inside[-new:] = sides[at].T
        return _PartialMatrix(at, inside)


@dataclass(frozen=True)
class _Interior:
    """What only one part of the stiffness holds, and how coordinates move it.

    Arguments:
        rows: of the whole model, (i,).
        at: coordinates that move them, (k,).
        motions: (i, k).
    """

    rows: IntArray
    at: IntArray
    motions: FloatArray


class _Substructures:
    """The motions of a model that the borders of its groups and their insides have.

    Arguments:
        kept: rows that are coordinates by themselves, the first ones, (b,).
        rigid: motions as a body, (n, r).
        known: modes of unit strain energy, (n, m).
        highest: eigenvalue up to which modes have to be right.
    """

    def __init__(
        self, model: Model, kept: IntArray, rigid: FloatArray, known: FloatArray, highest: float
    ) -> None:
        self.size, self.kept = model.size, kept
        names = list(model.groups)
        parts = [sp.csr_array(part) for part in model.groups.values()]
        rest = sp.csr_array(_rest_of(model.stiffness, parts))
        parts += [rest] if rest.nnz else []
        touched = np.array([np.diff(part.indptr) > 0 for part in parts])
        border = touched.sum(axis=0) != 1
        border[kept] = True
        owner = np.where(border, -1, touched.argmax(axis=0))
        heavy = sp.coo_array(model.mass)  # may couple the insides of two groups
        first, second = owner[heavy.row], owner[heavy.col]
        border[heavy.row[(first != second) & (np.minimum(first, second) >= 0)]] = True
        stiff, mass = model.stiffness.diagonal(), model.mass.diagonal()
        loaded = (mass > 0.0) & (stiff > 0.0)
        shift = _FLOATING * float((stiff[loaded] / mass[loaded]).max(initial=0.0))
        whole = sp.csr_array(model.stiffness + shift * model.mass)
        soft = [(_factors(model, name)[0], part) for name, part in zip(names, parts, strict=False)]
        size = np.sqrt(whole.diagonal())  # forces and moments alike
        size = np.where(size > 0.0, size, 1.0)[:, None]
        at, shapes = [kept], [sp.diags_array(1.0 / size[kept, 0])]
        free = np.setdiff1d(np.flatnonzero(border), kept)
        borders = _borders(whole, touched, free)
        most = int(np.clip(_BORDERS / max(len(borders), 1), *_BORDER))
        for rows in borders:
            changes = [(f - 1.0) * part for own, (f, part) in zip(touched, soft, strict=False)
                       if own[rows[0]]]  # fmt: skip
            at.append(rows)
            shapes.append(_traces(whole, changes, size, rows, rigid, known, most))
        found = sp.coo_array(sp.block_diag(shapes))
        places = np.concatenate(at)[found.row], found.col
        self.shapes = sp.csr_array((found.data, places), shape=(self.size, found.shape[1]))
        self.insides: list[_Interior] = []
        inertia = sp.csr_array(model.mass)
        edges = GroupPriors(model).interfaces.edges.values()
        for i in range(len(parts)):
            rows = np.flatnonzero(~border & (owner == i))
            if len(rows):
                softest = soft[i][0] if i < len(names) else 1.0
                name = names[i] if i < len(names) else ""
                loose = [self.shapes[edge.near].indices for edge in edges if edge.part == name]
                self._eliminate(
                    whole[rows], inertia[rows], rows, known, highest / softest,
                    np.concatenate([rows[:0], *loose]),
                )  # fmt: skip

    @property
    def count(self) -> int:
        """Return the number of coordinates."""
        return int(self.shapes.shape[1])

    def _eliminate(
        self, across: SparseArray, inertia: SparseArray, rows: IntArray, known: FloatArray,
        highest: float, loose: IntArray,
    ) -> None:  # fmt: skip
        """Add what the inside of a part does when its border moves, and when it is held.

        What it does with coordinates of the border that are `loose` it also does by itself.
        """
        inside = sp.csc_array(across[:, rows])
        solver = factorise_definite(inside)
        pulled = sp.csc_array(across @ self.shapes)  # shapes are zero inside
        at = np.flatnonzero(np.diff(pulled.indptr))
        static = -solver.solve(pulled[:, at].toarray())
        modes = _held_modes(solver.solve, inside, sp.csc_array(inertia[:, rows]), highest)
        beyond = solver.solve(across @ known)  # what the border does not make it do at once
        apart = static[:, np.isin(at, loose)]
        beyond = np.hstack([beyond, apart / np.sqrt(np.einsum("ij,ij->j", apart, inside @ apart))])
        beyond -= modes @ (modes.T @ (inside @ beyond))
        values, turn = la.eigh(beyond.T @ (inside @ beyond))
        strong = values > _STRONG**2
        more = beyond @ (turn[:, strong] / np.sqrt(values[strong]))
        new = np.arange(modes.shape[1] + more.shape[1]) + self.count
        self.shapes.resize(self.size, self.count + len(new))
        self.insides.append(_Interior(rows, np.append(at, new), np.hstack([static, modes, more])))

    def lift(self, coordinates: FloatArray, near: IntArray | None = None) -> FloatArray:
        """Return the motions of the whole model; right at least at some rows and in their parts."""
        found = np.asarray(self.shapes @ coordinates)
        for part in self.insides:
            if near is None or np.isin(part.rows, near).any():
                found[part.rows] = part.motions @ coordinates[part.at]
        return found

    def add(self, vectors: FloatArray) -> None:
        """Take further motions of the whole model as coordinates, the last ones, (n, m)."""
        new = np.arange(vectors.shape[1]) + self.count
        on_border = vectors.copy()
        for i, part in enumerate(self.insides):
            on_border[part.rows] = 0.0
            motions = np.hstack([part.motions, vectors[part.rows]])
            self.insides[i] = _Interior(part.rows, np.append(part.at, new), motions)
        self.shapes = sp.hstack([self.shapes, sp.csr_array(on_border)], format="csr")

    def forces(self, force: FloatArray | SparseArray) -> FloatArray:
        """Return what forces on the whole model do along the coordinates, (N, m)."""
        found = self.shapes.T @ force
        found = found.toarray() if sp.issparse(found) else np.asarray(found)
        touched = np.zeros(self.size, dtype=bool)
        touched[force.nonzero()[0]] = True
        for part in self.insides:
            if touched[part.rows].any():
                found[part.at] += part.motions.T @ force[part.rows]
        return found

    def reduce(self, matrix: SparseArray) -> _PartialMatrix:
        """Return a matrix in the coordinates."""
        matrix = sp.csr_array(matrix)
        touched = np.diff(matrix.indptr) > 0
        moving = np.diff(self.shapes[touched].tocsc().indptr) > 0
        insides = [part for part in self.insides if touched[part.rows].any()]
        for part in insides:
            moving[part.at] = True
        at = np.flatnonzero(moving)
        place = np.cumsum(moving) - 1
        shapes = self.shapes[:, at]
        found = (shapes.T @ (matrix @ shapes)).toarray()
        for part in insides:
            own, across = place[part.at], matrix[part.rows]
            side = shapes.T @ (across.T @ part.motions)
            found[:, own] += side
            found[own] += side.T
            found[np.ix_(own, own)] += part.motions.T @ (across[:, part.rows] @ part.motions)
        return _PartialMatrix(at, 0.5 * (found + found.T))


def _rest_of(whole: SparseArray, parts: Sequence[SparseArray]) -> SparseArray:
    """Return what parts leave of a matrix, without what rounding left."""
    pieces = [sp.csc_array(whole.shape), *parts]
    while len(pieces) > 1:  # in pairs: a sum that grows part by part would be copied as often
        pieces = [sum(pieces[i + 1 : i + 2], pieces[i]) for i in range(0, len(pieces), 2)]
    found = sp.coo_array(whole - pieces[0])
    size = np.sqrt(np.abs(whole.diagonal()))
    real = np.abs(found.data) > 1e-10 * size[found.row] * size[found.col]
    return sp.csc_array((found.data[real], (found.row[real], found.col[real])), shape=found.shape)


def _borders(whole: SparseArray, touched: BoolArray, rows: IntArray) -> list[IntArray]:
    """Return rows that the same parts touch and that are connected, border by border."""
    kinds = np.unique(touched[:, rows], axis=1, return_inverse=True)[1]
    links = sp.coo_array(whole[rows][:, rows])
    same = kinds[links.row] == kinds[links.col]
    graph = sp.coo_array((same[same], (links.row[same], links.col[same])), shape=links.shape)
    number, label = connected_components(graph, directed=False)
    return [rows[label == i] for i in range(number)]


def _traces(
    whole: SparseArray, changes: Sequence[SparseArray], size: FloatArray, rows: IntArray,
    rigid: FloatArray, known: FloatArray, most: int,
) -> SparseArray:  # fmt: skip
    """Return how a border moves when what is some way off does, (f, k).

    What its forces do there dies out with the distance, so that few motions remain.

    Arguments:
        whole: the definite stiffness, (n, n).
        changes: of it, one at a time, (n, n) each.
        size: roots of the diagonal of it, (n, 1).
        rows: of the border, (f,).
        rigid, known: motions of the whole model of which it has the traces, (n, r), (n, m).
        most: k.

    Source: Babuska & Lipton (2011), Multiscale Model. Simul. 9, for optimal local spaces; Buhr &
    Smetana (2018), SIAM J. Sci. Comput. 40, for random data.
    """
    if len(rows) <= most:
        return sp.diags_array(1.0 / size[rows, 0])
    near = _neighbourhood(whole, rows, _PATCH)
    inner = near[-2] if len(near) > 1 else rows
    outer = np.setdiff1d(near[-1], inner)
    body = la.orth(rigid[rows] * size[rows], rcond=1e-9)

    def bend(motions: FloatArray) -> FloatArray:
        scaled = motions * size[rows]
        return np.asarray(scaled - body @ (body.T @ scaled))

    found = bend(known[rows])
    # What moves as a body is bent by rounding alone.
    least = _FAINT * la.norm(size[rows] * known[rows], axis=0) + 1e-300
    pieces = [found / np.maximum(la.norm(found, axis=0), least)]
    moved = np.random.default_rng(0).standard_normal((len(outer), most + 8)) / size[outer]
    own = np.searchsorted(inner, rows)
    for change in [None, *changes] if len(outer) else []:
        across = whole[inner] if change is None else whole[inner] + change[inner]
        solver = factorise_definite(sp.csc_array(across[:, inner]))
        found = bend(solver.solve(across[:, outer] @ moved)[own])
        pieces.append(found / max(la.norm(found, 2), 1e-300))
    shapes, strength, _ = la.svd(np.hstack(pieces), full_matrices=False)
    shapes = shapes[:, strength > _FAINT * strength[0]][:, : most - body.shape[1]]
    return sp.coo_array(np.hstack([body, shapes]) / size[rows])


def _neighbourhood(whole: SparseArray, rows: IntArray, times: int) -> list[IntArray]:
    """Return rows and ever more of those around them, until they are so many times as many."""
    near = [rows]
    while len(near) < 3 or len(near[-1]) < min(times * len(rows), _MOST_NEAR):
        near.append(np.unique(whole[near[-1]].indices))
        if len(near[-1]) == len(near[-2]):  # nothing lies farther off
            near.pop()
            break
    return near


def _held_modes(
    solve: Callable[[FloatArray], FloatArray],
    stiffness: SparseArray,
    mass: SparseArray,
    highest: float,
) -> FloatArray:
    """Return modes of what lies inside a border that is held, of unit energy, (i, k)."""
    size, limit = mass.shape[0], _HELD * highest
    if size <= _DENSE:
        mu, modes = la.eigh(mass.toarray(), stiffness.toarray())
        return np.asarray(modes[:, ::-1][:, mu[::-1] * limit > 1.0][:, :_MOST_HELD])
    loaded = np.count_nonzero(mass.diagonal())
    operator = LinearOperator((size, size), matvec=solve, dtype=float)
    modes, values = np.zeros((size, 0)), np.zeros(0)
    for count in (min(most, loaded // 2) for most in (8, 24, _MOST_HELD) if loaded > 1):
        try:
            values, modes = eigsh(stiffness, k=count, M=mass, sigma=0.0, OPinv=operator,
                                  which="LM", v0=np.ones(size))  # fmt: skip
        except ArpackError as error:
            raise ModelError("modes of a group with its border held do not converge") from error
        if values.max() > limit:
            break
    return np.asarray(modes / np.sqrt(values))[:, values <= limit]


class _Reduced:
    """A model in coordinates of substructures, with its modes as they are.

    Arguments:
        span: the coordinates, to which those are added that its modes lack.
        exact: rigid motions and modes, (n, m).
        rigid: number of the former, the first ones, with modes that are none but these.
        shift: s of A = K + s M, in rad^2/s^2.
    """

    def __init__(
        self, span: _Substructures, model: Model, exact: FloatArray, rigid: int, shift: float
    ) -> None:
        self.model, self.shift = model, shift
        kinds = (
            ("stiffness", model.stiffness, model.groups),
            ("mass", model.mass, model.mass_groups),
        )
        self.blocks: dict[_Name, _PartialMatrix] = {}
        self.span = span
        self.stiffness, self.mass = (np.zeros((span.count,) * 2) for _ in kinds)
        for total, (kind, whole, parts) in zip((self.stiffness, self.mass), kinds, strict=True):
            own = {(kind, name): span.reduce(part) for name, part in parts.items()}
            self.blocks |= own
            for block in (*own.values(), span.reduce(_rest_of(whole, list(parts.values())))):
                block.add_to(total)
        self.exact = exact / np.sqrt(np.einsum("ij,ij->j", exact, self.energy(exact)))
        self.inverse = la.lapack.dpotri(
            la.cholesky(self.shifted, lower=True), lower=True, overwrite_c=True
        )[0]
        self.inverse += np.tril(self.inverse, -1).T
        # What the coordinates lack of the energy of a mode raises its eigenvalue.
        self.lacking = 0.5 * float(self.add(self.exact)[rigid:].max(initial=0.0))

    def add(self, vectors: FloatArray) -> FloatArray:
        """Take what motions of the whole model have beyond the coordinates; return its energy."""
        span, new = self.span, vectors
        for _ in range(2):  # the second time what rounding left
            new = new - span.lift(self.inverse @ span.forces(self.energy(new)))
        gram = new.T @ self.energy(new)
        values, turn = la.eigh(0.5 * (gram + gram.T))
        strong = values > _APART
        if strong.any():
            new = new @ (turn[:, strong] / np.sqrt(values[strong]))
            span.add(new)
            model, everything = self.model, np.arange(len(self.mass))
            parts = {"stiffness": model.groups, "mass": model.mass_groups}
            for (kind, name), block in self.blocks.items():
                self.blocks[kind, name] = block.bordered(span.forces(parts[kind][name] @ new))
            self.stiffness, self.mass = (
                _PartialMatrix(everything, total).bordered(span.forces(whole @ new)).inside
                for total, whole in ((self.stiffness, model.stiffness), (self.mass, model.mass))
            )
            # They cost no energy together with the others, and one alone.
            self.inverse = la.block_diag(self.inverse, np.eye(new.shape[1]))
        forces = span.forces(self.energy(self.exact))
        answers = np.hstack([self.inverse @ forces, self.inverse[:, : len(span.kept)]])
        self.base = orthonormal(answers, answers.T @ self.shifted @ answers, _DEPENDENT)
        # In answers to forces along the coordinates, the mass.
        self._half = self.inverse @ (self.mass @ self.base)
        self._heavy = self.inverse @ self.mass
        for rows in np.array_split(self._heavy, _PARTS):  # in place: few matrices are as large
            rows[:] = rows @ self.inverse
        return np.asarray(gram.diagonal())

    @property
    def shifted(self) -> FloatArray:
        """Return A in the coordinates, (N, N)."""
        return np.asarray(self.stiffness + self.shift * self.mass)

    def energy(self, vectors: FloatArray) -> FloatArray:
        """Return A times motions of the whole model, (n, m)."""
        return self.model.stiffness_times(vectors) + self.shift * self.model.mass_times(vectors)

    def vary(
        self,
        block: _PartialMatrix,
        is_mass: bool,
        factors: Sequence[float],
        count: int,
        highest: float,
    ) -> tuple[list[FloatArray], FloatArray]:
        """Return the modes with factors on a group: what forces on it add to those without.

        Returns:
            Their elastic eigenvalues, (m,) each, and the motions that they need in addition, of
            the energy that modes of unit energy have in them, (N, k).
        """
        values, turn = la.eigh(block.inside)
        some = np.abs(values) > 1e-12 * np.abs(values).max(initial=0.0)
        pull, sign = turn[:, some] * np.sqrt(np.abs(values[some])), np.sign(values[some])
        # The answers are inverse[:, at] pull, less what the base has of them.
        at, base = block.at, self.base
        known, pushed = base[at].T @ pull, self._half[at].T @ pull
        gram = pull.T @ self.inverse[np.ix_(at, at)] @ pull - known.T @ known
        share, ways = la.eigh(0.5 * (gram + gram.T))
        strong = share > _SHARE / (highest if is_mass else 1.0)
        ways = ways[:, strong] / np.sqrt(share[strong])
        within = base.T @ self.mass @ base
        side = pushed - within @ known
        heavy = pull.T @ self._heavy[np.ix_(at, at)] @ pull - known.T @ pushed - side.T @ known
        side, heavy = side @ ways, ways.T @ heavy @ ways
        mass = np.block([[within, side], [side.T, heavy]])
        moved = np.vstack([known, ways.T @ gram])
        own = (moved * sign) @ moved.T
        found, parts = [], [np.zeros((ways.shape[1], 0))]
        for factor in factors:
            change = (factor - 1.0) * own
            shifted = np.eye(len(own)) + (self.shift if is_mass else 1.0) * change
            values, x = _ritz(mass + change if is_mass else mass, shifted, self.shift, count)
            found.append(values)
            parts.append(x[base.shape[1] :] / np.sqrt(values + self.shift))
        turn, strength, _ = la.svd(np.hstack(parts), full_matrices=False)
        turn = ways @ (turn * strength)[:, np.square(strength) > _WEAK]
        return found, np.asarray(self.inverse[:, at] @ (pull @ turn) - base @ (known @ turn))

    def strongest(
        self, pieces: list[FloatArray], joints: Sequence[str], most: int, lost: float
    ) -> FloatArray:
        """Return the base and the motions of most energy, orthonormal in A, (N, k).

        Nothing can be varied or added after it.

        Arguments:
            pieces: motions of the energy that modes have in them.
            joints: groups in which energy weighs less, as when they are soft.
            most: k at most.
            lost: energy below which a motion is left out.
        """
        weight = self.shifted
        for name in joints:
            self.blocks["stiffness", name].add_to(weight, _SOFT - 1.0)
        added, base = np.hstack(pieces), self.base
        side = weight @ base
        added -= base @ la.solve(base.T @ side, side.T @ added, assume_a="pos")
        values, turn = la.eigh(added.T @ (weight @ added))
        strong = np.flatnonzero(values > lost)[::-1][: most - base.shape[1]]
        found = np.hstack([base, added @ (turn[:, strong] / np.sqrt(values[strong]))])
        del self.inverse, self._heavy  # as large as all groups together, and asked no more
        return orthonormal(found, found.T @ (self.shifted @ found), _DEPENDENT)


def _ritz(
    mass: FloatArray, shifted: FloatArray, shift: float, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return the first elastic eigenvalues of K + s M and M, (m,), and coordinates, (N, m)."""
    # Reciprocal: low eigenvalues come out with full relative accuracy.
    size = len(mass)
    mu, x = la.eigh(mass, shifted, subset_by_index=[max(size - count - _SPARE, 0), size - 1])
    values = 1.0 / np.maximum(mu[::-1], 1e-300) - shift
    elastic = np.flatnonzero(values > 1e-6 * shift)[:count]
    x = x[:, ::-1][:, elastic]
    return values[elastic], x / np.sqrt(np.einsum("ij,ij->j", x, mass @ x))


def _hold_rigid(kept: IntArray, rigid: FloatArray, node: IntArray) -> IntArray:
    """Return rows with those of more nodes, where it takes them to tell all rigid motions apart.

    Arguments:
        node: of every row, (n,).
    """
    count = rigid.shape[1]
    strength = la.svdvals(rigid[kept]) if len(kept) >= max(count, 1) else np.zeros(1)
    if count == 0 or strength[-1] > _DISTINCT * strength[0]:
        return np.unique(kept)
    pivots = la.qr(rigid.T, mode="economic", pivoting=True)[2][:count]
    return np.unique(np.concatenate([kept, np.flatnonzero(np.isin(node, node[pivots]))]))


def _loose(stiffness: FloatArray, free: FloatArray) -> FloatArray:
    """Return a stiffness that does not hold motions of a body, not even by rounding, (N, N).

    The entries of a large model are many times those of the small one, and so is what rounding
    leaves of their sums.

    Arguments:
        free: these motions at the kept rows, the first ones; they move no others, (b, r).
    """
    apart = np.eye(len(stiffness))
    apart[: len(free), : len(free)] -= free @ la.pinv(free)
    found = apart.T @ stiffness @ apart
    return np.asarray(0.5 * (found + found.T))


def _physical_coordinates(kept: FloatArray, rigid: FloatArray) -> FloatArray:
    """Return the turn to coordinates of which the first are the kept rows, (N, N).

    Arguments:
        kept: those rows of the vectors, (b, N).
        rigid: rigid motions by their coordinates, (N, r); the new ones behind the kept are zero.
    """
    first = la.pinv(kept)
    rest = la.null_space(kept)
    if rigid.shape[1]:
        first = first + rest @ ((rest.T @ rigid) @ la.pinv(kept @ rigid))
    return np.hstack([first, rest])
