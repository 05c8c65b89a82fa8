"""The hooks that a plugin may implement; the names of its functions must be these."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femubench.core.plugin.markers import hookspec

if TYPE_CHECKING:
    from femubench.core.roles import Effect, Fault, Paper, Reader, Reporter, Scenario, StrategyRole

# Hook specifications have no body: pluggy reads their signature alone.
# mypy: disable-error-code="empty-body"


@hookspec
def femubench_strategies() -> Iterable[StrategyRole | type[StrategyRole]]:
    """Return the plugin's updating strategies, as classes or instances."""


@hookspec
def femubench_scenarios() -> Iterable[Scenario]:
    """Return the plugin's scenarios: named sets of case folders."""


@hookspec
def femubench_effects() -> Iterable[Effect | type[Effect]]:
    """Return the physical causes that the plugin adds to the diagnosis."""


@hookspec
def femubench_faults() -> Iterable[Fault | type[Fault]]:
    """Return what may be wrong with data or with what was typed in."""


@hookspec
def femubench_readers() -> Iterable[Reader | type[Reader]]:
    """Return readers for file formats of matrices or measured modes."""


@hookspec
def femubench_reporters() -> Iterable[Reporter | type[Reporter]]:
    """Return report formats for ``bench report --format``."""


@hookspec
def femubench_papers() -> Iterable[Paper | type[Paper]]:
    """Return papers whose tables ``bench reproduce`` recomputes."""
