"""The command ``bench``: finds the verb, imports it alone, and turns errors into exit codes.

Exit codes: 0 done, 1 some run failed, 2 wrong input, 3 a run ended before its end, 130 interrupted.
"""

from __future__ import annotations

import errno
import gc
import os
import sys
import traceback
from collections.abc import Callable
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NoReturn

import click
from click.shell_completion import CompletionItem

from femubench.core.cli.ending import INTERRUPTED, remember
from femubench.core.errors import FemubenchError, InputError, PluginError
from femubench.core.version import __version__

DONE, FAILED, WRONG_INPUT = 0, 1, 2

# A verb, which is a click command of that name in a module of that name, and its help in one line,
# which stands here so that `bench --help` imports none of them; in the order in which one meets
# them, and then those that one seldom needs.
_OFTEN = {
    "run": "Run strategies on cases and rank them.",
    "study": "Run strategies under conditions that vary: noise, sensors, options.",
    "report": "Write a report on a stored run.",
    "compare": "Compare run B with run A; exit with 1 if B is worse.",
    "update": "Write the updated model of CASE in the format that it came in.",
    "diagnose": "Find what a model lacks, and extend it.",
    "advise": "Measure the modes that are advised, with held-out ones as the laboratory.",
    "identify": "Find modes in measured responses, without a click.",
    "init": "Write a case folder into FOLDER, which must be new or empty.",
    "help": "Explain a key of a case, an effect, a verdict or a setting.",
    "scenarios": "List the built-in scenarios, or show one.",
    "plugins": "List, show and check plugins, or write a new one.",
}
_SELDOM = {
    "store": "Check or repair stored runs.",
    "submit": "Check, run and compare a strategy for a leaderboard.",
    "publish": "Merge result files into a static site in DIR.",
    "reproduce": "Recompute the tables of the papers, cell by cell.",
    "challenge": "Write blind cases with a hidden fault, and score answers.",
}
VERBS = {**_OFTEN, **_SELDOM}


class VerbGroup(click.Group):
    """A group of lazily imported verbs with the exit codes of `bench`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take the words, which tell how to go on with a run that ends early."""
        remember(ctx, args)
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the verbs in the order in which one meets them."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one verb."""
        if cmd_name not in VERBS:
            return None
        module = import_module(f"{__package__}.{cmd_name}")
        command = getattr(module, cmd_name, None) or getattr(module, f"{cmd_name}_")
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the verb; name the nearest ones where it is unknown."""
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            near = get_close_matches(args[0], VERBS, n=2)
            if args[0] in ("strategies", "effects", "readers"):
                near = ["plugins list"]
            hint = f" Did you mean {' or '.join(near)}?" if near else ""
            ctx.fail(f"No such command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete a verb without importing any."""
        verbs = [
            CompletionItem(verb, help=line)
            for verb, line in VERBS.items()
            if verb.startswith(incomplete)
        ]
        return verbs + click.Command.shell_complete(self, ctx, incomplete)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of verbs without importing them."""
        for title, verbs in (("Commands", _OFTEN), ("Seldom needed", _SELDOM)):
            with formatter.section(title):
                formatter.write_dl(list(verbs.items()))

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 - as click has it
        """Run a verb; print one line for an error that the user can act upon."""
        try:
            return super().invoke(ctx)
        except (FemubenchError, OSError) as fault:
            if isinstance(fault, OSError) and fault.errno == errno.EPIPE:
                raise
            if ctx.params["traceback"]:
                click.echo("".join(traceback.format_exception(fault)), err=True, nl=False)
            click.echo(f"bench: {' '.join(str(fault).split())}", err=True)
            wrong_input = isinstance(fault, (InputError, PluginError))
            ctx.exit(WRONG_INPUT if wrong_input else FAILED)

    def main(self, *args: Any, **kwargs: Any) -> NoReturn:  # noqa: ANN401 - as click has it
        """Run `bench` and leave with its exit code."""
        # Modules and models are no garbage: to look for it as often as by default takes 4 %.
        gc.set_threshold(20_000, 20, 20)
        sys.exit(_exit_code(lambda: super(VerbGroup, self).main(*args, **kwargs), kwargs))


def _exit_code(call: Callable[[], Any], kwargs: dict[str, Any]) -> int:
    """Return the exit code of a call of click's main."""
    kwargs["standalone_mode"] = False
    try:
        code = call()
    except click.exceptions.NoArgsIsHelpError as fault:
        fault.show()
        return WRONG_INPUT
    except click.ClickException as fault:
        words = fault.format_message().split()
        if isinstance(fault, click.NoSuchOption) and not fault.possibilities and fault.ctx:
            words.append(f"({fault.ctx.command_path} --help lists all)")
        click.echo(f"bench: {' '.join(words)}", err=True)
        return WRONG_INPUT
    except (click.Abort, KeyboardInterrupt):
        click.echo("bench: interrupted", err=True)
        return INTERRUPTED
    except OSError as fault:
        if fault.errno != errno.EPIPE:
            raise
        # The reader of a pipe has gone; what is still buffered must not raise once more at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    return code if isinstance(code, int) else DONE


@click.group(cls=VerbGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="femubench")
@click.option(
    "--traceback", is_flag=True, help="Show where an error or a broken plugin comes from."
)
def bench(traceback: bool) -> None:
    """Rank finite element model updating strategies on measured structures."""


if __name__ == "__main__":
    bench()
