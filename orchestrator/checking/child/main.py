"""Entry of the child process: loads the FMU, runs the probes, writes one JSON object per line."""

import json
import os
import sys
from typing import Any

from orchestrator.checking.child import probes, probes_compare, probes_misuse, probes_reference
from orchestrator.checking.child.binding import CurrentCall, Library, StatusError, TerminatedError
from orchestrator.checking.child.trajectory import Bench, Job, Variable

PROBES: dict[str, probes.Probe] = {
    "life cycle": probes.life_cycle,
    "inputs": probes.inputs,
    "determinism": probes_compare.determinism,
    "setting": probes.setting,
    "instances": probes_compare.instances,
    "reset": probes_compare.reset,
    "state": probes_compare.state,
    "variable steps": probes_compare.variable_steps,
    "reference": probes_reference.reference,
    "memory": probes.memory,
    "misuse": probes_misuse.misuse,
}


class Channel:
    """Where messages for the parent go: the standard output that the process was born with."""

    def __init__(self, log: str) -> None:
        self._out = os.dup(1)
        sink = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(sink, 1)
        os.dup2(sink, 2)

    def send(self, **message: Any) -> None:
        """One line for the parent."""
        data = json.dumps(message).encode() + b"\n"
        while data:
            data = data[os.write(self._out, data) :]


def main() -> None:
    """Run the job whose file is the first argument."""
    with open(sys.argv[1], encoding="utf-8") as file:
        data = json.load(file)
    channel = Channel(data.pop("log"))
    current = CurrentCall(data.pop("call"))
    wanted = data.pop("probes")
    job = _job(data)

    def report(rule: str, message: str, path: str = "") -> None:
        channel.send(rule=rule, message=message, path=path)

    channel.send(probe="load")
    try:
        library = Library(job.library, current, "canRunAsynchronuously" in job.flags)
    except OSError as error:
        report("load.library", f"the library must load, but: {error}")
        channel.send(done=True)
        return
    probes.load(library, report)
    bench = Bench(job, library, lambda: channel.send(beat=True))
    context = probes.Context(bench, report, single="canBeInstantiatedOnlyOncePerProcess" in job.flags)
    for name in wanted:
        channel.send(probe=name)
        try:
            go_on = PROBES[name](context)
        except TerminatedError:
            go_on = True  # the slave ended this run earlier than the undisturbed one: nothing to compare
        except StatusError as error:
            report(_rule_of(error), str(error))
            go_on = False
        if not go_on:
            channel.send(stopped=name)
            break
    channel.send(done=True)
    # Straight out: a host that tidies up Python after a Python FMU has run is not what is tested here.
    os._exit(0)


def _rule_of(error: StatusError) -> str:
    if error.function == "fmi2Instantiate":
        return "run.instantiate"
    return "run.pending" if error.status == 5 else "run.status"


def _job(data: dict[str, Any]) -> Job:
    data["variables"] = tuple(Variable(**v) for v in data["variables"])
    data["flags"] = frozenset(data["flags"])
    return Job(**data)
