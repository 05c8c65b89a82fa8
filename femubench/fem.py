"""Finite elements: frames and their parts, sections, beam matrices, what a model is made of."""

from femubench.core.case.case import Modification
from femubench.core.case.matrix_files import write_matrices
from femubench.core.case.nodes import MatrixGeometry, matrix_model
from femubench.core.case.opensees import from_opensees
from femubench.core.child.workers import call_apart
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
    Link,
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
from femubench.core.fem.parameters import Property
from femubench.core.fem.preload import (
    gravity_stiffness,
    preload_forces,
    preload_stiffness,
    redundant_members,
    unit_preload_matrices,
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
from femubench.core.fem.sensors import Outline
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
    "Link",
    "LowRank",
    "Material",
    "MatrixGeometry",
    "Member",
    "MemberSet",
    "ModelError",
    "Modification",
    "Oscillator",
    "Outline",
    "Property",
    "Place",
    "PointMass",
    "Preload",
    "RigidEnd",
    "Section",
    "SparseArray",
    "Structure",
    "Support",
    "bredt",
    "call_apart",
    "constant_kappa",
    "coupling_matrices",
    "eccentric_mass_parts",
    "from_opensees",
    "gravity_stiffness",
    "group_matrix",
    "group_places",
    "mass_matrices",
    "matrix_model",
    "member_axes",
    "preload_forces",
    "preload_stiffness",
    "rectangular_tube",
    "redundant_members",
    "round_tube",
    "solid_rectangle",
    "stiffness_matrices",
    "unit_preload_matrices",
    "wall_of",
    "write_matrices",
    "with_group_factors",
]
