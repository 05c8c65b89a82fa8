"""The numbers that a diagnosis rests on: each with its unit, its kind and why it is what it is.

A `prior` is what is believed before any datum is seen, a `cost` is how much work is spent (and
what counts as rounding), a `decision` is where a statement begins. Code reads them by attribute:
`settings.sure_fault`. In a block `with overridden({"sure_fault": 0.95}):` some have other values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from difflib import SequenceMatcher
from math import inf
from typing import Literal, TypeVar, cast

from femubench.core.case.case import SCATTER
from femubench.core.case.modes import LARGEST_SCALE
from femubench.core.errors import InputError
from femubench.core.modal.antiresonances import SAME
from femubench.core.modal.eigen import ALL_MODES_LIMIT
from femubench.core.modal.group_prior import KINDS

Kind = Literal["prior", "cost", "decision"]
Value = float | tuple[float, ...]
T = TypeVar(
    "T",
    float,
    int,
    tuple[float, ...],
    tuple[float, float],
    tuple[float, float, float, float],
    tuple[int, int],
)


@dataclass(frozen=True)
class Setting:
    """One number of the table.

    Arguments:
        value: a number, or several that belong together.
        unit: what it counts or is a share of.
        kind: prior, cost or decision.
        why: one line.
    """

    value: Value
    unit: str
    kind: Kind
    why: str


def _entry(value: T, unit: str, kind: Kind, why: str) -> T:
    return field(default=value, metadata={"unit": unit, "kind": kind, "why": why})


def _prior(value: T, unit: str, why: str) -> T:
    return _entry(value, unit, "prior", why)


def _cost(value: T, unit: str, why: str) -> T:
    return _entry(value, unit, "cost", why)


def _decision(value: T, unit: str, why: str) -> T:
    return _entry(value, unit, "decision", why)


@dataclass(frozen=True)
class Settings:
    """All numbers, each with the value that it has unless a block says otherwise."""

    # What is believed before any datum is seen: causes and faults.
    prior_fault: float = _prior(
        0.1, "probability", "data or input are wrong somewhere, over kinds, then suspects"
    )
    prior_of_causes: tuple[float, ...] = _prior(
        (0.5, 0.4, 0.08, 0.015, 0.005), "probability", "a model lacks 0, 1, 2, 3, 4 or more causes"
    )
    prior_of_further_causes: tuple[float, ...] = _prior(
        (0.6, 0.3, 0.08, 0.015, 0.005), "probability", "the same on top of textbook physics"
    )
    prior_as_drawn: float = _prior(
        0.1, "probability", "a model that could lack textbook physics lacks none of it"
    )
    prior_whole_textbook: float = _prior(
        0.8, "probability", "it lacks all of it, since every beam has it; other sets share the rest"
    )
    prior_imitated: tuple[float, float] = _prior(
        (0.002, 0.022),
        "probability",
        "no effect describes it (0.05), one or several imitate it (1 and 11 of 25 own beams)",
    )
    damage_of_part: float = _prior(
        0.4,
        "of ln(factor)",
        "of a part where there is a reference, of a group always: damage is not tolerance",
    )
    prior_missed_mode: float = _prior(
        0.05, "probability", "a test does not find a mode among those that it finds"
    )
    # What a beam model gets wrong of a real structure.
    width_element_stiffness: float = _prior(
        0.02, "relative", "sections and moduli scatter along a structure"
    )
    width_group_stiffness: float = _prior(
        0.03, "relative", "thickness and modulus of a part of matrices are off as a whole"
    )
    width_joint_groups: float = _prior(
        0.3, "relative", "the same of a joint or a support, which are drawn by rule of thumb"
    )
    width_group_mass: float = _prior(
        0.02, "relative", "masses of parts scatter less: they can be weighed"
    )
    width_element_mass: float = _prior(0.01, "relative", "masses scatter less: they can be weighed")
    width_everything: float = _prior(
        0.03, "relative", "modulus and density of a delivery are off as a whole"
    )
    width_joint_types: float = _prior(
        0.15, "of L/4EI", "joints of one make are all softer than their drawing"
    )
    width_joints: float = _prior(0.05, "of L/4EI", "each joint differs from its like")
    width_joint_masses: float = _prior(0.02, "of the structure", "welds, bolts and brackets")
    width_general: float = _prior(
        0.02, "relative", "random changes between modes, for what no other class is"
    )
    width_sensor_gains: float = _prior(
        0.01, "relative", "sensors and dial gauges are calibrated to a per cent"
    )
    width_shapes: float = _prior(
        1.0, "deviations", "stated deviations of shapes are right only within their own size"
    )
    width_between_states: float = _prior(
        0.02, "of the scale", "a structure and its reference hardly differ in their model error"
    )
    error_scale_median: float = _prior(
        0.3, "of the width", "most structures are nearer to beams than a class is wide"
    )
    error_scale_spread: float = _prior(
        1.0, "of the logarithm", "the scale of a class is known within a factor of three or so"
    )
    error_scale_range: tuple[float, float] = _prior(
        (0.01, 10.0), "of the width", "smaller is nothing, larger is no beam"
    )
    own_error_of_change: float = _prior(
        0.3, "of the change", "an effect at a place is an idealisation: width of its own error"
    )
    own_error_of_size: tuple[float, float] = _prior(
        (0.12, 0.3), "of a size", "as far off were 18 solids; a spring drawn as rigid is farther"
    )
    trust_in_model_error: float = _prior(
        0.7, "power of the evidence", "model error is no more than a model of what is not known"
    )
    idealisation_error: float = _prior(
        0.05, "of the change", "the same where unseen data judge a cause"
    )
    shape_label: float = _prior(
        0.1, "of a shape's largest reading", "as far off it labels an unseen mode no better"
    )
    unseen_error: tuple[float, float] = _prior(
        (0.003, 1.5),
        "of a frequency, of the logarithm",
        "what a beam model gets wrong of an unseen mode, where anything; how well that is known",
    )
    widest_coordinate: float = _prior(
        3.0, "prior deviations", "beyond this a parameter or a size is not believed"
    )
    reachable_mass_std: float = _prior(0.002, "relative", "scales of a careful test")
    reachable_antiresonance_std: float = _prior(
        0.005, "relative", "antiresonances shift with where the hammer hits"
    )
    reachable_shape_std: float = _prior(
        0.015, "of the largest component", "accelerometers of a careful test; where none is stated"
    )
    scatter_of_tests: tuple[float, float] = _prior(
        SCATTER,
        "of frequencies, of shapes",
        "mounting, warmth, who hits: key `scatter` of a case, where one record was identified",
    )
    scale_of_readings: float = _prior(
        LARGEST_SCALE,
        "ratio of readings",
        "of two modes; a larger one is no matter of what sensors see",
    )
    tolerance_of_groups: tuple[float, ...] = _prior(
        tuple(s for kind in KINDS.values() for s in (kind.std, kind.mass_std)),
        "of ln(factor)",
        "stiffness and mass of parts, joints, supports: within tolerances, loose, hardly known; "
        "change of the force of preloads, which have no mass",
    )
    stiffest_joint: float = _prior(
        KINDS["joint"].most, "factor", "a joint is drawn whole and stiffens by a fillet at most"
    )

    # What the drawing itself lacks, where there is no reference.
    budget_handbook: float = _prior(
        0.1, "of what it changes", "shear coefficients and rotary inertia by handbooks are so sure"
    )
    budget_joints: tuple[float, float, float, float] = _prior(
        (1.5, 0.75, 0.5, 1.0 / 3.0),
        "of ln(stiffness) of a zone that ends, that passes; correlation of axes; part of a member",
        "an end is rigid or gives like a wall, bending is alike; no joint reaches farther",
    )
    budget_made: tuple[float, ...] = _prior(
        (1.5, 1.5, 1.5, 0.9, 1.0),
        "the first of these by `made`",
        "a solid corner has little but its arm, a glued one no weld; all others as not known",
    )
    budget_known: tuple[float, ...] = _prior(
        (0.02, 0.05, 0.01, 0.01, 0.3, 7850.0),
        "of E, of GJ, of density, of the structure, of drawn springs; kg/m3",
        "masses at the joints of a type likewise: all of them are apt to take what is not theirs; "
        "pads and soil are known to a third; a drawn mass has the inertia of a cube of steel",
    )
    budget_rest: tuple[float, float] = _prior(
        (0.01, 0.03),
        "of a frequency, of a shape's largest reading",
        "what no class of a budget is: 0.9 to 1.3 % of four solids",
    )

    # Where a verdict begins.
    nothing_missing: float = _decision(
        0.5, "probability", "from here on the verdict is that nothing is missing"
    )
    earned_probability: float = _decision(
        0.6, "probability", "from which a textbook effect may be part of a name"
    )
    earned_factor: float = _decision(
        20.0, "Bayes factor", "which the data must add: strong evidence (Kass & Raftery 1995)"
    )
    nearly_all: float = _decision(
        0.95,
        "probability",
        "covered by the stated names, and places of each; what lies outside is excluded",
    )
    adequate_p: float = _decision(
        0.05, "probability", "what is left, were it noise: above it nothing more is sought"
    )
    noise_p: float = _decision(
        1e-3, "probability", "what is left, were it noise: below it nothing known explains it"
    )
    largest_group: int = _decision(
        6, "explanations", "more names or places than this help nobody to decide"
    )
    as_well: float = _decision(3.0, "nats", "within which two fits are as good: 6 of chi-square")
    too_small: float = _decision(
        12.0, "of chi-square", "an effect that changes it by less is too small to see"
    )
    largest_own_error: float = _decision(
        0.4, "of the change", "right causes have 0.01 to 0.22 as their own error, a wrong one 0.87"
    )
    # Where unseen data confirm.
    visible_deviations: float = _decision(
        3.0, "deviations", "by which two predictions must differ to be distinguished"
    )
    telling_deviations: float = _decision(
        0.5, "deviations", "by which a single mode must change to say anything"
    )
    telling_modes: int = _decision(
        4, "modes", "fewer frequencies do not say which of them is wrong, nor what one of them does"
    )
    decisive: float = _decision(
        5.0, "nats", "odds of 150 to 1, from which unseen data outweigh used ones"
    )
    gross_error: float = _decision(
        0.05, "of a frequency", "more than any model error: the drawing, or the pairing, is wrong"
    )
    unusual_error: float = _decision(
        5.0, "times the usual error", "a mode farther off was not measured, or is not that mode"
    )
    # Where a fault begins.
    sure_fault: float = _decision(0.9, "probability", "from which data or input are corrected")
    lag: float = _decision(
        20.0, "nats", "behind which a fault, causes or a pure beam model are not tried"
    )
    fault_remainder: float = _decision(
        0.3, "of the squared misfit", "which may be left where a fault is most of what is wrong"
    )
    wrong_factor: float = _decision(
        2.0, "factor", "by which a gain or stated deviations must be off to be called wrong"
    )
    # Where a plain look warns.
    notable_mesh: float = _decision(
        0.001, "of a frequency", "change by a finer mesh that is worth a warning"
    )
    notable_physics: float = _decision(
        0.005, "of a frequency", "change by physics that a model leaves out that is worth one"
    )
    notable_deviations: float = _decision(
        2.0, "deviations", "the same against the measurement; a resonance so close hides"
    )
    unequal_elements: float = _decision(
        20.0, "ratio of lengths", "of neighbours, above which a mesh is ill made"
    )
    soft_suspension: float = _decision(
        0.5, "of the first elastic frequency", "above which rigid motions are held, not free"
    )
    usual_std: tuple[float, float] = _decision(
        (1e-5, 0.2),
        "of a frequency",
        "deviations that tests have, from the best to the worst",
    )
    alike_readings: float = _decision(
        0.97, "cosine", "of readings and expectations: a gain; of two shapes: a sound pair"
    )
    lone_misfit: float = _decision(
        10.0, "times an ordinary sensor's", "what a model lacks gave up to 6"
    )
    least_modes: int = _decision(2, "modes", "fewer have no pattern that says anything")
    stubby: float = _decision(8.0, "length over height", "below which a member is hardly a beam")
    quiet_share: float = _decision(
        0.05, "of the energy", "below which a member has no say, or counts as that much"
    )
    stiffness_per_mass: tuple[float, float] = _decision(
        (1e6, 4e8), "m2/s2", "E / rho of plastics and of beryllium alloys, with room"
    )
    shear_coefficient: tuple[float, float] = _decision(
        (0.2, 1.0), "", "of thin-walled to solid sections"
    )
    # What is worth measuring.
    worth_measuring: float = _decision(
        1.0, "squared deviations", "from which a measurement separates two explanations"
    )
    test_mass: float = _decision(
        0.02, "of the structure", "a known mass that is at hand and changes a mode visibly"
    )
    antiresonance_band: float = _decision(
        0.25, "of the lowest used frequency", "antiresonances may lie below the first resonance"
    )
    same_antiresonance: float = _decision(
        SAME, "ratio of frequencies", "within which two explanations mean the same one"
    )

    budget_seen: float = _decision(
        0.5, "of the prior variance", "which data must take away to see an entry of a budget"
    )

    # How much work is spent: the search.
    candidates: int = _cost(2, "candidates", "followed where the best alone might be wrong")
    of_a_kind: int = _cost(
        3, "of a kind", "suspects, partners, measurements or classes that are tried or shown"
    )
    near: float = _cost(
        8.0, "nats", "behind the best, within which a first estimate may have ranked wrongly"
    )
    approximation: float = _cost(
        0.05, "of what it explains", "which interpolation may miss, or first order near a resonance"
    )
    shortlist: int = _cost(
        40, "hypotheses", "fitted exactly, or weighed as partners, at most; half of input"
    )
    given_up: float = _cost(
        20.0, "of the cost", "so far behind the best a fit is not brought to its end"
    )
    seeds: int = _cost(6, "causes", "about which pairs are sought where no single one suffices")
    partners: int = _cost(8, "causes", "fitted with a seed, or carried on from other scales")
    promise_share: float = _cost(
        0.3, "of the chi-square to earn", "which a partner must promise, were effects to add up"
    )
    most_causes: int = _cost(4, "causes", "in one explanation: few data tell more apart")
    finer_singles: int = _cost(4, "causes", "tried with more values at their places")
    leading: int = _cost(
        12, "explanations", "given scales of their own and listed; places of a name kept"
    )
    scale_rounds: int = _cost(2, "rounds", "of causes and scales of model error in turn")
    worth_scales: float = _cost(
        1.0, "nats", "by which other scales must suit the leader better for another round"
    )
    few_steps: int = _cost(3, "steps", "of an iteration that begins near its end")
    scale_steps: tuple[int, int] = _cost(
        (40, 10), "steps", "for the scales of model error, from anywhere and from nearby"
    )
    scale_settled: float = _cost(1e-5, "relative", "change of the cost at which these steps end")
    general_modes: int = _cost(20, "elastic modes", "that random changes couple")
    faults_corrected: int = _cost(3, "faults", "more are no matter of mending")
    grid_points: int = _cost(13, "points", "on which the parameter of a fault is sought first")
    coordinate_margin: float = _cost(
        0.02, "prior deviations", "step of a curvature, what is off a bound, what still moves"
    )
    advised: int = _cost(8, "rows", "of advice, and explanations that it parts")
    points: int = _cost(48, "points", "of a structure where a test is thought through")
    # The atlas.
    responses: int = _cost(
        6, "vectors", "responses of the higher modes to a hypothesis; half where those suffice"
    )
    modes_kept: int = _cost(5, "modes", "beyond the last partner, in the basis of the atlas")
    modes_tracked: int = _cost(3, "modes", "beyond the last partner, with their response")
    spare_modes: int = _cost(8, "modes", "beyond twice the measured ones that are solved for")
    long_step: float = _cost(
        1.5, "prior deviations", "between neighbours on a grid, above which modes change places"
    )
    most_dofs: int = _cost(ALL_MODES_LIMIT, "dofs", "all of whose modes are solved for")
    fewest_elements: int = _cost(4, "elements", "a member, at least, where these are few enough")
    work_of_pieces: tuple[float, ...] = _cost(
        (0.35, 0.018, 1.0, 0.45, 1.0, 0.4, 0.35, 0.9, 0.3),
        "searches for single causes",
        "medians of the cases that come along, of the drawing the most (benchmarks/time_left.py)",
    )
    # Memory and rounding.
    block: int = _cost(512, "rows", "worked on at once, so that arrays fit the memory")
    slope_step: float = _cost(1e-4, "of a coordinate", "for a slope by central differences")
    close_modes: float = _cost(
        1e-3, "of an eigenvalue", "closer modes turn into each other at the least change"
    )
    minor: float = _cost(1e-4, "of the largest", "below this a response, row or noise is rounding")
    negligible: float = _cost(
        1e-6, "share, or m", "below this nothing differs; its square for energies"
    )
    far: float = _cost(1e18, "ratio", "as good as infinite, and its square still a number")
    unknown_variance: float = _cost(1e8, "variance", "of a datum that is not looked at")


_CURRENT: ContextVar[Settings] = ContextVar("settings", default=Settings())  # noqa: B039


class _Reader:
    """Gives the numbers of the block that asks."""

    def __getattr__(self, name: str) -> object:
        return getattr(_CURRENT.get(), name)


settings = cast(Settings, _Reader())


def settings_table() -> dict[str, Setting]:
    """Return every number by its name, in the order of the table, as it is in this block."""
    now = _CURRENT.get()
    return {f.name: Setting(getattr(now, f.name), **f.metadata) for f in fields(now)}


@contextmanager
def overridden(values: Mapping[str, Value]) -> Iterator[None]:
    """Give some numbers other values inside a block, and nowhere else.

    Raises:
        InputError: for a name that is not in the table, or a value of another type.
    """
    table = settings_table()
    for name, value in values.items():
        _check_known(name, table)
        _check_value(name, value, table[name])
    given = {
        name: type(table[name].value)(value)  # type: ignore[arg-type] # of one type, as checked
        for name, value in values.items()
    }
    token = _CURRENT.set(replace(_CURRENT.get(), **given))  # type: ignore[arg-type]
    try:
        yield
    finally:
        _CURRENT.reset(token)


def list_changed() -> dict[str, Value]:
    """Return the numbers that have other values in this block than in the table."""
    standard = Settings()
    table = settings_table().items()
    return {name: s.value for name, s in table if s.value != getattr(standard, name)}


def format_value(value: Value) -> str:
    """Return a value as it is written in words and options."""
    return ",".join(f"{x:g}" for x in (value if isinstance(value, tuple) else (value,)))


def decisions_from(words: Iterable[str]) -> dict[str, Value]:
    """Return numbers of the class `decision` from words such as ``sure_fault=0.95``.

    Raises:
        InputError: for an unknown name, one of another class, or a bad value.
    """
    table = settings_table()
    known = {name: s for name, s in table.items() if s.kind == "decision"}
    found: dict[str, Value] = {}
    for word in words:
        name, equals, text = (part.strip() for part in word.partition("="))
        if not equals:
            raise InputError(f"--set {word}", expected="name=value")
        if name in table and name not in known:
            what = f"--set {name}: a {table[name].kind} is not to be set"
            raise InputError(what, expected=f"a decision, one of {_nearest(name, known)}")
        _check_known(name, known)
        old = known[name].value
        try:
            numbers = tuple(float(part) for part in text.split(","))
        except ValueError:
            numbers = ()
        value: Value = numbers[0] if len(numbers) == 1 and not isinstance(old, tuple) else numbers
        _check_value(name, value, known[name])
        found[name] = int(cast(float, value)) if isinstance(old, int) else value
    return found


def _check_known(name: str, known: Mapping[str, Setting]) -> None:
    if name not in known:
        raise InputError(f"no setting {name!r}", expected=f"one of {_nearest(name, known)}")


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return known names, those most like a name first: a message has an end."""
    return ", ".join(sorted(known, key=lambda other: -SequenceMatcher(None, name, other).ratio()))


def _check_value(name: str, value: Value, known: Setting) -> None:
    """Make sure that a value is of the kind of the present one.

    Raises:
        InputError: otherwise.
    """
    several, whole = isinstance(known.value, tuple), isinstance(known.value, int)
    count = len(known.value) if isinstance(known.value, tuple) else 1
    numbers = value if isinstance(value, tuple) else (value,)
    most = 1.0 if known.unit in ("probability", "cosine", "MAC") else inf
    good = len(numbers) == count and isinstance(value, tuple) == several
    good = good and all(0.0 < x < most for x in numbers)
    if not good or (whole and numbers[0] != int(numbers[0])):
        below = "" if most == inf else f" and < {most:g}"
        kind = f"{count} numbers > 0, by comma" if several else f"a number > 0{below}"
        kind = "a whole number >= 1" if whole else kind
        given = format_value(value) or "no number"
        raise InputError(
            f"{name} = {given}", expected=f"{kind}, such as {format_value(known.value)}"
        )
