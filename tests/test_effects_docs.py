"""docs/effects.md: its tables agree with the effects, and its example works as printed."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distributions import install_metadata

from femubench import Model
from femubench.core.conformance.checking import findings, subjects
from femubench.core.plugin.loader import Plugins, load_plugins
from femubench.fem import Frame, Place, PointMass, Support
from femubench.plugins.effects import femubench_effects

TEXT = (Path(__file__).parents[1] / "docs" / "effects.md").read_text(encoding="utf-8")
THERE, WRITES = "## The catalogue", "### Keys written, and possible confusions"
EFFECTS: dict[str, Any] = {name: load_plugins().effects[name] for name in femubench_effects()}
RATIOS = ("ratio", "multiple")

FrameBuilder = Callable[..., Frame]


def rows_of(heading: str) -> dict[str, list[str]]:
    """Return the cells of the table below a heading by the effect's name."""
    part = TEXT.split(f"\n{heading}\n")[1].split("\n#")[0]
    rows = re.findall(r"^\| `([a-z-]+)` \| (.*) \|$", part, re.MULTILINE)
    return {name: cells.split(" | ") for name, cells in rows}


@pytest.fixture(scope="module")
def models(ladder: FrameBuilder, hframe: FrameBuilder, portal: FrameBuilder) -> list[Model]:
    """Return a frame of each plane, none with shear deformation, and one that carries a weight.

    One has a joint twice, at the end of either member, the last lies on a roller.
    """
    frames = [ladder(), hframe(mesh=(4, 2, 4)), portal(3, "euler-bernoulli")]
    clamp = Support(Place(joint="L1"), ("x", "z", "ry"))
    weight = PointMass(Place(joint="U2"), 1000.0)
    frames.append(replace(frames[1], supports=(clamp,), masses=(weight,)))
    whole, first = frames[0], frames[0].members[0]
    twice = replace(whole.joint(first.ends[0]), name="other side")
    parted = (replace(first, ends=(twice.name, first.ends[1])), *whole.members[1:])
    frames.append(replace(whole, joints=(*whole.joints, twice), members=parted))
    roller = Support(Place(member="BC", s=0.4), ("z",))
    held = Support(Place(joint="A"), ("z", "rx", "ry"))
    frames.append(replace(whole, supports=(held, roller)))
    return [Model.of(frame) for frame in frames]


def changed_keys(frame: Frame, other: Frame) -> set[str]:
    """Return what differs between two frames, in the words of a case."""
    names = {f.name for f in fields(frame)} - {"members"}
    keys = {name for name in names if getattr(frame, name) != getattr(other, name)}
    for own, new in zip(frame.members, other.members, strict=True):
        keys |= {"materials"} if own.material != new.material else set()
        keys |= {"sections"} if own.section != new.section else set()
    return keys


def test_every_effect_is_in_both_tables() -> None:
    assert len(EFFECTS) == 34
    assert list(rows_of(THERE)) == list(rows_of(WRITES))
    assert set(rows_of(THERE)) == set(EFFECTS)


def test_units_priors_and_keys_are_those_of_the_effects(models: list[Model]) -> None:
    for name, effect in EFFECTS.items():
        check_row(name, effect, models)


def check_row(name: str, effect: Any, models: list[Model]) -> None:
    _, where, unit, prior = rows_of(THERE)[name]
    scalings = set(re.findall(r"linear|exponential|compliance|factor", prior))
    written: set[str] = set()
    for model in models:
        frame = model.frame_structure.frame
        places = ("all",) if where == "none" else effect.places(model)
        assert where != "none" or not effect.places(model)
        for place in places[:1]:
            parameters = effect.parameters(model, place)
            units = unit.split(", ") * len(parameters)
            assert [p.unit or unit for p in parameters] == units[: len(parameters)]
            assert all(p.unit for p in parameters) == (unit not in RATIOS)
            assert {p.scaling for p in parameters} == scalings
            assert any(p.one_sided for p in parameters) == ("+" in prior)
            values = [float(p.value(np.array(0.3))) for p in parameters]
            written |= changed_keys(frame, effect.frame(frame, place, values))
    assert written == set(re.findall(r"`([a-z_]+)`", rows_of(WRITES)[name][0]))


@pytest.fixture
def bedding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Install the package of the docs, as printed, and load it as `bench` would."""
    (project,) = re.findall(r"```toml\n# pyproject\.toml\n(.*?)```", TEXT, re.DOTALL)
    (source,) = re.findall(r"```python\n# my_bedding\.py\n(.*?)```", TEXT, re.DOTALL)
    table = tomllib.loads(project)["project"]
    (tmp_path / "my_bedding.py").write_text(source, encoding="utf-8")
    points = table["entry-points"]["femubench"]
    install_metadata(tmp_path, table["name"], points, table["version"])
    monkeypatch.syspath_prepend(tmp_path)
    (found,) = distributions(path=[str(tmp_path)])
    plugins = load_plugins(list(found.entry_points))
    assert plugins.broken == ()
    yield plugins.effects["elastic-bedding"]
    del sys.modules["my_bedding"]


def test_example_keeps_the_rules(bedding: Any) -> None:
    (subject,) = subjects(bedding.name, Plugins(effects={bedding.name: bedding}))
    assert [f for f in findings(subject) if f.verdict.status in ("fail", "warn")] == []
