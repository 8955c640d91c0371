"""All tools, and the adapters of this master and of its floor.

What is timed is the run of an initialised system; loading, and for others initialisation, is not. Ours resets,
initialises and records two signals within the time; the others record as little as they allow.
"""

from pathlib import Path
from typing import Any

from benchmarks.masters import others, with_fmpy
from benchmarks.masters.job import BenchJob
from benchmarks.masters.tool import GAUSS_SEIDEL, JACOBI, JACOBI_READ_AGAIN, Prepared, Tool


def _ours(job: BenchJob, compiled: bool) -> Prepared:
    from orchestrator.fmi.instances import fmu_instance
    from orchestrator.master import session as session_module
    from orchestrator.master.algorithms import GaussSeidel
    from orchestrator.master.result import Recording
    from orchestrator.master.system import Connection, System

    session_module.COMPILED_FROM = 0
    starts: dict[str, dict[str, Any]] = {name: {} for name in job.fmus}
    for name, variable, _, value in job.starts:
        starts[name][variable] = value
    instances = tuple(fmu_instance(name, Path(path), starts[name]) for name, path in job.fmus.items())
    connections = tuple(Connection(f"{a}.{b}", f"{c}.{d}") for a, b, c, d in job.connections)
    record = [f"{a}.{b}" for a, b in job.watched]
    algorithm = GaussSeidel(job.step, compiled=compiled)
    session = session_module.Session(System(instances, connections), record, algorithm, job.step * job.steps)
    session.run()
    results: list[Recording] = []

    def run() -> None:
        results[:] = [session.run()]

    return Prepared(run, lambda: {name: float(results[0][name][-1]) for name in record})


def _ours_compiled(job: BenchJob) -> Prepared:
    """This master with its loop in machine code."""
    return _ours(job, compiled=True)


def ours_interpreted(job: BenchJob) -> Prepared:
    """This master with its loop in Python. Return the run and the watched ends."""
    return _ours(job, compiled=False)


def _slaves_directly(job: BenchJob) -> Prepared:
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

    def run() -> None:
        for n in range(job.steps):
            for name, slave, sources, write, read in plan:
                slave.set_real(write, [values[a][k] for a, k in sources])
                slave.do_step(n * job.step, job.step)
                values[name] = slave.get_real(read)

    return Prepared(run, lambda: {f"{a}.{b}": slaves[a].get_real([r[a][b]])[0] for a, b in job.watched})


def _python_slaves(job: BenchJob) -> dict[str, Any]:
    from pyfmu_sources.controllers.lqr_slave import LqrController
    from pyfmu_sources.drivetrain.drivetrain_slave import Drivetrain
    from pyfmu_sources.estimators.kalman_slave import KalmanEstimator

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
    "ours": Tool("this master, compiled loop", "", _ours_compiled, True, GAUSS_SEIDEL, fmi3=True),
    "ours_interpreted": Tool("this master, Python loop", "", ours_interpreted, True, GAUSS_SEIDEL, fmi3=True),
    "floor": Tool("floor: the slaves' Python without FMI", "", _slaves_directly, False, GAUSS_SEIDEL),
    "fmpy_batched": Tool("FMPy, one get and set per FMU", "fmpy", with_fmpy.batched, False, GAUSS_SEIDEL, fmi3=True),
    "fmpy": Tool("FMPy, one call per variable", "fmpy", with_fmpy.per_variable, False, GAUSS_SEIDEL, fmi3=True),
    "ecos": Tool("ecos", "ecospy", others.ecos, False, JACOBI_READ_AGAIN),
    "libcosim": Tool("libcosim", "libcosimpy", others.libcosim, False, JACOBI),
    "pyfmi": Tool("PyFMI", "pyfmi", others.pyfmi, False, JACOBI),
    # Steps side by side, then passes values on in the order of the declared dependencies: the same trajectories.
    "omsimulator": Tool("OMSimulator, two signals", "OMSimulator", others.omsimulator, False, GAUSS_SEIDEL),
    "omsimulator_all": Tool(
        "OMSimulator, all signals (its default)",
        "OMSimulator",
        others.omsimulator_as_it_comes,
        False,
        GAUSS_SEIDEL,
    ),
    "cofmupy": Tool("cofmupy", "cofmupy", others.cofmupy, False, GAUSS_SEIDEL),
    "mastersim": Tool("MasterSim (its own clock)", "program:mastersim", others.mastersim, True, GAUSS_SEIDEL),
}
