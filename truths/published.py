"""A published test whose shapes were not printed.

python -m truths.published
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from truths.posing import ROOT

# Participant C, Hz and ratios, after Balmes & Wright (1997), DETC'97.
GARTEUR_HZ = (6.376, 16.104, 33.125, 33.531, 35.647, 48.384, 49.433, 55.076, 63.039)
GARTEUR_DAMPING = (0.0130, 0.0130, 0.0083, 0.0100, 0.0110, 0.0230, 0.0046, 0.0020, 0.0200)
# Laboratories differ by 2-4 %.
GARTEUR_STD = 0.03


def write_garteur(folder: Path = ROOT / "scenarios" / "garteur") -> None:
    """Write what was measured of the test bed GARTEUR SM-AG19: frequencies, no shapes."""
    modes = pd.DataFrame({"mode": range(1, len(GARTEUR_HZ) + 1)})
    modes["frequency"] = [f"{hertz:g}" for hertz in GARTEUR_HZ]
    modes["frequency_std"] = [f"{GARTEUR_STD * hertz:.2g}" for hertz in GARTEUR_HZ]
    modes["damping"] = [f"{ratio:g}" for ratio in GARTEUR_DAMPING]
    folder.mkdir(exist_ok=True)
    modes.to_csv(folder / "modes.csv", index=False)


if __name__ == "__main__":
    write_garteur()
