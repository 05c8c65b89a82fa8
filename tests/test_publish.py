"""`bench publish`: what it takes, what it refuses, what the site says and that it is repeatable."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import harness_toys as toys
import pytest
from click.testing import Result
from run_edits import called, failed, moved, renamed, scaled, versioned
from running import run_jobs

import femubench
from femubench.core.publish import publishing
from femubench.core.publish.submissions import slug
from femubench.core.schema.records import read_run, run_from_json, run_to_json
from femubench.core.score.leaderboard import leaderboard
from femubench.reports.publish_page import pages_of
from tests.command import call_bench

Data = dict[str, Any]
HOSTILE = "../../<script>alert(1)</script>\"'\x1b[2J"


@pytest.fixture(scope="module")
def data() -> Data:
    cases = [toys.tiny_case(), toys.tiny_case("other/corner", 80.0e9)]
    strategies = [toys.Unchanged(), toys.Softer(), toys.Failing()]
    run = run_jobs(cases, strategies, jobs=2)
    made: Data = json.loads(json.dumps(run_to_json(run)))
    return made


class Site:
    """Publishes runs into a folder, and reads what came of it."""

    def __init__(self, room: Path) -> None:
        self.room, self.folder, self.count = room, room / "site", 0
        self.words = ["--unverified"]

    def add(self, *runs: Data | str) -> Result:
        files = []
        for run in runs:
            self.count += 1
            file = self.room / f"run{self.count}.json"
            file.write_text(run if isinstance(run, str) else json.dumps(run))
            files.append(str(file))
        return call_bench("publish", self.folder, *files, *self.words, code=None)

    def content(self) -> dict[str, bytes]:
        return {
            str(path.relative_to(self.folder)): path.read_bytes()
            for path in sorted(self.folder.rglob("*"))
            if path.is_file()
        }

    def index(self) -> Data:
        return json.loads((self.folder / "index.json").read_text())  # type: ignore[no-any-return]

    def strategy(self, name: str) -> Data:
        return next(item for item in self.index()["strategies"] if item["name"] == name)

    def rest(self) -> list[str]:
        return sorted(path.name for path in self.room.iterdir() if path.suffix != ".json")


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return Site(tmp_path)


@pytest.fixture(scope="module")
def full(data: Data, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a site with one run, for what leaves it as it is."""
    made = Site(tmp_path_factory.mktemp("full"))
    assert made.add(data).exit_code == 0
    return made


def test_one_run_gives_its_leaderboard(data: Data, site: Site) -> None:
    answer = site.add(data)
    assert answer.exit_code == 0, answer.output
    assert "1 new run, 1 run and 3 strategies in all" in answer.output
    board = leaderboard(run_from_json(data)).to_dict("records")
    found = site.index()
    assert found["schema"] == 4
    assert [item["name"] for item in found["strategies"]] == [row["strategy"] for row in board]
    for item, row in zip(found["strategies"], board, strict=True):
        version = item["versions"][0]
        assert item["rank"] == row["rank"]
        assert version["gain"] == pytest.approx(row["gain"], rel=1e-12)
        assert version["failures"] == (2 if row["strategy"] == "failing" else 0)
        for block in ("used", "higher", "modified"):
            assert version[f"{block}_percent"] == pytest.approx(
                row[f"{block}_percent"], nan_ok=True
            ) or (version[f"{block}_percent"] is None)
    assert [case["name"] for case in found["cases"]] == ["corner", "other/corner"]
    assert all(case["ranked"] for case in found["cases"])
    (kept,) = (site.folder / "data").glob("*.json")
    assert json.loads(kept.read_text())["meta"]["structures"] == data["meta"]["structures"]
    text = (site.folder / "index.html").read_text()
    assert f"{found['strategies'][0]['versions'][0]['gain']:.3f}" in text


def test_a_case_is_drawn_where_its_files_are_installed(data: Data, site: Site) -> None:
    site.add(data)
    index, digest = site.index(), femubench.cases["frame"].digest
    for stated, drawn in ((digest, True), (digest[::-1], False)):
        index["cases"].append({**index["cases"][0], "name": "frame", "digest": stated, "page": "x"})
        assert ("<strong>The structure</strong>" in pages_of(index)["x"]) == drawn


def test_the_same_files_give_the_same_bytes(data: Data, tmp_path: Path) -> None:
    first = called(data, "first", 1)
    later = called(versioned(scaled(data, "softer", 0.5), "softer", "2"), "later", 2)
    sites = []
    for number, batches in enumerate(([[first, later]], [[later], [first], [later, first]])):
        room = tmp_path / str(number)
        room.mkdir()
        site = Site(room)
        for batch in batches:
            assert site.add(*batch).exit_code == 0
        sites.append(site.content())
        assert site.rest() == ["site"]
    assert sites[0] == sites[1]
    assert len([name for name in sites[0] if name.startswith("data/")]) == 2


def test_data_files_are_runs_that_can_be_read_again(data: Data, site: Site) -> None:
    data = json.loads(json.dumps(data))
    data["meta"]["request"] = {"secret": "/home/me"}
    data["results"][0]["traceback"] = "/home/me/secret.py"
    site.add(data)
    (file,) = (site.folder / "data").iterdir()
    assert "/home/me" not in file.read_text()
    assert len(read_run(file).results) == 6
    other = Site(site.room)
    other.folder = site.room / "again"
    assert call_bench("publish", other.folder, file, "--unverified", code=None).exit_code == 0
    assert other.content() == site.content()


def test_history_has_every_version_and_the_board_the_latest(data: Data, site: Site) -> None:
    old = called(data, "one", 1, cpu="Old <cpu>")
    new = called(versioned(scaled(data, "softer", 0.5), "softer", "9.9"), "two", 2, cpu="New")
    assert site.add(new, old).exit_code == 0
    softer = site.strategy("softer")
    assert [row["version"] for row in softer["versions"]] == [
        "9.9",
        old["results"][1]["provenance"]["strategy"],
    ]
    assert softer["versions"][0]["gain"] > softer["versions"][1]["gain"]
    assert softer["versions"][1]["machines"][0]["cpu"] == "Old <cpu>"
    page = (site.folder / softer["page"]).read_text()
    assert "Gain of every version" in Links(page).text.partition("Versions")[0]
    assert "Old &lt;cpu&gt;" in page
    # The strategy that did not change has one version, which two machines agree on.
    same = site.strategy("unchanged")
    assert len(same["versions"]) == 1
    assert {case["machines"] for case in same["versions"][0]["cases"]} == {2}
    assert site.index()["conflicts"] == []


def test_older_case_files_are_not_ranked(data: Data, site: Site) -> None:
    old = called(data, "one", 1)
    new = called(versioned(data, "softer", "2"), "two", 2)
    for case in ("corner", "other/corner"):
        new = moved(new, case, f"new {case}")
    new["results"] = [r for r in new["results"] if r["strategy"] != "failing"]
    site.add(old, new)
    first, second = site.strategy("softer")["versions"]
    assert first["comparable"]
    assert not second["comparable"]
    assert second["gain"] is None
    assert site.strategy("failing")["rank"] is None
    assert site.index()["cases"][0]["older"] == ["0123"]
    page = (site.folder / site.strategy("softer")["page"]).read_text()
    assert page.count('<tr class="old">') == 1
    assert "older case files" in page
    assert '<tr class="part">' in (site.folder / "index.html").read_text()


def test_a_case_of_one_contributor_takes_nobodys_rank(data: Data, site: Site) -> None:
    own = renamed(json.loads(json.dumps(data).replace("other/corner", "mine")), "softer", "mine")
    own["results"] = [r for r in own["results"] if r["strategy"] == "mine"]
    site.add(data, called(own, "own", 3))
    ranked = {case["name"]: case["ranked"] for case in site.index()["cases"]}
    assert ranked == {"corner": True, "mine": False, "other/corner": True}
    assert site.strategy("softer")["rank"] == 1
    assert site.strategy("mine")["rank"] is None


def test_contradictions_are_kept_and_flagged(data: Data, site: Site) -> None:
    honest = [called(data, f"honest {k}", k, cpu=f"cpu {k}") for k in (1, 2)]
    liar = called(scaled(data, "softer", 0.01), "liar", 3, cpu="liar")
    answer = site.add(*honest, liar)
    assert answer.exit_code == 0
    assert "2 jobs with results that contradict each other" in answer.stderr
    conflicts = site.index()["conflicts"]
    assert {item["case"] for item in conflicts} == {"corner", "other/corner"}
    assert [row["counted"] for row in conflicts[0]["results"]] == [True, False]
    assert len(conflicts[0]["results"][0]["runs"]) == 2
    gain = site.strategy("softer")["versions"][0]["gain"]
    alone = Site(site.room)
    alone.folder = site.room / "alone"
    alone.add(honest[0])
    assert gain == alone.strategy("softer")["versions"][0]["gain"]
    assert "contradicted" in (site.folder / "index.html").read_text()


def test_of_two_the_worse_counts_and_a_timeout_contradicts_nobody(data: Data, site: Site) -> None:
    liar = called(scaled(data, "softer", 0.01), "liar", 3, cpu="liar")
    slow = called(failed(data, "unchanged", "timeout"), "slow", 4, cpu="slow")
    site.add(called(data, "first", 1), liar, slow)
    row = site.strategy("softer")["versions"][0]
    true = next(r for r in data["results"] if r["strategy"] == "softer")
    assert row["cases"][0]["used_percent"] == true["used"]["rms_percent"]
    assert {item["strategy"] for item in site.index()["conflicts"]} == {"softer"}
    assert site.strategy("unchanged")["versions"][0]["failures"] == 0


def test_a_liars_own_nominal_errors_do_not_make_it_count(data: Data, site: Site) -> None:
    liar = called(scaled(data, "softer", 0.01), "liar", 3, cpu="liar")
    for blocks in liar["meta"]["reference"].values():
        blocks |= dict.fromkeys(blocks, 0.0)
    for models in liar["meta"]["models"].values():
        for mode in models["drawn"]["higher"]["modes"]:
            mode["predicted_hz"] *= 1.2
    site.add(called(data, "first", 1), liar)
    true = next(r for r in data["results"] if r["strategy"] == "softer")
    row = site.strategy("softer")["versions"][0]["cases"][0]
    assert row["used_percent"] == true["used"]["rms_percent"]


def test_a_run_that_was_resumed_replaces_its_first_part(data: Data, site: Site) -> None:
    part = json.loads(json.dumps(data))
    part["results"] = part["results"][:3]
    site.add(part)
    site.add(data)
    assert len(site.index()["runs"]) == 1
    assert site.index()["runs"][0]["results"] == 6


def bad(data: Data, path: str, value: object) -> Data:
    made = json.loads(json.dumps(data))
    *parents, last = path.split("/")
    inner = made
    for name in parents:
        inner = inner[int(name) if name.isdigit() else name]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    return made  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        ("schema", 3, "schema: schema 3"),
        ("meta/started", "yesterday", "meta.started"),
        ("meta/run", None, "meta.run"),
        ("meta/cases/corner/digest", None, "meta.cases.corner.digest"),
        ("meta/reference/corner", None, "meta.reference.corner"),
        ("meta/models", None, "meta.models"),
        ("meta/models/corner", None, "meta.models.corner.drawn: missing"),
        ("meta/reference/corner/used", -1.0, "meta.reference.corner.used"),
        ("results", [], "results: no results"),
        ("results/0/key", "", "results[0].key"),
        ("results/0/key", "../../x", "results[0].key"),
        ("results/0/provenance/case", "beef", "results[0].provenance.case"),
        ("results/0/provenance/strategy", None, "results[0].provenance.strategy"),
        ("results/0/used/rms_percent", 1e-6, "results[0].used.rms_percent"),
        ("results/0/used/modes", [], "results[0].used: no modes"),
    ],
)
def test_one_bad_file_and_nothing_is_written(
    data: Data, full: Site, path: str, value: object, key: str
) -> None:
    before, full.count = full.content(), 1
    answer = full.add(called(data, "fine", 5), bad(data, path, value))
    assert answer.exit_code == 2
    assert len(answer.stderr.splitlines()) == 1
    assert f"run3.json: {key}" in answer.stderr
    assert full.content() == before
    assert full.rest() == ["site"]


@pytest.mark.parametrize("text", ["", '{"meta": {}, "results": [', "[]"])
def test_half_a_file_is_refused(data: Data, site: Site, text: str) -> None:
    answer = site.add(data, text)
    assert answer.exit_code == 2
    assert "run2.json" in answer.stderr
    assert not site.folder.exists()
    assert site.rest() == []


def test_a_folder_of_somebody_else_is_left_alone(data: Data, site: Site) -> None:
    site.folder.mkdir()
    (site.folder / "thesis.tex").write_text("years of work")
    answer = site.add(data)
    assert answer.exit_code == 2
    assert "not made by bench publish" in answer.stderr
    assert list(site.content()) == ["thesis.tex"]
    (site.folder / "thesis.tex").unlink()
    assert site.add(data).exit_code == 0
    marker = site.folder / publishing.MARKER
    marker.write_text(marker.read_text().replace('"schema": 2', '"schema": 7'))
    answer = site.add(data)
    assert answer.exit_code == 2
    assert "schema 7 (expected 2)" in answer.stderr


def test_what_others_put_into_the_folder_stays(data: Data, site: Site) -> None:
    (site.folder / ".git").mkdir(parents=True)
    (site.folder / ".git" / "HEAD").write_text("ref")
    assert site.add(data).exit_code == 0
    (site.folder / "CNAME").write_text("example.org")
    assert site.add(called(data, "next", 4)).exit_code == 0
    assert (site.folder / ".git" / "HEAD").read_text() == "ref"
    assert (site.folder / "CNAME").read_text() == "example.org"
    assert site.rest() == ["site"]


def test_a_broken_swap_leaves_the_old_site(
    data: Data, site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    site.add(data)
    before = site.content()
    true = Path.rename

    def rename(self: Path, target: Path) -> Path:
        if self.name == "new":
            raise OSError("no space left")
        return true(self, target)

    monkeypatch.setattr(Path, "rename", rename)
    answer = site.add(called(data, "next", 4))
    assert answer.exit_code == 1
    assert "no space left" in answer.stderr
    assert site.content() == before
    assert site.rest() == ["site"]


class Links(HTMLParser):
    """Collects tags and where they lead."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.events: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]
        self.events += [name for name, _ in attrs if name.startswith("on") or name == "style"]

    def handle_data(self, data: str) -> None:
        self.text += data


def test_hostile_names_are_text_and_no_paths(data: Data, site: Site) -> None:
    made = renamed(data, "softer", HOSTILE)
    made = json.loads(json.dumps(made).replace("other/corner", "</title><svg onload=1>"))
    made["meta"] |= {"run": HOSTILE, "citations": {HOSTILE: "javascript:<b>"}}
    made["meta"]["cases"]["corner"]["title"] = '"><img src=http://x>'
    made["meta"]["machine"]["cpu"] = "\x1b<i>"
    made["meta"]["classes"] = {"corner": ["<img src=x onerror=alert(1)>", "../../etc"]}
    made["meta"]["about"] = {HOSTILE: {"summary": "<script>", "author": '"><iframe>'}}
    again = called(versioned(scaled(made, HOSTILE, 0.5), HOSTILE, "<b>2</b>"), HOSTILE, 9)
    answer = site.add(made, again)
    assert answer.exit_code == 0, answer.output
    assert site.rest() == ["site"]
    names = site.content()
    assert all(re.fullmatch(r"[A-Za-z0-9./-]+", name) and ".." not in name for name in names)
    for name, content in names.items():
        if not name.endswith(".html"):
            continue
        page = Links(content.decode())
        assert page.tags.count("script") == 1
        assert page.tags.count("link") == 2
        assert not {"img", "i", "b", "iframe", "style"} & set(page.tags)
        assert page.events == []
        assert b"\x1b" not in content
        for link in page.links:
            target = (site.folder / name).parent / unquote(link)
            assert target.resolve().is_file(), link


def test_extremes_do_not_break_the_site_that_took_them(data: Data, site: Site) -> None:
    half = site.add(renamed(data, "softer", "half \ud800 of a character"))
    assert half.exit_code == 2
    assert "run1.json: " in half.stderr
    made = json.loads(json.dumps(data))
    for result in (r for r in made["results"] if r["strategy"] == "unchanged"):
        modes = result["used"]["modes"]
        modes[0]["predicted_hz"], modes[0]["measured_hz"] = 1e100, 1e-40
        result["used"]["rms_percent"] = 100.0 * 1e140 / len(modes) ** 0.5
    made["meta"]["reference"]["corner"]["used"] = 0.0
    assert site.add(made).exit_code == 0
    before = site.content()
    again = site.add(made, made)
    assert again.exit_code == 0, again.output
    assert site.content() == before


def test_names_that_look_alike_get_files_of_their_own() -> None:
    names = ["A b", "a-b", "a b", "", "..", "é", "è", "x" * 500, "CON"]
    files = [slug(name) for name in names]
    assert len(set(files)) == len(names)
    assert all(re.fullmatch(r"[a-z0-9-]{8,60}", file) for file in files)


def test_pages_need_nothing_from_elsewhere(full: Site) -> None:
    for name, content in full.content().items():
        if name.endswith(".html"):
            text = content.decode()
            assert "default-src 'none'" in text
            assert "unsafe" not in text
            assert "script-src 'self'" in text
            assert not re.search(r"(?:https?:)?//\w", text)


def test_one_yardstick_and_one_start_for_all(data: Data, site: Site) -> None:
    drawn = json.loads(json.dumps(data))
    drawn["meta"]["yardstick"] = "textbook"
    drawn["meta"]["models"] = {
        c: {"textbook": m["drawn"]} for c, m in data["meta"]["models"].items()
    }
    drawn["meta"]["starts"] = {case: ["drawn"] for case in drawn["meta"]["cases"]}
    refused = site.add(drawn)
    assert refused.exit_code == 2
    assert "starts from the drawn model alone" in refused.stderr
    drawn["meta"]["starts"] = {case: ["textbook"] for case in drawn["meta"]["cases"]}
    for result in drawn["results"]:
        result["nominal"] = "textbook"
    assert site.add(drawn).exit_code == 0
    mixed = site.add(called(data, "older", 2))
    assert mixed.exit_code == 2
    assert "others against the drawn ones" in mixed.stderr


def test_a_class_has_a_board_of_its_own(data: Data, site: Site) -> None:
    made = json.loads(json.dumps(data))
    parts = [
        json.loads(json.dumps(data).replace("other/corner", f"b{k}").replace('"corner"', f'"a{k}"'))
        for k in range(2)
    ]
    made["results"] = [
        {**result, "key": f"{k}{result['key'][1:]}"}
        for k, part in enumerate(parts)
        for result in part["results"]
    ]
    for key in ("cases", "reference", "models"):
        made["meta"][key] = {n: v for part in parts for n, v in part["meta"][key].items()}
    made["meta"]["structures"] = {name: name for name in made["meta"]["cases"]}
    made["meta"]["classes"] = {"a0": ["frame", "all"], "a1": ["frame", "all"], "b0": ["all", "one"]}
    made["meta"]["classes"]["b1"] = ["all"]
    worse = scaled(made, "softer", 20.0)
    for result, other in zip(made["results"], worse["results"], strict=True):
        if result["case"] in ("a0", "a1"):
            result |= {name: other[name] for name in ("used", "higher", "modified")}
    assert site.add(made).exit_code == 0
    boards = {board["class"]: board for board in site.index()["boards"]}
    assert list(boards) == ["", "frame"]  # all of them is the whole, one is a case
    assert boards["frame"]["cases"] == ["a0", "a1"]
    first = boards["frame"]["rows"][0]
    ranks = {row["strategy"]: row["rank"] for row in boards["frame"]["rows"]}
    assert ranks == {"unchanged": 1, "failing": 1, "softer": 3}
    assert f'data-value="{first["gain"]}"' in (site.folder / boards["frame"]["page"]).read_text()
    assert f'href="{boards["frame"]["page"]}"' in (site.folder / "index.html").read_text()


ATOM = "{http://www.w3.org/2005/Atom}"


def test_the_feed_tells_of_new_versions_and_new_leaders(data: Data, site: Site) -> None:
    first = called(scaled(data, "softer", 20.0), "first", 1)
    site.add(first)
    before = site.index()["news"]
    assert [(item["kind"], item["strategy"]) for item in before] == [
        ("leader", "unchanged"), ("strategy", "unchanged"), ("strategy", "softer"),
        ("strategy", "failing"),
    ]  # fmt: skip
    site.add(called(versioned(data, "softer", "2 & <more>"), "second", 2))
    news = site.index()["news"]
    assert [(item["kind"], item["strategy"], item["version"]) for item in news[:2]] == [
        ("leader", "softer", "2 & <more>"), ("version", "softer", "2 & <more>"),
    ]  # fmt: skip
    assert news[2:] == before
    feed = ElementTree.fromstring((site.folder / "feed.xml").read_text())
    assert feed.tag == f"{ATOM}feed"
    assert feed.findtext(f"{ATOM}updated") == "2027-01-02T00:00:00+00:00"
    entries = feed.findall(f"{ATOM}entry")
    assert [entry.findtext(f"{ATOM}title") for entry in entries[:2]] == [
        "softer leads", "New version of softer",
    ]  # fmt: skip
    assert "2 & <more>" in str(entries[0].findtext(f"{ATOM}content"))
    for one in (feed, *entries):
        for tag in ("id", "title", "updated"):
            assert one.findtext(f"{ATOM}{tag}")
    ids = [one.findtext(f"{ATOM}id") for one in (feed, *entries)]
    assert len(set(ids)) == len(ids)


def test_with_an_address_the_feeds_have_whole_links(data: Data, site: Site) -> None:
    site.words += ["--address", "https://example.org/board"]
    site.add(called(versioned(data, "softer", "2 & <more>"), "first", 1))
    assert site.index()["address"] == "https://example.org/board/"
    site.words = ["--unverified"]
    site.add(called(data, "second", 2))  # the address stays
    feed = json.loads((site.folder / "feed.json").read_text())
    assert feed["version"] == "https://jsonfeed.org/version/1.1"
    assert feed["feed_url"] == "https://example.org/board/feed.json"
    atom = ElementTree.fromstring((site.folder / "feed.xml").read_text())
    assert len(feed["items"]) == len(site.index()["news"]) > 0
    for item, entry in zip(feed["items"], atom.findall(f"{ATOM}entry"), strict=True):
        link = entry.find(f"{ATOM}link")
        assert link is not None
        assert link.attrib["href"] == item["url"]
        assert (site.folder / item["url"].removeprefix(feed["home_page_url"][:-10])).is_file()
        for key, tag in (
            *(("id", "id"), ("title", "title"), ("content_text", "content")),
            ("date_published", "updated"),
        ):
            assert item[key] == entry.findtext(f"{ATOM}{tag}")
    assert 'type="application/feed+json"' in (site.folder / "index.html").read_text()


@pytest.mark.parametrize("address", ["javascript:alert(1)", 'https://x"', "//x"])
def test_what_is_no_address_is_refused(data: Data, site: Site, address: str) -> None:
    site.words += ["--address", address]
    answer = site.add(data)
    assert answer.exit_code == 2
    assert "is no address of a site" in answer.stderr
    assert not site.folder.exists()


def test_pages_of_strategies_say_where_they_come_from(data: Data, site: Site) -> None:
    stated = {
        "homepage": "https://example.org/?a=1&b=<2>".replace("<2>", "2"),
        "summary": "One & all", "author": "Ada <ada@example.org>", "doi": "10.1000/xyz",
    }  # fmt: skip
    made = json.loads(json.dumps(data))
    made["meta"]["about"] = {"softer": stated}
    made["meta"]["citations"] = {"softer": "Ada (1843), note G"}
    assert site.add(made).exit_code == 0
    item = site.strategy("softer")
    assert item["about"] == stated
    page = Links((site.folder / item["page"]).read_text())
    assert stated["homepage"] in page.links
    assert "https://doi.org/10.1000/xyz" in page.links
    for text in ("One & all", "Ada <ada@example.org>", "Ada (1843), note G"):
        assert text in page.text
    made["meta"]["about"]["softer"]["homepage"] = "javascript:alert(1)"
    answer = site.add(made)
    assert answer.exit_code == 2
    assert "meta.about.softer.homepage" in answer.stderr


def test_cells_of_downloads_are_no_formulas(data: Data, site: Site) -> None:
    made = renamed(data, "softer", "=cmd|' /C calc'!A0")
    assert site.add(made).exit_code == 0
    assert ",'=cmd|" in (site.folder / "leaderboard.csv").read_text()
