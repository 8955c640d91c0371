"""The corrected system as an SSP: the original FMU untouched, effect FMUs wired around it, and their values."""

import hashlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree

import pyfmu_sources
from orchestrator.building.archive import write_archive
from orchestrator.diagnosis.blackbox.bank import CUT, INPUT, OUTPUT, PARAMETER, PORT, BoxEffect
from orchestrator.diagnosis.blackbox.binding import owned
from orchestrator.diagnosis.blackbox.judged import BoxOutcome
from orchestrator.diagnosis.blackbox.problem import series_of
from orchestrator.errors import FmuError, OrchestratorError
from orchestrator.master.protocol import Value
from orchestrator.master.signals import Samples
from orchestrator.scenarios.isolated import Safety
from orchestrator.scenarios.scenario import simulate
from orchestrator.scenarios.ssp.common import SPACES, STRUCTURE, add_experiment, add_master, require_valid, tag
from orchestrator.scenarios.ssp.read import opened_ssp
from orchestrator.shared.results.any_fmu import DeliveredFound, PartFound
from pyfmu_sources.attachment import SERIES

DATE = "2026-01-01T00:00:00Z"
PLANT = "plant"
BUILD = (
    "import sys; from pythonfmu import FmuBuilder; "
    "FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2], project_files=sys.argv[3:])"
)


_KINDS = {"Boolean": bool, "Integer": int, "Real": float, "String": str}


@dataclass(frozen=True)
class Part:
    """One effect FMU of the system: its name, the effect, and the values it is given.

    Without an effect it hands a value from one FMU to another, extrapolated as in the fit.
    """

    name: str
    effect: BoxEffect | None
    values: dict[str, float | int | bool]

    @property
    def where(self) -> str:
        """Where it acts; empty: between two FMUs, with no effect."""
        return "" if self.effect is None else self.effect.kind.where

    @property
    def place(self) -> str:
        """The input, output, port, parameter or cut that it acts at."""
        return "" if self.effect is None else self.effect.place


@dataclass(frozen=True)
class Delivered:
    """A corrected system that was written.

    Attributes:
        path: the SSP file.
        parts: its effect FMUs.
        difference: largest rms difference of an output between its run under our master and the fit, over the noise.
        note: why it could not be run, where it could not.
    """

    path: Path
    parts: tuple[Part, ...]
    difference: float
    note: str = ""

    def found(self) -> DeliveredFound:
        """Return what ``diagnose.json`` says of it.

        Returns:
            The corrected system.
        """
        parts = tuple(
            PartFound(p.name, "connection" if p.effect is None else p.effect.label, p.values) for p in self.parts
        )
        return DeliveredFound(self.path.name, parts, self.difference, self.note)


def _effect_fmu(folder: Path) -> Path:
    """Return the effect FMU, built in ``folder`` from the laws' own source, its modules named by their content.

    Raises:
        FmuError: the build fails.
    """
    sources = Path(pyfmu_sources.__file__).parent
    laws, slave = ((sources / f"{name}.py").read_text(encoding="utf-8") for name in ("port_laws", "attachment"))
    digest = hashlib.sha256((laws + slave).encode()).hexdigest()[:16]
    (folder / f"port_laws_{digest}.py").write_text(laws, encoding="utf-8")
    script = folder / f"attachment_{digest}.py"
    script.write_text(slave.replace("from .port_laws import", f"from port_laws_{digest} import"), encoding="utf-8")
    target = folder / "built"
    target.mkdir()
    run = subprocess.run(
        [sys.executable, "-c", BUILD, str(script), str(target), str(folder / f"port_laws_{digest}.py")],
        capture_output=True, text=True, check=False, cwd=folder,
    )  # fmt: skip
    found = sorted(target.glob("*.fmu"))
    if run.returncode != 0 or not found:
        lines = run.stderr.strip().splitlines() or ["no message"]
        raise FmuError(f"cannot build the effect FMU: {lines[-1]}")
    return found[0]


def parts_of(outcome: BoxOutcome) -> tuple[Part, ...]:
    """Return the effect FMUs of a corrected model.

    Args:
        outcome: of the diagnosis.

    Returns:
        The parts: what hands values from one FMU to another, then the effects in their order.

    Raises:
        FmuError: what an FMU hands on depends at once on several connections.
    """
    problem = outcome.problem
    found = []
    for k, c in enumerate(problem.runner.subject.connections):
        at_once = [t for t in problem.runner.through if t.wire == k]
        if len(at_once) > 1:
            raise FmuError(f"what {c.source} hands on must depend at once on one connection at most to be delivered")
        gain = sum(t.gain for t in at_once)
        values = {"series": SERIES.index("connection"), "q0": c.factor, "q1": c.offset, "q2": gain, "lead": 0.5}
        found.append(Part(f"connection_{k + 1}", None, values))
    for k, (effect, fitted) in enumerate(zip(outcome.model.effects, outcome.model.values, strict=True)):
        given: dict[str, float | int | bool] = {f"q{n}": float(v) for n, v in enumerate(fitted)}
        if effect.kind.where == PORT:
            given |= {"series": -1, "law": effect.kind.law, "sign": problem.sign.get(effect.place, 1.0), "lead": 0.5}
            given["has_velocity"] = problem.map.ports[effect.place].velocity is not None
        elif effect.kind.where == CUT:
            given |= {"series": -1, "law": effect.kind.law, "sign": problem.sign.get(effect.place, 1.0), "lead": 0.5}
        elif effect.kind.where == PARAMETER:
            given |= {"series": SERIES.index(effect.kind.name.partition("_")[2])}
            given |= {"q1": float(problem.starts(outcome.model)[effect.place]), "q2": float(problem.data.time[0])}
            if effect.signal:
                given["q2"] = problem.map.signals[effect.signal].reference
        else:
            given |= {"series": SERIES.index(effect.kind.name.partition("_")[2]), "law": 0, "at_rest": effect.at_rest}
            if effect.kind.name == "output_delay":
                given |= {"series": SERIES.index("late_reading"), "q1": float(problem.m)}
        found.append(Part(f"{effect.kind.name}_{k + 1}", effect, given))
    return tuple(found)


def deliver(path: Path, outcome: BoxOutcome) -> Delivered:
    """Write the corrected system as SSP 1.0, and compare its run with the fit.

    Args:
        path: the SSP file.
        outcome: of the diagnosis.

    Returns:
        What was written.

    Raises:
        FmuError: the effect FMU cannot be built.
    """
    parts = parts_of(outcome)
    subject = outcome.problem.runner.subject
    members = {f"resources/{fmu.name}": fmu.read_bytes() for fmu in subject.members.values()}
    attachment = ""
    if parts:
        with tempfile.TemporaryDirectory() as folder:
            built = _effect_fmu(Path(folder))
            attachment = f"AttachedEffect_{hashlib.sha256(built.read_bytes()).hexdigest()[:8]}.fmu"
            members[f"resources/{attachment}"] = built.read_bytes()
    for name in subject.members:
        members[f"resources/{name or PLANT}.ssv"] = _values(_given_to(name, outcome))
    for part in parts:
        members[f"resources/{part.name}.ssv"] = _values(part.values)
    members[STRUCTURE] = _structure(outcome, parts, attachment)
    write_archive(path, members)
    try:
        return Delivered(path, parts, difference(path, outcome))
    except OrchestratorError as error:
        return Delivered(path, parts, float("nan"), str(error))


def difference(path: Path, outcome: BoxOutcome, jacobi: bool = False) -> float:
    """Return the largest rms difference between a run of the system and the fit, over the noise.

    Args:
        path: the SSP file.
        outcome: of the diagnosis.
        jacobi: step all FMUs side by side.

    Returns:
        The difference, without unit.

    Raises:
        OrchestratorError: it does not run.
    """
    problem = outcome.problem
    fitted = problem.must_simulate(outcome.model)
    step = problem.step
    table = series_of(problem, problem.n)
    start = float(problem.data.time[0])
    signals = {_system(name, "in"): Samples(table[:, k], step, start) for k, name in enumerate(problem.inputs)}
    for name in _followed(parts_of(outcome)):
        at = list(problem.map.signals).index(name)
        values = problem.data.signals[:-1, at] + problem.map.signals[name].reference
        signals[_system(name, "in")] = Samples(np.repeat(values, problem.m), step, start)
    worst = 0.0
    with opened_ssp(path, signals, step, jacobi) as scenario:
        result = simulate(scenario, Safety())
    for k, name in enumerate(problem.outputs):
        last = [p.name for p in parts_of(outcome) if p.where == OUTPUT and p.place == name]
        signal = f"{last[-1]}.result" if last else ".".join(_at(outcome, name))
        y = result[signal][:: problem.m][: problem.n]
        rows = slice(problem.n // 20, None)
        rms = float(np.sqrt(np.mean((y[rows] - fitted[: len(y), k][rows]) ** 2)))
        worst = max(worst, rms / float(problem.noise[k]))
    return worst


def _given_to(member: str, outcome: BoxOutcome) -> dict[str, Value]:
    """Return start values of one of the FMUs, by its own names."""
    problem = outcome.problem
    placed = {owned(n, problem.runner.subject.members): v for n, v in problem.starts(outcome.model).items()}
    return {variable: value for (name, variable), value in placed.items() if name == member}


def _at(outcome: BoxOutcome, variable: str) -> tuple[str, str]:
    """Return component and connector of a variable of an FMU."""
    member, name = owned(variable, outcome.problem.runner.subject.members)
    return member or PLANT, name


def _values(values: Mapping[str, Value]) -> bytes:
    spaces = {key: SPACES[key] for key in ("ssv", "ssc")}
    root = etree.Element(tag("ssv", "ParameterSet"), nsmap=spaces, version="1.0", name="initialValues")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    for name, value in values.items():
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=name)
        kind = next(name for name, of in _KINDS.items() if isinstance(value, of))
        text = str(value).lower() if isinstance(value, bool) else value if isinstance(value, str) else repr(value)
        etree.SubElement(parameter, tag("ssv", kind), value=text)
    require_valid(root, "ssv", "values")
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _system(name: str, way: str) -> str:
    """Return what a signal is called at the border of the system."""
    return f"{name.replace('.', '_')}_{way}"


def _followed(parts: tuple[Part, ...]) -> list[str]:
    """Return the signals that parameters depend on."""
    return list(dict.fromkeys(p.effect.signal for p in parts if p.effect is not None and p.effect.signal))


def _turn(part: Part) -> int:
    """Return when a part before an FMU has its turn within a step: a signal passes all of them in one step.

    What depends at once on what was fed looks at that before it changes.
    """
    at_once = part.effect is None and bool(part.values["q2"])
    return -1 if at_once else (PARAMETER, INPUT, "", CUT, PORT).index(part.where)


def _structure(outcome: BoxOutcome, parts: tuple[Part, ...], attachment: str) -> bytes:
    problem, members = outcome.problem, outcome.problem.runner.subject.members
    spaces = {key: SPACES[key] for key in ("ssd", "ssc", "ssv", "osp", "oms")}
    root = etree.Element(tag("ssd", "SystemStructureDescription"), nsmap=spaces, version="1.0", name="corrected")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    connectors = etree.SubElement(system, tag("ssd", "Connectors"))
    for name in (*problem.inputs, *_followed(parts)):
        _connector(connectors, _system(name, "in"), "input")
    for name in problem.outputs:
        _connector(connectors, _system(name, "out"), "output")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    ahead = sorted((p for p in parts if p.where != OUTPUT), key=_turn)
    behind = [p for p in parts if p.where == OUTPUT]
    wired = _wires(outcome, parts)
    for part in ahead:
        taken = [connector for _, (name, connector) in wired if name == part.name]
        _component(elements, part.name, attachment, {"input": taken, "output": ["result"]})
    for name, fmu in members.items():
        mine = {"input": [], "parameter": [], "output": []}  # type: dict[str, list[str]]
        ends = dict.fromkeys([end for _, end in wired] + [_at(outcome, v) for v in problem.runner.reads])
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


def _wires(outcome: BoxOutcome, parts: tuple[Part, ...]) -> list[Joined]:
    """Return the connections; an empty element is the system itself."""
    problem = outcome.problem
    found: list[Joined] = []
    handed = dict(zip([c.target for c in problem.runner.subject.connections], parts, strict=False))
    ports = [problem.map.ports[p.place].input for p in parts if p.where == PORT]
    for name in dict.fromkeys([*problem.inputs, *ports, *handed]):
        at: tuple[str, str] | None = ("", _system(name, "in")) if name in problem.inputs else None
        series = [p for p in parts if p.where == INPUT and p.place == name]
        cuts = [p for p in parts if p.where == CUT and problem.map.cuts[p.place].input == name]
        feedback = [p for p in parts if p.where == PORT and problem.map.ports[p.place].input == name]
        for part in (*series, *([handed[name]] if name in handed else []), *cuts, *feedback):
            if at is not None:
                found.append((at, (part.name, "signal")))
            at = (part.name, "result")
        assert at is not None
        found.append((at, _at(outcome, name)))
    for connected, part in zip(problem.runner.subject.connections, parts, strict=False):
        found.append((_at(outcome, connected.source), (part.name, "signal")))
    for t in problem.runner.through:
        target = _at(outcome, problem.runner.subject.connections[t.by].target)
        fed = next(start for start, end in found if end == target)
        found.append((fed, (parts[t.wire].name, "position")))
    for part in parts:
        found += _read(outcome, part)
    for name in problem.outputs:
        at = _at(outcome, name)
        for part in parts:
            if part.where == OUTPUT and part.place == name:
                found.append((at, (part.name, "signal")))
                at = (part.name, "result")
        found.append((at, ("", _system(name, "out"))))
    return found


def _read(outcome: BoxOutcome, part: Part) -> list[Joined]:
    """Return what an effect reads beside the signal that it stands in, and the parameter that it sets."""
    found: list[Joined] = []
    if part.effect is None:
        return found
    if part.where == PORT:
        port = outcome.problem.map.ports[part.place]
        found.append((_at(outcome, port.position), (part.name, "position")))
        if port.velocity is not None:
            found.append((_at(outcome, port.velocity), (part.name, "velocity")))
    elif part.where == CUT:
        found.append((_at(outcome, outcome.problem.beyond(part.effect)), (part.name, "position")))
    elif part.where == PARAMETER:
        found.append(((part.name, "result"), _at(outcome, part.place)))
        if part.effect.signal:
            found.append((("", _system(part.effect.signal, "in")), (part.name, "signal")))
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
