"""What the master needs of a model description of FMI 2.0 or 3.0; ``check`` looks at all the rest."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from lxml import etree

from orchestrator.errors import FmuError
from orchestrator.fmi.access import Access
from orchestrator.fmi.clocks import EventFeatures, names_in_words, read_clocks
from orchestrator.fmi.variables import read_feedthrough, read_scalars, read_variables
from orchestrator.master.protocol import ModelInterface, Unit, Value
from orchestrator.shared.isolation.archives import open_archive
from orchestrator.shared.units import EXPONENTS

PYTHON_SLAVE = "resources/slavemodule.txt"  # in what PythonFMU builds
MAXIMUM_XML = 64 * 2**20
"""Bytes of XML beyond which a model description is refused: ten times the largest seen in the wild."""


@dataclass(frozen=True)
class Exchange:
    """What it takes to integrate an FMU for model exchange."""

    states: int  # number of continuous states, before structural parameters are set
    indicators: int  # number of event indicators, likewise
    completed: bool  # the FMU is to be told of every step that the integrator has completed


@dataclass(frozen=True)
class FmuDescription:
    """An FMU's interface and what it takes to load it."""

    model: ModelInterface  # the interface as masters see it
    version: str  # of FMI, "2.0" or "3.0"
    guid: str  # to be handed over at instantiation; FMI 3.0 calls it a token
    identifier: str  # name of the shared library
    python: bool  # the FMU runs Python in this very process
    once: bool  # only one instance per process is allowed
    access: Mapping[str, Access]  # where the value of each variable is, by its name
    events: EventFeatures = field(default_factory=EventFeatures)  # what event mode needs to know
    # sizes of the dimensions of the arrays, by name
    arrays: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    structural: frozenset[str] = frozenset()  # names of the structural parameters
    # values that these are given before an instance is initialised, where they are not the FMU's own
    configured: Mapping[str, Value] = field(default_factory=dict)
    # names of the elements of arrays that have no start value, for that is for another size
    resized: frozenset[str] = frozenset()
    left_out: str = ""  # what of the FMU is not there for the master, in words; empty for nothing
    # what it takes to integrate it; ``None``: it integrates itself, for it is for co-simulation
    exchange: Exchange | None = None
    inputs: frozenset[str] = frozenset()  # names of the inputs that may change while it is integrated


def read_description(
    path: Path, events: bool = True, configured: Mapping[str, Value] | None = None, exchange: bool = False
) -> FmuDescription:
    """Read the model description of the FMU at ``path``, a file or the folder of an unpacked one.

    Args:
        events: event mode is used where the FMU has it.
        configured: values of structural parameters, which are set in configuration mode.
        exchange: an FMU for both is used as model exchange.
    """
    content, python = _read_unpacked(path) if path.is_dir() else _read_archive(path)
    description = parse_description(content, str(path), python, configured, exchange)
    if events or not description.model.has_events:
        return description
    clocks = [*description.model.clocks, *description.model.triggered, *description.events.timed]
    if clocks and not description.events.self_sampling:
        raise FmuError(f"{path}: its clocks ({names_in_words(clocks)}) tick in event mode, which is not used here")
    model = replace(
        description.model,
        has_events=False,
        output_derivatives=0,
        inputs_inside_steps=frozenset(),
        clocks={},
        triggered={},
    )
    return replace(description, model=model, events=EventFeatures())


def _read_archive(path: Path) -> tuple[bytes, bool]:
    """Return the model description's content, and whether the FMU runs Python."""
    with open_archive(path) as (archive, members):
        info = members.get("modelDescription.xml")
        if info is None:
            inner = next((f"; it has {name}" for name in members if name.endswith("/modelDescription.xml")), "")
            raise FmuError(f"`fmu` must hold a modelDescription.xml at its top, but {path} does not{inner}")
        if info.file_size > MAXIMUM_XML:
            raise FmuError(f"{path}: modelDescription.xml must be at most {MAXIMUM_XML >> 20} MB, but is larger")
        return archive.read(info), PYTHON_SLAVE in members


def _read_unpacked(folder: Path) -> tuple[bytes, bool]:
    file = folder / "modelDescription.xml"
    try:
        if file.stat().st_size > MAXIMUM_XML:
            raise FmuError(f"{file}: must be at most {MAXIMUM_XML >> 20} MB, but is larger")
        content = file.read_bytes()
    except OSError as error:
        raise FmuError(f"`fmu` must hold a modelDescription.xml, but {folder} does not: {error.strerror}") from None
    return content, (folder / PYTHON_SLAVE).exists()


def parse_description(
    content: bytes,
    origin: str,
    python: bool = False,
    configured: Mapping[str, Value] | None = None,
    exchange: bool = False,
) -> FmuDescription:
    """Parse a model description; see ``read_description``."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise FmuError(f"{origin}: modelDescription.xml must be well-formed XML, but is not: {error}") from None
    version = root.get("fmiVersion") or ""
    if root.tag != "fmiModelDescription" or not re.fullmatch(r"2\.0|3\.\d+", version):
        raise FmuError(f"{origin}: must be an FMI 2.0 or 3.0 FMU, but has fmiVersion {version!r}")
    found = [root.find("ModelExchange")] if exchange else [root.find("CoSimulation"), root.find("ModelExchange")]
    interface = next((element for element in found if element is not None), None)
    if interface is None and exchange:
        others = (
            ", ".join(tag for tag in ("CoSimulation", "ScheduledExecution") if root.find(tag) is not None) or "none"
        )
        raise FmuError(f"{origin}: must be an FMU for model exchange, as is asked for, but is for {others}")
    if interface is None:
        alone = ": it is for scheduled execution alone" if root.find("ScheduledExecution") is not None else ""
        raise FmuError(f"{origin}: must be an FMU for co-simulation or model exchange, but is for neither{alone}")
    try:
        return _describe(root, interface, version == "2.0", python, configured or {})
    except FmuError as error:
        raise FmuError(f"{origin}: {error}") from None
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise FmuError(f"{origin}: modelDescription.xml must follow FMI {version}, but does not: {error}") from None


def _describe(
    root: etree._Element, interface: etree._Element, is_old: bool, python: bool, configured: Mapping[str, Value]
) -> FmuDescription:
    """Return what a description of FMI 2.0 (``is_old``) or 3.0 says."""
    found = read_scalars(root) if is_old else read_variables(root, configured)
    names = _unique([v.name for v in found.scalars])
    variables = dict(zip(names, found.scalars, strict=True))
    exchange = None if interface.tag == "CoSimulation" else _read_exchange(root, interface, is_old)
    is_free = ("input", "Real", "continuous")  # may change while time goes on
    free = (v.name for v in variables.values() if (v.causality, v.type, v.variability) == is_free)
    inputs = frozenset(free if exchange else ())
    has_events = exchange is not None or (not is_old and _flag(interface, "hasEventMode"))
    clocks = read_clocks(found)
    if found.clocks and not has_events:
        raise ValueError(f"it has clocks ({names_in_words(list(found.clocks))}), but no event mode")
    inside = clocks.features.inside if not is_old and _flag(interface, "providesIntermediateUpdate") else inputs
    model = ModelInterface(
        name=root.attrib["modelName"],
        variables=variables,
        units=_units(root),
        feedthrough=read_feedthrough(root, found),
        can_save_state=_flag(interface, "canGetAndSetFMUstate" if is_old else "canGetAndSetFMUState"),
        can_vary_step=exchange is not None or _flag(interface, "canHandleVariableCommunicationStepSize"),
        has_events=has_events,
        output_derivatives=0 if is_old or not has_events else int(interface.get("maxOutputDerivativeOrder", "0")),
        inputs_inside_steps=inside if has_events else inputs,
        clocks=clocks.periodic,
        triggered=clocks.triggered,
        output_clocks=clocks.outputs,
    )
    return FmuDescription(
        model=model,
        version="2.0" if is_old else "3.0",
        guid=root.attrib["guid" if is_old else "instantiationToken"],
        identifier=_identifier(interface),
        python=python or "PythonFMU" in (root.get("generationTool") or ""),
        once=_flag(interface, "canBeInstantiatedOnlyOncePerProcess"),
        access=dict(zip(names, found.accesses, strict=True)),
        events=clocks.features,
        arrays=found.arrays,
        structural=frozenset(found.structural),
        configured=configured,
        resized=frozenset(found.resized),
        left_out=_note_on_unusable(found.binaries, clocks.left_out),
        exchange=exchange,
        inputs=inputs,
    )


def _read_exchange(root: etree._Element, interface: etree._Element, is_old: bool) -> Exchange:
    """Return what a description says; in FMI 3.0 the FMU itself says better."""
    if is_old:
        states, indicators = root.findall("ModelStructure/Derivatives/Unknown"), root.get("numberOfEventIndicators")
        is_needed = not _flag(interface, "completedIntegratorStepNotNeeded")
        return Exchange(len(states), int(indicators or 0), is_needed)
    states, found = (root.findall(f"ModelStructure/{tag}") for tag in ("ContinuousStateDerivative", "EventIndicator"))
    return Exchange(len(states), len(found), _flag(interface, "needsCompletedIntegratorStep"))


def _note_on_unusable(binaries: Sequence[str], clocks: Sequence[str]) -> str:
    texts = [f"{kind} {names_in_words(names)}" for kind, names in (("Binary", binaries), ("clocks", clocks)) if names]
    return f"variables that nothing here can use are left as they are: {'; '.join(texts)}" if texts else ""


def _unique(names: list[str]) -> list[str]:
    if len(set(names)) < len(names):
        twice = next(name for name, count in Counter(names).items() if count > 1)
        raise ValueError(f"the variable {twice!r} is declared twice")
    return names


def _identifier(interface: etree._Element) -> str:
    identifier = interface.attrib["modelIdentifier"]
    if not identifier.replace("_", "a").isalnum():
        raise ValueError(f"modelIdentifier {identifier!r} is no C identifier")
    return identifier


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
            exponents = tuple(int(base.get(e, "0")) for e in EXPONENTS)
            units[name] = Unit(name, exponents, float(base.get("factor", "1")), float(base.get("offset", "0")))
    return units
