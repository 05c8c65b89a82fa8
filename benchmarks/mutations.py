"""How many wrong lines of numerics and judging the tests see: one line changed at a time.

    python benchmarks/mutations.py [--only WORD] [--quick] [--list] [--root DIR]

Every change is made in a temporary copy of the tree, where the test files named with it are run:
killed when one of them fails, survived when all pass, stale where the text is not there once, in
its file or else in one of core. With --quick the tests are those of `make check`.
The table: a file :: its tests, then lines of old => new.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

TABLE = """
core/fem/beam.py :: beam_elements textbook
    a, b = 6.0 * L, 4.0 + phi => a, b = 6.0 * L, 4.0 - phi
    t3 = 35 * phi**2 + 63 * phi + 27 => t3 = 35 * phi**2 + 63 * phi + 26
    transform[:, 1, 5], transform[:, 2, 4] = first, -first => transform[:, 1, 5] = first
    bar * (self.GJ / L) => bar * (self.GJ / self.length)
core/fem/assembly.py :: assembly
    > 1e-13 * scale => > 1e-3 * scale
core/fem/attaching.py :: attachments frame_extensions
    *= [share, 1.0 - share] => *= [0.5, 0.5]
    (1.0 - share) * first + share * last => share * first + (1.0 - share) * last
core/fem/preload.py :: preload
    GRAVITY = 9.80665 => GRAVITY = 10.0
    moment - 0.5 * length * np.cross => moment + 0.5 * length * np.cross
core/modal/correlation.py :: pairing expansion
    left.conj().T @ right => left.T @ right
    right.conj() * left => right * left
core/modal/pairing.py :: pairing
    LEAST_MAC = 0.5 => LEAST_MAC = 0.4
    LEAST_SENSORS = 3 => LEAST_SENSORS = 2
    WINDOW = 2.0 => WINDOW = 2.5
    WINDOW_WITHOUT_SHAPE = 1.4 => WINDOW_WITHOUT_SHAPE = 3.0
    FREQUENCY_WEIGHT = 0.25 => FREQUENCY_WEIGHT = 0.4
    _WITHOUT_SHAPE = 1e-4 => _WITHOUT_SHAPE = 1.0
core/modal/close_modes.py :: close_modes
    along.T @ measured => across @ along.T @ measured
    > closeness * abs(first) => > closeness * first
core/modal/eigen.py :: eigen rigid_modes
    1.0 / mu - => 1.0 / mu - 0.0 *
    _ROUNDOFF = 32.0 => _ROUNDOFF = 0.0
core/modal/expansion.py :: expansion
    full @ rotation.T), rotation => full @ rotation), rotation
core/change/change.py :: change_lists
    (up - down).diagonal() => 2.0 * _SLOPE_STEP
core/change/parametric_model.py :: change_lists
    sums[term.matrix] + factor * matrix => sums[term.matrix] - factor * matrix
    np.where(set_alone, self.growth(x), 1.0) => np.where(set_alone, 1.0, 1.0)
core/fit/gauss_newton.py :: diagnosis_fit
    (at <= low) & (step < 0.0) => (at <= low) & (step > 0.0)
    np.diag(self.precision) => 1e-9 * np.diag(self.precision)
core/fit/modal_fit.py :: diagnosis_fit
    (8.0 * np.pi**2 * moving) => (4.0 * np.pi**2 * moving)
core/fit/noise.py :: model_error
    log_weight - float(np.log => log_weight + float(np.log
    self.whiten(raw - self.mean) => self.whiten(raw)
core/inference/model_error.py :: model_error
    scales=found.v, trust= => scales=found.v, trust=1.0**
    weight @ raw[known] => 0.0 * weight @ raw[known]
core/inference/posterior.py :: diagnosis_search diagnosis_verdict
    + trust * self.log_evidence => + self.log_evidence
    self.missed * log( => 0.2 * self.missed * log(
    min(gains) > log( => min(gains) > -9.0 + 0.0 * log(
    - 0.5 * self.chi2 => - self.chi2
core/inference/prior.py :: diagnosis_search
    log(names) + log(part.hypothesis.places) => log(names)
core/update/modal_space.py :: factor_strategies
    _LOST = 1.0 - 1.0 / WINDOW_WITHOUT_SHAPE => _LOST = 0.0
    _DEPENDENT = 1e-8 => _DEPENDENT = 1e-16
    shapes[i] - 2.0 * scale * read => shapes[i] - scale * read
core/update/uncertainty.py :: uncertainty
    _SYMMETRY, _NEGATIVE = 1e-8, 1e-8 => _SYMMETRY, _NEGATIVE = 1e-4, 1e-8
    _SYMMETRY, _NEGATIVE = 1e-8, 1e-8 => _SYMMETRY, _NEGATIVE = 1e-8, 0.0
core/score/scoring.py :: scoring
    closeness = 2.0 * float => closeness = 0.0 * float
    modes.eigenvalues < -reference.zero => modes.eigenvalues < 0.0
    _SAME_MOTION = 0.9 => _SAME_MOTION = 0.1
    mode.predicted_hz <= 0.0 => mode.predicted_hz == 0.0
core/score/ranking.py :: scoring
    TIE = 1e-6 => TIE = 1e-2
core/score/bounded_gain.py :: bounded_gain
    cap: float = math.log(1.4) => cap: float = math.log(2.0)
    max(r, e, rule.floor) => max(r, rule.floor)
    float(heights[i, j] / heights[i, partner]) => 1.0
    & ~taken => & True
    c.weight >= rule.visible => c.weight >= 0.0
core/score/predictive.py :: uncertainty
    np.delete(units, k, axis=0) => units
    2.0 * density - 1.0 / np.sqrt(np.pi) => 2.0 * density - 1.0 / np.pi
core/score/twin_gain.py :: twins
    frozenset({"timeout", "crashed"}) => frozenset({"crashed"})
    CLEAR, KNOWN = 0.1, 3.0 => CLEAR, KNOWN = 0.001, 3.0
core/run/store.py :: harness_store resume
    or record.status in DONE or known => or True or known
core/run/model_checks.py :: harness_jobs
    _SYMMETRY = 1e-8 => _SYMMETRY = 1e-4
core/run/judging.py :: uncertainty
    check_model(sample, outcome.model) => pass
"""
QUICK = ("-m", "not slow and not nightly")
SECONDS = 120  # of the processor, for the test files of one change
LEFT_OUT = shutil.ignore_patterns(".git", "*_cache", "__pycache__", "femubench-results", "docs")


class Mutation(NamedTuple):
    """One change of a file, and the test files that should see it."""

    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.file}: {self.old} => {self.new}"

    def place(self, root: Path) -> Path | None:
        """Return the file that holds the old text once; None where it is stale."""
        texts = {file: file.read_text() for file in root.glob("core/**/*.py")}
        holding = [file for file, text in texts.items() if self.old in text]
        own = [file for file in holding if file == root / self.file] or holding
        return own[0] if len(own) == 1 and texts[own[0]].count(self.old) == 1 else None


def mutations() -> Iterator[Mutation]:
    """Yield the table."""
    file, tests = "", ""
    for line in filter(None, TABLE.splitlines()):
        if " :: " in line:
            file, tests = line.split(" :: ")
        else:
            old, new = line.strip().split(" => ")
            yield Mutation(file, old, new, tuple(f"tests/test_{t}.py" for t in tests.split()))


def first_failure(root: Path, words: Iterable[str], seconds: int) -> str:
    """Return the first test that fails in a tree, empty where all pass.

    Arguments:
        words: for pytest: files, and which of their tests.
    """
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *words],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds)),
    )
    if done.returncode in (0, 5):  # 5 where none of the tests is chosen
        return ""
    named = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return named.group(1) if named else f"no more than exit status {done.returncode}"


def outcome(mutation: Mutation, root: Path, which: Iterable[str]) -> tuple[str, str]:
    """Return killed, survived or stale, and the test that saw the change."""
    file = mutation.place(root)
    if file is None:
        return "stale", ""
    before = file.read_text()
    file.write_text(before.replace(mutation.old, mutation.new))
    test = first_failure(root, (*which, *mutation.tests), SECONDS)
    file.write_text(before)
    return ("killed", f"  by {test}") if test else ("survived", "")


def main() -> None:
    """Run the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--only", default="", help="changes with this in file, text or tests")
    parser.add_argument("--quick", action="store_true", help="with the tests of `make check` alone")
    parser.add_argument("--list", action="store_true", help="print the table and where it is stale")
    parser.add_argument("--root", type=Path, default=Path(__file__).parents[1], help="the tree")
    asked = parser.parse_args()
    chosen = [m for m in mutations() if asked.only in f"{m} {' '.join(m.tests)}"]
    if asked.list:
        stale = [m for m in chosen if m.place(asked.root) is None]
        for m in chosen:
            print(f"{'STALE ' if m in stale else ''}{m}  [{' '.join(m.tests)}]")
        raise SystemExit(1 if stale else 0)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "tree"
        shutil.copytree(asked.root, root, symlinks=True, ignore=LEFT_OUT)
        tests = dict.fromkeys(test for m in chosen for test in m.tests)
        which = QUICK if asked.quick else ()
        if test := first_failure(root, (*which, *tests), SECONDS * len(tests)):
            raise SystemExit(f"{test} fails without any change")
        counts: Counter[str] = Counter()
        for m in chosen:
            word, test = outcome(m, root, which)
            counts[word] += 1
            print(f"{word:8} {m}{test}", flush=True)
    print(", ".join(f"{n} {word}" for word, n in counts.items()), f"of {len(chosen)}")


if __name__ == "__main__":
    main()
