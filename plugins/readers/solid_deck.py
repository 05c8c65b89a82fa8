"""A model of solids and shells in groups from what an input file says, and files like it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from femubench import InputError, Model
from femubench.fem import FloatArray, Groups, MatrixGeometry, SparseArray, matrix_model
from femubench.modal import GroupPriors
from femubench.plugins.readers import nodes, shells, solid_elements
from femubench.plugins.readers.attachments import NodeMotions, rigid
from femubench.plugins.readers.deck_file import KINDS, POINTS, REST, SECTIONS, SolidDeck, read_deck
from femubench.plugins.readers.nodes import Point
from femubench.plugins.readers.outline import find_outline
from femubench.plugins.readers.reading import DIRECTIONS, needs

Powers = Mapping[int, tuple[SparseArray, SparseArray]]
JOINT_SHARE = 0.02  # of the mass: a smaller set of elements is a weld, a bolt or glue
_BETTER = {**solid_elements.BETTER, **shells.BETTER}
_TIED = 100.0  # times what holds the nodes of a coupling as a body: how its reference node is
_SAME = 1e-9  # of the largest entry: what rounding leaves of a factor
_POWERS, _THICKNESSES = (1, 3, 5), np.array([1.0, 0.75, 1.3])  # over that drawn
_MOST_HELD, _MOST_PATCHES = 1500, 12  # directions of held nodes; patches, or all give together
_SOLVED = 10_000  # degrees of freedom up to which better elements are tried: four times as many


@dataclass(frozen=True)
class BetterElements:
    """The model of a deck, and the same with better elements.

    Those are linear elements with a node amid every edge, and shells with such nodes cut in four.

    Arguments:
        deck: with elements that better ones stand for.
    """

    deck: SolidDeck
    places: Mapping[str, Point]
    whole: Model

    def __call__(self) -> tuple[Model, Model]:
        """Return both models; the rows of the second begin with those of the first."""
        return self.whole, self._better

    @cached_property
    def _better(self) -> Model:
        deck = self.deck
        own_places = {int(node): at for node, at in self.places.items()}
        quarters, own_places, edge_of = shells.split_shells(deck.elements, own_places)
        better = replace(deck, elements={}, held=set(deck.held))
        better.sets = {name: dict(own) for name, own in deck.sets.items()}
        amid: dict[tuple[int, ...], int] = {}
        next_node, next_element = max(own_places) + 1, max(deck.elements) + 1
        for number, (kind, own) in deck.elements.items():
            found = _BETTER.get(kind)
            if number in quarters:
                numbers = (number, *range(next_element, next_element + 3))
                next_element += 3
                better.elements |= dict(zip(numbers, quarters[number], strict=True))
                for members in better.sets.values():
                    members |= dict.fromkeys(numbers) if number in members else {}
                continue
            if found is None:
                better.elements[number] = kind, own
                continue
            pairs = (pair for chain in KINDS[found].edges for pair in pairwise(chain))
            edges = [tuple(sorted((own[a], own[b]))) for a, b in pairs]
            new = [amid.setdefault(edge, next_node + len(amid)) for edge in edges]
            better.elements[number] = found, (*own, *new)
        for pair, node in amid.items():
            x, y, z = 0.5 * np.sum([own_places[end] for end in pair], axis=0)
            own_places[node], edge_of[node] = (float(x), float(y), float(z)), pair
        for node, ends in edge_of.items():
            better.held |= {(node, d) for d in range(6) if {(e, d) for e in ends} <= deck.held}
        better.attached = deck.attached.with_edges(edge_of, own_places)
        places = {str(node): at for node, at in own_places.items()}
        return _model_of(better, _materials(better), places, deck)


def read_solids(path: Path) -> Model:
    """Return mass, stiffness, labels and groups of a deck of solids, without what is held.

    Raises:
        InputError: as `read_deck`, and for elements without material, density or volume.
    """
    return solid_model(read_deck(path), nodes.read_nodes(path))


def solid_model(deck: SolidDeck, places: Mapping[str, Point]) -> Model:
    """Return the model of a deck, which knows itself with better elements where it is small.

    Raises:
        InputError: for elements without material, density or volume.
    """
    model = _model_of(deck, _materials(deck), places)
    kinds = {kind for kind, _ in deck.elements.values()}
    if not kinds & {*_BETTER, *shells.SHELLS} or model.size > _SOLVED or deck.couplings:
        return model
    return replace(model, finer=BetterElements(deck, places, model))


def _model_of(
    deck: SolidDeck,
    material: Mapping[int, str],
    places: Mapping[str, Point],
    before: SolidDeck | None = None,
) -> Model:
    """Return the model of a deck whose solid elements have these materials.

    Arguments:
        before: whose degrees of freedom come first.
    """
    path = deck.path
    needs("skfem", "solids", path)
    early = shells.find_lines_of_three((before or deck).elements)
    used = list(early | shells.find_lines_of_three(deck.elements))
    if lost := [n for n in (*used, *deck.couplings) if str(n) not in places]:
        raise InputError(f"node {lost[0]} of an element has no place", file=path, expected="*NODE")
    used = [n for n in used if n not in deck.couplings]
    own = {n: places[str(n)] for n in used}
    alone = {n: places[str(n)] for n in (*deck.attached.nodes(), *deck.couplings) if n not in own}
    solid = _thicken(deck, material, {**own, **alone})
    ends = dict.fromkeys(
        n for kind, nodes in solid.elements.values() if kind not in POINTS for n in nodes
    )
    row, xyz = {n: i for i, n in enumerate(ends)}, np.array([solid.places[n] for n in ends])
    motions = shells.Motions(
        row, deck.held | deck.attached.led(), {**early, **dict.fromkeys(alone, False)}
    )
    hung = NodeMotions(deck.attached, solid, motions, used, alone, path)
    found, moved = hung.found, hung.moved
    names = {n: name for n, (name, _) in deck.couplings.items()}
    groups, heavy = deck.groups(), {}
    solids = replace(deck, elements=solid.elements)
    coated = {n for name in deck.coated for n in deck.sets[name]}
    swells = [solid.swell(row, factor) for factor in _THICKNESSES[1:] if solid.lines]
    plates: dict[str, Powers] = {}
    grounds: list[tuple[str, list[SparseArray]]] = []
    parts: dict[str, SparseArray] = {}
    masses: dict[str, SparseArray] = {}
    mass = sp.csc_array(_point_masses(deck, found) + hung.mass(deck.attached.masses))
    for name, numbers in (groups or {REST: list(material)}).items():
        stiffness, inertia = _assemble(solids, numbers, row, xyz, material)
        parts[name] = hung.reduced(stiffness)
        masses[name] = hung.reduced(inertia)
        mass += masses[name]
        grounds += [(name, edge) for edge in _grounds(stiffness, inertia, hung.moved)]
        heavy[name] = float(inertia.sum())
        if all(deck.elements[n][0] in shells.SHELLS and n not in coated for n in numbers):
            pairs = [(parts[name], masses[name])]
            for swell in swells:
                every = sp.kron(swell, sp.eye_array(3), format="csr")
                thick = _assemble(solids, numbers, row, swell @ xyz, material)
                k, m = (hung.reduced(every.T @ part @ every) for part in thick)
                pairs.append((k, m))
            plates[name] = _find_powers(pairs)
    at = {(motion.node, motion.direction): i for i, motion in enumerate(found)}
    axes = np.array([motion.axes for motion in found])
    for n, (_, surface) in deck.couplings.items():
        around = list(deck.surfaces[surface])
        if loose := [node for node in around if node not in row]:
            what = f"node {loose[0]} of a coupling is none of a solid element"
            raise InputError(what, file=path, expected="nodes of solid elements")
        own_rows = [3 * row[node] + d for node in around for d in range(3)]
        _tie(n, around, parts, at, places, moved[own_rows], axes[:, :3])
    for name, (direction, value) in deck.springs.items():
        sprung = [(deck.elements[n][1][0], direction) for n in deck.sets.get(name, ())]
        own_rows = [at[key] for key in sprung if key in at]
        values = np.full(len(own_rows), value)
        parts[deck.named[name]] = sp.csc_array((values, (own_rows, own_rows)), shape=mass.shape)
    for name in deck.attached.groups():
        parts[name] = hung.stiffness([s for s in deck.attached.springs if s.group == name])
    stiffness = sp.csc_array(sum(parts.values()))
    if len(left := hung.kept(stiffness + mass)) < len(found):
        stiffness, mass = stiffness[left][:, left], mass[left][:, left]
        parts, masses = (
            {name: part[left][:, left] for name, part in own.items()} for own in (parts, masses)
        )
        plates = {
            name: {p: (k[left][:, left], m[left][:, left]) for p, (k, m) in own.items()}
            for name, own in plates.items()
        }
        grounds = [(n, [*(m[left] for m in own[:2]), *own[2:]]) for n, own in grounds]
        found, axes = [found[i] for i in left], axes[left]
    labels = [names.get(motion.node, str(motion.node)) for motion in found]
    parts = {name: part for name, part in parts.items() if part.count_nonzero()}
    model = matrix_model(
        sp.csc_array(mass),
        sp.csc_array(stiffness),
        labels,
        [DIRECTIONS[motion.direction] for motion in found],
        np.array([motion.xyz for motion in found]),
        parts if len(parts) > 1 else {},
    )
    prefix = Groups.PREFIX
    powers = {f"{prefix}{n}" if len(parts) > 1 else "all": own for n, own in plates.items()}
    model = replace(model, powers=powers)
    for name, edge in grounds if len(parts) > 1 else ():
        model = model.with_ground(name, *edge)
    dofs = replace(model.dofs, axes=axes)
    if solid.lines:
        geometry = MatrixGeometry(tuple(dict.fromkeys(labels)), dofs)
        model = replace(model, dofs=dofs, geometry=geometry)
    drawn = {
        name if groups else "": _outline(deck, numbers, own)
        for name, numbers in (groups or {REST: list(material)}).items()
    }
    assert isinstance(model.geometry, MatrixGeometry)
    model = replace(model, geometry=replace(model.geometry, outlines=drawn))
    least = JOINT_SHARE * sum(heavy.values())
    small = {name for name in model.groups if heavy.get(name, 0.0) < least}
    springs = GroupPriors(model).supports - heavy.keys()
    kinds = dict.fromkeys(small - springs, "joint")
    masses, families = masses if len(masses) > 1 else {}, _find_families(deck, material)
    return replace(model, mass_groups=masses, group_kinds=kinds, families=families)


def _find_families(deck: SolidDeck, material: Mapping[int, str]) -> dict[str, tuple[str, ...]]:
    """Return the groups of every material; one of several materials is in none."""
    found: dict[str, tuple[str, ...]] = {}
    for name, numbers in deck.groups().items():
        own = {deck.metals.get(material[n], material[n]) for n in numbers}
        if len(own) == 1:
            # No name in a word for a place has one of these.
            word = Groups.MATERIAL + re.sub("[@/:]", "-", own.pop())[:80]
            found[word] = (*found.get(word, ()), name)
    return found


def _grounds(
    stiffness: SparseArray, mass: SparseArray, moved: SparseArray
) -> Iterator[list[SparseArray]]:
    """Yield what a part does where its nodes are held, patch by patch; many give together.

    Arguments:
        stiffness, mass: of the part, of the translations of all nodes, (3 N, 3 N) each.
        moved: what the degrees of freedom do to these, (3 N, n), by rows.
    """
    held = np.diff(moved.indptr).reshape(-1, 3).max(axis=1) == 0
    own = np.flatnonzero(held & (stiffness.diagonal().reshape(-1, 3).max(axis=1) > 0.0))
    rows = (3 * own[:, None] + np.arange(3)).ravel()
    count, patch = connected_components(stiffness[rows][:, rows], directed=False)
    if count > _MOST_PATCHES:
        count, patch = 1, 0 * patch
    for i in range(count):
        at = rows[patch == i]
        across = [sp.csr_array(moved.T @ matrix[:, at]) for matrix in (stiffness, mass)]
        if len(at) <= _MOST_HELD and across[0].nnz:
            yield [*across, *(sp.csc_array(matrix[at][:, at]) for matrix in (stiffness, mass))]


def _find_powers(pairs: Sequence[tuple[SparseArray, SparseArray]]) -> Powers:
    """Return stiffness and mass that come with powers of the thickness of plates.

    Membrane and shear come with the thickness, bending with its cube, as the strains of a plate are
    even or odd across it. The fifth power is of nodes in the middle, and of what is curved.

    Arguments:
        pairs: stiffness and mass at `_THICKNESSES`.
    """
    shares = np.linalg.inv(np.power.outer(_THICKNESSES, _POWERS))
    found: dict[int, tuple[SparseArray, SparseArray]] = {}
    for power, share in zip(_POWERS, shares, strict=True):
        stiffness, mass = (
            sp.csc_array(sum(s * part for s, part in zip(share, parts, strict=True)))
            for parts in zip(*pairs, strict=True)
        )
        found[power] = stiffness, mass
    return found


def _tie(
    node: int,
    around: list[int],
    parts: dict[str, SparseArray],
    at: Mapping[tuple[int, int], int],
    places: Mapping[str, Point],
    moved: SparseArray,
    axes: FloatArray,
) -> None:
    """Make a reference node move as the motion of a body that fits those of some nodes best.

    It is held to that motion by springs, stiff against what holds the nodes, in the group that
    holds them most: the elements stay as soft as they are.

    Arguments:
        node, around: the reference node, and those it is tied to.
        parts: the stiffness by group, (n, n) each.
        at: degree of freedom by node and direction.
        moved: what degrees of freedom do to the translations of the nodes, (3 k, n).
        axes: directions of the degrees of freedom, (n, 3).
    """
    arms = np.array([places[str(n)] for n in around]) - np.array(places[str(node)])
    size = float(np.abs(arms).max())
    body = np.vstack([rigid(arm / size)[:3] for arm in arms])
    fit = np.linalg.pinv(body, rcond=1e-6)
    apart = sp.lil_array(-fit @ moved)
    for d in range(6):
        if (node, d) in at:
            apart[d, at[node, d]] = 1.0 if d < 3 else size
    inner = np.unique(moved.indices)
    held = {
        name: float(
            np.einsum("ij,ij", axes[inner], sp.csr_array(part)[inner][:, inner] @ axes[inner])
        )
        for name, part in parts.items()
    }
    name = max(held, key=held.__getitem__)
    apart = sp.csr_array(apart)
    parts[name] = sp.csc_array(parts[name] + _TIED / 3.0 * held[name] * (apart.T @ apart))


def _outline(deck: SolidDeck, numbers: Sequence[int], places: Mapping[int, Point]) -> FloatArray:
    """Return the ends of the edges that draw some elements, (e, 2, 3)."""
    row, xyz = {n: i for i, n in enumerate(places)}, np.array(list(places.values()))
    by_shape: dict[tuple[bool, int], list[list[int]]] = {}
    for number in numbers:
        kind, own = deck.elements[number]
        found = KINDS[kind]
        solid = isinstance(found, solid_elements.Kind)
        count = len(found.corners) if isinstance(found, solid_elements.Kind) else found.corners
        by_shape.setdefault((solid, count), []).append([row[n] for n in own[:count]])
    parts = [(solid, np.array(corners)) for (solid, _), corners in by_shape.items()]
    return np.asarray(xyz[find_outline(parts, xyz)])


def _thicken(
    deck: SolidDeck, material: Mapping[int, str], places: Mapping[int, Point]
) -> shells.Thickened:
    """Return solids in place of the shells of a deck."""
    thickness: dict[int, float] = {}
    for name, (_, value) in deck.sections.items():
        thickness |= dict.fromkeys(deck.sets[name], value)
    for number in material:
        if deck.elements[number][0] in shells.SHELLS and not thickness[number] > 0.0:
            what = f"shell element {number} has no thickness"
            raise InputError(what, file=deck.path, expected="*SHELL SECTION with a thickness")
    try:
        return shells.thicken(deck.elements, places, thickness)
    except ValueError as error:
        what = f"element {error.args[0]} has no area"
        raise InputError(what, file=deck.path, expected="corners around an area") from None


def _point_masses(deck: SolidDeck, found: Sequence[shells.Motion]) -> SparseArray:
    """Return the mass matrix of the masses at nodes."""
    own = {(m.node, m.direction): i for i, m in enumerate(found) if m.axes.any()}
    pairs = [
        (own[end], value)
        for name, value in deck.masses.items()
        for n in deck.sets.get(name, ())
        for d in range(3)
        if (end := (deck.elements[n][1][0], d)) in own
    ]
    rows, values = np.array(pairs).reshape(-1, 2).T
    at = rows.astype(int)
    return sp.csc_array((values, (at, at)), shape=(len(found), len(found)))


def _assemble(
    deck: SolidDeck,
    numbers: Sequence[int],
    row: Mapping[int, int],
    xyz: FloatArray,
    material: Mapping[int, str],
) -> tuple[SparseArray, SparseArray]:
    """Return stiffness and mass of some elements, of all kinds among them."""
    by_kind: dict[str, list[int]] = {}
    for number in numbers:
        by_kind.setdefault(deck.elements[number][0], []).append(number)
    found = []
    for kind, own in by_kind.items():
        ends = np.array([[row[node] for node in deck.elements[n][1]] for n in own])
        values = np.array([deck.materials[material[n]] for n in own])
        try:
            found.append(solid_elements.assemble(kind, ends, xyz, values))
        except ValueError as error:
            what = f"element {own[error.args[0]]} is turned inside out"
            raise InputError(what, file=deck.path, expected="a volume above zero") from None
    stiffness, mass = zip(*found, strict=True)
    return sum(stiffness), sum(mass)


def write_factors(model: Model, path: Path, original: Path) -> bool:
    """Write a deck in which every group has a material of its own, as stiff and heavy as updated.

    Arguments:
        model: updated, with the groups of the deck.
        original: the deck that the model came from.

    Returns:
        Whether factors of groups make the model; without them nothing is written.

    Raises:
        InputError: as `read_solids`.
    """
    deck = read_deck(original)
    material = _materials(deck)
    before = _model_of(deck, material, nodes.read_nodes(original))
    groups = deck.groups() or {REST: list(material)}
    found = factors_of(before, model)
    if "instances" in deck.named or found is None:
        return False
    factors, heavier = found
    if deck.masses and heavier.get(REST, 1.0) != 1.0:  # of all that there is
        return False
    section = {
        n: pair for name, pair in deck.sections.items() for n in deck.sets[name] if n in material
    }
    sections: list[str] = []
    for name, numbers in groups.items():
        for i, (old, thickness) in enumerate(dict.fromkeys(section[n] for n in numbers)):
            part = [n for n in numbers if section[n] == (old, thickness)]
            label = name if len(part) == len(numbers) else f"{name}_{i + 1}"
            if set(deck.sets.get(label.upper(), ())) != set(part):
                rows = (part[i : i + 12] for i in range(0, len(part), 12))
                sections += [f"*ELSET, ELSET={label}", *(", ".join(map(str, r)) for r in rows)]
            modulus, poisson, density = deck.materials[old]
            sections += [f"*MATERIAL, NAME={label}", "*ELASTIC"]
            sections += [f"{modulus * factors[name]!r}, {poisson!r}", "*DENSITY"]
            of_shells = np.isfinite(thickness)
            kind = "SHELL" if of_shells else "SOLID"
            sections += [
                repr(density * heavier.get(name, heavier.get(REST, 1.0))),
                f"*{kind} SECTION, ELSET={label}, MATERIAL={label}",
            ]
            sections += [repr(thickness)] if of_shells else []
    springs = {
        name: [str(direction + 1), repr(stiffness * factors[deck.named[name]])]
        for name, (direction, stiffness) in deck.springs.items()
    }
    lines = _other_lines(original, sections, springs)
    path.write_text("\n".join([*lines, ""]), encoding="latin-1")
    return True


def factors_of(before: Model, model: Model) -> tuple[dict[str, float], dict[str, float]] | None:
    """Return factors of stiffness and mass of the groups that make a model; None where none do."""
    found = []
    for groups, whole, updated, made in (
        (before.groups, before.stiffness, model.groups, model.stiffness),
        (before.mass_groups, before.mass, model.mass_groups, model.mass),
    ):
        parts, own = groups or {REST: whole}, updated if groups else {REST: made}
        if set(own) != set(parts) or made.shape != whole.shape:
            return None
        factors = {n: float(own[n].diagonal().sum() / k.diagonal().sum()) for n, k in parts.items()}
        grown = whole + sum((factors[n] - 1.0) * k for n, k in parts.items())
        every = float(made.diagonal().sum() / grown.diagonal().sum())  # a factor on all there is
        every = 1.0 if abs(every - 1.0) < _SAME else every
        factors = {n: every * factor for n, factor in factors.items()}
        factors = {n: 1.0 if abs(f - 1.0) < _SAME else f for n, f in factors.items()}
        grown = whole + sum((factors[n] - 1.0) * k for n, k in parts.items())
        if abs(grown - made).max() > _SAME * abs(made).max():
            return None
        found.append(factors)
    return found[0], found[1]


def _other_lines(
    path: Path, sections: Sequence[str], springs: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    """Return the lines of a deck and of what it includes with other materials and springs."""
    left_out, inside, last = ("MATERIAL", "ELASTIC", "DENSITY", *SECTIONS), False, ""
    for _, _, line in nodes.read_lines(path):
        if line.startswith("*"):
            keyword = line[1:].upper().replace(" ", "").partition(",")[0]
            if last in SECTIONS and keyword not in SECTIONS:
                yield from sections
                sections = ()
            inside, last = keyword in (*left_out, "INCLUDE"), keyword
            if keyword == "SPRING":
                name = re.search('ELSET *= *"?([^,"]+)', line, re.IGNORECASE)
                yield from (line, *springs[name[1].strip().upper() if name else ""])
                inside = True
        if not inside:
            yield line
    yield from sections


def _materials(deck: SolidDeck) -> dict[int, str]:
    """Return the material of every solid element by number."""
    found: dict[int, str] = {}
    for name, (material, _) in deck.sections.items():
        values = deck.materials.get(material)
        if values is None or name not in deck.sets:
            what = f"no {'material ' + material if values is None else 'set ' + name}"
            raise InputError(what, file=deck.path, expected="what the section names")
        for key, value in zip(("modulus", "Poisson's ratio", "density"), values, strict=True):
            if not np.isfinite(value):
                what, expected = f"material {material} has no {key}", "*ELASTIC and *DENSITY"
                raise InputError(what, file=deck.path, expected=expected)
        found |= dict.fromkeys(deck.sets[name], material)
    solid = set(deck.solids())
    if not solid or (lost := solid - found.keys()):
        what = f"element {min(lost)} has no section" if solid else "no elements"
        raise InputError(what, file=deck.path, expected="*ELEMENT and a section of it")
    return {number: found[number] for number in solid}
