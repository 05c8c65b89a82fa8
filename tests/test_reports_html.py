"""Reports on papers worked through: the figures in them, and that text cannot break them."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import pytest
import reproduction_toys as toys

from femubench.reports.blocks import Drawing, Items, Passage
from femubench.reports.digits import Digits, off
from femubench.reports.html import to_html
from femubench.reports.markdown import to_markdown
from femubench.reports.reproduction import (
    reproduction_markdown,
    reproduction_text,
)
from femubench.reports.reproduction_page import reproduction_html
from femubench.reports.svg import embed_svg
from femubench.reports.terminal import to_terminal
from femubench.reproduction import Ground, Page, Study

STUDIES = (toys.study("frame"), toys.study("hframe"))
DRAWINGS = {figure.name: toys.drawn(figure) for study in STUDIES for figure in study.figures}
VOID = {"meta", "link", "br", "img", "input", "hr"}


class Document(HTMLParser):
    """Reads a document; every element that is opened is closed in its turn."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.text.append((self.open[-1] if self.open else "", data.strip()))

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def texts(self, tag: str) -> list[str]:
        return [text for name, text in self.text if name == tag]


@pytest.fixture(scope="module")
def source() -> str:
    return reproduction_html(STUDIES, DRAWINGS)


@pytest.fixture(scope="module")
def document(source: str) -> Document:
    return Document(source)


class TestDigits:
    def test_one_more_than_in_print(self) -> None:
        digits = Digits.of([255.8, 500.0])
        assert digits == Digits(1, 1)
        assert (digits.format(500.0), digits.ours(500.0)) == ("500.0", "500.00")

    def test_counts_stay_counts(self) -> None:
        digits = Digits.of([231, 112])
        assert (digits.ours(231), digits.ours(230.5), digits.ours(231, "N m2")) == (
            *("231", "230.5", "231.0"),
        )

    def test_powers_of_ten_do_not_lengthen_the_others(self) -> None:
        digits = Digits.of([0.02, -0.0283, 3.12e-6])
        assert digits.format(3.12e-6) == "3.12e-6"
        assert digits.ours(3.1204e-6, printed=3.12e-6) == "3.120e-6"
        assert digits.format(0.02) == "0.0200"
        assert digits.ours(-0.02849, printed=-0.0283) == "-0.02849"
        assert digits.ours(1.5e-7, printed=0.02) == "0.00000"
        assert digits.ours(4.128e9, printed=0.02) == "4.128e9"

    def test_last_digit_of_small_figures(self) -> None:
        digits = Digits.of([-0.0221, -0.0001])
        assert (digits.format(-0.0001), digits.ours(0.000192, printed=-0.0001)) == (
            *("-0.0001", "0.00019"),
        )

    def test_imaginary_frequency(self) -> None:
        digits = Digits.of([-1197.6])
        assert digits.format(-1197.6, "Hz") == "1197.6 i"
        assert digits.format(-1197.6, "N") == "-1197.6"

    @pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
    def test_nothing(self, value: float | None) -> None:
        assert Digits(1, 1).ours(value) == "–"
        assert off(value) == "–"

    @pytest.mark.parametrize(
        ("percent", "unit", "text"),
        [
            (1.234, "Hz", "+1.23"),
            (-0.0001, "", "0.00"),
            (-2.2, "%", "-2.20 pt"),
            (123456.0, "", "+1.2e+05"),
        ],
    )
    def test_deviation(self, percent: float, unit: str, text: str) -> None:
        assert off(percent, unit) == text

    def test_no_negative_zero(self) -> None:
        assert Digits(1, 1).ours(-0.001) == "0.00"


class TestScreen:
    def test_cells(self) -> None:
        text = reproduction_text(STUDIES)
        assert re.search(r"mode 1 +FE +255\.8 +255\.83 +\+0\.01 +✓ yes \[1\]\n", text)
        assert re.search(r"mode 4 +FE +911\.3 +867\.60 +-4\.80 +✗ no \[3\]\n", text)
        assert re.search(r"mode 5 +FE +1049\.4 +– +– +✗ no \[3\]\n", text)
        assert re.search(r"rigid 1 +Kabe +1197\.6 i +1197\.90 i +\+0\.03 +≈ if \[2\]\n", text)

    def test_a_note_stands_once_a_table(self) -> None:
        text = " ".join(reproduction_text(STUDIES[:1]).split())
        assert text.count(toys.CONVENTION) == text.count(toys.REASON) == 1

    def test_long_names_go_on_below(self) -> None:
        page = Page("frame", "1", (toys.FREE,), unit="Hz")
        cell = page.cell("a long row " * 9, "a long column " * 9, 1049.4, 1049.5)
        study = Study("frame", "Title", "", (), (cell,))
        _, *lines = reproduction_text([study]).splitlines()
        assert max(map(len, lines)) <= 80
        assert any(re.search(r"  1049\.4  1049\.50 +\+0\.01  ✓ yes \[1\]$", line) for line in lines)
        text = "\n".join(lines)
        assert (text.count("long"), text.count("row")) == (18, 11)

    def test_commands_stay_whole(self) -> None:
        words = "spring:" + ",".join(f"option_{k}={k}" for k in range(20))
        ground = Ground("under-convention", f"bench run hframe -s '{words}'")
        page = Page("frame", "1", (ground,), tolerance=1.0)
        study = Study("frame", "Title", "", (), (page.cell("a", "b", 1.0, 1.001),))
        assert words in reproduction_text([study])

    def test_many_wide_columns_fit(self) -> None:
        extra = replace(
            STUDIES[0].extras[0],
            columns=tuple(f"column number {k} (Hz)" for k in range(9)),
            rows=(tuple(f"{k}{k}{k}.{k}" for k in range(9)),),
        )
        text = reproduction_text([replace(STUDIES[0], cells=(), extras=(extra,))])
        assert max(map(len, text.splitlines()[1:])) <= 80
        assert "888.8" in text

    def test_sentences_without_room_stand_below(self) -> None:
        words = "this is what the model consists of, in some more words"
        columns = ("model", *(f"mode {k} (Hz)" for k in range(8)), "what it is")
        extra = replace(
            STUDIES[0].extras[0],
            columns=columns,
            rows=(("a", *("1234.5",) * 8, words), ("b", *("5.5",) * 8, "short")),
        )
        text = reproduction_text([replace(STUDIES[0], cells=(), extras=(extra,))])
        assert max(map(len, text.splitlines()[1:])) <= 80
        assert f"  a: {words}\n  b: short\n  Note: None of them" in text


class TestMarkdown:
    def test_nothing_gets_through(self) -> None:
        text = reproduction_markdown(STUDIES, figures=True)
        assert "<" not in text
        rows = [line for line in text.splitlines() if line.startswith("| ")]
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {3, 7, 8}

    def test_levels(self) -> None:
        text = to_markdown([Passage("a", [], 2), Passage("b", [], 3)])
        assert text == "## a\n\n### b"

    def test_drawing(self) -> None:
        block = Drawing("A [b]", "c", file="figures/a b.svg")
        assert to_markdown([Passage("", [block])]) == (
            "![A \\[b\\]](figures/a%20b.svg)\n\n**A \\[b\\]**: c"
        )
        assert to_terminal([Passage("", [block])]) == "  A [b]: c"


class TestHtml:
    def test_reads_in_order(self, document: Document) -> None:
        names = [tag for tag, _ in document.elements if tag in ("h1", "h2", "h3")]
        assert names[0] == "h1"
        assert names.count("h1") == 1
        assert document.texts("h1") == ["6 of 22 printed figures do not come out again"]
        assert document.texts("b")[:8] == ["4", "4", "2", "2", "2", "2", "2", "4"]
        assert any(
            text.startswith("2 of 11 printed cells agree independently (2 different figures), ")
            for text in document.texts("p")
        )
        assert document.all("html") == [{"lang": "en"}]
        assert [tag for tag, _ in document.elements].count("main") == 1

    def test_every_cell_has_its_square(self, document: Document) -> None:
        squares = [b for b in document.all("button") if b["class"].startswith("square ")]
        spots = [s["id"] for s in document.all("span") if s.get("class") == "at"]
        own = [b["popovertarget"] for b in squares if "other" not in b["class"].split()]
        assert own == [f"{spot}w" for spot in spots]
        assert len(spots) == 22
        assert {a["href"][1:] for a in document.all("a")} <= {
            attributes["id"] for _, attributes in document.elements if "id" in attributes
        }

    def test_cells_say_what_they_are(self, document: Document) -> None:
        cells = [b for b in document.all("button") if b["class"].startswith("cell ")]
        judged = [c for c in cells if not c["aria-describedby"].partition("w")[2]]
        wanted = [cell for study in STUDIES for cell in study.cells]
        assert sorted(
            (c["data-printed"], c["data-value"], c["class"][5:]) for c in judged
        ) == sorted(
            (str(c.printed), "" if c.ours is None else str(c.ours), c.verdict) for c in wanted
        )
        whys = {s["id"] for s in document.all("span") if "popover" in s}
        for key in ("aria-describedby", "popovertarget", "interestfor"):
            assert {c[key] for c in cells} == whys

    def test_layout_is_that_of_the_print(self, document: Document) -> None:
        assert document.texts("td").count(toys.EVIL) >= 5
        assert document.texts("th").count("measured") == 2
        assert "Kabe" in document.texts("th")  # what the layout has not, stands below

    def test_conventions_change_cells(self, source: str, document: Document) -> None:
        radios = [i for i in document.all("input") if i["type"] == "radio"]
        assert len(radios) == 4
        assert ["checked" in i for i in radios] == [True, False] * 2
        assert document.texts("legend") == ["Shear <b>"] * 2
        assert "(1 of 2 cells agree; judged so)" in document.texts("span")
        key = radios[1]["id"]
        others = [b for b in document.all("button") if b.get("interestfor", "").endswith(f"w{key}")]
        assert [b["data-value"] for b in others] == ["560.0", "911.35"]
        assert [b["class"] for b in others] == ["cell does-not-follow", "cell under-convention"]
        assert f"body:has(#{key}:checked) .other.{key} {{" in source

    def test_tables_can_be_read_aloud(self, document: Document) -> None:
        assert len(document.all("table")) == len(document.all("thead"))
        assert {th["scope"] for th in document.all("th")} == {"row", "col"}

    def test_verdicts_are_words_with_a_symbol(self, document: Document) -> None:
        cells = document.texts("td")
        for words in ("✓ independent [1]", "≈ under a convention [2]", "✗ does not follow [3]"):
            assert words in cells

    def test_nothing_runs_and_nothing_is_fetched(self, source: str, document: Document) -> None:
        assert not {tag for tag, _ in document.elements} & {
            *("script", "iframe", "object", "embed", "link", "img", "foreignobject", "form"),
        }
        for _, attributes in document.elements:
            assert not [name for name in attributes if name.startswith("on")]
            for name in ("href", "xlink:href", "src"):
                assert attributes.get(name, "#").startswith(("#", "data:image/png;base64,"))
        assert not re.search(r"@import|url\((?!#)|far\.example", source)

    def test_text_stays_text(self, source: str, document: Document) -> None:
        assert toys.EVIL in document.texts("li")
        assert "A. Author 1999 <nowhere>" in document.texts("p")
        assert source.count("&lt;script&gt;alert(1)") >= 6

    def test_ids_are_unique_and_references_are_met(self, source: str, document: Document) -> None:
        ids = [attributes["id"] for _, attributes in document.elements if "id" in attributes]
        assert len(ids) == len(set(ids))
        wanted = set(re.findall(r"url\(#([^)]+)\)", source))
        wanted |= {use["xlink:href"][1:] for use in document.all("use") if "xlink:href" in use}
        assert len(wanted) == 16
        assert wanted <= set(ids)

    def test_drawings_have_names(self, document: Document) -> None:
        names = [svg["aria-label"] for svg in document.all("svg") if "aria-label" in svg]
        assert names == ["Receptance <6Z/6Z>", "Bars"] * 2

    def test_label_and_empty_parts(self) -> None:
        text = to_html([Passage("", [Items([("a<", "b"), ("", "c")])])], title="t & u", heading="h")
        assert "<li><b>a&lt;</b>: b</li>\n<li>c</li>" in text
        assert "<title>t &amp; u</title>" in text
        assert "<li class" not in text


class TestDrawing:
    def test_stays_well_formed_and_keeps_its_picture(self) -> None:
        made = embed_svg(toys.drawn(toys.figures("frame")[0]), "p", "a & b")
        root = ElementTree.fromstring(str(made))
        assert root.get("aria-label") == "a & b"
        assert 'href="data:image/png;base64,AAAA"' in made
        assert "stroke-linejoin" in made
        for word in ("alert", "far.example", "metadata", "data:text", "frame-curve</p>"):
            assert word not in made

    def test_its_own_name_is_found(self) -> None:
        svg = (
            '<svg xmlns="http://www.w3.org/2000/svg" aria-labelledby="t d">'
            '<title id="t">T</title><desc id="d">D</desc></svg>'
        )
        root = ElementTree.fromstring(str(embed_svg(svg, "p", "l")))
        assert (root.get("aria-labelledby"), root.get("aria-label")) == ("p-t p-d", None)
        assert [child.get("id") for child in root] == ["p-t", "p-d"]

    def test_label_with_brackets_stays(self) -> None:
        svg = '<svg xmlns="http://www.w3.org/2000/svg"><text>url(x)</text></svg>'
        assert "<text>url(x)</text>" in embed_svg(svg, "p", "l")

    def test_something_else_is_refused(self) -> None:
        with pytest.raises(ValueError, match="not a drawing"):
            embed_svg("<html/>", "p", "l")
