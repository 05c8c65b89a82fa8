"""Shear deformation, which Euler and Bernoulli left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from femubench import Model
from femubench.effect import (
    Change,
    ElementOperator,
    FrameEffect,
    LookWarning,
    Parameter,
    Seen,
    Size,
    Term,
)
from femubench.fem import BeamProperties, Factor, FloatArray, Frame, Section
from femubench.plugins.effects.flexible_ends import rate_nodes

_KAPPA = 5.0 / 6.0  # of a rectangle, for sections of unknown shape
_AT_ALL = ("all",)
_PLANES = (("EIy", "flex_z"), ("EIz", "flex_y"))


class ShearDeformation(FrameEffect):
    """Let a multiple of 1/(kappa G A) take part; 1 is the textbook's (Cowper 1966).

    With phi = 12 EI / (kappa G A L^2) the stiffness of an element is affine in 1 / (1 + s phi),
    and so, by its square, is a mass matrix that knows of the shear.
    """

    name: ClassVar[str] = "shear-deformation"
    summary: ClassVar[str] = "the members deform in shear"
    innate: ClassVar[bool] = True
    handbook: ClassVar[bool] = True
    sizes: ClassVar[Sequence[Size]] = (Size(0.5, 3.0),)

    def places(self, model: Model) -> Sequence[str]:
        """Return the whole frame."""
        return () if model.structure is None else _AT_ALL

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        """Return the multiple of 1/(kappa G A)."""
        frame = model.frame_structure.frame
        now = present_share(frame)
        lacks, known = now == 0.0, all(m.section.kappa is not None for m in frame.members)
        textbook = 1.0 if lacks and known else None
        name = "multiple of 1/(kappa G A)"
        return (Parameter(name, "", 1.0, now, 0.0, one_sided=lacks, textbook=textbook),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        """Return the frame of Timoshenko beams; rotary inertia stays what it is."""
        share = float(values[0])
        if share == present_share(frame):
            return frame
        rotary = frame.rotary_share
        rotary = rotary if rotary not in (0.0, 1.0) else rotary == 1.0
        others = tuple(f for f in frame.factors if (f.quantity, f.at) != ("shear", _AT_ALL))
        if share == 0.0:
            return replace(frame, beam="euler-bernoulli", rotary_inertia=rotary, factors=others)
        members = tuple(
            m
            if m.section.kappa is not None
            else replace(m, section=replace(m.section, kappa=Section.constant_kappa(_KAPPA)))
            for m in frame.members
        )
        own = () if share == 1.0 else (Factor("shear", _AT_ALL, share),)
        return replace(
            frame, beam="timoshenko", rotary_inertia=rotary, members=members, factors=others + own
        )

    def look(self, seen: Seen) -> list[LookWarning]:
        """Return whether members without shear flexibility should have it."""
        structure = seen.model.structure
        if structure is None or structure.frame.beam != "euler-bernoulli":
            return []
        unknown = any(m.section.kappa is None for m in structure.frame.members)
        remark = " (kappa = 5/6 assumed where none is given)" if unknown else ""
        changes = seen.changes(self.frame(structure.frame, "all", (1.0,)))
        what = f"The members are stubby enough for shear to matter{remark}"
        return seen.notable(self.name, what, changes)

    def change(self, model: Model, place: str) -> Change:
        """Return one set of terms a plane of bending and a value of phi."""
        structure = model.frame_structure
        now = present_share(structure.frame)
        whole = structure.rebuilt(self.frame(structure.frame, place, (1.0,))).properties
        terms: list[Term] = []
        rates: list[float] = []
        powers: list[int] = []
        for bending, shear in _PLANES if structure.frame.plane == "3d" else _PLANES[:1]:
            phi = _ratio(whole, bending, shear)
            rows = np.flatnonzero(phi)
            if not len(rows):
                continue
            first, kind = whole.take(rows).alike()
            parts = _parts(whole.take(rows[first]), bending, shear)
            nodes, weights = rate_nodes(phi[rows])
            for node, weight in zip(nodes, weights.T, strict=True):
                for matrix, power, blocks in parts:
                    if (weight[first, None, None] * blocks).any():
                        operator = ElementOperator(structure, rows, blocks, share=weight, kind=kind)
                        terms.append(Term(matrix, operator))
                        rates.append(float(node))
                        powers.append(power)
        if not terms:
            return Change.proportional()
        rate, power_of = np.array(rates), np.array(powers)

        def coefficients(values: FloatArray) -> FloatArray:
            return np.asarray(
                _share(values[:, :1], rate) ** power_of - _share(now, rate) ** power_of
            )

        return Change(tuple(terms), coefficients)


def present_share(frame: Frame) -> float:
    """Return the multiple of 1/(kappa G A) that a frame has now, 0 for Euler-Bernoulli."""
    own = [f.factor for f in frame.factors if (f.quantity, f.at) == ("shear", _AT_ALL)]
    return float(np.prod(own)) if frame.beam == "timoshenko" else 0.0


def _share(multiple: FloatArray | float, rate: FloatArray) -> FloatArray:
    return np.asarray(1.0 / (1.0 + multiple * rate))


def _ratio(p: BeamProperties, bending: str, shear: str) -> FloatArray:
    """Return phi of every element, (n_elements,)."""
    flexible = p.length - p.rigid_1 - p.rigid_2
    return np.asarray(12.0 * getattr(p, bending) * getattr(p, shear) / flexible**2)


def _parts(
    p: BeamProperties, bending: str, shear: str
) -> list[tuple[Literal["mass", "stiffness"], int, FloatArray]]:
    """Return what comes with 1/(1 + phi) and its square, (k, 12, 12) each.

    Three values of phi, 0, 1 and 3, give the coefficients of a polynomial of degree two.
    """
    phi = _ratio(p, bending, shear)
    none = dict.fromkeys(("flex_y", "flex_z"), np.zeros(len(p)))
    other = [
        replace(p, **{**none, shear: value / phi * getattr(p, shear)}) for value in (0.0, 1.0, 3.0)
    ]
    stiff = [own.stiffness_matrices() for own in other]
    heavy = [own.mass_matrices() for own in other]
    first, second = heavy[0] - heavy[1], heavy[1] - heavy[2]
    square = (first - 2.0 * second) / 0.375
    return [
        ("stiffness", 1, 2.0 * (stiff[0] - stiff[1])),
        ("mass", 1, 2.0 * first - 1.5 * square),
        ("mass", 2, square),
    ]
