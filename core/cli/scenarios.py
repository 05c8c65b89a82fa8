"""``bench scenarios``: what there is to run, and what a case consists of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import click

from femubench.core.cli.cases import read_cases
from femubench.core.cli.registry import counted, plugins_for, wrapped

if TYPE_CHECKING:
    from femubench.core.case.case import Case, Modification
    from femubench.core.typing import FloatArray


@click.group("scenarios")
def scenarios() -> None:
    """List the built-in scenarios, or show one."""


@scenarios.command("list")
@click.pass_context
def list_(ctx: click.Context) -> None:
    """List the scenarios with the number of their cases."""
    found = plugins_for(ctx).scenarios
    width = max((len(name) for name in found), default=0)
    for name, scenario in found.items():
        cases = "" if len(scenario.cases) == 1 else f" ({len(scenario.cases)} cases)"
        click.echo(f"{name:{width}}  {scenario.title}{cases}")


@scenarios.command("show")
@click.argument("name")
@click.pass_context
def show(ctx: click.Context, name: str) -> None:
    """Show the cases of a scenario: model, sensors, modes, modifications, source.

    NAME is a scenario, one case of it, or a case folder.
    """
    plugins = plugins_for(ctx)
    if name in plugins.scenarios:
        click.echo(f"{name}: {plugins.scenarios[name].title}")
    for case in read_cases([name], plugins):
        click.echo()
        click.echo("\n".join(_describe(case)))


def _describe(case: Case) -> Iterator[str]:
    """Return the lines on one case."""
    measured = case.measurement
    rows = [
        ("title", case.title),
        ("source", case.source),
        ("folder", str(case.folder)),
        ("model", _model(case)),
        ("sensors", str(len(measured.sensors))),
        ("used", _modes(case.used, measured.select(case.used).frequencies)),
    ]
    if case.held_out:
        held_out = measured.select(case.held_out).frequencies
        rows.append(("held out", _modes(case.held_out, held_out)))
    rows += [("modified", _modification(change)) for change in case.modifications]
    yield case.name
    for key, value in rows:
        yield wrapped(f"{key + ':':10}{' '.join(value.split())}", indent=2, hanging=12)


def _modification(change: Modification) -> str:
    attached = (counted(len(change.masses), "mass"), counted(len(change.springs), "spring"))
    measured = change.measurement
    modes = _modes(measured.numbers, measured.frequencies)
    return f"{change.name}: {', '.join(attached)}; {modes}"


def _model(case: Case) -> str:
    size = f"{case.model.size} degrees of freedom"
    if case.model.structure is None:
        return f"{size}, matrices from files"
    frame = case.model.structure.frame
    members, joints = counted(len(frame.members), "member"), counted(len(frame.joints), "joint")
    return f"{size}, {frame.plane}, {members}, {joints}"


def _modes(numbers: Iterable[int], frequencies: FloatArray) -> str:
    """Return modes as ``modes 1 2 3 at 226.8 275.2 537.4 Hz``."""
    labels = [str(number) for number in numbers]
    figures = [f"{hertz:.5g}" for hertz in frequencies]
    noun = "mode" if len(labels) == 1 else "modes"
    return f"{noun} {' '.join(labels)} at {' '.join(figures)} Hz"
