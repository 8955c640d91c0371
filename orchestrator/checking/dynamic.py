"""The dynamic checks: what is run, and how the ending of the child becomes a finding."""

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.binaries import here, library_name
from orchestrator.checking.description import Description, Interface, Variable, number
from orchestrator.checking.findings import Finding
from orchestrator.checking.layered import ReferenceResult
from orchestrator.checking.rules import RULES
from orchestrator.checking.sandbox import Ending, Limits, run_child

PROBES = (
    "life cycle", "inputs", "determinism", "setting", "instances", "reset", "state", "variable steps", "reference",
    "memory", "misuse",
)  # fmt: skip
_STEPS = 200
_MOST_FINDINGS = 10_000
_FLAGS = (
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "canHandleVariableCommunicationStepSize",
    "canBeInstantiatedOnlyOncePerProcess",
    "canRunAsynchronuously",
)


def can_run(d: Description, files: FmuFiles) -> bool:
    """Whether there is a co-simulation library for this machine."""
    interface = d.cosimulation
    if interface is None or interface.identifier is None:
        return False
    return library_name(interface.identifier, here()) in files.names()


def check_dynamic(d: Description, files: FmuFiles, references: list[ReferenceResult], limits: Limits) -> list[Finding]:
    """Run the FMU in a child process and report what it did.

    Args:
        d, files: of an FMU whose static checks found no error, and for which ``can_run`` is true.
        references: reference results; each is simulated.
    """
    interface = d.cosimulation
    assert interface is not None
    with tempfile.TemporaryDirectory(prefix="fmu-check-", ignore_cleanup_errors=True) as name:
        base = Path(name)
        try:
            files.extract(base / "fmu")
        except OSError as error:
            return [Finding("run.failed", "", f"the FMU must be unpacked to be run, but cannot be: {error.strerror}")]
        findings: list[Finding] = []
        for position, reference in enumerate(references or [None]):
            probes = PROBES if position == 0 else ("reference",)
            if position and any(f.severity == "error" for f in findings):
                break
            work = base / f"run{position}" / "work"
            work.mkdir(parents=True)
            job = _job(d, interface, base / "fmu", reference, limits)
            findings += _Watcher(base / "fmu", work, limits).run(job, probes)
    return findings


class _Watcher:
    """Runs one child and collects its findings."""

    def __init__(self, fmu: Path, work: Path, limits: Limits) -> None:
        self.fmu, self.work, self.limits = fmu, work, limits
        self.findings: list[Finding] = []
        self.probe = "load"
        self.done = False
        self.stopped = ""

    def run(self, job: dict[str, Any], probes: tuple[str, ...]) -> list[Finding]:
        """The findings of one child."""
        side = self.work.parent
        call, log = side / "call", side / "log"
        call.write_bytes(bytes(128))
        job |= {"probes": list(probes), "call": str(call), "log": str(log)}
        file = side / "job.json"
        file.write_text(json.dumps(job), encoding="utf-8")
        before = _snapshot(self.fmu)
        ending = run_child("orchestrator.checking.child.main", [str(file)], self.work, self.limits, self._line)
        # The FMU may have deleted what it was given.
        function = call.read_bytes().rstrip(b"\0").decode("utf-8", "replace") if call.exists() else ""
        if not self.done:
            self._ended_early(ending, function, log)
        self._skipped(probes)
        self._left_behind(before, _snapshot(self.fmu), log, ending)
        return self.findings

    def _line(self, line: bytes) -> None:
        """Take in a message. The FMU might write to the same pipe, so nothing is taken for granted."""
        try:
            message = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(message, dict):
            return
        self.probe = str(message.get("probe", self.probe))
        self.stopped = str(message.get("stopped", self.stopped))
        self.done = self.done or bool(message.get("done"))
        rule = str(message.get("rule"))
        if rule in RULES and len(self.findings) < _MOST_FINDINGS:
            self._add(rule, str(message.get("message")), str(message.get("path", "")))

    def _add(self, rule: str, message: str, path: str = "") -> None:
        self.findings.append(Finding(rule, path or f"({self.probe})", message))

    def _ended_early(self, ending: Ending, function: str, log: Path) -> None:
        where = f"during {function}" if function else f"in the probe `{self.probe}`"
        if ending.reason == "time":
            self._add("limits.time", f"a call must take at most {self.limits.time:g} s, but took longer {where}")
        elif ending.reason == "memory":
            allowed = self.limits.memory >> 20
            self._add("limits.memory", f"the process must use at most {allowed} MiB, but used more {where}")
        elif self.probe == "misuse" and function:
            self._add(
                "misuse.crash",
                f"a call that is to be refused must not end the process, but {ending.describe()} {where}",
            )
        elif function:
            self._add("run.crash", f"no call must end the process, but {ending.describe()} {where}")
        else:
            said = log.read_text("utf-8", "replace").strip().splitlines()[-1:] if log.exists() else []
            self._add(
                "run.failed", f"the probe `{self.probe}` must end, but {ending.describe()} ({' '.join(said)[:300]})"
            )

    def _skipped(self, probes: tuple[str, ...]) -> None:
        last = self.stopped or ("" if self.done else self.probe)
        rest = probes[probes.index(last) + 1 :] if last in probes else probes if last == "load" else ()
        if rest:
            self._add("run.skipped", f"not carried out after that: {', '.join(rest)}")

    def _left_behind(self, before: dict[str, Any], after: dict[str, Any], log: Path, ending: Ending) -> None:
        written = sorted(p.relative_to(self.work).as_posix() for p in self.work.rglob("*") if p.is_file())
        self.probe = "afterwards"
        if written:
            self._add("files.written", f"the FMU must write no files, but wrote {', '.join(written[:5])}", written[0])
        changed = sorted(k for k in before.keys() | after.keys() if before.get(k) != after.get(k))
        if changed:
            self._add(
                "files.changed", f"the FMU must leave its files alone, but changed {', '.join(changed[:5])}", changed[0]
            )
        sizes = [p.stat().st_size for p in (log, *self.work.rglob("*")) if p.is_file()]
        if max(sizes, default=0) >= self.limits.output:
            self._add("limits.output", f"text and files must stay below {self.limits.output >> 20} MiB, but do not")
        if ending.left:
            self._add("process.left", "no process must outlive the FMU, but one did (it has been killed)")


def _snapshot(folder: Path) -> dict[str, Any]:
    """Size and time of every file, byte code left out."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            info = os.stat(path)
            found[path.relative_to(folder).as_posix()] = (info.st_size, info.st_mtime_ns)
    return found


def _job(
    d: Description, interface: Interface, fmu: Path, reference: ReferenceResult | None, limits: Limits
) -> dict[str, Any]:
    start = d.experiment("startTime") or 0.0
    stop = d.experiment("stopTime")
    length = (stop if stop is not None else start + 1.0) - start
    step = d.experiment("stepSize") or length / _STEPS
    # Steps beyond the stop time may be refused, so a fraction of one is left out.
    steps = max(1, math.floor(min(_STEPS, length / step + 1e-6)))
    return {
        "library": str(fmu / library_name(str(interface.identifier), here())),
        "guid": d.root.get("guid", ""),
        "resources": (fmu / "resources").as_uri(),
        "variables": [_plain(v) for v in d.variables if v.reference is not None],
        "start": start,
        "stop": stop,
        "step": step,
        "tolerance": d.experiment("tolerance"),
        "steps": steps,
        "budget": min(2.0, 0.2 * limits.time),
        "flags": [f for f in _FLAGS if interface.flag(f)],
        "reference": None
        if reference is None
        else {"path": reference.path, "names": reference.names, "rows": reference.rows},
    }


def _plain(v: Variable) -> dict[str, Any]:
    start: Any = v.start
    if start is not None:
        if v.base == "Boolean":
            start = int(start in ("true", "1"))
        elif v.base != "String":
            start = number(start, v.kind)
    return {
        "name": v.name,
        "reference": v.reference,
        "base": v.base,
        "causality": v.causality,
        "variability": v.variability,
        "initial": v.initial,
        "start": start,
        "minimum": v.number("min"),
        "maximum": v.number("max"),
        "nominal": v.number("nominal"),
    }
