"""``bench plugins``: what is installed, what is wrong with it, and a start for one's own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from femubench.core.cli import options
from femubench.core.cli.registry import Verbs, plugins_for, warn, wrap_text
from femubench.core.conformance import SECONDS
from femubench.core.display import count_noun
from femubench.core.errors import InputError
from femubench.core.files import write_atomically
from femubench.core.library.cases import read_cases
from femubench.core.plugin.loader import load_plugins
from femubench.core.plugin.validation import CHECKS, choose_names, did_you_mean

if TYPE_CHECKING:
    from femubench.core.conformance.checking import CheckResult

# What `new` writes, as in `KINDS` of the module that does it.
_KINDS = ("strategy", "effect", "scenario", "reader")
_WORDS = {"pass": "pass", "fail": "FAIL", "warn": "warn", "not-applicable": "-"}
_NEXT = {
    "strategy": "{trial}",
    "effect": "bench init portal && bench diagnose portal --effects {name}",
    "scenario": "bench run {name}",
    "reader": "bench run {folder}/tests/case",
}


@click.group("plugins", cls=Verbs)
def plugins() -> None:
    """List, show and check plugins, or write a new one."""


@plugins.command("list")
@click.option("--traceback", is_flag=True, help="Show where a broken plugin fails.")
@click.pass_context
def list_(ctx: click.Context, traceback: bool) -> None:
    """List all plugins and what they offer; broken ones go to stderr.

    A broken plugin does not stop bench, nor does it change the exit code.
    """
    found = load_plugins()
    for plugin in found.loaded:
        click.echo(f"{plugin.plugin} ({plugin.distribution})")
        for kind, names in plugin.offers.items():
            if names:
                click.echo(wrap_text(f"{kind}: {', '.join(names)}", indent=2, hanging=4))
    wanted = traceback or bool(ctx.find_root().params.get("traceback"))
    warn(found.broken, with_traceback=wanted)
    if found.broken and not wanted:
        click.echo("bench plugins list --traceback shows where these come from", err=True)


@plugins.command("show")
@click.argument("name")
@click.pass_context
def show(ctx: click.Context, name: str) -> None:
    """Show what NAME is, where it comes from, what it needs, and its options.

    NAME is a strategy, scenario, effect, reader, reporter or paper, or a plugin of `bench plugins
    list`.
    """
    from femubench.core.cli.plugin_pages import pages_of

    found = plugins_for(ctx)
    pages = list(pages_of(name, found))
    if not pages:
        known = [word for kind in CHECKS for word in getattr(found, kind)]
        known += [plugin.plugin for plugin in found.loaded]
        hint = (
            did_you_mean(name, dict.fromkeys(known)) or "; bench plugins list names all there are"
        )
        raise InputError(f"no plugin offers {name!r}{hint}")
    click.echo("\n\n".join(pages))


@plugins.command("new")
@click.argument("name")
@click.option(
    "--kind", type=click.Choice(_KINDS), default="strategy", show_default=True,
    help="What the package contains.",
)  # fmt: skip
@options.output_folder("Write the folder NAME there. Default: here.", default=".")
@click.pass_context
def new(ctx: click.Context, name: str, kind: str, output: Path) -> None:
    """Write a pip-installable package with a working plugin in the new folder NAME.

    NAME, of lower-case letters, digits and dashes, is also the name of the plugin.
    """
    from femubench.core.library.new_package import trial_of, write_package

    found = plugins_for(ctx)
    for path in write_package(name, kind, output, found):
        click.echo(f"wrote {path}")
    folder = output / name
    click.echo(f"Install it: pip install -e {folder}")
    click.echo(
        f"then run:   {_NEXT[kind].format(name=name, folder=folder, trial=trial_of(name, found))}"
    )


@plugins.command("check")
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
    """Check that the plugin NAME follows the rules for plugins.

    NAME is a strategy, with options after a colon if need be, an effect, a reader or a scenario.
    Every trial runs in a process of its own. Exit: 0 nothing failed, 1 something did.
    """
    found = plugins_for(ctx)
    named = (found.strategies, found.effects, found.readers, found.scenarios)
    known = [word for offered in named for word in offered]
    choose_names("strategy, effect, reader or scenario", [name.partition(":")[0]], known)
    from femubench.core.conformance.checking import counts, findings, subjects, to_json
    from femubench.core.conformance.problems import of_case

    cases = [of_case(case) for case in read_cases(words, found)] if words else []
    records: list[dict[str, Any]] = []
    bad = 0
    for subject in subjects(name, found, cases=cases, seconds=timeout):
        title = f"{subject.role} {subject.name}: {count_noun(len(subject.checks), 'check')}"
        click.echo(title if not records else f"\n{title}")
        seen = []
        for finding in findings(subject):
            click.echo(_line(finding))
            seen.append(finding)
        number = counts(seen)
        click.echo(
            f"{number['pass']} passed, {number['fail']} failed, "
            f"{count_noun(number['warn'], 'warning')}, {number['not-applicable']} not applicable"
        )
        bad += number["fail"]
        records.append(to_json(subject, seen))
    if json_file is not None:
        write_atomically(json_file, json.dumps({"checked": records}, indent=1))
    return 1 if bad else 0


def _line(finding: CheckResult) -> str:
    """Return one line: what a finding says, or what was checked."""
    word = _WORDS[finding.verdict.status]
    plain = finding.verdict.status == "pass" and not finding.verdict.message
    text = finding.check.sentence if plain else finding.verdict.message
    return f"{word:4}  {finding.check.name:18}  {text}"
