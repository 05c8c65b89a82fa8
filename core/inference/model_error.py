"""What a beam model gets wrong of a real structure, as random perturbations in classes.

Measured data are the prediction plus the sensitivities to many small unknown changes z, each
standard normal times the scale tau of its class: C = I + sum_k tau_k^2 S_k S_k'. The scales are
unknown too, tau_k = w_k u_k with ln u_k normal; the data infer them for every explanation, so that
each has the same freedom to be wrong. A half-normal prior of the scales lets them collapse to zero.

Source: Kennedy & O'Hagan (2001) for the inadequacy of a model as a random function; MacKay (1992)
for scales that the evidence sets.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.linalg as la
from scipy.optimize import minimize

from femubench.core.change.terms import MatrixOperator, heaviest_translation
from femubench.core.fem.frame import ACTIVE
from femubench.core.fem.structure import Structure
from femubench.core.fit.discrepancy import Discrepancy
from femubench.core.fit.modal_basis import Space, rigid_first, scatter_terms
from femubench.core.fit.modal_fit import Problem, State, state_at
from femubench.core.fit.noise import Noise
from femubench.core.fit.zero_rows import ZeroRows
from femubench.core.inference.settings import settings
from femubench.core.modal.eigen import Modes
from femubench.core.modal.group_prior import STRUCTURE_STD, GroupPriors
from femubench.core.typing import FloatArray, IntArray


def class_widths() -> dict[str, float]:
    """Return the width w of every class, compliances in those of the member's own end."""
    return {
        "element stiffness": settings.width_element_stiffness,
        "element mass": settings.width_element_mass,
        "group stiffness": settings.width_group_stiffness,
        "joint groups": settings.width_joint_groups,
        "group mass": settings.width_group_mass,
        "stiffness of everything": settings.width_everything,
        "density of everything": settings.width_everything,
        "flexibility of joint types": settings.width_joint_types,
        "flexibility of joints": settings.width_joints,
        "mass of joints": settings.width_joint_masses,
        "general": settings.width_general,
        "sensor gains": settings.width_sensor_gains,
        "shapes": settings.width_shapes,
    }


def error_slopes(problem: Problem, modes: Modes) -> dict[str, FloatArray]:
    """Return the sensitivities of the data to unit perturbations of every class, (n_data, p_k).

    Arguments:
        problem: data in the modal coordinates of a model; one from matrices has fewer classes.
        modes: of the model, in the order of the coordinates.
    """
    nominal, structure = state_at(problem, (), np.zeros(0)), problem.model.structure
    found = {
        "stiffness of everything": _everything(nominal, 1.0, 0.0),
        "density of everything": _everything(nominal, -1.0, problem.space.mass),
        "general": general_slopes(nominal),
        "sensor gains": _gains(nominal),
        **_shapes(nominal),
    }
    shapes = rigid_first(modes).shapes
    found |= _groups(nominal, shapes)
    if structure is not None:
        rows = scatter_slopes(problem, modes)
        count = len(structure.properties)
        found["element stiffness"], found["element mass"] = rows[:, :count], rows[:, count:]
        found |= _joints(nominal, structure, shapes)
    return found


def antiresonance_errors(state: ZeroRows, modes: Modes) -> dict[str, FloatArray]:
    """Return the sensitivities of antiresonances to the same perturbations, (k, p_k).

    Shapes as they are read have no part in them, nor have gains.

    Arguments:
        state: of the nominal model.
        modes: of it, in the order of the coordinates.
    """
    near, values, space = state.vectors, state.eigenvalues, state.problem.space
    structure, shapes = state.problem.model.structure, rigid_first(modes).shapes
    nothing = np.zeros(1)
    found = {
        "stiffness of everything": state.rows(
            (space.eigenvalues[:, None] * near)[..., None], nothing
        ),
        "density of everything": state.rows((-values * near)[..., None], nothing),
        "general": general_slopes(state),
    }
    found |= _groups(state, shapes)
    if structure is not None:
        element = structure.properties
        one, other = (
            np.asarray(structure.gather @ (shapes @ side)).reshape(len(element), 12, -1)
            for side in (near, state.left)
        )
        stiff, heavy = (
            (other * (matrices @ one)).sum(axis=1).T
            for matrices in (element.stiffness_matrices(), element.mass_matrices())
        )
        found["element stiffness"] = state.scale[:, None] * stiff
        found["element mass"] = -(state.scale * values)[:, None] * heavy
        found |= _joints(state, structure, shapes)
    return found


def _joints(
    nominal: State | ZeroRows, structure: Structure, shapes: FloatArray
) -> dict[str, FloatArray]:
    """Return the slopes of masses at joints, and of the flexibility of joints and their types."""
    local = _at_joints(structure, shapes)
    stiff, heavy, types = _end_moments(structure, local)
    values = nominal.eigenvalues[nominal.partner]
    ends = stiff - values[:, None, None] * heavy  # (m, p, N)
    own = np.einsum("mpN,Nm->mp", ends, nominal.vectors[: ends.shape[2], nominal.partner])
    forces = -np.moveaxis(ends * own[:, :, None], 2, 0)
    single = nominal.rows(forces, np.zeros(len(types)))
    return {
        "mass of joints": _joint_masses(nominal, structure, local),
        "flexibility of joints": single,
        "flexibility of joint types": single @ np.eye(types.max(initial=-1) + 1)[types],
    }


def scatter_slopes(problem: Problem, modes: Modes) -> FloatArray:
    """Return d data / d relative change of every element's stiffness, then of its mass."""
    structure = problem.model.structure
    if structure is None:
        return np.zeros((len(problem.data), 0))
    space: Space = problem.space
    nominal = state_at(problem, (), np.zeros(0))
    shapes = rigid_first(modes).shapes
    # Close modes are turned to the measured ones, and their forces with them.
    turned = nominal.vectors[:, nominal.partner]
    top = int(np.flatnonzero(np.abs(turned).max(axis=1) > settings.negligible**2)[-1]) + 1
    element = structure.properties
    own = element.rhoA * (element.length - element.rigid_mass_1 - element.rigid_mass_2)
    found = np.zeros((len(problem.data), 2, len(element)))
    # Some elements at once: with those of a large model the forces would fill the memory.
    most = settings.block
    for rows in np.split(np.arange(len(element)), range(most, len(element), most)):
        forces = scatter_terms(structure, shapes, space.eigenvalues[:top], rows)
        near = np.einsum("piN,im->mNp", forces, turned[:top])
        masses = np.concatenate([np.zeros(len(rows)), own[rows]])
        slopes = nominal.rows(np.swapaxes(near, 0, 1), masses)
        found[:, :, rows] = slopes.reshape(len(slopes), 2, -1)
    return found.reshape(len(found), -1)


def _everything(nominal: State, sign: float, mass: float) -> FloatArray:
    """Return the slope of all stiffness, or of all mass, (n_data, 1)."""
    forces = np.zeros((len(nominal.vectors), len(nominal.partner), 1))
    values = nominal.eigenvalues[nominal.partner]
    forces[:, :, 0] = sign * nominal.vectors[:, nominal.partner] * values
    return nominal.rows(forces, np.array([mass]))


def _groups(nominal: State | ZeroRows, shapes: FloatArray) -> dict[str, FloatArray]:
    """Return the slopes of a relative change of every group of matrices, by how well it is known.

    Arguments:
        nominal: the model as drawn.
        shapes: of its modes, in the order of the coordinates, (n, N).
    """
    model, near = nominal.problem.model, nominal.vectors[: shapes.shape[1], nominal.partner]
    values, motion = nominal.eigenvalues[nominal.partner], heaviest_translation(model)
    sure = {n: GroupPriors(model).std(n) < 2.0 * STRUCTURE_STD for n in model.groups}
    classes = {
        "group stiffness": [part for name, part in model.groups.items() if sure[name]],
        "joint groups": [part for name, part in model.groups.items() if not sure[name]],
        "group mass": list(model.mass_groups.values()),
    }
    found = {}
    for name, parts in classes.items():
        heavy = name == "group mass"
        forces = np.zeros((len(nominal.vectors), len(values), len(parts)))
        for i, part in enumerate(parts):
            own = shapes.T @ MatrixOperator(part).apply(shapes @ near)
            forces[: len(own), :, i] = -values * own if heavy else own
        mass = [motion @ (part @ motion) if heavy else 0.0 for part in parts]
        if parts:
            found[name] = nominal.rows(forces, np.array(mass))
    return found


def general_slopes(state: State | ZeroRows) -> FloatArray:
    """Return the slopes of random symmetric changes sqrt(lambda_a lambda_b) g_ab, (n_data, p).

    Between the coordinates of the nominal model, whatever causes are in the state.
    """
    space, near = state.problem.space, state.vectors[:, state.partner]
    modes = np.arange(space.rigid, min(space.rigid + settings.general_modes, len(space)))
    one, other = (modes[index] for index in np.triu_indices(len(modes)))
    size = np.sqrt(np.maximum(space.eigenvalues[one] * space.eigenvalues[other], 0.0))
    column = np.arange(len(one))
    forces = np.zeros((len(near), len(state.partner), len(one)))
    forces[one, :, column] = size[:, None] * near[other]
    forces[other, :, column] = size[:, None] * near[one]
    return state.rows(forces, np.zeros(len(one)))


def _gains(nominal: State) -> FloatArray:
    """Return the slopes of a relative gain of every sensor, (n_data, n_sensors)."""
    data = nominal.problem.data
    mode, sensor = data.shape_rows
    count = len(data.measurement)
    found = np.zeros((len(data), len(data.weight)))
    found[count + np.arange(len(mode)), sensor] = (data.weight * data.shapes)[sensor, mode]
    return found


def _shapes(nominal: State) -> dict[str, FloatArray]:
    """Return the slopes of single readings, in deviations, by mode, (n_data, n) each."""
    data = nominal.problem.data
    mode, sensor = data.shape_rows
    row = len(data.measurement) + np.arange(len(mode))
    found = {}
    for j, number in enumerate(data.measurement.numbers):
        slopes = np.zeros((len(data), len(data.weight)))
        slopes[row[mode == j], sensor[mode == j]] = 1.0
        found[f"shapes {number}"] = slopes
    return found


def _at_joints(structure: Structure, shapes: FloatArray) -> dict[int, FloatArray]:
    """Return the displacements of the elements at joints and at ends of members, (12, N) each."""
    mesh = structure.mesh
    order = np.lexsort((mesh.stations[:, 0], mesh.member))
    last = np.flatnonzero(np.diff(mesh.member[order], append=-1))
    outer = order[np.concatenate([last, [0], last[:-1] + 1])]
    at_joints = np.flatnonzero((mesh.ends < len(structure.frame.joints)).any(axis=1))
    elements = np.union1d(outer, at_joints)
    rows = (12 * elements[:, None] + np.arange(12)).ravel()
    local = (structure.gather[rows] @ shapes).reshape(len(elements), 12, -1)
    return dict(zip(elements.tolist(), local, strict=True))


def _joint_masses(
    nominal: State | ZeroRows, structure: Structure, local: Mapping[int, FloatArray]
) -> FloatArray:
    """Return the slopes of a mass at every joint, as a share of the structure, (n_data, n).

    Arguments:
        nominal: the model as drawn.
        structure: its frame.
        local: displacements of elements, (12, N) each, of those at joints and ends at least.
    """
    mesh, frame = structure.mesh, structure.frame
    moved: dict[int, FloatArray] = {}
    for element, own in local.items():
        for node, part in zip(mesh.ends[element], (slice(0, 3), slice(6, 9)), strict=True):
            if node < len(frame.joints):
                moved.setdefault(int(node), own[part])
    mass = nominal.problem.space.mass
    values = nominal.eigenvalues[nominal.partner]
    near = nominal.vectors[:, nominal.partner]
    forces = [-mass * rows.T @ (rows @ near * values) for _, rows in sorted(moved.items())]
    return nominal.rows(np.stack(forces, axis=2), np.full(len(forces), mass))


def _end_moments(
    structure: Structure, local: Mapping[int, FloatArray]
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return the end moments of all members by all modes, scaled, and the class of each.

    A compliance c at an end lowers the energy by c M^2 / 2, to first order, M with the inertia of
    the end's own rotation. Unit compliances are L/4EI in bending and L/GJ in torsion.

    Arguments:
        structure: the frame as drawn.
        local: displacements of elements, (12, N) each, of those at joints and ends at least.

    Returns:
        elastic moments and, at unit eigenvalue, those of inertia, both times the root of the unit
        compliance, (p, N) each; joint type and direction, (p,).
    """
    frame, mesh = structure.frame, structure.mesh
    matrices = structure.properties.stiffness_matrices(), structure.properties.mass_matrices()
    kind = {joint.name: joint.family for joint in frame.joints}
    active = [d for d, word in enumerate(("rx", "ry", "rz")) if word in ACTIVE[frame.plane]]
    moments: tuple[list[FloatArray], list[FloatArray]] = [], []
    labels = []
    for number, member in enumerate(frame.members):
        own = np.flatnonzero(mesh.member == number)
        own = own[np.argsort(mesh.stations[own, 0])]
        length = float(structure.properties.length[own].sum())
        s, m = member.section, member.material
        stiff = (m.G * s.J / length, 4.0 * m.E * s.Iy / length, 4.0 * m.E * s.Iz / length)
        # Rotations among the local displacements of an element.
        ends = slice(3, 6), slice(9, 12)
        for element, rotations, joint in zip((own[0], own[-1]), ends, member.ends, strict=True):
            for d in active:
                if stiff[d] > 0.0 and np.isfinite(stiff[d]):
                    for rows, matrix in zip(moments, matrices, strict=True):
                        row = matrix[element][rotations][d] @ local[element]
                        rows.append(row / np.sqrt(stiff[d]))
                    labels.append((kind[joint], d))
    known = {label: i for i, label in enumerate(dict.fromkeys(labels))}
    types = np.array([known[label] for label in labels], dtype=np.int64)
    # In a truss no end has a moment.
    count = next(iter(local.values())).shape[1]
    elastic, inertial = (np.array(rows).reshape(len(labels), count) for rows in moments)
    return elastic, inertial, types


@dataclass(frozen=True)
class Inadequacy:
    """The classes of model error in the data, and in those of a reference where there is one.

    Both states share one model error; what they do not share is a small part of it, whose scale is
    inferred like those of the classes.

    Arguments:
        names: of the classes.
        widths: w of each.
        present: covariance of the data by unit perturbations of each, (n_classes, n, n).
        reference: likewise of the reference, (n_classes, r, r).
        cross: between reference and data, (n_classes, r, n).
        residual: of the reference at the nominal model, in deviations, (r,).
        unshared: width of the scale of what the states do not share.
        log_prior: ln of the prior probability that the structure is no beam model.
        earlier: sensitivities of the reference to each, (r, p_k).
        change: by how much an explanation moves each datum, in deviations, (n,); a share of that
            is its own error. Empty where there is none.
    """

    names: tuple[str, ...]
    widths: FloatArray
    present: FloatArray
    reference: FloatArray
    cross: FloatArray
    residual: FloatArray
    unshared: float
    log_prior: float
    earlier: tuple[FloatArray, ...]
    change: FloatArray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls,
        present: Mapping[str, FloatArray],
        reference: Mapping[str, FloatArray] | None,
        residual: FloatArray,
        widths: Mapping[str, float],
        unshared: float,
        log_prior: float,
    ) -> Inadequacy:
        """Return the model error of sensitivities, (n_data, p_k) by class."""
        before, r, n = reference or {}, len(residual), len(next(iter(present.values())))
        names = tuple(dict.fromkeys((*present, *before)))
        # Zeros where only the other state has a class.
        earlier = [
            before[name] if name in before else np.zeros((r, present[name].shape[1]))
            for name in names
        ]
        return cls(
            names,
            np.array([widths[kind(name)] for name in names]),
            np.zeros((len(names), n, n)),
            np.array([rows @ rows.T for rows in earlier]),
            np.zeros((len(names), r, n)),
            residual,
            unshared,
            log_prior,
            tuple(earlier),
        ).moved(present)

    def moved(self, slopes: Mapping[str, FloatArray]) -> Inadequacy:
        """Return the model error where the same perturbations have other sensitivities.

        Arguments:
            slopes: of the data; a class that is not there, or is another one, stays as it is.
        """
        present, cross = self.present.copy(), self.cross.copy()
        for k, (name, earlier) in enumerate(zip(self.names, self.earlier, strict=True)):
            rows = slopes.get(name)
            if rows is not None and rows.shape[1] == earlier.shape[1]:
                present[k], cross[k] = rows @ rows.T, earlier @ rows.T
        return replace(self, present=present, cross=cross)

    def add_own_error(self, nothing: State, state: State) -> Inadequacy:
        """Return the model error where part of what an explanation changes is its own error.

        An effect at a place is an idealisation, and the beams that carry it to the sensors are.

        Arguments:
            nothing: the model as drawn.
            state: the explanation.
        """
        data = state.problem.data
        moved = np.abs(nothing.raw - state.raw)
        mode, _ = data.shape_rows
        rows = len(data.measurement) + np.arange(len(mode))
        for j in np.unique(mode):
            own = rows[mode == j]
            moved[own] = np.sqrt(np.mean(np.square(moved[own])))
        return replace(self, change=moved)

    @property
    def _count(self) -> int:
        """Return the number of scales in addition to that of an explanation's own error."""
        return len(self.names) + (len(self.residual) > 0)

    def _variances(self, v: FloatArray) -> tuple[FloatArray, float]:
        """Return tau^2 of the classes, and the unshared share, of standard normal v."""
        u, last = _scale(v), len(self.names)
        tau = np.square(self.widths * u[:last])
        if not len(self.residual):
            return tau, 0.0
        return tau, (self.unshared * u[last] / settings.error_scale_median) ** 2

    def _own(self, v: FloatArray) -> FloatArray:
        """Return the variances of an explanation's own error, (r + n,)."""
        found = np.zeros(len(self.residual) + self.present.shape[1])
        if len(self.change):
            found[len(self.residual) :] = np.square(self.own_share(v) * self.change)
        return found

    @cached_property
    def _blocks(self) -> tuple[FloatArray, FloatArray]:
        """Return the covariances by class of reference and data as one, and within each state."""
        r, n = len(self.residual), self.present.shape[1]
        if not r:
            return self.present.reshape(len(self.names), -1), np.zeros((0, n * n))
        joint = np.zeros((len(self.names), r + n, r + n))
        joint[:, :r, :r], joint[:, r:, r:] = self.reference, self.present
        apart = joint.copy()
        joint[:, :r, r:], joint[:, r:, :r] = self.cross, np.swapaxes(self.cross, 1, 2)
        flat = joint.shape[1] ** 2
        return joint.reshape(-1, flat), apart.reshape(-1, flat)

    def covariance(self, v: FloatArray) -> FloatArray:
        """Return the covariance of reference and data, (r + n, r + n)."""
        joint, apart = self._blocks
        size = len(self.residual) + self.present.shape[1]
        tau, unshared = self._variances(v)
        total = tau @ joint + (unshared * tau @ apart if len(apart) else 0.0)
        return np.asarray(np.diag(1.0 + self._own(v)) + total.reshape(size, size))

    def _slopes(self, v: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the sum of the covariance's derivatives by v, entry by entry times a weight."""
        joint, apart = self._blocks
        tau, unshared = self._variances(v)
        both = joint @ weight.ravel()
        within = apart @ weight.ravel() if len(apart) else 0.0
        found = tau * (both + unshared * within)
        if len(apart):
            found = np.append(found, unshared * float(tau @ within))
        if len(self.change):
            found = np.append(found, float(self._own(v) @ weight.diagonal()))
        return np.asarray(2.0 * settings.error_scale_spread * found)

    def fit(self, state: State, near: Fitted | None = None) -> Fitted:
        """Return the most probable scales where the causes of a state may still move.

        Arguments:
            state: any explanation, linear in its causes nearby.
            near: scales of a similar one, from where a few steps do, and about which there is as
                much room.
        """
        first = np.zeros(self._count + (len(self.change) > 0))
        if near is not None:
            first[: self._count] = near.v[: self._count]
        return self._fitted(*self._linear(state), first, near)

    def before(self) -> Fitted:
        """Return the scales that the reference alone asks for, whatever the present data say."""
        r, n = len(self.residual), self.present.shape[1]
        unknown = np.diag(np.concatenate([np.zeros(r), np.full(n, settings.unknown_variance)]))
        y = np.concatenate([self.residual, np.zeros(n)])
        return self._fitted(y, unknown, np.zeros(self._count), None)

    def _fitted(
        self, y: FloatArray, free: FloatArray, first: FloatArray, near: Fitted | None
    ) -> Fitted:
        """Return the most probable scales of data with a covariance of their own as well."""

        def cost(v: FloatArray) -> tuple[float, FloatArray]:
            inverse, log_det = _inverse(self.covariance(v) + free)
            alpha = inverse @ y
            value = 0.5 * float(alpha @ y + log_det + v @ v)
            return value, v + 0.5 * self._slopes(v, inverse - np.outer(alpha, alpha))

        ends = np.log(settings.error_scale_range) - np.log(settings.error_scale_median)
        low, high = ends / settings.error_scale_spread
        many, few = settings.scale_steps
        found = minimize(
            cost,
            first,
            jac=True,
            method="L-BFGS-B",
            bounds=[(low, high)] * len(first),
            options={"maxiter": many if near is None else few, "ftol": settings.scale_settled},
        )
        v = np.asarray(found.x)
        inverse, _ = _inverse(self.covariance(v) + free)
        if near is not None:
            own = 2.0 * settings.error_scale_spread * self._own(v)
            known = 0.5 * float(own @ np.square(inverse) @ own)
            return Fitted(v, near.log_volume - 0.5 * float(np.log1p(known)))
        fisher = np.eye(len(v)) + self._fisher(v, inverse)
        return Fitted(v, -0.5 * float(np.linalg.slogdet(fisher)[1]))

    def _fisher(self, v: FloatArray, inverse: FloatArray) -> FloatArray:
        """Return what the data say of the scales, 1/2 tr C^-1 C_k C^-1 C_l, (k, k)."""
        joint, apart = self._blocks
        tau, unshared = self._variances(v)
        turned = np.empty((len(joint) + (len(apart) > 0), *inverse.shape))
        # One class after the other: all of them are as large as all the rest.
        for k, own in enumerate(joint):
            slope = own + unshared * apart[k] if len(apart) else own
            turned[k] = inverse @ (tau[k] * slope).reshape(inverse.shape)
        if len(apart):
            turned[-1] = inverse @ (unshared * tau @ apart).reshape(inverse.shape)
        flat = turned.reshape(len(turned), -1)
        found = np.array([flat @ own.T.ravel() for own in turned])
        return 0.5 * (2.0 * settings.error_scale_spread) ** 2 * found

    def log_density(self, state: State, v: FloatArray) -> float:
        """Return ln of the density of all data, linear in the causes, and of scales."""
        y, free = self._linear(state)
        inverse, log_det = _inverse(self.covariance(v) + free)
        return -0.5 * float(y @ inverse @ y + log_det + v @ v)

    def _linear(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return reference and data with the causes at zero, and the covariance by the causes."""
        r = len(self.residual)
        y = np.concatenate([self.residual, state.raw + state.slopes @ state.x])
        free = np.zeros((len(y), len(y)))
        free[r:, r:] = state.slopes @ state.slopes.T
        return y, free

    def own_share(self, v: FloatArray) -> float:
        """Return which share of what an explanation changes is its own error."""
        return float(settings.own_error_of_change * _scale(v[-1])) if len(v) > self._count else 0.0

    def unshared_share(self, v: FloatArray) -> float:
        """Return which share of the model error the two states do not have in common."""
        return float(np.sqrt(self._variances(v)[1]))

    def scales(self, v: FloatArray) -> list[tuple[str, float, str]]:
        """Return name, standard deviation and unit of every class, at definite scales."""
        tau, _ = self._variances(v)
        rows = zip(self.names, np.sqrt(tau), strict=True)
        found = [(n, float(s), "deviations" if kind(n) == "shapes" else "") for n, s in rows]
        if len(self.residual):
            found.append(("unshared", self.unshared_share(v), ""))
        if len(v) > self._count:
            found.append(("change by the causes", self.own_share(v), ""))
        return found

    def foreseen(
        self,
        scales: FloatArray,
        slopes: Mapping[str, FloatArray],
        raw: FloatArray,
        unseen: IntArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean and deviation of residuals of unseen data, given those of all others.

        In standard deviations of their measurement, which is no part of the deviation.

        Arguments:
            scales: of an explanation.
            slopes: sensitivities of all data to each class, (N, p_k).
            raw: residuals of all data under the explanation, (N,).
            unseen: rows, (u,).
        """
        tau, _ = self._variances(scales)
        total = np.zeros((len(raw), len(raw)))
        for name, variance in zip(self.names, tau, strict=True):
            if name in slopes:
                total += variance * slopes[name] @ slopes[name].T
        known = np.setdiff1d(np.arange(len(raw)), unseen)
        inverse, _ = _inverse(np.eye(len(known)) + total[np.ix_(known, known)])
        weight = total[np.ix_(unseen, known)] @ inverse
        rest = total[unseen, unseen] - np.einsum("uk,uk->u", weight, total[np.ix_(unseen, known)])
        return weight @ raw[known], np.sqrt(np.maximum(rest, 0.0))

    def noise(self, found: Fitted) -> Noise:
        """Return the noise of the data at definite scales, given the reference."""
        total = self.covariance(found.v)
        weight = found.log_volume - 0.5 * float(found.v @ found.v) + self.log_prior
        noise = condition_noise(total, self.residual, weight, beam=False)
        # Source: Grünwald (2012), the safe Bayesian; Miller & Dunson (2019), coarsened posteriors.
        return replace(noise, scales=found.v, trust=settings.trust_in_model_error)


def _scale(v: FloatArray) -> FloatArray:
    """Return the scale u of standard normal v, log-normal."""
    return Discrepancy(settings.error_scale_median, settings.error_scale_spread).std(v)


def condition_noise(total: FloatArray, known: FloatArray, weight: float, *, beam: bool) -> Noise:
    """Return the noise of data whose reference is known.

    Arguments:
        total: covariance of reference and data, (r + n, r + n).
        known: residuals of the reference, (r,).
        weight: ln of the probability of this covariance.
        beam: as in `Noise`.
    """
    r = len(known)
    if r == 0:
        return Noise(np.asarray(la.cholesky(total, lower=True)), 0.0, weight, beam)
    first = np.asarray(la.cholesky(total[:r, :r], lower=True))
    both = np.column_stack([total[:r, r:], known])
    turned = np.asarray(la.solve_triangular(first, both, lower=True))
    weight -= 0.5 * float(turned[:, -1] @ turned[:, -1]) + float(np.log(first.diagonal()).sum())
    rest = total[r:, r:] - turned[:, :-1].T @ turned[:, :-1]
    factor = np.asarray(la.cholesky(rest, lower=True))
    return Noise(factor, turned[:, :-1].T @ turned[:, -1], weight, beam)


@dataclass(frozen=True)
class Fitted:
    """Scales that were inferred.

    Arguments:
        v: standard normal logarithms, (k,).
        log_volume: ln of the volume about them, where the prior's is 1.
    """

    v: FloatArray
    log_volume: float


def _inverse(matrix: FloatArray) -> tuple[FloatArray, float]:
    """Return the inverse of a positive definite matrix and ln of its determinant."""
    factor = la.cholesky(matrix, lower=True, check_finite=False)
    inverse, _ = la.lapack.dpotri(factor, lower=1)
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    return np.asarray(inverse), 2.0 * float(np.log(factor.diagonal()).sum())


def kind(name: str) -> str:
    """Return the class that a scale belongs to: that of a mode's shape to all shapes."""
    return "shapes" if name.startswith("shapes") else name
