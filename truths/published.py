"""Published tests whose shapes were not printed: frequencies of the test, shapes of the solid.

python -m truths.published
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd

from truths.posing import ROOT, SUITE

# Participant C, Hz and ratios, after Balmes & Wright (1997), DETC'97.
GARTEUR_HZ = (6.376, 16.104, 33.125, 33.531, 35.647, 48.384, 49.433, 55.076, 63.039)
GARTEUR_DAMPING = (0.0130, 0.0130, 0.0083, 0.0100, 0.0110, 0.0230, 0.0046, 0.0020, 0.0200)
# Laboratories differ by 2-4 %; one specimen, once assembled, is known better.
GARTEUR_STD = 0.01


def write_garteur(folder: Path = ROOT / "scenarios" / "garteur", suite: Path = SUITE) -> None:
    """Write the measured side of the test bed GARTEUR SM-AG19."""
    solid = pd.read_csv(suite / "garteur" / "modes.csv", dtype=str)
    modes = solid.iloc[: len(GARTEUR_HZ)].copy()
    modes["frequency"] = [f"{hertz:g}" for hertz in GARTEUR_HZ]
    modes["frequency_std"] = [f"{GARTEUR_STD * hertz:.2g}" for hertz in GARTEUR_HZ]
    modes["damping"] = [f"{ratio:g}" for ratio in GARTEUR_DAMPING]
    folder.mkdir(exist_ok=True)
    modes.to_csv(folder / "modes.csv", index=False)
    shutil.copyfile(suite / "garteur" / "sensors.csv", folder / "sensors.csv")


if __name__ == "__main__":
    write_garteur()
