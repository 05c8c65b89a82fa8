"""A tiny case and toy strategies, in a module that worker processes can import."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import os
import re
import signal
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.random import Generator

from femubench.core.case.case import Case, Modification
from femubench.core.child.confinement import Confinement
from femubench.core.errors import Diverged, NotApplicable, SelfCheckFailed
from femubench.core.fem.frame import Frame, GroundSpring, Joint, Material, Member, Place, PointMass
from femubench.core.fem.model import LowRank, Model
from femubench.core.fem.parameters import Property
from femubench.core.fem.sections import Section
from femubench.core.fem.sensors import Sensors
from femubench.core.modal.eigen import solve_modes
from femubench.core.modal.measurement import Measurement
from femubench.core.update.strategy import ParameterEstimate, Strategy, UpdateResult

SECRET = re.compile("zq[0-9]{12}")
SECRET_BYTES = re.compile(b"zq[0-9]{12}")


def frame(elements: int, modulus: float, masses: tuple[PointMass, ...] = ()) -> Frame:
    """An L of two unequal members, out of plane."""
    section = Section(A=2.0e-4, Iy=2.0e-8, Iz=2.0e-8, J=3.0e-8, Jp=4.0e-8)
    material = Material(E=modulus, nu=0.3, rho=2700.0)
    joints = (
        Joint("A", (0.0, 0.0, 0.0)),
        Joint("B", (0.6, 0.0, 0.0)),
        Joint("C", (0.6, 0.45, 0.0)),
    )
    members = (
        Member("long", ("A", "B"), elements, section, material),
        Member("short", ("B", "C"), elements, section, material),
    )
    return Frame("out-of-plane", "euler-bernoulli", joints, members, masses=masses)


def sensors() -> Sensors:
    points = [(0.0, 0.0), (0.2, 0.0), (0.4, 0.0), (0.6, 0.0), (0.6, 0.15), (0.6, 0.3), (0.6, 0.45)]
    xyz = np.array([(x, y, 0.0) for x, y in points])
    return Sensors(tuple(f"s{i}" for i in range(len(xyz))), xyz, ("z",) * len(xyz))


def measured(model: Model, numbers: tuple[int, ...]) -> Measurement:
    """The lowest elastic modes of a model, as a test would give them."""
    modes = solve_modes(model).elastic.take(slice(0, len(numbers)))
    shapes = np.asarray(model.observe(sensors()) @ modes.shapes)
    shapes = shapes / np.abs(shapes).max(axis=0) * np.linspace(-1.0, 2.0, len(numbers))
    f = modes.natural_frequencies
    nothing = np.full(len(numbers), np.nan)
    return Measurement(sensors(), numbers, f, 0.002 * f, nothing, shapes, 0.01 * np.abs(shapes))


MASSES = (PointMass(Place(joint="C"), 0.1),)
SPRINGS = (GroundSpring(Place(member="long", s=0.5), "z", 1.0e5),)


def tiny_case(name: str = "corner", modulus: float = 77.0e9, *, folder: str = "corner") -> Case:
    """A coarse model 10 % too stiff, tested on a finer mesh at 70 GPa."""
    truth = Model.of(frame(9, 70.0e9, (PointMass(Place(joint="A"), 0.005),)))
    changed = measured(truth.attach(MASSES, SPRINGS), (1, 2, 3))
    return Case(
        name=name,
        title="An L",
        source="made up",
        folder=Path(folder),
        model=Model.of(frame(3, modulus)),
        measurement=measured(truth, (1, 2, 3, 4, 5)),
        used=(1, 2, 3),
        held_out=(4, 5),
        modifications=(Modification("mass at C", MASSES, SPRINGS, changed),),
        digest="0123",
    )


def matrices_only(model: Model) -> Model:
    """The same matrices without a frame behind them."""
    return replace(model, structure=None)


class Toy(Strategy):
    """Base of all: the name is that of the class."""

    citation = "none"

    def __init_subclass__(cls) -> None:
        if Toy in cls.__bases__ and "name" not in vars(cls):
            cls.name = re.sub("(?<!^)(?=[A-Z])", "-", cls.__name__).lower()


class Unchanged(Toy):
    baseline = True

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(model)


class Softer(Toy):
    """Finds the modulus from the first frequency."""

    needs = frozenset({"elements"})

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        structure = model.frame_structure
        first = solve_modes(model).elastic.eigenvalues[0]
        factor = float(measurement.eigenvalues[0] / first)
        places = tuple(label for label in structure.labels if label)
        changed = structure.with_values([Property("E", "E", places)], [factor])
        estimate = ParameterEstimate("E", 1.0, factor, std=0.01)
        return UpdateResult(
            Model.of(changed), 1, (estimate,), ({"step": 1.0},), {"rng": rng.random()}
        )


class Grounded(Toy):
    """Ties the structure to ground by a low-rank change: rigid-body modes are lost."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        basis = np.zeros((model.size, 1))
        basis[model.dofs.direction.index("z")] = 1.0
        change = LowRank(basis, np.array([[1.0e6]]))
        return UpdateResult(replace(model, stiffness_change=change), 1)


class Failing(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        raise SelfCheckFailed("used modes reproduced", 0.25, 1e-8)


class Diverging(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        raise Diverged("step 7: the residual grew to 1e9")


class Declining(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        raise NotApplicable("needs two modes\nof one kind")


class Needy(Toy):
    needs = frozenset({"geometry"})

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(model)


class Exiting(Toy):
    """Leaves the process in a chosen way: an exit code, or a signal where it is negative."""

    def __init__(self, code: int) -> None:
        self.code = code
        self.name = f"exiting-{code}"

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        if self.code < 0:
            os.kill(os.getpid(), -self.code)
            signal.pause()
        os._exit(self.code)


class Quitting(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        sys.exit("enough")


class Interrupting(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        raise KeyboardInterrupt


class Looping(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        while True:
            time.sleep(0.05)


class _LockedError(Exception):
    def __init__(self, first: object, second: object) -> None:
        self.payload = (lambda: first, second)

    def __str__(self) -> str:
        raise RuntimeError("no text either")

    def __reduce__(self) -> str:
        raise TypeError("cannot be pickled")


@dataclass(frozen=True)
class Parent(Toy):
    """Starts a process that would outlive it, tells its number in a file, and waits for it."""

    file: str = ""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        Path(self.file).write_text(str(child.pid))
        child.wait()
        return UpdateResult(model)


class Locked(Toy):
    """Raises an exception that cannot be pickled and has no text."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        raise _LockedError(1, 2)


class _Trap:
    def __reduce__(self) -> str:
        raise TypeError("this geometry stays here")


class OwnGeometry(Toy):
    """Returns a model that holds something which no other process could be given."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(replace(model, geometry=_Trap(), groups={"trap": _Trap()}))  # type: ignore[arg-type]


class Unsendable(Toy):
    """Returns a model that cannot be sent back."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(replace(model, mass=model.mass.toarray()))


class WrongSize(Toy):
    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return UpdateResult(replace(model, stiffness=sp.csc_array(model.stiffness[:-1, :-1])))


class Numbers(Toy):
    """Returns something that is no result at all."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        return 42


class Spy(Toy):
    """Looks for held-out data in everything the process holds, and reports what it finds.

    It knows the held-out numbers by their hash alone, and secret words by their pattern.
    """

    def __init__(self, hashes: frozenset[str]) -> None:
        self.hashes = hashes

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        gc.unfreeze()  # what the server has kept from the search for garbage is looked into too
        found = search([model, measurement, rng, *gc.get_objects()], self.hashes)
        return UpdateResult(model, diagnostics=found)


class Rummager(Toy):
    """Reads all memory of its own process and counts numbers that it was not given.

    It knows them masked alone, and masks what it reads: so it does not find its own list.
    """

    mask = 0x5A5A_F00D_1234_8765

    def __init__(self, held_out: frozenset[float], used: frozenset[float]) -> None:
        self.held_out, self.used = ([masked(f, self.mask) for f in fs] for fs in (held_out, used))

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        found = {"bytes": 0.0, "held_out": 0.0, "used": 0.0}
        wanted = {name: np.array(getattr(self, name), np.uint64) for name in ("held_out", "used")}
        for block in memory_of_this_process():
            found["bytes"] += len(block)
            for offset in range(8):
                whole = (len(block) - offset) // 8 * 8
                words = np.frombuffer(block[offset : offset + whole], np.uint64)
                words = words ^ np.uint64(self.mask)
                for name, numbers in wanted.items():
                    found[name] += float(np.isin(words, numbers).sum())
        return UpdateResult(model, diagnostics=found)


def masked(number: float, mask: int) -> int:
    return int(np.float64(number).view(np.uint64)) ^ mask


def memory_of_this_process() -> Iterator[bytes]:
    regions = []
    for line in Path("/proc/self/maps").read_text().splitlines():
        where, access, *_ = line.split()
        start, stop = (int(number, 16) for number in where.split("-"))
        if access.startswith("rw") and stop - start < 2**28:
            regions.append((start, stop))
    with open("/proc/self/mem", "rb", buffering=0) as memory:
        for start, stop in regions:
            try:
                memory.seek(start)
                yield memory.read(stop - start)
            except (OSError, ValueError, OverflowError):
                continue


def hashed(number: float) -> str:
    return hashlib.sha256(float(number).hex().encode()).hexdigest()


def search(roots: list[object], hashes: frozenset[str]) -> dict[str, float]:
    """Walk all that can be reached and count what gives secret words or numbers away."""
    seen, queue = {id(roots)}, list(roots)
    found = {"objects": 0.0, "numbers": 0.0, "words": 0.0}
    while queue:
        item = queue.pop()
        if id(item) in seen:
            continue
        seen.add(id(item))
        found["objects"] += 1.0
        if type(item) is np.ndarray:
            small = item.ravel() if item.dtype == np.float64 and item.size < 1000 else ()
            found["numbers"] += sum(hashed(number) in hashes for number in small)
        elif isinstance(item, float):
            found["numbers"] += hashed(item) in hashes
        elif isinstance(item, str):
            found["words"] += bool(SECRET.search(item))
        elif isinstance(item, bytes):
            found["words"] += bool(SECRET_BYTES.search(item))
        elif not isinstance(item, type | types.ModuleType | types.FunctionType):
            queue.extend(gc.get_referents(item))
    return found


def standing(_: object) -> bytes:
    """Return whether this process can be read, how many files are open, whether it stands alone."""
    readable = ctypes.CDLL(None).prctl(3, 0, 0, 0, 0)
    return f"{readable} {len(os.listdir('/proc/self/fd'))} {os.getsid(0) == os.getpid()}".encode()


class NoStart(Confinement):
    """Ends a worker before it is ready, and says why."""

    def enter(self, apart: object) -> None:
        print("a line", "there is no room", sep="\n", flush=True)
        os._exit(3)


@dataclass(frozen=True)
class OnAdvance(Toy):
    """Leaves the model as it is, draws a number, and tells in a file that it was run."""

    name: ClassVar[str] = "stated"
    file: str = ""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        descriptor = os.open(self.file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        os.write(descriptor, b"run\n")
        os.close(descriptor)
        return UpdateResult(model, diagnostics={"rng": rng.random()})


class Murderous(Toy):
    """Ends whatever started the process that its own was forked from."""

    def update(self, model: Model, measurement: Measurement, rng: Generator) -> UpdateResult:
        server = Path(f"/proc/{os.getppid()}/stat").read_text().rpartition(")")[2].split()
        os.kill(int(server[1]), signal.SIGKILL)
        signal.pause()
        return UpdateResult(model)
