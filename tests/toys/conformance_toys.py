"""Strategies that break one rule each, in a module that worker processes can import."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from femubench import (
    InputError,
    Measurement,
    Model,
    NotApplicable,
    Strategy,
    StrategyFailure,
    UpdateResult,
    solve_modes,
)
from femubench.core.score.scoring import frequency_error, predict_block
from femubench.effect import FrameEffect, LookWarning, Parameter, Reading, Seen, Site, Size
from femubench.fem import Frame, GroundSpring, LowRank, Place, SparseArray


def scaled(model: Model, factor: float = 0.95) -> Model:
    return replace(model, stiffness=factor * model.stiffness)


class Good(Strategy):
    """Scale the stiffness by the first frequency."""

    name: ClassVar[str] = "good"
    citation: ClassVar[str] = "none"

    def update(
        self, model: Model, measurement: Measurement, rng: np.random.Generator
    ) -> UpdateResult:
        first = solve_modes(model).elastic.eigenvalues[0]
        return self.finish(scaled(model, float(measurement.eigenvalues[0] / first)))

    def finish(self, model: Model) -> UpdateResult:
        return UpdateResult(model, parameter_count=1)


class InPlace(Good):
    """Write into the nominal stiffness, and put it right too late."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        result = super().update(model, measurement, rng)
        model.stiffness.data *= 1.01
        return result


class Unseeded(Good):
    """Draw from a generator of its own."""

    def finish(self, model: Model) -> UpdateResult:
        own = np.random.default_rng()
        return UpdateResult(scaled(model, 1.0 + 1e-14 * own.integers(1, 10**6)), 1)


class Silencing(Good):
    """Turn numpy's warnings off for everybody."""

    def finish(self, model: Model) -> UpdateResult:
        np.seterr(all="ignore")
        return super().finish(model)


class CellsWanted(Good):
    """Want every shape cell."""

    needs: ClassVar[frozenset[str]] = frozenset({"shapes"})

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        if np.isnan(measurement.shapes).any():
            raise ValueError("array must not contain infs or NaNs")
        return super().update(model, measurement, rng)


class Asymmetric(Good):
    """Change one entry and not its mirror image."""

    def finish(self, model: Model) -> UpdateResult:
        stiffness = sp.lil_array(model.stiffness)
        stiffness[0, 1] += 1e-3 * stiffness[0, 0]
        return super().finish(replace(model, stiffness=sp.csc_array(stiffness)))


class NotNumbers(Good):
    """Return a core of nan."""

    def finish(self, model: Model) -> UpdateResult:
        change = LowRank(np.ones((model.size, 1)), np.array([[np.nan]]))
        return super().finish(replace(model, stiffness_change=change))


class WrongSize(Good):
    """Leave a row and a column out."""

    def finish(self, model: Model) -> UpdateResult:
        return super().finish(replace(model, stiffness=sp.csc_array(model.stiffness[:-1, :-1])))


class Locked(Good):
    """Hold something that no other process can be given."""

    def __init__(self) -> None:
        self.key = threading.Lock()


class Undeclared(Good):
    """Use the frame without saying so."""

    def finish(self, model: Model) -> UpdateResult:
        assert model.frame_structure is not None
        return super().finish(model)


class ByIndex(Good):
    """Give the model's modes the measured frequencies in the order in which they come."""

    promises: ClassVar[frozenset[str]] = frozenset({"used-modes"})

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        modes = solve_modes(model).elastic
        count = len(measurement)
        change = np.diag(measurement.eigenvalues - modes.eigenvalues[:count])
        low_rank = LowRank(model.mass_times(modes.shapes[:, :count]), change)
        return self.finish(replace(model, stiffness_change=low_rank))


class Candid(Good):
    """Say by how much the worst used frequency is off."""

    promises: ClassVar[frozenset[str]] = frozenset({"used-modes-or-stated"})
    factor: ClassVar[float] = 1.0

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        result = super().update(model, measurement, rng)
        pairs = predict_block(result.model, measurement, None)
        error = self.factor * max(map(frequency_error, pairs))
        return replace(result, diagnostics={"used_frequency_error": error})


class Flattering(Candid):
    """Say that it is half as much."""

    factor: ClassVar[float] = 0.5


class Looping(Good):
    """Never come back."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        while True:
            time.sleep(0.05)


class Exiting(Good):
    """Leave the process."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        os._exit(0)


class Hog(Good):
    """Take all memory that there is."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        kept = []
        while True:
            kept.append(np.ones(2**24))


class SilentRefusal(Good):
    """Refuse without a reason."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        raise StrategyFailure


class Inverting(Good):
    """Invert the stiffness."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        if np.linalg.matrix_rank(model.stiffness.toarray(), hermitian=True) < model.size:
            raise np.linalg.LinAlgError("Singular matrix")
        return super().update(model, measurement, rng)


class InvertingMass(Good):
    """Invert the mass."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        if not model.mass.diagonal().all():
            raise np.linalg.LinAlgError("Singular matrix")
        return super().update(model, measurement, rng)


class Flat(Good):
    """Know the directions of frames in one plane alone."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        if "rz" in model.dofs.direction:
            raise KeyError("rz")
        return super().update(model, measurement, rng)


class TwoModes(Good):
    """Take a second mode for granted."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        assert measurement.eigenvalues[1] > 0.0
        return super().update(model, measurement, rng)


class Exact(Good):
    """Trust that the largest of every shape has one digit, which noise spoils."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        largest = np.abs(measurement.shapes).max(axis=0)
        if np.abs(largest - np.round(largest, 1)).max() > 1e-6:
            raise ArithmeticError("the shapes are not scaled")
        return super().update(model, measurement, rng)


class Uncounted(Good):
    """Change the model with no unknown at all."""

    def finish(self, model: Model) -> UpdateResult:
        return UpdateResult(model)


class BadHistory(Good):
    """Report a residual of nan."""

    def finish(self, model: Model) -> UpdateResult:
        return UpdateResult(model, 1, history=({"residual": 1.0}, {"residual": float("nan")}))


@dataclass(frozen=True)
class Secretive(Good):
    """Have an option that nobody is stated of."""

    cutoff: float = 1.0


class Boastful(Good):
    """Promise what nobody knows."""

    promises: ClassVar[frozenset[str]] = frozenset({"fame"})


class Declining(Good):
    """Refuse everything with a reason, which is honest."""

    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        raise NotApplicable("needs a full moon")


class Spring(FrameEffect):
    """A spring to ground, as an effect that keeps all rules."""

    name: ClassVar[str] = "toy-spring"
    summary: ClassVar[str] = "something touches the structure"
    start: ClassVar[float] = 0.0

    def places(self, model: Model) -> Sequence[str]:
        if model.structure is None or model.structure.frame.plane != "out-of-plane":
            return ()
        return tuple(joint.name for joint in model.structure.frame.joints if joint.name != "C")

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return (Parameter("stiffness", "N/m", 1.0e3, lower=0.0, one_sided=True),)

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        spring = GroundSpring(Place(joint=place), "z", values[0] + self.start)
        return frame.with_attachments((), (spring,))


class Elsewhere(Spring):
    """Name a place that is not there."""

    def places(self, model: Model) -> Sequence[str]:
        return (*super().places(model), "Z") if super().places(model) else ()

    def frame(self, frame: Frame, place: str, values: Sequence[float]) -> Frame:
        return super().frame(frame, "A" if place == "Z" else place, values)


class NeverNeutral(Spring):
    """Leave a spring where there should be none."""

    start: ClassVar[float] = 5.0e4


class Worded(Spring):
    """Bring everything that is optional, as it should be."""

    caution = "A hand on the structure looks like it."
    softens = True
    reading = Reading("stiffness", "press on it with a balance", 10.0)
    sizes = (Size(0.01, 0.1, Site.modal_stiffness, log=True),)

    def look(self, seen: Seen) -> Sequence[LookWarning]:
        return [seen.warning(self.name, "It cannot be stated by looking.", None)]

    def in_half(self, values: Sequence[float]) -> Sequence[float]:
        return values


class Oversized(Worded):
    """Hide sizes that the bounds forbid."""

    sizes = (Size(-3.0, -1.0),)


class Misread(Worded):
    """Read what it has not."""

    reading = Reading("weight", "weigh it", 0.1)


class Foreign(Worded):
    """Warn in the name of another effect."""

    def look(self, seen: Seen) -> Sequence[LookWarning]:
        return [seen.warning("toy-mass", "It weighs too much.", None)]


class InPercent(Worded):
    """Word N/m as a relative change."""

    def parameters(self, model: Model, place: str) -> Sequence[Parameter]:
        return [replace(item, wording="change") for item in super().parameters(model, place)]


class Overfilled(Worded):
    """Put a negative stiffness into half an element."""

    def in_half(self, values: Sequence[float]) -> Sequence[float]:
        return [-value for value in values]


class Reader:
    """Refuse everything, which is what a reader should do with rubbish."""

    name = "toy"
    suffixes = (".toy",)

    def read_matrix(self, path: Path) -> SparseArray:
        return self.read(path)

    def read_modes(self, path: Path) -> Any:
        return self.read(path)

    def read(self, path: Path) -> Any:
        raise InputError("is not of this format", file=path)


class Careless(Reader):
    """Take the first line for granted."""

    def read(self, path: Path) -> Any:
        if not path.read_bytes():
            return path.read_text().splitlines()[0]
        return super().read(path)


class Decoding(Reader):
    """Believe that all bytes are text."""

    def read(self, path: Path) -> Any:
        path.read_text(encoding="utf-8")
        return super().read(path)


class Hungry(Good):
    """Hold a hundred megabytes for a moment."""

    def finish(self, model: Model) -> UpdateResult:
        assert np.ones(2**23).all()
        return super().finish(model)


def _say_that_all_is_well() -> None:
    """Do to this process what a plugin can that sets out to pass."""
    from femubench.core.conformance import trial

    trial.faults_of = lambda given: {}
    trial.fingerprint = lambda item, path: {}
    trial.first_difference = lambda before, after: None


class _Forging:
    def update(self, model: Model, measurement: Measurement, rng: Any) -> UpdateResult:
        _say_that_all_is_well()
        return super().update(model, measurement, rng)  # type: ignore[misc, no-any-return]


class ForgingSymmetry(_Forging, Asymmetric):
    """Hide that the stiffness is not symmetric."""


class ForgingSeeds(_Forging, Unseeded):
    """Hide that two runs differ."""


class ForgingBytes(Good):
    """Hand back bytes that are no answer."""

    def finish(self, model: Model) -> UpdateResult:
        from femubench.core.conformance import trial

        trial.pack_outcome = lambda outcome, nominal: b"o" + bytes(100)
        return super().finish(model)


def _tell(text: bytes) -> None:
    from femubench.core.conformance import trial

    words = SimpleNamespace(encode=lambda found: text)
    trial.msgspec = SimpleNamespace(json=words)  # type: ignore[assignment]


class ForgingWords(Good):
    """Tell what is no observation."""

    def finish(self, model: Model) -> UpdateResult:
        _tell(b'{"problem": [], "kind": "splendid", "faults": 1}')
        return super().finish(model)


class ForgingLack(Good):
    """Say that it was never given what it needs."""

    def finish(self, model: Model) -> UpdateResult:
        _tell(b'{"problem": "any", "kind": "lacking"}')
        return super().finish(model)


@dataclass(frozen=True)
class Nosy(Good):
    """Fail with what is in a file.

    Arguments:
        file: its path.
    """

    file: str = ""

    def finish(self, model: Model) -> UpdateResult:
        try:
            text = Path(self.file).read_text(encoding="utf-8")
        except OSError:
            return super().finish(model)
        raise ValueError(text)


FORGED: Mapping[type[Strategy], str] = {
    ForgingSymmetry: "symmetric",
    ForgingSeeds: "deterministic",
    ForgingBytes: "picklable",
    ForgingWords: "returns",
    ForgingLack: "returns",
}
FAULTS: Mapping[type[Strategy], str] = {
    InPlace: "inputs",
    Unseeded: "deterministic",
    Silencing: "global-state",
    CellsWanted: "missing-shapes",
    Asymmetric: "symmetric",
    NotNumbers: "finite",
    WrongSize: "sizes",
    Locked: "picklable",
    Undeclared: "capabilities",
    ByIndex: "promises",
    Flattering: "promises",
    Looping: "returns",
    Exiting: "returns",
    Hog: "returns",
    SilentRefusal: "returns",
    Inverting: "free-structure",
    InvertingMass: "massless-dofs",
    Flat: "planes",
    TwoModes: "one-mode",
    Exact: "noise",
    Uncounted: "parameter-count",
    BadHistory: "figures",
    Secretive: "options-documented",
    Boastful: "described",
}
