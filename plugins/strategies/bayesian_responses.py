"""The most probable parameters by frequency responses whose errors are not known beforehand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from femubench.plugins.strategies.bayesian import Bayesian
from femubench.plugins.strategies.response_function import ResponseFunction
from femubench.update import UpdateOptions

_OPTIONS = replace(ResponseFunction.options, unknown_noise=True, damping=0.0)


@dataclass(frozen=True)
class BayesianResponses(Bayesian):
    """Weigh frequency responses against prior knowledge, the size of their errors unknown.

    Parameters and priors are those of `bayesian`. Real and imaginary parts of a receptance have
    normal errors, of noise and of the model alike: their deviations are the stated ones times a
    factor that every channel has for itself and that has no prior (that of its logarithm is even).
    Parameters and factors of least cost are sought in turn, from the parameters that fit the used
    frequencies. The posterior about them is normal, its covariance the inverse of s'Ws + P less
    what the factors of the channels take of s'Ws.

    Where a model cannot follow the responses the factors are large, and priors keep their weight.
    Lines count as independent, which errors of a model are not: deviations are then too small.

    Arguments:
        stiffness_std, torsion_std, joint_std, density_std, changes: as of `Bayesian`.
        options: of the iteration.

    The authors' are the posterior with an unknown variance of the prediction errors and its normal
    approximation (Beck & Katafygiotis); Zhang & Au go by a posterior of the modes, here it is of
    the parameters at once. Ours: parameters, priors, a factor for every channel, the measured
    damping, the start.

    Source: Beck & Katafygiotis (1998), the asymptotic posterior; Zhang & Au (2016).
    """

    name: ClassVar[str] = "bayesian-responses"
    citation: ClassVar[str] = (
        "Beck & Katafygiotis (1998), Updating models and their uncertainties. I: Bayesian "
        "statistical framework, J. Eng. Mech. 124, 455-461; Zhang & Au (2016), Fundamental "
        "two-stage formulation for Bayesian system identification, Part II: Application to ambient "
        "vibration data, Mech. Syst. Signal Process. 66-67, 43-61"
    )
    needs: ClassVar[frozenset[str]] = Bayesian.needs | {"responses"}
    settings: ClassVar[tuple[str, ...]] = ("joint_std=0.25", "joint_std=1.0")

    options: UpdateOptions = _OPTIONS
