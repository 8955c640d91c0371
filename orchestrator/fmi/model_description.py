"""What the master needs of a ``modelDescription.xml`` of FMI 2.0 for co-simulation; ``check`` looks at all the rest."""

import math
import zipfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from orchestrator.errors import FmuError
from orchestrator.master.protocol import ModelInterface, Unit, Value, Variable

MAXIMUM_XML = 64 * 2**20
"""Bytes of XML beyond which a model description is refused: ten times the largest seen in the wild."""

_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
_EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class FmuDescription:
    """An FMU's interface and what it takes to load it.

    Attributes:
        model: the interface as masters see it.
        guid: to be handed over at instantiation.
        identifier: name of the shared library.
        python: the FMU runs Python in this very process.
        once: only one instance per process is allowed.
    """

    model: ModelInterface
    guid: str
    identifier: str
    python: bool
    once: bool


def read_description(path: Path) -> FmuDescription:
    """Read the model description of the FMU at ``path``, a file or the folder of an unpacked one.

    Args:
        path: a file or a folder.

    Returns:
        The description.

    Raises:
        FmuError: the file is missing, no FMU, not FMI 2.0 or not for co-simulation.
    """
    if path.is_dir():
        return _read_unpacked(path)
    try:
        with zipfile.ZipFile(path) as archive:
            info = archive.getinfo("modelDescription.xml")
            if info.file_size > MAXIMUM_XML:
                raise FmuError(f"{path}: modelDescription.xml must be at most {MAXIMUM_XML >> 20} MB, but is larger")
            content = archive.read(info)
            names = archive.namelist()
    except FileNotFoundError:
        raise FmuError(f"`fmu` must exist, but {path} does not") from None
    except KeyError:
        raise FmuError(f"`fmu` must hold a modelDescription.xml, but {path} does not") from None
    except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, ValueError, EOFError) as error:
        raise FmuError(f"`fmu` must be a readable zip archive, but {path} is not: {error}") from None
    except Exception as error:  # zlib.error and what else a damaged archive makes zipfile raise
        raise FmuError(f"`fmu` must be an intact zip archive, but {path} is not: {error}") from None
    return parse_description(content, str(path), python="resources/slavemodule.txt" in names)


def _read_unpacked(folder: Path) -> FmuDescription:
    file = folder / "modelDescription.xml"
    try:
        if file.stat().st_size > MAXIMUM_XML:
            raise FmuError(f"{file}: must be at most {MAXIMUM_XML >> 20} MB, but is larger")
        content = file.read_bytes()
    except OSError as error:
        raise FmuError(f"`fmu` must hold a modelDescription.xml, but {folder} does not: {error.strerror}") from None
    python = (folder / "resources" / "slavemodule.txt").exists()
    return parse_description(content, str(folder), python)


def parse_description(content: bytes, origin: str, python: bool = False) -> FmuDescription:
    """Parse a model description.

    Args:
        content: the XML.
        origin: what to call it in messages.
        python: see ``FmuDescription``.

    Returns:
        The description.

    Raises:
        FmuError: it is no FMI 2.0 co-simulation description.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FmuError(f"{origin}: modelDescription.xml must be well-formed XML, but is not: {error}") from None
    version = root.get("fmiVersion")
    if root.tag != "fmiModelDescription" or version != "2.0":
        raise FmuError(f"{origin}: must be an FMI 2.0 FMU, but has fmiVersion {version!r}")
    cosimulation = root.find("CoSimulation")
    if cosimulation is None:
        raise FmuError(f"{origin}: must be an FMU for co-simulation, but has no CoSimulation element")
    try:
        return _description(root, cosimulation, python)
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise FmuError(f"{origin}: modelDescription.xml must follow FMI 2.0, but does not: {error}") from None


def _description(root: etree._Element, cosimulation: etree._Element, python: bool) -> FmuDescription:
    variables = _variables(root)
    names = [v.name for v in variables]
    if len(set(names)) < len(names):
        twice = next(name for name, count in Counter(names).items() if count > 1)
        raise ValueError(f"the variable {twice!r} is declared twice")
    identifier = cosimulation.attrib["modelIdentifier"]
    if not identifier.replace("_", "a").isalnum():
        raise ValueError(f"modelIdentifier {identifier!r} is no C identifier")
    model = ModelInterface(
        name=root.attrib["modelName"],
        variables=dict(zip(names, variables, strict=True)),
        units=_units(root),
        feedthrough=_feedthrough(root, variables),
        can_save_state=_flag(cosimulation, "canGetAndSetFMUstate"),
        can_vary_step=_flag(cosimulation, "canHandleVariableCommunicationStepSize"),
    )
    return FmuDescription(
        model=model,
        guid=root.attrib["guid"],
        identifier=identifier,
        python=python or "PythonFMU" in (root.get("generationTool") or ""),
        once=_flag(cosimulation, "canBeInstantiatedOnlyOncePerProcess"),
    )


def _flag(element: etree._Element, name: str) -> bool:
    return element.get(name) in {"true", "1"}


def _units(root: etree._Element) -> dict[str, Unit]:
    units = {}
    for element in root.findall("UnitDefinitions/Unit"):
        name = element.attrib["name"]
        base = element.find("BaseUnit")
        if base is None:
            units[name] = Unit(name)
        else:
            exponents = tuple(int(base.get(e, "0")) for e in _EXPONENTS)
            units[name] = Unit(name, exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
    return units


def _variables(root: etree._Element) -> list[Variable]:
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/SimpleType")}
    found = []
    for scalar in root.findall("ModelVariables/ScalarVariable"):
        kind = next((child for child in scalar if child.tag in _TYPES), None)
        if kind is None:
            raise ValueError(f"the variable {scalar.get('name')!r} has no type")
        found.append(_variable(scalar, kind, types))
    return found


def _variable(scalar: etree._Element, kind: etree._Element, types: dict[str, etree._Element]) -> Variable:
    declared = types.get(kind.get("declaredType", ""))
    inherited = None if declared is None else declared.find(str(kind.tag))
    name, causality = scalar.attrib["name"], scalar.get("causality", "local")

    def attribute(key: str) -> str | None:
        own = kind.get(key)
        return own if own is not None or inherited is None else inherited.get(key)

    items = [] if inherited is None else inherited.findall("Item")
    low, high = attribute("min"), attribute("max")
    return Variable(
        name=name,
        causality=causality,
        type=str(kind.tag),
        unit=attribute("unit") or None,
        variability=scalar.get("variability", "continuous" if kind.tag == "Real" else "discrete"),
        start=_start(str(kind.tag), kind.get("start"), name),
        minimum=None if low is None else float(low),
        maximum=None if high is None else float(high),
        items=tuple((item.attrib["name"], int(item.attrib["value"])) for item in items),
        description=scalar.get("description", ""),
        reference=int(scalar.attrib["valueReference"]),
    )


def _start(kind: str, text: str | None, name: str) -> Value | None:
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in {"true", "1"}
    value = float(text) if kind == "Real" else int(text)
    if not math.isfinite(value):
        raise ValueError(f"the start value of {name!r} is {text}")
    return value


def _feedthrough(root: etree._Element, variables: list[Variable]) -> dict[str, frozenset[str]]:
    direct = {}
    for unknown in root.findall("ModelStructure/Outputs/Unknown"):
        listed = unknown.get("dependencies")
        if listed is not None:
            known = [variables[int(index) - 1] for index in listed.split()]
            output = variables[int(unknown.attrib["index"]) - 1]
            direct[output.name] = frozenset(v.name for v in known if v.causality == "input")
    return direct
