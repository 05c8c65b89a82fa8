"""What a drawing of centre lines lacks of its members' sections, as refinements of it.

A solid has torsion, warping, the shear centre and the product of inertia of a section by its shape
alone: none of them can be taken out of it without another area or another second moment. So they
are put into the drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import skfem
from scipy import sparse
from skfem.models.poisson import laplace, mass

from femubench import Model
from femubench.core.change.terms import ElementOperator, sparse_matrix
from femubench.core.fem.mesh import member_axes
from femubench.fem import Factor, Frame, Member
from truths.sections import Rectangle
from truths.structure import Structure

Array = npt.NDArray[np.float64]
Refinement = tuple[str, str, str]  # class, place, in words
Edit = Callable[[Frame], Frame]
SHEAR_CENTRE = "shear-centre", "all", "bending about the shear centres of open sections"
WARPING = "warping", "all", "open sections that resist warping"
ECCENTRIC = "eccentricity", "all", "centroids off the drawn axes"
LEAST = 1e-6  # relative; what is less is rounding
# Of twist and its rate times the length at both ends: GJ / 30 L, linear and cubic; E Cw / L^3.
_LINEAR = 30.0 * np.array([[1, 0, -1, 0], [0, 0, 0, 0], [-1, 0, 1, 0], [0, 0, 0, 0]])
_TWISTED = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]])
_WARPED = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])


@dataclass(frozen=True)
class Constants:
    """Hold what follows from a section's shape, about its centroid.

    Arguments:
        area, torsion, warping: m2; St Venant's constant, m4; Vlasov's, m6.
        second: integrals of y y, y z and z z, (2, 2), m4.
        centre: y and z of the shear centre, (2,), m.
        centroid: y and z from the drawn axis, (2,), m.
    """

    area: float
    torsion: float
    warping: float
    second: Array
    centre: Array
    centroid: Array

    def scaled(self, area: float) -> Constants:
        """Return those of a section of the same shape and another area, m2."""
        s = np.sqrt(area / self.area)
        warping, second = s**6 * self.warping, s**4 * self.second
        torsion, points = float(s**4 * self.torsion), (s * self.centre, s * self.centroid)
        return Constants(area, torsion, float(warping), second, *points)


@cache
def _load() -> skfem.LinearForm:
    return skfem.LinearForm(lambda v, w: w.x[1] * v.grad[0] - w.x[0] * v.grad[1])


@cache
def constants(rectangles: tuple[Rectangle, ...]) -> Constants:
    """Return the constants of a section of rectangles.

    Four cells across the thinnest, 16 in all or more.

    Source: St Venant's warping function, J = Ip minus the energy of the warping; about the shear
    centre it is orthogonal to y and z, and its square is Vlasov's constant (Pilkey 2002, 7.2).
    """
    lines = []
    for axis in (0, 2):
        edges = np.unique(np.round([r[axis + i] for r in rectangles for i in (0, 1)], 9))
        step = min(np.diff(edges).min() / 4, np.ptp(edges) / 16)
        counts = np.clip(np.diff(edges) / step + 1.01, 2, 25).astype(int)
        pieces = [
            np.linspace(a, b, n)[:-1] for (a, b), n in zip(pairwise(edges), counts, strict=True)
        ]
        lines.append(np.append(np.concatenate(pieces), edges[-1]))
    mesh = skfem.MeshQuad.init_tensor(*lines)
    y, z = mesh.p[:, mesh.t].mean(axis=1)
    solid = np.zeros(len(y), dtype=bool)
    for y0, y1, z0, z1, filled in rectangles:
        solid[(y > y0) & (y < y1) & (z > z0) & (z < z1)] = filled
    mesh = mesh.restrict(np.flatnonzero(solid))
    cells = np.ptp(mesh.p[:, mesh.t], axis=1).prod(axis=0)
    centroid = mesh.p[:, mesh.t].mean(axis=1) @ cells / cells.sum()
    basis = skfem.CellBasis(mesh.translated(-centroid), skfem.ElementQuad2(), intorder=4)
    load, inner, at = _load().assemble(basis), mass.assemble(basis), basis.doflocs
    warping = skfem.solve(*skfem.condense(laplace.assemble(basis), load, D=np.array([0])))
    second = at @ (inner @ at.T)
    torsion = float(np.trace(second) - load @ warping)
    warping = warping - (inner @ warping).sum() / cells.sum()
    (yy, yz), (_, zz) = second
    centre = np.linalg.solve([[-yz, yy], [-zz, yz]], at @ (inner @ warping))
    warping = warping - centre[1] * at[0] + centre[0] * at[1]
    own = float(warping @ (inner @ warping))
    return Constants(float(cells.sum()), torsion, own, second, centre, centroid)


class Sections:
    """The constants of a drawing's members, and what they make of it.

    Arguments:
        held: joints where nothing can warp.
        shaped, open: constants by member, of those that the solid has so and of the open ones.
    """

    def __init__(self, structure: Structure, frame: Frame, held: Collection[str]) -> None:
        self.structure, self.frame, self.held = structure, frame, held
        self.shaped, self.open = dict[str, Constants](), dict[str, Constants]()
        for member in frame.members:
            section = structure.sections[structure.member(member.name).section]
            # Circles are squares here until they are warped.
            if section.rectangles and "diameter" not in section.drawn:
                own, named = constants(section.rectangles), "shape" in section.drawn
                if not named or np.isclose(own.area, member.section.A):
                    self.shaped[member.name] = own.scaled(member.section.A)
                if not named:
                    self.open[member.name] = self.shaped[member.name]

    def refinements(self) -> dict[Refinement, Edit]:
        """Return what can be put into the drawing, by class, place and words; see `refine`."""
        found: dict[Refinement, Edit] = {}
        if self.structure.plane != "in-plane":
            name = "torsion-constant", "all", "torsion constants of the shapes"
            found[name] = partial(_changed, change=_twisting, known=self.shaped)
            if self.open:
                found[WARPING] = lambda frame: frame  # of the matrices
            for name, at in ((SHEAR_CENTRE, "centre"), (ECCENTRIC, "centroid")):
                if any(self._is_off(own, at) for own in self.open.values()):
                    found[name] = lambda frame: frame
        if self.structure.plane == "3d":
            skew = {k: c for k, c in self.open.items() if abs(c.second[0, 1]) > LEAST * c.area**2}
            if skew:
                name = "product-of-inertia", "all", "principal axes of open sections"
                turned = partial(_turned, frame=self.frame)
                found[name] = partial(_changed, change=turned, known=skew)
        if self._taper(self.frame) is not self.frame:
            found["taper", "all", "sections that taper along a member"] = self._taper
        return found

    def _is_off(self, own: Constants, at: str) -> bool:
        return bool(np.abs(getattr(own, at)).max() ** 2 > LEAST * own.area)

    def refine(self, model: Model, names: Collection[Refinement]) -> Model:
        """Return a model with those refinements of a list that are none of its frame."""
        bent = self._moved(model, "centre", SHEAR_CENTRE in names)
        line = self._moved(model, "centroid", ECCENTRIC in names)
        # The axial displacement too is that of the centroid, of the shear centre it is not.
        for end in (0, 6):
            line[:, end, end + 4] = -line[:, end + 1, end + 3]  # z ry
            line[:, end, end + 5] = -line[:, end + 2, end + 3]  # -y rz
        p = model.frame_structure.properties
        turn = bent @ line
        more = turn.transpose(0, 2, 1) @ p.stiffness_matrices() @ turn - p.stiffness_matrices()
        heavy = line.transpose(0, 2, 1) @ p.mass_matrices() @ line - p.mass_matrices()
        own = np.arange(len(turn))
        stiffer, heavier = (
            sparse_matrix(ElementOperator(model.frame_structure, own, blocks), model.size)
            for blocks in (more, heavy)
        )
        model = replace(model, stiffness=model.stiffness + stiffer, mass=model.mass + heavier)
        return self._restrain_warping(model) if WARPING in names else model

    def _moved(self, model: Model, point: str, wanted: bool) -> Array:
        """Return the displacements of a point of open sections from those of nodes, (k, 12, 12).

        A point at y and z moves by v - z rx and w + y rx.
        """
        meshed = model.frame_structure
        turn = np.tile(np.eye(12), (len(meshed.properties), 1, 1))
        for number, drawn in enumerate(self.frame.members):
            if wanted and drawn.name in self.open:
                rows = meshed.mesh.member == number
                before, at = (
                    member_axes(self.frame, drawn)[0],
                    getattr(self.open[drawn.name], point),
                )
                y, z = meshed.mesh.axes[rows][0, 1:] @ before[1:].T @ at
                for end in (0, 6):
                    turn[rows, end + 1, end + 3], turn[rows, end + 2, end + 3] = -z, y
        return turn

    def _restrain_warping(self, model: Model) -> Model:
        """Return a model whose open sections warp with the rate of twist, which takes stiffness.

        The twist is cubic between nodes; its rate is one from element to element, none where
        warping is held, and condensed.

        Source: Barsoum & Gallagher (1970), Int. J. Numer. Methods Eng. 2, 335-352, without loads.
        """
        meshed = model.frame_structure
        members, mesh, p = meshed.frame.members, meshed.mesh, meshed.properties
        rows = np.flatnonzero([members[k].name in self.open for k in mesh.member])
        still = [k for k, joint in enumerate(meshed.frame.joints) if joint.name in self.held]
        nodes = np.setdiff1d(mesh.ends[rows], still)
        size = model.size
        twists = meshed.gather[(12 * rows[:, None] + [3, 9]).ravel()].toarray()
        total = np.zeros((size + len(nodes),) * 2)
        for k, row in enumerate(rows.tolist()):
            own = members[mesh.member[row]]
            L = float(p.length[row] - p.rigid_1[row] - p.rigid_2[row])
            stiff = p.GJ[row] / (30.0 * L) * (_TWISTED - _LINEAR)
            stiff += own.material.E * self.open[own.name].warping / L**3 * _WARPED
            scale = np.array([1.0, L, 1.0, L])
            place = np.zeros((4, len(total)))
            place[[0, 2], :size] = twists[2 * k : 2 * k + 2]
            for end, node in enumerate(mesh.ends[row]):
                place[1 + 2 * end, size:] = nodes == node
            total += place.T @ (stiff * np.outer(scale, scale)) @ place
        inner = np.linalg.solve(total[size:, size:], total[size:, :size])
        added = sparse.csc_array(total[:size, :size] - total[:size, size:] @ inner)
        return replace(model, stiffness=model.stiffness + added)

    def _taper(self, frame: Frame) -> Frame:
        """Return a frame with elements that are as wide and deep as the solid is there.

        Relative to the middle of their member, of which the drawing has the section.
        """
        structure, factors = self.structure, []
        for member in frame.members:
            own = structure.member(member.name)
            section = structure.sections[own.section]
            if structure.warp is None or not section.rectangles:
                continue
            axes, length = structure.axes(own)
            stations = np.append((np.arange(member.elements) + 0.5) / member.elements, 0.5)
            line = structure.point(own.ends[0])[:, None] + np.outer(axes[0], length * stations)
            sizes = []
            for side, half in zip(axes[1:], (section.width / 2, section.height / 2), strict=True):
                out = [structure.warped(line + s * half * side[:, None]) for s in (-1.0, 1.0)]
                size = np.linalg.norm(out[1] - out[0], axis=0)
                sizes.append(size[:-1] / size[-1])
            wide, deep = sizes
            powers = {
                **dict.fromkeys(("EA", "rhoA"), wide * deep),
                **dict.fromkeys(("GJ", "rhoJp"), (wide * deep) ** 2),
                **{"bending ry": wide * deep**3, "bending rz": wide**3 * deep},
            }
            factors += [
                Factor(quantity, (f"{member.name}/{k}",), float(value))
                for quantity, values in powers.items()
                for k, value in enumerate(values, 1)
                if abs(value - 1.0) > LEAST
            ]
        return replace(frame, factors=(*frame.factors, *factors)) if factors else frame


def _changed(
    frame: Frame, change: Callable[[Member, Constants], Member], known: Mapping[str, Constants]
) -> Frame:
    members = (change(m, known[m.name]) if m.name in known else m for m in frame.members)
    return replace(frame, members=tuple(members))


def _twisting(member: Member, own: Constants) -> Member:
    return replace(member, section=replace(member.section, J=own.torsion))


def _turned(member: Member, own: Constants, frame: Frame) -> Member:
    """Return a member with its section on its principal axes."""
    (yy, yz), (_, zz) = own.second
    turn = 0.5 * np.arctan2(np.copysign(2.0 * yz, yz * (yy - zz) or yz), abs(yy - zz))
    across, up = member_axes(frame, member)[0][1:]
    c, s = np.cos(turn), np.sin(turn)
    along = c * c * yy + 2.0 * c * s * yz + s * s * zz
    section = replace(member.section, Iz=float(along), Iy=float(yy + zz - along))
    x, y, z = (c * up - s * across).tolist()
    return replace(member, section=section, up=(x, y, z))
