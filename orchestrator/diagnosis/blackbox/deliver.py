"""The corrected system as an SSP: the original FMU untouched, effect FMUs wired around it, and their values."""

import hashlib
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

import pyfmu_sources
from orchestrator.building.archive import write_archive
from orchestrator.diagnosis.blackbox.bank import INPUT, OUTPUT, PORT, BoxEffect
from orchestrator.diagnosis.blackbox.diagnose import BoxOutcome
from orchestrator.diagnosis.blackbox.problem import series_of
from orchestrator.errors import FmuError, OrchestratorError
from orchestrator.master.signals import Samples
from orchestrator.scenarios.isolated import Safety
from orchestrator.scenarios.scenario import simulate
from orchestrator.scenarios.ssp.common import OSP, SPACES, STRUCTURE, require_valid, tag
from orchestrator.scenarios.ssp.read import opened_ssp
from pyfmu_sources.attachment import SERIES

DATE = "2026-01-01T00:00:00Z"
PLANT = "plant"
BUILD = (
    "import sys; from pythonfmu import FmuBuilder; "
    "FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2], project_files=sys.argv[3:])"
)


@dataclass(frozen=True)
class Part:
    """One effect FMU of the system: its name, the effect, and the values it is given."""

    name: str
    effect: BoxEffect
    values: dict[str, float | int | bool]


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

    def as_json(self) -> dict[str, Any]:
        """Return what ``diagnose.json`` says of it.

        Returns:
            Plain data.
        """
        parts = [{"name": p.name, "effect": p.effect.label, "values": p.values} for p in self.parts]
        return {"file": self.path.name, "parts": parts, "difference_over_noise": self.difference, "note": self.note}


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
        The parts, in the order of the effects.
    """
    problem = outcome.problem
    found = []
    for k, (effect, values) in enumerate(zip(outcome.model.effects, outcome.model.values, strict=True)):
        given: dict[str, float | int | bool] = {f"q{n}": float(v) for n, v in enumerate(values)}
        if effect.kind.where == PORT:
            given |= {"series": -1, "law": effect.kind.law, "sign": problem.sign.get(effect.place, 1.0), "lead": 0.5}
            given["has_velocity"] = problem.map.ports[effect.place].velocity is not None
        else:
            given |= {"series": SERIES.index(effect.kind.name.partition("_")[2]), "law": 0, "at_rest": effect.at_rest}
        found.append(Part(f"{effect.kind.name}_{k + 1}", effect, given))
    return tuple(found)


def deliver(path: Path, fmu: Path, outcome: BoxOutcome) -> Delivered:
    """Write the corrected system as SSP 1.0, and compare its run with the fit.

    Args:
        path: the SSP file.
        fmu: the original.
        outcome: of the diagnosis.

    Returns:
        What was written.

    Raises:
        FmuError: the effect FMU cannot be built.
    """
    parts = parts_of(outcome)
    members = {f"resources/{fmu.name}": fmu.read_bytes()}
    attachment = ""
    if parts:
        with tempfile.TemporaryDirectory() as folder:
            built = _effect_fmu(Path(folder))
            attachment = f"AttachedEffect_{hashlib.sha256(built.read_bytes()).hexdigest()[:8]}.fmu"
            members[f"resources/{attachment}"] = built.read_bytes()
    members[f"resources/{PLANT}.ssv"] = _values(_plant_values(outcome))
    for part in parts:
        members[f"resources/{part.name}.ssv"] = _values(part.values)
    members[STRUCTURE] = _structure(outcome, parts, fmu.name, attachment)
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
    step = problem.h / problem.m
    table = series_of(problem, problem.n)
    start = float(problem.data.time[0])
    signals = {f"{name}_in": Samples(table[:, k], step, start) for k, name in enumerate(problem.inputs)}
    worst = 0.0
    with opened_ssp(path, signals, step, jacobi) as scenario:
        result = simulate(scenario, Safety())
    for k, name in enumerate(problem.outputs):
        last = [p.name for p in parts_of(outcome) if p.effect.kind.where == OUTPUT and p.effect.place == name]
        signal = f"{last[-1]}.result" if last else f"{PLANT}.{name}"
        y = result[signal][:: problem.m][: problem.n]
        rows = slice(problem.n // 20, None)
        rms = float(np.sqrt(np.mean((y[rows] - fitted[: len(y), k][rows]) ** 2)))
        worst = max(worst, rms / float(problem.noise[k]))
    return worst


def _plant_values(outcome: BoxOutcome) -> dict[str, float | int | bool]:
    problem = outcome.problem
    values: dict[str, float | int | bool] = dict(problem.map.fixed)
    values |= {u.name: float(v) for u, v in zip(problem.map.uncertain, outcome.model.p, strict=True)}
    return values


def _values(values: dict[str, float | int | bool]) -> bytes:
    spaces = {key: SPACES[key] for key in ("ssv", "ssc")}
    root = etree.Element(tag("ssv", "ParameterSet"), nsmap=spaces, version="1.0", name="initialValues")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    for name, value in values.items():
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=name)
        kind = "Boolean" if isinstance(value, bool) else "Integer" if isinstance(value, int) else "Real"
        etree.SubElement(
            parameter, tag("ssv", kind), value=str(value).lower() if isinstance(value, bool) else repr(value)
        )
    require_valid(root, "ssv", "values")
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _structure(outcome: BoxOutcome, parts: tuple[Part, ...], fmu: str, attachment: str) -> bytes:
    problem = outcome.problem
    spaces = {key: SPACES[key] for key in ("ssd", "ssc", "ssv", "osp")}
    root = etree.Element(tag("ssd", "SystemStructureDescription"), nsmap=spaces, version="1.0", name="corrected")
    root.set("generationTool", "backlash-cosim")
    root.set("generationDateAndTime", DATE)
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    connectors = etree.SubElement(system, tag("ssd", "Connectors"))
    for name in problem.inputs:
        _connector(connectors, f"{name}_in", "input")
    for name in problem.outputs:
        _connector(connectors, f"{name}_out", "output")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    # Effects before the FMU: where a master runs one after the other, they come first within a step.
    ahead = [p for p in parts if p.effect.kind.where != OUTPUT]
    behind = [p for p in parts if p.effect.kind.where == OUTPUT]
    for part in ahead:
        _component(
            elements,
            part.name,
            attachment,
            ["signal", "position", "velocity"] if _fed(part) else ["signal"],
            ["result"],
        )
    fed = list(dict.fromkeys([*problem.inputs, *(problem.map.ports[p.effect.place].input for p in ahead if _fed(p))]))
    _component(elements, PLANT, fmu, fed, list(problem.runner.reads))
    for part in behind:
        _component(elements, part.name, attachment, ["signal"], ["result"])
    wires = etree.SubElement(system, tag("ssd", "Connections"))
    for start, end in _wires(outcome, parts, fed):
        given = (
            dict(zip(("startElement", "startConnector"), start, strict=True))
            if start[0]
            else {"startConnector": start[1]}
        )
        given |= dict(zip(("endElement", "endConnector"), end, strict=True)) if end[0] else {"endConnector": end[1]}
        etree.SubElement(wires, tag("ssd", "Connection"), given)
    times = {"startTime": repr(float(problem.data.time[0])), "stopTime": repr(float(problem.data.time[-1]))}
    experiment = etree.SubElement(root, tag("ssd", "DefaultExperiment"), times)
    annotations = etree.SubElement(experiment, tag("ssd", "Annotations"))
    algorithm = etree.SubElement(
        etree.SubElement(annotations, tag("ssc", "Annotation"), type=OSP), tag("osp", "Algorithm")
    )
    etree.SubElement(algorithm, tag("osp", "FixedStepAlgorithm"), baseStepSize=repr(problem.h / problem.m))
    require_valid(root, "ssd", STRUCTURE)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _fed(part: Part) -> bool:
    return part.effect.kind.where == PORT


def _wires(
    outcome: BoxOutcome, parts: tuple[Part, ...], fed: list[str]
) -> list[tuple[tuple[str, str], tuple[str, str]]]:
    """Return the connections; an empty element is the system itself."""
    problem = outcome.problem
    found = []
    for name in fed:
        at: tuple[str, str] | None = ("", f"{name}_in") if name in problem.inputs else None
        series = [p for p in parts if p.effect.kind.where == INPUT and p.effect.place == name]
        feedback = [p for p in parts if _fed(p) and problem.map.ports[p.effect.place].input == name]
        for part in (*series, *feedback):
            if at is not None:
                found.append((at, (part.name, "signal")))
            at = (part.name, "result")
        assert at is not None
        found.append((at, (PLANT, name)))
    for part in parts:
        if _fed(part):
            port = problem.map.ports[part.effect.place]
            found.append(((PLANT, port.position), (part.name, "position")))
            if port.velocity is not None:
                found.append(((PLANT, port.velocity), (part.name, "velocity")))
    for name in problem.outputs:
        at = (PLANT, name)
        for part in parts:
            if part.effect.kind.where == OUTPUT and part.effect.place == name:
                found.append((at, (part.name, "signal")))
                at = (part.name, "result")
        found.append((at, ("", f"{name}_out")))
    return found


def _component(parent: etree._Element, name: str, source: str, inputs: list[str], outputs: list[str]) -> None:
    given = {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{source}"}
    component = etree.SubElement(parent, tag("ssd", "Component"), given | {"implementation": "CoSimulation"})
    connectors = etree.SubElement(component, tag("ssd", "Connectors"))
    for kind, names in (("input", inputs), ("output", outputs)):
        for variable in names:
            _connector(connectors, variable, kind)
    bindings = etree.SubElement(component, tag("ssd", "ParameterBindings"))
    binding = {"type": "application/x-ssp-parameter-set", "source": f"resources/{name}.ssv"}
    etree.SubElement(bindings, tag("ssd", "ParameterBinding"), binding)


def _connector(parent: etree._Element, name: str, kind: str) -> None:
    connector = etree.SubElement(parent, tag("ssd", "Connector"), name=name, kind=kind)
    etree.SubElement(connector, tag("ssc", "Real"))
