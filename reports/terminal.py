"""The leaderboard and the failures, 80 columns wide."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from femubench.reports.cells import fixed, interval, plain, shortened, whole
from femubench.reports.summary import Trouble, lead, notes_of, spared, troubles, unconverged
from femubench.reports.twins import drawn_from, suspicions
from femubench.results import (
    Run,
    interval_kind,
    leaderboard,
    ranked,
    tell_apart,
    twin_skills,
)

if TYPE_CHECKING:
    import pandas as pd

WIDTH = 80
_NAME_WIDTH = 16
_MOST_FAILURES = 20
_MOST_WIDTHS = (20, _NAME_WIDTH, 13)
_HEADERS = (
    *("#", "strategy", "skill", "from\ndrawn", "high\n%", "mod.\n%", "given\n%"),
    *("rigid\nlost", "neg.\neig.", "par.", "s"),
)
_ALIGN = ("right", "left", *("right" for _ in _HEADERS[2:]))


class TerminalReporter:
    """Plain text for the screen."""

    name = "terminal"
    suffix = ".txt"

    def render(self, run: Run) -> str:
        """Return the ranking, the failures and what the columns mean."""
        parts = [board_text(run)]
        failed = troubles(run.results)
        if failed:
            parts.append(failures(failed))
        parts += [textwrap.fill(text, WIDTH) for text in _notes(run)]
        return "\n\n".join(parts)


def board_text(run: Run) -> str:
    """Return the ranking, what its columns mean, and which strategies differ from the best."""
    board = leaderboard(run)
    parts = [ranking(board)]
    if interval_kind(run) == "seeds":
        parts.append(intervals(board))
    parts.append("\n".join(_legend(run, board)))
    if board["skill_tests"].notna().any():
        parts.append(_tests(board))
    if board["coverage90"].notna().any():
        parts.append(_stated(board))
    if len(board) > 1:
        parts.append(_first_tier(run, board))
    parts += _twins(run, board)
    return "\n\n".join(parts)


def ranking(board: pd.DataFrame) -> str:
    """Return the leaderboard as a text of 80 columns at most."""
    return aligned_table([_row(row) for row in board.to_dict("records")], _HEADERS, _ALIGN)


def intervals(board: pd.DataFrame) -> str:
    """Return median and 95 % interval of the skill over the seeds."""
    found = board[["strategy", "skill", "skill_low", "skill_high"]].itertuples(index=False)
    rows = [
        [shortened(plain(name), _NAME_WIDTH), fixed(skill, 3), interval(low, high)]
        for name, skill, low, high in found
    ]
    heads = ("strategy", "median skill", "95 % interval")
    return aligned_table(rows, heads, ("left", "right", "left"))


def failures(failed: list[Trouble]) -> str:
    """Return a table of the failures with their reasons, the first ones where there are many."""
    from tabulate import tabulate

    rows = []
    for item in failed[:_MOST_FAILURES]:
        often = f" x{len(item.seeds)}" if len(item.seeds) > 1 else ""
        rows.append((plain(item.case), plain(item.strategy), item.status + often, item.reason))
    headers = ("case", "strategy", "status", "reason")
    # tabulate pads a header by two; columns are two apart.
    columns = zip(*([f"{header}  " for header in headers], *rows), strict=True)
    needed = [max(map(len, column)) for column in columns][:3]
    widths = [min(width, most) for width, most in zip(needed, _MOST_WIDTHS, strict=True)]
    text: str = tabulate(
        rows,
        headers=headers,
        tablefmt="simple",
        disable_numparse=True,
        maxcolwidths=[*widths, WIDTH - sum(widths) - 6],
    )
    more = len(failed) - _MOST_FAILURES
    return text + (f"\n... and {more} more in the report" if more > 0 else "")


def _row(row: dict[Any, Any]) -> list[str]:
    return [
        _marks(row) + whole(row["rank"]),
        shortened(plain(row["strategy"]), _NAME_WIDTH),
        fixed(row["skill"], 3),
        fixed(row["skill_drawn"], 3),
        *(fixed(row[f"{block}_percent"], 2, 4) for block in ("higher", "modified", "used")),
        whole(row["rigid_modes_lost"], 5),
        whole(row["negative_eigenvalues"], 4),
        whole(row["parameters"], 5),
        fixed(row["seconds"], 2, 4),
    ]


def _marks(row: dict[Any, Any]) -> str:
    """Return what must not be overlooked: lost physics, and jobs that the errors leave out."""
    incomplete = row["ok"] + row["not_applicable"] < row["total"]
    return ("!" if row["unphysical"] else "") + ("*" if incomplete else "")


def aligned_table(rows: list[list[str]], headers: tuple[str, ...], align: tuple[str, ...]) -> str:
    """Return a table no wider than its cells; tabulate pads headers, so they go in as rows."""
    from tabulate import tabulate

    height = max(header.count("\n") for header in headers) + 1
    split = [[""] * (height - 1 - header.count("\n")) + header.split("\n") for header in headers]
    heads = [list(line) for line in zip(*split, strict=True)]
    rule = ["-" * max(map(len, column)) for column in zip(*heads, *rows, strict=True)]
    lines = [*heads, rule, *rows]
    text: str = tabulate(lines, tablefmt="plain", disable_numparse=True, colalign=align)
    return "\n".join(line.rstrip() for line in text.splitlines())


def _tests(board: pd.DataFrame) -> str:
    """Return the order of the strategies on tests alone."""
    rows = ranked(
        board.to_dict("records"), lambda row: ((), 1.0 - row["skill_tests"], str(row["strategy"]))
    )
    named = (
        f"{_marks(row)}{plain(row['strategy'])} {fixed(row['skill_tests'], 2)}" for _, row in rows
    )
    return textwrap.fill(f"skill on tests alone, no computed truths: {', '.join(named)}", WIDTH)


def _stated(board: pd.DataFrame) -> str:
    """Return how often the intervals that strategies state hold the truth."""
    rows = board[board["coverage90"].notna()].to_dict("records")
    named = (f"{plain(row['strategy'])} {100.0 * row['coverage90']:.0f} %" for row in rows)
    return textwrap.fill(f"unseen modes inside the stated 90 % interval: {', '.join(named)}", WIDTH)


def _twins(run: Run, board: pd.DataFrame) -> Iterator[str]:
    """Return the skills on twins beside those on their cases, and who may know these."""
    found = twin_skills(run)
    if found:
        named = (
            f"{plain(name)} {fixed(found[name].skill, 3)} ({fixed(found[name].original_skill, 3)})"
            for name in board["strategy"]
            if name in found
        )
        said = f"skill on {drawn_from(run)}, in brackets on the cases: {', '.join(named)}"
        yield textwrap.fill(said, WIDTH)
    yield from (textwrap.fill(f"?: {told}", WIDTH) for told in suspicions(run))


def _first_tier(run: Run, board: pd.DataFrame) -> str:
    """Return of which strategies no difference from the best is shown, or why nothing is tested."""
    tested = tell_apart(run, list(board["strategy"]))
    if not tested.tiers:
        return textwrap.fill(tested.note, WIDTH)
    rows = {row["strategy"]: row for row in board.to_dict("records")}
    named = [
        f"{_marks(row)}{plain(row['strategy'])} {fixed(row['skill'], 3)} "
        f"({interval(row['skill_low'], row['skill_high'])})"
        for row in (rows[name] for name in tested.tiers[0])
    ]
    others = len(rows) - len(named)
    if not others:
        best = f"{named[0]}, 95 % interval over structures"
        return textwrap.fill(f"no strategy is shown to differ from the best, {best}", WIDTH)
    said = "tier 1, no difference from the best shown (95 % interval over structures)"
    below = f"{others} of {len(rows)} are below"
    return textwrap.fill(f"{said}: {', '.join(named)}; {below}", WIDTH)


def _notes(run: Run) -> Iterator[str]:
    yield from (f"Note: {note}." for note in notes_of(run))
    moving = unconverged(run.results)
    if moving:
        named = ", ".join(f"{plain(name)} ({count})" for name, count in moving.items())
        yield f"Still moving at their last iteration (jobs): {named}."
    for reason, names in spared(run.results).items():
        listed = ", ".join(map(plain, names))
        yield f"Not applicable, counted as the model that was given: {listed}: {reason}."


def _legend(run: Run, board: pd.DataFrame) -> Iterator[str]:
    yield textwrap.fill(lead(run), WIDTH)
    yield "high, mod., given: rms frequency error of the modes, median over the cases"
    if board["unphysical"].any():
        why = "rigid modes lost, negative eigenvalues or surplus partners"
        yield textwrap.fill(f"!: unphysical ({why}), below all others", WIDTH)
    if (board["ok"] + board["not_applicable"] < board["total"]).any():
        yield "*: some jobs gave no model: ten times the error, left out of the errors shown"
