"""The beam model an engineer draws: centre lines and catalogue values, as a case folder's text.

It reads the drawing alone: joints, members, sections, lumps, springs and clamps. Blocks, welds and
what is marked as not drawn stay unknown to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from truths.structure import Place, Structure

DOFS = {
    "3d": ("x", "y", "z", "rx", "ry", "rz"),
    "in-plane": ("x", "z", "ry"),
    "out-of-plane": ("z", "rx", "ry"),
}


def text(value: object) -> str:
    """Return a TOML value."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {text(v)}" for key, v in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(text(v) for v in value) + "]"
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def table(header: str, values: Mapping[str, object]) -> str:
    """Return a TOML table."""
    return "\n".join([header, *(f"{key} = {text(value)}" for key, value in values.items()), ""])


def place(at: Place) -> str:
    """Return a place in the grammar of a case."""
    return at if isinstance(at, str) else f"{at[0]}@{at[1]:g}"


def model_tables(structure: Structure) -> Iterator[str]:
    """Yield the tables of the drawn model."""
    head = {"kind": "frame", "plane": structure.plane, "beam": structure.beam}
    if structure.beam == "timoshenko":
        head["bending_mass"] = "shear-consistent"
    yield table("[model]", head)
    for name in dict.fromkeys(member.material for member in structure.members):
        m = structure.materials[name]
        yield table(f"[model.materials.{name}]", {"E": m.E, "nu": m.nu, "rho": m.rho})
    for name in dict.fromkeys(member.section for member in structure.members):
        yield table(f"[model.sections.{name}]", structure.sections[name].drawn)
    for joint in structure.joints:
        xyz = structure.warped(structure.point(joint)[:, None])[:, 0]
        values: dict[str, object] = {"name": joint, "xyz": [round(float(v), 9) + 0.0 for v in xyz]}
        if joint in structure.types:
            values["type"] = structure.types[joint]
        yield table("[[model.joints]]", values)
    for member in structure.members:
        values = {
            "name": member.name,
            "ends": member.ends,
            "elements": member.elements,
            "section": member.section,
            "material": member.material,
        }
        up = member.drawn_up or member.up
        if structure.plane == "3d" and up is not None:
            values["up"] = up
        yield table("[[model.members]]", values)
    for lump in structure.lumps:
        if lump.drawn:
            values = {"at": place(lump.at), "mass": lump.mass}
            if any(lump.offset):
                values["offset"] = lump.offset
            yield table("[[model.masses]]", values)
    for spring in structure.springs:
        if spring.drawn and spring.direction in DOFS[structure.plane]:
            values = {
                "at": place(spring.at),
                "direction": spring.direction,
                "stiffness": spring.stiffness,
            }
            yield table("[[model.springs]]", values)
    for clamp in structure.clamps:
        yield table("[[model.supports]]", {"at": clamp.at, "fixed": DOFS[structure.plane]})


def case_text(structure: Structure, mass: float) -> str:
    """Return `case.toml`.

    Arguments:
        mass: the weighed mass, kg.
    """
    used, held = structure.used, structure.held_out
    case = {"name": f"suite/{structure.name}", "title": structure.title}
    case["source"] = "solid elements (scikit-fem), scatter of a test added: see README.md"
    measurement: dict[str, object] = {
        "sensors": "sensors.csv",
        "modes": "modes.csv",
        "shape_std": structure.shape_scatter,
        "used": list(range(1, used + 1)),
        "held_out": list(range(used + 1, used + held + 1)),
    }
    if structure.weighed:
        std = float(f"{mass * structure.weighed:.2g}")
        measurement["mass"] = {"value": float(f"{mass:.5g}"), "std": std}
    parts = [table("[case]", case), *model_tables(structure), table("[measurement]", measurement)]
    for number, change in enumerate(structure.changes, 1):
        values: dict[str, object] = {"name": change.name}
        if change.lumps:
            values["masses"] = [{"at": place(item.at), "mass": item.mass} for item in change.lumps]
        if change.springs:
            values["springs"] = [
                {"at": place(item.at), "direction": item.direction, "stiffness": item.stiffness}
                for item in change.springs
            ]
        parts.append(table("[[modification]]", {**values, "modes": f"change-{number}.csv"}))
    return "\n".join(parts)
