"""FMUs of FMI 3.0 that are broken on purpose: the ball with one fault of behaviour, and the rule that must name it."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import CheckOptions
from orchestrator.shared.isolation.limits import Limits
from tests.support.ball3 import XML, ball_files
from tests.support.c_fmu import write_fmu

QUICK = CheckOptions(limits=Limits(time=4.0, memory=192 << 20))
STATIC = replace(QUICK, static=True)


@dataclass(frozen=True)
class Mutant:
    """One broken FMU: the rule that must be named, and what writes it."""

    name: str
    rule: str
    make: Callable[[Path], object]
    options: CheckOptions = QUICK

    @property
    def wanted(self) -> str:
        """Severity of the rule."""
        return RULES[self.rule].severity


CO_SIMULATION = {
    "version": "load.version",
    "missing_function": "binary.exports",
    "instantiate_null": "run.instantiate",
    "init_error": "run.status",
    "exit_error": "run.status",
    "error_step": "run.status",
    "discard_first": "run.status",
    "discard_long": "step.discarded",
    "discard_step": "step.discarded",
    "fatal_step": "run.status",
    "illegal_status": "run.status",
    "get_error": "run.status",
    "python_exception": "run.python-exception",
    "terminate_error": "run.status",
    "crash_step": "run.crash",
    "exit_step": "run.crash",
    "crash_free": "run.crash",
    "hang_step": "limits.time",
    "eat_memory": "limits.memory",
    "chatter": "limits.output",
    "nan_output": "value.not-finite",
    "out_of_range": "value.out-of-range",
    "start_mismatch": "value.start",
    "null_string": "value.string",
    "null_binary": "value.string",
    "last_time": "step.last-time",
    "no_progress": "step.no-progress",
    "early_always": "step.early-return",
    "event_endless": "event.endless",
    "event_past": "event.next-time",
    "event_nan": "event.next-time",
    "event_without_cause": "event.without-cause",
    "input_refused": "run.input-refused",
    "random": "run.determinism",
    "set_refused": "value.set",
    "set_effect": "value.set",
    "set_initial_refused": "value.set-initial",
    "second_refused": "instances.second",
    "shared": "instances.interference",
    "reset_error": "run.reset",
    "reset_incomplete": "run.reset",
    "reset_clock": "run.reset",
    "state_refused": "state.status",
    "state_incomplete": "state.restore",
    "state_clock": "state.restore",
    "serialised_empty": "state.status",
    "serialised_incomplete": "state.serialise",
    "deserialise_error": "state.status",
    "state_not_nulled": "state.free",
    "ignores_step": "steps.variable",
    "update_outside": "intermediate.unexpected",
    "update_missing": "intermediate.missing",
    "update_backwards": "intermediate.time",
    "update_beyond": "intermediate.time",
    "update_get_refused": "intermediate.access",
    "update_set_refused": "intermediate.access",
    "update_no_return": "intermediate.early-return",
    "clock_interval": "clock.interval-value",
    "clock_stays": "clock.deactivation",
    "clock_always": "event.idle",
    "clock_refused": "run.status",
    "configuration_refused": "configuration.status",
    "configuration_array": "configuration.status",
    "configuration_value": "configuration.value",
    "slow_physics": "reference.result",
    "instance_leak": "resources.instance-leak",
    "step_leak": "resources.step-leak",
    "token_ignored": "misuse.guid",
    "step_before_init": "misuse.step-before-init",
    "negative_step": "misuse.negative-step",
    "unknown_reference": "misuse.value-reference",
    "value_count": "misuse.value-count",
    "set_output": "misuse.set-output",
    "crash_unknown": "misuse.crash",
    "write_file": "files.written",
    "write_resources": "files.changed",
}
MODEL_EXCHANGE = {
    "states_count": "states.count",
    "indicators_count": "indicators.count",
    "nominal_zero": "states.nominal",
    "derivative_error": "run.status",
    "completed_error": "run.status",
    "event_endless": "event.endless",
    "state_incomplete": "state.restore",
}
SCHEDULED_EXECUTION = {
    "partition_error": "run.status",
    "lock_kept": "partition.preemption",
    "reset_clock": "run.reset",
    "state_clock": "state.restore",
}
FLAGS = {
    # A good library under flags that do not fit it.
    "early_unflagged": ("step.early-return", 'mightReturnEarlyFromDoStep="true"', ""),
    "update_undeclared": ("intermediate.unexpected", 'providesIntermediateUpdate="true"', ""),
}
Edits = tuple[tuple[str, str], ...]
SLOPES: Edits = (('hasEventMode="true"/>', 'hasEventMode="true" maxOutputDerivativeOrder="1"/>'),)
PARTIAL: Edits = (
    ('canSerializeFMUState="true"/>', 'canSerializeFMUState="true" providesDirectionalDerivatives="true" '
     'providesAdjointDerivatives="true"/>'),
)  # fmt: skip
KICKED: Edits = (
    ('<Clock name="hit"', '<Clock name="kick" valueReference="102" causality="input" intervalVariability="triggered"/>'
     '<Clock name="hit"'),
)  # fmt: skip
RESIZED: Edits = (('causality="structuralParameter" variability="fixed"', 'causality="structuralParameter" '
                   'variability="tunable"'),)  # fmt: skip
SETTABLE: Edits = (('intervalVariability="constant"', 'intervalVariability="fixed"'),)
EXTENDED: dict[str, tuple[str, str, Edits]] = {
    # fault: interface, rule, and what the description has more
    "slope_refused": ("CoSimulation", "derivative.status", SLOPES),
    "slope_zero": ("CoSimulation", "derivative.value", SLOPES),
    "directional_refused": ("ModelExchange", "derivative.status", PARTIAL),
    "directional_wrong": ("ModelExchange", "derivative.value", PARTIAL),
    "adjoint_wrong": ("ModelExchange", "derivative.adjoint", PARTIAL),
    "kick_refused": ("CoSimulation", "run.status", KICKED),
    "reconfiguration_refused": ("CoSimulation", "configuration.status", RESIZED),
}


def _behaviour(fault: str, interface: str) -> Callable[[Path], object]:
    return lambda path: write_fmu(path, ball_files(fault, interface))


def _without_clocks(fault: str) -> Callable[[Path], object]:
    """Without clocks event mode need not be used."""
    text = ball_files()[XML].decode()
    text = re.sub(r"(?s)    <Clock.*?/>\n", "", text)
    text = re.sub(r'    <\w+ name="\w+"[^>]*clocks="100"[^>]*/>\n', "", text)
    text = re.sub(r'    <(Output|ClockedState) valueReference="(16|20|101)"/>\n', "", text)
    return lambda path: write_fmu(path, ball_files(fault) | {XML: text.encode()})


def _flags(fault: str, old: str, new: str) -> Callable[[Path], object]:
    def make(path: Path) -> None:
        files = ball_files("early_unflagged" if fault == "early_unflagged" else "")
        text = files[XML].decode().replace(old, new)
        text = text.replace('canReturnEarlyAfterIntermediateUpdate="true"', "")
        write_fmu(path, files | {XML: text.encode()})

    return make


def extended(fault: str, interface: str, edits: Edits) -> dict[str, bytes]:
    """The files of a ball with more in its description, and a fault (empty: none)."""
    files = ball_files(fault, interface)
    text = files[XML].decode()
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} must be in the description once"
        text = text.replace(old, new)
    return files | {XML: text.encode()}


def _extended(fault: str, interface: str, edits: Edits) -> Callable[[Path], object]:
    return lambda path: write_fmu(path, extended(fault, interface, edits))


def behavioural() -> list[Mutant]:
    """All faults of behaviour."""
    kinds = {
        "CoSimulation": CO_SIMULATION,
        "ModelExchange": MODEL_EXCHANGE,
        "ScheduledExecution": SCHEDULED_EXECUTION,
    }
    found = [
        Mutant(f"{interface} {fault}", rule, _behaviour(fault, interface))
        for interface, faults in kinds.items()
        for fault, rule in faults.items()
    ]
    found += [
        Mutant(f"CoSimulation {fault}", rule, _without_clocks(fault))
        for fault, rule in (("event_not_used", "event.not-used"), ("event_mode", "misuse.event-mode"))
    ]
    found += [
        Mutant(f"{interface} {fault}", rule, _extended(fault, interface, edits))
        for fault, (interface, rule, edits) in EXTENDED.items()
    ]
    return found + [Mutant(f"flags {n}", rule, _flags(n, old, new)) for n, (rule, old, new) in FLAGS.items()]
