"""docs/development/performance.md has the kept figures, and calls a bar met when it is."""

from __future__ import annotations

import json

import performance


def test_page_has_the_kept_figures() -> None:
    kept = json.loads(performance.KEPT.read_text(encoding="utf-8"))
    page = performance.PAGE.read_text(encoding="utf-8")
    assert page.partition(performance._BEGIN)[2].partition(performance._END)[0] == (
        performance.page_of(kept) + "\n"
    )


def test_every_bar_is_that_of_a_series() -> None:
    sections = {section.word: section.series for section in performance.SECTIONS}
    for bar in performance.BARS:
        names = {series.name: series.sizes for series in sections[bar.section]}
        assert bar.size in names[bar.series]
        assert bar.over in ("", "anchor", *names)


def test_bars_are_met_from_the_right_side() -> None:
    rows = [
        {"series": "one factorisation, lattice", "size": 9, "seconds": 1.0},
        {"series": "modes of a lattice", "size": 9, "seconds": 2.0},
        {"series": "eigsh as called, lattice", "size": 9, "seconds": 90.0},
    ]
    kept = {"lattice": {"rows": rows}}
    rival, ours = performance.BARS[0].line(kept), performance.BARS[2].line(kept)
    assert (rival["found"], rival["met"]) == ("45", "yes")
    assert (ours["found"], ours["met"]) == ("2", "no")
    assert performance.BARS[3].line(kept)["met"] == ""
