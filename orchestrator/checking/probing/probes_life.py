"""Probes of what a life has beside steps: its end, another start time, and silence where logging is off."""

from dataclasses import replace

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import DiscardedError, StatusError, TerminatedError
from orchestrator.checking.rules import declare

declare("""
[end]
ended.get | W | 4.2.4 | 2.3.8 | values can be read after the end | allow the functions in the state terminated
[silence]
log.off | W | 2.1.5 | 2.3.1 | nothing is logged if logging is off | check loggingOn before calling the logger
[another start]
start.time | W | 2.1.6 | 2.3.2 | an experiment can begin at any time | take the start time from the arguments of the setup
""")  # noqa: E501

_FEW_STEPS = 3
_LATER = 10  # steps
_NEAR = 1e-6


def end(context: Context) -> None:
    """After the end values can still be read."""
    job = context.bench.job
    variables = [v for v in job.variables if not v.clocks and v.base != "Clock" and v.causality == "output"]
    firsts = list({v.base: v for v in reversed(variables)}.values())
    with context.bench.instance() as driver:
        _steps(context, driver)
        driver.terminate()
        for v in firsts:
            try:
                driver.get([v], "after Terminate")
            except StatusError as error:
                context.report("ended.get", str(error), v.name)
                break


def _steps(context: Context, driver: Driver) -> None:
    context.bench.run(driver, 0, min(_FEW_STEPS, context.bench.job.steps))


def silence(context: Context) -> None:
    """Without logging, at instantiation or switched off later, nothing is logged that is neither warning nor error."""
    for how, notes in (("loggingOn = false", context.observation.notes), ("SetDebugLogging(false)", context.notes)):
        if notes is not None and notes[0]:
            text = f"nothing must be logged with {how}, but {notes[0]} messages are, the first: {notes[1]}"
            context.report("log.off", text)
            return


def another_start(context: Context) -> None:
    """An experiment that begins at another time than the default one begins there."""
    bench, job = context.bench, context.bench.job
    try:
        for steps in (_LATER, -_LATER):
            begin = job.start + steps * job.step
            bench.job = replace(job, start=begin, stop=None if job.stop is None else job.stop + steps * job.step)
            if not _begins(context, begin):
                return
    finally:
        bench.job = job


def _begins(context: Context, begin: float) -> bool:
    """Whether an experiment begins at ``begin`` [s]; it is reported where it does not."""
    when = f"of an experiment from t = {begin:g}"
    try:
        with context.bench.instance() as driver:
            v = context.bench.job.time_variable
            found = begin if v is None else float(driver.read([v])[0])
            _steps(context, driver)
    except StatusError as error:
        if not error.rule:  # a model may have events at times of its own
            context.report("start.time", f"an experiment must be able to begin at any time, but {error}", "", when)
        return False
    except (DiscardedError, TerminatedError):
        return False
    if v is not None and abs(found - begin) > _NEAR * max(abs(begin), context.bench.job.step):
        text = f"`{v.name}` must be the start time after initialisation, but is {found:g}"
        context.report("start.time", text, v.name, when)
        return False
    return True
