"""A case: a nominal model, what was measured on the structure, and its known changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from femubench.core.case.modal_scale import weigh_by_scale
from femubench.core.display import Shown, count_noun, modes_line
from femubench.core.fem.alteration import Alteration, alter_model
from femubench.core.fem.frame import GroundSpring, Place, PointMass
from femubench.core.fem.model import Model
from femubench.core.modal.eigen import DENSE_LIMIT, keep_last
from femubench.core.modal.frf import FrequencyResponses, ResponseSplit
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import FloatArray

TOLERANCE = 0.005
LARGEST_TOLERANCE = 0.2
BEAM_SHARE = 0.5
SCATTER = (0.002, 0.02)  # of frequencies and of shapes, from one test to the next


@dataclass(frozen=True)
class Modification:
    """A known change of the structure with its own measurement, all of it held out."""

    name: str
    masses: tuple[PointMass, ...]
    springs: tuple[GroundSpring, ...]
    measurement: Measurement
    alteration: Alteration = field(default_factory=Alteration)

    def __str__(self) -> str:
        more = self.alteration
        kinds = zip(
            (self.masses, self.springs, more.supports, more.removed, more.exchanged),
            ("mass", "ground spring", "support", "part removed", "member exchanged"),
            strict=True,
        )
        changed = ", ".join(f"{noun}: {len(own)}" for own, noun in kinds if own)
        modes = modes_line(self.measurement.numbers, self.measurement.frequencies)
        return f"{self.name}: {changed}; {modes}"

    @property
    def places(self) -> tuple[Place, ...]:
        """Return where something is added."""
        own = [mass.at for mass in self.masses] + [spring.at for spring in self.springs]
        return (*own, *(support.at for support in self.alteration.supports))

    def modify(self, model: Model) -> Model:
        """Return a model with the change, of a small model the same one every time.

        Raises:
            ModelError: when something lies off the structure, or is not there to be taken away.
            NotApplicable: where members are to be taken of matrices.
        """

        def make() -> Model:
            attached = model.attach(self.masses, self.springs)
            return alter_model(attached, self.alteration) if self.alteration else attached

        # A small one is kept with all that follows from it.
        few = model.size <= DENSE_LIMIT
        return keep_last(model, ("with", id(self)), self, make) if few else make()


@dataclass(frozen=True)
class Match:
    """Where a sensor was taken to sit.

    Arguments:
        place: the node, the joint or the station of a member.
        xyz: where that is in m.
        measured: where the test says that the sensor is, in m along the axes of the model.
    """

    sensor: str
    place: str
    xyz: FloatArray
    measured: FloatArray

    @property
    def distance(self) -> float:
        """Return how far apart the two are in m."""
        return float(np.linalg.norm(self.xyz - self.measured))


@dataclass(frozen=True, repr=False)
class Case(Shown):
    """Everything that a case folder says.

    Arguments:
        name: the case's name, as in ``bench run NAME``.
        title: one line for tables.
        source: where the numbers come from.
        folder: the folder that was read.
        model: the nominal model.
        measurement: all measured modes, used, held out and neither.
        used: labels of the modes that a strategy is given.
        held_out: labels of the modes that only the score sees.
        modifications: known changes with their modes.
        band: every mode between these frequencies in Hz was found; None where not stated.
        digest: hash of the content of all files of the case.
        tolerance: standard deviation of the relative scatter of every element's stiffness and
            mass that counts as ordinary in a diagnosis; 0 turns it off.
        reference: modes of the same structure as it was, which the causes sought are not in.
        reference_used: labels of those that a diagnosis is given; the others serve its proof.
        model_error: factor on the widths of what a model gets wrong; 0 turns it off. None is 1
            with a reference, which says much of it, or with groups, and 0 without.
        beam_share: how probable it is, before any datum, that the structure behaves like a beam
            model with ordinary scatter.
        structure: the physical structure, which several cases may share; empty for one that no
            other case is known to share.
        notes: what was understood otherwise than it stands in the files, one sentence each.
        matches: where each sensor that came with coordinates was taken to sit.
        lines: that draw the structure of the test, in m along the axes of the model, (k, 2, 3).
        whole: the model as it came, where `model` is its reduction to groups; None elsewhere.
        drawing: name of the drawing that the model is; empty for that of `case.toml`.
        frfs: measured frequency responses of the structure as tested; they hold the held-out modes
            too, and are drawn.
        split: which of them a strategy is given and which only the score sees; None for neither.
    """

    name: str
    title: str
    source: str
    folder: Path
    model: Model
    measurement: Measurement
    used: tuple[int, ...]
    held_out: tuple[int, ...]
    modifications: tuple[Modification, ...] = ()
    band: tuple[float, float] | None = None
    digest: str = ""
    tolerance: float = TOLERANCE
    reference: Measurement | None = None
    reference_used: tuple[int, ...] = ()
    model_error: float | None = None
    beam_share: float = BEAM_SHARE
    structure: str = ""
    notes: tuple[str, ...] = ()
    matches: tuple[Match, ...] = ()
    lines: FloatArray | None = None
    frfs: FrequencyResponses | None = None
    split: ResponseSplit | None = None
    whole: Model | None = None
    drawing: str = ""

    def rows(self) -> list[tuple[str, str]]:
        """Return where the case is from, its model, and what was measured on it."""
        measured = self.measurement
        found = [
            (self.name, self.title),
            ("source", self.source),
            ("folder", str(self.folder)),
            *([("structure", self.structure)] if self.structure else []),
            ("model", self.model.rows()[0][1]),
            ("sensors", str(len(measured.sensors))),
            ("used", modes_line(self.used, measured.select(self.used).frequencies)),
        ]
        if self.held_out:
            held_out = measured.select(self.held_out).frequencies
            found.append(("held out", modes_line(self.held_out, held_out)))
        if self.reference is not None:
            known = self.reference.select(self.reference_used).frequencies
            found.append(("reference", modes_line(self.reference_used, known)))
        if self.frfs is not None:
            found.append(("frfs", self.frfs.rows()[0][1]))
            if self.split is not None:
                given = self.split.given(self.frfs)
                where = count_noun(len(given.responses), "sensor")
                found.append(("used lines", f"{given.rows()[1][1]}, at {where}"))
        found += [("modified", str(change)) for change in self.modifications]
        return [*found, *(("note", note) for note in self.notes)]

    @property
    def error_width(self) -> float:
        """Return the factor on the widths of the model error."""
        if self.model_error is not None:
            return self.model_error
        grouped = bool(self.model.groups or self.model.mass_groups)
        return 1.0 if grouped or self.reference is not None else 0.0

    @property
    def used_reference(self) -> Measurement | None:
        """Return the modes of the structure as it was that a diagnosis is given."""
        return None if self.reference is None else self.reference.select(self.reference_used)

    @property
    def drawn_as(self) -> str:
        """Return the name that goes into the random numbers of its jobs."""
        return self.name

    def used_measurement(self, seed: int = 0) -> Measurement:
        """Return what a strategy may know: used modes and responses, with noise of a seed but 0.

        Where nobody weighed the structure its mass is what modal masses of these modes say. Seed 0
        is the data as recorded; every other seed is one draw at the stated deviations.
        """
        used = weigh_by_scale(self.model, self.measurement.select(self.used))
        if self.frfs is not None and self.split is not None:
            used = replace(used, responses=self.split.given(self.frfs))
        if seed == 0:
            return used
        words = [seed, *self.drawn_as.encode()]
        return used.with_noise(np.random.default_rng(np.random.SeedSequence(words)))

    def conditions(self, seed: int) -> Mapping[str, float | str]:
        """Return what a job of this seed is given otherwise than the files of the case say."""
        return {}
