"""The physical causes that come with femubench, one file each."""

from __future__ import annotations

from femubench import hookimpl
from femubench.effect import FrameEffect


@hookimpl
def femubench_effects() -> tuple[type[FrameEffect], ...]:
    """Return the effects, those of the whole structure first."""
    from femubench.plugins.effects.added_mass import AddedMass
    from femubench.plugins.effects.amplitude_dependent_stiffness import AmplitudeDependentStiffness
    from femubench.plugins.effects.attached_oscillator import AttachedOscillator
    from femubench.plugins.effects.axial_preload import AxialPreload
    from femubench.plugins.effects.bending_torsion_coupling import BendingTorsionCoupling
    from femubench.plugins.effects.brace_spring import BraceSpring
    from femubench.plugins.effects.density import Density
    from femubench.plugins.effects.grounding_spring import GroundingSpring
    from femubench.plugins.effects.joint_mass import JointMass
    from femubench.plugins.effects.joint_offset import JointOffset
    from femubench.plugins.effects.joint_rotation import JointRotation
    from femubench.plugins.effects.local_stiffness_loss import LocalStiffnessLoss
    from femubench.plugins.effects.mass_eccentricity import MassEccentricity
    from femubench.plugins.effects.member_mass import MemberMass
    from femubench.plugins.effects.member_stiffness import MemberStiffness
    from femubench.plugins.effects.rotary_inertia import RotaryInertia
    from femubench.plugins.effects.shear_deformation import ShearDeformation
    from femubench.plugins.effects.temperature import Temperature
    from femubench.plugins.effects.torsion_constant import TorsionConstant
    from femubench.plugins.effects.youngs_modulus import YoungsModulus

    return (
        YoungsModulus,
        Density,
        TorsionConstant,
        ShearDeformation,
        RotaryInertia,
        JointRotation,
        JointOffset,
        JointMass,
        AddedMass,
        GroundingSpring,
        MemberStiffness,
        MemberMass,
        LocalStiffnessLoss,
        AxialPreload,
        MassEccentricity,
        BendingTorsionCoupling,
        BraceSpring,
        AttachedOscillator,
        AmplitudeDependentStiffness,
        Temperature,
    )
