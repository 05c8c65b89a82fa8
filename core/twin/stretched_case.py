"""Twins with spans and sections, or materials, of their own: solids give what is measured."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from femubench.core.case.case import Case
from femubench.core.case.similarity import similar_section
from femubench.core.errors import NotApplicable
from femubench.core.fem.frame import Frame, GroundSpring, Joint, Material, Member, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.files import read_bytes
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.modal.pairing import pair_measured
from femubench.core.twin.reduced_solid import LARGEST, ReducedSolid
from femubench.core.typing import FloatArray

FILE = "stretch.npz"  # in the folder of a case
_MOST_DRAWS = 100
_LEAST_SHIFT = 0.04  # of ratios of frequencies: who knows them must not find them again
_GAIN_SHARE = 0.5  # of the variance of the largest reading: a sensor's gain, alike in every mode
_FARTHER = 1.5  # times as far from what was measured as on the case at most
_SCALED = "section"  # the factor of sections that are given by numbers
_Part = TypeVar("_Part", PointMass, GroundSpring)


def draw_stretched_case(case: Case, rng: np.random.Generator) -> Case:
    """Return the case of a structure that is stretched piecewise; solids of some cases are kept.

    It has other ratios of frequencies, and a drawing about as near to the truth. Where the drawing
    tells two modes apart by chance alone, a stretch may leave one without a partner: that says
    nothing of a strategy.

    Raises:
        NotApplicable: for a case without the file of a stretched solid, or where no stretch is
            as hard as the case.
        InputError: where that file cannot be read.
    """
    file = case.folder / FILE
    if not file.is_file() or case.model.structure is None:
        raise NotApplicable(f"no stretched solid of {case.name} is known")
    solid, known = ReducedSolid.read(file), nearness(case)
    for _ in range(_MOST_DRAWS):
        found = stretch_case(case, solid, solid.draw_factors(rng), rng)
        shift = np.log(found.measurement.frequencies / case.measurement.frequencies)
        as_near = all(
            alone <= most and error <= _FARTHER * usual
            for (alone, error), (most, usual) in zip(nearness(found), known, strict=True)
        )
        if float(np.std(shift)) >= _LEAST_SHIFT and as_near:
            content = hashlib.sha256(read_bytes(file, LARGEST)).hexdigest()
            source = f"{case.digest} stretched by {content}"
            return replace(found, digest=hashlib.sha256(source.encode()).hexdigest())
    raise NotApplicable(f"no stretch of {case.name} is as hard as it is")


def nearness(case: Case) -> list[tuple[int, float]]:
    """Return how near the nominal model is, as built and after each design change.

    That is the number of measured modes without a partner in it, and the rms of
    ln(f_predicted / f_measured) of the others.
    """
    states = [(case.model, case.measurement)]
    states += [(change.modify(case.model), change.measurement) for change in case.modifications]
    found = []
    for model, measured in states:
        modes = solve_modes(model)
        readings = model.observe(measured.sensors) @ modes.shapes
        partners = pair_measured(measured, modes, readings).index
        paired = partners >= 0
        predicted = modes.natural_frequencies[partners[paired]]
        off = np.log(np.abs(predicted) / measured.frequencies[paired])
        error = np.sqrt(np.square(off).sum() / max(off.size, 1))
        found.append((int((~paired).sum()), float(error)))
    return found


def stretch_case(
    case: Case, solid: ReducedSolid, factors: FloatArray, rng: np.random.Generator | None
) -> Case:
    """Return the case of a stretched structure: model, modes, and changes.

    Arguments:
        case: a frame.
        solid: of the structure of the case.
        factors: of the stretch, (factors,).
        rng: draws what a test scatters, at the deviations of the case; None for no scatter.
    """
    frame = case.model.frame_structure.frame
    test = _Test.of(case, solid, factors, rng)
    changes = tuple(
        replace(
            change,
            masses=_at_places(frame, solid, factors, change.masses),
            springs=_at_places(frame, solid, factors, change.springs),
            measurement=test.measure(change.measurement, number),
        )
        for number, change in enumerate(case.modifications, start=1)
    )
    corners = solid.move_points(factors, frame.corners).tolist()
    joints = [
        Joint(joint.name, (x, y, z), joint.type)
        for joint, (x, y, z) in zip(frame.joints, corners, strict=True)
    ]
    sections = {id(m.section): _section(m.section, solid, factors) for m in frame.members}
    return replace(
        case,
        model=Model.of(
            replace(
                frame,
                joints=tuple(joints),
                members=tuple(
                    replace(
                        m, section=sections[id(m.section)], material=_material(m, solid, factors)
                    )
                    for m in frame.members
                ),
                masses=_at_places(frame, solid, factors, frame.masses),
                springs=_at_places(frame, solid, factors, frame.springs),
            )
        ),
        measurement=test.measure(case.measurement, 0),
        modifications=changes,
        # What is said of the files is of the structure that it was.
        notes=(),
        matches=(),
        lines=None,
    )


def _material(member: Member, solid: ReducedSolid, factors: FloatArray) -> Material:
    modulus, density = solid.material(factors, member.name)
    known = member.material
    return replace(known, E=modulus * known.E, rho=density * known.rho)


def _section(section: Section, solid: ReducedSolid, factors: FloatArray) -> Section:
    sizes = solid.sizes(factors, section.name)
    if sizes is None:
        return section
    width, height, wall = map(float, sizes)
    if not width:
        return similar_section(section, float(factors[solid.names.index(_SCALED)]))
    shape = (
        Section.rectangular_tube(width, height, wall)
        if wall
        else Section.solid_rectangle(width, height)
    )
    return replace(shape, name=section.name)


def _at_places(
    frame: Frame, solid: ReducedSolid, factors: FloatArray, parts: Iterable[_Part]
) -> tuple[_Part, ...]:
    """Return what is attached at places where the stretch has these."""
    return tuple(replace(part, at=_place(frame, solid, factors, part.at)) for part in parts)


def _place(frame: Frame, solid: ReducedSolid, factors: FloatArray, place: Place) -> Place:
    """Return a place; a part of a member may grow more than the rest."""
    if place.member is None or place.s is None:
        return place
    ends = frame.members[frame.member_index[place.member]].ends
    start, stop = (np.array(frame.joint(name).xyz) for name in ends)
    points = np.array([start, start + place.s * (stop - start), stop])
    first, here, last = solid.move_points(factors, points)
    share = np.linalg.norm(here - first) / np.linalg.norm(last - first)
    return Place(member=place.member, s=float(share))


@dataclass(frozen=True)
class _Test:
    """What a test of the stretched structure would record.

    Arguments:
        gains: of the sensors, alike in all modes and states, (sensors,).
        weighed: mass in kg.
    """

    solid: ReducedSolid
    factors: FloatArray
    gains: FloatArray
    weighed: float
    rng: np.random.Generator | None

    @classmethod
    def of(
        cls,
        case: Case,
        solid: ReducedSolid,
        factors: FloatArray,
        rng: np.random.Generator | None,
    ) -> _Test:
        measured, mass = case.measurement, solid.mass(factors)
        gains = np.ones(len(measured.sensors))
        if rng is not None:
            spread = float(solid.arrays["shape_scatter"]) * np.sqrt(_GAIN_SHARE)
            gains += spread * rng.standard_normal(len(gains))
            if measured.total_mass is not None:
                value, std = measured.total_mass
                mass *= 1.0 + std / value * rng.standard_normal()
        return cls(solid, factors, gains, mass, rng)

    def measure(self, known: Measurement, change: int) -> Measurement:
        """Return what replaces a measurement of the case.

        Arguments:
            change: number of the design change, 0 for none.
        """
        exact, shapes = self.solid.modes(self.factors, change, len(known))
        shapes, relative = _scaled(shapes), known.frequency_std / known.frequencies
        frequencies = exact
        if self.rng is not None:
            scatter, together, of_shapes = (
                float(self.solid.arrays[name]) for name in ("scatter", "together", "shape_scatter")
            )
            # The scatter of the test that the case describes.
            common = np.sqrt(together) * self.rng.standard_normal()
            each = np.sqrt(1.0 - together) * self.rng.standard_normal(len(exact))
            # What the gain leaves of the stated variance, so that every reading scatters as stated.
            share = np.sqrt(1.0 - _GAIN_SHARE * np.square(shapes))
            noise = of_shapes * share * self.rng.standard_normal(shapes.shape)
            read = _scaled(shapes * self.gains[:, None] + noise)
            frequencies, shapes = exact * (1.0 + scatter * (common + each)), read
        weight = known.total_mass
        own: dict[str, Any] = {
            "sensors": Sensors(
                known.sensors.labels,
                self.solid.move_points(self.factors, known.sensors.xyz),
                known.sensors.directions,
            ),
            "frequencies": frequencies,
            "frequency_std": relative * exact,
            "shapes": shapes,
            "modal_mass": None,
        }
        if weight is not None:
            own["total_mass"] = (self.weighed, weight[1] / weight[0] * self.weighed)
        return replace(known, **own)


def _scaled(shapes: FloatArray) -> FloatArray:
    """Return shapes with the largest component of each at +1, (sensors, modes)."""
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=0)[None, :], axis=0)
    return np.asarray(shapes / largest)
