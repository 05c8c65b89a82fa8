"""The files that a run is written to, and what is shown at its end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from femubench.core.cli import options
from femubench.core.cli.ending import telling
from femubench.core.cli.progress import progress
from femubench.core.cli.registry import wrap_text
from femubench.core.errors import InputError, OutputError, PluginError
from femubench.core.files import write_atomically

if TYPE_CHECKING:
    from femubench.core.plugin.loader import Plugins
    from femubench.core.roles import Reporter
    from femubench.core.run.runner import Plan
    from femubench.core.run.store import Store
    from femubench.core.schema.results import JobName, RunData


@dataclass(frozen=True)
class RunOutput:
    """What becomes of a run: its store, the files that the user named, and what is shown."""

    ctx: click.Context
    plugins: Plugins
    store: Store
    files: dict[Path, Reporter]

    @classmethod
    def of(cls, ctx: click.Context, plugins: Plugins) -> RunOutput:
        """Return the output that the options of a verb say.

        Raises:
            InputError: for two outputs in one file, or a file of no known format.
        """
        from femubench.core.library.rank import store_in
        from femubench.core.library.report import reporter, reporter_for

        files: dict[Path, Reporter] = {}
        for key, name in (("json_file", "json"), ("report_file", None)):
            path = ctx.params[key]
            if path is None:
                continue
            if path in files:
                raise InputError("is to hold two outputs", file=path, expected="a file for each")
            files[path] = reporter(plugins, name) if name else reporter_for(plugins, path)
        return cls(ctx, plugins, store_in(ctx.params["store"]), files)

    def run(
        self,
        plan: Plan,
        header: Callable[[str], str],
        exhibits: object = None,
        *resumed_with: Sequence[str],
    ) -> tuple[RunData, int]:
        """Run what is planned and report; return the run and the exit code.

        Arguments:
            header: returns what is shown first, from a clause on where the jobs run.
            resumed_with: words that make the same command go on, and those that do not.
        """
        from femubench.core.library.report import reporter
        from femubench.core.run.executor import open_executor
        from femubench.core.run.handed_in import count_unanswered, name_answers, write_answers
        from femubench.core.run.runner import Receivers

        quiet = self.ctx.params["quiet"]
        screen = None if quiet else reporter(self.plugins, "terminal")
        with (
            telling(self.store, plan.jobs, screen, *resumed_with),
            open_executor(options.read_given(self.ctx)[1]) as executor,
        ):
            if not quiet:
                found = executor.enclosure()
                if found.sandbox == "none" and executor.sandbox != "off":
                    click.echo(f"strategies run without a sandbox: {found.reason}", err=True)
                click.echo(wrap_text(header(executor.spoken), hanging=2))
            # What goes to a leaderboard has twins, and is judged again there from its models.
            file = self.ctx.params["json_file"]
            answers: dict[JobName, bytes] = {}
            keep = answers.__setitem__ if file and plan.starts.companions.twins else None
            with progress(quiet=quiet) as advance:
                run = plan.run(executor, Receivers(self.store, advance=advance, keep_answer=keep))
        if keep and (missing := count_unanswered(run, answers)):
            name_answers(file).unlink(missing_ok=True)  # of an earlier run
            what = f"no {name_answers(file)}: {missing} results come from the store"
            click.echo(f"bench: {what}, without their models", err=True)
        elif keep:
            write_answers(name_answers(file), run, answers)
        return run, self._report(run, screen, exhibits)

    def _report(self, run: RunData, screen: Reporter | None, exhibits: object) -> int:
        """Write the files, then show the ranking and where the files are.

        A file that cannot be written keeps nobody from the ranking and the other files.
        Returns the exit code: 1 where some job has no result.

        Raises:
            OutputError: for the last such file, when all else is done.
            PluginError: for the last reporter that failed.
        """
        from femubench.core.library.cases import way_of
        from femubench.core.library.report import render_report, reporter, run_name, text_of
        from femubench.core.schema.results import DONE

        files, written = dict(self.files), list[str]()
        broken: OutputError | PluginError | None = None
        if self.ctx.params["report_file"] is None:
            for own in (reporter(self.plugins, name) for name in ("html", "markdown")):
                files[self.store.folder / f"{run_name(run)}{own.suffix}"] = own
        for path, writer in files.items():
            try:
                write_atomically(path, render_report(writer, run, exhibits))
                written.append(f"{writer.name}: {path}")
            except (OutputError, PluginError) as fault:
                if broken is not None:
                    click.echo(f"bench: {broken}", err=True)
                broken = fault
        for line in way_of("terminal", "shortfalls")(run) if screen is None else ():
            click.echo(f"bench: {line}", err=True)
        if screen is not None:
            click.echo("\n".join(["", text_of(screen, render_report(screen, run)), *written]))
        if broken is not None:
            raise broken
        return int(any(result.status not in DONE for result in run.results))
