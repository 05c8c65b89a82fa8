"""Sixty variants of the suite with one fault each in the data, or in what was typed in.

    python -m truths.faults        # writes truths/data/faults/, says what differs

A fault edits the files of its structure; nothing else of the structure changes. Everything comes
from one seed and from the suite.
"""

from __future__ import annotations

import csv
import io
import shutil
import tempfile
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from femubench import Case, read_case
from femubench.core.case.tables import RESERVED
from femubench.core.challenge.posing import CASE_FILE, overlay
from femubench.core.challenge.truth_file import (
    TRUTH_FILE,
    KnownCase,
    TrueCause,
    read_truth,
)
from femubench.core.errors import InputError
from femubench.core.fit.residuals import Data
from femubench.core.modal.eigen import enough_modes, solve_modes
from truths.posing import FAULTS, SUITE, first_folders
from truths.truth_text import rounded, truth_text

SEED = 12_000
TURNED = 0.02  # a section whose sizes differ by less looks the same when turned
Rows = list[dict[str, str]]


@dataclass(frozen=True)
class Structure:
    """A structure of the suite, whose files a fault edits.

    Arguments:
        folder: with its `case.toml`.
    """

    folder: Path

    @property
    def name(self) -> str:
        """Return the name of its folder."""
        return self.folder.name

    @cached_property
    def text(self) -> str:
        """Return its `case.toml`."""
        return (self.folder / CASE_FILE).read_text(encoding="utf-8")

    @cached_property
    def spec(self) -> dict[str, Any]:
        """Return the tables of its `case.toml`."""
        return tomllib.loads(self.text)

    @cached_property
    def sound(self) -> Case:
        """Return the case without a fault."""
        return read_case(self.folder)

    @property
    def modes_file(self) -> str:
        """Return the name of the file of its modes."""
        return str(self.spec["measurement"]["modes"])

    def modes(self) -> Rows:
        """Return the cells of its modes as they are written."""
        text = (self.folder / self.modes_file).read_text(encoding="utf-8")
        return list(csv.DictReader(io.StringIO(text)))

    @cached_property
    def used(self) -> tuple[int, ...]:
        """Return the used modes in the order of their frequencies."""
        hertz = {int(row["mode"]): float(row["frequency"]) for row in self.modes()}
        return tuple(sorted(self.spec["measurement"]["used"], key=hertz.__getitem__))

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Return the sensors at which every used mode was measured."""
        rows = [row for row in self.modes() if int(row["mode"]) in self.used]
        columns = [c for c in rows[0] if c not in RESERVED and c.removesuffix("_std") == c]
        return tuple(column for column in columns if all(row[column] for row in rows))

    def members(self, key: str, name: str) -> tuple[str, ...]:
        """Return the members of a section or a material."""
        members = self.spec["model"].get("members", ())
        return tuple(member["name"] for member in members if member[key] == name)


@dataclass(frozen=True)
class Draft:
    """A fault as it was drawn: the files that differ, and what is wrong."""

    files: Mapping[str, str]
    cause: TrueCause


# What a fault can be on a structure, and what has to be drawn as well.
Option = tuple[Any, ...]
Options = Callable[[Structure, int], Sequence[Option]]
Make = Callable[[Structure, Option, np.random.Generator], Draft]


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault.

    Arguments:
        effect: slug.
        kind: of the truth.
        count: how many are drawn.
        options: where the n-th fault of its kind may sit on a structure; nothing where it cannot.
        make: the fault at one of them.
    """

    effect: str
    kind: str
    count: int
    options: Options
    make: Make


def _written(rows: Rows) -> str:
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue()


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def _times(cell: str, factor: float) -> str:
    """Return a cell times a factor; an empty one was not measured."""
    return f"{float(cell) * factor + 0.0:.7g}" if cell else cell


def _edited(structure: Structure, edit: Callable[[Any], None]) -> Mapping[str, str]:
    """Return `case.toml` after an edit that leaves all else as it is written."""
    document = tomlkit.parse(structure.text)
    edit(document)
    return {CASE_FILE: tomlkit.dumps(document)}


def _outlier(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    (mode,) = option
    size = _log_uniform(rng, 0.01, 0.1) * (-1.0, 1.0)[rng.integers(2)]
    rows = structure.modes()
    row = next(row for row in rows if int(row["mode"]) == mode)
    row["frequency"] = _times(row["frequency"], 1.0 + size)
    word = "high" if size > 0.0 else "low"
    what = f"the frequency of mode {mode} is {100.0 * abs(size):.3g} % too {word}"
    cause = TrueCause(what, "frequency-outlier", f"mode:{mode}", size=size)
    return Draft({structure.modes_file: _written(rows)}, cause)


def _modes_swapped(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    rows = structure.modes()
    one, two = (next(row for row in rows if int(row["mode"]) == mode) for mode in option)
    for column in ("frequency", "frequency_std", "damping"):
        if column in one:
            one[column], two[column] = two[column], one[column]
    what = f"modes {option[0]} and {option[1]} have each other's frequencies"
    cause = TrueCause(what, "modes-swapped", f"mode:{option[0]}+{option[1]}")
    return Draft({structure.modes_file: _written(rows)}, cause)


def _sensor_gained(
    structure: Structure, label: str, factor: float, what: str, effect: str
) -> Draft:
    rows = structure.modes()
    for row in rows:
        row[label] = _times(row[label], factor)
        if f"{label}_std" in row:
            row[f"{label}_std"] = _times(row[f"{label}_std"], abs(factor))
    size = factor if factor > 0.0 else None
    cause = TrueCause(what, effect, f"sensor:{label}", size=size)
    return Draft({structure.modes_file: _written(rows)}, cause)


def _sensor_sign(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    what = f"sensor {option[0]} reads with the wrong sign"
    return _sensor_gained(structure, option[0], -1.0, what, "sensor-sign")


def _sensor_gain(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    gain = _log_uniform(rng, 0.3, 3.0)
    what = f"sensor {option[0]} reads {gain:g} times what it should"
    return _sensor_gained(structure, option[0], gain, what, "sensor-gain")


def _sensors_swapped(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    one, two = option
    rows = structure.modes()
    for row in rows:
        for end in ("", "_std"):
            if f"{one}{end}" in row and f"{two}{end}" in row:
                row[one + end], row[two + end] = row[two + end], row[one + end]
    what = f"the cables of sensors {one} and {two} are swapped"
    cause = TrueCause(what, "sensors-swapped", f"sensor:{one}+{two}")
    return Draft({structure.modes_file: _written(rows)}, cause)


def _sigmas(structure: Structure, number: int) -> Sequence[Option]:
    quantity, factor = [(q, f) for q in ("frequencies", "shapes") for f in (1 / 3, 3.0)][number % 4]
    stated = all(row.get("frequency_std") for row in structure.modes())
    return [(quantity, factor)] if stated else []


def _sigma_misstated(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    quantity, factor = option
    rows = structure.modes()
    of_shapes = [c for c in rows[0] if c.endswith("_std") and c != "frequency_std"]
    files: dict[str, str] = {}
    columns = ["frequency_std"] if quantity == "frequencies" else of_shapes
    if columns:
        for row in rows:
            row.update({column: _times(row[column], factor) for column in columns})
        files[structure.modes_file] = _written(rows)
    else:
        share = float(f"{structure.spec['measurement'].get('shape_std', 0.015) * factor:.4g}")
        files.update(_edited(structure, lambda d: d["measurement"].update(shape_std=share)))
    word = "three times" if factor > 1.0 else "a third of"
    what = f"the deviations of the {quantity} are stated as {word} what they are"
    return Draft(files, TrueCause(what, "sigma-misstated", "data", size=rounded(factor)))


def _slips(structure: Structure, number: int) -> Sequence[Option]:
    """Return the numbers in which a unit may slip: in turn E, a density, a size of a section."""
    model = structure.spec["model"]
    key = ("E", "rho", "size")[number % 3]
    if key == "size":
        sizes = ("width", "height", "diameter")
        return [
            ("sections", name, size, 1e3)
            for name, section in model.get("sections", {}).items()
            for size in sizes
            if size in section and structure.members("section", name)
        ]
    factor = 1e3 if key == "E" and number % 2 else 1e-3
    materials = model.get("materials", {})
    return [
        ("materials", name, key, factor)
        for name in materials
        if structure.members("material", name)
    ]


_SLIP_WORDS = {
    ("E", 1e-3): "is a thousandth of what it is, GPa typed as MPa",
    ("E", 1e3): "is a thousand times what it is, MPa typed as GPa",
    ("rho", 1e-3): "is typed in g/cm3",
}


def _unit_slip(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    table, name, key, factor = option
    old = structure.spec["model"][table][name][key]
    new = float(f"{old * factor:.10g}")

    def edit(document: Any) -> None:  # noqa: ANN401 - as tomlkit has it
        document["model"][table][name][key] = new

    words = _SLIP_WORDS.get((key, factor), "is typed in mm")
    kind = table.removesuffix("s")
    cause = TrueCause(
        f"{key} of {kind} {name} {words}",
        "unit-slip",
        f"{kind}:{name}",
        _same_as_slip(structure, kind, name, key),
        factor,
    )
    return Draft(_edited(structure, edit), cause)


def _same_as_slip(structure: Structure, kind: str, name: str, key: str) -> tuple[str, ...]:
    """Return the effects that change just what a slip in a material changes."""
    members = structure.members(kind, name)
    if kind != "material":
        return ()
    if len(members) == len(structure.spec["model"]["members"]):
        return ("youngs-modulus@all" if key == "E" else "density@all",)
    effect = "member-stiffness" if key == "E" else "member-mass"
    return (f"{effect}@{members[0]}",) if len(members) == 1 else ()


_ACROSS = (("width", "height"), ("Iy", "Iz"))


def _turnable(structure: Structure, number: int) -> Sequence[Option]:
    """Return the sections that are not the same about both axes."""
    found = []
    for name, section in structure.spec["model"].get("sections", {}).items():
        pairs = [pair for pair in _ACROSS if any(key in section for key in pair)]
        whole = all(key in section for pair in pairs for key in pair)
        unequal = whole and any(abs(section[a] / section[b] - 1.0) > TURNED for a, b in pairs)
        if unequal and structure.members("section", name):
            found.append((name,))
    return found


def _section_turned(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    (name,) = option

    def edit(document: Any) -> None:  # noqa: ANN401 - as tomlkit has it
        section = document["model"]["sections"][name]
        for one, two in _ACROSS:
            if one in section:
                section[one], section[two] = section[two].unwrap(), section[one].unwrap()

    what = f"section {name} is turned by a right angle"
    cause = TrueCause(what, "section-turned", f"section:{name}")
    return Draft(_edited(structure, edit), cause)


def _supports(structure: Structure, number: int) -> Sequence[Option]:
    """Return the supports that may be forgotten, in turn whole ones and one direction of one."""
    supports = structure.spec["model"].get("supports", ())
    if number % 2:
        return [
            (i, direction)
            for i, support in enumerate(supports)
            for direction in support["fixed"]
            if len(support["fixed"]) > 1
        ]
    return [(i, "") for i in range(len(supports)) if len(supports) > 1]


def _support_missing(structure: Structure, option: Option, rng: np.random.Generator) -> Draft:
    index, direction = option
    at = structure.spec["model"]["supports"][index]["at"]
    at = at if isinstance(at, str) else f"{at['member']}@{at['s']:g}"

    def edit(document: Any) -> None:  # noqa: ANN401 - as tomlkit has it
        supports = document["model"]["supports"]
        if direction:
            supports[index]["fixed"].remove(direction)
        else:
            supports.pop(index)

    axis = direction.lstrip("+-")
    cause = TrueCause(
        f"the support at {at} is forgotten" + (f" in direction {axis}" if axis else ""),
        "support-missing",
        f"support:{at}" + (f":{axis}" if axis else ""),
        (f"grounding-spring@{at}:{axis}",) if axis else (),
    )
    return Draft(_edited(structure, edit), cause)


def _used_modes(structure: Structure, number: int) -> Sequence[Option]:
    return [(mode,) for mode in structure.used]


def _neighbours(structure: Structure, number: int) -> Sequence[Option]:
    return list(pairwise(structure.used))


def _one_sensor(structure: Structure, number: int) -> Sequence[Option]:
    return [(label,) for label in structure.labels]


def _two_sensors(structure: Structure, number: int) -> Sequence[Option]:
    return list(combinations(structure.labels, 2))


# What few structures can have comes first, so that the others find even room.
FAULT_KINDS = (
    FaultKind("support-missing", "input-fault", 5, _supports, _support_missing),
    FaultKind("section-turned", "input-fault", 5, _turnable, _section_turned),
    FaultKind("unit-slip", "input-fault", 6, _slips, _unit_slip),
    FaultKind("modes-swapped", "data-fault", 6, _neighbours, _modes_swapped),
    FaultKind("sensors-swapped", "data-fault", 6, _two_sensors, _sensors_swapped),
    FaultKind("sensor-sign", "data-fault", 7, _one_sensor, _sensor_sign),
    FaultKind("sensor-gain", "data-fault", 7, _one_sensor, _sensor_gain),
    FaultKind("sigma-misstated", "data-fault", 8, _sigmas, _sigma_misstated),
    FaultKind("frequency-outlier", "data-fault", 10, _used_modes, _outlier),
)


def drafts(structures: Sequence[Structure]) -> Iterator[tuple[Structure, KnownCase, Draft]]:
    """Yield every fault with its structure and its truth, not yet with its visibility.

    A fault goes to the structure that has fewest of its kind, then fewest of all.

    Arguments:
        structures: of the suite.

    Raises:
        InputError: when no structure can have a fault of some kind.
    """
    order = np.random.default_rng(SEED).permutation(len(structures))
    shuffled = [structures[i] for i in order]
    total: Counter[str] = Counter()
    taken: dict[tuple[str, str], list[Option]] = defaultdict(list)
    numbered = ((kind, number) for kind in FAULT_KINDS for number in range(kind.count))
    for seed, (kind, number) in enumerate(numbered, SEED + 1):
        free = {
            s: [o for o in kind.options(s, number) if o not in taken[kind.effect, s.name]]
            for s in shuffled
        }
        possible = [s for s in shuffled if free[s]]
        if not possible:
            what = f"no structure can have {kind.effect} number {number + 1}"
            raise InputError(what, expected=f"a suite with room for {kind.count}")
        least = min((len(taken[kind.effect, s.name]), total[s.name]) for s in possible)
        structure = next(
            s for s in possible if (len(taken[kind.effect, s.name]), total[s.name]) == least
        )
        rng = np.random.default_rng(seed)
        option = free[structure][int(rng.integers(len(free[structure])))]
        draft = kind.make(structure, option, rng)
        taken[kind.effect, structure.name].append(option)
        total[structure.name] += 1
        again = len(taken[kind.effect, structure.name])
        name = f"{structure.name}-{kind.effect}" + (f"-{again}" if again > 1 else "")
        yield structure, KnownCase(name, structure.name, kind.kind, seed, (draft.cause,)), draft


def change_of_data(sound: Case, faulty: Case) -> tuple[float, float]:
    """Return chi-square of the change of the used modes, and the part of the frequencies.

    Deviations are those of the sound data; shapes are compared at their best common scale.
    """
    stated = replace(sound.used_measurement(), total_mass=None)
    other = faulty.used_measurement()
    readings = np.nan_to_num(other.shapes)[None]
    data = Data(stated, np.zeros(0))
    squares = np.square(data.residual(other.frequencies[None], readings, np.zeros(1))[0])
    return float(squares.sum()), float(squares[: len(stated)].sum())


def change_of_model(sound: Case, faulty: Case) -> tuple[float, float]:
    """Return chi-square of the change of what the model predicts for the used modes, twice.

    By number, rigid modes included, frequencies alone: shapes of modes that trade places, or of a
    pair of equal frequencies, would say nothing of the size of the fault.
    """
    stated = sound.used_measurement()
    count = enough_modes(sound.model, len(stated))
    modes = solve_modes(sound.model, count)
    readings = np.asarray(sound.model.observe(stated.sensors) @ modes.shapes)
    before = modes.natural_frequencies
    partner = Data(stated, np.zeros(0)).pair(before[None], readings[None])[0]
    after = solve_modes(faulty.model, count).natural_frequencies
    change = (after[partner] - before[partner]) / stated.frequency_std
    chi2 = float(np.square(change).sum())
    return chi2, chi2


def visibility(structure: Structure, truth: KnownCase, draft: Draft) -> tuple[float | None, ...]:
    """Return chi-square of what a fault changes, and the part of the frequencies.

    A misstated deviation changes nothing that was measured: there is none.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder, posed = Path(scratch, "fault"), Path(scratch, "case")
        _write(folder, draft.files)
        overlay(structure.folder, folder, posed)
        faulty = read_case(posed)
    if truth.causes[0].place == "data":
        return None, None
    change = change_of_data if truth.kind == "data-fault" else change_of_model
    return change(structure.sound, faulty)


def faults(suite: Path = SUITE) -> dict[str, Mapping[str, str]]:
    """Return the files of every fault by its name; nothing where there is no suite.

    Arguments:
        suite: where the structures are.
    """
    structures = [Structure(folder) for folder in first_folders(suite)]
    found: dict[str, Mapping[str, str]] = {}
    for structure, truth, draft in drafts(structures) if structures else ():
        chi2, part = visibility(structure, truth, draft)
        truth = replace(truth, chi2=chi2, chi2_frequencies=part)
        found[truth.name] = {**draft.files, TRUTH_FILE: truth_text(truth)}
    return found


def _write(folder: Path, files: Mapping[str, str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")


def files_of(folder: Path) -> dict[str, str]:
    """Return the text of every file in a folder."""
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.iterdir())}


def write_faults(suite: Path = SUITE, target: Path = FAULTS) -> list[str]:
    """Write every fault into a folder of its own, remove those that are none any more.

    Arguments:
        suite: where the structures are.
        target: where the faults go.

    Returns:
        One line for every fault that differs from what was there.
    """
    new = faults(suite)
    lines = []
    for folder in sorted(target.glob("*/")):
        if folder.name not in new and read_truth(folder).kind.endswith("-fault"):
            shutil.rmtree(folder)
            lines.append(f"{folder.name}: removed")
    for name, files in new.items():
        folder = target / name
        old = files_of(folder) if folder.is_dir() else {}
        if old == files:
            continue
        if old:
            shutil.rmtree(folder)
        _write(folder, files)
        differs = sorted(key for key in {*old, *files} if old.get(key) != files.get(key))
        lines.append(f"{name}: {', '.join(differs) if old else 'new'}")
    return lines


if __name__ == "__main__":
    changed = write_faults()
    print(*changed, f"{len(changed)} faults differ from what was there", sep="\n")
