"""Finite elements: frames and their parts, sections, beam matrices, what a model is made of."""

from femubench.core.case.case import Modification
from femubench.core.errors import ModelError
from femubench.core.fem.beam import (
    BeamProperties,
    coupling_matrices,
    eccentric_mass_parts,
    mass_matrices,
    stiffness_matrices,
)
from femubench.core.fem.frame import (
    ACTIVE,
    Brace,
    Coupling,
    Eccentricity,
    Factor,
    Frame,
    GroundSpring,
    Joint,
    JointSpring,
    Material,
    Member,
    MemberSet,
    Oscillator,
    Place,
    PointMass,
    Preload,
    RigidEnd,
    Support,
)
from femubench.core.fem.group_factors import (
    GROUP,
    group_matrix,
    group_places,
    with_group_factors,
)
from femubench.core.fem.mesh import member_axes
from femubench.core.fem.model import LowRank
from femubench.core.fem.parameters import Parameter
from femubench.core.fem.preload import (
    gravity_stiffness,
    preload_stiffness,
    preload_stiffnesses,
    redundant_members,
)
from femubench.core.fem.sections import (
    Section,
    bredt,
    constant_kappa,
    rectangular_tube,
    round_tube,
    solid_rectangle,
    wall_of,
)
from femubench.core.fem.structure import Structure
from femubench.core.typing import BoolArray, FloatArray, IntArray, SparseArray

__all__ = [
    "ACTIVE",
    "BeamProperties",
    "BoolArray",
    "Brace",
    "Coupling",
    "Eccentricity",
    "Factor",
    "FloatArray",
    "Frame",
    "GROUP",
    "GroundSpring",
    "IntArray",
    "Joint",
    "JointSpring",
    "LowRank",
    "Material",
    "Member",
    "MemberSet",
    "ModelError",
    "Modification",
    "Oscillator",
    "Parameter",
    "Place",
    "PointMass",
    "Preload",
    "RigidEnd",
    "Section",
    "SparseArray",
    "Structure",
    "Support",
    "bredt",
    "constant_kappa",
    "coupling_matrices",
    "eccentric_mass_parts",
    "gravity_stiffness",
    "group_matrix",
    "group_places",
    "mass_matrices",
    "member_axes",
    "preload_stiffness",
    "preload_stiffnesses",
    "rectangular_tube",
    "redundant_members",
    "round_tube",
    "solid_rectangle",
    "stiffness_matrices",
    "wall_of",
    "with_group_factors",
]
