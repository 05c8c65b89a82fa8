"""Finite elements: frames and their parts, sections, beam matrices, what a model is made of."""

from femubench.core.case.matrix_files import write_matrices as write_matrices
from femubench.core.case.nodes import MatrixGeometry as MatrixGeometry, matrix_model as matrix_model
from femubench.core.case.opensees import from_opensees as from_opensees
from femubench.core.child.workers import call_apart as call_apart
from femubench.core.errors import ModelError as ModelError
from femubench.core.fem.beam import (
    BeamProperties as BeamProperties,
    coupling_matrices as coupling_matrices,
    eccentric_mass_parts as eccentric_mass_parts,
    mass_matrices as mass_matrices,
    stiffness_matrices as stiffness_matrices,
)
from femubench.core.fem.frame import (
    ACTIVE as ACTIVE,
    Brace as Brace,
    Coupling as Coupling,
    Eccentricity as Eccentricity,
    Factor as Factor,
    Frame as Frame,
    GroundSpring as GroundSpring,
    Joint as Joint,
    JointSpring as JointSpring,
    Link as Link,
    Material as Material,
    Member as Member,
    MemberSet as MemberSet,
    Oscillator as Oscillator,
    Place as Place,
    PointMass as PointMass,
    Preload as Preload,
    RigidEnd as RigidEnd,
    Support as Support,
    halves_of as halves_of,
)
from femubench.core.fem.group_factors import (
    GROUP as GROUP,
    group_matrix as group_matrix,
    group_places as group_places,
    with_group_factors as with_group_factors,
)
from femubench.core.fem.mesh import member_axes as member_axes
from femubench.core.fem.model import LowRank as LowRank
from femubench.core.fem.parameters import Property as Property
from femubench.core.fem.preload import (
    gravity_stiffness as gravity_stiffness,
    preload_forces as preload_forces,
    redundant_members as redundant_members,
    unit_preload_matrices as unit_preload_matrices,
)
from femubench.core.fem.sections import (
    Section as Section,
    bredt as bredt,
    constant_kappa as constant_kappa,
    rectangular_tube as rectangular_tube,
    round_tube as round_tube,
    solid_rectangle as solid_rectangle,
    wall_of as wall_of,
)
from femubench.core.fem.sensors import Outline as Outline
from femubench.core.fem.structure import Structure as Structure
from femubench.core.typing import (
    BoolArray as BoolArray,
    FloatArray as FloatArray,
    IntArray as IntArray,
    SparseArray as SparseArray,
)

__all__ = [name for name in dir() if not name.startswith("_")]
