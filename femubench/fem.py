"""Finite elements: frames and their parts, sections, beam matrices, what a model is made of."""

from typing import TYPE_CHECKING

from femubench.core.plugin.door import open_door

if TYPE_CHECKING:
    from femubench.core.case.matrix_files import write_matrices as write_matrices
    from femubench.core.case.nodes import (
        MatrixGeometry as MatrixGeometry,
        matrix_model as matrix_model,
    )
    from femubench.core.case.opensees import from_opensees as from_opensees
    from femubench.core.child.workers import call_apart as call_apart
    from femubench.core.errors import ModelError as ModelError
    from femubench.core.fem.beam import BeamProperties as BeamProperties
    from femubench.core.fem.damping import Damping as Damping
    from femubench.core.fem.frame import (
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
    )
    from femubench.core.fem.group_factors import Groups as Groups
    from femubench.core.fem.model import LowRank as LowRank
    from femubench.core.fem.parameters import Property as Property
    from femubench.core.fem.preload import GeometricStiffness as GeometricStiffness
    from femubench.core.fem.sections import Section as Section
    from femubench.core.fem.sensors import Outline as Outline
    from femubench.core.fem.structure import Structure as Structure
    from femubench.core.typing import (
        FloatArray as FloatArray,
        IntArray as IntArray,
        SparseArray as SparseArray,
    )
else:
    __all__, __getattr__, __dir__ = open_door(__name__, __file__)
