"""Cross sections: area, second moments, torsion and polar constants, Cowper's shear coefficient."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from femubench.core.errors import ModelError

ShearCoefficients = Callable[[float], tuple[float, float]]


@dataclass(frozen=True)
class Section:
    """Constants of a cross section in its local axes (y across, z up).

    Arguments:
        A: area in m2.
        Iy: integral of z^2 over the area in m4 (bending in the local x-z plane).
        Iz: integral of y^2 over the area in m4.
        J: St Venant torsion constant in m4.
        Jp: polar second moment in m4 (torsional inertia).
        kappa: from Poisson's ratio to the shear coefficients for shear along y and along z;
            None where the section was given without one.
        width: size along y in m; None where the section was given as numbers.
        height: size along z in m; None likewise.
        shape: the name of the shape; empty for numbers.
        name: in its case; sections that differ in it alone are the same.
    """

    A: float
    Iy: float
    Iz: float
    J: float
    Jp: float
    kappa: ShearCoefficients | None = None
    width: float | None = None
    height: float | None = None
    shape: str = ""
    name: str = field(default="", compare=False)

    def same_shape(self, width: float, height: float, wall: float) -> Section:
        """Return a section of the same shape with the constants of other outer sizes, in m."""
        if self.shape == "rectangular-tube":
            return Section.rectangular_tube(width, height, wall)
        if self.shape == "round-tube":
            return Section.round_tube(width, wall)
        assert self.shape == "solid-rectangle"
        return Section.solid_rectangle(width, height)

    @classmethod
    def rectangular_tube(cls, width: float, height: float, wall: float) -> Section:
        """Return a tube with sharp corners; sizes are outer sizes in m.

        Examples:
            >>> round(fem.Section.rectangular_tube(0.0254, 0.0254, 0.00238).A * 1e6, 1)
            219.2
        """
        inner_w, inner_h = width - 2 * wall, height - 2 * wall
        iy = (width * height**3 - inner_w * inner_h**3) / 12
        iz = (height * width**3 - inner_h * inner_w**3) / 12
        b, h = width - wall, height - wall
        return cls(
            A=width * height - inner_w * inner_h,
            Iy=iy,
            Iz=iz,
            J=cls.bredt(b, h, wall),
            Jp=iy + iz,
            kappa=BoxKappa(b, h),
            width=width,
            height=height,
            shape="rectangular-tube",
        )

    @classmethod
    def solid_rectangle(cls, width: float, height: float) -> Section:
        """Return a solid rectangle; sizes in m.

        Examples:
            >>> round(fem.Section.solid_rectangle(0.02, 0.01).A * 1e6, 1)
            200.0
        """
        iy, iz = width * height**3 / 12, height * width**3 / 12
        return cls(
            A=width * height,
            Iy=iy,
            Iz=iz,
            J=saint_venant_rectangle(width, height),
            Jp=iy + iz,
            kappa=_rectangle_kappa,
            width=width,
            height=height,
            shape="solid-rectangle",
        )

    @classmethod
    def round_tube(cls, diameter: float, wall: float) -> Section:
        """Return a circular tube; `wall` of half the diameter makes it solid; sizes in m.

        Examples:
            >>> round(fem.Section.round_tube(0.02, 0.01).A * 1e6, 1)
            314.2
        """
        outer, inner = diameter / 2, diameter / 2 - wall
        second = np.pi / 4 * (outer**4 - inner**4)
        return cls(
            A=float(np.pi * (outer**2 - inner**2)),
            Iy=float(second),
            Iz=float(second),
            J=float(2 * second),
            Jp=float(2 * second),
            kappa=CircleKappa(inner / outer),
            width=diameter,
            height=diameter,
            shape="round-tube",
        )

    @staticmethod
    def bredt(b: float, h: float, wall: float) -> float:
        """Return the torsion constant of a thin closed rectangle in m4 (Bredt 1896).

        Arguments:
            b, h: centre-line width and height in m.
            wall: wall thickness in m.

        Examples:
            >>> round(fem.Section.bredt(0.1, 0.05, 0.002) * 1e12)
            666667
        """
        return 2.0 * wall * (b * h) ** 2 / (b + h)

    @staticmethod
    def constant_kappa(value: float, along_z: float | None = None) -> ShearCoefficients:
        """Return shear coefficients that are the same for every material.

        Arguments:
            value: along both axes, or along y where `along_z` is given.
            along_z: along z.

        Examples:
            >>> fem.Section.constant_kappa(0.44)(0.33)
            (0.44, 0.44)
            >>> fem.Section.constant_kappa(0.44, 0.85)(0.33)
            (0.44, 0.85)
        """
        return ConstantKappa(value, value if along_z is None else along_z)

    @property
    def wall(self) -> float:
        """Return the wall in m that follows from the shape and the area of a tube, 0 for no tube.

        Examples:
            >>> round(fem.Section.round_tube(0.05, 0.002).wall, 6)
            0.002
        """
        width, height = self.width or 0.0, self.height or 0.0
        if self.shape == "rectangular-tube":
            root = max((width + height) ** 2 - 4.0 * self.A, 0.0)
            return float(width + height - np.sqrt(root)) / 4.0
        if self.shape == "round-tube":
            return float(width - np.sqrt(max(width**2 - 4.0 * self.A / np.pi, 0.0))) / 2.0
        return 0.0


@dataclass(frozen=True)
class ConstantKappa:
    """Shear coefficients of every material."""

    along_y: float
    along_z: float

    def __call__(self, nu: float) -> tuple[float, float]:
        """Return both coefficients."""
        return self.along_y, self.along_z


@dataclass(frozen=True)
class TabulatedKappa:
    """Shear coefficients that are known for some materials alone.

    Arguments:
        rows: Poisson's ratio and the coefficients along y and along z.
    """

    rows: tuple[tuple[float, float, float], ...]

    def __call__(self, nu: float) -> tuple[float, float]:
        """Return both coefficients; raises ModelError for another material."""
        for known, along_y, along_z in self.rows:
            if known == nu:
                return along_y, along_z
        raise ModelError(f"no shear coefficient is known for a Poisson's ratio of {nu:g}")


def saint_venant_rectangle(a: float, b: float) -> float:
    """Return the torsion constant of a solid rectangle in m4 (Timoshenko & Goodier, art. 109)."""
    long, short = max(a, b), min(a, b)
    n = np.arange(1, 40, 2)
    # tanh is 1 to the last digit from a slenderness of 100 on, and no quotient may overflow.
    slenderness = 1.0 / max(short / long, 0.01)
    series = np.sum(np.tanh(n * np.pi * slenderness / 2.0) / n**5.0)
    return float(long * short**3 * (1.0 / 3.0 - 64.0 / np.pi**5 * short / long * series))


def _cowper_box(b: float, h: float, nu: float) -> float:
    """Return kappa of a thin box of uniform wall for shear along h (Cowper 1966, table 1)."""
    n = b / h
    m = n
    flange = (12 + 72 * m + 150 * m**2 + 90 * m**3) + nu * (11 + 66 * m + 135 * m**2 + 90 * m**3)
    web = 10 * n**2 * ((3 + nu) * m + 3 * m**2)
    return 10 * (1 + nu) * (1 + 3 * m) ** 2 / (flange + web)


@dataclass(frozen=True)
class BoxKappa:
    """Shear coefficients of a thin box with centre-line sizes b along y and h along z in m."""

    b: float
    h: float

    def __call__(self, nu: float) -> tuple[float, float]:
        """Return both coefficients."""
        return _cowper_box(self.h, self.b, nu), _cowper_box(self.b, self.h, nu)


def _rectangle_kappa(nu: float) -> tuple[float, float]:
    kappa = 10 * (1 + nu) / (12 + 11 * nu)
    return kappa, kappa


@dataclass(frozen=True)
class CircleKappa:
    """Shear coefficients of a hollow circle by inner over outer radius (Cowper 1966, table 1)."""

    ratio: float

    def __call__(self, nu: float) -> tuple[float, float]:
        """Return both coefficients."""
        square = (1 + self.ratio**2) ** 2
        kappa = 6 * (1 + nu) * square / ((7 + 6 * nu) * square + (20 + 12 * nu) * self.ratio**2)
        return kappa, kappa


# Name in case.toml -> (constructor, its keys); walls come last so that they can be checked.
SHAPES: Mapping[str, tuple[Callable[..., Section], tuple[str, ...]]] = {
    "square-tube": (
        lambda width, wall: Section.rectangular_tube(width, width, wall),
        ("width", "wall"),
    ),
    "rectangular-tube": (Section.rectangular_tube, ("width", "height", "wall")),
    "round-tube": (Section.round_tube, ("diameter", "wall")),
    "solid-square": (lambda width: Section.solid_rectangle(width, width), ("width",)),
    "solid": (Section.solid_rectangle, ("width", "height")),
    "solid-rectangle": (Section.solid_rectangle, ("width", "height")),
    "solid-circle": (lambda diameter: Section.round_tube(diameter, diameter / 2), ("diameter",)),
}
