"""FMPy's calls in the plainest loop, one call per variable, and in the quickest, one get and set per FMU and step."""

from collections.abc import Mapping
from typing import Any

from benchmarks.masters.job import BenchJob
from benchmarks.masters.tool import Prepared


def slaves_of(job: BenchJob) -> dict[str, Any]:
    """Return initialised slaves by instance.

    Returns:
        Slaves, to be freed by the caller.
    """
    import fmpy

    kind = _slave2() if job.fmi == 2 else _slave3()
    slaves: dict[str, Any] = {}
    for name, path in job.fmus.items():
        description = fmpy.read_model_description(path)
        slave = kind(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        slave.instantiate()
        slaves[name] = slave
    arrays: dict[tuple[str, str, int], list[Any]] = {}
    for name, variable, type_, value in job.starts:
        arrays.setdefault((name, type_, job.references[name][variable]), []).append(value)
    for (name, type_, reference), values in arrays.items():
        getattr(slaves[name], f"set{type_}")([reference], values)
    for slave in slaves.values():
        if job.fmi == 2:
            slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
    return slaves


def _slave2() -> Any:
    from fmpy.fmi2 import FMU2Slave

    return FMU2Slave


def _slave3() -> Any:
    from fmpy.fmi3 import FMU3Slave

    class Slave(FMU3Slave):
        """With the names that FMI 2.0 has for the calls of a loop."""

        setReal = FMU3Slave.setFloat64

        def getReal(self, vr: list[int]) -> list[float]:
            return list(self.getFloat64(vr, len(vr)))

    return Slave


def ends_of(job: BenchJob, slaves: Mapping[str, Any]) -> dict[str, float]:
    """Return the watched outputs."""
    return {f"{a}.{b}": slaves[a].getReal([job.references[a][b]])[0] for a, b in job.watched}


def one_after_the_other(job: BenchJob, slaves: Mapping[str, Any]) -> None:
    """One call per variable, instances in execution order."""
    r = job.references
    inputs = {name: [(slaves[a], r[a][b], r[c][d]) for a, b, c, d in job.connections if c == name] for name in slaves}
    for n in range(job.steps):
        for name, slave in slaves.items():
            for source, output, entry in inputs[name]:
                slave.setReal([entry], source.getReal([output]))
            slave.doStep(n * job.step, job.step)


def per_variable(job: BenchJob) -> Prepared:
    """One call per variable."""
    slaves = slaves_of(job)
    return Prepared(lambda: one_after_the_other(job, slaves), lambda: ends_of(job, slaves))


def batched(job: BenchJob) -> Prepared:
    """One batched get and set per FMU and step, instances in execution order."""
    slaves, r = slaves_of(job), job.references
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

    return Prepared(run, lambda: ends_of(job, slaves))
