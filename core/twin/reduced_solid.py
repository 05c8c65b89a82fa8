"""A solid of other spans and sections, or other materials: its modes from a few dozen shapes.

Mass and stiffness of a solid that is stretched piecewise along its axes, or of which members have
other moduli and densities, are sums of fixed matrices times products of powers of the factors; they
are kept as shapes found beforehand see them.

Source: affine decomposition and Rayleigh-Ritz (Quarteroni, Manzoni & Negri 2016, chapter 3).
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import scipy.linalg as la

from femubench.core.errors import InputError
from femubench.core.files import read_bytes
from femubench.core.typing import AnyArray, FloatArray

LARGEST = 16 * 1024**2  # bytes of a file
_RIGID = 6  # modes of a free structure
_SHIFT = 50.0  # times the frequency below which modes are rigid
_NAMES = (
    *("names", "ranges", "sections", "sizes", "sensors", "lumps", "springs", "masses"),
    *("members", "materials"),
    *("knots_x", "knots_y", "knots_z", "kinds_x", "kinds_y", "kinds_z", "rigid_below"),
    *("stiffness", "stiffness_powers", "mass", "mass_powers"),
    *("seat_axes", "seat_factors", "seat_counts", "seat_first", "seat_second"),
    *("seat_sums", "seat_moments", "scatter", "together", "shape_scatter", "error", "alike"),
)
# Of an archive that is none, holds objects, or ends too early.
_UNREADABLE = (ValueError, KeyError, EOFError, TypeError, AttributeError, zlib.error)
_ARM = np.zeros((3, 3, 3))  # theta x arm: [direction, axis of the arm, axis of the rotation]
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _ARM[_i, _k, _j], _ARM[_i, _j, _k] = 1.0, -1.0


@dataclass(frozen=True)
class ReducedSolid:
    """What a file of a stretched solid holds.

    Arguments:
        arrays: by their names, which `truths/stretch_file.py` lists.
    """

    arrays: Mapping[str, AnyArray]

    @classmethod
    def read(cls, file: Path) -> ReducedSolid:
        """Return the solid of a file.

        Arguments:
            file: ``.npz`` as `python -m truths --only stretches` writes it.

        Raises:
            InputError: where it is no such file.
        """
        expected = "a stretched solid, as python -m truths writes it"
        try:
            with np.load(BytesIO(read_bytes(file, LARGEST)), allow_pickle=False) as kept:
                arrays = dict(kept)
        except (*_UNREADABLE, BadZipFile) as fault:
            raise InputError(f"it cannot be read ({fault})", file=file, expected=expected) from None
        missing = sorted(set(_NAMES) - set(arrays))
        if missing:
            raise InputError(f"it has no {missing[0]!r}", file=file, expected=expected)
        return cls(arrays)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the factors."""
        return tuple(map(str, self.arrays["names"]))

    def draw_factors(self, rng: np.random.Generator) -> FloatArray:
        """Return factors within their ranges, log-uniform, (factors,)."""
        low, high = np.log(self.arrays["ranges"]).T
        return np.asarray(np.exp(rng.uniform(low, high)))

    def move_points(self, factors: FloatArray, xyz: FloatArray) -> FloatArray:
        """Return where points of the drawing lie in the stretched one, m.

        Arguments:
            factors: of the stretch, (factors,).
            xyz: points in m, (n, 3).
        """
        found = np.array(xyz, dtype=float)
        for axis, name in enumerate("xyz"):
            knots, kinds = self.arrays[f"knots_{name}"], self.arrays[f"kinds_{name}"]
            planes = knots[0] + np.append(0.0, np.cumsum(factors[kinds] * np.diff(knots)))
            which = np.searchsorted(knots[1:-1], found[:, axis])
            beyond = found[:, axis] - knots[which]
            found[:, axis] = planes[which] + factors[kinds[which]] * beyond
        return found

    def sizes(self, factors: FloatArray, section: str) -> FloatArray | None:
        """Return width, height and wall of a section in m; None for one that only the drawing has.

        A section that is given by numbers has no sizes: all are 0.
        """
        names = list(map(str, self.arrays["sections"]))
        if section not in names:
            return None
        return np.asarray(self.arrays["sizes"][names.index(section)] @ factors)

    @cached_property
    def _materials(self) -> dict[str, tuple[int, int]]:
        rows = zip(self.arrays["members"], self.arrays["materials"].tolist(), strict=True)
        return {str(name): (modulus, density) for name, (modulus, density) in rows}

    def material(self, factors: FloatArray, member: str) -> tuple[float, float]:
        """Return the factors of modulus and density of a member, 1 of one that stays."""
        if member not in self._materials:
            return 1.0, 1.0
        modulus, density = self._materials[member]
        return float(factors[modulus]), float(factors[density])

    def mass(self, factors: FloatArray) -> float:
        """Return the mass with all that is attached to it, without design changes, in kg."""
        powers = np.prod(factors ** self.arrays["mass_powers"], axis=1)
        hung = self.arrays["lumps"][self.arrays["lumps"][:, 0] == 0.0, 2].sum()
        return float(powers @ self.arrays["masses"] + hung)

    def modes(self, factors: FloatArray, change: int, count: int) -> tuple[FloatArray, FloatArray]:
        """Return the lowest elastic modes.

        Arguments:
            factors: of the stretch, (factors,).
            change: number of the design change, from 1; 0 for the structure as built.
            count: of modes.

        Returns:
            Frequencies in Hz, (count,), and shapes at the sensors, (sensors, count).
        """
        seats = [self._seat(factors, seat) for seat in range(len(self.arrays["seat_counts"]))]
        stiffness, mass = (self._sum(what, factors) for what in ("stiffness", "mass"))
        for state, seat, kg, *offset in self.arrays["lumps"]:
            if state in (0, change):
                motion = seats[int(seat)]
                moves = motion[:3] + np.einsum("iaj,a,jn->in", _ARM, offset, motion[3:])
                mass = mass + kg * (moves.T @ moves)
        for state, seat, direction, value in self.arrays["springs"]:
            if state in (0, change):
                row = seats[int(seat)][int(direction)]
                stiffness = stiffness + value * np.outer(row, row)
        # The sum is nearly a unit matrix, the mass nearly singular: so the digits are the same on
        # all machines.
        slowest = float(self.arrays["rigid_below"])
        shift = (2.0 * np.pi * _SHIFT * slowest) ** 2
        lowest = max(self.size - count - _RIGID, 0), self.size - 1
        inverse, vectors = la.eigh(mass, stiffness + shift * mass, subset_by_index=lowest)
        values, vectors = 1.0 / inverse[::-1] - shift, vectors[:, ::-1]
        hertz = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
        chosen = np.flatnonzero(hertz >= slowest)[:count]
        read = np.array([seats[seat][direction] for seat, direction in self.arrays["sensors"]])
        return hertz[chosen], np.asarray(read @ vectors[:, chosen])

    def _sum(self, what: str, factors: FloatArray) -> FloatArray:
        """Return a matrix of the stretched solid as the shapes see it, (n, n)."""
        powers = np.prod(factors ** self.arrays[f"{what}_powers"], axis=1)
        rows, columns = self._upper
        found = np.zeros((self.size, self.size))
        found[rows, columns] = powers @ self.arrays[what].astype(float)
        found[columns, rows] = found[rows, columns]
        return found

    @property
    def size(self) -> int:
        """Return the number of shapes."""
        return int((np.sqrt(8 * self.arrays["mass"].shape[1] + 1) - 1) / 2)

    @cached_property
    def _upper(self) -> tuple[AnyArray, AnyArray]:
        rows, columns = np.triu_indices(self.size)
        return rows, columns

    def _seat(self, factors: FloatArray, seat: int) -> FloatArray:
        """Return the rigid motion that fits the nodes of a seat best, (6, n) of the shapes."""
        kept = {
            name: self.arrays[f"seat_{name}"][seat].astype(float)
            for name in ("first", "second", "sums", "moments")
        }
        axes, which = self.arrays["seat_axes"][seat], self.arrays["seat_factors"][seat]
        count, own = int(self.arrays["seat_counts"][seat]), factors[which]
        along = np.eye(3)[axes] * own[:, None]  # (pieces, 3)
        first, second = kept["first"] @ along, along.T @ kept["second"] @ along
        moment = np.einsum("pa,pcn->acn", along, kept["moments"])
        normal = np.zeros((6, 6))
        normal[:3, :3] = count * np.eye(3)
        normal[:3, 3:] = np.einsum("iaj,a->ij", _ARM, first)
        normal[3:, :3] = normal[:3, 3:].T
        normal[3:, 3:] = np.einsum("iaj,ibk,ab->jk", _ARM, _ARM, second)
        right = np.vstack([kept["sums"], np.einsum("iaj,ain->jn", _ARM, moment)])
        return np.asarray(np.linalg.solve(normal, right), dtype=float)
