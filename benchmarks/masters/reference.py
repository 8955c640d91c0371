"""Where a run must end: the job by plain FMI calls, in the schemes that tools use.

Tools that exchange values in different orders follow different trajectories. That a tool did the work that it was
timed for shows when it ends where plain calls in its own order end.
"""

from collections.abc import Callable, Mapping
from typing import Any

from benchmarks.masters.job import BenchJob
from benchmarks.masters.tool import GAUSS_SEIDEL, JACOBI, JACOBI_READ_AGAIN
from benchmarks.masters.with_fmpy import ends_of, one_after_the_other, slaves_of


def _side_by_side(job: BenchJob, slaves: Mapping[str, Any], read_again: bool) -> None:
    r = job.references
    links = [(slaves[a], [r[a][b]], slaves[c], [r[c][d]]) for a, b, c, d in job.connections]

    def exchange() -> None:
        values = [source.getReal(output) for source, output, _, _ in links]
        for (_, _, sink, entry), value in zip(links, values, strict=True):
            sink.setReal(entry, value)
        if read_again:
            for source, output, _, _ in links:
                source.getReal(output)

    exchange()
    for n in range(job.steps):
        for slave in slaves.values():
            slave.doStep(n * job.step, job.step)
        exchange()


SCHEMES: dict[str, Callable[[BenchJob, Mapping[str, Any]], None]] = {
    GAUSS_SEIDEL: one_after_the_other,
    JACOBI: lambda job, slaves: _side_by_side(job, slaves, read_again=False),
    JACOBI_READ_AGAIN: lambda job, slaves: _side_by_side(job, slaves, read_again=True),
}


def reference_ends(job: BenchJob, scheme: str) -> dict[str, float]:
    """Return where ``job.watched`` ends under a scheme."""
    slaves = slaves_of(job)
    SCHEMES[scheme](job, slaves)
    ends = ends_of(job, slaves)
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
    return ends
