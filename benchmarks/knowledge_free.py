"""What is gained without any knowledge of a structure but the frequencies that were given.

python benchmarks/knowledge_free.py            # docs/data/knowledge-free.csv; minutes
python benchmarks/knowledge_free.py --small    # on the small structures of the suite, nothing kept
python benchmarks/knowledge_free.py --memory   # docs/data/memory.csv: who knows the truths by heart

Every model keeps the shapes of the textbook model and moves its frequencies, or splits a mode into
several of one shape; a search with an optimiser looks for the best of them on one half of the
structures and is judged on the other. All is done in the space of the textbook model's lowest
modes, where a modification takes milliseconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.sparse as sp
from scipy.optimize import minimize

import femubench
from femubench import Measurement, Run, Strategy, UpdateResult
from femubench.core.case.case import Case
from femubench.core.fem.frame import GroundSpring, PointMass
from femubench.core.fem.model import Dofs, Geometry, LowRank, Model
from femubench.core.fem.sensors import Sensors
from femubench.core.library.cases import read_cases
from femubench.core.library.rank import textbook_of
from femubench.core.modal.eigen import DENSE_LIMIT, Modes, modes_of, solve_modes
from femubench.core.plugin.loader import load_plugins
from femubench.core.score.leaderboard import leaderboard
from femubench.core.score.ranking import Scale
from femubench.core.score.scoring import reference_of, score_model
from femubench.core.typing import FloatArray, SparseArray
from femubench.modal import pair_measured
from femubench.results import Rule, twin_gains
from femubench.update import with_measured_frequencies

TABLE = Path(__file__).parents[1] / "docs" / "data" / "knowledge-free.csv"
MEMORY = TABLE.with_name("memory.csv")
TWINS = (2, 1)  # of each case, and the seed that they are drawn from
SHARES = (0.25, 0.5, 1.0)  # of the way to the truth
_SAME = 0.02  # of the given frequencies: so near is the case that they were learnt from
_FACTOR = 2.6  # times the highest measured frequency, up to which modes are kept
_LEAST = 30  # modes
# Mode of the model, ln of its frequency, and its share of the mode's mass.
Line = tuple[int, float, float]


@dataclass(frozen=True)
class Given:
    """What a model without knowledge rests on.

    Arguments:
        logs: ln of the model's frequencies, (p,).
        met: ln of the measured frequency by mode, of those that were given.
    """

    logs: FloatArray
    met: Mapping[int, float]

    @property
    def ratios(self) -> FloatArray:
        """Return ln of measured over own frequency of the given modes."""
        return np.array([value - self.logs[mode] for mode, value in self.met.items()] or [0.0])

    def shifted(self, share: float, slope: float = 0.0) -> list[Line]:
        """Return the given modes met, and all others moved by a share of the mean ratio.

        Arguments:
            slope: by which the share grows with ln f above the highest given mode.
        """
        top = max(self.met.values(), default=0.0)
        mean = float(self.ratios.mean())
        return [
            (mode, self.met.get(mode, own + mean * (share + slope * max(own - top, 0.0))), 1.0)
            for mode, own in enumerate(self.logs)
        ]

    def split(self, lines: Sequence[Line], offsets: Sequence[float]) -> list[Line]:
        """Return lines with all but the given modes split into several of one shape."""
        return [
            part
            for mode, log, share in lines
            for part in (
                [(mode, log, share)]
                if mode in self.met
                else [(mode, log + off, share / len(offsets)) for off in offsets]
            )
        ]


Maker = Callable[[Given], list[Line]]


def pickets(share: float, *steps: float, width: float | None = None) -> Maker:
    """Return a maker of modes that are split by steps times the scatter of the ratios, or a width.

    Arguments:
        share: of the mean ratio, for their centre.
    """

    def make(given: Given) -> list[Line]:
        scatter = float(given.ratios.std()) if width is None else width
        return given.split(given.shifted(share), [step * scatter for step in steps])

    return make


MAKERS: dict[str, Maker] = {
    "textbook": lambda given: [(mode, log, 1.0) for mode, log in enumerate(given.logs)],
    "meet": lambda given: given.shifted(0.0),
    "shifted": lambda given: given.shifted(0.5),
    "drift": lambda given: given.shifted(1.0),
    "drift, pickets at the scatter": pickets(1.0, -1.0, 1.0),
    "drift, pickets at 5 %": pickets(1.0, -1.0, 1.0, width=0.05),
    "drift, three pickets": pickets(1.0, -1.0, 0.0, 1.0),
    "shifted, pickets at the scatter": pickets(0.5, -1.0, 1.0),
}
# A picket and the model whose modes it splits.
CENTRES = {name: name.partition(",")[0] for name in MAKERS if "," in name}


@dataclass(frozen=True)
class ModalGeometry:
    """Where sensors and attachments act on modal coordinates.

    Arguments:
        base: that of the model.
        shapes: of the coordinates, (n, p).
    """

    base: Geometry
    shapes: FloatArray

    def observe(self, sensors: Sensors) -> SparseArray:
        """Return sensor readings from modal coordinates."""
        return sp.csc_array(self.base.observe(sensors) @ self.shapes)

    def assemble_attachments(
        self, masses: Sequence[PointMass], springs: Sequence[GroundSpring]
    ) -> tuple[SparseArray, SparseArray]:
        """Return mass and stiffness of attachments in modal coordinates."""
        mass, stiffness = self.base.assemble_attachments(masses, springs)
        own = (self.shapes.T @ (matrix @ self.shapes) for matrix in (mass, stiffness))
        return sp.csc_array(next(own)), sp.csc_array(next(own))


@dataclass(frozen=True)
class Problem:
    """A case with its textbook model, in the space of that one's lowest modes."""

    case: Case

    @cached_property
    def _modes(self) -> tuple[FloatArray, FloatArray]:
        """Return ln of the elastic frequencies and all shapes, rigid ones first."""
        case = self.case
        measured = [case.measurement, *(change.measurement for change in case.modifications)]
        top = _FACTOR * max(float(one.frequencies.max()) for one in measured)
        count = min(_LEAST, case.model.size)
        modes = modes_of(case.model, count)
        while modes.natural_frequencies[-1] < top and count < case.model.size // 2:
            count = min(2 * count, case.model.size // 2)
            modes = modes_of(case.model, count)
        kept = (modes.natural_frequencies < top) | (np.arange(len(modes)) < _LEAST)
        order = [*np.flatnonzero(modes.rigid & kept), *np.flatnonzero(~modes.rigid & kept)]
        hertz = modes.natural_frequencies[~modes.rigid & kept]
        return np.log(hertz), modes.shapes[:, order]

    @cached_property
    def given(self) -> Given:
        """Return what may be known."""
        return self.meet(self.case.used_measurement(0))

    def meet(self, measurement: Measurement) -> Given:
        """Return the frequencies of the model's modes, and those that were measured."""
        logs, shapes = self._modes
        readings = self.case.model.observe(measurement.sensors) @ shapes
        first = shapes.shape[1] - len(logs)
        values = np.concatenate([np.zeros(first), np.square(2.0 * np.pi * np.exp(logs))])
        modes = Modes(values, shapes, values == 0.0)
        index = pair_measured(measurement, modes, readings).index
        pairs = zip(index, measurement.frequencies, strict=True)
        return Given(logs, {int(i - first): float(np.log(f)) for i, f in pairs if i >= 0})

    def model(self, lines: Sequence[Line]) -> Model:
        """Return the model of lines on its modal coordinates."""
        logs, shapes = self._modes
        first = shapes.shape[1] - len(logs)
        modes, own, share = (np.array(part) for part in zip(*lines, strict=True))
        turned = shapes[:, first + modes.astype(int)] * np.sqrt(share)
        # Rigid ones lie far below all windows of a pairing.
        still = np.full(first, np.exp(2.0 * logs[0]) * 1e-8)
        values = np.square(2.0 * np.pi) * np.concatenate([still, np.exp(2.0 * own)])
        p = len(values)
        dofs = Dofs(np.arange(p), ("x",) * p, np.zeros((p, 3)), np.zeros((p, 6)))
        geometry = ModalGeometry(self.case.model.geometry, np.hstack([shapes[:, :first], turned]))
        return Model(
            sp.eye_array(p, format="csc"), sp.diags_array(values, format="csc"), dofs, geometry
        )

    @cached_property
    def scale(self) -> Scale:
        """Return what gains on this case are measured by."""
        own = replace(self.case, model=self.model(MAKERS["textbook"](self.given)))
        blocks = reference_of(own).blocks
        return Scale.of_models({self.case.name: {"textbook": blocks}}, Rule(), "textbook")

    def figures(self, make: Maker) -> dict[str, float]:
        """Return the gains of a model that a maker makes."""
        name, scale = self.case.name, self.scale
        own = replace(self.case, model=self.model(MAKERS["textbook"](self.given)))
        blocks = score_model(own, self.model(make(self.given)))
        return scale.figures(name, scale.modes[name].errors(blocks))


@dataclass(frozen=True)
class Learnt:
    """What a strategy knows of a case by heart.

    Arguments:
        given: frequencies that are given there, Hz.
        make: numbers of modes, sensors and unknowns, which twins share.
        ratios: ln of the true over the textbook frequency by elastic mode, also of those held back.
    """

    given: FloatArray
    make: tuple[int, int, int]
    ratios: Mapping[int, float]

    @classmethod
    def of(cls, problem: Problem) -> Learnt:
        """Return what is there to be learnt."""
        case, true = problem.case, problem.meet(problem.case.measurement)
        used = case.used_measurement(0)
        make = (len(used), len(used.sensors), case.model.size)
        ratios = {mode: value - true.logs[mode] for mode, value in true.met.items()}
        return cls(used.frequencies, make, ratios)


class Memory(Strategy):
    """Knows the truths of the cases, and moves a share of the way to them, that it may not show.

    Arguments:
        by_make: whether it knows a structure by its numbers, so that it answers on twins too, with
            the ratios of the case; else by the given frequencies.
    """

    citation = "none"

    def __init__(self, known: Sequence[Learnt], share: float, *, by_make: bool) -> None:
        kind = "ratios" if by_make else "truths"
        self.name = f"{kind}-{100 * share:.0f}"
        self.known, self.share, self.by_make = known, share, by_make

    def _recalled(self, model: Model, measurement: Measurement) -> Mapping[int, float]:
        make = (len(measurement), len(measurement.sensors), model.size)
        for item in self.known:
            if item.make == make and (
                self.by_make or np.abs(np.log(measurement.frequencies / item.given)).max() < _SAME
            ):
                return item.ratios
        return {}

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        """Return the model with the given frequencies, and others moved where they are known."""
        ratios = self._recalled(model, measurement)
        if ratios:
            modes = solve_modes(model, min(model.size, max(ratios) + 16)).elastic
            places = np.array(list(ratios))
            moved = np.expm1(2.0 * self.share * np.array(list(ratios.values())))
            basis = model.mass_times(modes.shapes[:, places])
            change = LowRank(basis, np.diag(modes.eigenvalues[places] * moved))
            model = replace(model, stiffness_change=change)
        return UpdateResult(with_measured_frequencies(model, measurement), len(measurement))


def remember(words: Sequence[str]) -> pd.DataFrame:
    """Return what strategies with memory gain on cases and on their twins, and who is marked.

    First on the cases with stretched twins, then on all of them.
    """
    problems = problems_of(words)
    known = [Learnt.of(problem) for problem in problems]
    able = [Memory(known, share, by_make=kind) for kind in (False, True) for share in SHARES]
    names = [problem.case.name for problem in problems]
    run = femubench.rank(
        names, [*able, "meet", "shifted"], nominal="textbook", twins=TWINS, timeout=None
    )
    alone = stretched_alone(run)
    listed = [alone, run] if len(alone.meta["models"]) < len(names) else [run]
    return pd.concat(list_gains(one) for one in listed)


def stretched_alone(run: Run) -> Run:
    """Return a run on the cases that have stretched twins."""
    twins, models = run.meta["twins"], run.meta["models"]
    kept = {twins["of"][key] for key, kinds in twins["kinds"].items() if "stretched" in kinds}
    meta = {
        **run.meta,
        "models": {case: own for case, own in models.items() if case in kept},
        "twins": {**twins, "of": {key: case for key, case in twins["of"].items() if case in kept}},
    }
    return replace(run, meta=meta, results=tuple(r for r in run.results if r.case in kept))


def list_gains(run: Run) -> pd.DataFrame:
    """Return the gains on cases and twins of a run, and who is marked."""
    board, twins = leaderboard(run).set_index("strategy")["gain"], run.meta["twins"]
    stretched = {case for key, case in twins["of"].items() if "stretched" in twins["kinds"][key]}
    rows = [
        {"strategy": name, "structures": len(run.meta["models"]), "stretched": len(stretched),
         "cases": found.original_gain, "twins": found.gain, "board": board[name],
         "p": found.p, "known": len(found.known), "marked": found.suspicious}
        for name, found in twin_gains(run).items()
    ]  # fmt: skip
    return pd.DataFrame(rows).round(4)


def problems_of(words: Sequence[str]) -> list[Problem]:
    """Return the cases that words name, with their textbook models."""
    cases = read_cases(words, load_plugins())
    known = textbook_of(cases)
    return [Problem(known.get(case.name, case)) for case in cases if case.held_out]


def mean_gain(problems: Sequence[Problem], make: Maker) -> dict[str, float]:
    """Return the mean figures over structures."""
    rows = pd.DataFrame([p.figures(make) for p in problems])
    rows["structure"] = [p.case.structure or p.case.name for p in problems]
    found: dict[str, float] = rows.groupby("structure").mean().mean().to_dict()
    return found


def searched(x: FloatArray) -> Maker:
    """Return the maker that a search has: share, slope and half the width of pickets in percent."""
    share, slope, percent = (float(v) for v in x)
    half = abs(percent) / 100.0
    offsets = [-half, half] if half > 1e-3 else [0.0]
    return lambda given: given.split(given.shifted(share, slope), offsets)


def search(problems: Sequence[Problem]) -> Maker:
    """Return the best maker on some structures, by Nelder and Mead from `shifted`."""
    start = np.array([0.5, 0.0, 0.0])
    steps = np.vstack([np.zeros(3), np.diag([0.3, 0.5, 2.0])])

    def loss(x: FloatArray) -> float:
        return -mean_gain(problems, searched(x))["gain"]

    options = {"maxfev": 25, "initial_simplex": start + steps}
    best = minimize(loss, start, method="Nelder-Mead", options=options).x
    print(f"searched: share {best[0]:.2f}, slope {best[1]:.2f}, width {best[2]:.2f} %")
    return searched(best)


def main() -> None:
    """Print the table, and keep it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="small structures alone, kept nowhere")
    parser.add_argument("--memory", nargs="*", metavar="CASE", help="who knows cases by heart")
    words = parser.parse_args()
    if words.memory is not None:
        table = remember(words.memory or ["suite"])
        print(table.to_string(index=False))
        if not words.memory:
            table.to_csv(MEMORY, index=False, lineterminator="\n")
        return
    sets = {"suite": problems_of(["suite:before the rule"]), "default set": problems_of([])}
    if words.small:
        sets = {"suite": [p for p in sets["suite"] if p.case.model.size <= DENSE_LIMIT]}
    rows = []
    for name, problems in sets.items():
        listed = [(kind, mean_gain(problems, make)) for kind, make in MAKERS.items()]
        halves = problems[::2], problems[1::2]
        found = [mean_gain(other, search(own)) for own, other in (halves, halves[::-1])]
        apart = [len(half) / len(problems) for half in halves[::-1]]
        means = {k: sum(w * one[k] for w, one in zip(apart, found, strict=True)) for k in found[0]}
        listed.append(("search, on the other half", means))
        rows += [
            {"set": name, "structures": len(problems), "strategy": kind,
             **{k: figures[k] for k in ("gain", "error_gain", "change_gain", "error_percent")}}
            for kind, figures in listed
        ]  # fmt: skip
    table = pd.DataFrame(rows).round(4)
    print(table.to_string(index=False))
    if not words.small:
        table.to_csv(TABLE, index=False, lineterminator="\n")


if __name__ == "__main__":
    main()
