"""When each update of a re-run of the papers is done: the figures of `femubench.papers.DONE`.

python benchmarks/reproduce_updates.py [MOST]    # so many updates of each paper, in one run
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress

from femubench.core.library.cases import usable_plugins
from femubench.core.library.reproduce import studies_of
from femubench.papers import DONE

_RUNS = 3


def ends_of(paper: str, most: int) -> list[float]:
    """Return the processor time in s to the end of each update, and of all of them."""
    begin, ends = time.process_time(), list[float]()

    def note(_: object) -> None:
        ends.append(time.process_time() - begin)
        if len(ends) == most:
            raise TimeoutError

    with suppress(TimeoutError):
        studies_of([paper], usable_plugins(), note)
        ends.append(time.process_time() - begin)
    return ends


def main() -> None:
    """Measure and print."""
    most = int(sys.argv[1]) if sys.argv[1:] else 0
    for paper in DONE:
        runs = [ends_of(paper, most) for _ in range(1 if most else _RUNS)]
        print(f"{paper}:", *(f"{100.0 * min(ends):.0f}," for ends in zip(*runs, strict=True)))


if __name__ == "__main__":
    main()
