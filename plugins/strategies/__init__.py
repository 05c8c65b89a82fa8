"""The updating strategies that come with femubench."""

from __future__ import annotations

from femubench import hookimpl

CLASSES = {
    "unchanged": "unchanged:Unchanged",
    "textbook": "textbook:Textbook",
    "meet": "given_frequencies:Meet",
    "shifted": "given_frequencies:Shifted",
    "baruch": "baruch:Baruch",
    "berman": "berman:Berman",
    "secant": "secant:Secant",
    "kabe": "kabe:Kabe",
    "kabe-rigid": "kabe:KabeRigid",
    "physical": "physical:Physical",
    "nobari": "nobari:Nobari",
    "nobari-rigid": "nobari:NobariRigid",
    "generic-ls": "generic:GenericLS",
    "generic-adjusted": "generic:GenericAdjusted",
    "global": "factors:Global",
    "local": "factors:Local",
    "spring": "spring:Spring",
    "offset": "offset:Offset",
    "bayesian": "bayesian:Bayesian",
    "eigensensitivity": "eigensensitivity:Eigensensitivity",
    "sparse": "sparse:Sparse",
    "cross-model": "cross_model:CrossModel",
    "dynamic-residual": "dynamic_residual:DynamicResidual",
    "constitutive-error": "constitutive_error:ConstitutiveError",
    "strain-energy": "strain_energy:StrainEnergy",
    "multi-start": "multi_start:MultiStart",
    "eigenvector-difference": "eigenvector_difference:EigenvectorDifference",
    "cma-es": "cma_es:CmaEs",
    "particle-swarm": "particle_swarm:ParticleSwarm",
    "bayesian-sampling": "sampling:BayesianSampling",
    "transitional-mcmc": "transitional:TransitionalMcmc",
    "response-function": "response_function:ResponseFunction",
    "bayesian-responses": "bayesian_responses:BayesianResponses",
    "antiresonances": "antiresonances:AntiresonanceFit",
    "diagnosed": "diagnosed:Diagnosed",
}


@hookimpl
def femubench_strategies() -> dict[str, str]:
    """Return where the strategies are: without data, of both papers in their order, `diagnosed`."""
    return {name: f"{__name__}.{place}" for name, place in CLASSES.items()}
