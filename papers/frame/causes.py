"""What the ladder frame's beam model lacks, switched on one at a time and in every order."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from math import factorial

import numpy as np

from femubench import Model, solve_modes
from femubench.fem import Factor, FloatArray, Frame, Section
from femubench.reproduction import Workbench
from femubench.scenarios.structures import ladder_truth

WALL = 0.00238  # m, of the tube as the paper gives it
TORSION = "torsion constant"
SHEAR = "shear and rotary inertia"
FURTHER = "further shear flexibility"
JOINTS = "joint springs"
CAUSES = (TORSION, SHEAR, FURTHER, JOINTS)


@dataclass(frozen=True)
class Ladder:
    """The paper's model, and the beam model that meets the test.

    Arguments:
        nominal: Euler-Bernoulli beams, the polar moment as torsion constant.
        truth: stand-in for the test.
        tube: the section with Bredt's torsion constant.
        measured: the five frequencies of the test in Hz.
    """

    nominal: Frame
    truth: Frame
    tube: Section
    measured: FloatArray

    @classmethod
    def of(cls, bench: Workbench) -> Ladder:
        """Return what the case ``frame`` says, and the stand-in for its test."""
        case = bench.cases["frame"]
        nominal = case.model.frame_structure.frame
        width = nominal.members[0].section.width
        assert width is not None
        tube = Section.rectangular_tube(width, width, WALL)
        return cls(nominal, ladder_truth(tube), tube, case.measurement.frequencies)

    @property
    def shear_ratio(self) -> float:
        """Return the shear flexibility of the stand-in over the textbook's."""
        used, nu = self.truth.members[0].section.kappa, self.truth.members[0].material.nu
        assert used is not None
        assert self.tube.kappa is not None
        return self.tube.kappa(nu)[1] / used(nu)[1]

    def frame(
        self, causes: Iterable[str], *, young: float | None = None, accelerometer: bool = True
    ) -> Frame:
        """Return the paper's model with some causes added.

        Arguments:
            causes: of `CAUSES`.
            young: Young's modulus in Pa; None for the paper's.
            accelerometer: whether the mass at coordinate 1 stays.
        """
        found = set(causes)
        section = replace(self.tube, J=self.tube.J if TORSION in found else self.tube.Jp)
        members = tuple(
            replace(m, section=section, material=replace(m.material, E=young or m.material.E))
            for m in self.nominal.members
        )
        flexibility = (SHEAR in found) + (FURTHER in found) * (self.shear_ratio - 1.0)
        return replace(
            self.nominal,
            beam="timoshenko",
            members=members,
            masses=self.nominal.masses if accelerometer else (),
            joint_springs=self.truth.joint_springs if JOINTS in found else (),
            rotary_inertia=SHEAR in found,
            bending_mass="cubic",  # of the paper's time
            factors=(Factor("shear", ("all",), flexibility),),
        )

    def frequencies(self, frame: Frame) -> FloatArray:
        """Return the first frequencies of a frame in Hz, as many as were measured."""
        count = len(self.measured)
        return solve_modes(Model.of(frame), count + 3).elastic.natural_frequencies[:count]

    def errors(self, frequencies: FloatArray) -> FloatArray:
        """Return the deviations from the test in percent."""
        return np.asarray(100.0 * (frequencies / self.measured - 1.0))


@dataclass(frozen=True)
class Shares:
    """Parts of the frequency errors in percent of the measured frequencies, (n_modes,) each.

    Arguments:
        first: what a cause takes off the error of the paper's model, alone.
        last: what it takes off when all others are there already.
        mean: the mean over all orders (Shapley 1953).
        whole: the error of the paper's model.
        complete: the error with all causes, at the paper's Young's modulus.
        accelerometer: what taking the accelerometer off takes off after all causes.
        young: what the stand-in's Young's modulus takes off after that.
    """

    first: Mapping[str, FloatArray]
    last: Mapping[str, FloatArray]
    mean: Mapping[str, FloatArray]
    whole: FloatArray
    complete: FloatArray
    accelerometer: FloatArray
    young: FloatArray

    @property
    def rest(self) -> FloatArray:
        """Return what is left: mesh, mass matrix, misfit of the stand-in."""
        return np.asarray(self.complete - self.accelerometer - self.young)


def shares_of(ladder: Ladder) -> Shares:
    """Return how the errors of the paper's model are made up, at its own Young's modulus."""
    subsets = [frozenset(c) for k in range(len(CAUSES) + 1) for c in combinations(CAUSES, k)]
    error = {s: ladder.errors(ladder.frequencies(ladder.frame(s))) for s in subsets}
    none, everything = frozenset[str](), frozenset(CAUSES)
    bare = ladder.frame(CAUSES, accelerometer=False)
    young = ladder.truth.members[0].material.E
    stiffer = ladder.frame(CAUSES, young=young, accelerometer=False)
    without, other = (ladder.errors(ladder.frequencies(f)) for f in (bare, stiffer))
    return Shares(
        first={c: error[none] - error[frozenset({c})] for c in CAUSES},
        last={c: error[everything - {c}] - error[everything] for c in CAUSES},
        mean={c: mean_share(error, c) for c in CAUSES},
        whole=error[none],
        complete=error[everything],
        accelerometer=error[everything] - without,
        young=without - other,
    )


def mean_share(error: Mapping[frozenset[str], FloatArray], cause: str) -> FloatArray:
    """Return what a cause takes off the errors, as the mean over all orders of the causes.

    Source: Shapley (1953), A value for n-person games.
    """
    count = max(len(causes) for causes in error)
    total = np.zeros_like(error[frozenset()])
    for causes, found in error.items():
        if cause not in causes:
            before = factorial(len(causes)) * factorial(count - len(causes) - 1)
            total += before / factorial(count) * (found - error[causes | {cause}])
    return total


def best_factor(frequencies: FloatArray, measured: FloatArray) -> float:
    """Return the factor on all frequencies that leaves the smallest largest deviation."""
    ratio = frequencies / measured
    return float(2.0 / (ratio.min() + ratio.max()))
