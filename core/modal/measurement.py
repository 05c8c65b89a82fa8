"""What a vibration test gives: frequencies and mode shapes with their standard deviations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.display import Shown, count_noun
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.complex_modes import phase_loss
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.typing import FloatArray, IntArray

_DAMPING = 0.005  # where none was measured
_OF_MODES = (
    *("frequencies", "frequency_std", "damping", "shapes", "shape_std", "out_of_phase"),
    "modal_mass",
)
OUT_OF_PHASE = 0.2  # of a shape: from there on its loss is said


@dataclass(frozen=True, repr=False)
class Measurement(Shown):
    """Measured modes of one structure.

    Arguments:
        sensors: where the shapes were measured.
        numbers: the label of every mode, (m,); says nothing about a model's order.
        frequencies: natural frequencies in Hz, (m,).
        frequency_std: their standard deviations in Hz, (m,).
        damping: damping ratios, (m,); nan where none was measured.
        shapes: real mode shapes, (n_sensors, m), every one with its own scale; nan where missing.
        shape_std: standard deviations in the unit of each shape, (n_sensors, m).
        total_mass: mass of the whole structure and its standard deviation in kg, if weighed.
        frequency_correlation: of the errors of the frequencies, (m, m); None where they are
            independent.
        assumed: whether a scatter that nobody has measured is in the deviations.
        responses: frequency responses at some of the sensors with their standard deviations; None
            where none are given.
        out_of_phase: share of the norm of every shape that was out of phase with the rest of it and
            is lost as it was turned real, (m,); None where none was complex.
        modal_mass: phi' M phi of every shape as it is scaled here, in kg, (m,); nan where unknown;
            None where the test gives none.
    """

    sensors: Sensors
    numbers: tuple[int, ...]
    frequencies: FloatArray
    frequency_std: FloatArray
    damping: FloatArray
    shapes: FloatArray
    shape_std: FloatArray
    total_mass: tuple[float, float] | None = None
    frequency_correlation: FloatArray | None = None
    assumed: bool = False
    responses: FrequencyResponses | None = None
    out_of_phase: FloatArray | None = None
    modal_mass: FloatArray | None = None

    phase_loss = staticmethod(phase_loss)

    def __len__(self) -> int:
        return len(self.numbers)

    def rows(self) -> list[tuple[str, str]]:
        """Return the sensors, and frequency, deviation and damping of every mode."""
        found = [
            ("", f"{count_noun(len(self), 'mode')} at {count_noun(len(self.sensors), 'sensor')}")
        ]
        lost = np.zeros(len(self)) if self.out_of_phase is None else self.out_of_phase
        kg = np.full(len(self), np.nan) if self.modal_mass is None else self.modal_mass
        own = self.numbers, self.frequencies, self.frequency_std, self.damping, lost, kg
        for row in zip(*own, strict=True):
            text = f"{row[1]:.6g} Hz, std {row[2]:.2g} Hz"
            text += f", damping {row[3]:.3g}" if np.isfinite(row[3]) else ""
            text += f", {100.0 * row[4]:.2g} % out of phase" if row[4] >= OUT_OF_PHASE else ""
            text += f", modal mass {row[5]:.3g} kg" if np.isfinite(row[5]) else ""
            found.append((f"mode {row[0]}", text))
        if self.total_mass is not None:
            found.insert(1, ("mass", "{:.6g} kg, std {:.2g} kg".format(*self.total_mass)))
        if self.responses is not None:
            found += [("responses", text) for _, text in self.responses.rows()]
        return found

    @property
    def eigenvalues(self) -> FloatArray:
        """Return (2 pi f)^2 in rad^2/s^2, (m,)."""
        return np.square(2.0 * np.pi * self.frequencies)

    @property
    def frequency_covariance(self) -> FloatArray | None:
        """Return the covariance of the frequencies in Hz^2, (m, m); None where independent."""
        if self.frequency_correlation is None:
            return None
        return np.asarray(
            self.frequency_std[:, None] * self.frequency_correlation * self.frequency_std
        )

    @property
    def usual_damping(self) -> float:
        """Return the median of the measured damping ratios, a half per cent where there is none."""
        known = self.damping[np.isfinite(self.damping)]
        return float(np.median(known)) if len(known) else _DAMPING

    def damping_of(self, partner: IntArray, count: int) -> FloatArray:
        """Return the damping ratio of every mode of a model: the usual one where none is measured.

        Arguments:
            partner: which of them belongs to every measured mode; -1 where none does, (m,).
            count: of the modes of the model.
        """
        found = np.full(count, self.usual_damping)
        known = (partner >= 0) & np.isfinite(self.damping)
        found[partner[known]] = self.damping[known]
        return found

    def widen(self, std: FloatArray) -> Measurement:
        """Return the same modes with errors of their own as well.

        Arguments:
            std: of the further, independent errors of the frequencies in Hz, (m,).
        """
        wide, correlation = np.hypot(self.frequency_std, std), None
        if self.frequency_correlation is not None:
            share = self.frequency_std / wide
            correlation = share[:, None] * self.frequency_correlation * share
            np.fill_diagonal(correlation, 1.0)
        return replace(self, frequency_std=wide, frequency_correlation=correlation)

    @property
    def has_shapes(self) -> bool:
        """Tell whether every mode has a shape at one sensor at least."""
        return len(self.sensors) > 0 and bool(np.isfinite(self.shapes).any(axis=0).all())

    def select(self, numbers: Iterable[int]) -> Measurement:
        """Return the modes of the given labels, in the given order.

        Raises:
            KeyError: when a label is not among the modes.
        """
        wanted = tuple(numbers)
        missing = [number for number in wanted if number not in self.numbers]
        if missing:
            raise KeyError(f"no measured mode {missing[0]}; there are {list(self.numbers)}")
        columns = [self.numbers.index(number) for number in wanted]
        own = {name: getattr(self, name) for name in _OF_MODES}
        taken = {name: value[..., columns] for name, value in own.items() if value is not None}
        if self.frequency_correlation is not None:
            taken["frequency_correlation"] = self.frequency_correlation[np.ix_(columns, columns)]
        return replace(self, numbers=wanted, **taken)

    def with_noise(self, rng: np.random.Generator) -> Measurement:
        """Return the same modes with one draw of Gaussian noise at their standard deviations."""
        drawn = rng.standard_normal(len(self))
        if self.frequency_correlation is not None:
            drawn = np.linalg.cholesky(self.frequency_correlation) @ drawn
        frequencies = self.frequencies + self.frequency_std * drawn
        shapes = self.shapes + self.shape_std * rng.standard_normal(self.shapes.shape)
        own = self.responses and self.responses.with_noise(rng)  # last: the draws above stay
        return replace(self, frequencies=np.abs(frequencies), shapes=shapes, responses=own)
