"""The two test structures as beam models: nominal geometry, and truths that no update can reach."""

from __future__ import annotations

from dataclasses import replace

from femubench.fem import Frame, Joint, JointSpring, Material, Member, Section

HALF_SIDE = 0.2921  # m, centre line
RUNG = 0.2794  # m, centre line
# Joint springs of the beam truth in N m/rad: bending and torsion of each kind of member end.
L_BENDING, L_TORSION = 1.6945e5, 5.5449e5
T_SIDE_BENDING, T_SIDE_TORSION = 4.5650e5, 2.1436e4
T_RUNG_BENDING, T_RUNG_TORSION = 8.2428e4, 1.1021e6
YOUNG, SHEAR_FLEXIBILITY = 71.0324e9, 2.1461  # Pa; times that of kappa = 0.436


def ladder_joints(stretch: float = 1.0) -> tuple[Joint, ...]:
    """Return the six joints, named after their coordinates.

    Arguments:
        stretch: factor on the half side between coordinates 5 and 7.
    """
    left = HALF_SIDE * (1.0 - stretch)
    middle, right = HALF_SIDE, 2.0 * HALF_SIDE
    return (
        Joint("J1", (right, RUNG, 0.0), "L"),
        Joint("J3", (right, 0.0, 0.0), "L"),
        Joint("J5", (middle, 0.0, 0.0), "T"),
        Joint("J7", (left, 0.0, 0.0), "L"),
        Joint("J9", (0.0, RUNG, 0.0), "L"),
        Joint("J11", (middle, RUNG, 0.0), "T"),
    )


LADDER_MEMBERS = {
    "rung-right": ("J1", "J3"),
    "front-right": ("J3", "J5"),
    "front-left": ("J5", "J7"),
    "rung-left": ("J7", "J9"),
    "back-left": ("J9", "J11"),
    "back-right": ("J11", "J1"),
    "rung-middle": ("J5", "J11"),
}


def ladder_truth(tube: Section, stretch: float = 1.0, soft_joint: float = 1.0) -> Frame:
    """Return the beam truth of the ladder: shear, rotary inertia, flexible joints, a finer mesh.

    It meets the five published frequencies to 0.01 %; plausible, not unique (eight unknowns, five
    data). Its mass matrix is that of the Timoshenko element, which the nominal models do not use.

    Arguments:
        tube: the section with its St Venant torsion constant.
        stretch: factor on one half side.
        soft_joint: factor on the springs at joint 3.
    """
    section = replace(tube, kappa=_weak_shear)
    material = Material(E=YOUNG, nu=0.33, rho=2700.0)
    members = tuple(
        Member(name, ends, 12, section, material) for name, ends in LADDER_MEMBERS.items()
    )
    joints = ladder_joints(stretch)
    springs = []
    for joint in joints:
        for name, ends in LADDER_MEMBERS.items():
            if joint.name in ends:
                rx, ry = _end_springs(joint.type, name)
                soft = soft_joint if joint.name == "J3" else 1.0
                springs.append(JointSpring(joint.name, name, {"rx": soft * rx, "ry": soft * ry}))
    return Frame(
        plane="out-of-plane",
        beam="timoshenko",
        joints=joints,
        members=members,
        joint_springs=tuple(springs),
    )


def _weak_shear(nu: float) -> tuple[float, float]:
    return 0.436 / SHEAR_FLEXIBILITY, 0.436 / SHEAR_FLEXIBILITY


def _end_springs(joint_type: str, member: str) -> tuple[float, float]:
    if joint_type == "L":
        return L_TORSION, L_BENDING
    if member.startswith("rung"):
        return T_RUNG_TORSION, T_RUNG_BENDING
    return T_SIDE_TORSION, T_SIDE_BENDING
