"""The ladder with every member numbered from either end, and readings that depend on it."""

from __future__ import annotations

from itertools import combinations

from equation_readings import Reading, nominal_of

# As the case has them: around the frame, and the middle rung from front to back.
MEMBERS = tuple(member.name for member in nominal_of(Reading()).structure.frame.members)
DIRECTIONS = tuple(
    "+".join(chosen) for count in range(8) for chosen in combinations(MEMBERS, count)
)
# One member at a time, and all.
EACH = (*MEMBERS, "+".join(MEMBERS))
# The shapes with which the ties of the adjusted column are tried.
SHAPES: dict[str, dict[str, object]] = {
    "tied": {},
    "tied, expansion (15)": {"expansion": "force", "start": "nominal"},
    "tied, beam shapes at all dofs": {"data": "beam", "expansion": "all dofs"},
}


def direction(backward: str) -> str:
    """Return from where to where every member is numbered."""
    structure = nominal_of(Reading(backward=backward)).structure
    return " ".join("-".join(member.ends) for member in structure.frame.members)
