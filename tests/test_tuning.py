"""`benchmarks/tuning.py`: chosen on one half, stated on the other."""

from __future__ import annotations

import math

import pytest
from tuning import tuned


def test_a_setting_is_chosen_on_one_half_and_told_on_the_other() -> None:
    names = ("x", "x:lucky=true", "x:good=true")
    factors = {"x": (1.0, 1.0), "x:lucky=true": (0.2, 3.0), "x:good=true": (0.5, 0.5)}
    logs = {
        name: {s: math.log(pair[i]) for i, half in enumerate(("ab", "cd")) for s in half}
        for name, pair in factors.items()
    }
    found = tuned("x", names, logs, {"a", "b"})
    assert (found.best, found.default, found.tuned) == ("lucky=true", 1.0, pytest.approx(3.0))
    assert found.best_of_all == ("good=true", pytest.approx(0.5), 1.0)
    assert found.gain == "-"  # two structures give no interval
