"""What may be wrong with a frame of tubes, drawn over places and sizes, and put into its beams."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truths.opensees_frames import AXES, FINER, FREE, Bar, Beams, E, Plan


@dataclass(frozen=True)
class Fault:
    """A cause in words, and how it is put into the beams.

    Arguments:
        what: in words.
        effect: slug; empty where no effect describes it.
        place: in the words of the plan.
        edit: puts it in.
        also: ``effect@place`` of what counts as the same.
        size: in `unit`, empty for a ratio; None where there is none.
    """

    what: str
    effect: str
    place: str
    edit: Callable[[Beams], None]
    also: tuple[str, ...] = ()
    size: float | None = None
    unit: str = ""


Maker = Callable[[Plan, np.random.Generator], Fault | None]


def _spread(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two, its logarithm uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice((-1.0, 1.0))) * _spread(rng, low, high)


def _any(rng: np.random.Generator, items: Sequence[Bar]) -> Bar:
    return items[int(rng.integers(len(items)))]


def _scaled(
    numbers: Callable[[Beams], Sequence[int]], factor: float, *keys: str
) -> Callable[[Beams], None]:
    def edit(beams: Beams) -> None:
        for i in numbers(beams):
            for key in keys:
                beams.elements[i][key] *= factor

    return edit


def stiff_member(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a member with another modulus."""
    bar, size = _any(rng, plan.bars), _signed(rng, 0.06, 0.3)
    what = f"modulus of {bar.name} changed by {100 * size:.0f} %"
    return Fault(
        what,
        "member-stiffness",
        bar.name,
        _scaled(lambda b: b.of[bar.name], 1.0 + size, "E", "G"),
        size=size,
    )


def heavy_member(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a member that is heavier."""
    bar, size = _any(rng, plan.bars), _spread(rng, 0.08, 0.5)
    return Fault(
        f"sand in {bar.name}",
        "member-mass",
        bar.name,
        _scaled(lambda b: b.of[bar.name], 1.0 + size, "rhoA"),
        size=size,
    )


def soft_all(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return another modulus everywhere."""
    size = _signed(rng, 0.02, 0.1)
    what = f"modulus of all changed by {100 * size:.0f} %"
    return Fault(
        what,
        "youngs-modulus",
        "all",
        _scaled(lambda b: range(len(b.elements)), 1.0 + size, "E", "G"),
        also=("temperature@all",),
        size=size,
    )


def damage(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a drawn element that is softer."""
    bar, size = _any(rng, plan.bars), _spread(rng, 0.2, 0.7)
    k = int(rng.integers(1, bar.elements + 1))
    what = f"{bar.name} softer by {100 * size:.0f} % along element {k}"

    def own(beams: Beams) -> Sequence[int]:
        return beams.of[bar.name][FINER * (k - 1) : FINER * k]

    return Fault(
        what,
        "local-stiffness-loss",
        f"{bar.name}/{k}",
        _scaled(own, 1.0 - size, "E", "G"),
        size=size,
    )


def clamp_mass(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a lump on a member or a joint that is not clamped."""
    bar = _any(rng, plan.bars)
    k = int(rng.integers(1, bar.elements))
    places = [f"{bar.name}@{k / bar.elements:.6g}", *(j for j in bar.ends if j not in plan.clamped)]
    at = places[int(rng.integers(len(places)))]
    mass = plan.mass * _spread(rng, 0.005, 0.06)
    return Fault(
        f"clamp of {mass:.3g} kg at {at}",
        "added-mass",
        at,
        lambda beams: beams.masses.append((beams.node(at), mass)),
        size=mass,
        unit="kg",
    )


def cord(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a spring to the ground at a joint."""
    free = [joint for joint in plan.joints if joint not in plan.clamped]
    at = free[int(rng.integers(len(free)))]
    direction = int(rng.choice([d for d in FREE[plan.plane] if d <= len(AXES)]))
    inertia = max(tube.inertia for tube in plan.tubes.values())
    stiffness = 12.0 * E * inertia / plan.extent**3 * _spread(rng, 0.02, 1.0)
    word = AXES[direction - 1]
    what = f"spring to the ground along {word} at {at}"
    words = [f"{at}:{word}", at]
    # Out of its plane a frame moves along one axis alone.
    place, other = reversed(words) if plan.plane == "out-of-plane" else words
    also = (f"grounding-spring@{other}",)
    return Fault(
        what,
        "grounding-spring",
        place,
        lambda beams: beams.grounds.append((beams.node(at), {str(direction): stiffness})),
        also=also,
        size=stiffness,
        unit="N/m",
    )


def loose_joint(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a member end that turns at its joint."""
    bar = _any(rng, plan.bars)
    inner = [joint for joint in bar.ends if plan.ends_at(joint) > 1]
    joint = inner[int(rng.integers(len(inner)))]
    stiffness = 4.0 * E * plan.tubes[bar.tube].inertia / plan.length(bar) * _spread(rng, 0.5, 15.0)
    k = 1 if bar.ends[0] == joint else bar.elements
    also = [f"local-stiffness-loss@{bar.name}/{k}", f"joint-flexibility@{joint}"]
    if plan.ends_at(joint) == 2:
        other = next(b for b in plan.bars if joint in b.ends and b is not bar)
        also += [f"joint-rotation@{joint}", f"joint-rotation@{other.name}@{joint}"]
    turns = {str(d): stiffness for d in FREE[plan.plane] if d > len(AXES)}
    return Fault(
        f"{bar.name} turns at {joint}",
        "joint-rotation",
        f"{bar.name}@{joint}",
        lambda beams: beams.hinges.append((*beams.part(bar.name, joint), turns)),
        also=tuple(also),
        size=stiffness,
        unit="N m/rad",
    )


def soft_foot(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a clamp that turns."""
    joint = plan.clamped[int(rng.integers(len(plan.clamped)))]
    bar = next(bar for bar in plan.bars if joint in bar.ends)
    stiffness = 4.0 * E * plan.tubes[bar.tube].inertia / plan.length(bar) * _spread(rng, 0.3, 8.0)
    k = 1 if bar.ends[0] == joint else bar.elements
    turns = [d for d in FREE[plan.plane] if d > len(AXES)]
    also = [f"support-flexibility@support:{joint}:r{AXES[d - 4]}" for d in turns]
    also += [f"local-stiffness-loss@{bar.name}/{k}", f"joint-rotation@{bar.name}@{joint}"]
    what, unit = f"the clamp at {joint} turns", "N m/rad"
    place = f"support:{joint}"
    springs = {str(d): stiffness for d in turns}
    return Fault(
        what,
        "support-flexibility",
        place,
        lambda beams: beams.hinges.append((*beams.part(bar.name, joint), springs)),
        also=tuple(also),
        size=stiffness,
        unit=unit,
    )


def strut(plan: Plan, rng: np.random.Generator) -> Fault | None:
    """Return a rod between two joints, in whose direction the plane is free."""
    if plan.plane == "out-of-plane":
        return None
    joined = {frozenset(bar.ends) for bar in plan.bars}
    names = list(plan.joints)
    pairs = [
        (a, b)
        for i, a in enumerate(names)
        for b in names[i + 1 :]
        if frozenset((a, b)) not in joined and not {a, b} <= set(plan.clamped)
    ]
    a, b = pairs[int(rng.integers(len(pairs)))]
    stiffness = _bending(plan, plan.bars[0]) * _spread(rng, 0.05, 2.0)
    also = (f"brace-spring@{b}-{a}",)
    what = f"a rod from {a} to {b}"

    def edit(beams: Beams) -> None:
        ends = beams.joints[a], beams.joints[b]
        first, last = (np.array(beams.nodes[node]) for node in ends)
        length = float(np.linalg.norm(last - first))
        beams.struts.append((*ends, stiffness, length))

    return Fault(what, "brace-spring", f"{a}-{b}", edit, also=also, size=stiffness, unit="N/m")


def taper(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a member whose stiffness changes along it."""
    bar, low = _any(rng, plan.bars), float(rng.uniform(0.4, 0.7))
    ends = (low, 2.0 - low) if rng.random() < 0.5 else (2.0 - low, low)
    what = f"the stiffness of {bar.name} goes from {ends[0]:.2f} to {ends[1]:.2f} along it"

    def edit(beams: Beams) -> None:
        numbers = beams.of[bar.name]
        for i, factor in zip(numbers, np.linspace(*ends, len(numbers)), strict=True):
            for key in ("E", "G"):
                beams.elements[i][key] *= float(factor)

    return Fault(what, "", bar.name, edit)


def slide(plan: Plan, rng: np.random.Generator) -> Fault:
    """Return a member end that slides across its axis, along one of the axes of the plan."""
    bars = [bar for bar in plan.bars if np.count_nonzero(plan.along(bar)) == 1]
    bar = _any(rng, bars)
    across = set((np.flatnonzero(plan.along(bar) == 0.0) + 1).tolist())
    springs = {
        str(d): _bending(plan, bar) * _spread(rng, 0.5, 5.0)
        for d in FREE[plan.plane]
        if d in across
    }
    joint = bar.ends[int(rng.integers(2))]
    return Fault(
        f"{bar.name} slides across its axis at {joint}",
        "",
        f"{bar.name}@{joint}",
        lambda beams: beams.hinges.append((*beams.part(bar.name, joint), springs)),
    )


def _bending(plan: Plan, bar: Bar) -> float:
    """Return 12 E I / L^3 of a member in N/m."""
    return float(12.0 * E * plan.tubes[bar.tube].inertia / plan.length(bar) ** 3)


SINGLES: dict[str, Maker] = {
    "member-stiffness": stiff_member,
    "member-mass": heavy_member,
    "damage": damage,
    "clamp-mass": clamp_mass,
    "cord": cord,
    "loose-joint": loose_joint,
    "soft-foot": soft_foot,
    "strut": strut,
    "modulus": soft_all,
}
OUTSIDE: dict[str, Maker] = {"taper": taper, "slide": slide}
