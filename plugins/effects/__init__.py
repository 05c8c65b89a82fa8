"""The physical causes that come with femubench."""

from __future__ import annotations

from femubench import hookimpl

CLASSES = {
    "youngs-modulus": "material:YoungsModulus",
    "density": "material:Density",
    "torsion-constant": "torsion_constant:TorsionConstant",
    "shear-deformation": "shear_deformation:ShearDeformation",
    "rotary-inertia": "rotary_inertia:RotaryInertia",
    "joint-rotation": "joint_rotation:JointRotation",
    "joint-flexibility": "joint_flexibility:JointFlexibility",
    "joint-offset": "joint_offset:JointOffset",
    "joint-mass": "joint_mass:JointMass",
    "added-mass": "added_mass:AddedMass",
    "mass-offset": "mass_offset:MassOffset",
    "support-flexibility": "support_flexibility:SupportFlexibility",
    "support-position": "support_position:SupportPosition",
    "support-removed": "support_removed:SupportRemoved",
    "support-added": "support_added:SupportAdded",
    "grounding-spring": "grounding_spring:GroundingSpring",
    "member-stiffness": "material:MemberStiffness",
    "member-mass": "material:MemberMass",
    "group-mass": "material:GroupMass",
    "group-material": "material:GroupMaterial",
    "plate-thickness": "powers:PlateThickness",
    "interface-softness": "powers:InterfaceSoftness",
    "preload-force": "powers:PreloadForce",
    "wall-thickness": "wall_thickness:WallThickness",
    "local-stiffness-loss": "local_stiffness_loss:LocalStiffnessLoss",
    "axial-preload": "axial_preload:AxialPreload",
    "gravity-stiffness": "gravity_stiffness:GravityStiffness",
    "mass-eccentricity": "mass_eccentricity:MassEccentricity",
    "bending-torsion-coupling": "bending_torsion_coupling:BendingTorsionCoupling",
    "brace-spring": "brace_spring:BraceSpring",
    "interface-spring": "interface_spring:InterfaceSpring",
    "attached-oscillator": "attached_oscillator:AttachedOscillator",
    "amplitude-dependent-stiffness": "amplitude_dependent_stiffness:AmplitudeDependentStiffness",
    "temperature": "temperature:Temperature",
}


@hookimpl
def femubench_effects() -> dict[str, str]:
    """Return where the effects are, those of the whole structure first."""
    return {name: f"{__name__}.{place}" for name, place in CLASSES.items()}
