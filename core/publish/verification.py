"""What of a run can be checked here: cases, twins, measured figures, errors, scores, all jobs.

Where the answers of the strategies come along, their errors are computed again too; else they are
what the file states. That an answer came out of the strategy it is said to be of, a sample that is
run again shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn, Protocol

from femubench.core.case.case import Case
from femubench.core.errors import InputError
from femubench.core.publish.rerun import Sample
from femubench.core.run.executor import count_workers
from femubench.core.run.handed_in import judge_answers, name_answers
from femubench.core.run.provenance import plan_digest
from femubench.core.schema.records import Models
from femubench.core.schema.results import BLOCKS, JobResult, RunData
from femubench.core.score.bounded_gain import Rule
from femubench.core.score.leaderboard import list_rows
from femubench.core.score.ranking import Scale, rank_results
from femubench.core.score.scoring import reference_of
from femubench.core.twin.twins import AGAIN, Twin, again

SANDBOX = "namespaces"  # what a run calls the one that it can have
_AGAIN = "run it again with this version of femubench"
_FEWEST_TWINS = 2  # with fewer, chance could be taken for knowledge
_SAME = 1e-9  # relative, of measured figures, which a twin has times a factor
_ROUNDING = 1e-6  # relative, of errors that are computed again on another machine

Marks = Mapping[tuple[str, str | None, int], float]  # measured Hz by block, modification, number


class Installed(Protocol):
    """The cases of this installation."""

    def case(self, name: str) -> Case | None:
        """Return a case by its name; None where there is none."""
        ...

    def classes(self, name: str) -> Sequence[str]:
        """Return the kinds of structure and of truth of a case."""
        ...

    def twins(self, cases: Sequence[Case], number: int, seed: int) -> Sequence[Twin]:
        """Return the twins that a run of these cases draws from a seed."""
        ...

    def yardstick(self, case: Case) -> Case:
        """Return a case with the model that all errors are measured against."""
        ...


@dataclass(frozen=True)
class _Known:
    """What this installation says of a case: measured figures, nominal errors, its scale."""

    measured: Marks
    reference: Mapping[str, float]
    scale: Scale

    @classmethod
    def of(cls, case: Case, installed: Installed) -> _Known:
        found = reference_of(installed.yardstick(case))
        measured = {
            (name, mode.modification, mode.number): mode.measured_hz
            for name, block in found.blocks.items()
            for mode in block.modes
        }
        models: Models = {case.name: {"textbook": found.blocks}}
        return cls(measured, found.rms_percent, Scale.of_models(models, Rule(), "textbook"))


def verify(
    run: RunData,
    data: Mapping[str, Any],
    file: Path,
    *,
    installed: Installed,
    sample: Sample | None,
) -> bool:
    """Check everything that a run says; tell whether its errors were computed again.

    They are where a file with its answers stands next to its own. What it says of its sandbox is
    its contributor's word.

    Arguments:
        sample: runs some jobs again of a run whose errors were computed again.

    Raises:
        InputError: naming the first thing that is wrong or cannot be checked, and what to do.
    """
    if run.meta.get("yardstick") != "textbook":
        what = "errors are not measured against the textbook models"
        _refuse(file, what, "meta.yardstick", _AGAIN)
    usual = run.meta.get("sandbox")
    jobs = chain(run.results, run.companions)
    each = (result.provenance.get("sandbox", usual) for result in jobs)
    if any(one != SANDBOX for one in (usual, *each)):
        what = "the strategies ran without a sandbox"
        _refuse(file, what, "meta.sandbox", "a run with `--sandbox require`, or --unverified")
    if Rule.of(run.meta) != Rule():
        _refuse(file, "gains by another rule", "meta.rule", _AGAIN)
    cases = _own_cases(run, installed, file)
    twins = _own_twins(run, list(cases.values()), installed, file)
    _check_complete(run, file)
    known = {name: _Known.of(case, installed) for name, case in (cases | twins).items()}
    # The nominal errors, which every gain is relative to.
    scale = Scale.of(run.meta)
    for key, stated, names in (
        ("meta.reference", run.meta["reference"], run.meta["cases"]),
        ("meta.twins.reference", run.meta["twins"]["reference"], run.meta["twins"]["of"]),
    ):
        for name in names:
            errors, right = stated.get(name, {}), known[name].reference
            _check_errors(errors, right, f"{key}.{name}", file)
            predicted, said = known[name].scale.textbook[name], scale.textbook.get(name)
            if said is None or not all(map(_near, astuple(said), astuple(predicted))):
                where = key.replace("reference", "models")
                _refuse(file, "not what the textbook model predicts", f"{where}.{name}", _AGAIN)
    origins = run.meta["twins"]["again"]
    for key, results in (("results", run.results), ("companions", run.companions)):
        for number, result in enumerate(results):
            own = known[origins.get(result.case, result.case)]
            _check_result(result, own, file, f"{key}[{number}]")
    for number, one in enumerate(rank_results(run.results, run.meta)):
        if run.results[number].rank not in (None, one.rank):
            what = f"rank {run.results[number].rank}, the gains give {one.rank}"
            _refuse(file, what, f"results[{number}].rank", _AGAIN)
    _check_board(run, data.get("leaderboard"), file)
    answers = name_answers(file)
    if not answers.exists():
        return False
    repeated = [again(cases[name]) for name in origins.values()]
    listed = {case.name: case for case in (*cases.values(), *twins.values(), *repeated)}
    textbooks = {
        name: new for name, case in listed.items() if (new := installed.yardstick(case)) is not case
    }
    _recompute(run, list(listed.values()), textbooks, file)
    if sample is not None:
        sample.check(run, listed, textbooks, file)
    return True


def _recompute(
    run: RunData, listed: Sequence[Case], textbooks: Mapping[str, Case], file: Path
) -> None:
    """Judge the answers of a run anew, and compare what it says of them."""
    judged = judge_answers(listed, [name_answers(file)], textbooks, count_workers(None), "both")
    found = {(r.case, r.strategy, r.seed, r.nominal): r for r in judged.results}
    for key, results in (("results", run.results), ("companions", run.companions)):
        for number, one in enumerate(results):
            own = found.get((one.case, one.strategy, one.seed, one.nominal))
            if own is None or ("ok" in (one.status, own.status) and not _are_alike(one, own)):
                what = "not the errors of its answer"
                _refuse(file, what, f"{key}[{number}]", f"those that {name_answers(file)} gives")


def _are_alike(one: JobResult, other: JobResult) -> bool:
    stated, found = _judged_figures(one), _judged_figures(other)
    return len(stated) == len(found) and all(map(_near, stated, found))


def _judged_figures(result: JobResult) -> list[float]:
    """Return all that a judge finds of an answer and that counts."""
    modes = [mode for name in BLOCKS if name in result.blocks for mode in result.blocks[name].modes]
    found: list[float | None] = [result.status == "ok", result.rigid_modes_lost]
    found.append(result.negative_eigenvalues)
    found.append(None if result.responses is None else result.responses.rms_db)
    for mode in modes:
        found += [mode.predicted_hz, mode.mac, mode.predicted_std_hz, len(mode.candidates)]
        found += [x for one in mode.candidates for x in (one.hz, one.weight, one.mac)]
    return [math.nan if figure is None else float(figure) for figure in found]


def _refuse(file: Path, what: str, key: str, expected: str) -> NoReturn:
    raise InputError(what, file=file, key=key, expected=expected)


def _own_cases(run: RunData, installed: Installed, file: Path) -> dict[str, Case]:
    """Return the cases of a run as they are installed here, which they have to equal."""
    found = {}
    for name, entry in run.meta["cases"].items():
        case = installed.case(name)
        if case is None:
            what = f"no case {name!r} is installed here, so that nothing of it can be checked"
            _refuse(file, what, f"meta.cases.{name}", "a built-in case, or --unverified")
        if case.digest != entry["digest"]:
            what = f"other files than those of the case {name!r} that is installed here"
            _refuse(file, what, f"meta.cases.{name}.digest", f"{case.digest}: {_AGAIN}")
        structure = (run.meta.get("structures") or {}).get(name)
        if structure != (case.structure or name):
            what = f"{structure!r} is not its structure"
            _refuse(file, what, f"meta.structures.{name}", repr(case.structure or name))
        classes = (run.meta.get("classes") or {}).get(name)  # files of old do not tell them
        if classes and list(classes) != list(installed.classes(name)):
            what = f"{', '.join(map(str, classes))[:80]!r} are not its classes"
            expected = repr(", ".join(installed.classes(name)))
            _refuse(file, what, f"meta.classes.{name}", expected)
        found[name] = case
    return found


def _own_twins(
    run: RunData, cases: Sequence[Case], installed: Installed, file: Path
) -> dict[str, Case]:
    """Return the twins of a run, drawn again from its seed."""
    twins = run.meta.get("twins")
    if not twins or twins["number"] < _FEWEST_TWINS:
        what = f"it has no {_FEWEST_TWINS} twins, which would show who knows the cases"
        expected = f"a run with `--twins {_FEWEST_TWINS}` or more, or --unverified"
        _refuse(file, what, "meta.twins", expected)
    smallest = min(case.model.size for case in cases)
    repeated = [{f"{c.name}{AGAIN}": c.name} for c in cases if c.model.size == smallest]
    if twins["again"] not in repeated:
        _refuse(file, "what ran twice is not its smallest case", "meta.twins.again", _AGAIN)
    drawn = {t.name: t for t in installed.twins(cases, twins["number"], twins["seed"])}
    wanted = {name: twin.digest for name, twin in drawn.items()}
    wanted |= {name: run.meta["cases"][of]["digest"] for name, of in twins["again"].items()}
    stated = {name: entry.get("digest") for name, entry in twins["cases"].items()}
    if lost := sorted(wanted.keys() - stated.keys()):
        _refuse(file, f"there is no {lost[0]}", "meta.twins.cases", "all twins and what ran twice")
    if wanted != stated or twins["of"].keys() != drawn.keys():
        what = f"these are not the twins that seed {twins['seed']} draws"
        _refuse(file, what, "meta.twins", _AGAIN)
    kinds = {name: list(twin.families) for name, twin in drawn.items()}
    if twins.get("kinds") != kinds:
        _refuse(file, "its twins are of other kinds", "meta.twins.kinds", _AGAIN)
    if any(twins["of"][name] != name.rpartition("~")[0] for name in drawn):
        _refuse(file, "they are of other cases", "meta.twins", _AGAIN)
    return dict(drawn)


def _check_complete(run: RunData, file: Path) -> None:
    """Check that every job is there, once: nobody leaves out what did not go well."""
    meta = run.meta
    jobs = {(r.case, r.nominal, r.strategy, r.seed) for r in chain(run.results, run.companions)}
    starts = {name: meta["starts"].get(name, []) for name in meta["cases"]}
    starts |= {name: ["textbook"] for name in (*meta["twins"]["of"], *meta["twins"]["again"])}
    wanted = {
        (case, nominal, strategy, seed)
        for case, nominals in starts.items()
        for nominal in nominals
        for strategy in meta["strategies"]
        for seed in meta["seeds"]
    }
    if jobs != wanted or len(jobs) < len(run.results) + len(run.companions):
        what = f"{len(wanted - jobs)} jobs are missing, {len(jobs - wanted)} are of no plan"
        _refuse(file, what, "results", "all jobs of the run: go on with it by --resume")
    keys = (result.key for result in chain(run.results, run.companions))
    if plan_digest(keys) != meta.get("plan"):
        _refuse(file, "the jobs are not those that the run began with", "meta.plan", _AGAIN)


def _check_errors(
    found: Mapping[str, float], own: Mapping[str, float], key: str, file: Path
) -> None:
    """Check the errors of a textbook model."""
    if found.keys() != own.keys() or not all(_near(found[block], own[block]) for block in own):
        errors = ", ".join(f"{block} {error:.6g} %" for block, error in own.items()) or "none"
        _refuse(file, "not the errors of the textbook model", key, errors)


def _near(one: float, other: float) -> bool:
    return abs(one - other) <= _ROUNDING * (1.0 + abs(other)) or (one != one and other != other)


def _check_result(result: JobResult, known: _Known, file: Path, key: str) -> None:
    """Check measured figures and gain of a result."""
    if result.status != "ok":
        if result.blocks:
            _refuse(file, f"errors of a job that is {result.status}", key, "none")
        return
    found = [
        ((name, mode.modification, mode.number), mode.measured_hz)
        for name, block in result.blocks.items()
        for mode in block.modes
    ]
    if len(found) != len(known.measured) or {mark for mark, _ in found} != set(known.measured):
        _refuse(file, "not the measured modes of its case", key, "each of them once")
    for mark, hertz in found:
        if abs(hertz - known.measured[mark]) > _SAME * known.measured[mark]:
            what = f"{hertz:.9g} Hz was not measured: mode {mark[2]} of block {mark[0]}"
            _refuse(file, what, f"{key}.{mark[0]}", f"{known.measured[mark]:.9g} Hz")
    if result.gain is not None and result.answered:
        own = replace(result, case=next(iter(known.scale.blocks)))
        gain = known.scale.gain(own.case, known.scale.errors(own)).gain
        if not _near(result.gain, gain):
            _refuse(file, f"gain {result.gain:.6g}, its modes give another", f"{key}.gain", _AGAIN)


def _check_board(run: RunData, board: object, file: Path) -> None:
    """Check the gains of the leaderboard that comes with a run, where one does."""
    if board is None:
        return
    own_rows = {str(row["strategy"]): row for row in list_rows(run)}
    rows: Iterable[object] = board if isinstance(board, list) else [board]
    for number, row in enumerate(rows):
        stated = row if isinstance(row, dict) else {}
        own = own_rows.get(str(stated.get("strategy")), {})
        for name in ("gain", "rank"):
            said, right = stated.get(name), own.get(name, "nothing")
            numbers = [x for x in (said, right) if isinstance(x, (int, float))]
            if not (_near(*numbers) if len(numbers) > 1 else said is right is None):
                what = f"{name} {said!r}, the results give {right!r}"[:200]
                _refuse(file, what, f"leaderboard[{number}].{name}", "what its results give")
