"""Diagnose every case whose truth comes from outside; write figures of docs/diagnosis-accuracy.md.

python benchmarks/truth_sweep.py run --jobs 2         # appends, goes on where it stopped
python benchmarks/truth_sweep.py run --reference      # with the measurement before the defect
python benchmarks/truth_sweep.py run --set opensees   # the second generator; shear: the third
python benchmarks/truth_sweep.py run --drawing solid  # on another drawing, where there is one
python benchmarks/truth_sweep.py tables               # of each run: [--reference] [--set SET] ...
python benchmarks/truth_sweep.py ceiling              # what the data could name: [--set SET]
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from statistics import median
from types import FrameType
from typing import Any, TypeVar

import pandas as pd
from threadpoolctl import threadpool_limits

sys.path.insert(0, str(Path(__file__).parents[1]))  # the truths are not installed

from blind_sweep import Record
from ceiling import CLASSES, GROUPED, NAMEABLE, ceiling
from drawn_truth import same_in_groups, truth_in_groups
from stated_probabilities import (
    Statement,
    calibration_rows,
    coverage_rows,
    fault_rows,
    percent,
    statements,
    wilson,
)
from sweep_data import DATA, PAGE, as_markdown, each, filled, write_rows
from true_fit import CataloguedCause, fits_of, fits_worse, is_search_fault

from femubench import Model, read_case
from femubench.core.challenge.answer import Answer, AnswerCause
from femubench.core.challenge.outcome import (
    OUTCOMES,
    Same,
    counts_as_right,
    is_finding,
    outcome,
    record_of,
    same_place,
    size_errors,
)
from femubench.core.challenge.posing import HEALTHY
from femubench.core.challenge.truth_file import TRUTH_FILE, KnownCase, read_truth
from femubench.core.diagnosis.result import Diagnosis
from femubench.core.plugin.loader import load_plugins
from femubench.core.schema.validation import read_plain
from truths.posing import (
    DEFECTS,
    FAULTS,
    OPENSEES,
    SHEAR,
    SHEAR_STRUCTURES,
    STRUCTURES,
    SUITE,
    pose,
)

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "femubench-results" / "truth-sweep.jsonl"
MARK = "truth-sweep"
CEILING = "sweep-ceiling.csv"
SURE = 0.99
HALVES = {"development": False, "held": True}
# Truths and their structures.
SETS = {
    "solids": ((DEFECTS,), SUITE),
    "faults": ((FAULTS,), SUITE),
    "opensees": ((OPENSEES,), STRUCTURES),
    "shear": ((SHEAR,), SHEAR_STRUCTURES),
}
# Upper ends of the ranges of chi-square.
EDGES = (9.0, 30.0, 100.0, 1000.0, math.inf)
RANGES = ("< 9", "9 to 30", "30 to 100", "100 to 1000", "> 1000")
KIND_ORDER = ("defect", "pair", "clean", "outside")


class TooLong(BaseException):
    """A case took more processor time than it may; nothing on the way catches it."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Stop what is in the block after so much processor time, whatever else the machine does."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@dataclass(frozen=True)
class Task:
    """A case of the sweep.

    Arguments:
        folder: of its truth.
        suite: where the structures are.
        reference: whether it brings the healthy structure's measurement.
        seconds: of processor time that it may take.
        ideal: whether it is asked what its data could name, and not diagnosed.
        drawing: whose model is diagnosed; that of `case.toml` where empty.
    """

    folder: Path
    suite: Path
    reference: bool
    seconds: float
    ideal: bool = False
    drawing: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Return its name and a hash over what is diagnosed."""
        with tempfile.TemporaryDirectory() as scratch:
            target = Path(scratch, "case")
            pose(self.folder, target, self.reference, suite=self.suite)
            total = hashlib.sha256()
            for path in sorted(target.iterdir()):
                content = path.read_bytes()
                total.update(f"{path.name}\0{len(content)}\0".encode() + content)
        return self.folder.name, total.hexdigest()[:16]


def diagnosed(task: Task, key: tuple[str, str]) -> Record:
    """Return the record of one case, on one thread; a failure is a record too."""
    from femubench.core.diagnosis.diagnose import diagnose

    record: Record = {"name": key[0], "digest": key[1], "verdict": "error"}
    diagnosis: Diagnosis | None = None
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as scratch, threadpool_limits(1):
        target = Path(scratch, "case")
        truth = pose(task.folder, target, task.reference, suite=task.suite)
        try:
            with warnings.catch_warnings(record=True) as caught, limited(task.seconds):
                warnings.simplefilter("default")
                case = read_case(target / f"{task.drawing}.toml" if task.drawing else target)
                if task.ideal:
                    for cells in ceiling(case, truth, load_plugins().effects):
                        record |= cells
                        record["verdict"] = record["class"]
                else:
                    diagnosis = diagnose(case)
            record["warnings"] = sorted({str(warning.message)[:80] for warning in caught})
            if diagnosis is not None:
                record |= record_of(Answer.of(diagnosis))
                record["chi2"] = list(diagnosis.chi2)
                record["adequacy_p"] = diagnosis.adequacy_p
        except TooLong:
            record["verdict"] = "too-long"
        except Exception as error:  # a fault of the diagnosis is a finding of the sweep
            record["error"] = f"{type(error).__name__}: {error}"
    record["seconds"] = round(time.process_time() - begin, 2)
    if diagnosis is not None:
        same, truth = words_of(task.suite, truth, task.drawing)
        with suppress(TooLong), limited(task.seconds), threadpool_limits(1):
            record |= _fits(diagnosis, truth, same)
    return record


@cache
def _same_in(suite: Path, structure: str, drawing: str) -> tuple[Same, Model | None]:
    """Return what compares places in a drawing of a structure, and that drawing in groups."""
    model = read_case(suite / structure).model
    if drawing:
        drawn = read_case(suite / structure / f"{drawing}.toml").model
        return same_in_groups(drawn, model), drawn
    return same_place(model.structure.frame if model.structure is not None else None), None


def words_of(suite: Path, truth: KnownCase, drawing: str) -> tuple[Same, KnownCase]:
    """Return what compares places in a drawing, and a truth in the words of that drawing."""
    same, drawn = _same_in(suite, truth.structure, drawing)
    return same, truth if drawn is None else truth_in_groups(truth, drawn)


def _fits(diagnosis: Diagnosis, truth: KnownCase, same: Same) -> Record:
    """Return how the true causes fit next to what was found; nothing where there are none."""
    if diagnosis.examination is None or truth.kind not in ("defect", "pair"):
        return {}
    # A true size is one parameter's; where an effect has more, the others are not known.
    causes = [
        [
            CataloguedCause(effect, place, () if cause.size is None or i else (cause.size,))
            for i, (effect, place) in enumerate(cause.findings)
        ]
        for cause in truth.causes
    ]
    return fits_of(diagnosis.examination, causes, load_plugins().effects, same)


def read_records(path: Path) -> dict[str, Record]:
    """Return the last record of every case; a line that was cut off is left out."""
    records: dict[str, Record] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        records[record["name"]] = record
    return records


def truth_folders(*rooms: Path) -> list[Path]:
    """Return the folders with a truth."""
    return [file.parent for room in rooms for file in sorted(room.glob(f"*/{TRUTH_FILE}"))]


def run(path: Path, tasks: Sequence[Task], jobs: int) -> None:
    """Diagnose what is not in the results file yet, or has changed since; append a line a case."""
    known = read_records(path)
    keyed = [(task, task.key) for task in tasks]
    rest = [(task, key) for task, key in keyed if not is_of(known.get(key[0]), key)]
    path.parent.mkdir(parents=True, exist_ok=True)
    print(f"{len(keyed) - len(rest)} of {len(keyed)} cases are in {path}", file=sys.stderr)
    with path.open("a") as stream:
        for i, record in enumerate(each(diagnosed, rest, jobs), 1):
            stream.write(json.dumps(record) + "\n")
            stream.flush()
            said = record.get("error", record["verdict"])
            seconds = f"{record['seconds']:.0f} s"
            print(f"{i}/{len(rest)} {record['name']}: {said}, {seconds}", file=sys.stderr)


def is_of(record: Record | None, key: tuple[str, str]) -> bool:
    """Tell whether a record is of a case as it is now."""
    return record is not None and (record["name"], record["digest"]) == key


def reach(truth: KnownCase) -> str:
    """Return the range of the visibility of a truth; a dash where it has none.

    A mode that appears among the used ones cannot be overlooked, whatever the others do.
    """
    if truth.chi2 is None:
        return "-"
    if truth.appears:
        return RANGES[-1]
    return next(word for word, edge in zip(RANGES, EDGES, strict=True) if truth.chi2 < edge)


def kind_of(truth: KnownCase) -> str:
    """Return the row of a truth: faults of the data by what they are, all others by kind."""
    return truth.causes[0].effect if truth.kind.endswith("-fault") else truth.kind


@dataclass(frozen=True)
class Scored:
    """A truth and what was said of it.

    Arguments:
        truth: of the case.
        said: one of `OUTCOMES`.
        sure: whether the verdict states a probability of at least `SURE`.
        companions: what was said of the structure next to faults of data and input.
        stated: probabilities of names and places.
        deviations: of sizes that were found, from the true ones, in stated deviations.
        fits: whether the answer fits worse than the truth, and whether by a fault of the search;
            None where the truth was not fitted.
        seconds: of one core.
        ceiling: the class of what the data could name; empty where it is not known.
    """

    truth: KnownCase
    said: str
    sure: bool
    companions: str = ""
    stated: tuple[Statement, ...] = ()
    deviations: tuple[float, ...] = ()
    fits: tuple[bool, bool] | None = None
    seconds: float = 0.0
    ceiling: str = ""


def scored(
    records: Mapping[str, Record], truths: Iterable[KnownCase], suite: Path, drawing: str = ""
) -> list[Scored]:
    """Return what was said of every truth that has a record."""

    found = []
    for truth in truths:
        if truth.name in records:
            record = records[truth.name]
            places, truth = words_of(suite, truth, drawing)
            said = outcome(truth, record, places)
            sure = (record.get("probability") or 0.0) >= SURE
            worse = fits_worse(record)
            found.append(
                Scored(
                    *(truth, said, sure, describe_structure(record)),
                    stated=tuple(stated(truth, record, places)),
                    deviations=tuple(
                        size.deviations
                        for size in size_errors(truth, record, places)
                        if size.deviations is not None
                    ),
                    fits=None if worse is None else (worse, bool(is_search_fault(record))),
                    seconds=record.get("seconds", 0.0),
                )
            )
    return found


def describe_structure(record: Record) -> str:
    """Return what is said of the structure apart from faults of data and input."""
    verdict = str(record["verdict"])
    if verdict not in ("named", "ambiguous"):
        return verdict.replace("-", " ")
    causes = read_plain(Answer, record["answer"]).causes
    return "a cause" if any(cause.side == "model" for cause in causes) else "none"


def stated(truth: KnownCase, record: Record, same: Same) -> list[Statement]:
    """Return the probabilities of names and places in a record, and whether they are right.

    What is taken at the textbook value counts neither way; where the data or what was typed in
    are wrong, their faults count alone.
    """
    if "answer" not in record:
        return []
    wanted = {effect for cause in truth.causes for effect, _ in cause.findings}
    textbook = set(record.get("textbook", ())) - wanted

    def is_placed(effect: str, place: str) -> bool:
        return any(is_finding((effect, place), cause, same) for cause in truth.causes)

    def counts(cause: AnswerCause) -> bool:
        faulty = truth.kind.endswith("-fault")
        return cause.side != "model" if faulty else cause.effect not in textbook

    answer = read_plain(Answer, record["answer"])
    return statements(answer, wanted.__contains__, is_placed, counts)


def outcome_row(first: Mapping[str, str], cases: Sequence[Scored]) -> dict[str, str]:
    """Return the row of a table of outcomes: how many of each, and the share that counts."""
    right = sum(counts_as_right(case.truth, case.said) for case in cases)
    low, high = wilson(right, len(cases))
    row = {**first, "cases": str(len(cases))}
    for word in OUTCOMES:
        if word == "wrong":
            row[f"wrong, P >= {SURE:g}"] = str(sum(c.said == word and c.sure for c in cases))
        row[word] = str(sum(case.said == word for case in cases))
    share = f"{100.0 * right / len(cases):.0f} % ({100.0 * low:.0f} to {100.0 * high:.0f})"
    return {**row, "counts as right": share}


def outcome_rows(
    by: str, group: Callable[[KnownCase], str], cases: Iterable[Scored], order: Sequence[str] = ()
) -> list[dict[str, str]]:
    """Return one row a group of cases, in a given order or by name."""
    groups: dict[str, list[Scored]] = {}
    for case in cases:
        groups.setdefault(group(case.truth), []).append(case)
    names = ranked(groups, order)
    return [outcome_row({"by": by, "group": name}, groups[name]) for name in names]


def ranked(names: Iterable[str], order: Sequence[str]) -> list[str]:
    """Return names in a given order, then all others by the alphabet."""
    known = set(names)
    first = [name for name in order if name in known]
    return [*first, *sorted(known - set(first))]


def visibility_rows(truths: Iterable[KnownCase]) -> list[dict[str, str]]:
    """Return how many cases of each kind change the data by how much."""
    kinds: dict[str, list[str]] = {}
    for truth in truths:
        kinds.setdefault(kind_of(truth), []).append(reach(truth))
    return [
        {
            "kind": name,
            "cases": str(len(kinds[name])),
            **{word: str(kinds[name].count(word)) for word in (*RANGES, "-")},
        }
        for name in ranked(kinds, KIND_ORDER)
    ]


def half(cases: Sequence[Scored]) -> dict[str, list[dict[str, str]]]:
    """Return the rows of one half of the cases by the name of their table."""
    single = [case for case in cases if case.truth.kind == "defect"]
    found = [case for case in cases if case.truth.chi2 is not None and case.truth.causes]
    faulty = [case for case in cases if case.truth.kind.endswith("-fault")]
    fits = by_kind(cases, lambda case: () if case.fits is None else (case.fits,))
    return {
        "outcomes": [
            *outcome_rows("kind", kind_of, cases, KIND_ORDER),
            *outcome_rows("effect", lambda truth: truth.causes[0].effect, single),
            *outcome_rows("chi-square", reach, found, RANGES),
        ],
        "structure": structure_rows(faulty),
        "calibration": calibration_rows([one for case in cases for one in case.stated]),
        "sizes": coverage_rows(by_kind(cases, lambda case: case.deviations)),
        "fits": fault_rows(fits),
    }


def strict_rows(cases: Sequence[Scored]) -> list[dict[str, str]]:
    """Return the shares that matter: one name at one place, groups apart, and the seconds."""

    def of(*kinds: str) -> list[Scored]:
        return [case for case in cases if case.truth.kind in kinds]

    faults = of("data-fault", "input-fault")
    clear = [case for case in cases if case.ceiling == NAMEABLE]
    known = [case for case in cases if case.ceiling in (NAMEABLE, GROUPED)]
    named, grouped = ("right",), ("right", "in the group")
    # A pair that is named by half says nothing that is not so.
    untrue = ("wrong", "other place", "with others")
    figures = (
        ("one defect: named with its place, alone", of("defect"), named),
        ("one defect: so, or in a group", of("defect"), grouped),
        ("two defects: both so, or in a group", of("pair"), grouped),
        ("what the data could name: named with its place, alone", clear, named),
        ("what they could name or group: so, or in a group", known, grouped),
        ("sound: none", of("clean"), ("none",)),
        ("outside the catalogue: flagged", of("outside"), (*grouped, "unknown", "not confirmed")),
        ("fault of data or input: named with its place", faults, named),
    )
    rows = [
        {
            "figure": name,
            "cases": str(len(own)),
            **percent(sum(c.said in said for c in own), len(own)),
        }
        for name, own, said in figures
        if own
    ]
    sure = sum(case.sure and case.said in untrue for case in cases)
    head = f"all: not so, with P >= {SURE:g} stated"
    rows.append({"figure": head, "cases": str(len(cases)), **percent(sure, len(cases))})
    seconds = sorted(case.seconds for case in cases)
    taken = f"median {median(seconds):.1f}, slowest {seconds[-1]:.0f}"
    rows.append({"figure": "seconds of one core", "cases": str(len(cases)), "right": taken})
    return [{("share" if key == "right" else key): v for key, v in r.items()} for r in rows]


V = TypeVar("V")


def by_kind(cases: Iterable[Scored], values: Callable[[Scored], Sequence[V]]) -> dict[str, list[V]]:
    """Return some values of all cases by kind."""
    found: dict[str, list[V]] = {}
    for case in cases:
        found.setdefault(kind_of(case.truth), []).extend(values(case))
    return {kind: found[kind] for kind in ranked(found, KIND_ORDER)}


def structure_rows(cases: Sequence[Scored]) -> list[dict[str, str]]:
    """Return the verdict on the structure where the fault was named, and where it was not."""
    rows = []
    usual = ("none", "a cause", "unknown", "not confirmed")
    words = ranked((*usual, *(case.companions for case in cases)), usual)
    for head, chosen in (("named", True), ("not named", False)):
        own = [
            case.companions for case in cases if (case.said in ("right", "with others")) is chosen
        ]
        rows.append({"fault": head, "cases": str(len(own))} | {w: str(own.count(w)) for w in words})
    return rows if cases else []


def tables(cases: Sequence[Scored], truths: Sequence[KnownCase]) -> dict[str, list[dict[str, str]]]:
    """Return the rows of all tables by name; the outcomes of the two halves stay apart.

    Arguments:
        cases: what has a record.
        truths: all that there are.
    """
    found: dict[str, list[dict[str, str]]] = {"visibility": visibility_rows(truths)}
    for name, is_held in HALVES.items():
        own = [case for case in cases if case.truth.held is is_held]
        for table, rows in half(own).items() if own else ():
            found.setdefault(table, []).extend({"half": name, **row} for row in rows)
    return found


def strict_table(cases: Sequence[Scored]) -> str:
    """Return the strict figures of both halves next to each other."""
    rows: dict[str, dict[str, str]] = {}
    for name, is_held in HALVES.items():
        own = [case for case in cases if case.truth.held is is_held]
        for row in strict_rows(own) if own else ():
            cells = {f"{name}: {key}": v for key, v in row.items() if key != "figure"}
            rows.setdefault(row["figure"], {"figure": row["figure"]}).update(cells)
    return as_markdown(rows.values())


def ceiling_rows(records: Mapping[str, Record], folders: Iterable[Path]) -> list[dict[str, str]]:
    """Return one row a truth: what its data could name, and what else would explain them best."""
    rows = []
    for folder in folders:
        if folder.name in records:
            truth, record = read_truth(folder), records[folder.name]
            cells = {"class": record["verdict"], **record, "kind": truth.kind}
            cells["half"] = next(name for name, held in HALVES.items() if held is truth.held)
            cells["chi2"] = f"{record['chi2']:.4g}" if "chi2" in record else ""
            columns = "name", "half", "kind", "class", "twice", "chi2", "rival"
            rows.append({column: str(cells.get(column, "")) for column in columns})
    return rows


def ceiling_table(path: Path) -> str:
    """Return how many truths are of each class, by set and half; with twice the modes in brackets.

    Arguments:
        path: of the table with one row a truth.
    """
    known = pd.read_csv(path, dtype=str, keep_default_na=False)
    rows = []
    for (name, half_of), own in known.groupby(["run", "half"]):
        counts = {c: f"{(own['class'] == c).sum()} ({(own['twice'] == c).sum()})" for c in CLASSES}
        rows.append({"set": name, "half": half_of, "truths": str(len(own)), **counts})
    return as_markdown(rows)


def fill(page: Path, text: str, mark: str) -> None:
    """Write a text between its markers on a page."""
    page.write_text(filled(page.read_text(encoding="utf-8"), text, mark), encoding="utf-8")


def parser() -> argparse.ArgumentParser:
    """Return the command line."""
    found = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    found.add_argument("what", choices=("run", "tables", "ceiling"))
    found.add_argument("names", nargs="*", help="cases; all by default")
    found.add_argument("--jobs", type=int, default=2, help="processes")
    found.add_argument("--reference", action="store_true", help="with the healthy structure")
    found.add_argument("--seconds", type=float, default=120.0, help="processor time a case")
    found.add_argument("--results", type=Path, help=f"{RESULTS.relative_to(ROOT)} by default")
    found.add_argument("--set", choices=tuple(SETS), default="solids", help="of truths")
    found.add_argument("--drawing", default="", help="in groups; that of case.toml by default")
    found.add_argument("--suite", type=Path, help="where the structures are; that of the set")
    found.add_argument("--truths", type=Path, nargs="*", help="folders of truths; the set's")
    found.add_argument("--page", type=Path, default=PAGE)
    found.add_argument("--data", type=Path, default=DATA, help="folder of the tables")
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the sweep, or write its figures."""
    known = parser()
    options: Any = known.parse_args(arguments)
    rooms, suite = SETS[options.set]
    options.truths, options.suite = options.truths or rooms, options.suite or suite
    every = folders = truth_folders(*options.truths)
    ideal = options.what == "ceiling"
    options.reference |= ideal
    if unknown := set(options.names) - {folder.name for folder in folders}:
        known.error(f"no case {sorted(unknown)[0]!r} in {', '.join(map(str, options.truths))}")
    if options.names:
        folders = [folder for folder in folders if folder.name in options.names]
    if options.drawing:
        drawn = {p.parent.name for p in options.suite.glob(f"*/{options.drawing}.toml")}
        folders = [f for f in folders if read_truth(f).structure in drawn]
    if options.reference:
        folders = [folder for folder in folders if (folder / HEALTHY).is_file()]
    drawing = options.drawing and f"-{options.drawing}"
    run_of = (
        ("" if options.set == "solids" else f"-{options.set}")
        + drawing
        + ("-ceiling" if ideal else "-reference" if options.reference else "")
    )
    results = options.results or RESULTS.with_stem(RESULTS.stem + run_of)
    on = options.suite, options.reference, options.seconds, ideal, options.drawing
    tasks = [Task(folder, *on) for folder in folders]
    table = options.data / CEILING
    if options.what != "tables":
        run(results, tasks, options.jobs)
        if ideal:
            write_rows(table, options.set, ceiling_rows(read_records(results), every))
            fill(options.page, ceiling_table(table), "ceiling")
        return
    truths = [read_truth(folder) for folder in folders]
    keys = dict(task.key for task in tasks)
    records = read_records(results)
    records = {n: r for n, r in records.items() if n in keys and is_of(r, (n, keys[n]))}
    cases = scored(records, truths, options.suite, options.drawing)
    if (options.reference or drawing) and table.is_file():
        rows = pd.read_csv(table, dtype=str, keep_default_na=False).query("run == @options.set")
        classes = dict(zip(rows["name"], rows["class"], strict=True))
        cases = [replace(c, ceiling=classes.get(c.truth.name, "")) for c in cases]
    if not cases:
        known.error(f"no results in {results}: run the sweep first")
    name = options.set + drawing + ("-reference" if options.reference else "")
    for what, rows in tables(cases, truths).items():
        write_rows(options.data / f"sweep-{what}.csv", name, rows)
    fill(options.page, strict_table(cases), MARK + run_of)
    print(f"{len(cases)} of {len(truths)} cases, {options.page}, {options.data}")


if __name__ == "__main__":
    main()
