"""Updating by frequencies and antiresonances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.plugins.strategies.response_function import ResponseFunction
from femubench.update import UpdateOptions

_OPTIONS = UpdateOptions(residual="frequency", weighting="statistical", antiresonances=True)


@dataclass(frozen=True)
class AntiresonanceFit(ResponseFunction):
    """Fit the used frequencies and the antiresonances of the given responses.

    Between two resonances a receptance vanishes where what all modes contribute cancels. An
    antiresonance is read as exactly as a frequency, whatever gain a sensor has and whether or not
    the sensor moves much, and has in it what shapes and modes beyond the band say. One is compared
    with that of the model at the same sensor and between the same resonances, in the same order;
    where a model has more of them there, or fewer, they are left out in this iteration.

    Arguments:
        options: of the iteration, which begins at the factors that fit the used frequencies.
        stiffness_std: prior standard deviation of the logarithm of a factor.
        changes: as of `ResponseFunction`.

    The authors' are the data, their sensitivities and the pairs between resonances (D'Ambrogio &
    Fregolent; Hanson et al., who take those of cross responses too); ours: the deviation of each,
    from a parabola about the change of sign of the real part, the model's damping by measured
    ratios, the prior, and the start.

    Source: D'Ambrogio & Fregolent (2000); Hanson, Waters, Thompson, Randall & Ford (2007).
    """

    name: ClassVar[str] = "antiresonances"
    citation: ClassVar[str] = (
        "D'Ambrogio & Fregolent (2000), The use of antiresonances for robust model updating, J. "
        "Sound Vib. 236, 227-243; Hanson, Waters, Thompson, Randall & Ford (2007), The role of "
        "anti-resonance frequencies from operational modal analysis in finite element model "
        "updating, Mech. Syst. Signal Process. 21, 74-97"
    )

    options: UpdateOptions = _OPTIONS
