"""A run that nobody made: many strategies on many scenarios, to see how reports cope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from msgspec import structs, to_builtins

from femubench.core.schema.paired_modes import ModeBefore, PartnerCandidate
from femubench.core.schema.results import Block
from femubench.core.score.ranking import rank_results
from femubench.core.score.scoring import frequency_error
from femubench.results import JobResult, PairedMode, Rule, RunData

BLOCKS = ("used", "higher", "modified")
MODES = {"used": (1, 2, 3), "higher": (4, 5), "modified": (1, 4)}
FIRST = {"used": 0.0, "higher": 0.0, "modified": -20.0}  # Hz that a first mode is off 100
CHANGE = "mass at 6"
CASES_IN_A_SCENARIO = 2  # of every tenth scenario; the others have a case of their own


def synthetic_run(
    strategies: int = 200,
    scenarios: int = 50,
    seeds: int = 1,
    *,
    names: Sequence[str] = (),
    failing: float = 0.03,
    random_seed: int = 20260101,
) -> RunData:
    """Return a run with gains and ranks; the same arguments give the same run.

    Strategies get worse with their number, more or less. Some jobs fail, some do
    not apply, some models are unphysical; `unchanged` is the last strategy.

    Arguments:
        strategies, scenarios, seeds: how many of each.
        names: of the first strategies, instead of ``strategy-000`` and so on.
        failing: share of the jobs without a model.
        random_seed: of everything that is drawn.
    """
    random = np.random.default_rng(random_seed)
    named = [*names, *(f"strategy-{n:03d}" for n in range(len(names), strategies - 1)), "unchanged"]
    cases = case_names(scenarios)
    nominal = {case: _nominal(random, number) for number, case in enumerate(cases)}
    reference = {
        case: {name: block.rms_percent for name, block in blocks.items()}
        for case, blocks in nominal.items()
    }
    gains = np.geomspace(0.05, 1.5, len(named))
    drawn = tuple(range(1, seeds + 1)) if seeds > 1 else (0,)
    results = [
        _result(random, case, name, seed, nominal[case], gain)
        if name == "unchanged" or random.random() >= failing
        else _failure(random, case, name, seed)
        for case in cases
        for name, gain in zip(named, gains, strict=True)
        for seed in drawn
    ]
    meta = {
        "run": "20260101T000000Z-5e7e71",
        "started": "2026-01-01T00:00:00+00:00",
        "finished": "2026-01-01T01:00:00+00:00",
        "seed": 0,
        "seeds": list(drawn),
        "jobs": 2,
        "timeout": 600.0,
        "versions": {"python": "3.11.0", "femubench": "0.1.0"},
        "machine": {"platform": "Linux", "cpu": "none", "cpu_count": 2},
        "cases": {
            case: {"title": f"Structure {case}", "digest": f"{n:064d}"}
            for n, case in enumerate(cases)
        },
        "strategies": named,
        "baseline": "unchanged",
        "citations": {name: f"A. Author (2001), {name}" for name in named},
        "reference": reference,
        "rule": Rule().to_json(),
        "yardsticks": {"unchanged": "the models that were given"},
        "models": {case: {"drawn": _plain(blocks)} for case, blocks in nominal.items()},
        "notes": [],
    }
    return RunData(meta, rank_results(results, meta))


def _plain(blocks: dict[str, Block]) -> dict[str, object]:
    """Return what a nominal model predicts, with the modes before the change."""
    found = dict(blocks)
    if "modified" in found:
        modes = (
            structs.replace(mode, before=ModeBefore(mode.number, 0.97))
            for mode in found["modified"].modes
        )
        found["modified"] = replace(found["modified"], modes=tuple(modes))
    return {name: to_builtins(block) for name, block in found.items()}


def case_names(scenarios: int) -> list[str]:
    """Return all cases: ``scenario-01``, or ``scenario-00/a`` and ``scenario-00/b``."""
    return [
        name
        for number in range(scenarios)
        for name in (
            [f"scenario-{number:02d}/{part}" for part in "ab"[:CASES_IN_A_SCENARIO]]
            if number % 10 == 0
            else [f"scenario-{number:02d}"]
        )
    ]


def _nominal(random: np.random.Generator, number: int) -> dict[str, Block]:
    """Return what the nominal model predicts; every fourth case has no design change."""
    names = BLOCKS[:2] if number % 4 == 3 else BLOCKS
    return {name: _block(random, name, float(random.uniform(3.0, 12.0))) for name in names}


def _result(
    random: np.random.Generator,
    case: str,
    strategy: str,
    seed: int,
    nominal: dict[str, Block],
    gain: float,
) -> JobResult:
    still = strategy == "unchanged"
    factor = gain * random.lognormal(0.0, 0.6)
    negative = 0 if still else int(gain > 1.0 and random.random() < 0.1)
    return JobResult(
        case=case,
        strategy=strategy,
        seed=seed,
        status="ok",
        seconds=float(random.lognormal(-2.0, 1.0)),
        blocks=nominal
        if still
        else {
            name: _block(random, name, own.rms_percent * factor) for name, own in nominal.items()
        },
        rigid_body_modes=3,
        rigid_body_modes_expected=3,
        negative_eigenvalues=negative,
        parameter_count=0 if still else int(random.integers(1, 140)),
        evaluations=1 if still else int(random.integers(1, 100)),
        parameters=() if still else _parameters(random),
        history=() if still else tuple({"residual": 0.5**n} for n in range(6)),
        diagnostics={"converged": 1.0},
    )


def _block(random: np.random.Generator, name: str, percent: float) -> Block:
    numbers = MODES[name]
    shares = random.standard_normal(len(numbers))
    errors = shares * percent / 100.0 / math.sqrt(float(np.mean(shares**2)))
    modes = tuple(
        PairedMode(
            n,
            100.0 * n + FIRST[name],
            (100.0 * n + FIRST[name]) * (1.0 + float(e)),
            float(random.uniform(0.9, 1)),
            CHANGE if name == "modified" else None,
            candidates=_others(random, 100.0 * n),
        )
        for n, e in zip(numbers, errors, strict=True)
    )
    mac = float(np.mean([mode.mac for mode in modes if mode.mac is not None]))
    # A frequency that was drawn below zero is an error of 100 %.
    rms = 100.0 * math.sqrt(float(np.mean([frequency_error(mode) ** 2 for mode in modes])))
    return Block(rms, mac, modes)


def _others(random: np.random.Generator, hertz: float) -> tuple[PartnerCandidate, ...]:
    """Return now and then another mode that may stand for the measured one."""
    if random.random() > 0.1:
        return ()
    return (
        PartnerCandidate(hertz * float(random.uniform(0.9, 1.1)), float(random.uniform(0, 1)), 0.8),
    )


def _parameters(random: np.random.Generator) -> tuple[dict[str, object], ...]:
    return tuple(
        {
            "name": name,
            "before": before,
            "after": before * float(random.uniform(0.8, 1.2)),
            "unit": "N m2",
            "std": 0.01 * before,
        }
        for name, before in (("EI left", 1337.0), ("GJ left", 1005.0))
    )


def _failure(random: np.random.Generator, case: str, strategy: str, seed: int) -> JobResult:
    failed = JobResult(case, strategy, seed, "failed", "stiffness: measured 3e-2, allowed 1e-8")
    if random.random() < 0.5:
        return replace(failed, status="not-applicable", reason="the model has no joints")
    return failed
