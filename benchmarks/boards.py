"""The leaderboards that README and docs print: run, kept in docs/figures, put into the pages.

python benchmarks/boards.py default      # README.md, docs/scenarios.md; minutes on two cores
python benchmarks/boards.py suite        # docs/scenarios.md, the predictive board: docs/scoring.md
python benchmarks/boards.py after        # docs/scenarios.md, what decides on the rule
python benchmarks/boards.py after --from suite.json    # its structures, of a run that has them
"""

from __future__ import annotations

import argparse
import json
import textwrap
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import femubench
from femubench import Run
from femubench.core.display import count_noun
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.core.schema.run_options import StartModels
from femubench.core.score.leaderboard import list_rows
from femubench.reports.predictive import PredictiveReporter
from femubench.reports.runs import board_text
from femubench.reports.summary import finding
from femubench.results import run_to_json

ROOT = Path(__file__).parents[1]
_BEGIN, _END = "<!-- {} -->\n", "<!-- /{} -->"
_META = (
    *("run", "started", "seed", "seeds", "versions", "machine", "cases", "strategies", "baseline"),
    *("structures", "classes", "yardstick", "yardsticks", "starts", "alike", "reference"),
    *("rule", "models"),
)
_BY_CASE = ("cases", "structures", "classes", "starts", "reference", "models")


@dataclass(frozen=True)
class Board:
    """A leaderboard in a page.

    Arguments:
        page: where it stands, between marks of its name.
        which: the structures, for what the README says of them.
        cases: words of `bench run`; the default set where there are none.
        nominal: the models that strategies start from.
        mark: where it stands in the page.
    """

    page: str
    which: str
    cases: tuple[str, ...] = ()
    nominal: StartModels = "both"
    mark: str = "leaderboard"


BOARDS = {
    "default": Board(
        "docs/scenarios.md",
        mark="leaderboard-default",
        which="cases of the default set ([the whole board](docs/scenarios.md#the-default-set))",
    ),
    # What the rule was made with; those after it have the class "after the rule".
    "suite": Board(
        "docs/scenarios.md",
        cases=("suite:before the rule",),
        nominal="textbook",
        which="structures of the suite that were there before the rule ([the board](docs/"
        'scenarios.md#all-strategies-on-all-structures), `bench run "suite:before the rule"`)',
    ),
    "after": Board(
        "docs/scenarios.md",
        cases=("suite:after the rule",),
        nominal="textbook",
        mark="leaderboard-after",
        which="structures of other families that were made after the rule ([the board](docs/"
        "scenarios.md#structures-made-after-the-rule))",
    ),
}


def file_of(name: str) -> Path:
    """Return where the results of a board are kept."""
    return ROOT / "docs" / "figures" / f"board-{name}.json"


def slim(run: Run, cases: Collection[str]) -> Run:
    """Return what the leaderboard of some cases of a run rests on."""
    bare = {"parameters": (), "history": (), "diagnostics": {}, "traceback": "", "key": ""}
    kept = [replace(r, provenance={}, **bare) for r in run.results if r.case in cases]
    meta = {name: run.meta[name] for name in _META if name in run.meta}
    for name in _BY_CASE:
        meta[name] = {case: value for case, value in meta[name].items() if case in cases}
    return Run({**meta, "alike": [c for c in meta["alike"] if c in cases]}, tuple(kept))


def join(one: Run, other: Run) -> Run:
    """Return runs of the same strategies on different cases as one, by name of the case."""
    meta = {name: dict(sorted((one.meta[name] | other.meta[name]).items())) for name in _BY_CASE}
    alike = [*one.meta["alike"], *other.meta["alike"]]
    return Run({**one.meta, **meta, "alike": alike}, one.results + other.results)


def brief(data: Any) -> Any:  # noqa: ANN401 - JSON data of any form
    """Return plain data with seven digits, and without what a reader takes for granted."""
    if isinstance(data, float):
        return float(f"{data:.7g}")
    if isinstance(data, dict):
        needed = ("predicted_hz", "mac", "modes")
        return {
            k: v if k == "rule" else brief(v)
            for k, v in data.items()
            if k in needed or v not in (None, "", [], {})
        }
    return [brief(item) for item in data] if isinstance(data, list) else data


def put(name: str, text: str, page: Path) -> None:
    """Put a text between the marks of a page.

    Raises:
        ValueError: where the page has no such marks.
    """
    before, mark, rest = page.read_text(encoding="utf-8").partition(_BEGIN.format(name))
    _, end, after = rest.partition(_END.format(name))
    if not mark or not end:
        raise ValueError(f"{page} has no marks {name!r}")
    page.write_text(f"{before}{mark}{text}\n{end}{after}", encoding="utf-8")


def said_of(which: str, run: Run) -> str:
    """Return what the README says of some structures, wrapped."""
    said = " ".join(finding(run, list_rows(run)))
    text = f"On the {len(run.meta['cases'])} {which}: {said}"
    return textwrap.fill(text, 118, break_long_words=False, break_on_hyphens=False)


def main() -> None:
    """Run a board, keep it and print it into its page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("board", choices=BOARDS)
    parser.add_argument("--from", dest="file", help="a file of `bench run --json`")
    parser.add_argument("--jobs", type=int, help="worker processes")
    words = parser.parse_args()
    board = BOARDS[words.board]
    if words.file:
        run = femubench.read_run(words.file)
    else:
        run = femubench.rank(board.cases, nominal=board.nominal, jobs=words.jobs)
    run = slim(run, [case.name for case in read_cases(board.cases, load_plugins())])
    text = json.dumps(brief(run_to_json(run)), separators=(",", ":"))
    file_of(words.board).write_text(text.replace('{"case"', '\n{"case"') + "\n", encoding="utf-8")
    put(f"{words.board}-finding", said_of(board.which, run), ROOT / "README.md")
    if words.board == "default":  # the README has the first part of the table
        ranking = board_text(run).partition("\n\n")[0]
        put("leaderboard", f"```\n{ranking}\n```", ROOT / "README.md")
    if words.board == "suite":
        text = PredictiveReporter().render(run)
        put("predictive", f"```\n{text}\n```", ROOT / "docs" / "scoring.md")
    put(board.mark, f"```\n{board_text(run)}\n```", ROOT / board.page)
    if words.board != "default":
        both = join(*(femubench.read_run(file_of(name)) for name in ("suite", "after")))
        put("both-finding", said_of("structures together", both), ROOT / board.page)
    print(f"{count_noun(len(run.results), 'job')} in {file_of(words.board)}")


if __name__ == "__main__":
    main()
