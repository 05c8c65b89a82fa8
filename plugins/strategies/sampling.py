"""The posterior of the parameters by sampling, with what no model of the kind can follow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from femubench import InputError, Measurement, Model, UpdateResult
from femubench.plugins.strategies.bayesian import Bayesian
from femubench.update import sample_posterior


@dataclass(frozen=True)
class BayesianSampling(Bayesian):
    """Weigh measured modes against prior knowledge, knowing that the model itself is off.

    Parameters and priors are those of `bayesian`. The misfit of a frequency is a measurement error
    of known standard deviation and a discrepancy of the model, whose relative standard deviation is
    one more unknown. Its prior is log-normal: beam models of frames that were updated as well as
    they can be are typically a few percent off, and rarely better than 0.5 % or worse than 8 %.

    Arguments:
        discrepancy_median: prior median of the model's own relative standard deviation.
        discrepancy_spread: prior standard deviation of its logarithm; ln 2 is a factor of two.

    Source: Kennedy & O'Hagan (2001), J. R. Stat. Soc. B 63, 425-464; Simoen, De Roeck & Lombaert
    (2015), Mech. Syst. Signal Process. 56-57, 123-149; Goodman & Weare (2010), Commun. Appl. Math.
    Comput. Sci. 5, 65-80.
    """

    name: ClassVar[str] = "bayesian-sampling"
    citation: ClassVar[str] = (
        "Kennedy & O'Hagan (2001), Bayesian calibration of computer models; Simoen, De Roeck & "
        "Lombaert (2015), Dealing with uncertainty in model updating for damage assessment: a "
        "review; sampled after Goodman & Weare (2010) by emcee, Foreman-Mackey et al. (2013)"
    )

    settings: ClassVar[tuple[str, ...]] = tuple(s for s in Bayesian.settings if "shapes" not in s)

    sampler: ClassVar[str] = "ensemble"

    discrepancy_median: float = 0.02
    discrepancy_spread: float = 0.69

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model at the posterior mean, with samples and the discrepancy.

        Raises:
            InputError: for shapes or responses as data, of which the likelihood knows none.
            StrategyFailure: when the chain has not converged, with the figure that says so.
        """
        for key in ("shapes", "responses", "antiresonances"):
            if getattr(self.options, key):
                what = "the likelihood is of frequencies alone"
                raise InputError(what, key=key, expected="false")
        return sample_posterior(
            *self.pose(model, measurement),
            measurement,
            rng,
            discrepancy=(self.discrepancy_median, self.discrepancy_spread),
            options=self.options,
            sampler=self.sampler,
        )
