"""Printed tables, conventions and equations of papers: what they refuse, and what they show."""

from __future__ import annotations

import pytest
import reproduction_toys as toys

from femubench import InputError
from femubench.papers.printed import equations
from femubench.reproduction import Choice, Convention, Equation

CELLS = toys.study().cells
MATH = "<math><mi>x</mi></math>"


class TestConvention:
    def test_cells_are_judged_by_their_own_bars(self) -> None:
        (choice,) = toys.convention().choices
        found = choice.under(CELLS)
        verdicts = {key[1]: cell.verdict for key, cell in found.items()}
        assert verdicts == {"mode 3": "does-not-follow", "mode 4": "under-convention"}
        assert found["1", "mode 4", "FE"].note.endswith("; with | it")
        assert found["1", "mode 3", "FE"].note == "the figures do not agree: with | it"

    def test_unknown_cell(self) -> None:
        with pytest.raises(InputError, match="no judged cell"):
            Choice("x", {("1", "mode 99", "FE"): 1.0}).under(CELLS)

    def test_nothing_to_see(self) -> None:
        with pytest.raises(InputError, match="changes nothing"):
            Convention("x", "y", (Choice("z", {}),))


class TestEquation:
    @pytest.mark.parametrize("paper", ["frame", "hframe"])
    def test_the_function_cites_its_equation(self, paper: str) -> None:
        found = equations(paper)
        assert len(found) >= 5
        for equation in found:
            assert equation.number in equation.documentation, equation.function
            assert equation.summary.endswith(".")

    @pytest.mark.parametrize(
        "mathml",
        [
            "<math><mi>x</math>",
            "<math><script>alert(1)</script></math>",
            "<math href='x'><mi>x</mi></math>",
            "<mi>x</mi>",
            "<math onclick='x'/>",
        ],
    )
    def test_only_formulas_get_through(self, mathml: str) -> None:
        with pytest.raises(InputError, match=r"equation \(1\)"):
            Equation("(1)", "what", "femubench.modal.mac", mathml)

    @pytest.mark.parametrize("function", ["femubench.modal.nothing", "os.getcwd", ""])
    def test_function_of_ours(self, function: str) -> None:
        with pytest.raises(InputError, match="no "):
            Equation("(1)", "what", function, MATH).documentation  # noqa: B018
