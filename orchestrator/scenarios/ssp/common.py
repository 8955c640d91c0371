"""Names and schemas that reading and writing share.

In all functions: ``step``: communication step [s].
"""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from lxml import etree

from orchestrator.errors import ScenarioError
from orchestrator.scenarios.ssp.grammar import SSP2
from orchestrator.shared.xml_grammar import grammar_faults

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
ROOTS = {"ssd": "SystemStructureDescription", "ssv": "ParameterSet", "ssm": "ParameterMapping"}
_PREFIXES = {space: prefix for prefix, space in SPACES.items()}
OSP = "com.opensimulationplatform"
"""Type of the annotation in which libcosim looks for the communication step; others pass over it."""

OMS = "org.openmodelica"
"""Type of the annotation without which OMSimulator does not know that a system is co-simulated."""

OMS_TOLERANCE = 1e-4
"""Relative tolerance that OMSimulator hands to FMUs where a file states none; stated, it counts as not stated."""

STRUCTURE = "SystemStructure.ssd"
DATE = "2026-01-01T00:00:00Z"
"""Date in the files' metadata: fixed, so that the same system gives the same bytes."""

VALUES = "initialValues"
"""Name of every parameter set: ecos applies the sets of one name, others do not look at it."""

FURTHER = {"ssd": ("ssv", "osp", "oms"), "ssv": ()}
"""Namespaces that a file of each kind uses beside its own and the common one."""
MAXIMUM_XML = 64 * 2**20


def tag(space: str, name: str) -> str:
    """Return an element's name with its namespace, as lxml writes it."""
    return f"{{{SPACES[space]}}}{name}"


@cache
def schema(kind: str) -> etree.XMLSchema:
    """Return the XML schema of ``ssd``, ``ssv`` or ``ssm`` files."""
    import fmpy.ssp

    folder = Path(fmpy.ssp.__file__).parent / "schema"
    return etree.XMLSchema(etree.parse(folder / SCHEMAS[kind]))


def parse(content: bytes, kind: str, origin: str) -> etree._Element:
    """Parse and validate an SSP file."""
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
    """Raise a ScenarioError unless ``root`` follows the schema of its kind, and of its version of SSP."""
    if (root.get("version") or "").startswith("2"):
        _require_grammar(root, kind, origin)
        return
    rules = schema(kind)
    if not rules.validate(root):
        first = rules.error_log[0]
        raise ScenarioError(f"{origin}: must follow {SCHEMAS[kind]}, but does not: line {first.line}: {first.message}")


def new_document(kind: str, element: str, name: str, version: str = "1.0") -> etree._Element:
    """Return the root of an ``ssd`` or ``ssv`` file of a version of SSP."""
    spaces = {key: SPACES[key] for key in (kind, "ssc", *FURTHER[kind])}
    root = etree.Element(tag(kind, element), nsmap=spaces, version=version, name=name)
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    return root


def document_bytes(root: etree._Element, kind: str, origin: str) -> bytes:
    """Return the text of a file that follows the schema of its kind."""
    require_valid(root, kind, origin)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _require_grammar(root: etree._Element, kind: str, origin: str) -> None:
    """Raise a ScenarioError unless ``root`` follows the grammar of SSP 2.0."""
    expected = tag(kind, ROOTS[kind])
    if root.tag != expected:
        raise ScenarioError(f"{origin}: must be <{kind}:{ROOTS[kind]}>, but is <{root.tag}>")
    if faults := grammar_faults(root, SSP2, _short_name):
        first, more = faults[0], len(faults) - 1
        text = f"{origin}: must follow SSP 2.0, but does not: line {first.element.sourceline}: {first.message}"
        raise ScenarioError(f"{text} (and {more} more)" if more else text)


def _short_name(name: str) -> str:
    """Return what the grammar calls a tag: its space's usual prefix, a dot and its name."""
    space, _, local = name.lstrip("{").rpartition("}")
    return f"{_PREFIXES[space]}.{local}" if space in _PREFIXES else name


def add_master(system: etree._Element, step: float, solver_tolerance: float | None) -> None:
    """Say of a system that it is co-simulated, how it steps and how exactly its FMUs solve: as OMSimulator reads it."""
    annotations = etree.SubElement(system, tag("ssd", "Annotations"))
    annotation = etree.SubElement(annotations, tag("ssc", "Annotation"), type=OMS)
    information = etree.SubElement(
        etree.SubElement(annotation, tag("oms", "Annotations")), tag("oms", "SimulationInformation")
    )
    given = {"description": "oms-ma", "stepSize": repr(step), "absoluteTolerance": f"{OMS_TOLERANCE:g}"}
    given["relativeTolerance"] = f"{OMS_TOLERANCE if solver_tolerance is None else solver_tolerance:.12g}"
    etree.SubElement(information, tag("oms", "FixedStepMaster"), given)


def add_experiment(root: etree._Element, start: float, stop: float, step: float) -> None:
    """Say when a system runs, and its communication step where libcosim reads it. ``start``, ``stop``: [s]."""
    times = {"startTime": repr(start), "stopTime": repr(stop)}
    experiment = etree.SubElement(root, tag("ssd", "DefaultExperiment"), times)
    annotations = etree.SubElement(experiment, tag("ssd", "Annotations"))
    annotation = etree.SubElement(annotations, tag("ssc", "Annotation"), type=OSP)
    algorithm = etree.SubElement(annotation, tag("osp", "Algorithm"))
    etree.SubElement(algorithm, tag("osp", "FixedStepAlgorithm"), {"baseStepSize": repr(step)})


def solver_tolerance(system: etree._Element) -> float | None:
    """Return the relative tolerance for the FMUs' own solvers that a system states where OMSimulator looks for it."""
    stated = _numbers_of(system, "*", "relativeTolerance")
    return next((value for value in stated if 0.0 < value < 1.0 and value != OMS_TOLERANCE), None)


def oms_step(system: etree._Element) -> float | None:
    """Return the communication step [s] that a system states where OMSimulator looks for it, or None."""
    stated = _numbers_of(system, tag("oms", "FixedStepMaster"), "stepSize")
    return next((value for value in stated if 0.0 < value < float("inf")), None)


def _numbers_of(system: etree._Element, element: str, attribute: str) -> Iterator[float]:
    """Yield the numbers in an attribute of elements of OMSimulator's SimulationInformation."""
    for annotation in system.findall(f"{tag('ssd', 'Annotations')}/{tag('ssc', 'Annotation')}[@type='{OMS}']"):
        for found in annotation.findall(f".//{tag('oms', 'SimulationInformation')}/{element}[@{attribute}]"):
            try:
                yield float(str(found.get(attribute)))
            except ValueError:
                continue


def file_of_uri(folder: Path, source: str) -> Path | None:
    """Return the file of an archive that a URI names, such as ``resources/My%20Part.fmu``."""
    for text in (unquote(source), source):
        file = (folder / text.replace("\0", "%00")).resolve()
        if file.is_relative_to(folder.resolve()) and os.path.isfile(file):
            return file
    return None
