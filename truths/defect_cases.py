"""Draw defects over the structures, solve them next to the healthy solids, write their folders."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from femubench.core.challenge.truth_file import KnownCase, TrueCause
from truths.defects import ATTACHED, KINDS, OUTSIDE, Defect, local
from truths.eigenmodes import attach, statics
from truths.elasticity import Matrices, basis_of
from truths.measurement import mac, modes_csv, paired, record, scaled
from truths.modes_of import Observed, assembled, mesh_of, modes_of
from truths.posing import DEFECTS
from truths.prestress import with_misfit
from truths.seats import rigid_fit
from truths.solid import Solid
from truths.structure import AFTER, Place, Structure
from truths.suite import mesh_differences, structures, write_files
from truths.truth_text import rounded, truth_text

Array = npt.NDArray[np.float64]
SEED = 26_000
SINGLES, PAIRS, CLEAN, OUTSIDE_KINDS = 104, 15, 20, 20
LARGEST_MESH = 30_000  # nodes; larger solids carry no defects
ALL = {**KINDS, **OUTSIDE}
CLOSENESS = 2.0  # weight of frequencies where a defect's modes are paired with healthy ones
NEW_MODE = 0.5  # MAC below which no healthy mode is the partner
TRIES = 40  # draws of a place and a size before a kind passes to another structure


@dataclass(frozen=True)
class Draw:
    """Hold what one case hides."""

    name: str
    kind: str
    structure: str
    seed: int
    defects: tuple[Defect, ...]


@dataclass(frozen=True)
class Healthy:
    """Hold a structure's coarse solid, its matrices and modes."""

    structure: Structure
    solid: Solid
    matrices: Matrices
    modes: Observed


@lru_cache(maxsize=2)
def healthy(name: str) -> Healthy:
    """Return the healthy solid of a structure, on the coarse mesh."""
    structure = structures()[name]
    solid = mesh_of(structure, structure.size[0])
    matrices = assembled(structure, solid)
    count = structure.used + structure.held_out
    return Healthy(structure, solid, matrices, modes_of(structure, matrices, count))


def draws() -> list[Draw]:
    """Return all cases, the same ones each time: kinds in turn, the least used structure first."""
    solids = {}
    for name, structure in structures().items():
        if AFTER in structure.classes:
            continue
        solid = mesh_of(structure, structure.size[0])
        if basis_of(solid, solid.points).N < LARGEST_MESH:
            solids[name] = (structure, solid)
    able = {
        kind: [n for n, (s, m) in solids.items() if _make(s, m, kind, np.random.default_rng(0))]
        for kind in ALL
    }
    found: list[Draw] = []
    used: Counter[tuple[str, str]] = Counter()
    load: Counter[str] = Counter()

    def draw(label: str, kinds: Iterable[str], number: int) -> None:
        wanted = [kind for kind in kinds if able[kind]]
        for i in range(number):
            seed = SEED + len(found)
            rng = np.random.default_rng(seed)
            kind = wanted[i % len(wanted)]
            name = min(able[kind], key=lambda n: (used[kind, n], load[n], rng.random()))
            hidden = _draw_defects(*solids[name], kind, label == "pair", rng)
            used[kind, name] += 1
            load[name] += 1
            words = "-".join((name, *(d.kind for d in hidden)))
            count = 1 + sum(other.name.startswith(f"{words}-") for other in found)
            found.append(Draw(f"{words}-{count}", label, name, seed, hidden))

    draw("defect", KINDS, SINGLES)
    draw("pair", (kind for kind in KINDS if kind != "unfit-member"), PAIRS)
    draw("outside", OUTSIDE, OUTSIDE_KINDS)
    for i in range(CLEAN):
        name = sorted(solids)[i % len(solids)]
        number = i // len(solids) + 1
        found.append(Draw(f"{name}-clean-{number}", "clean", name, SEED + len(found), ()))
    return found


def _make(structure: Structure, solid: Solid, kind: str, rng: np.random.Generator) -> Defect | None:
    for _ in range(TRIES):
        defect = ALL[kind](structure, solid, rng)
        if defect is not None:
            return defect
    return None


def _draw_defects(
    structure: Structure, solid: Solid, kind: str, pair: bool, rng: np.random.Generator
) -> tuple[Defect, ...]:
    """Return a defect of a kind, for a pair with another that only hangs something on.

    Raises:
        ValueError: where no place can be found.
    """
    first = _make(structure, solid, kind, rng)
    if first is None:
        raise ValueError(f"{structure.name} has no place for {kind}")
    if not pair:
        return (first,)
    for _ in range(TRIES):
        second = _make(structure, solid, str(rng.choice(ATTACHED)), rng)
        if second is not None and second.kind != kind and second.place != first.place:
            return first, second
    raise ValueError(f"{structure.name} has no second place next to {kind}")


def damaged(base: Healthy, defects: tuple[Defect, ...]) -> tuple[Observed, list[TrueCause], float]:
    """Return the modes of a structure with defects, the causes as stated, and its mass in kg."""
    structure, solid, matrices = base.structure, base.solid, base.matrices
    for defect in defects:
        structure, solid = defect.edit(structure, solid)
    if solid is not base.solid:
        matrices = assembled(structure, solid)
    causes = []
    for defect in defects:
        size = defect.size
        if defect.preload is not None:
            matrices, size = preloaded(structure, solid, matrices, *defect.preload)
        if defect.turns is not None:
            size = turning_stiffness(base, matrices, *defect.turns)
        unit = "N m/rad" if defect.turns else defect.unit
        causes.append(TrueCause(defect.what, defect.effect, defect.place, defect.also, size, unit))
    count = structure.used + structure.held_out
    mass = matrices.total_mass + structure.hung_mass
    return modes_of(structure, matrices, count, mixed=True), causes, mass


def preloaded(
    structure: Structure, solid: Solid, matrices: Matrices, name: str, strain: float
) -> tuple[Matrices, float]:
    """Return the matrices with a misfit member, and its axial force in N, tension positive."""
    member = structure.member(name)
    axes, length = structure.axes(member)
    along = np.abs(axes[0])
    system = attach(structure, matrices, structure.lumps, structure.springs)
    cells = solid.of_part(name)
    stressed, stress = with_misfit(solid, matrices, system, cells, strain * along)
    x = local(structure, solid, member)[0]
    middle = cells & (np.abs(x - length / 2) < length / 4)
    axis = int(along.argmax())
    corners = solid.points[:, solid.cells]
    volume = np.ptp(corners, axis=1).prod(axis=0)
    span = float(np.ptp(solid.points[axis, solid.cells[:, middle]]))
    force = float((stress[axis, axis].mean(axis=1) * volume)[middle].sum() / span)
    return stressed, force


def turning_stiffness(base: Healthy, matrices: Matrices, name: str, joint: str) -> float:
    """Return the spring (N m/rad) that turns as much as a defect adds, about the softer axis.

    A couple acts between the joint and the member a quarter of its length away; what both states
    turn differently is the spring's.
    """
    structure = base.structure
    member = structure.member(name)
    place: Place = (name, 0.25 if member.ends[0] == joint else 0.75)
    ends = np.array([structure.joints[j] for j in member.ends], dtype=float).T
    along = np.diff(structure.warped(ends), axis=1)[:, 0]
    # The two axes across the member as it really lies, those alone that the drawing turns about.
    across = np.linalg.svd(along[None, :])[2][1:]
    if structure.plane != "3d":
        normal = np.array([0.0, 1.0, 0.0] if structure.plane == "in-plane" else [0.0, 0.0, 1.0])
        turned = np.cross(normal, along) / np.linalg.norm(along)
        across = np.array([normal if structure.plane == "in-plane" else turned])

    def flexibility(state: Matrices) -> Array:
        seats = [rigid_fit(structure, state, at)[3:].toarray() for at in (joint, place)]
        couple = across @ (seats[1] - seats[0])
        system = attach(structure, state, (), structure.springs)
        load = system.observe.T @ couple.T
        return np.asarray(np.einsum("ij,ij->j", load, statics(system).solve(load)))

    added = flexibility(matrices) - flexibility(base.matrices)
    return float(1 / added.max())


def visible(base: Healthy, state: Observed) -> tuple[float, float, int]:
    """Return how a noise-free change shows in the used modes.

    Returns:
        Chi-square of frequencies and shapes of the healthy modes' partners, its part of the
        frequencies, and how many of the modes that are posed as used have no healthy partner.
    """
    structure, used = base.structure, base.structure.used
    before = base.modes.chosen(np.arange(used))
    partner = paired(
        (before.frequencies, before.stations), (state.frequencies, state.stations), CLOSENESS
    )
    after = state.chosen(partner)
    std = np.hypot(structure.scatter, mesh_differences(structure.name)[:used])
    drift = (after.frequencies / before.frequencies - 1) / std
    one, two = scaled(before.sensors), after.sensors
    # Every shape has a scale of its own: the one that fits best.
    two = two * ((one * two).sum(axis=1) / (two**2).sum(axis=1))[:, None]
    turned = (two - one) / structure.shape_scatter
    alike = mac(state.stations[:used], base.modes.stations).max(axis=1)
    chi2_frequencies = float((drift**2).sum())
    appears = int((alike < NEW_MODE).sum())
    return chi2_frequencies + float((turned**2).sum()), chi2_frequencies, appears


def weighed(structure: Structure, mass: float, seed: int) -> tuple[float, float] | None:
    """Return what a balance reads of a mass (kg), and its deviation; None where nobody weighs."""
    if not structure.weighed:
        return None
    read = 1 + structure.weighed * np.random.default_rng((seed, 3)).standard_normal()
    return float(f"{mass * read:.5g}"), float(f"{mass * structure.weighed:.2g}")


def files_of(draw: Draw) -> dict[str, str]:
    """Return the text of every file of a case."""
    base = healthy(draw.structure)
    structure, count = base.structure, base.structure.used + base.structure.held_out
    causes: list[TrueCause] = []
    state, mass = base.modes, base.matrices.total_mass + structure.hung_mass
    if draw.defects:
        state, causes, mass = damaged(base, draw.defects)
    if min(len(state.frequencies), len(base.modes.frequencies)) < count:
        raise ValueError(f"fewer than {count} modes were found")
    chi2, chi2_frequencies, appears = visible(base, state) if draw.defects else (0.0, 0.0, 0)
    truth = KnownCase(
        draw.name,
        draw.structure,
        draw.kind,
        draw.seed,
        tuple(replace(c, size=None if c.size is None else rounded(c.size)) for c in causes),
        chi2,
        chi2_frequencies,
        appears,
        weighed(structure, mass, draw.seed),
    )
    files = {"truth.toml": truth_text(truth)}
    differences = mesh_differences(structure.name)
    for name, modes, number in (("modes.csv", state, 1), ("healthy.csv", base.modes, 2)):
        # The same sensors in both states, so the gains are shared; all other scatter is not.
        recording = record(
            structure,
            modes.frequencies[:count],
            modes.sensors[:count],
            differences,
            structure.seed,
            draw.seed,
            number,
        )
        files[name] = modes_csv(structure, recording)
    return files


def write_all(
    names: list[str], made: Callable[[Draw], bool], folder: Path = DEFECTS
) -> Iterator[tuple[Draw, list[str] | str]]:
    """Write the cases of some structures, of all without names; yield what differs, or why not.

    Arguments:
        made: tells which cases a run before this one has made.
    """
    drawn = draws()
    stale = {p.name for p in folder.glob("*/")} - {d.name for d in drawn}
    for name in sorted(stale):
        shutil.rmtree(folder / name)
    wanted = [d for d in drawn if (not names or d.structure in names) and not made(d)]
    for draw in sorted(wanted, key=lambda d: d.structure):
        try:
            files = files_of(draw)
        except ValueError as error:
            yield draw, str(error)
            continue
        yield draw, write_files(folder / draw.name, files)
