"""The posterior of the parameters by samples that start from the prior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from femubench.plugins.strategies.sampling import BayesianSampling


@dataclass(frozen=True)
class TransitionalMcmc(BayesianSampling):
    """Lead samples of the prior to the posterior, in stages that let the data count more and more.

    Parameters, priors, discrepancy and posterior are those of `bayesian-sampling`. Its chains start
    from the most probable parameters; here 2000 samples start all over the prior, so that none of
    several explanations is missed, and the weights of the stages give the evidence of these
    parameters, ``log_evidence``: its differences between lists of `changes` on the same data are
    logarithms of Bayes factors.

    Arguments:
        discrepancy_median, discrepancy_spread: as of `BayesianSampling`.

    The authors' are the stages, a coefficient of variation of 1 of the weights and the evidence
    (Ching & Chen), and the length of moves (Betz et al.); ours: parameters, priors, the
    discrepancy, how many samples and moves there are, polynomials that stand for the model.

    Source: Ching & Chen (2007), J. Eng. Mech. 133, 816-832; Betz, Papaioannou & Straub (2016), J.
    Eng. Mech. 142, 04016016.
    """

    name: ClassVar[str] = "transitional-mcmc"
    citation: ClassVar[str] = (
        "Ching & Chen (2007), Transitional Markov chain Monte Carlo method for Bayesian model "
        "updating, model class selection, and model averaging, J. Eng. Mech. 133, 816-832; "
        "Betz, Papaioannou & Straub (2016), J. Eng. Mech. 142, 04016016"
    )
    sampler: ClassVar[str] = "transitional"
