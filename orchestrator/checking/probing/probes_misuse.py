"""Calls that a slave must refuse. They come last, for a slave may break on them."""

from orchestrator.checking.probing.binding import OK, WARNING
from orchestrator.checking.probing.probes import Context


def misuse(context: Context) -> None:
    """Wrong guid, a step too early, a negative step, an unknown value reference.

    Args:
        context: the FMU, its job and where findings go.
    """
    bench, job = context.bench, context.bench.job
    slave = bench.library.instantiate("instance", "{a guid of another model}", job.resources)
    if slave is not None:
        slave.free()
        context.report("misuse.guid", "fmi2Instantiate must refuse a wrong guid, but accepts it")
    with bench.instance(initialised=False) as slave:
        status = slave.raw("fmi2DoStep", ("double", job.start), ("double", job.step), ("int", 0))
        if status in (OK, WARNING):
            context.report("misuse.step-before-init", "fmi2DoStep must be refused before initialisation, but is not")
    with bench.instance() as slave:
        status = slave.raw("fmi2DoStep", ("double", job.start), ("double", -job.step), ("int", 0))
        if status in (OK, WARNING):
            context.report("misuse.negative-step", "fmi2DoStep must refuse a negative step, but does not")
    with bench.instance() as slave:
        unknown = max((v.reference for v in job.variables if v.base == "Real"), default=0) + 12345
        status = slave.raw("fmi2GetReal", ("references", [unknown]), ("size", 1), ("out Real", 1))
        if status in (OK, WARNING):
            message = f"fmi2GetReal must refuse the unknown value reference {unknown}, but does not"
            context.report("misuse.value-reference", message)
