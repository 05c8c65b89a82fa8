"""When each update of a re-run of the papers is done: the figures of `femubench.papers.DONE`.

python benchmarks/reproduce_updates.py
"""

from __future__ import annotations

import time

from femubench.core.library.cases import usable_plugins
from femubench.core.library.reproduce import studies_of
from femubench.papers import DONE

_RUNS = 3


def main() -> None:
    plugins = usable_plugins()
    for paper in DONE:
        least: list[float] = []
        for _ in range(_RUNS):
            begin, ends = time.process_time(), list[float]()
            studies_of([paper], plugins, lambda _, ends=ends: ends.append(time.process_time()))
            ends = [end - begin for end in (*ends, time.process_time())]
            least = [min(pair) for pair in zip(least or ends, ends, strict=True)]
        print(f"{paper}:", *(f"{100.0 * seconds:.0f}," for seconds in least))


if __name__ == "__main__":
    main()
