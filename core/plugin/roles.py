"""The roles that plugins fill besides strategies: scenarios, readers, reporters, effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from femubench.core.effect.frame_effect import EffectParameter
    from femubench.core.fem.model import Model
    from femubench.core.modal.measurement import Measurement
    from femubench.core.schema.results import Run
    from femubench.core.typing import SparseArray


@dataclass(frozen=True)
class Scenario:
    """A named set of case folders that are run together.

    Arguments:
        name: the word after ``bench run``.
        title: one line for lists.
        cases: from the case's name (the scenario's own, or ``scenario/part``) to its folder.
    """

    name: str
    title: str
    cases: Mapping[str, Path]


@runtime_checkable
class Reader(Protocol):
    """Reads a file format that the case format does not know by itself.

    Attributes:
        name: for messages, e.g. ``"universal file"``.
        suffixes: lower-case file suffixes with the dot.
    """

    name: str
    suffixes: tuple[str, ...]

    def read_matrix(self, path: Path) -> SparseArray:
        """Return a square sparse matrix; raises InputError where the file holds none."""
        ...

    def read_modes(self, path: Path) -> Measurement:
        """Return sensors and modes; raises InputError where the file holds none."""
        ...


@runtime_checkable
class Reporter(Protocol):
    """Turns stored results into a text.

    A reporter may offer more than is asked here:

    - ``render_with(run, exhibits) -> str``: used instead of `render` where there is a store;
      `exhibits` is None, or has ``case(digest)`` of a case and ``of(key of the job)``, plain
      data to draw or None.
    - ``render_bytes(run) -> bytes``: used instead of `render`, for a format that is no text.

    Attributes:
        name: the word after ``bench report --format``.
        suffix: of the file that is written, with the dot.
    """

    name: str
    suffix: str

    def render(self, run: Run) -> str:
        """Return the report; must not run anything."""
        ...


@runtime_checkable
class Effect(Protocol):
    """A physical cause that a model can lack; `femubench.FrameEffect` is a base class for frames.

    An effect may offer more than is asked here:

    - ``summary``, ``caution``: what the model lacks, as a clause (``"a bolt is loose"``), and a
      sentence for whoever finds the effect named.
    - ``change(model, place) -> Change``: what it does to mass and stiffness as fixed matrices with
      varying factors. Without it the diagnosis reads the change off `extend` at a few values.
    - ``look(seen) -> Iterable[LookWarning]``: what a plain look at model and measurement, a `Seen`,
      shows of it before any fit.
    - ``softens``, ``reading``: hints for the advice, as in `FrameEffect`.
    """

    @property
    def name(self) -> str:
        """Return a slug such as ``"loose-bolt"``; a plain attribute will do."""
        ...

    def places(self, model: Model) -> Sequence[str]:
        """Return where the effect may sit in this model; nothing where it does not apply."""
        ...

    def parameters(self, model: Model, place: str) -> Sequence[EffectParameter]:
        """Return its parameters there, with unit, prior and bounds."""
        ...

    def extend(self, model: Model, place: str, values: Sequence[float]) -> Model:
        """Return the model with the effect in it."""
        ...
