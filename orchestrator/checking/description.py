"""The modelDescription.xml of an FMI 2.0 FMU as plain data, with the defaults of the standard filled in.

Whatever the schema would refuse is read as None here, so that a rule is never violated twice.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lxml import etree

NUMERIC = ("Real", "Integer", "Enumeration")
CAUSALITIES = ("parameter", "calculatedParameter", "input", "output", "local", "independent")
VARIABILITIES = ("constant", "fixed", "tunable", "discrete", "continuous")

# Table of section 2.2.7: (causality, variability) -> initial values allowed, the default first.
INITIAL: dict[tuple[str, str], tuple[str | None, ...]] = {
    **{("parameter", v): ("exact",) for v in ("fixed", "tunable")},
    **{("calculatedParameter", v): ("calculated", "approx") for v in ("fixed", "tunable")},
    **{("input", v): (None,) for v in ("discrete", "continuous")},
    ("output", "constant"): ("exact",),
    **{("output", v): ("calculated", "exact", "approx") for v in ("discrete", "continuous")},
    ("local", "constant"): ("exact",),
    **{("local", v): ("calculated", "approx") for v in ("fixed", "tunable")},
    **{("local", v): ("calculated", "exact", "approx") for v in ("discrete", "continuous")},
    ("independent", "continuous"): (None,),
}


@dataclass(frozen=True)
class SimpleType:
    """An element of TypeDefinitions."""

    element: etree._Element
    name: str
    kind: str
    attributes: Mapping[str, str]
    items: tuple[tuple[str, int | None], ...]


@dataclass(frozen=True)
class ScalarVariable:
    """A ScalarVariable; ``index`` counts from 1 as ModelStructure does.

    ``initial`` is the effective value (declared, or the default of the standard's table), ``attributes`` those
    of the type element after the declared type's have been filled in.
    """

    element: etree._Element
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

    def number(self, attribute: str) -> float | int | None:
        """A numeric attribute, or None when it is absent or no number.

        Args:
            attribute: its name in the XML.

        Returns:
            The value, in the variable's unit.
        """
        return number(self.attributes.get(attribute), self.kind)

    @property
    def start(self) -> str | None:
        """The start attribute as it is written."""
        return self.own.get("start")

    @property
    def base(self) -> str:
        """The type of the function that accesses the variable."""
        return "Integer" if self.kind == "Enumeration" else self.kind

    def path(self, attribute: str = "") -> str:
        """XPath of the variable; attributes of the type element are looked for there.

        Put together here, for lxml counts all siblings each time: too slow for 100,000 variables.

        Args:
            attribute: of the variable or of its type element; empty for the element.

        Returns:
            The path, after the file's name and a colon.
        """
        path = f"modelDescription.xml:/fmiModelDescription/ModelVariables/ScalarVariable[{self.index}]"
        if attribute and attribute not in self.element.attrib and self.kind:
            path += f"/{self.kind}"
        return path + (f"/@{attribute}" if attribute else "")


@dataclass(frozen=True)
class StructureEntry:
    """An entry of ModelStructure; ``dependencies`` and ``kinds`` are None when absent or unreadable."""

    section: str
    position: int
    index: int | None
    dependencies: tuple[int, ...] | None
    kinds: tuple[str, ...] | None

    def path(self, attribute: str) -> str:
        """XPath of an attribute.

        Args:
            attribute: its name in the XML.

        Returns:
            The path, after the file's name and a colon.
        """
        place = f"/fmiModelDescription/ModelStructure/{self.section}/Unknown[{self.position}]"
        return f"modelDescription.xml:{place}/@{attribute}"


@dataclass(frozen=True)
class Interface:
    """The CoSimulation or ModelExchange element."""

    element: etree._Element
    identifier: str | None
    sources: tuple[tuple[etree._Element, str], ...]

    def flag(self, name: str) -> bool:
        """A capability flag; absent means false.

        Args:
            name: of the capability, such as "canGetAndSetFMUstate".

        Returns:
            True when it is set.
        """
        return self.element.get(name) in ("true", "1")


@dataclass(frozen=True)
class Description:
    """What the rules look at."""

    root: etree._Element
    variables: tuple[ScalarVariable, ...]
    types: tuple[SimpleType, ...]
    units: Mapping[str, etree._Element]
    cosimulation: Interface | None
    model_exchange: Interface | None
    outputs: tuple[StructureEntry, ...]
    derivatives: tuple[StructureEntry, ...]
    initial_unknowns: tuple[StructureEntry, ...]

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """The interfaces that the FMU has."""
        return tuple(i for i in (self.cosimulation, self.model_exchange) if i is not None)

    def variable(self, index: int | None) -> ScalarVariable | None:
        """The variable with an index of ModelStructure, or None when there is none.

        Args:
            index: counted from 1.

        Returns:
            The variable.
        """
        if index is None or not 1 <= index <= len(self.variables):
            return None
        return self.variables[index - 1]

    def experiment(self, name: str) -> float | None:
        """A number of DefaultExperiment.

        Args:
            name: "startTime", "stopTime", "stepSize" or "tolerance".

        Returns:
            The number [s] (a tolerance without unit), or None when it is absent.
        """
        element = self.root.find("DefaultExperiment")
        value = None if element is None else number(element.get(name), "Real")
        return None if value is None else float(value)


def number(text: str | None, kind: str) -> float | int | None:
    """Read a number as the XML schema types it; None when ``text`` is absent or not one.

    Args:
        text: as the XML has it.
        kind: "Real", "Integer" and so on, as the XML names the type.

    Returns:
        The number.
    """
    if text is None:
        return None
    try:
        return float(text) if kind == "Real" else int(text)
    except ValueError:
        return None


def read_description(root: etree._Element) -> Description:
    """Read what the rules need; never fails on a document that is merely wrong.

    Args:
        root: of modelDescription.xml.

    Returns:
        The description; what is missing or wrong is None or empty.
    """
    types = tuple(_simple_type(e) for e in root.findall("TypeDefinitions/SimpleType") if len(e))
    by_name = {t.name: t for t in types}
    elements = root.findall("ModelVariables/ScalarVariable")
    return Description(
        root=root,
        variables=tuple(_variable(e, i, by_name) for i, e in enumerate(elements, 1)),
        types=types,
        units={e.get("name", ""): e for e in root.findall("UnitDefinitions/Unit")},
        cosimulation=_interface(root.find("CoSimulation")),
        model_exchange=_interface(root.find("ModelExchange")),
        outputs=_unknowns(root, "Outputs"),
        derivatives=_unknowns(root, "Derivatives"),
        initial_unknowns=_unknowns(root, "InitialUnknowns"),
    )


def _simple_type(element: etree._Element) -> SimpleType:
    inner = element[0]
    items = tuple((i.get("name", ""), _integer(i.get("value"))) for i in inner.findall("Item"))
    return SimpleType(element, element.get("name", ""), _tag(inner), dict(inner.attrib), items)


def _variable(element: etree._Element, index: int, types: Mapping[str, SimpleType]) -> ScalarVariable:
    inner: Any = next((e for e in element if e.tag in (*NUMERIC, "Boolean", "String")), None)
    own = {} if inner is None else dict(inner.attrib)
    kind = "" if inner is None else _tag(inner)
    declared = types.get(own.get("declaredType", ""))
    inherited = dict(declared.attributes) if declared is not None and declared.kind == kind else {}
    causality = element.get("causality", "local")
    variability = element.get("variability", "continuous")
    declared_initial = element.get("initial")
    default = INITIAL.get((causality, variability), (None,))[0]
    return ScalarVariable(
        element=element,
        index=index,
        name=element.get("name", ""),
        reference=_integer(element.get("valueReference")),
        kind=kind,
        causality=causality,
        variability=variability,
        declared_initial=declared_initial,
        initial=declared_initial if declared_initial is not None else default,
        attributes=inherited | own,
        own=own,
    )


def _unknowns(root: etree._Element, section: str) -> tuple[StructureEntry, ...]:
    found = []
    for position, element in enumerate(root.findall(f"ModelStructure/{section}/Unknown"), 1):
        text = element.get("dependencies")
        parts = None if text is None else tuple(_integer(p) for p in text.split())
        dependencies = None if parts is None or None in parts else parts
        kinds = element.get("dependenciesKind")
        found.append(
            StructureEntry(
                section,
                position,
                _integer(element.get("index")),
                dependencies,  # type: ignore[arg-type]
                None if kinds is None else tuple(kinds.split()),
            )
        )
    return tuple(found)


def _interface(element: etree._Element | None) -> Interface | None:
    if element is None:
        return None
    sources = tuple((e, e.get("name", "")) for e in element.findall("SourceFiles/File"))
    return Interface(element, element.get("modelIdentifier"), sources)


def _tag(element: etree._Element) -> str:
    return element.tag if isinstance(element.tag, str) else ""


def _integer(text: str | None) -> int | None:
    try:
        return None if text is None else int(text)
    except ValueError:
        return None
