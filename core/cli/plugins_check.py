"""``bench plugins check``: whether a plugin keeps what a plugin must keep."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.registry import plugins_for
from femubench.core.conformance import SECONDS
from femubench.core.display import counted
from femubench.core.files import write_atomically
from femubench.core.library.cases import read_cases
from femubench.core.plugin.validation import chosen

if TYPE_CHECKING:
    from femubench.core.conformance.checking import Finding

_WORDS = {"pass": "pass", "fail": "FAIL", "warn": "warn", "not-applicable": "-"}


@click.command("check")
@click.argument("name")
@click.option(
    "--case", "words", multiple=True, metavar="CASE",
    help="Try a strategy on this case too; may be repeated.",
)  # fmt: skip
@click.option(
    "--timeout", type=click.FloatRange(0.0, min_open=True), default=SECONDS, metavar="SECONDS",
    show_default=True, help="Give up on one trial after this time.",
)  # fmt: skip
@options.json_file("Write the findings as JSON.")
@click.pass_context
def check(
    ctx: click.Context, name: str, words: tuple[str, ...], timeout: float, json_file: Path | None
) -> int:
    """Check that the plugin NAME keeps what a plugin must keep.

    NAME is a strategy, with options after a colon if need be, an effect, a reader or a scenario.
    Every trial runs in a process of its own. Exit: 0 nothing failed, 1 something did.
    """
    plugins = plugins_for(ctx)
    named = (plugins.strategies, plugins.effects, plugins.readers, plugins.scenarios)
    known = [word for offered in named for word in offered]
    chosen("strategy, effect, reader or scenario", [name.partition(":")[0]], known)
    from femubench.core.conformance.checking import counts, findings, subjects, to_json
    from femubench.core.conformance.problems import of_case

    cases = [of_case(case) for case in read_cases(words, plugins)] if words else []
    records: list[dict[str, Any]] = []
    bad = 0
    for subject in subjects(name, plugins, cases=cases, seconds=timeout):
        title = f"{subject.role} {subject.name}: {counted(len(subject.checks), 'check')}"
        click.echo(title if not records else f"\n{title}")
        found = []
        for finding in findings(subject):
            click.echo(_line(finding))
            found.append(finding)
        click.echo(_last_line(found))
        bad += counts(found)["fail"]
        records.append(to_json(subject, found))
    if json_file is not None:
        write_atomically(json_file, json.dumps({"checked": records}, indent=1))
    return 1 if bad else 0


def _line(finding: Finding) -> str:
    """Return one line: what a finding says, or what was checked."""
    word = _WORDS[finding.verdict.status]
    plain = finding.verdict.status == "pass" and not finding.verdict.message
    text = finding.check.sentence if plain else finding.verdict.message
    return f"{word:4}  {finding.check.name:18}  {text}"


def _last_line(found: Sequence[Finding]) -> str:
    from femubench.core.conformance.checking import counts

    number = counts(found)
    parts = (
        f"{number['pass']} passed",
        f"{number['fail']} failed",
        counted(number["warn"], "warning"),
        f"{number['not-applicable']} not applicable",
    )
    return ", ".join(parts)
