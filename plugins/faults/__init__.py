"""What may be wrong with data or with what was typed in, as far as femubench knows by itself."""

from __future__ import annotations

from femubench import hookimpl

CLASSES = {
    "frequency-outlier": "frequency_outlier:FrequencyOutlier",
    "modes-swapped": "modes_swapped:ModesSwapped",
    "sensor-sign": "readings:SensorSign",
    "sensor-gain": "readings:SensorGain",
    "sensors-swapped": "readings:SensorsSwapped",
    "sigma-misstated": "sigma_misstated:SigmaMisstated",
    "unit-slip": "unit_slip:UnitSlip",
    "section-turned": "section_turned:SectionTurned",
    "support-missing": "support_missing:SupportMissing",
}


@hookimpl
def femubench_faults() -> dict[str, str]:
    """Return where the faults are, those of the data first."""
    return {name: f"{__name__}.{place}" for name, place in CLASSES.items()}
