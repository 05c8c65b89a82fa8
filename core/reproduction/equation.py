"""Equations of a paper in MathML, each next to the function of ours that works by it."""

from __future__ import annotations

from dataclasses import dataclass
from inspect import getdoc
from pydoc import locate
from xml.etree import ElementTree

from femubench.core.errors import InputError

# Presentation elements of MathML Core; nothing that loads, links or runs.
_ELEMENTS = frozenset(
    {
        *("math", "mrow", "mi", "mn", "mo", "mtext", "mspace", "mtable", "mtr", "mtd"),
        *("msub", "msup", "msubsup", "mfrac", "msqrt", "mover", "munder", "munderover"),
    }
)
_ATTRIBUTES = frozenset({"display", "mathvariant", "stretchy", "width", "fence", "accent"})


@dataclass(frozen=True)
class Equation:
    """What a paper writes, and where we do it.

    Arguments:
        number: how the docstring cites it, e.g. ``"(16)"``; where it has none, its section.
        what: it says.
        function: public name of ours, e.g. ``"femubench.modal.mac"``.
        mathml: one ``<math>`` element.

    Raises:
        InputError: for MathML that is none, or a name that is nothing of ours.
    """

    number: str
    what: str
    function: str
    mathml: str

    def __post_init__(self) -> None:
        """Check what a page takes over as it is."""
        try:
            elements = list(ElementTree.fromstring(self.mathml).iter())
        except ElementTree.ParseError as error:
            raise InputError(f"equation {self.number}: {error}", expected="MathML") from None
        odd = {e.tag for e in elements} - _ELEMENTS | {a for e in elements for a in e.attrib} - (
            _ATTRIBUTES
        )
        if odd or elements[0].tag != "math":
            what = f"equation {self.number}: {', '.join(sorted(odd)) or elements[0].tag}"
            raise InputError(what, expected="one math element of MathML's presentation")

    @property
    def markup(self) -> str:
        """Return the formula for the middle of a page."""
        return self.mathml.strip()

    @property
    def documentation(self) -> str:
        """Return the docstring of the function.

        Raises:
            InputError: where there is no such function, or it says nothing.
        """
        found = locate(self.function) if self.function.startswith("femubench.") else None
        text = getdoc(found) if found is not None else None
        if not text:
            raise InputError(f"equation {self.number}: no {self.function}", expected="a function")
        return text

    @property
    def summary(self) -> str:
        """Return the first line of the docstring."""
        return self.documentation.splitlines()[0]
