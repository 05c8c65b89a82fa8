"""What an identification gives: modes with their standard deviations, and how they came."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femubench.core.display import Shown, count_noun
from femubench.core.fem.sensors import Sensors
from femubench.core.identify.complexity import mean_phase_deviation, phase_collinearity
from femubench.core.identify.lscf import Poles
from femubench.core.modal.complex_modes import phase_loss
from femubench.core.modal.frf import FrequencyResponses
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import AnyArray, FloatArray


@dataclass(frozen=True, repr=False)
class Identification(Shown):
    """Modes that were identified from measured responses, by frequency.

    Arguments:
        sensors: where the shapes are known.
        frequencies: natural frequencies in Hz, (m,).
        frequency_std: their standard deviations in Hz, (m,).
        damping: viscous damping ratios, (m,).
        damping_std: their standard deviations, (m,).
        shapes: complex, turned to be as real as they can, the largest real part 1, (n_sensors, m).
        shape_std: standard deviations of the real parts, (n_sensors, m).
        support: share of the model orders that have the pole, (m,).
        poles: of all orders, for a stabilisation diagram.
        band: that was looked at, in Hz.
        measured: the responses in the band; None where no force was measured.
        synthesised: the same channels from the fit, in the quantity of `measured`.
        spectrum: largest singular value of the spectra in dB by frequency in Hz, where no force
            was measured, (n_f, 2).
        said: how the responses came from records over time; empty where they did not.
        modal_mass: of the shapes as they are scaled, in kg, (m,); nan where no driven point that
            moves was read too; None where there is none at all.
    """

    sensors: Sensors
    frequencies: FloatArray
    frequency_std: FloatArray
    damping: FloatArray
    damping_std: FloatArray
    shapes: AnyArray
    shape_std: FloatArray
    support: FloatArray
    poles: Poles
    band: tuple[float, float]
    measured: FrequencyResponses | None = None
    synthesised: AnyArray | None = None
    spectrum: FloatArray | None = None
    said: str = ""
    modal_mass: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.frequencies)

    def rows(self) -> list[tuple[str, str]]:
        """Return frequency, damping and collinearity of every mode."""
        low, high = self.band
        found = [("", f"{count_noun(len(self), 'mode')} from {low:.6g} to {high:.6g} Hz")]
        found += [("records", self.said)] if self.said else []
        for k in range(len(self)):
            text = f"{self.frequencies[k]:.6g} Hz, std {self.frequency_std[k]:.2g} Hz"
            text += f", damping {self.damping[k]:.3g}, MPC {self.collinearity[k]:.3f}"
            found.append((f"mode {k + 1}", text))
        return found

    @property
    def collinearity(self) -> FloatArray:
        """Return the modal phase collinearity of every mode, 1 for a real one, (m,)."""
        return phase_collinearity(self.shapes)

    @property
    def phase_deviation(self) -> FloatArray:
        """Return the mean phase deviation of every mode in degrees, 0 for a real one, (m,)."""
        return mean_phase_deviation(self.shapes)

    @property
    def located(self) -> bool:
        """Tell whether the place of every sensor is known."""
        return bool(np.isfinite(self.sensors.xyz).all())

    @property
    def measurement(self) -> Measurement:
        """Return the modes as a case has them; shapes are the real parts.

        No real mode of an undamped model is closer to a complex one than its imaginary part is
        large, so that what of this exceeds the noise counts as a deviation of every component.
        """
        own = np.square(self.shape_std)
        beyond = (np.square(self.shapes.imag) - own).mean(axis=0)
        return Measurement(
            sensors=self.sensors,
            numbers=tuple(range(1, len(self) + 1)),
            frequencies=self.frequencies,
            frequency_std=self.frequency_std,
            damping=self.damping,
            shapes=np.asarray(self.shapes.real),
            shape_std=np.sqrt(own + np.maximum(beyond, 0.0)),
            out_of_phase=phase_loss(self.shapes),
            modal_mass=self.modal_mass,
        )
