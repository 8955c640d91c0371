"""Variables of FMI 2.0, from a model description."""

from lxml import etree

from orchestrator.fmi.access import Access
from orchestrator.fmi.variables3 import Variables, number, start_value
from orchestrator.master.protocol import Variable

_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")


def read_variables(root: etree._Element) -> Variables:
    """Return the variables of a model description."""
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/SimpleType")}
    found = []
    for scalar in root.findall("ModelVariables/ScalarVariable"):
        kind = next((child for child in scalar if child.tag in _TYPES), None)
        if kind is None:
            raise ValueError(f"the variable {scalar.get('name')!r} has no type")
        found.append(_variable(scalar, kind, types))
    accesses = [Access("Integer" if v.type == "Enumeration" else v.type, v.reference) for v in found]
    return Variables(found, accesses)


def _variable(scalar: etree._Element, kind: etree._Element, types: dict[str, etree._Element]) -> Variable:
    declared = types.get(kind.get("declaredType", ""))
    inherited = None if declared is None else declared.find(str(kind.tag))
    name, causality = scalar.attrib["name"], scalar.get("causality", "local")

    def attribute(key: str) -> str | None:
        own = kind.get(key)
        return own if own is not None or inherited is None else inherited.get(key)

    items = [] if inherited is None else inherited.findall("Item")
    return Variable(
        name=name,
        causality=causality,
        type=str(kind.tag),
        unit=attribute("unit") or None,
        variability=scalar.get("variability", "continuous" if kind.tag == "Real" else "discrete"),
        start=start_value(str(kind.tag), kind.get("start"), name),
        minimum=_limit(kind, attribute("min")),
        maximum=_limit(kind, attribute("max")),
        items=tuple((item.attrib["name"], int(item.attrib["value"])) for item in items),
        description=scalar.get("description", ""),
        reference=int(scalar.attrib["valueReference"]),
        relative=attribute("relativeQuantity") in {"true", "1"},
    )


def _limit(kind: etree._Element, text: str | None) -> float | None:
    """Return a limit; one beyond the 32 bits of a whole number limits nothing."""
    limit = number(text)
    return None if kind.tag != "Real" and limit is not None and abs(limit) > 2**31 else limit


def read_feedthrough(root: etree._Element, variables: Variables) -> dict[str, frozenset[str]]:
    """Return for each output whose dependencies are declared the inputs on which it depends at once."""
    direct = {}
    for unknown in root.findall("ModelStructure/Outputs/Unknown"):
        listed = unknown.get("dependencies")
        if listed is not None:
            known = [variables.scalars[int(index) - 1] for index in listed.split()]
            output = variables.scalars[int(unknown.attrib["index"]) - 1]
            direct[output.name] = frozenset(v.name for v in known if v.causality == "input")
    return direct
