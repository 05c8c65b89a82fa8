"""Compare budgets of errors with what drawings lack; write docs/diagnosis-accuracy.md.

    python benchmarks/budget_score.py           # development half: budgets and the advised mode
    python benchmarks/budget_score.py held      # the other half: its rows are kept unless asked
    python benchmarks/budget_score.py portal    # one structure, class by class

The truths are those of `make truths ARGS="--only lacks"`; a minute.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).parents[1]))  # the truths are not installed

from sweep_data import PAGE, as_markdown, filled

import femubench
from femubench.core.diagnosis.budget import budget_of_modes
from femubench.core.diagnosis.budget_advice import open_variance
from femubench.core.plugin.loader import list_effects
from femubench.core.score.responses import rms
from truths.lacks_file import LACKS, Lacks, read_lacks

Array = npt.NDArray[np.float64]
Class = tuple[str, str]
MARK, ADVICE = "budget-score", "budget-advice"
CLEAR = 1.645  # deviations of a 90 % interval
OWN = 0.25  # of its size, by which definitions of a truth differ (five, twenty, 200 times as stiff)
LEAST = 0.05  # % of frequency; smaller in truth and budget says nothing
GROUNDED = ("springs to ground", "extent of springs")
KINDS = {
    **dict.fromkeys(
        ("support", "joint-stiffness", "joint stiffness", "arms of joints", *GROUNDED), "joint"
    ),
    **dict.fromkeys(("joint-mass", "joint mass", "overlap of members", "added-mass"), "mass"),
    "rotary inertia of masses": "mass",
    **dict.fromkeys(("shear-deformation", "rotary-inertia"), "shear"),
    **dict.fromkeys(("GJ", "warping"), "torsion-constant"),
    "density": "mass",
}


def signed(values: Array) -> float:
    """Return the rms with the sign of the sum."""
    return float(np.copysign(rms(values), values.sum()))


@dataclass(frozen=True)
class BudgetScore:
    """Hold a truth and the budget of its case in the same classes, in % of frequency.

    Arguments:
        truth: what the drawing lacks.
    """

    truth: Lacks

    @cached_property
    def budget(self) -> femubench.diagnosis.Budget:
        """Return the budget by the used modes."""
        return self.budget_with()

    def budget_with(self, *more: int) -> femubench.diagnosis.Budget:
        """Return the budget by the used modes and others."""
        case = femubench.cases[f"suite/{self.truth.structure}"]
        used = sorted((*case.used, *more))
        found = budget_of_modes(case.model, case.measurement, used, list_effects())
        assert found is not None
        return found

    @cached_property
    def used(self) -> npt.NDArray[np.bool_]:
        """Tell which modes were used, (m,)."""
        return np.array([mode.used for mode in self.budget.modes])

    def name(self, kind: str, place: str) -> Class:
        """Return what data cannot tell apart under one name: feet, joints, masses, shear."""
        frame = femubench.cases[f"suite/{self.truth.structure}"].model.structure.frame
        types = {joint.name: joint.family for joint in frame.joints}
        place, own = place.removeprefix("type:"), KINDS.get(kind, kind)
        if own == "joint":
            held = {types.get(str(one.at)) for one in (*frame.supports, *frame.springs)}
            grounded = kind in GROUNDED or (kind, place) == ("support", "all")
            if grounded or types.get(place, place) in held:
                return "foot", "all"
        return own, types.get(place, place) if own in ("joint", "mass") else "all"

    @cached_property
    def true(self) -> dict[Class, Array]:
        """Return the contribution of every class, (m,)."""
        found: dict[Class, Array] = {}
        for part in self.truth.net:
            key = self.name(part.kind, part.place)
            found[key] = found.get(key, 0.0) + 100.0 * np.array(part.contribution)
        return found

    @cached_property
    def stated(self) -> dict[Class, tuple[Array, float]]:
        """Return the same of the budget, with the deviation of its rms."""
        found: dict[Class, tuple[Array, float]] = {}
        for line in self.budget.lines:
            key = self.name(line.name, line.place)
            was, std = found.get(key, (np.zeros(len(self.used)), 0.0))
            found[key] = was + np.array(line.percent), float(np.hypot(std, line.rms_std))
        return found

    def both(self, key: Class) -> tuple[Array, Array, float]:
        """Return truth, budget and deviation of a class, zero where it has none."""
        none = np.zeros(len(self.used))
        return self.true.get(key, none), *self.stated.get(key, (none, 0.0))

    @property
    def classes(self) -> list[Class]:
        """Return all that either has, the largest first."""
        every = {*self.true, *self.stated}
        return sorted(every, key=lambda key: -max(map(rms, self.both(key)[:2])))

    def first(self, count: int) -> tuple[list[Class], list[Class]]:
        """Return the largest classes of truth and budget."""
        true = sorted(self.true, key=lambda key: -rms(self.true[key]))
        stated = sorted(self.stated, key=lambda key: -rms(self.stated[key][0]))
        return true[:count], stated[:count]

    def error(self, among: npt.NDArray[np.bool_]) -> float:
        """Return the norm of budget minus truth relative to the truth; 1 for an empty budget."""
        pairs = [self.both(key)[:2] for key in self.classes]
        off = np.array([(ours - true)[among] for true, ours in pairs])
        return float(np.linalg.norm(off) / np.linalg.norm([true[among] for true, _ in pairs]))

    @cached_property
    def handbook(self) -> Array:
        """Return what handbooks leave of every mode, (m,)."""
        book = sum(np.array(n.percent) for n in self.budget.lines if n.source == "handbook")
        return np.array([mode.error_percent for mode in self.budget.modes]) - book

    @property
    def left(self) -> Array:
        """Return what the extended model leaves of every mode, (m,)."""
        return np.array([mode.left_percent for mode in self.budget.modes])

    @property
    def ratio(self) -> float:
        """Return the error of held-out modes left by the extended model, of the handbook's."""
        return rms(self.left[~self.used]) / rms(self.handbook[~self.used])

    @cached_property
    def advised(self) -> int:
        """Return the row of the held-out mode that is known least, which is advised first."""
        return int(open_variance(self.budget).argmax())

    @cached_property
    def left_with(self) -> dict[int, Array]:
        """Return what is left of held-out modes, (h,), by the row of the one that is used too."""
        rows = np.flatnonzero(~self.used)
        found = {int(row): self.budget_with(self.budget.modes[row].mode) for row in rows}
        return {r: np.array([b.modes[i].left_percent for i in rows]) for r, b in found.items()}

    @property
    def after(self) -> list[float]:
        """Return the errors of held-out modes with one of them used, the advised one first."""
        rows = sorted(self.left_with, key=lambda row: row != self.advised)
        return [rms(self.left_with[row]) for row in rows]

    @property
    def ratio_with(self) -> float:
        """Return the error of modes unseen with the advised one too, of the handbook's."""
        unseen = np.flatnonzero(~self.used) != self.advised
        left, book = self.left_with[self.advised], self.handbook[~self.used]
        return rms(left[unseen]) / rms(book[unseen])

    def intervals(self) -> tuple[list[bool], list[Class]]:
        """Tell of every class whether its interval has the truth, and which signs are wrong."""
        inside, wrong = [], []
        for key in self.classes:
            true, ours, std = self.both(key)
            if max(rms(true), rms(ours)) < LEAST:
                continue
            reach = CLEAR * float(np.hypot(std, OWN * rms(true)))
            inside.append(abs(signed(true) - signed(ours)) <= reach)
            if (
                rms(ours) > CLEAR * std
                and rms(true) > 2 * LEAST
                and signed(true) * signed(ours) < 0
            ):
                wrong.append(key)
        return inside, wrong


def row(name: str, scores: list[BudgetScore]) -> dict[str, str]:
    """Return the figures of some structures."""
    firsts = [(one.first(1), one.first(2)) for one in scores]
    found = [key in stated for _, (true, stated) in firsts for key in true]
    inside = [one for score in scores for one in score.intervals()[0]]
    ratios = [score.ratio for score in scores]
    return {
        "structures": name,
        "top class right": f"{sum(t == s for (t, s), _ in firsts)} of {len(scores)}",
        "of two largest": f"{sum(found)} of {len(found)}",
        "vector error, used": f"{np.mean([one.error(one.used) for one in scores]):.2f}",
        "held out": f"{np.mean([one.error(~one.used) for one in scores]):.2f}",
        "in the 90 % interval": f"{sum(inside)} of {len(inside)}",
        "wrong signs": str(sum(len(one.intervals()[1]) for one in scores)),
        "unseen error, of the handbook's": f"{np.exp(np.mean(np.log(ratios))):.2f}",
        "worst": f"{max(ratios):.2f}",
    }


def advice_row(name: str, scores: list[BudgetScore]) -> dict[str, str]:
    """Return what one more mode does to the budgets of some structures, as geometric means."""
    ranks = [1 + int((np.array(one.after) < one.after[0]).sum()) for one in scores]
    best_two, alone = sum(rank <= 2 for rank in ranks), len(scores) == 1
    figures = {
        "error of held-out modes without, %": [rms(one.left[~one.used]) for one in scores],
        "with it": [one.after[0] for one in scores],
        "with the best": [min(one.after) for one in scores],
        "of those still unseen, of the handbook's": [one.ratio_with for one in scores],
    }
    return {
        "structure": name,
        "held out": str(sum(len(one.after) for one in scores)),
        "advised": str(scores[0].budget.modes[scores[0].advised].mode) if alone else "",
        "its rank": str(ranks[0]) if alone else f"of the best two in {best_two} of {len(ranks)}",
        **{key: f"{np.exp(np.mean(np.log(values))):.2f}" for key, values in figures.items()},
    }


def merged(text: str, mark: str, order: list[str], fresh: dict[str, dict[str, str]]) -> str:
    """Return a page with fresh rows in a table, the others as they stand."""
    old, keys = {}, list(next(iter(fresh.values())))
    for line in text.partition(f"<!-- {mark} -->")[2].partition("<!-- /")[0].splitlines():
        if cells := [cell.strip() for cell in line.strip("|").split("|")]:
            old[cells[0]] = cells
    there = [name for name in order if name in fresh or name in old]
    rows = [fresh.get(name) or dict(zip(keys, old[name], strict=True)) for name in there]
    print(as_markdown(rows))
    return filled(text, as_markdown(rows), mark)


def main() -> None:
    """Write the tables, or show one structure."""
    truths = [read_lacks(file) for file in sorted(LACKS.glob("*.toml"))]
    scores = [BudgetScore(truth) for truth in truths if not truth.refused]
    for score in scores:
        if score.truth.structure in sys.argv[1:]:
            for key in score.classes:
                true, ours, std = score.both(key)
                print(*key, "truth", true.round(1), "budget", ours.round(1), f"± {std:.2f}")
    run = "held" if sys.argv[1:] == ["held"] else "development"
    if sys.argv[1:] and run != "held":
        return
    named = {}
    for half in HALVES:
        own = [score for score in scores if score.truth.held == (half == "held")]
        named[half] = {f"{half} ({len(own)})": own, **{f"`{s.truth.structure}`": [s] for s in own}}
    order = [next(iter(names)) for names in named.values()]
    order += [name for names in named.values() for name in list(names)[1:]]
    text = PAGE.read_text(encoding="utf-8")
    for mark, make in ((MARK, row), (ADVICE, advice_row)):
        text = merged(text, mark, order, {n: make(n, own) for n, own in named[run].items()})
    PAGE.write_text(text, encoding="utf-8")


HALVES = ("held", "development")

if __name__ == "__main__":
    main()
