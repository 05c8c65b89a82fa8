"""Whether what is left is noise: chi-square of all data, and of each part that may be off alone."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2 as chi_square

from femubench.core.diagnosis.fit import State
from femubench.core.typing import FloatArray


def adequacy(state: State, unknowns: int) -> float:
    """Return the probability of residuals as large as these, were they noise.

    The smallest of the probabilities of all data, of the frequencies, of the shape of any one
    mode and of any one sensor, times the number of these looks (Bonferroni): a sensor that reads
    wrong is hidden in the sum over many good ones.

    Arguments:
        state: after the fit.
        unknowns: number of values that were fitted.
    """
    data = state.problem.data
    count, modes = len(data.measurement), len(state.partner)
    residual = state.residual
    mode, sensor = data.shape_rows
    total = _tail(residual, unknowns + data.scale_count)
    looks = [total, _tail(residual[:count], 0)]
    shape = residual[count : count + len(mode)]
    by_mode = [_tail(shape[mode == j], 1) for j in range(modes) if (mode == j).sum() > 2]
    by_sensor = [_tail(shape[sensor == s], 0) for s in np.unique(sensor)]
    parts = [min(ps) * len(ps) for ps in (by_mode, by_sensor) if ps]
    return float(min(1.0, total, len(looks + parts) * min(looks + parts)))


def _tail(residual: FloatArray, unknowns: int) -> float:
    dof = max(len(residual) - unknowns, 1)
    return float(chi_square.sf(residual @ residual, dof)) if len(residual) else 1.0
