"""Make the truths again: ``python -m truths [NAME ...] [--only STEP]``.

The steps are suite, drawings, stretches, responses, defects, faults and lacks.

Structures that have not changed since the last run are left out, so that a run goes on where it
was cut.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from truths.structure import Structure

HERE = Path(__file__).parent
STATE = HERE.parent / "build" / "truths.json"
NEEDED = {"gmsh": "gmsh", "skfem": "scikit-fem", "matplotlib": "matplotlib"}
STEPS = ("suite", "drawings", "stretches", "responses", "defects", "faults", "lacks")
# What a solid's figures follow from, in addition to the structure's own file.
SOLVER = (
    "bricks",
    "elasticity",
    "eigenmodes",
    "measurement",
    "modes_of",
    "seats",
    "solid",
    "suite",
)


DEFECTS = ("defects", "defect_cases", "prestress")  # what those of a defect follow from as well
STRETCHES = ("affine", "remade", "reduction", "stretch", "stretch_file")  # and what twins have
# And what drawings lack.
LACKS = ("lacks", "counterfactuals", "section_features", "lacks_file", "drawing")


def digest(name: str, *more: str) -> str:
    """Return a digest of what a structure's files are made from."""
    parts = (*SOLVER, "drawing", "sections", "structure", *more)
    files = [HERE / f"{part}.py" for part in parts]
    files += [HERE / "tetrahedra.py", HERE / "structures" / f"{name.replace('-', '_')}.py"]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def made_before() -> dict[str, str]:
    """Return the digests of the structures that were made."""
    found: dict[str, str] = json.loads(STATE.read_text()) if STATE.exists() else {}
    return found


def note(name: str, what: str) -> None:
    """Write down that something was made, and from what."""
    STATE.parent.mkdir(exist_ok=True)
    STATE.write_text(json.dumps({**made_before(), name: what}, indent=1))


def make_defects(names: list[str], again: bool) -> bool:
    """Write the cases of defects; tell whether all could be made."""
    from truths.defect_cases import Draw, write_all

    def made_from(draw: Draw) -> str:
        hidden = [(d.kind, d.what, d.place, d.also, d.size, d.preload) for d in draw.defects]
        words = f"{digest(draw.structure, *DEFECTS)} {draw.seed} {hidden}"
        return hashlib.sha256(words.encode()).hexdigest()

    before, sound = {} if again else made_before(), True
    for draw, result in write_all(names, lambda d: before.get(d.name) == made_from(d)):
        if isinstance(result, str):
            print(f"{draw.name}: {result}", file=sys.stderr)
            sound = False
            continue
        print("\n".join(result) or f"{draw.name}: as it was", flush=True)
        note(draw.name, made_from(draw))
    return sound


def make_each(
    names: list[str],
    again: bool,
    write: Callable[[Structure, Path], list[str]],
    kind: str = "",
    more: tuple[str, ...] = (),
    among: tuple[str, ...] = (),
) -> bool:
    """Write a kind of files of structures, from more modules; tell whether all were made."""
    from truths.suite import SUITE, structures

    known, sound = structures(), True
    wanted = names or among or known
    for number, name in enumerate(wanted, 1):
        what = digest(name, *more)
        if not (again or names) and made_before().get(name + kind) == what:
            continue
        began = time.perf_counter()
        try:
            said = write(known[name], SUITE)
        except ValueError as error:
            print(f"{name}{kind}: {error}", file=sys.stderr)
            sound = False
            continue
        seconds = time.perf_counter() - began
        print(f"{number}/{len(wanted)} {name}{kind}: {seconds:.0f} s", file=sys.stderr)
        print("\n".join(said) or f"{name}{kind}: as it was", flush=True)
        note(name + kind, what)
    return sound


def make_suite(names: list[str], again: bool) -> bool:
    """Write the folders of the structures; tell whether all could be made."""
    from truths.published import write_garteur
    from truths.suite import SUITE, index_text, structures, write

    sound, known = make_each(names, again, write), structures()
    made = {name: item for name, item in known.items() if (SUITE / name).is_dir()}
    (SUITE / "suite.toml").write_text(index_text(made), encoding="utf-8")
    if "garteur" in (names or known):
        write_garteur()
    return sound


def make_drawings(names: list[str], again: bool) -> bool:
    """Write the solids that engineers draw; tell whether all could be made."""
    from truths.solid_drawing import DRAWN, write

    return make_each(names, again, write, " drawing", ("solid_drawing",), DRAWN)


def make_stretches(names: list[str], again: bool) -> bool:
    """Write the files that twins have their truth from; tell whether all could be made."""
    from truths.stretch_file import write, write_table

    sound = make_each(names, again, write, " stretched", STRETCHES)
    write_table()
    return sound


def make_responses(names: list[str], again: bool) -> bool:
    """Write the cases with frequency responses; tell whether all could be made."""
    from truths.responses import NAMES, write, write_index

    sound = make_each(
        names, again, lambda item, _: write(item), " responses", ("responses",), NAMES
    )
    write_index()
    return sound


def make_lacks(names: list[str], again: bool) -> bool:
    """Write what drawings lack; tell whether all could be made."""
    from truths.lacks import TRIED
    from truths.lacks_file import write, write_table

    sound = make_each(names, again, lambda item, _: write(item), " lacks", LACKS, TRIED)
    write_table()
    return sound


def main() -> int:
    """Run the steps that are asked for; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m truths", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="structures; all by default")
    parser.add_argument("--only", choices=STEPS, help="one step; all by default")
    parser.add_argument("--again", action="store_true", help="also what has not changed")
    options = parser.parse_args()
    lacking = [pip for module, pip in NEEDED.items() if importlib.util.find_spec(module) is None]
    if lacking:
        print(f"the truths need {', '.join(lacking)}: pip install -e '.[truths]'", file=sys.stderr)
        return 2
    from truths.suite import structures

    unknown = [name for name in options.names if name not in structures()]
    if unknown:
        known = ", ".join(structures())
        print(f"no structure {', '.join(unknown)}; there are {known}", file=sys.stderr)
        return 2
    sound = True
    if options.only in (None, "suite"):
        sound = make_suite(options.names, options.again)
    from truths.solid_drawing import DRAWN

    drawn = [name for name in options.names if name in DRAWN or options.only == "drawings"]
    if options.only in (None, "drawings") and (drawn or not options.names):
        sound = make_drawings(drawn, options.again) and sound
    if options.only in (None, "stretches"):
        sound = make_stretches(options.names, options.again) and sound
    from truths.responses import NAMES

    chosen = [name for name in options.names if name in NAMES]
    if options.only in (None, "responses") and (chosen or not options.names):
        sound = make_responses(chosen, options.again) and sound
    if options.only in (None, "defects"):
        sound = make_defects(options.names, options.again) and sound
    if options.only in (None, "faults") and not options.names:
        from truths.faults import write_faults

        print(*write_faults(), sep="\n")
    from truths.lacks import TRIED

    chosen = [name for name in options.names if name in TRIED or options.only == "lacks"]
    if options.only in (None, "lacks") and (chosen or not options.names):
        sound = make_lacks(chosen, options.again) and sound
    return 0 if sound else 1


if __name__ == "__main__":
    raise SystemExit(main())
