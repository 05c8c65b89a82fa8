"""A support that sits elsewhere on the beam that lies on it: a roller, a knife edge, a trestle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, pairwise
from typing import ClassVar, Literal

import numpy as np
import scipy.sparse as sp

from femubench import Model
from femubench.effect import Change, FrameEffect, ModelPlaces, Parameter, Places, RowOperator, Term
from femubench.fem import FloatArray, Frame, IntArray, Member, ModelError, Place, SparseArray
from femubench.plugins.effects.flexible_supports import release_supports

_AXES = ("x", "y", "z", "rx", "ry", "rz")
_ACROSS = 0.7  # cosine of the angle between a member and what a support on it holds, at most
_STRAIGHT = 0.999  # cosine of the angle between two members that are one beam
_INTERVALS = 12  # in which a point moves, each by a cubic
_MARGIN = 0.02  # of the beam, between a moved support and what bounds it
_FARTHEST = 0.3  # of the beam
_SAME = 1e-9  # m
_TYPICAL = 0.02  # of the beam
_RIGID = 1e3  # of the stiffness of the mesh at a support
_NEAR = 1e-3  # of the beam
_MOST = 20
POWERS = 4  # of a cubic


@dataclass(frozen=True)
class Beam:
    """Members in one straight line, on which a point may move.

    Arguments:
        members: names, in order, and whether each runs along the line.
        ends: where each begins and ends along the line in m, from the first one, (k + 1,).
    """

    members: tuple[tuple[str, bool], ...]
    ends: tuple[float, ...]

    def place(self, x: float) -> Place:
        """Return the point at a distance in m from the start of the line."""
        k = int(np.clip(np.searchsorted(self.ends, x, side="right") - 1, 0, len(self.members) - 1))
        name, along = self.members[k]
        s = float(np.clip((x - self.ends[k]) / (self.ends[k + 1] - self.ends[k]), 0.0, 1.0))
        return Place(member=name, s=s if along else 1.0 - s)

    def position(self, frame: Frame, place: Place) -> float | None:
        """Return where a point lies on the line in m; None where it does not."""
        for k, (name, along) in enumerate(self.members):
            ends = frame.members[frame.member_index[name]].ends
            s = place.s if place.member == name else None
            if place.joint in ends:
                s = float(ends.index(str(place.joint)))
            if s is not None:
                share = s if along else 1.0 - s
                return self.ends[k] + share * (self.ends[k + 1] - self.ends[k])
        return None

    def grid(
        self, model: Model, reach: tuple[float, float], through: float, most: int
    ) -> tuple[FloatArray, bool]:
        """Return mesh nodes from below to above two points of the line, and whether all of them.

        Arguments:
            reach: the two points in m.
            through: the node that is there whatever is left out.
            most: about how many intervals there may be.
        """
        mesh, frame = model.frame_structure.mesh, model.frame_structure.frame
        found = list(self.ends)
        for k, (name, along) in enumerate(self.members):
            own = mesh.stations[mesh.member == frame.member_index[name]].ravel()
            found += list(
                self.ends[k] + (self.ends[k + 1] - self.ends[k]) * (own if along else 1.0 - own)
            )
        nodes = np.unique(np.round(found, 9))
        nodes = nodes[max(np.searchsorted(nodes, reach[0], side="right") - 1, 0) :]
        nodes = nodes[: np.searchsorted(nodes, reach[1]) + 1]
        even = np.linspace(0, len(nodes) - 1, min(len(nodes), most + 1)).round().astype(int)
        kept = np.unique([*even, int(np.abs(nodes - through).argmin())])
        return np.asarray(nodes[kept]), len(kept) == len(nodes)


def beam_of(frame: Frame, member: str) -> Beam:
    """Return the straight line of members that go through joints at which no other member ends."""
    line = [(member, True)]

    def following() -> tuple[str, bool] | None:
        name, along = line[-1]
        joint = frame.members[frame.member_index[name]].ends[1 if along else 0]
        others = [other for other in frame.ends_at(joint) if other != name]
        if len(others) != 1 or others[0] in dict(line):
            return None
        other = frame.members[frame.member_index[others[0]]]
        onward = other.ends[0] == joint
        turn = float(_along(frame, other) @ _along(frame, frame.members[frame.member_index[name]]))
        same = turn * (1.0 if onward == along else -1.0) > _STRAIGHT
        return (other.name, onward) if same else None

    for _ in range(2):
        while (more := following()) is not None:
            line.append(more)
        line = [(name, not along) for name, along in reversed(line)]
    lengths = [frame.member_length(name) for name, _ in line]
    return Beam(tuple(line), tuple(np.concatenate([[0.0], np.cumsum(lengths)]).tolist()))


def _along(frame: Frame, member: Member) -> FloatArray:
    return np.asarray(Places(frame).axes(member)[0])


def directions_across(frame: Frame, name: str) -> list[str]:
    """Return the directions that lie across a member."""
    along = _along(frame, frame.members[frame.member_index[name]])
    plane = {"in-plane": "xz", "out-of-plane": "z", "3d": "xyz"}[frame.plane]
    return [d for d in plane if abs(along["xyz".index(d)]) <= _ACROSS]


def _bending_compliance(model: Model, beam: Beam, grid: FloatArray, direction: str) -> FloatArray:
    """Return 1/(3 EI) for a force in a direction in each interval, 1/(N m2)."""
    structure, found = model.frame_structure, []
    mesh, p, axis = structure.mesh, structure.properties, "xyz".index(direction)
    for x in (grid[:-1] + grid[1:]) / 2.0:
        at = beam.place(float(x))
        rows = np.flatnonzero(mesh.member == structure.frame.member_index[str(at.member)])
        s = float(at.s or 0.0)
        inside = (mesh.stations[rows, 0] <= s) & (s <= mesh.stations[rows, 1])
        e = rows[int(inside.argmax())]
        across = np.square(mesh.axes[e, 1:, axis])  # shares along local y and z
        found.append(
            sum(a / (3.0 * i) for a, i in zip(across, (p.EIz[e], p.EIy[e]), strict=True) if a)
        )
    return np.array(found)


@dataclass(frozen=True)
class Track:
    """How a point of a beam moves, as cubics between the nodes of a grid.

    Arguments:
        grid: along the beam in m, (k + 1,).
        rows: coefficients of the powers 0 .. 3 of the share of each interval, on dofs,
            (4, n) each.
        compliance: 1/(3 EI) of each interval.
    """

    grid: FloatArray
    rows: tuple[SparseArray, ...]
    compliance: FloatArray

    @classmethod
    def of(
        cls,
        model: Model,
        beam: Beam,
        reach: tuple[float, float],
        direction: str,
        through: float,
        most: int = _INTERVALS,
    ) -> Track:
        """Return the track of points of a model between two of a beam; see `Beam.grid`."""
        grid, every = beam.grid(model, reach, through, most)
        share = np.linspace(0.0, 1.0, POWERS)
        inverse = np.linalg.inv(np.vander(share, POWERS, increasing=True))
        found = []
        for low, high in pairwise(grid):
            points = [beam.place(float(low + (high - low) * s)) for s in share]
            axis = _AXES.index(direction)
            seen = sp.vstack([ModelPlaces(model).motion(at)[[axis]] for at in points])
            found.append(sp.csr_array(sp.csr_array(inverse) @ seen))
        # An interval of several elements has nodes inside that give.
        compliance = _bending_compliance(model, beam, grid, direction) * every
        return cls(grid, tuple(found), compliance)

    def at(self, x: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return interval (g,), powers of the share (g, 4), and the give of the interval in m/N.

        Between two nodes a force bends an element in a way that its shape functions lack: by
        l^3 s^3 (1 - s)^3 / 3 EI, as a beam clamped at both ends.
        """
        k = np.clip(np.searchsorted(self.grid, x, side="right") - 1, 0, len(self.rows) - 1)
        width = np.diff(self.grid)[k]
        share = (x - self.grid[k]) / width
        give = self.compliance[k] * width**3 * (share * (1.0 - share)) ** 3
        return k, share[:, None] ** np.arange(POWERS), np.maximum(give, 0.0)


@dataclass(frozen=True)
class _Spot:
    """A support that could slide on its beam.

    Arguments:
        x: where it is on it, in m.
        inward: 1, or -1 where it sits at the far end and can but go back.
    """

    beam: Beam
    x: float
    low: float
    high: float
    inward: float
    directions: tuple[str, ...]

    @property
    def length(self) -> float:
        return self.beam.ends[-1]

    @property
    def reach(self) -> tuple[float, float]:
        """Return the range of the displacement in m."""
        pair = self.inward * (self.low - self.x), self.inward * (self.high - self.x)
        return min(pair), max(pair)


def _spot_of(frame: Frame, word: str) -> _Spot | None:
    """Return the beam on which a support could slide; None for one that is fastened.

    One that holds a rotation, or the member along itself, is bolted or welded where it was drawn;
    a member merely lies on one that holds it across. At a joint with members to the side it is a
    support of the joint.
    """
    held = Places(frame).supports_of(f"support:{word}")[word]
    at = Places(frame).point(word)
    around = [at.member] if at.member else list(frame.ends_at(str(at.joint)))
    if not around or len(around) > 2 or not all(np.isinf(list(held.values()))):
        return None
    others = [w for w in Places(frame).supports_of("support:all") if w != word]
    beam = beam_of(frame, str(around[0]))
    names = dict(beam.members)
    if not set(around) <= set(names) or not all(
        set(held) <= set(directions_across(frame, str(name))) for name in around
    ):
        return None

    x, total = float(beam.position(frame, at) or 0.0), beam.ends[-1]
    margin, bounds = _MARGIN * total, [(0.0, 0.0), (total, 0.0)]
    found = (beam.position(frame, Places(frame).point(other)) for other in others)
    bounds += [(other, margin) for other in found if other is not None]
    low = max((b + m for b, m in bounds if b < x - _SAME), default=x)
    high = min((b - m for b, m in bounds if b > x + _SAME), default=x)
    low, high = max(low, x - _FARTHEST * total), min(high, x + _FARTHEST * total)
    low, high = min(low, x), max(high, x)
    if high - low < margin:
        return None
    return _Spot(beam, x, low, high, -1.0 if high == x else 1.0, tuple(held))


class SupportPosition(FrameEffect):
    """Let a support sit elsewhere on the beam that lies on it.

    The displacement is positive from ends[0] to ends[1] of the member, at an end inwards. Its prior
    grows by decades, with one deviation at 3.4 % of the beam: a rig is set up again to a few per
    cent of its span, and now and then, one time in fourteen, off by a tenth and more.
    """

    name: ClassVar[str] = "support-position"
    summary: ClassVar[str] = "a support sits elsewhere on its member"
    acquired: ClassVar[bool] = True

    def places(self, model: Model) -> Sequence[str]:
        """Return the supports on which a straight beam lies, twenty at most."""
        if model.structure is None or not model.structure.frame.supports:
            return ()
        frame = model.structure.frame
        words = Places(frame).supports_of("support:all")
        return tuple(f"support:{word}" for word in words if _spot_of(frame, word))[:_MOST]

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the displacement along the beam."""
        spot = _spot(model.frame_structure.frame, place)
        low, high = spot.reach
        return (
            Parameter(
                "displacement",
                "m",
                _TYPICAL * spot.length,
                lower=low,
                upper=high,
                scaling="exponential",
                one_sided=low == 0.0,
            ),
        )

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame with the support elsewhere."""
        if values[0] == 0.0:
            return frame
        spot, word = _spot(frame, place), place.removeprefix("support:")
        at = Places(frame).point(str(spot.beam.place(spot.x + spot.inward * values[0])))
        supports = (
            replace(s, at=at) if str(Places(frame).point(str(s.at))) == word else s
            for s in frame.supports
        )
        return replace(frame, supports=tuple(supports))

    def change(self, model: Model, place: str) -> Change:
        """Return what it does to release a support and to hold its beam elsewhere.

        The directions q that were held come back with K_qq, K_qu and M_qq, M_qu, and a force f
        holds the point T u + C q, a cubic between two nodes, but for the little d that it gives.
        Both follow statically,

            [K_qq C'; C -d] [q; f] = -[K_qu u; T u]

        exactly in the stiffness, after Guyan (1965) in the mass.
        """
        return _sliding_change(model, _spot(model.frame_structure.frame, place), place)


def _spot(frame: Frame, place: str) -> _Spot:
    found = _spot_of(frame, place.removeprefix("support:"))
    if found is None:
        raise ModelError(f"no beam lies on {place!r}")
    return found


def _sliding_change(model: Model, spot: _Spot, place: str) -> Change:
    released, word = release_supports(model), place.removeprefix("support:")
    count, own = model.size, [released.held[word, d] for d in spot.directions]
    stiffness, mass = (released.take(m) for m in (released.model.stiffness, released.model.mass))
    inner, inertia = (m[own][:, own].toarray() for m in (stiffness, mass))
    fixed = sp.vstack([stiffness[own][:, :count], mass[own][:, :count]])
    m, line = len(own), (released.model, spot.beam, (spot.low, spot.high))
    tracks = [Track.of(*line, d, spot.x, _INTERVALS // m) for d in spot.directions]
    grid = tracks[0].grid
    size = (2 + POWERS) * m
    bending = [(i, j) for i, j in pairs_of(size) if not {i, j} & set(range(m, 2 * m))]
    moving = [(i, j) for i, j in pairs_of(size) if not (m <= i < 2 * m and m <= j < 2 * m)]
    terms, corners = list[Term](), list[FloatArray]()
    for k in range(len(grid) - 1):
        cubics = released.take(sp.csr_array(sp.vstack([track.rows[k] for track in tracks])))
        corners.append(cubics[:, own].toarray())
        rows = sp.csr_array(sp.vstack([fixed, cubics[:, :count]]))
        terms += [pair_term("stiffness", rows, *pair) for pair in bending]
        terms += [pair_term("mass", rows, *pair) for pair in moving]
    picked = [tuple(np.array(pairs).T) for pairs in (bending, moving)]

    def factors(x: FloatArray) -> FloatArray:
        seen = [track.at(x) for track in tracks]
        found = np.zeros((len(x), len(grid) - 1, len(bending) + len(moving)))
        for g, k in enumerate(seen[0][0]):
            hold = np.zeros((m, POWERS * m))  # T, on the coefficients of the cubics
            for i, (_, powers, _) in enumerate(seen):
                hold[i, POWERS * i : POWERS * (i + 1)] = powers[g]
            # At no displacement it is rigid, and exactly where it was.
            far = np.square((x[g] - spot.x) / (_NEAR * spot.length))
            give = [own[g] for *_, own in seen] + far / (1.0 + far) / (_RIGID * inner.diagonal())
            corner = hold @ corners[k]
            both = np.linalg.inv(np.block([[inner, corner.T], [corner, -np.diag(give)]]))
            pull = np.zeros((2 * m, size))  # K_qu u and T u
            pull[:m, :m], pull[m:, 2 * m :] = np.eye(m), hold
            core, follow = -pull.T @ both @ pull, -both[:m] @ pull
            momentum = np.zeros((size, size))
            momentum[m : 2 * m] = follow
            momentum = momentum + momentum.T + follow.T @ inertia @ follow
            found[g, k] = np.concatenate([core[picked[0]], momentum[picked[1]]])
        return found.reshape(len(x), -1)

    still = factors(np.array([spot.x]))
    return Change(tuple(terms), lambda values: factors(spot.x + spot.inward * values[:, 0]) - still)


def pairs_of(size: int) -> list[tuple[int, int]]:
    """Return pairs of rows, each once, and each row with itself."""
    return list(combinations_with_replacement(range(size), 2))


def pair_term(matrix: Literal["mass", "stiffness"], rows: SparseArray, i: int, j: int) -> Term:
    """Return the product of two rows and its transpose, the square of one."""
    core = np.zeros((rows.shape[0], rows.shape[0]))
    core[i, j] = core[j, i] = 1.0
    return Term(matrix, RowOperator(rows, core), weight=0.0)
