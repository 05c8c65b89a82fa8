"""Reports on papers worked through: the figures in them, and that text cannot break them."""

from __future__ import annotations

import re
from html.parser import HTMLParser

import pytest
import reproduction_toys as toys

from femubench.core.plot.figure import render_figure
from femubench.reports.digits import Digits, off
from femubench.reports.reproduction import reproduction_markdown, reproduction_text
from femubench.reports.reproduction_page import reproduction_html

STUDIES = (toys.study("frame"), toys.study("hframe"))
DRAWINGS = {figure.name: render_figure(figure) for study in STUDIES for figure in study.figures}
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

    @pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
    def test_nothing(self, value: float | None) -> None:
        assert Digits(1, 1).ours(value) == "–"
        assert off(value) == "–"


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


class TestMarkdown:
    def test_nothing_gets_through(self) -> None:
        text = reproduction_markdown(STUDIES, figures=True)
        assert "<" not in text
        rows = [line for line in text.splitlines() if line.startswith("| ")]
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {3, 7, 8}


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

    def test_nothing_runs_and_nothing_is_fetched(self, source: str, document: Document) -> None:
        assert not {tag for tag, _ in document.elements} & {
            *("script", "iframe", "object", "embed", "link", "img", "foreignobject", "form")
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
        assert len(wanted) > 16
        assert wanted <= set(ids)
