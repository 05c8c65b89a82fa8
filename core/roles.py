"""The roles that are played here, as protocols: anyone who has the members plays the role.

Nothing has to be inherited. Models, measurements and runs are always the data classes of
`femubench`, of which nothing is known here: they are `Any`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

from femubench.core.errors import FemubenchError, PluginError

if TYPE_CHECKING:
    import numpy as np

    from femubench.core.typing import SparseArray, Wording

Scaling = Literal["linear", "exponential", "compliance", "factor", "log"]
CAPABILITIES = ("shapes", "parts", "elements", "geometry", "joints", "responses")


@runtime_checkable
class Result(Protocol):
    """What a strategy hands back; `femubench.UpdateResult` is one.

    A result may say more than is asked here: ``uncertainty``, a `update.Uncertainty` or whatever
    has its two members, from which the judge makes a standard deviation of every frequency.
    """

    @property
    def model(self) -> Any:  # noqa: ANN401 - see the module
        """Return the updated `femubench.Model`."""
        ...

    @property
    def parameter_count(self) -> int:
        """Return the number of unknowns that were free to change."""
        ...

    @property
    def parameters(self) -> Sequence[Any]:
        """Return the parameters that have a name: name, before, after, unit, std."""
        ...

    @property
    def history(self) -> Sequence[Mapping[str, float]]:
        """Return one mapping an iteration."""
        ...

    @property
    def diagnostics(self) -> Mapping[str, float]:
        """Return any further figures."""
        ...


@runtime_checkable
class StrategyRole(Protocol):
    """A method of updating; `femubench.Strategy` is a base class for who wants one.

    A strategy may say more than is asked here; `declared` reads it:

    - ``needs``: capabilities (of `CAPABILITIES`) that model or measurement must have.
    - ``promises``: what every result keeps; `bench plugins check` measures it.
    - ``settings``: other values of its options, each in the words of ``bench run -s NAME:...``.
    """

    @property
    def name(self) -> str:
        """Return the word after ``bench run -s``; a plain attribute will do."""
        ...

    @property
    def citation(self) -> str:
        """Return author, year, title, equation."""
        ...

    def update(
        self,
        model: Any,  # noqa: ANN401 - see the module
        measurement: Any,  # noqa: ANN401
        rng: np.random.Generator,
    ) -> Result:
        """Return an updated model; raises StrategyFailure or NotApplicable where there is none."""
        ...


def list_declared(strategy: object, what: Literal["needs", "promises"]) -> frozenset[str]:
    """Return what a strategy says that it needs or promises; nothing where it says nothing."""
    found: frozenset[str] = getattr(strategy, what, frozenset())
    return found


@dataclass(frozen=True)
class Scenario:
    """A named set of case folders that are run together.

    Arguments:
        name: the word after ``bench run``. ``group/name`` belongs to a group, and ``bench run
            group`` runs all of it.
        title: one line for lists.
        cases: from the case's name (the scenario's own, or ``scenario/part``) to its folder, or
            to a function without arguments that makes the folder when the case is asked for.
        classes: kinds of structure and of truth, for lists.
        default: whether ``bench run`` without a case runs it.
    """

    name: str
    title: str
    cases: Mapping[str, Path | Callable[[], Path]]
    classes: tuple[str, ...] = ()
    default: bool = True

    def folder(self, case: str) -> Path:
        """Return the folder of a case.

        Raises:
            InputError: when it has to be made, and what it is made of is not there or is wrong.
            PluginError: when the function that makes it fails otherwise.
        """
        found = self.cases[case]
        if isinstance(found, Path):
            return found
        try:
            return found()
        except FemubenchError:
            raise
        except Exception as error:
            stated = " ".join(f"{type(error).__name__}: {error}".split())
            what = f"the folder of {case!r} cannot be made: {stated}"
            raise PluginError(f"scenario {self.name!r}: {what}") from error


@runtime_checkable
class Reader(Protocol):
    """Reads a file format that the case format does not know by itself.

    A reader may offer more than is asked here; what it reads is in the units of the file:

    - ``read_model(path) -> Model``: mass, stiffness and labelled dofs, made by
      `fem.matrix_model`, or `Model.of(frame)` where the file holds elements.
    - ``read_pair(stiffness, mass) -> Model``: likewise, from two files; without it `read_matrix`
      reads them, and a table must give the labels.
    - ``read_remarks(path) -> Sequence[str]``: what `read_model` left out or took otherwise than it
      stands in the file, one sentence each, which become notes of a case.
    - ``model_files(path) -> Sequence[Path]``: further files that `read_model` opens.
    - ``read_nodes(path) -> Mapping[str, Sequence[float]]``: coordinates of nodes by name, for
      models whose own files have none.
    - ``read_named_modes(path, names) -> Measurement``: instead of `read_modes` where a case names
      the variables of a file, from ``frequencies``, ``shapes``, ... to what they are called there.
    - ``read_outline(path) -> Outline``: the title of a test, and lines that draw its structure.
    - ``write_model(model, path, original)``, ``write_pair(model, stiffness, mass, originals)``:
      write an updated model in the format of the original file or files, and keep of these what
      an update does not change.
    - ``read_responses(path) -> FrequencyResponses | TimeSignals``: what `bench identify` starts
      from and `frfs` of a case names; both classes are in `femubench.modal`; with names of
      variables ``read_named_responses(path, names)``.

    Attributes:
        name: for messages, e.g. ``"universal file"``.
        suffixes: lower-case file suffixes with the dot.
    """

    name: str
    suffixes: tuple[str, ...]

    def read_matrix(self, path: Path) -> SparseArray:
        """Return a square sparse matrix; raises InputError where the file holds none."""
        ...

    def read_modes(self, path: Path) -> Any:  # noqa: ANN401 - see the module
        """Return a `femubench.Measurement`, nan where the file states no deviations or places.

        Raises:
            InputError: where the file holds none.
        """
        ...


@runtime_checkable
class Reporter(Protocol):
    """Turns stored results into a text.

    A reporter may offer more than is asked here:

    - ``render_with(run, exhibits) -> str``: used instead of `render` where there is a store;
      `exhibits` is None, or has ``case(digest)`` of a case and ``of(key of the job)``, plain
      data to draw or None.
    - ``render_bytes(run) -> bytes``: used instead of `render`, for a format that is no text.

    Those that come with femubench also show other things, each where it can: a diagnosis
    (``render_diagnosis(data)``, ``diagnosis_lines(data)``), a comparison
    (``render_comparison(data)``), papers (``render_studies(studies, drawings)``), identified modes
    (``render_modes(found, source)``), a list (``render_list(title, lines)``), a leaderboard
    (``render_site(index)``), and what else has to be known of a run (``notes(run)``).

    Attributes:
        name: the word after ``bench report --format``.
        suffix: of the file that is written, with the dot.
    """

    name: str
    suffix: str

    def render(self, run: Any) -> str:  # noqa: ANN401 - see the module
        """Return the report; must not run anything."""
        ...


@runtime_checkable
class Paper(Protocol):
    """A paper whose printed tables are recomputed.

    A paper may offer more than is asked here: ``done``, hundredths of a second after which a re-run
    had done each of its different updates, and all else, from which the time that is left follows.
    """

    @property
    def name(self) -> str:
        """Return the word after ``bench reproduce``; a plain attribute will do."""
        ...

    @property
    def cases(self) -> Sequence[str]:
        """Return the names of cases that the re-run works with; a plain attribute will do."""
        ...

    def study(self, bench: Any) -> Any:  # noqa: ANN401 - see the module
        """Return the `reproduction.Study`, worked out on a `reproduction.Workbench`."""
        ...


class EffectParameter(Protocol):
    """One number of an effect, with its prior; `effect.Parameter` explains the members."""

    @property
    def name(self) -> str:
        """Return a word for tables."""
        ...

    @property
    def unit(self) -> str:
        """Return the unit of the value; empty for a ratio."""
        ...

    @property
    def scale(self) -> float:
        """Return the scale of the value at a coordinate of 1."""
        ...

    @property
    def neutral(self) -> float:
        """Return the value that leaves the model as it is."""
        ...

    @property
    def lower(self) -> float:
        """Return the least value."""
        ...

    @property
    def upper(self) -> float:
        """Return the largest value."""
        ...

    @property
    def scaling(self) -> Scaling:
        """Return how a coordinate becomes a value."""
        ...

    @property
    def one_sided(self) -> bool:
        """Tell whether coordinates are positive."""
        ...

    @property
    def textbook(self) -> float | None:
        """Return a value that physics gives without any fit, None where there is none."""
        ...

    @property
    def wording(self) -> Wording:
        """Return how a size is worded: in its unit, as a relative change, or as a share."""
        ...

    @property
    def range(self) -> tuple[float, float]:
        """Return the smallest and the largest coordinate that the bounds allow."""
        ...

    def value(self, x: Any) -> Any:  # noqa: ANN401 - numbers and arrays alike
        """Return the value at a coordinate that is standard normal a priori."""
        ...

    def coordinate(self, value: float) -> float:
        """Return the coordinate of a value."""
        ...


@runtime_checkable
class Effect(Protocol):
    """A physical cause that a model can lack; `effect.FrameEffect` is a base class for frames.

    An effect may offer more than is asked here:

    - ``summary``, ``caution``: what the model lacks, as a clause (``"a bolt is loose"``), and a
      sentence for anyone who finds the effect named.
    - ``change(model, place) -> Change``: what it does to mass and stiffness as fixed matrices with
      varying factors. Without it the diagnosis reads the change off `extend` at a few values.
    """

    @property
    def name(self) -> str:
        """Return a slug such as ``"loose-bolt"``; a plain attribute will do."""
        ...

    def places(self, model: Any) -> Sequence[str]:  # noqa: ANN401 - see the module
        """Return where the effect may sit in this model; nothing where it does not apply."""
        ...

    def parameters(self, model: Any, place: str) -> Sequence[EffectParameter]:  # noqa: ANN401
        """Return its parameters there, with unit, prior and bounds."""
        ...

    def extend(self, model: Any, place: str, values: Sequence[float]) -> Any:  # noqa: ANN401
        """Return the model with the effect in it."""
        ...


@runtime_checkable
class Fault(Protocol):
    """Something that is wrong with the data, or with what was typed in; no cause of physics.

    A diagnosis weighs every suspect against the physical causes, on the same data.
    """

    @property
    def name(self) -> str:
        """Return a slug such as ``"lost-digit"``; a plain attribute will do."""
        ...

    @property
    def side(self) -> Literal["data", "input"]:
        """Return whether what was measured is wrong, or what was typed in."""
        ...

    def suspects(
        self,
        model: Any,  # noqa: ANN401 - see the module
        measurement: Any,  # noqa: ANN401
    ) -> Sequence[Any]:
        """Return where the fault may sit, each a `femubench.effect.Suspect`."""
        ...
