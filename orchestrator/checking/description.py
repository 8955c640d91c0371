"""The modelDescription.xml of an FMU as plain data, with the defaults of the standard filled in."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod

from lxml import etree

from orchestrator.checking.dialects import FMI2, REAL, FmiDialect


@dataclass(frozen=True)
class SimpleType:
    """An element of TypeDefinitions; ``holder`` is the one that has its attributes."""

    element: etree._Element
    holder: etree._Element
    name: str
    kind: str
    attributes: Mapping[str, str]
    items: tuple[tuple[str, int | None], ...]


@dataclass(frozen=True)
class Dimension:
    """A dimension of an array: a size, or the value reference of the variable that has it; None where absent."""

    size: int | None
    reference: int | None


@dataclass(frozen=True)
class DescribedVariable:
    """A variable; ``index`` counts from 1 in the order of the file.

    ``initial`` is the effective value (declared, or the default of the standard's table), ``attributes`` those of the
    element that has its type after the declared type's have been filled in. ``starts`` are its start values as they
    are written, None when there are none; ``clocks`` and ``previous`` are value references.
    """

    element: etree._Element
    place: str
    index: int
    name: str
    reference: int | None
    kind: str
    causality: str
    variability: str
    declared_initial: str | None
    initial: str | None
    attributes: Mapping[str, str]
    own: Mapping[str, str]
    starts: tuple[str, ...] | None = None
    dimensions: tuple[Dimension, ...] = ()
    clocks: tuple[int, ...] | None = None
    previous: int | None = None
    aliases: tuple[etree._Element, ...] = ()

    def number(self, attribute: str) -> float | int | None:
        """A numeric attribute, or None when it is absent or no number."""
        return number(self.attributes.get(attribute), self.kind)

    @property
    def start(self) -> str | None:
        """The first start value as it is written."""
        return None if not self.starts else self.starts[0]

    @property
    def base(self) -> str:
        """The type of the function of FMI 2.0 that accesses the variable."""
        return "Integer" if self.kind == "Enumeration" else self.kind

    def flag(self, name: str) -> bool:
        """A flag among its attributes; absent means false."""
        return self.attributes.get(name) in ("true", "1")

    def path(self, attribute: str = "") -> str:
        """XPath of the variable, made here: lxml counts all siblings each time, too slow for 100,000 variables."""
        path = self.place
        if attribute and attribute not in self.element.attrib and self.element.tag == "ScalarVariable" and self.kind:
            path += f"/{self.kind}"
        return path + (f"/@{attribute}" if attribute else "")


@dataclass(frozen=True)
class StructureEntry:
    """An entry of ModelStructure; ``variable`` names it as the version does (index, or value reference).

    ``dependencies`` and ``kinds`` are None when absent or unreadable.
    """

    place: str
    variable: int | None
    dependencies: tuple[int, ...] | None
    kinds: tuple[str, ...] | None

    def path(self, attribute: str) -> str:
        """XPath of an attribute. Return the path, after the file's name and a colon."""
        return f"{self.place}/@{attribute}"


@dataclass(frozen=True)
class Interface:
    """The element CoSimulation, ModelExchange or ScheduledExecution."""

    element: etree._Element
    identifier: str | None
    sources: tuple[tuple[etree._Element, str], ...]

    @property
    def kind(self) -> str:
        return str(self.element.tag)

    def flag(self, name: str) -> bool:
        """A capability flag; absent means false."""
        return self.element.get(name) in ("true", "1")


@dataclass(frozen=True)
class Description:
    """What the rules look at."""

    dialect: FmiDialect
    root: etree._Element
    variables: tuple[DescribedVariable, ...]
    numbered: Mapping[int, DescribedVariable]
    types: tuple[SimpleType, ...]
    units: Mapping[str, etree._Element]
    interfaces: tuple[Interface, ...]
    outputs: tuple[StructureEntry, ...]
    derivatives: tuple[StructureEntry, ...]
    initial_unknowns: tuple[StructureEntry, ...]
    clocked_states: tuple[StructureEntry, ...]
    event_indicators: tuple[StructureEntry, ...]

    def interface(self, kind: str) -> Interface | None:
        return next((i for i in self.interfaces if i.kind == kind), None)

    def identity(self, v: DescribedVariable) -> int | None:
        """The number by which ModelStructure names a variable: its index, counted from 1, or its value reference."""
        return v.index if self.dialect is FMI2 else v.reference

    def variable(self, number: int | None) -> DescribedVariable | None:
        """The variable with a number of ModelStructure, or None when there is none."""
        return None if number is None else self.numbered.get(number)

    def size(self, v: DescribedVariable) -> int | None:
        """Number of values of a variable at its initial dimensions, or None when it cannot be told."""
        sizes = [self.extent(dimension) for dimension in v.dimensions]
        known = [size for size in sizes if size is not None]
        return prod(known) if len(known) == len(sizes) else None

    def extent(self, dimension: Dimension) -> int | None:
        """Initial size of a dimension. Return the size, or None when it cannot be told."""
        if dimension.size is not None or dimension.reference is None:
            return dimension.size
        holder = self.variable(dimension.reference)
        return None if holder is None else integer(holder.start)

    def experiment(self, name: str) -> float | None:
        """A number of DefaultExperiment [s] (a tolerance without unit), or None when it is absent."""
        element = self.root.find("DefaultExperiment")
        value = None if element is None else number(element.get(name), "Real")
        return None if value is None else float(value)


def number(text: str | None, kind: str) -> float | int | None:
    """Read a number as the XML schema types it; None when ``text`` is absent or not one."""
    if text is None:
        return None
    try:
        return float(text) if kind in REAL else int(text)
    except ValueError:
        return None


def integer(text: str | None) -> int | None:
    """Read a whole number."""
    try:
        return None if text is None else int(text)
    except ValueError:
        return None
