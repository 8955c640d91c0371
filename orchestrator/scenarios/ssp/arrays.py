"""Arrays of SSP 2.0: connectors, connections and values of arrays become those of their elements."""

from collections.abc import Mapping
from dataclasses import replace

from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.size import SystemSize, element_count
from orchestrator.fmi.variables import element_places
from orchestrator.master.problems import Problem
from orchestrator.scenarios.ssp.flow import Node, Structure


def expand_arrays(structure: Structure, descriptions: Mapping[str, FmuDescription], size: SystemSize) -> None:
    """Replace what is said of arrays by what it says of their elements, which FMUs have as variables.

    ``size``: in which these have been counted.
    """
    places = _places(structure, descriptions, size)
    for node, sizes in structure.sizes.items():
        own = descriptions[node[0]].arrays.get(node[1], ()) if node[0] in descriptions else None
        if own is not None and None not in sizes and own != sizes:
            text = f"must have the sizes of the FMU's variable, {_shown(own)}, but has {_shown(sizes)}"
            structure.problems.append(Problem(f"$.{_named(node)}", text, mismatch=True))
    for node, (array, place) in structure.elements.items():
        if array[0] not in descriptions and place not in places.get(array, ()):
            text = f"must be an element of {array[1]}, but is none"
            structure.problems.append(Problem(f"$.{_named(node)}", text, mismatch=True))
    _expand_drivers(structure, places)
    for node, elements in places.items():
        kind, unit = structure.kinds.pop(node, None), structure.connector_units.pop(node, None)
        for place in elements if kind is not None else ():
            structure.kinds[node[0], node[1] + place] = str(kind)
            if unit is not None:
                structure.connector_units[node[0], node[1] + place] = unit
    _expand_values(structure, descriptions, places)


def _named(node: Node) -> str:
    return ".".join(filter(None, node))


def _shown(sizes: tuple[int | None, ...]) -> str:
    return " x ".join(map(str, sizes)) if sizes else "none"


def _places(
    structure: Structure, descriptions: Mapping[str, FmuDescription], size: SystemSize
) -> dict[Node, list[str]]:
    """Return the elements of each connector that is an array: as its FMU, the file or what it is joined to says."""
    places: dict[Node, list[str]] = {}
    for node in structure.kinds:
        if node[0] in descriptions:
            sizes = descriptions[node[0]].arrays.get(node[1], ())
        else:
            stated = structure.sizes.get(node, ())
            sizes = () if None in stated else tuple(length for length in stated if length)
            size.add(element_count(sizes), _named(node))
        if sizes:
            places[node] = element_places(sizes)
    open_nodes = {node for node in structure.sizes if node[0] not in descriptions and node not in places}
    pairs = [
        pair for target, (source, _, _) in structure.drivers.items() for pair in ((target, source), (source, target))
    ]
    while learned := {a: places[b] for a, b in pairs if a in open_nodes and b in places and a not in places}:
        for node, elements in learned.items():
            size.add(len(elements), _named(node))
        places |= learned
    return places


def _expand_drivers(structure: Structure, places: Mapping[Node, list[str]]) -> None:
    for target, (source, factor, offset) in list(structure.drivers.items()):
        ends = places.get(target), places.get(source)
        if ends == (None, None):
            continue
        del structure.drivers[target]
        path = f"$.{_named(target)}"
        if ends[0] is None or ends[0] != ends[1]:
            last = [elements[-1] if elements else " (a scalar)" for elements in ends]
            text = (
                f"must be joined to an array of its size, but ends with {target[1]}{last[0]} and {source[1]}{last[1]}"
            )
            structure.problems.append(Problem(path, text, mismatch=True))
            continue
        for place in ends[0]:
            element = target[0], target[1] + place
            if element in structure.drivers:
                text = f"must be fed once, but its element {place} is fed twice"
                structure.problems.append(Problem(path, text, mismatch=True))
            structure.drivers[element] = (source[0], source[1] + place), factor, offset


def _expand_values(
    structure: Structure, descriptions: Mapping[str, FmuDescription], places: Mapping[Node, list[str]]
) -> None:
    for node, given in list(structure.given.items()):
        sizes = descriptions[node[0]].arrays.get(node[1]) if node[0] in descriptions else None
        elements = places.get(node) if sizes is None else element_places(sizes)
        if elements is None:
            continue
        del structure.given[node]
        texts = given.texts or (given.text,)
        if len(texts) != len(elements):
            text = f"must have {len(elements)} values, but has {len(texts)}"
            structure.problems.append(Problem(f"$.{_named(node)}", text))
            continue
        for place, text in zip(elements, texts, strict=True):
            structure.given.setdefault((node[0], node[1] + place), replace(given, text=text, texts=()))
