"""How good the time left of `bench diagnose` is, and what its pieces take: docs of Effort.

python benchmarks/time_left.py [CASE ...]
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import median

from femubench.core.diagnosis.diagnose import diagnose
from femubench.core.inference.effort import Effort, Kind
from femubench.core.library.cases import one_case, usable_plugins
from femubench.core.pace import Advance

CASES = (
    *("frame", "hframe", "frame-solid", "hframe-solid", "garteur"),
    *("suite/portal", "suite/bracket", "suite/mast-on-pad", "suite/tower", "suite/table-feet"),
)
SHARES = (0.1, 0.25, 0.5, 0.75, 0.9)


class Watched(Effort):
    """An effort by processor time that keeps what it says and what its pieces take."""

    def __init__(self) -> None:
        self.said: list[tuple[float, Advance]] = []
        self.pieces: dict[str, list[float]] = defaultdict(list)
        super().__init__(
            None, lambda a: self.said.append((time.process_time(), a)), time.process_time
        )

    @contextmanager
    def piece(self, kind: Kind) -> Iterator[None]:
        begin = time.process_time()
        with super().piece(kind):
            yield
        self.pieces[kind].append(time.process_time() - begin)


def estimate(said: list[tuple[float, Advance]], begin: float, now: float) -> float | None:
    """Return the seconds in all that the bar stands for at a time; None where it shows none."""
    before = [item for item in said if item[0] <= now]
    if not before or before[-1][1].left is None:
        return None
    then, advance = before[-1]
    assert advance.left is not None
    return now - begin + advance.left - min(now - then, advance.current)


def main(names: list[str]) -> None:
    plugins = usable_plugins()
    weights: dict[str, list[float]] = defaultdict(list)
    print(f"{'case':20} {'s':>6}  estimated over true time at", *SHARES)
    for name in names:
        effort, begin = Watched(), time.process_time()
        diagnose(one_case(name, plugins), tuple(plugins.effects.values()), effort=effort)
        seconds = time.process_time() - begin
        found = [estimate(effort.said, begin, begin + share * seconds) for share in SHARES]
        shown = ("   -" if x is None else f"{x / seconds:4.2f}" for x in found)
        print(f"{name:20} {seconds:6.1f} ", *shown, f"  {effort.said[-1][1]}", flush=True)
        one = median(effort.pieces["single"])
        for kind, pieces in effort.pieces.items():
            weights[kind].append(sum(pieces) / len(pieces) / one)
            print(f"    {kind:10} {len(pieces):3} {weights[kind][-1]:6.3f}")
    for kind, values in weights.items():
        print(f"{kind:10} {median(values):6.3f}")


if __name__ == "__main__":
    main(sys.argv[1:] or list(CASES))
