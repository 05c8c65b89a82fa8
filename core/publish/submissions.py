"""Result files of anybody for a public leaderboard: checked, normalised, named by content."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, get_args

from msgspec import Meta, Struct, field

from femubench.core.errors import InputError
from femubench.core.files import read_text
from femubench.core.plugin.distribution import DOI, HOMEPAGE, LONGEST_LINE
from femubench.core.schema.bounds import Name, Percent
from femubench.core.schema.records import (
    LARGEST_RUN,
    Models,
    parse_json,
    result_to_json,
    run_from_json,
    to_plain,
)
from femubench.core.schema.results import JobResult, Nominal, RunData
from femubench.core.schema.validation import read_plain
from femubench.core.score.bounded_gain import Rule
from femubench.core.score.ranking import rank_results
from femubench.core.score.scoring import frequency_error

SCHEMA = 2
_MOMENT = r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?(\+00:00|Z)\Z"
_LONGEST = 1e9  # s
_ROUNDING = 1e-6  # relative, of an rms that is computed again from its modes
_Word = Annotated[str, Meta(max_length=200)]
_Moment = Annotated[str, Meta(pattern=_MOMENT)]
_BlockName = Literal["used", "higher", "modified"]
_Digest = Annotated[str, Meta(min_length=1, max_length=200)]
_Line = Annotated[str, Meta(max_length=LONGEST_LINE)]
# Raises InputError for a run, given with the content of its file, that does not stand the checks;
# tells whether its errors were computed again from its answers.
Verify = Callable[[RunData, Mapping[str, Any], Path], bool]
Proof = Literal["unverified", "stated", "recomputed"]
_OF_CHECKED = ("plan", "sandbox", "twins")  # meta data of checked runs alone


class _Machine(Struct):
    platform: _Word | None = None
    cpu: _Word | None = None
    cpu_count: Annotated[int, Meta(ge=0, lt=2**31)] | None = None
    blas: _Word | None = None


class _Case(Struct, kw_only=True):
    title: Annotated[str, Meta(max_length=1_000)] | None = None
    digest: _Digest


class _Twins(Struct, kw_only=True):
    seed: Annotated[int, Meta(ge=0)]
    number: Annotated[int, Meta(ge=0, le=1_000)]
    of: dict[Name, Name]
    kinds: dict[Name, list[_Word]] = {}
    again: dict[Name, Name]
    cases: dict[Name, _Case]
    reference: dict[Name, dict[_BlockName, Percent]]
    models: Models


class _About(Struct):
    """What the package of a strategy says of it."""

    homepage: Annotated[_Line, Meta(pattern=HOMEPAGE)] = ""
    summary: _Line = ""
    author: _Line = ""
    doi: Annotated[_Line, Meta(pattern=DOI)] = ""


class _Meta(Struct, kw_only=True):
    """The meta data that are published; nothing else of them is."""

    run: _Digest
    started: _Moment
    finished: _Moment | None = None
    seeds: list[int] = []
    seed: int = 0
    strategies: list[Name] = []
    baseline: Name | None = None
    structures: dict[Name, Name] = {}
    yardstick: Nominal | None = None
    starts: dict[Name, list[Nominal]] = {}
    alike: list[Name] = []
    cases: dict[Name, _Case]
    classes: dict[Name, Annotated[list[_Word], Meta(max_length=50)]] = {}
    citations: dict[Name, Annotated[str, Meta(max_length=5_000)]] = {}
    about: dict[Name, _About] = {}
    reference: dict[Name, dict[_BlockName, Percent]]
    models: Models
    yardsticks: dict[Name, _Word] = {}
    versions: Annotated[dict[_Word, _Word], Meta(max_length=50)] = {}
    machine: _Machine = field(default_factory=_Machine)
    git_commit: _Word | None = None
    plan: _Word | None = None
    sandbox: _Word | None = None
    twins: _Twins | None = None


@dataclass(frozen=True)
class Submission:
    """A run as it is published.

    Arguments:
        name: of that file, from the run's id and a hash of the text.
        proof: ``stated`` where all that can be checked without the answers of its strategies was,
            ``recomputed`` where their errors were computed again from these.
    """

    run: RunData
    text: str
    name: str
    proof: Proof = "unverified"

    @property
    def is_checked(self) -> bool:
        """Tell whether all but the answers was checked."""
        return self.proof != "unverified"

    @property
    def started(self) -> str:
        """Return the moment at which the run began, in a form that sorts by time."""
        return str(self.run.meta["started"]).replace("Z", "+00:00")

    @property
    def order(self) -> tuple[str, str]:
        """Return what submissions are sorted by: time, then name, whatever order they came in."""
        return self.started, self.name


def read_submission(
    file: Path, verify: Verify | None = None, *, published: bool = False
) -> Submission:
    """Return the run of a file, normalised.

    Arguments:
        verify: checks what can be checked; None checks the form alone.
        published: whether the file is one of a site, which says how far it was checked.

    Raises:
        InputError: naming file and key of the first thing that is wrong.
    """
    expected = "what 'bench run --json' writes"
    data = parse_json(read_text(file, LARGEST_RUN), file=file, expected=expected)
    if isinstance(data, dict) and data.get("schema", SCHEMA) != SCHEMA:
        what = f"schema {data['schema']!r}"
        raise InputError(what, file=file, key="schema", expected=str(SCHEMA))
    run = run_from_json(data, file=file)
    meta = _meta(run, file)
    # Of several results with one key the last counts, as in the store.
    if not run.results:
        raise InputError("no results", file=file, key="results", expected="at least one")
    results: dict[str, JobResult] = {}
    for number, result in enumerate(run.results):
        _check(result, meta, file, f"results[{number}]")
        results[result.key] = result
    proof: Proof = "unverified"
    if published and data.get("proof") in get_args(Proof):
        proof = data["proof"]
    if verify is not None:
        proof = "recomputed" if verify(run, data, file) else "stated"
    if proof == "unverified":
        meta = {name: value for name, value in meta.items() if name not in _OF_CHECKED}
    companions = run.companions if proof != "unverified" else ()
    # A run as its file says it, so that it is the same when that is read again.
    data = {"schema": SCHEMA, "meta": meta, "results": _records(results.values())}
    if proof != "unverified":
        data |= {"companions": _records(companions), "proof": proof}
    text = json.dumps(data, sort_keys=True, allow_nan=False, separators=(",", ":")) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()[:12]
    run = run_from_json(json.loads(text), file=file)
    ranked = replace(run, results=rank_results(run.results, run.meta))
    return Submission(ranked, text, f"{slug(str(meta['run']))}-{digest}.json", proof)


def slug(text: str) -> str:
    """Return a file name for any text: letters, digits, and a hash that keeps it apart."""
    word = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:40].strip("-")
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{word}-{digest}" if word else digest


def _records(results: Iterable[JobResult]) -> list[dict[str, Any]]:
    """Return results in an order that does not depend on who ended first, without their gains."""
    dropped = {"gain": None, "rank": None, "traceback": ""}
    order = sorted(results, key=lambda r: (r.case, r.strategy, r.seed, r.key))
    return [{**result_to_json(item), **dropped} for item in order]


def _meta(run: RunData, file: Path) -> dict[str, Any]:
    # Without halves of characters, which no file could hold.
    record = read_plain(_Meta, to_plain(run.meta), file=file, key="meta")
    data: dict[str, Any] = to_plain(record)
    for name in ("baseline", "structures", "classes", "about", "yardsticks"):
        if not data[name]:  # as in what was published before there was one
            del data[name]
    return {**data, "rule": Rule().to_json()}


def _check(result: JobResult, meta: Mapping[str, Any], file: Path, key: str) -> None:
    """Check what a ranking of results from anywhere rests on.

    Raises:
        InputError: for a job without key or digest, or an error that its modes do not give.
    """

    def refuse(what: str, where: str, expected: str) -> NoReturn:
        raise InputError(what, file=file, key=where, expected=expected)

    if not re.fullmatch(r"[0-9a-f]{8,128}", result.key):
        refuse(
            f"{result.key!r} is no key" if result.key else "no key",
            f"{key}.key",
            "a hash of the job",
        )
    if result.seconds > _LONGEST:
        refuse(f"{result.seconds:g} s", f"{key}.seconds", f"at most {_LONGEST:g}")
    for name in ("case", "strategy", "femubench"):
        text = result.provenance.get(name)
        if not isinstance(text, str) or not 0 < len(text) <= 200:
            expected = "a digest" if name == "case" else "a version"
            refuse("missing or not a text", f"{key}.provenance.{name}", expected)
    case = meta["cases"].get(result.case)
    if case is None or case["digest"] != result.provenance["case"]:
        refuse("another case", f"{key}.provenance.case", "the digest that meta.cases has")
    starts = meta.get("starts") or {}
    if meta.get("yardstick") == "textbook" and "textbook" not in starts.get(result.case, ()):
        expected = "textbook among them: `bench run --nominal textbook`, or both"
        refuse("starts from the drawn model alone", f"meta.starts.{result.case}", expected)
    reference = meta["reference"].get(result.case)
    if not reference:
        refuse("missing", f"meta.reference.{result.case}", "the errors of the nominal model")
    for name, block in result.blocks.items():
        if name not in reference or not block.modes:
            what = "no modes" if name in reference else "a block that the nominal model has not"
            refuse(what, f"{key}.{name}", "one of meta.reference, with modes")
        errors = [frequency_error(mode) for mode in block.modes]
        rms = 100.0 * (sum(error * error for error in errors) / len(errors)) ** 0.5
        if abs(rms - block.rms_percent) > _ROUNDING * (1.0 + rms):
            what = f"{block.rms_percent:g} %, its modes give {rms:g} %"
            refuse(what, f"{key}.{name}.rms_percent", "the rms of its modes")
