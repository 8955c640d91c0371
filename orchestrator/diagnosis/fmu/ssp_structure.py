"""The files of a corrected system as SSP 1.0: its structure and its parameter sets."""

from collections.abc import Mapping

from lxml import etree

from orchestrator.diagnosis.fmu.bank import CUT, INPUT, OUTPUT, PARAMETER, PORT
from orchestrator.diagnosis.fmu.binding import owned
from orchestrator.diagnosis.fmu.parts import Part
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.scenarios.ssp.common import SPACES, STRUCTURE, add_experiment, add_master, require_valid, tag

DATE = "2026-01-01T00:00:00Z"
PLANT = "plant"


def owner_and_connector(problem: BoxProblem, variable: str) -> tuple[str, str]:
    """Return component and connector of a variable of an FMU."""
    member, name = owned(variable, problem.runner.subject.members)
    return member or PLANT, name


def parameter_values(values: Mapping[str, float | int | bool | str]) -> bytes:
    """Return a parameter set (SSV) of values."""
    spaces = {key: SPACES[key] for key in ("ssv", "ssc")}
    root = etree.Element(tag("ssv", "ParameterSet"), nsmap=spaces, version="1.0", name="initialValues")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    for name, value in values.items():
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=name)
        kind, text = _kind_and_text(value)
        etree.SubElement(parameter, tag("ssv", kind), value=text)
    require_valid(root, "ssv", "values")
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _kind_and_text(value: float | int | bool | str) -> tuple[str, str]:
    if isinstance(value, str):
        return "String", value
    if isinstance(value, bool):
        return "Boolean", str(value).lower()
    return ("Integer" if isinstance(value, int) else "Real"), repr(value)


def border_name(name: str, way: str) -> str:
    """Return what a signal is called at the border of the system."""
    return f"{name.replace('.', '_')}_{way}"


def followed_signals(parts: tuple[Part, ...]) -> list[str]:
    """Return the signals that parameters depend on."""
    return list(dict.fromkeys(p.effect.signal for p in parts if p.effect is not None and p.effect.signal))


def _turn(part: Part) -> int:
    """Return when a part before an FMU has its turn within a step: a signal passes all of them in one step.

    What depends at once on what was fed looks at that before it changes.
    """
    at_once = part.effect is None and bool(part.values["q2"])
    return -1 if at_once else (PARAMETER, INPUT, "", CUT, PORT).index(part.where)


def system_structure(problem: BoxProblem, parts: tuple[Part, ...], attachment: str) -> bytes:
    """Return the structure (SSD) of a corrected system."""
    members = problem.runner.subject.members
    spaces = {key: SPACES[key] for key in ("ssd", "ssc", "ssv", "osp", "oms")}
    root = etree.Element(tag("ssd", "SystemStructureDescription"), nsmap=spaces, version="1.0", name="corrected")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    connectors = etree.SubElement(system, tag("ssd", "Connectors"))
    for name in (*problem.inputs, *followed_signals(parts)):
        _connector(connectors, border_name(name, "in"), "input")
    for name in problem.outputs:
        _connector(connectors, border_name(name, "out"), "output")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    ahead = sorted((p for p in parts if p.where != OUTPUT), key=_turn)
    behind = [p for p in parts if p.where == OUTPUT]
    wired = _wires(problem, parts)
    for part in ahead:
        taken = [connector for _, (name, connector) in wired if name == part.name]
        _component(elements, part.name, attachment, {"input": taken, "output": ["result"]})
    for name, fmu in members.items():
        mine = {"input": [], "parameter": [], "output": []}  # type: dict[str, list[str]]
        ends = dict.fromkeys(
            [end for _, end in wired] + [owner_and_connector(problem, v) for v in problem.runner.reads]
        )
        for owner, variable in ends:
            if owner == (name or PLANT):
                full = f"{name}.{variable}" if name else variable
                mine[problem.runner.subject.model.variables[full].causality].append(variable)
        _component(elements, name or PLANT, fmu.name, mine)
    for part in behind:
        _component(elements, part.name, attachment, {"input": ["signal"], "output": ["result"]})
    wires = etree.SubElement(system, tag("ssd", "Connections"))
    for start, end in wired:
        given = (
            dict(zip(("startElement", "startConnector"), start, strict=True))
            if start[0]
            else {"startConnector": start[1]}
        )
        given |= dict(zip(("endElement", "endConnector"), end, strict=True)) if end[0] else {"endConnector": end[1]}
        etree.SubElement(wires, tag("ssd", "Connection"), given)
    options, data = problem.map.options, problem.data
    add_master(system, problem.step, options.tolerance)
    first = float(data.time[0])
    last = first + (problem.n - 1) * problem.m * problem.step if problem.short else float(data.time[-1])
    add_experiment(root, first, last, problem.step)
    require_valid(root, "ssd", STRUCTURE)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


Joined = tuple[tuple[str, str], tuple[str, str]]


def _wires(problem: BoxProblem, parts: tuple[Part, ...]) -> list[Joined]:
    """Return the connections; an empty element is the system itself."""
    found: list[Joined] = []
    handed = dict(zip([c.target for c in problem.runner.subject.connections], parts, strict=False))
    ports = [problem.map.ports[p.place].input for p in parts if p.where == PORT]
    for name in dict.fromkeys([*problem.inputs, *ports, *handed]):
        at: tuple[str, str] | None = ("", border_name(name, "in")) if name in problem.inputs else None
        series = [p for p in parts if p.where == INPUT and p.place == name]
        cuts = [p for p in parts if p.where == CUT and problem.map.cuts[p.place].input == name]
        feedback = [p for p in parts if p.where == PORT and problem.map.ports[p.place].input == name]
        for part in (*series, *([handed[name]] if name in handed else []), *cuts, *feedback):
            if at is not None:
                found.append((at, (part.name, "signal")))
            at = (part.name, "result")
        assert at is not None
        found.append((at, owner_and_connector(problem, name)))
    for connected, part in zip(problem.runner.subject.connections, parts, strict=False):
        found.append((owner_and_connector(problem, connected.source), (part.name, "signal")))
    for t in problem.runner.through:
        target = owner_and_connector(problem, problem.runner.subject.connections[t.by].target)
        fed = next(start for start, end in found if end == target)
        found.append((fed, (parts[t.wire].name, "position")))
    for part in parts:
        found += _read(problem, part)
    for name in problem.outputs:
        at = owner_and_connector(problem, name)
        for part in parts:
            if part.where == OUTPUT and part.place == name:
                found.append((at, (part.name, "signal")))
                at = (part.name, "result")
        found.append((at, ("", border_name(name, "out"))))
    return found


def _read(problem: BoxProblem, part: Part) -> list[Joined]:
    """Return what an effect reads beside the signal that it stands in, and the parameter that it sets."""
    found: list[Joined] = []
    if part.effect is None:
        return found
    if part.where == PORT:
        port = problem.map.ports[part.place]
        found.append((owner_and_connector(problem, port.position), (part.name, "position")))
        if port.velocity is not None:
            found.append((owner_and_connector(problem, port.velocity), (part.name, "velocity")))
    elif part.where == CUT:
        found.append((owner_and_connector(problem, problem.beyond(part.effect)), (part.name, "position")))
    elif part.where == PARAMETER:
        found.append(((part.name, "result"), owner_and_connector(problem, part.place)))
        if part.effect.signal:
            found.append((("", border_name(part.effect.signal, "in")), (part.name, "signal")))
    return found


def _component(parent: etree._Element, name: str, source: str, variables: dict[str, list[str]]) -> None:
    given = {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{source}"}
    component = etree.SubElement(parent, tag("ssd", "Component"), given | {"implementation": "CoSimulation"})
    connectors = etree.SubElement(component, tag("ssd", "Connectors"))
    for kind, names in variables.items():
        for variable in names:
            _connector(connectors, variable, kind)
    bindings = etree.SubElement(component, tag("ssd", "ParameterBindings"))
    binding = {"type": "application/x-ssp-parameter-set", "source": f"resources/{name}.ssv"}
    etree.SubElement(bindings, tag("ssd", "ParameterBinding"), binding)


def _connector(parent: etree._Element, name: str, kind: str) -> None:
    connector = etree.SubElement(parent, tag("ssd", "Connector"), name=name, kind=kind)
    etree.SubElement(connector, tag("ssc", "Real"))
