"""Adapters of other masters. Each brings its own quirks; ``docs/performance.md`` says how to install them."""

import contextlib
import csv
import io
import itertools
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.masters.job import BenchJob
from benchmarks.masters.tool import Prepared

_MODELS = itertools.count()


def ecos(job: BenchJob) -> Prepared:
    """ecos, fixed step, side by side. Return the run and the watched ends."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    for name, path in job.fmus.items():
        structure.add_model(name, path)
    for a, b, c, d in job.connections:
        structure.make_real_connection(f"{a}::{b}", f"{c}::{d}")
    # ecos has no enumerations: they keep their default.
    reals = {f"{name}::{variable}": value for name, variable, kind, value in job.starts if kind == "Real"}
    structure.add_parameter_set("start", reals)
    simulation = EcosSimulation(structure=structure, step_size=job.step)
    simulation.init(parameter_set="start")

    def run() -> None:
        simulation.step(job.steps)

    return Prepared(run, lambda: {f"{a}.{b}": simulation.get_real(f"{a}::{b}") for a, b in job.watched})


def libcosim(job: BenchJob) -> Prepared:
    """libcosim, fixed step, side by side. Return the run and the watched ends."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(step_size=round(job.step * 1e9))
    index = {}
    for name, path in job.fmus.items():
        index[name] = execution.add_local_slave(CosimLocalSlave(fmu_path=path, instance_name=name))
    r = job.references
    for a, b, c, d in job.connections:
        execution.connect_real_variables(index[a], r[a][b], index[c], r[c][d])
    for name, variable, kind, value in job.starts:
        getattr(execution, f"{kind.lower()}_initial_value")(index[name], r[name][variable], value)
    observer = CosimObserver.create_last_value()
    execution.step(step_count=1)  # also initialises

    def run() -> None:
        execution.step(step_count=job.steps - 2)

    def ends() -> dict[str, float]:
        # The observer would cost time in every step; it is added for the last one.
        execution.add_observer(observer)
        execution.step(step_count=1)
        return {f"{a}.{b}": observer.last_real_values(index[a], [r[a][b]])[0] for a, b in job.watched}

    return Prepared(run, ends)


def pyfmi(job: BenchJob) -> Prepared:
    """PyFMI's master, fixed step, without its linear correction and without results.

    Returns:
        The run and the watched ends.
    """
    from pyfmi import load_fmu
    from pyfmi.master import Master

    os.chdir(tempfile.mkdtemp(prefix="pyfmi-"))  # it writes its logs there
    models = {name: load_fmu(path, log_level=0) for name, path in job.fmus.items()}
    for name, variable, _, value in job.starts:
        models[name].set(variable, value)
    connections = [(models[a], b, models[c], d) for a, b, c, d in job.connections]
    master = Master(list(models.values()), connections)
    options = master.simulate_options()
    wanted: dict[str, object] = {"step_size": job.step, "extrapolation_order": 0, "error_controlled": False}
    wanted |= {"linear_correction": False, "block_initialization": True, "result_handling": None}
    for key, value in wanted.items():
        options[key] = value

    def run() -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            master.simulate(start_time=0.0, final_time=job.step * job.steps, options=options)

    return Prepared(run, lambda: {f"{a}.{b}": float(models[a].get(b)[0]) for a, b in job.watched})


def omsimulator(job: BenchJob) -> Prepared:
    """OMSimulator, weakly coupled system, fixed step, recording what is watched.

    Returns:
        The run and the watched ends.
    """
    return _omsimulator(job, everything=False)


def omsimulator_as_it_comes(job: BenchJob) -> Prepared:
    """The same with all signals in a result file, which is its default."""
    return _omsimulator(job, everything=True)


def _omsimulator(job: BenchJob, everything: bool) -> Prepared:
    from OMSimulator.capi import Capi, Status
    from OMSimulator.instantiated_model import SolverType, SystemType

    def do(status: Status) -> None:
        if status not in {Status.ok, Status.warning}:
            raise RuntimeError(f"OMSimulator: {status}")

    do(Capi.setCommandLineOption("--suppressPath=true"))
    do(Capi.setTempDirectory(tempfile.mkdtemp(prefix="oms-")))
    model = f"bench{next(_MODELS)}"
    do(Capi.newModel(model))
    do(Capi.addSystem(f"{model}.root", SystemType.wc.value))
    do(Capi.setSolver(f"{model}.root", SolverType.oms_ma.value))
    do(Capi.setFixedStepSize(f"{model}.root", job.step))
    for name, path in job.fmus.items():
        do(Capi.addSubModel(f"{model}.root.{name}", path))
    for a, b, c, d in job.connections:
        do(Capi.addConnection(f"{model}.root.{a}.{b}", f"{model}.root.{c}.{d}"))
    for name, variable, kind, value in job.starts:
        do(getattr(Capi, f"set{kind}")(f"{model}.root.{name}.{variable}", value))
    do(Capi.instantiate(model))
    do(Capi.setStartTime(model, 0.0))
    do(Capi.setStopTime(model, job.step * job.steps))
    do(Capi.setResultFile(model, str(Path(tempfile.mkdtemp(prefix="oms-")) / "result.mat")))
    if not everything:
        do(Capi.removeSignalsFromResults(model, ".*"))
        for a, b in job.watched:
            do(Capi.addSignalsToResults(model, rf".*\.{a}\.{b}"))
    do(Capi.initialize(model))

    def run() -> None:
        do(Capi.simulate(model))

    def ends() -> dict[str, float]:
        found = {}
        for a, b in job.watched:
            value, status = Capi.getReal(f"{model}.root.{a}.{b}")
            do(status)
            found[f"{a}.{b}"] = value
        return found

    return Prepared(run, ends)


def cofmupy(job: BenchJob) -> Prepared:
    """cofmupy's coordinator, Gauss-Seidel without iteration. Return the run and the watched ends."""
    from cofmupy import Coordinator
    from cofmupy.wrappers import Fmu2Handler

    def real_outputs(handler: Any) -> list[str]:
        variables = handler.description.modelVariables
        return [v.name for v in variables if v.causality == "output" and v.type == "Real"]

    # Version 1.0.0 reads every output as a Real in every step, and so fails at the plant's Integer output.
    Fmu2Handler.get_output_names = real_outputs

    def end(instance: str, variable: str) -> dict[str, str]:
        return {"id": instance, "variable": variable, "unit": "", "type": "fmu"}

    fmus = []
    for name, path in job.fmus.items():
        # It sets Reals only: others keep their default.
        start = {v: value for n, v, kind, value in job.starts if n == name and kind == "Real"}
        fmus.append({"id": name, "name": name, "path": path, "initialization": start})
    links = [{"source": end(a, b), "target": end(c, d)} for a, b, c, d in job.connections]
    coordinator = Coordinator()
    with contextlib.redirect_stdout(io.StringIO()):
        setup = {"fmus": fmus, "connections": links, "cosim_method": "gauss_seidel", "iterative": False}
        coordinator.start(setup)
    # It starts with all inputs at zero, and lists a loop's FMUs in an order that changes from process to process.
    for a, b, c, d in job.connections:
        coordinator.master.set_inputs({c: {d: coordinator.get_variable((a, b))}})
    place = {name: k for k, name in enumerate(job.fmus)}
    for loop in coordinator.master.sequence_order:
        loop.sort(key=place.__getitem__)

    def run() -> None:
        for _ in range(job.steps):
            coordinator.do_step(job.step)

    return Prepared(run, lambda: {f"{a}.{b}": coordinator.get_variable((a, b))[0] for a, b in job.watched})


def mastersim(job: BenchJob) -> Prepared:
    """MasterSim's program in Gauss-Seidel mode; its own clock, without the time for writing results.

    Returns:
        The run and the watched ends.
    """
    program = shutil.which("mastersim")
    assert program is not None
    folder = Path(tempfile.mkdtemp(prefix="mastersim-"))
    stop = job.step * job.steps
    lines = [
        *("tStart 0 s", f"tEnd {stop!r} s", f"hMax {job.step!r} s", "hMin 1e-06 s", "hFallBackLimit 0.0001 s"),
        *(f"hStart {job.step!r} s", f"hOutputMin {job.step!r} s", "adjustStepSize no"),
        *("preventOversteppingOfEndTime no", "absTol 1e-06", "relTol 1e-05", "MasterMode GAUSS_SEIDEL"),
        *("ErrorControlMode NONE", "maxIterations 1", "writeInternalVariables no"),
    ]
    for n, (name, path) in enumerate(job.fmus.items()):
        shutil.copy(path, folder)
        lines.append(f'simulator {n} {n} {name} #ff0000ff "{Path(path).name}"')
    lines += [f"graph {a}.{b} {c}.{d}" for a, b, c, d in job.connections]
    # Its files have no word for enumerations: they keep their default.
    lines += [f"parameter {name}.{variable} {value!r}" for name, variable, kind, value in job.starts if kind == "Real"]
    (folder / "bench.msim").write_text("\n".join(lines) + "\n", encoding="utf-8")

    def run() -> float:
        words = [program, "--verbosity-level=0", "bench.msim"]
        subprocess.run(words, cwd=folder, capture_output=True, check=True)
        summary = (folder / "bench" / "log" / "summary.txt").read_text(encoding="utf-8")
        times = dict(line.split("=") for line in summary.splitlines() if "=" in line)
        return float(times["MasterAlgorithmTime"])

    def ends() -> dict[str, float]:
        with (folder / "bench" / "results" / "values.csv").open(encoding="utf-8") as stream:
            rows = list(csv.reader(stream, delimiter="\t"))
        names = [word.split(" ")[0] for word in rows[0]]
        last = min(rows[1:], key=lambda row: abs(float(row[0]) - stop))
        return {f"{a}.{b}": float(last[names.index(f"{a}.{b}")]) for a, b in job.watched}

    return Prepared(run, ends)
