"""The dynamic checks: what a child process is asked to run, and how its end becomes a finding."""

import contextlib
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.binaries import MAXIMUM_BYTES, PLATFORMS, here, inspect, library_name, loadable, misfit
from orchestrator.checking.description import Description, Interface
from orchestrator.checking.findings import Execution, Finding
from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.probing import (
    probes,
    probes_3,
    probes_dependencies,
    probes_derivatives,
    probes_driven,
    probes_life,
    probes_misuse,
    probes_promises,
    probes_reference,
    probes_states,
    probes_steps,
    probes_values,
    relations,
    returns,
    trajectory,
)
from orchestrator.checking.probing.binding import Library
from orchestrator.checking.probing.describing import make_job
from orchestrator.checking.probing.interfaces import InterfaceRun, compare_interfaces
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.statuses import PENDING, DiscardedError, StatusError, TerminatedError
from orchestrator.checking.rules import RULES, Version, declare
from orchestrator.errors import ChildError, OutputError
from orchestrator.plain_text import name_folder, plain_text
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.stopwatch import Stopwatch

declare("""
[run]
limits.time | E | * | * | no call takes longer than the time limit | look for an endless loop; raise the limit for a slow model
limits.total | I | * | * | all probes are done within the total time | raise the total limit, or make DefaultExperiment shorter
limits.memory | E | * | * | memory stays below the memory limit | look for a leak; raise the limit for a large model
limits.output | E | * | * | printed text and files stay small | print only when logging is on
run.crash | E | * | * | no call ends the process | run the call named under a debugger
run.failed | E | * | * | the checks can be carried out | report this with the FMU
run.not-executed | W | * | * | the FMU is executed, unless that is not asked for | check it where its binaries run, or ask for the static checks only
run.skipped | I | * | * | all checks can be carried out | mend the other findings first
[load]
load.library | E | 2.3 | 2.5.1.4 | the library loads | see the loader's message; link what is missing
[life cycle]
run.instantiate | E | 2.1.5 | 2.3.1 | instantiation succeeds | see the messages of the FMU
run.status | E | 4.2.4 | 2.3 | every call of a normal life cycle returns OK or Warning | see the messages of the FMU
run.pending | E | 4.2.2 | - | fmi2Pending only with canRunAsynchronuously | return when the step is done, or set the flag
[misuse]
misuse.crash | W | * | * | misuse neither ends the process nor hangs it | check the arguments and the state of the instance
[afterwards]
files.written | W | * | * | the FMU writes no files of its own | write only to a path that a parameter states
files.changed | W | * | * | the FMU does not change its own files | write to a temporary folder
process.left | W | * | * | no process outlives the FMU | end child processes when the instance is freed
""")  # noqa: E501

_PROBES: dict[str, probes.Probe] = {
    "life cycle": probes.life_cycle,
    "inputs": probes_driven.inputs,
    "determinism": relations.determinism,
    "setting": probes_driven.setting,
    "values": probes_values.values,
    "instances": relations.instances,
    "reset": returns.reset,
    "state": returns.state,
    "variable steps": probes_steps.variable_steps,
    "inner steps": probes_steps.inner_steps,
    "time": probes_steps.own_time,
    "states": probes_states.states,
    "dependencies": probes_dependencies.dependencies,
    "derivatives": probes_derivatives.derivatives,
    "early return": probes_3.early_return,
    "intermediate update": probes_3.intermediate,
    "clocks": probes_3.clocks,
    "configuration": probes_3.structure,
    "reference": probes_reference.reference,
    "memory": probes.memory,
    "promises": probes_promises.promises,
    "end": probes_life.end,
    "silence": probes_life.silence,
    "another start": probes_life.another_start,
    "misuse": probes_misuse.misuse,
    "path": relations.path,
}
_OF_3 = ("early return", "intermediate update", "clocks", "configuration")
_AT_POINTS = ("states", "dependencies", "derivatives")
"""Probes that look at points of a driven run: far from the values of the file too, where the others stay near them."""
PROBES: dict[Version, tuple[str, ...]] = {
    "2.0": tuple(n for n in _PROBES if n not in (*_OF_3, "path")),
    "3.0": tuple(n for n in _PROBES if n != "path"),
}
_MOST_FINDINGS = 10_000
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]{6,16}\b")
_TWO = 2


def obstacle(d: Description, files: FmuFiles) -> str:
    """Why an FMU cannot be executed here; empty when one of its interfaces can."""
    reasons = [_obstacle(d, interface, files) for interface in d.interfaces]
    return "it has no interface" if not reasons else "" if "" in reasons else reasons[0]


def _obstacle(d: Description, interface: Interface, files: FmuFiles) -> str:
    version = d.dialect.version
    path = loadable(d, interface, set(files.names()))
    if not path:
        wanted = library_name(interface.identifier or "", here(version), version)
        return f"there is no {wanted}, which this machine would load"
    unfit = misfit(inspect(files.read(path, MAXIMUM_BYTES)), path, PLATFORMS[version][here(version)], native=True)
    return "" if unfit is None else unfit.message


def check_dynamic(
    d: Description, files: FmuFiles, references: list[ReferenceResult], limits: Limits, walls: bool = True,
    chosen: tuple[str, ...] = (), tell: Callable[[str, float], None] = lambda stage, share: None,
) -> tuple[list[Finding], tuple[Execution, ...]]:  # fmt: skip
    """Run each interface of the FMU in a child process; return what it did wrong, and which probes were carried out.

    The child only does FMI calls, one by one; what is called and what is made of the answers is decided here.
    ``chosen``: names of the probes to carry out (default: all); ``tell``: called with each probe, and the share of them
    that are done.
    """
    findings: list[Finding] = []
    executions: list[Execution] = []
    runs: list[InterfaceRun] = []
    several = len(d.interfaces) > 1
    clock = Stopwatch(limits.total)
    with Scratch("check") as scratch:
        fmu = scratch.path / "fmu"
        name_folder(fmu, "the FMU")
        try:
            files.extract(fmu)
        except OSError as error:
            raise OutputError(f"the FMU must be unpacked to {scratch.path}, but cannot be: {error.strerror}") from None
        names = tuple(name for name in PROBES[d.dialect.version] if not chosen or name in chosen)
        for number, interface in enumerate(d.interfaces):
            reason = _obstacle(d, interface, files)
            if reason:
                executions.append(Execution(interface.kind, dict.fromkeys(("load", *names), reason)))
                continue
            library = loadable(d, interface, set(files.names()))
            rest = [] if executions or interface.kind == "ScheduledExecution" else references
            first = _Watcher(fmu, limits, clock, walls, interface.kind if several else "")
            first.tell = lambda probe, share, kind=interface.kind, at=number: tell(  # type: ignore[misc]
                f"{kind}: {probe}", (at + share) / len(d.interfaces)
            )
            found = first.run(make_job(d, interface, fmu, library, rest[0] if rest else None, limits), names)
            for reference in rest[1:]:
                if any(f.severity == "error" for f in found):
                    break
                job = make_job(d, interface, fmu, library, reference, limits)
                again = _Watcher(fmu, limits, clock, walls, interface.kind if several else "")
                found += again.run(job, ("reference",))
            runs += [] if first.run_seen is None else [first.run_seen]
            if len(runs) == _TWO and interface.kind != "ScheduledExecution":
                first.probe = "interfaces"
                first.stages["interfaces"] = compare_interfaces(runs[0], runs[1], first.add)
            findings += found
            if not chosen and number + 1 == len(d.interfaces):
                findings += _check_path(d, interface, fmu, first, library)
            executions.append(Execution(interface.kind, first.stages))
    return findings, tuple(executions)


def _check_path(d: Description, interface: Interface, fmu: Path, seen: "_Watcher", library: str) -> list[Finding]:
    """Run an FMU that has resources in a folder whose path has a blank and letters beyond ASCII."""
    resources = fmu / "resources"
    if seen.run_seen is None or not resources.is_dir() or not any(resources.iterdir()):
        seen.stages["path"] = "the FMU has no resources, or does not run"
        return []
    odd = fmu.with_name("FMU \N{LATIN SMALL LETTER E WITH ACUTE}")
    fmu.rename(odd)
    again = _Watcher(odd, seen.limits, seen.clock, seen.walls)
    again.expected, seen.stages["path"] = seen.run_seen.quiet, ""
    found = again.run(make_job(d, interface, odd, library, None, seen.limits), ("path",))
    known = {f.rule for f in seen.findings}
    wrong = [f for f in found if RULES[f.rule].severity == "error" and f.rule not in known]
    text = "an FMU must work in a folder whose path has a blank and letters beyond ASCII, but there"
    return [Finding("path.letters", "resources", f"{text} {wrong[0].message}")] if wrong else []


class _Watcher:
    """Asks one child and collects the findings."""

    def __init__(self, fmu: Path, limits: Limits, clock: Stopwatch, walls: bool, interface: str = "") -> None:
        self.fmu, self.limits, self.clock, self.walls = fmu, limits, clock, walls
        self.interface = f"{interface}, " if interface else ""
        self.findings: list[Finding] = []
        self._said: set[tuple[str, str]] = set()
        self.probe = "load"
        self.begun = 0.0
        self.stages: dict[str, str] = {}
        self.tell: Callable[[str, float], None] = lambda probe, share: None
        self.expected: list[list[Any]] = []
        """What the life cycle is known to give, where only its beginning is to be done again."""
        self.run_seen: InterfaceRun | None = None
        """The run of the interface, once there is one."""

    def run(self, job: ProbeJob, names: tuple[str, ...]) -> list[Finding]:
        before = _snapshot(self.fmu)
        self.begun = time.monotonic()
        with Library(self._start, job.version, job.variables, self.add) as library:
            try:
                self._probes(library, job, names)
            except ChildError as error:
                self._report_end(error, library.current, names)
            left = library.jail.finish() or library.left
            self._report_skipped(names)
            self._report_remains(before, library.jail, left)
            self.stages |= dict.fromkeys(("run", "process", "afterwards"), "")
        return self.findings

    def _start(self) -> Jail:
        entry = "orchestrator.checking.host:open_host"
        return Jail(entry, write=[self.fmu], limits=self.limits, walls=self.walls, adopt=True)

    def _probes(self, library: Library, job: ProbeJob, names: tuple[str, ...]) -> None:
        problem = library.load(job.library)
        if problem:
            self.add("load.library", f"the library must load, but: {problem}")
            return
        try:
            probes.load(library, self.add)
        except StatusError as error:  # a function that is not there
            self.add(_rule_of(error), str(error))
            return
        self.stages["load"] = ""
        single = "canBeInstantiatedOnlyOncePerProcess" in job.flags
        context = probes.Context(trajectory.Bench(job, library, self.add), self.add, single=single)
        context.quiet = self.expected
        for n, self.probe in enumerate(names):
            self.tell(self.probe, n / len(names))
            if self.clock.over:
                self._report_late(names)
                return
            try:
                told = len(self.findings)
                if self.probe in _AT_POINTS and context.far is not None:
                    with context.away():
                        probes.carry_out(_PROBES[self.probe], context)
                if len(self.findings) == told:
                    probes.carry_out(_PROBES[self.probe], context)
                library.surroundings()
            except (probes.SkippedError, DiscardedError) as reason:
                self.stages[self.probe] = str(reason)
                continue
            except TerminatedError:
                pass  # the slave ended this run earlier than the undisturbed one: nothing to compare
            except StatusError as error:
                self.add(_rule_of(error), str(error))
                return
            self.stages[self.probe] = ""
            bench = context.bench
            loses = any(f.rule == "value.kept" for f in self.findings)  # what it began from is not known then
            driven = [] if loses else context.trace or []
            self.run_seen = InterfaceRun(bench.job, context.quiet, driven, bench.movement)

    def _report_late(self, names: tuple[str, ...]) -> None:
        """Say what the total time did not suffice for."""
        missing = [name for name in names if name not in self.stages]
        reason = f"the time of {self.limits.total:g} s for the FMU was over"
        self.stages |= dict.fromkeys(missing, reason)
        text = f"all probes must be done within {self.limits.total:g} s, but these are left out: {', '.join(missing)}"
        self.add("limits.total", text)

    def add(self, rule: str, message: str, path: str = "", when: str = "") -> None:
        """Take a finding, unless the same was found before; ``when`` is the first time that it was.

        What differs from run to run is left out, so that a baseline knows the finding again: the folder, addresses.
        """
        message = _ADDRESS.sub("0x...", message.replace(f"{self.fmu}/", ""))
        if (rule, message) not in self._said and len(self.findings) < _MOST_FINDINGS:
            self._said.add((rule, message))
            self.findings.append(
                Finding(rule, path or f"({self.interface}{self.probe})", plain_text(f"{message} {when}".rstrip()))
            )

    def _report_end(self, error: ChildError, function: str, names: tuple[str, ...]) -> None:
        where = f"during {function}" if function else f"in the probe `{self.probe}`"
        if self.probe == "misuse" and function and error.reason not in ("memory", "disk"):
            self.add("misuse.crash", f"a call that is to be refused must return, but {error} {where}")
        elif error.reason == "time" and time.monotonic() - self.begun >= self.limits.total:
            self._report_late(names)
        elif error.reason == "time":
            self.add("limits.time", f"a call must take at most {self.limits.time:g} s, but took longer {where}")
        elif error.reason == "memory":
            allowed = self.limits.memory >> 20
            self.add("limits.memory", f"the process must use at most {allowed} MiB, but used more {where}")
        elif error.reason == "disk":
            self.add("limits.output", f"text and files must stay below {self.limits.disk >> 20} MiB, but do not")
        elif function:
            self.add("run.crash", f"no call must end the process, but {error} {where}")
        else:
            self.add("run.failed", f"the probe `{self.probe}` must end, but {error} ({error.said})")

    def _report_skipped(self, names: tuple[str, ...]) -> None:
        """Say what was not reached, and why."""
        missing = [name for name in names if name not in self.stages]
        ended = f"the run ended in the probe `{self.probe}`"
        self.stages |= dict.fromkeys(missing, ended)
        if missing[1:] or "load" not in self.stages:
            self.add("run.skipped", f"not carried out after that: {', '.join(missing[1:] or missing)}")

    def _report_remains(self, before: dict[str, tuple[int, int]], jail: Jail, left: bool) -> None:
        self.probe = "afterwards"
        written = _files(jail.scratch, "tmp")
        if written:
            self.add("files.written", f"the FMU must write no files, but wrote {', '.join(written[:5])}", written[0])
        after = _snapshot(self.fmu)
        changed = sorted(k for k in before.keys() | after.keys() if before.get(k) != after.get(k))
        if changed:
            self.add(
                "files.changed", f"the FMU must leave its files alone, but changed {', '.join(changed[:5])}", changed[0]
            )
        if jail.output_size() >= self.limits.output or any(
            os.lstat(jail.scratch / name).st_size >= self.limits.output for name in written
        ):
            self.add("limits.output", f"text and files must stay below {self.limits.output >> 20} MiB, but do not")
        if left:
            self.add("process.left", "no process must outlive the FMU, but one did (it has been killed)")


def _rule_of(error: StatusError) -> str:
    if error.rule:
        return error.rule
    if "Instantiate" in error.function:
        return "run.instantiate"
    pending = error.status == PENDING and error.function.startswith("fmi2")
    return "run.pending" if pending else "run.status"


def _files(folder: Path, left_out: str) -> list[str]:
    """Files below ``folder`` but for one subfolder; links are not followed."""
    # Not by os.walk, which calls itself for every level: an FMU may make thousands.
    found: list[str] = []
    waiting = [str(folder)]
    while waiting and len(found) <= _MOST_FINDINGS:
        current = waiting.pop()
        with contextlib.suppress(OSError), os.scandir(current) as entries:
            for entry in entries:
                if not entry.is_dir(follow_symlinks=False):
                    found.append(os.path.relpath(entry.path, folder))
                elif current != str(folder) or entry.name != left_out:
                    waiting.append(entry.path)
    return sorted(found)


def _snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of every file, byte code left out."""
    found = {}
    for name in _files(folder, ""):
        if "__pycache__" not in Path(name).parts:
            info = os.lstat(folder / name)
            found[Path(name).as_posix()] = (info.st_size, info.st_mtime_ns)
    return found
