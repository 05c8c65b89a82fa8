"""A strategy checked, run and compared, ready for a public leaderboard: ``bench submit``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.files import check_writable
from femubench.core.library.cases import as_list, usable_plugins, way_of
from femubench.core.library.compare import compare
from femubench.core.library.plugins import check
from femubench.core.library.publish import refusal_of
from femubench.core.library.rank import Run, plan_run, read_run
from femubench.core.library.report import render_report, rendering, report, reporter
from femubench.core.pace import OnAdvance
from femubench.core.run.executor import open_executor
from femubench.core.run.handed_in import name_answers, write_answers
from femubench.core.run.runner import Receivers
from femubench.core.schema.results import JobName
from femubench.core.schema.run_options import Where

if TYPE_CHECKING:
    from femubench.core.score.comparison import Comparison, Threshold

_NO_ANSWER = ("crashed", "timeout")
_MOST_NAMED = 3


@dataclass(frozen=True)
class SubmissionReview:
    """A run that may go to a leaderboard, and what stands against it.

    Arguments:
        faults: why it should not go there, a line each; none where all is well.
        unverified: why a leaderboard would take it as unverified alone; empty where not.
        comparison: with the baseline, where there is one.
    """

    run: Run
    faults: tuple[str, ...]
    unverified: str
    comparison: Comparison | None


def submit(
    strategies: str | Iterable[str],
    cases: Iterable[str | PathLike[str]],
    given: Mapping[str, Any],
    where: Where,
    *,
    output: str | PathLike[str],
    baseline: str | PathLike[str] | None = None,
    fail: Iterable[str | Threshold] = (),
    tell: Callable[[str], None] = lambda line: None,
    on_advance: OnAdvance | None = None,
) -> SubmissionReview:
    """Check strategies, run them, compare them with an earlier run, and write the result file.

    Arguments:
        cases: names or folders; the default set where there is none.
        given, where: options of the run, and where it is computed, from `split_keywords`.
        output: the file that `publish` takes. Next to it comes one with the updated models, of the
            same name but for ``.answers``.
        baseline: the result file of an earlier run; without one nothing is compared.
        fail: what counts as worse, as in `compare`.
        tell: is given a line at the start of every step.
        on_advance: how far the run is, and how long the rest takes.

    Raises:
        InputError: for an unknown name, a faulty case or baseline, or no job in common with it.
    """
    names = [str(name) for name in as_list(strategies)]
    file = Path(output)
    check_writable(file)
    if baseline is not None and not Path(baseline).is_file():
        what = "there is no such file"
        raise InputError(what, file=Path(baseline), expected="a result file")
    before = None if baseline is None else read_run(baseline)
    faults = []
    for name in names:
        tell(f"check {name}")
        rules = [item for item in check(name) if item.verdict.status == "fail"]
        faults += [f"{name} breaks the rule {r.check.name}: {r.verdict.message}" for r in rules]
    tell(f"run {', '.join(names)}")
    plan = plan_run(list(cases), names, usable_plugins(), given)
    with open_executor(where) as executor:
        answers: dict[JobName, bytes] = {}
        receivers = Receivers(advance=on_advance, keep_answer=answers.__setitem__)
        run = Run.of(plan.run(executor, receivers))
    write_answers(name_answers(file), run, answers)
    report(run, file, style="json")
    faults += _unanswered(run, names)
    found = None
    if before is not None:
        tell(f"compare with {baseline}")
        found = compare(before, run, strategies=names, fail=fail)
        faults += _losses(found)
    tell(f"check {file} as a leaderboard does")
    return SubmissionReview(run, tuple(faults), refusal_of(file), found)


def _unanswered(run: Run, names: Iterable[str]) -> Iterator[str]:
    """Yield strategies with jobs that ended their process or had to be ended."""
    for name in names:
        own = [item for item in run.results if item.strategy == name]
        for status in _NO_ANSWER:
            cases = list(dict.fromkeys(item.case for item in own if item.status == status))
            if cases:
                what = "crashed" if status == "crashed" else "ran out of time"
                left = len(cases) - _MOST_NAMED
                more = f" and {count_noun(left, 'more case')}" if left > 0 else ""
                yield f"{name} {what} on {', '.join(cases[:_MOST_NAMED])}{more}"


def _losses(found: Comparison) -> Iterator[str]:
    """Yield what is worse than in the baseline, over all cases where that says it."""
    whole = [item for item in found.excesses if item.scenario is None]
    for item in whole or found.excesses:
        where = "" if item.scenario is None else f" on {item.scenario}"
        names = {"failures": "lost results", "loss": "loss of gain"}
        was = names.get(item.metric, f"{item.metric}, as a ratio")
        figures = f"{was}: {item.value:.3g}, allowed {item.most:g}"
        yield f"{item.strategy} is worse than the baseline{where}: {figures}"


def summary_of(found: SubmissionReview) -> str:
    """Return what came out in Markdown: the verdict, the ranking, the comparison."""
    markdown = reporter(usable_plugins(), "markdown")
    verdict = "not accepted" if found.faults else "accepted"
    lines = list(found.faults)
    if found.unverified:
        lines.append(f"a leaderboard takes it as unverified alone: {found.unverified}")
    if found.comparison is None:
        lines.append("no baseline: commit the result file to have the next run compared with it")
    parts = [way_of("markdown", "render_list")(f"Submission: {verdict}", lines)]
    if found.comparison is not None:
        parts.append(str(rendering(found.comparison, "markdown")))
    parts.append(str(render_report(markdown, found.run)))
    return "\n\n".join(parts) + "\n"
