"""Names and schemas that reading and writing share."""

from functools import cache
from pathlib import Path

from lxml import etree

from orchestrator.errors import ScenarioError

BASE = "http://ssp-standard.org/SSP1/"
SPACES = {
    "ssd": BASE + "SystemStructureDescription",
    "ssv": BASE + "SystemStructureParameterValues",
    "ssc": BASE + "SystemStructureCommon",
    "ssm": BASE + "SystemStructureParameterMapping",
    "osp": "http://opensimulationplatform.com/SSP/OSPAnnotations",
    "oms": "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
}
SCHEMAS = {
    "ssd": "SystemStructureDescription.xsd",
    "ssv": "SystemStructureParameterValues.xsd",
    "ssm": "SystemStructureParameterMapping.xsd",
}
OSP = "com.opensimulationplatform"
"""Type of the annotation in which libcosim looks for the communication step; others pass over it."""

OMS = "org.openmodelica"
"""Type of the annotation without which OMSimulator does not know that a system is co-simulated."""

STRUCTURE = "SystemStructure.ssd"
EXPONENTS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
MAXIMUM_XML = 64 * 2**20


def tag(space: str, name: str) -> str:
    """Return an element's name with its namespace, as lxml writes it.

    Args:
        space: prefix of the namespace, a key of ``SPACES``.
        name: of the element.

    Returns:
        The name with its namespace in braces.
    """
    return f"{{{SPACES[space]}}}{name}"


@cache
def schema(kind: str) -> etree.XMLSchema:
    """Return the XML schema of ``ssd``, ``ssv`` or ``ssm`` files.

    Args:
        kind: "ssd", "ssv" or "ssm".

    Returns:
        The schema that FMPy ships.
    """
    import fmpy.ssp

    folder = Path(fmpy.ssp.__file__).parent / "schema"
    return etree.XMLSchema(etree.parse(folder / SCHEMAS[kind]))


def parse(content: bytes, kind: str, origin: str) -> etree._Element:
    """Parse and validate an SSP file.

    Args:
        content: the XML.
        kind: "ssd", "ssv" or "ssm".
        origin: what to call the file in messages.

    Returns:
        The root element.

    Raises:
        ScenarioError: it is too large, not well-formed or does not follow its schema.
    """
    if len(content) > MAXIMUM_XML:
        raise ScenarioError(f"{origin}: must be at most {MAXIMUM_XML >> 20} MB, but is larger")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise ScenarioError(f"{origin}: must be well-formed XML, but is not: {error}") from None
    require_valid(root, kind, origin)
    return root


def require_valid(root: etree._Element, kind: str, origin: str) -> None:
    """Raise a ScenarioError unless ``root`` follows the schema of its kind.

    Args:
        root: of the document.
        kind: which schema.
        origin: file name, for the message.

    Raises:
        ScenarioError: it does not follow the schema; the message says where first.
    """
    rules = schema(kind)
    if not rules.validate(root):
        first = rules.error_log[0]
        raise ScenarioError(f"{origin}: must follow {SCHEMAS[kind]}, but does not: line {first.line}: {first.message}")
