"""A case under other conditions: louder noise, fewer sensors; what it is scored on stays."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from femubench.core.case.case import Case
from femubench.core.display import count_noun
from femubench.core.modal.measurement import Measurement
from femubench.core.typing import IntArray


@dataclass(frozen=True, repr=False)
class VariedCase(Case):
    """A case of which a strategy is given a noisier or a smaller part.

    Strategies see its `used_measurement`. Scores rest on `measurement` and `modifications`, which
    are those of the case: gain compares along the axes.

    Arguments:
        origin: the case as it is, with the same model.
        noise: factor on all stated standard deviations, and on what is drawn with them.
        left_out: number of sensors that strategies do not see.
    """

    origin: Case | None = None
    noise: float = 1.0
    left_out: int = 0

    def used_measurement(self, seed: int = 0) -> Measurement:
        """Return what a strategy may know; the errors have the deviations that it states.

        The same seed draws the same noise for every factor, scaled, and of fewer sensors leaves
        out the same and more.
        """
        assert self.origin is not None
        louder = replace(
            self.origin.measurement,
            frequency_std=self.noise * self.origin.measurement.frequency_std,
            shape_std=self.noise * self.origin.measurement.shape_std,
        )
        frfs = self.origin.frfs
        if frfs is not None and frfs.deviations is not None:
            frfs = replace(frfs, deviations=self.noise * frfs.deviations)
        whole = replace(self.origin, measurement=louder, frfs=frfs).used_measurement(seed)
        rows = np.setdiff1d(np.arange(len(whole.sensors)), self._hidden(seed))
        fewer, own = whole.sensors.take(rows), whole.responses
        labels = enumerate(() if own is None else own.responses.labels)
        kept = [k for k, label in labels if label in fewer.labels]
        return replace(
            whole, sensors=fewer, shapes=whole.shapes[rows], shape_std=whole.shape_std[rows],
            responses=own and own.take(kept),
        )  # fmt: skip

    def conditions(self, seed: int) -> Mapping[str, float | str]:
        """Return the factor on the noise, and the labels of the sensors left out."""
        labels = self.measurement.sensors.labels
        hidden = " ".join(labels[row] for row in self._hidden(seed))
        return {"noise": self.noise, "sensors_left_out": hidden}

    def _hidden(self, seed: int) -> IntArray:
        assert self.origin is not None
        words = [seed, *f"sensors of {self.origin.name}".encode()]
        order = np.random.default_rng(np.random.SeedSequence(words))
        drawn = order.permutation(len(self.measurement.sensors))[: self.left_out]
        return np.asarray(np.sort(drawn))


def vary_case(case: Case, noise: float, left_out: int) -> Case:
    """Return a case under other conditions; the case itself where they are its own.

    Arguments:
        noise: factor on the stated standard deviations, > 0.
        left_out: number of sensors that strategies do not see.
    """
    if noise == 1.0 and left_out == 0:
        return case
    words = [f"noise {noise:.12g}"] if noise != 1.0 else []
    words += [f"{count_noun(left_out, 'sensor')} left out"] if left_out else []
    digest = hashlib.sha256(f"{', '.join(words)}: {case.digest}".encode()).hexdigest()
    own = {**vars(case), "name": f"{case.name} ({', '.join(words)})", "digest": digest}
    # Whose copies they are: of a structure every copy has a share, and not a vote.
    own["structure"] = case.structure or case.name
    return VariedCase(**own, origin=case, noise=noise, left_out=left_out)
