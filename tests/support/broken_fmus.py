"""FMUs that are broken on purpose: each is the good C FMU with one mutation, and names the rule it violates."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestrator.checking.archive import ArchiveLimits
from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import CheckOptions
from orchestrator.checking.static import STAGES as STATIC_STAGES
from orchestrator.shared.isolation.limits import Limits
from tests.support import broken_archives, broken_xml
from tests.support.c_fmu import LIBRARY, fmu_files, have_compiler, write_fmu

BEHAVIOURS = {
    "chatter": "limits.output",
    "crash_free": "run.crash",
    "crash_get": "run.crash",
    "crash_instantiate": "run.crash",
    "crash_step": "run.crash",
    "crash_unknown_reference": "misuse.crash",
    "default_mismatch": "value.start",
    "deserialise_error": "state.status",
    "directional_refused": "derivative.status",
    "discard_long": "step.discarded",
    "discard_step": "step.discarded",
    "eat_memory": "limits.memory",
    "error_step": "run.status",
    "exit_step": "run.crash",
    "fatal_step": "run.status",
    "get_error": "run.status",
    "guid_ignored": "misuse.guid",
    "hang_step": "limits.time",
    "hidden_state": "state.restore",
    "ignores_step": "steps.variable",
    "illegal_status": "run.status",
    "init_error": "run.status",
    "input_never": "value.set",
    "input_refused": "run.input-refused",
    "instance_leak": "resources.instance-leak",
    "instantiate_null": "run.instantiate",
    "instantiate_once": "instances.second",
    "missing_function": "binary.exports",
    "nan_initial": "value.not-finite",
    "nan_output": "value.not-finite",
    "negative_step": "misuse.negative-step",
    "null_string": "value.string",
    "orphan": "process.left",
    "out_of_range": "value.out-of-range",
    "pending_step": "run.pending",
    "python_exception": "run.python-exception",
    "python_symbols": "binary.python-symbols",
    "random": "run.determinism",
    "reset_error": "run.reset",
    "reset_incomplete": "run.reset",
    "serialised_empty": "state.status",
    "serialised_incomplete": "state.serialise",
    "set_has_effect": "value.set",
    "set_output_refused": "value.set-initial",
    "set_refused": "value.set",
    "shared_state": "instances.interference",
    "slow_physics": "reference.result",
    "slope_zero": "derivative.value",
    "spin_step": "limits.time",
    "state_not_nulled": "state.free",
    "state_not_restored": "state.restore",
    "state_rounded": "run.inexact",
    "state_refused": "state.status",
    "step_before_init": "misuse.step-before-init",
    "step_leak": "resources.step-leak",
    "terminate_error": "run.status",
    "types_platform": "load.platform",
    "undefined_symbol": "load.library",
    "unknown_reference": "misuse.value-reference",
    "variable_refused": "steps.variable",
    "version": "load.version",
    "warns": "run.warning",
    "logs_errors": "run.logged-error",
    "write_file": "files.written",
    "write_resources": "files.changed",
}
ALONE = ("discard_long", "discard_step")
"""Faults whose findings other tests look at by day."""
QUICK = CheckOptions(limits=Limits(time=4.0, memory=192 << 20))


@dataclass(frozen=True)
class Broken:
    """One broken FMU.

    Attributes:
        rule: the one rule that must be named.
        make: writes the FMU to a path.
        options: how it is checked.
    """

    name: str
    rule: str
    make: Callable[[Path], object]
    options: CheckOptions = field(default=QUICK)


def _behaviour(name: str) -> Callable[[Path], object]:
    return lambda path: write_fmu(path, fmu_files(name))


def _files(change: Callable[[dict[str, bytes]], None]) -> Callable[[Path], object]:
    def make(path: Path) -> None:
        files = fmu_files()
        change(files)
        write_fmu(path, files)

    return make


def _limited(**limits: float) -> CheckOptions:
    return CheckOptions(archive=ArchiveLimits(**limits), limits=QUICK.limits)  # type: ignore[arg-type]


def corpus() -> list[Broken]:
    """All broken FMUs; behaviour and binaries only where they can be made."""
    found = [
        Broken(f"xml {name}", rule, _files(broken_xml.replacing(old, new)))
        for name, rule, old, new in broken_xml.REPLACEMENTS
    ]
    found += [Broken(f"files {n}", rule, _files(change)) for n, rule, change in broken_xml.FILE_CHANGES]
    found.append(Broken("xml huge", "xml.too-large", _files(broken_xml.huge), _limited(ratio=1e9)))
    found += [Broken(f"archive {n}", rule, make) for n, rule, make in broken_archives.ARCHIVES]
    found.append(Broken("archive large", "archive.too-large", broken_archives.large, _limited(total=2 << 20)))
    found.append(Broken("archive many files", "archive.too-many-files", broken_archives.many, _limited(files=20)))
    # A fault in what is read may have consequences when the FMU runs, too; test_check_gate.py looks at these.
    read = {name for name, rule in RULES.items() if rule.stage in STATIC_STAGES}
    found = [replace(b, options=replace(b.options, static=b.rule in read)) for b in found]
    if have_compiler():
        static = replace(QUICK, static=True)
        found += [Broken(f"binary {n}", rule, _files(change), static) for n, rule, change in broken_xml.BINARIES]
        found += [
            # Behind walls a process cannot be started, so none can be left.
            Broken(f"behaviour {n}", rule, _behaviour(n), replace(QUICK, trust=rule == "process.left"))
            for n, rule in BEHAVIOURS.items()
        ]
    return found


def is_of_the_day(fault: str, version: str, others: Collection[str]) -> bool:
    """Whether a fault is looked at by day in this version; of those of both versions (``others``) each is in one."""
    both = sorted(BEHAVIOURS.keys() & others)
    return fault not in both or (both.index(fault) % 3 == 0) == (version == "3.0")


def good(path: Path) -> Path:
    """The FMU that the broken ones are made from."""
    assert LIBRARY in fmu_files()
    return write_fmu(path, fmu_files())
