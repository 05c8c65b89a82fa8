"""The five updates of table 4: the words that run them, and what the text leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from femubench import Case, Model, UpdateResult
from femubench.fem import Property
from femubench.papers.hframe.meshes import RECOVERED
from femubench.papers.printed import read_printed
from femubench.reproduction import Ground, Workbench

# The printed springs, arms and rigidities; the case knows the half depth of 20 mm.
SPRINGS = "stiffness.x=3.30e9,stiffness.z=4.48e9,stiffness.ry=3.02e6"
RIGID_SPRINGS = "stiffness.x=3.30e13,stiffness.z=4.48e13,stiffness.ry=3.02e10"
# Strong enough that k_x and k_z, on which the frequencies hardly depend, stay near their start.
_DAMPING = "options.damping=3e-3"
FREE_EI = f"spring:{SPRINGS},{_DAMPING}"
_TO_THE_LAST = "options.tolerance=1e-9,options.cost_tolerance=1e-12"


_AS_STATED = Ground(
    "independent",
    "with the strategy as the text has it on the recovered dimensions, which no update was fitted "
    "to; nothing is chosen for it",
)


@dataclass(frozen=True)
class Setup:
    """What a column rests on.

    Arguments:
        words: ``strategy:option=value,...``, as after ``bench run hframe -s``.
        ground: what an agreement under these words is worth.
    """

    words: str
    ground: Ground = _AS_STATED

    @property
    def stated(self) -> Ground:
        """Return the ground with the words that repeat it."""
        words = f"{self.ground.words}: bench run hframe -s '{self.words}'"
        return replace(self.ground, words=words)

    @property
    def start(self) -> str:
        """Return the words of the model before the first step."""
        return f"{self.words}{',' if ':' in self.words else ':'}options.max_iterations=0"


@dataclass(frozen=True)
class Update:
    """One of the updates (a) to (e).

    Arguments:
        letter: in the paper.
        key: in the printed tables.
        title: what is updated.
        updated: how the updated column follows.
        names: from the paper's symbol to our parameter.
        initial_ground: what an agreement of the initial frequencies is worth.
        before: the words of the initial column where that is another model.
        apart: symbols that follow from another reading.
        converged: words without a damping that was chosen, where all of ``updated`` rests on one.
    """

    letter: str
    key: str
    title: str
    updated: Setup
    names: Mapping[str, str]
    initial_ground: Ground
    before: str = ""
    apart: Mapping[str, Setup] = field(default_factory=dict)
    converged: str = ""

    @property
    def table(self) -> str:
        """Return the name of the table, e.g. ``4a``."""
        return f"4{self.letter}"

    @property
    def initial(self) -> Setup:
        """Return what the initial column rests on."""
        return Setup(self.before or self.updated.words, self.initial_ground)


_DAMPED = Setup(
    f"spring:free_stiffness=false,{SPRINGS},options.damping=0.3,"
    f"options.max_iterations=200,{_TO_THE_LAST}",
    Ground(
        "fitted",
        "EI frozen; damped so strongly that k_x and k_z, on which the frequencies hardly depend, "
        "have not drifted further when k_theta settles; the damping was chosen to meet these two",
    ),
)
_HELD = Ground(
    "input", "the initial value, printed again: that EI was frozen is read from this very figure"
)
_JOINTS = Ground(
    "independent",
    "a joint of the text with the printed values on the recovered dimensions, which are fitted to "
    "the frame without joints; nothing is chosen for it",
)
ROWS = (
    Update(
        "a",
        "a_global_prototype",
        "EI of all members",
        Setup("global:options.residual=eigenvalue"),
        {"EI": "EI all members"},
        RECOVERED,
    ),
    Update(
        "b",
        "b_local_prototype",
        "EI of the elements at the joints",
        Setup(
            "local:options.damping=0.01,options.max_iterations=6",
            Ground(
                "fitted",
                "stopped a little short of convergence; damping and number of steps were chosen to "
                "meet the two printed parameters",
            ),
        ),
        {"EI_x": "EI at T branch", "EI_z": "EI at T through"},
        RECOVERED,
        converged="local",
    ),
    Update(
        "c",
        "c_global_spring",
        "EI and rho A of all members, springs at the joints",
        Setup(
            f"spring:variant=global,{RIGID_SPRINGS},options.damping=1.0,"
            f"options.max_iterations=30,{_TO_THE_LAST}",
            Ground(
                "fitted",
                "springs made rigid, unlike those of the initial column, because this column asks "
                "for it; only EI / rho A is determined, and where the two stand along it is where "
                "the iteration stops, which was chosen to meet them",
            ),
        ),
        {"EI": "EI all members", "rhoA": "rhoA all members"},
        _JOINTS,
        before=f"spring:variant=global,{SPRINGS}",
    ),
    Update(
        "d",
        "d_spring",
        "springs at the joints",
        Setup(
            f"spring:free_stiffness=false,{SPRINGS},{_DAMPING}",
            Ground(
                "under-convention",
                "EI frozen, which the text sets free and the table prints unchanged",
            ),
        ),
        {"k_x": "k_x T branch", "k_z": "k_z T branch", "k_theta": "k_ry T branch"}
        | {"EI": "EI all members"},
        Ground("input", "the initial column of table 4(c), printed again"),
        apart=dict.fromkeys(("k_x", "k_z"), _DAMPED)
        | {"EI": Setup(f"spring:free_stiffness=false,{SPRINGS},{_DAMPING}", _HELD)},
    ),
    Update(
        "e",
        "e_offset",
        "partly rigid elements at the joints and EI",
        Setup("offset"),
        {"a_H": "a T branch", "a_V": "a T through", "EI": "EI all members"},
        _JOINTS,
        apart={
            "a_V": Setup(
                "offset:options.damping=3e-3",
                Ground("fitted", "the damping was chosen strong enough to hold it still"),
            )
        },
    ),
)


def run(bench: Workbench, words: str) -> UpdateResult:
    """Return an update of the H-frame."""
    return bench.update("hframe", words)


def nominal(case: Case, symbol: str) -> float:
    """Return what a factor multiplies: EI in N m2 or rho A in kg/m; 1 for what is no factor."""
    member = case.model.frame_structure.frame.members[0]
    if symbol.startswith("EI"):
        return member.material.E * member.section.Iy
    return member.material.rho * member.section.A if symbol == "rhoA" else 1.0


def parameter_values(bench: Workbench, row: Update, words: str) -> dict[str, tuple[float, float]]:
    """Return initial and updated value of every parameter of a row by the paper's symbol."""
    found = {p.name: (p.before, p.after) for p in run(bench, words).parameters}
    values = {}
    for symbol, name in row.names.items():
        unit = nominal(bench.cases["hframe"], symbol)
        before, after = found.get(name, (1.0, 1.0))  # a frozen factor keeps its value
        values[symbol] = unit * before, unit * after
    return values


def at_printed(bench: Workbench, row: Update) -> Model:
    """Return the model of the updated column with the parameters that the paper prints."""
    structure = run(bench, row.updated.start).model.frame_structure
    known = {parameter.name: parameter for parameter, _ in structure.changes}
    theirs = read_printed("hframe")["table4"][row.key]["parameters"]
    chosen: list[Property] = []
    values: list[float] = []
    for symbol, name in row.names.items():
        if name in known:
            first, last = theirs[symbol]
            chosen.append(known[name])
            values.append(last / first if known[name].is_factor else last)
    return Model.of(structure.with_values(chosen, values))


def row_of(letter: str) -> Update:
    """Return one of the rows a to e."""
    return next(row for row in ROWS if row.letter == letter)
