"""The ladder as matrices: nominal model, stand-ins for the measured shapes, patterns of change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import scipy.linalg as la

import femubench.scenarios
from femubench import Model, Sensors, read_case, solve_modes
from femubench.fem import FloatArray, Frame, Section, Structure
from femubench.modal import rigid_modes_of
from femubench.scenarios.generate import ladder_sensors
from femubench.scenarios.structures import HALF_SIDE, RUNG, ladder_truth
from femubench.update import ElementFamily

FRAME = Path(femubench.scenarios.__file__).parent / "frame"
BREDT = 2.9033e-8  # m4
FAMILIES = {
    "physical": ElementFamily.physical,
    "nobari": ElementFamily.nobari,
    "generic-ls": ElementFamily.generic,
    "generic-adjusted": lambda structure: ElementFamily.generic(structure, tied=True),
}


@dataclass(frozen=True, eq=False)
class Setting:
    """Nominal matrices and data: n dofs, s sensors, m modes; `turning` marks rotations."""

    model: Model
    mass: FloatArray
    stiffness: FloatArray
    turning: FloatArray
    length: float
    rigid: FloatArray
    sensors: FloatArray
    measured: FloatArray
    frequencies: FloatArray
    everywhere: FloatArray

    @property
    def structure(self) -> Structure:
        """Return the meshed nominal frame."""
        return self.model.frame_structure


def _layout(name: str) -> Sensors:
    if name == "midpoints":
        return ladder_sensors()
    corners = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]
    inner = {
        "quarters": [(0.25, 0), (1.25, 0), (0.25, 1), (1.25, 1), (0, 0.25), (1, 0.25), (2, 0.25)],
        "rungs": [(0.5, 0), (1.5, 0), (0.5, 1), (0, 0.25), (0, 0.75), (1, 0.5), (2, 0.5)],
    }[name]
    xyz = np.array([(HALF_SIDE * x, RUNG * y, 0.0) for x, y in corners + inner])
    return Sensors(tuple(f"{i}Z" for i in range(1, 14)), xyz, ("z",) * 13)


@lru_cache(maxsize=32)
def setting(
    data: str, layout: str, bredt: bool, accelerometer: bool, backward: str = ""
) -> Setting:
    """Return the nominal model and the first three modes that stand for the measured ones."""
    case = read_case(FRAME, "frame", ())
    frame: Frame = case.model.frame_structure.frame
    if bredt:
        tubes = [replace(m, section=replace(m.section, J=BREDT)) for m in frame.members]
        frame = replace(frame, members=tuple(tubes))
    if backward:
        frame = numbered(frame, backward.split("+"))
    model = Model.of(frame if accelerometer else replace(frame, masses=()))
    used, dofs = case.used_measurement(0), model.dofs
    tested = ladder_truth(Section.rectangular_tube(0.0254, 0.0254, 0.00238))
    truth = Model.of(tested).attach(frame.masses if accelerometer else (), ())
    true = solve_modes(truth).elastic.shapes[:, :3]
    labels = tuple(str(i) for i in range(len(dofs)))
    places = Sensors(labels, dofs.xyz, dofs.direction)
    sensors = used.sensors if data == "twin" else _layout(layout)
    return Setting(
        model,
        np.asarray(model.mass.toarray()),
        np.asarray(model.stiffness.toarray()),
        np.array([direction.startswith("r") for direction in dofs.direction]),
        float(model.frame_structure.properties.length.mean()),
        rigid_modes_of(model),
        np.asarray(model.observe(sensors).toarray()),
        used.shapes if data == "twin" else np.asarray(truth.observe(sensors) @ true),
        used.frequencies,
        np.asarray(truth.observe(places) @ true),
    )


def _entries(nominal: Setting) -> FloatArray:
    """Return a basis of changes of the non-zeros that leave rigid-body modes free."""
    k = nominal.stiffness
    i, j = np.nonzero(np.triu(np.abs(k) > 1e-9 * np.abs(k).max()))
    root = np.sqrt(np.diagonal(k))
    patterns = np.zeros((len(i), *k.shape))
    every = np.arange(len(i))
    patterns[every, i, j] = patterns[every, j, i] = root[i] * root[j]
    forces = np.einsum("jab,bm->jam", patterns, nominal.rigid) / root[:, None]
    free = la.null_space(forces.reshape(len(i), -1).T, rcond=1e-10)
    return np.asarray(np.einsum("jk,jab->kab", free, patterns))


def numbered(frame: Frame, backward: Sequence[str]) -> Frame:
    """Return the frame with these members numbered from their other end."""
    turned = [replace(m, ends=m.ends[::-1]) if m.name in backward else m for m in frame.members]
    return replace(frame, members=tuple(turned))


def _sides(structure: Structure) -> FloatArray:
    """Return -1 for elements whose joint goes on to their left only, +1 for others, (n,)."""
    frame, sides = structure.frame, np.ones(len(structure.properties))
    place = {joint.name: np.array(joint.xyz) for joint in frame.joints}
    for joint, at in place.items():
        along = {
            m.name: place[m.ends[m.ends[0] == joint]] - at for m in frame.members if joint in m.ends
        }
        units = {name: d / np.linalg.norm(d) for name, d in along.items()}
        for name, d in units.items():
            left = np.cross(d, sum(units.values()))[2]
            sides[structure.element_ends[f"{name}@{joint}"][0]] = -1.0 if left > 1e-9 else 1.0
    return sides


def shared(family: ElementFamily, structure: Structure, sharing: str) -> ElementFamily:
    """Return a tied generic family whose elements share their core in another way."""
    assert family.cores is not None
    signs = np.sign(family.cores.sum(axis=(2, 3)))
    if sharing == "mirrored":
        twist = np.abs(family.cores[..., :2, 2]).sum(axis=2) > 0.0  # k13, k23
        signs = np.where(twist, _sides(structure)[family.elements][:, None], 1.0)
    return replace(
        family,
        patterns=family.patterns * signs[..., None, None],
        cores=family.cores * signs[..., None, None],
    )


@lru_cache(maxsize=32)
def patterns(
    name: str, tied: str, only: str, nominal: Setting, sharing: str = "turned"
) -> FloatArray:
    """Return the change of K for a unit of every unknown, (n_unknowns, n, n)."""
    if name == "kabe-rigid":
        return _entries(nominal)
    family: ElementFamily = FAMILIES[name](nominal.structure)
    if sharing != "turned" and name == "generic-adjusted":
        family = shared(family, nominal.structure, sharing)
    plan = nominal.structure.plan
    unit = np.eye(len(family))
    each = np.array([plan.assemble(family.change(x)).toarray() for x in unit])
    owner, kinds = np.zeros(len(family), dtype=int), [""] * len(nominal.structure.properties)
    for row, e in enumerate(family.elements):
        owner[family.columns[row][family.columns[row] >= 0]] = e
    for kind, ends in nominal.structure.joint_ends.items():
        for end in ends:
            kinds[nominal.structure.element_ends[end][0]] = kind
    label = {
        "no": list(family.names),
        "kind": [f"{n.split()[0]} {kinds[e]}" for n, e in zip(family.names, owner, strict=True)],
        "element": [str(e) for e in owner],
    }[tied]
    kept = [i for i, n in enumerate(family.names) if n.startswith(tuple(only.split("|")))]
    groups: Mapping[str, list[int]] = {label[i]: [] for i in kept}
    for i in kept:
        groups[label[i]].append(i)
    return np.array([each[members].sum(axis=0) for members in groups.values()])
