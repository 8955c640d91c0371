"""One adapter per tool: set the job up, then return a call that runs it once from start to stop.

What is timed is the run of an initialised system; loading, and for others initialisation, is not. Ours resets,
initialises and records two signals within the time; the others record nothing.
"""

import importlib.metadata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.bench.job import Job

Prepare = Callable[[Job], Callable[[], None]]


@dataclass(frozen=True)
class Tool:
    """A way to run a job.

    Attributes:
        title: for the table.
        package: to be installed; empty for what is always there.
        prepare: sets up; the call that it returns is good for one run.
        again: the call may be repeated.
        scheme: order of execution.
    """

    title: str
    package: str
    prepare: Prepare
    again: bool
    scheme: str

    @property
    def version(self) -> str | None:
        """Version of the package, ``None`` when it is not installed."""
        if not self.package:
            return ""
        try:
            return importlib.metadata.version(self.package)
        except importlib.metadata.PackageNotFoundError:
            return None


def _ours(job: Job, compiled: bool) -> Callable[[], None]:
    from orchestrator.fmi.slave import fmu_instance
    from orchestrator.master import session as session_module
    from orchestrator.master.algorithms import GaussSeidel
    from orchestrator.master.system import Connection, System

    session_module.COMPILED_FROM = 0
    starts: dict[str, dict[str, Any]] = {name: {} for name in job.fmus}
    for name, variable, _, value in job.starts:
        starts[name][variable] = value
    instances = tuple(fmu_instance(name, Path(path), starts[name]) for name, path in job.fmus.items())
    connections = tuple(Connection(f"{a}.{b}", f"{c}.{d}") for a, b, c, d in job.connections)
    record = list(dict.fromkeys(f"{a}.{b}" for a, b, _, _ in job.connections))[:2]
    algorithm = GaussSeidel(job.step, compiled=compiled)
    session = session_module.Session(System(instances, connections), record, algorithm, job.step * job.steps)
    session.run()

    def run() -> None:
        session.run()

    return run


def ours_compiled(job: Job) -> Callable[[], None]:
    """This master with its loop in machine code."""
    return _ours(job, compiled=True)


def ours_interpreted(job: Job) -> Callable[[], None]:
    """This master with its loop in Python."""
    return _ours(job, compiled=False)


def _fmpy_slaves(job: Job) -> dict[str, Any]:
    import fmpy
    from fmpy.fmi2 import FMU2Slave

    slaves: dict[str, Any] = {}
    for name, path in job.fmus.items():
        description = fmpy.read_model_description(path)
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        slave.instantiate()
        slaves[name] = slave
    for name, variable, kind, value in job.starts:
        getattr(slaves[name], f"set{kind}")([job.references[name][variable]], [value])
    for slave in slaves.values():
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
    return slaves


def fmpy_per_variable(job: Job) -> Callable[[], None]:
    """FMPy, one call per variable, instances in execution order."""
    slaves, r = _fmpy_slaves(job), job.references
    inputs = {name: [(slaves[a], r[a][b], r[c][d]) for a, b, c, d in job.connections if c == name] for name in slaves}

    def run() -> None:
        for n in range(job.steps):
            for name, slave in slaves.items():
                for source, output, entry in inputs[name]:
                    slave.setReal([entry], source.getReal([output]))
                slave.doStep(n * job.step, job.step)

    return run


def fmpy_batched(job: Job) -> Callable[[], None]:
    """FMPy, one batched get and set per FMU and step, instances in execution order."""
    slaves, r = _fmpy_slaves(job), job.references
    outputs = {n: list(dict.fromkeys(b for a, b, _, _ in job.connections if a == n)) for n in slaves}
    inputs = {n: [(a, b, d) for a, b, c, d in job.connections if c == n] for n in slaves}
    values: dict[str, dict[str, float]] = {}
    plan = []
    for name, slave in slaves.items():
        read = [r[name][v] for v in outputs[name]]
        values[name] = dict(zip(outputs[name], slave.getReal(read), strict=True))
        plan.append((name, slave, inputs[name], [r[name][d] for _, _, d in inputs[name]], outputs[name], read))

    def run() -> None:
        for n in range(job.steps):
            for name, slave, sources, write, names, read in plan:
                slave.setReal(write, [values[a][b] for a, b, _ in sources])
                slave.doStep(n * job.step, job.step)
                values[name] = dict(zip(names, slave.getReal(read), strict=True))

    return run


def ecos(job: Job) -> Callable[[], None]:
    """ecos, fixed step, side by side."""
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

    return run


def libcosim(job: Job) -> Callable[[], None]:
    """libcosim, fixed step, side by side."""
    from libcosimpy.CosimExecution import CosimExecution
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
    execution.step(step_count=1)

    def run() -> None:
        execution.step(step_count=job.steps - 1)

    return run


def pyfmi(job: Job) -> Callable[[], None]:
    """PyFMI's master, fixed step."""
    from pyfmi import load_fmu
    from pyfmi.master import Master

    models = {name: load_fmu(path) for name, path in job.fmus.items()}
    for name, variable, _, value in job.starts:
        models[name].set(variable, value)
    connections = [(models[a], b, models[c], d) for a, b, c, d in job.connections]
    master = Master(list(models.values()), connections)
    options = master.simulate_options()
    options["step_size"] = job.step

    def run() -> None:
        master.simulate(start_time=0.0, final_time=job.step * job.steps, options=options)

    return run


def omsimulator(job: Job) -> Callable[[], None]:
    """OMSimulator, weakly coupled system, fixed step."""
    from OMSimulator import OMSimulator

    oms = OMSimulator()
    oms.newModel("bench")
    oms.addSystem("bench.root", oms.system_wc)
    for name, path in job.fmus.items():
        oms.addSubModel(f"bench.root.{name}", path)
    for name, variable, kind, value in job.starts:
        getattr(oms, f"set{kind}")(f"bench.root.{name}.{variable}", value)
    for a, b, c, d in job.connections:
        oms.addConnection(f"bench.root.{a}.{b}", f"bench.root.{c}.{d}")
    oms.setFixedStepSize("bench.root", job.step)
    oms.setStopTime("bench", job.step * job.steps)
    oms.setResultFile("bench", "")
    oms.instantiate("bench")
    oms.initialize("bench")

    def run() -> None:
        oms.simulate("bench")

    return run


def slaves_directly(job: Job) -> Callable[[], None]:
    """The slaves' own Python, called without any FMI: values in lists, one set, one step, one get per slave."""
    slaves, r = _python_slaves(job), job.references
    outputs = {n: list(dict.fromkeys(b for a, b, _, _ in job.connections if a == n)) for n in slaves}
    place = {(n, v): k for n, names in outputs.items() for k, v in enumerate(names)}
    values = {n: slaves[n].get_real([r[n][v] for v in outputs[n]]) for n in slaves}
    plan = []
    for name, slave in slaves.items():
        sources = [(a, place[a, b]) for a, b, c, _ in job.connections if c == name]
        write = [r[name][d] for _, _, c, d in job.connections if c == name]
        plan.append((name, slave, sources, write, [r[name][v] for v in outputs[name]]))
    clock = [0]

    def run() -> None:
        first = clock[0]
        for n in range(first, first + job.steps):
            for name, slave, sources, write, read in plan:
                slave.set_real(write, [values[a][k] for a, k in sources])
                slave.do_step(n * job.step, job.step)
                values[name] = slave.get_real(read)
        clock[0] += job.steps

    return run


def _python_slaves(job: Job) -> dict[str, Any]:
    from pyfmu_sources.drivetrain_slave import Drivetrain
    from pyfmu_sources.kalman_slave import KalmanEstimator
    from pyfmu_sources.lqr_slave import LqrController

    kinds = {k.__name__: k for k in (Drivetrain, KalmanEstimator, LqrController)}
    slaves: dict[str, Any] = {n: kinds[Path(path).stem](instance_name=n) for n, path in job.fmus.items()}
    for name, variable, kind, value in job.starts:
        getattr(slaves[name], f"set_{kind.lower()}")([job.references[name][variable]], [value])
    for slave in slaves.values():
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
    return slaves


TOOLS: dict[str, Tool] = {
    "ours": Tool("this master, compiled loop", "", ours_compiled, True, "Gauss-Seidel"),
    "ours_interpreted": Tool("this master, Python loop", "", ours_interpreted, True, "Gauss-Seidel"),
    "floor": Tool("floor: the slaves' Python without FMI", "", slaves_directly, True, "Gauss-Seidel"),
    "fmpy_batched": Tool("FMPy, one get and set per FMU", "FMPy", fmpy_batched, False, "Gauss-Seidel"),
    "fmpy": Tool("FMPy, one call per variable", "FMPy", fmpy_per_variable, False, "Gauss-Seidel"),
    "ecos": Tool("ecos", "ecospy", ecos, False, "Jacobi"),
    "libcosim": Tool("libcosim", "libcosimpy", libcosim, False, "Jacobi"),
    "pyfmi": Tool("PyFMI", "PyFMI", pyfmi, False, "Jacobi"),
    "omsimulator": Tool("OMSimulator", "OMSimulator", omsimulator, False, "Gauss-Seidel"),
}
