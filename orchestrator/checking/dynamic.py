"""The dynamic checks: what a child process is asked to run, and how its ending becomes a finding."""

import contextlib
import math
import os
from pathlib import Path
from typing import Any

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.binaries import MAXIMUM_BYTES, PLATFORMS, here, inspect, library_name, misfit
from orchestrator.checking.description import Description, Interface, Variable, number
from orchestrator.checking.findings import Execution, Finding
from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.probing import probes, probes_compare, probes_misuse, probes_reference, trajectory
from orchestrator.checking.probing.binding import PENDING, Library, StatusError, TerminatedError
from orchestrator.checking.probing.trajectory import ProbeJob
from orchestrator.errors import ChildError, OutputError
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.isolation.scratch import Scratch

_PROBES: dict[str, probes.Probe] = {
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
PROBES = tuple(_PROBES)
_STEPS = 200
_MOST_FINDINGS = 10_000
_FLAGS = (
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "canHandleVariableCommunicationStepSize",
    "canBeInstantiatedOnlyOncePerProcess",
    "canRunAsynchronuously",
)


def obstacle(d: Description, files: FmuFiles) -> str:
    """Why an FMU cannot be executed here; empty when it can.

    Args:
        d: the model description.
        files: of the FMU.

    Returns:
        The reason, in words.
    """
    if d.dialect.version != "2.0":
        return f"FMUs of FMI {d.dialect.version} are not run yet"
    interface = d.interface("CoSimulation")
    if interface is None:
        return "it has no co-simulation interface"
    path = library_name(interface.identifier or "", here())
    if path not in files.names():
        return f"there is no {path}, which this machine would load"
    unfit = misfit(inspect(files.read(path, MAXIMUM_BYTES)), path, PLATFORMS["2.0"][here()], native=True)
    return "" if unfit is None else unfit.message


def check_dynamic(
    d: Description, files: FmuFiles, references: list[ReferenceResult], limits: Limits, walls: bool = True
) -> tuple[list[Finding], Execution]:
    """Run the FMU in a child process and report what it did.

    The child only does FMI calls, one by one; what is called and what is made of the answers is decided here.

    Args:
        d, files: of an FMU without an ``obstacle``.
        references: reference results; each is simulated.
        limits: of the child process.
        walls: whether the kernel shall keep the FMU from files, network and other processes.

    Returns:
        What it did wrong, and which probes were carried out.

    Raises:
        OutputError: there is no room to unpack the FMU.
    """
    interface = d.interface("CoSimulation")
    assert interface is not None
    with Scratch("check") as scratch:
        fmu = scratch.path / "fmu"
        try:
            files.extract(fmu)
        except OSError as error:
            raise OutputError(f"the FMU must be unpacked to {scratch.path}, but cannot be: {error.strerror}") from None
        first = _Watcher(fmu, limits, walls)
        findings = first.run(_job(d, interface, fmu, references[0] if references else None, limits), PROBES)
        for reference in references[1:]:
            if any(f.severity == "error" for f in findings):
                break
            findings += _Watcher(fmu, limits, walls).run(_job(d, interface, fmu, reference, limits), ("reference",))
    return findings, Execution(interface.element.tag, first.stages)


class _Watcher:
    """Asks one child and collects the findings."""

    def __init__(self, fmu: Path, limits: Limits, walls: bool) -> None:
        self.fmu, self.limits, self.walls = fmu, limits, walls
        self.findings: list[Finding] = []
        self.probe = "load"
        self.stages: dict[str, str] = {}

    def run(self, job: ProbeJob, names: tuple[str, ...]) -> list[Finding]:
        """The findings of one child."""
        before = _snapshot(self.fmu)
        with Jail(
            "orchestrator.checking.host:opened", write=[self.fmu], limits=self.limits, walls=self.walls, adopt=True
        ) as jail:
            library = Library(jail, "canRunAsynchronuously" in job.flags)
            try:
                self._probes(library, job, names)
            except ChildError as error:
                self._ended_early(error, library.current)
            left = jail.finish()
            self._skipped(names)
            self._left_behind(before, jail, left)
            self.stages |= dict.fromkeys(("run", "afterwards"), "")
        return self.findings

    def _probes(self, library: Library, job: ProbeJob, names: tuple[str, ...]) -> None:
        problem = library.load(job.library)
        if problem:
            self._add("load.library", f"the library must load, but: {problem}")
            return
        probes.load(library, self._add)
        self.stages["load"] = ""
        single = "canBeInstantiatedOnlyOncePerProcess" in job.flags
        context = probes.Context(probes.Bench(job, library), self._add, single=single)
        for self.probe in names:
            try:
                _PROBES[self.probe](context)
            except probes.SkippedError as reason:
                self.stages[self.probe] = str(reason)
                continue
            except TerminatedError:
                pass  # the slave ended this run earlier than the undisturbed one: nothing to compare
            except StatusError as error:
                self._add(_rule_of(error), str(error))
                return
            self.stages[self.probe] = ""

    def _add(self, rule: str, message: str, path: str = "") -> None:
        if len(self.findings) < _MOST_FINDINGS:
            self.findings.append(Finding(rule, path or f"({self.probe})", message))

    def _ended_early(self, error: ChildError, function: str) -> None:
        where = f"during {function}" if function else f"in the probe `{self.probe}`"
        if error.reason == "time":
            self._add("limits.time", f"a call must take at most {self.limits.time:g} s, but took longer {where}")
        elif error.reason == "memory":
            allowed = self.limits.memory >> 20
            self._add("limits.memory", f"the process must use at most {allowed} MiB, but used more {where}")
        elif error.reason == "disk":
            self._add("limits.output", f"text and files must stay below {self.limits.disk >> 20} MiB, but do not")
        elif self.probe == "misuse" and function:
            self._add("misuse.crash", f"a call that is to be refused must not end the process, but {error} {where}")
        elif function:
            self._add("run.crash", f"no call must end the process, but {error} {where}")
        else:
            self._add("run.failed", f"the probe `{self.probe}` must end, but {error} ({error.said})")

    def _skipped(self, names: tuple[str, ...]) -> None:
        """Say what was not reached, and why."""
        missing = [name for name in names if name not in self.stages]
        ended = f"the run ended in the probe `{self.probe}`"
        self.stages |= dict.fromkeys(missing, ended)
        if missing[1:] or "load" not in self.stages:
            self._add("run.skipped", f"not carried out after that: {', '.join(missing[1:] or missing)}")

    def _left_behind(self, before: dict[str, tuple[int, int]], jail: Jail, left: bool) -> None:
        self.probe = "afterwards"
        written = _files(jail.scratch, "tmp")
        if written:
            self._add("files.written", f"the FMU must write no files, but wrote {', '.join(written[:5])}", written[0])
        after = _snapshot(self.fmu)
        changed = sorted(k for k in before.keys() | after.keys() if before.get(k) != after.get(k))
        if changed:
            self._add(
                "files.changed", f"the FMU must leave its files alone, but changed {', '.join(changed[:5])}", changed[0]
            )
        if jail.printed_bytes() >= self.limits.output or any(
            os.lstat(jail.scratch / name).st_size >= self.limits.output for name in written
        ):
            self._add("limits.output", f"text and files must stay below {self.limits.output >> 20} MiB, but do not")
        if left:
            self._add("process.left", "no process must outlive the FMU, but one did (it has been killed)")


def _rule_of(error: StatusError) -> str:
    if error.function == "fmi2Instantiate":
        return "run.instantiate"
    return "run.pending" if error.status == PENDING else "run.status"


def _files(folder: Path, left_out: str) -> list[str]:
    """Files below ``folder``, save for those in one of its subfolders; links are not followed.

    Not by ``os.walk``, which calls itself for every level: an FMU may make thousands.
    """
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


def _job(
    d: Description, interface: Interface, fmu: Path, reference: ReferenceResult | None, limits: Limits
) -> ProbeJob:
    start = _or(d.experiment("startTime"), 0.0)
    stop = d.experiment("stopTime")
    if stop is not None and not start < stop < math.inf:
        stop = None  # a finding already
    length = (stop if stop is not None else start + 1.0) - start
    step = d.experiment("stepSize") or length / _STEPS
    if not 0.0 < step <= length:
        step = length / _STEPS
    # Steps beyond the stop time may be refused, so a fraction of one is left out.
    steps = max(1, math.floor(min(_STEPS, length / step + 1e-6)))
    return ProbeJob(
        library=str(fmu / library_name(str(interface.identifier), here())),
        guid=d.root.get("guid", ""),
        resources=(fmu / "resources").as_uri(),
        variables=tuple(_plain(v, v.reference) for v in d.variables if v.reference is not None and v.kind),
        start=start,
        stop=stop,
        step=step,
        tolerance=d.experiment("tolerance"),
        steps=steps,
        budget=min(2.0, 0.2 * limits.time),
        flags=frozenset(f for f in _FLAGS if interface.flag(f)),
        reference=reference,
    )


def _or(value: float | None, default: float) -> float:
    return default if value is None or not math.isfinite(value) else value


def _plain(v: Variable, reference: int) -> trajectory.ProbedVariable:
    start: Any = v.start
    if start is not None:
        if v.base == "Boolean":
            start = int(start in ("true", "1"))
        elif v.base != "String":
            start = number(start, v.kind)
    return trajectory.ProbedVariable(
        name=v.name,
        reference=reference,
        base=v.base,
        causality=v.causality,
        variability=v.variability,
        initial=v.initial,
        start=start,
        minimum=v.number("min"),
        maximum=v.number("max"),
        nominal=v.number("nominal"),
    )
