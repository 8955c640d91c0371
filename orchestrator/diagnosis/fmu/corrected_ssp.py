"""The corrected system as SSP 1.0: the original FMU untouched, effect FMUs wired around it, and their values."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

from orchestrator.building.archive import write_archive
from orchestrator.building.sources import digest
from orchestrator.building.worker import OWNED
from orchestrator.diagnosis.fmu.coupled_fmus import split_name
from orchestrator.diagnosis.fmu.problem import FmuModel, FmuProblem
from orchestrator.effects.of_fmus import CUT, INPUT, OUTPUT, PARAMETER, PORT, FmuEffect
from orchestrator.errors import FmuError, OrchestratorError
from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import Value
from orchestrator.master.signals import Samples
from orchestrator.scenarios.isolated import Safety
from orchestrator.scenarios.scenario import simulate
from orchestrator.scenarios.ssp.common import (
    STRUCTURE,
    VALUES,
    add_experiment,
    add_master,
    document_bytes,
    new_document,
    tag,
)
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.shared.equation_files import members
from orchestrator.shared.results.any_fmu import DeliveredFound, PartFound
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.tool_runs import run_tool
from pyfmu_sources.adapters.attachment import SERIES

PLANT = "plant"
CO_SIMULATION = "CoSimulation"
LEAD = 0.5  # share of a step by which effects extrapolate what is fed back, as in the fit
BUILD = (
    "import sys; from pythonfmu import FmuBuilder; "
    "FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2], project_files=sys.argv[3:])"
)
Joined = tuple[tuple[str, str], tuple[str, str]]


@dataclass(frozen=True)
class Part:
    """One effect FMU of the system: its name, the effect, and the values it is given.

    Without an effect, at an empty place, it hands a value from one FMU to another, extrapolated as in the fit.
    """

    name: str
    values: dict[str, float | int | bool]
    effect: FmuEffect | None = None
    where: str = ""
    place: str = ""

    @property
    def turn(self) -> int:
        """When a part before an FMU has its turn within a step: a signal passes all of them in one step.

        What depends at once on what was fed looks at that before it changes.
        """
        at_once = self.effect is None and bool(self.values["q2"])
        return -1 if at_once else (PARAMETER, INPUT, "", CUT, PORT).index(self.where)


def write_corrected(path: Path, problem: FmuProblem, model: FmuModel) -> DeliveredFound:
    """Write the corrected system, and compare its run with the fit."""
    parts, system = effect_parts(problem, model), problem.runner.system
    members = {f"resources/{fmu.name}": fmu.read_bytes() for fmu in system.members.values()}
    attachment = ""
    if parts:
        with Scratch("effects") as scratch:
            built = build_effect_fmu(scratch.path).read_bytes()
        attachment = f"AttachedEffect_{digest([built])[:8]}.fmu"
        members[f"resources/{attachment}"] = built
    starts: dict[str, dict[str, Value]] = {name: {} for name in system.members}
    for full, value in problem.starts(model).items():
        member, variable = split_name(full, system.members)
        starts[member][variable] = value
    for name, values in starts.items():
        members[f"resources/{name or PLANT}.ssv"] = parameter_values(values)
    for part in parts:
        members[f"resources/{part.name}.ssv"] = parameter_values(part.values)
    members[STRUCTURE] = _structure(problem, parts, attachment)
    write_archive(path, members)
    listed = tuple(PartFound(p.name, "connection" if p.effect is None else p.effect.label, p.values) for p in parts)
    try:
        return DeliveredFound(path.name, listed, _difference(path, problem, model, parts))
    except OrchestratorError as error:
        return DeliveredFound(path.name, listed, float("nan"), str(error))


def effect_parts(problem: FmuProblem, model: FmuModel) -> tuple[Part, ...]:
    """Return the effect FMUs of a corrected model."""
    parts, runner = [], problem.runner
    for k, c in enumerate(runner.system.connections):
        at_once = [t.gain for t in runner.feedthrough if t.wire == k]
        if len(at_once) > 1:
            raise FmuError(
                f"{c.source} must depend directly on at most one connection to be written as SSP, but depends on more"
            )
        values = {"series": SERIES.index("connection"), "q0": c.factor, "q1": c.offset, "q2": sum(at_once)}
        parts.append(Part(f"connection_{k + 1}", values | {"lead": LEAD}))
    for k, (effect, fitted) in enumerate(zip(model.effects, model.values, strict=True)):
        given: dict[str, float | int | bool] = {f"q{n}": float(v) for n, v in enumerate(fitted)}
        name, where, place = effect.row.name, effect.row.site, effect.place
        if where in (PORT, CUT):
            given |= {"series": -1, "law": effect.row.law, "sign": problem.sign.get(place, 1.0), "lead": LEAD}
            if where == PORT:
                given["has_velocity"] = problem.map.ports[place].velocity is not None
        else:
            given["series"] = SERIES.index("late_reading" if name == "output_delay" else name.partition("_")[2])
            if where == PARAMETER:
                reference = problem.map.signals[effect.signal].reference if effect.signal else problem.data.time[0]
                given |= {"q1": float(problem.starts(model)[place]), "q2": float(reference)}
            else:
                given |= {"law": 0, "at_rest": effect.at_rest}
            if name == "output_delay":
                given["q1"] = float(problem.m)
        parts.append(Part(f"{name}_{k + 1}", given, effect, where, place))
    return tuple(parts)


def build_effect_fmu(folder: Path) -> Path:
    """Return the effect FMU, built in ``folder`` from the laws' own source, its package named by their content."""
    sources = members("adapters.attachment")
    package = folder / f"effect_{digest(part for name in sources for part in (name.encode(), sources[name]))[:16]}"
    for name, content in sources.items():
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / name).write_bytes(content)
    script = folder / f"attachment_{package.name}.py"
    script.write_text(f"{OWNED}\nfrom {package.name}.adapters.attachment import AttachedEffect\n", encoding="utf-8")
    target = folder / "built"
    target.mkdir()
    run = run_tool([sys.executable, "-c", BUILD, str(script), str(target), str(package)], folder)
    built = sorted(target.glob("*.fmu"))
    if run.returncode != 0 or not built:
        lines = run.stderr.strip().splitlines() or ["no message"]
        raise FmuError(f"cannot build the effect FMU: {lines[-1]}")
    return built[0]


def _difference(path: Path, problem: FmuProblem, model: FmuModel, parts: tuple[Part, ...]) -> float:
    """Return the largest rms difference between a run of the system under our master and the fit, over the noise."""
    fitted, table, start = problem.must_simulate(model), problem.plain_table(), float(problem.data.time[0])
    signals = {_border(name, "in"): Samples(table[:, k], problem.step, start) for k, name in enumerate(problem.inputs)}
    for name in _signals_followed_by(parts):
        values = problem.data.signals[:-1, list(problem.map.signals).index(name)] + problem.map.signals[name].reference
        signals[_border(name, "in")] = Samples(np.repeat(values, problem.m), problem.step, start)
    worst = 0.0
    with open_ssp(path, signals, problem.step, False) as scenario:
        result = simulate(scenario, Safety())
    for k, name in enumerate(problem.outputs):
        last = [p.name for p in parts if p.where == OUTPUT and p.place == name]
        y = result[f"{last[-1]}.result" if last else ".".join(_owner(problem, name))][:: problem.m][: problem.n]
        rows = slice(problem.n // 20, None)
        rms = float(np.sqrt(np.mean((y[rows] - fitted[: len(y), k][rows]) ** 2)))
        worst = max(worst, rms / float(problem.noise[k]))
    return worst


def _owner(problem: FmuProblem, variable: str) -> tuple[str, str]:
    """Return component and connector of a variable of an FMU."""
    member, name = split_name(variable, problem.runner.system.members)
    return member or PLANT, name


def _border(name: str, way: str) -> str:
    """Return what a signal is called at the border of the system."""
    return f"{name.replace('.', '_')}_{way}"


def _signals_followed_by(parts: tuple[Part, ...]) -> list[str]:
    """Return the signals that parameters depend on."""
    return list(dict.fromkeys(p.effect.signal for p in parts if p.effect is not None and p.effect.signal))


def parameter_values(values: Mapping[str, Value]) -> bytes:
    """Return a parameter set (SSV) of values."""
    root = new_document("ssv", "ParameterSet", VALUES)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    kinds = {str: "String", bool: "Boolean", int: "Integer"}
    for name, value in values.items():
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=name)
        text = str(value).lower() if isinstance(value, bool) else value if isinstance(value, str) else repr(value)
        etree.SubElement(parameter, tag("ssv", kinds.get(type(value), "Real")), value=text)
    return document_bytes(root, "ssv", "values")


def _structure(problem: FmuProblem, parts: tuple[Part, ...], attachment: str) -> bytes:
    """Return the structure (SSD) of a corrected system."""
    root = new_document("ssd", "SystemStructureDescription", "corrected")
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    connectors = etree.SubElement(system, tag("ssd", "Connectors"))
    for name in (*problem.inputs, *_signals_followed_by(parts)):
        _connector(connectors, _border(name, "in"), "input")
    for name in problem.outputs:
        _connector(connectors, _border(name, "out"), "output")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    wires = _wires(problem, parts)
    for part in sorted((p for p in parts if p.where != OUTPUT), key=lambda p: p.turn):
        taken = [connector for _, (name, connector) in wires if name == part.name]
        _component(elements, part.name, attachment, {"input": taken, "output": ["result"]})
    for name, fmu in problem.runner.system.members.items():
        mine: dict[str, list[str]] = {"input": [], "parameter": [], "output": []}
        ends = dict.fromkeys([*(end for _, end in wires), *(_owner(problem, v) for v in problem.runner.reads)])
        for owner, variable in ends:
            if owner == (name or PLANT):
                full = f"{name}.{variable}" if name else variable
                mine[problem.runner.system.model.variables[full].causality].append(variable)
        exchange = read_description(fmu, events=False).exchange is not None
        _component(elements, name or PLANT, fmu.name, mine, "ModelExchange" if exchange else CO_SIMULATION)
    for part in (p for p in parts if p.where == OUTPUT):
        _component(elements, part.name, attachment, {"input": ["signal"], "output": ["result"]})
    connections = etree.SubElement(system, tag("ssd", "Connections"))
    for wire in wires:
        given: dict[str, str] = {}
        for (element, connector), way in zip(wire, ("start", "end"), strict=True):
            given |= ({f"{way}Element": element} if element else {}) | {f"{way}Connector": connector}
        etree.SubElement(connections, tag("ssd", "Connection"), given)
    add_master(system, problem.step, problem.map.options.tolerance)
    first, last = float(problem.data.time[0]), float(problem.data.time[-1])
    last = first + (problem.n - 1) * problem.m * problem.step if problem.short else last
    add_experiment(root, first, last, problem.step)
    return document_bytes(root, "ssd", STRUCTURE)


def _wires(problem: FmuProblem, parts: tuple[Part, ...]) -> list[Joined]:
    """Return the connections; an empty element is the system itself."""
    wires: list[Joined] = []
    given, runner, connections = problem.map, problem.runner, problem.runner.system.connections
    handed = dict(zip([c.target for c in connections], parts, strict=False))
    ports = [given.ports[p.place].input for p in parts if p.where == PORT]
    for name in dict.fromkeys([*problem.inputs, *ports, *handed]):
        at: tuple[str, str] | None = ("", _border(name, "in")) if name in problem.inputs else None
        series = [p for p in parts if p.where == INPUT and p.place == name]
        cuts = [p for p in parts if p.where == CUT and given.cuts[p.place].input == name]
        feedback = [p for p in parts if p.where == PORT and given.ports[p.place].input == name]
        for part in (*series, *([handed[name]] if name in handed else []), *cuts, *feedback):
            if at is not None:
                wires.append((at, (part.name, "signal")))
            at = (part.name, "result")
        assert at is not None
        wires.append((at, _owner(problem, name)))
    wires += [(_owner(problem, c.source), (part.name, "signal")) for c, part in zip(connections, parts, strict=False)]
    for t in runner.feedthrough:
        target = _owner(problem, connections[t.by].target)
        fed = next(start for start, end in wires if end == target)
        wires.append((fed, (parts[t.wire].name, "position")))
    for part in parts:
        wires += _further_wires(problem, part)
    for name in problem.outputs:
        at = _owner(problem, name)
        for part in parts:
            if part.where == OUTPUT and part.place == name:
                wires.append((at, (part.name, "signal")))
                at = (part.name, "result")
        wires.append((at, ("", _border(name, "out"))))
    return wires


def _further_wires(problem: FmuProblem, part: Part) -> list[Joined]:
    """Return what an effect reads beside the signal that it stands in, and the parameter that it sets."""
    if part.effect is None:
        return []
    if part.where == PORT:
        port = problem.map.ports[part.place]
        read = {"position": port.position, "velocity": port.velocity}
        return [(_owner(problem, name), (part.name, key)) for key, name in read.items() if name is not None]
    if part.where == CUT:
        return [(_owner(problem, problem.beyond(part.effect)), (part.name, "position"))]
    if part.where == PARAMETER:
        followed = part.effect.signal
        wires: list[Joined] = [((part.name, "result"), _owner(problem, part.place))]
        return wires + ([(("", _border(followed, "in")), (part.name, "signal"))] if followed else [])
    return []


def _component(
    parent: etree._Element, name: str, source: str, variables: Mapping[str, list[str]], interface: str = CO_SIMULATION
) -> None:
    given = {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{source}"}
    component = etree.SubElement(parent, tag("ssd", "Component"), given | {"implementation": interface})
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
