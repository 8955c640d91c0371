"""The map between a record and an FMU: which column is which variable, what is uncertain, where effects may act.

A map is TOML::

    [inputs]
    M_A = { column = "u", hold = "zero" }     # hold "linear": straight lines between samples, for sensed inputs
    [outputs]
    phiA = { column = "phi", noise = 2e-4 }   # noise: standard deviation; absent: estimated
    [parameters]
    "inertia.J" = { uncertainty = "5 %" }     # or a number in the parameter's unit
    [start]
    "inertia.phi" = { uncertainty = 0.02 }
    [ports.shaft]
    input = "M_B"                             # what effects at the port add to
    position = "phiA"                         # any readable variable
    velocity = "wA"                           # absent: differentiated; alone: a flow, such as a current
    [signals]
    warmth = { column = "T", reference = 20 }  # what parameters may depend on
    [cuts.coupling]                           # with a scenario of several FMUs
    input = "load.phi_in"                     # the position that one hands to another
    far = "load.phi"                          # the position beyond it: for a gap
    effort = "load.tau"                       # what goes through it: for a spring
    [options]
    tolerance = 1e-8                          # of the FMU's own solver
"""

import math
from pathlib import Path
from typing import Any

import msgspec

from orchestrator.diagnosis.fmu.subject import Subject
from orchestrator.errors import ScenarioError
from orchestrator.master.protocol import Unit, Value, Variable
from orchestrator.master.units import resolve
from orchestrator.master.values import typed_value
from orchestrator.records.model_file import ModelParameter

MAXIMUM_BYTES = 1 << 24


class InputEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An input that a column drives."""

    column: str = ""
    hold: str = "zero"
    factor: float = 1.0
    unit: str = ""


class OutputEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An output that a column measures."""

    column: str = ""
    noise: float | None = None
    factor: float = 1.0
    unit: str = ""


class ParameterEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A parameter, or a start value: where the record's own value differs, and how far it may be off."""

    value: float | bool | str | None = None
    uncertainty: str | float = 0.0


class PortEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A conjugate pair: an effort that is added to an input, and the motion or flow that it acts on.

    Where only a flow is known, such as a current, ``position`` of a checked map names it as well.
    """

    input: str
    position: str = ""
    velocity: str | None = None

    @property
    def flow_only(self) -> bool:
        """Whether the flow is all that is known: nothing can depend on a position."""
        return self.position == self.velocity


class SignalEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A column that parameters may depend on, and its value at which they are what the map says."""

    column: str = ""
    reference: float = 0.0
    factor: float = 1.0
    unit: str = ""


class CutEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A connection between two FMUs that carries a position: what lies beyond it, and what goes through it."""

    input: str
    far: str | None = None
    effort: str | None = None


class Options(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What else can be said."""

    tolerance: float | None = None
    time: str = "time"
    time_factor: float = 1.0
    """Seconds in a unit of that column: 1e-3 for milliseconds; 1: what the file states, else seconds."""
    header: int | None = None
    """Line of a text that holds the names, from 1; 0: there are none; None: found."""
    substeps: int = 4
    """Communication steps in a sample."""
    budget: float = 600.0
    """Seconds that a diagnosis may take."""


class MapFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A map, as it is written."""

    inputs: dict[str, InputEntry] = {}
    outputs: dict[str, OutputEntry] = {}
    parameters: dict[str, ParameterEntry] = {}
    start: dict[str, ParameterEntry] = {}
    ports: dict[str, PortEntry] = {}
    signals: dict[str, SignalEntry] = {}
    cuts: dict[str, CutEntry] = {}
    options: Options = Options()


class Map(msgspec.Struct, frozen=True):
    """A map that has been checked against its FMU.

    Attributes:
        inputs, outputs, ports, signals, cuts, options: as written, with columns filled in.
        uncertain: what is re-fitted.
        fixed: values by name of what is set and not re-fitted.
        tunable: those of what is re-fitted that their FMU says may change within a run.
        initial: those of what is re-fitted that one record begins with.
        source: file name, for messages.
        units: of inputs and outputs, where the FMU states them.
    """

    inputs: dict[str, InputEntry]
    outputs: dict[str, OutputEntry]
    ports: dict[str, PortEntry]
    uncertain: tuple[ModelParameter, ...]
    fixed: dict[str, Value]
    options: Options
    source: str
    signals: dict[str, SignalEntry] = {}
    cuts: dict[str, CutEntry] = {}
    tunable: tuple[str, ...] = ()
    initial: tuple[str, ...] = ()
    units: dict[str, Unit] = {}


def read_map(path: Path, subject: Subject) -> Map:
    """Read and check a map."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"`map` must be a readable file, but {path} is not: {error.strerror}") from None
    if len(data) > MAXIMUM_BYTES:
        raise ScenarioError(f"`map` must be at most {MAXIMUM_BYTES >> 20} MB, but {path} is larger")
    try:
        written = msgspec.toml.decode(data, type=MapFile)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: {error}") from None
    return checked(written, subject, str(path))


def checked(written: MapFile, subject: Subject, source: str) -> Map:
    """Check a map against an FMU, or several."""
    look = _Look(subject.model.variables, source)
    if not written.inputs:
        raise ScenarioError(f"{source}: $.inputs must name at least one input with a column, but names none")
    if not written.outputs:
        raise ScenarioError(f"{source}: $.outputs must name at least one output with a column, but names none")
    for name, given in written.inputs.items():
        look.up(f"$.inputs.{name}", name, ("input",))
        if given.hold not in ("zero", "linear"):
            raise ScenarioError(f'{source}: $.inputs.{name}.hold must be "zero" or "linear", but is {given.hold!r}')
        look.factor(f"$.inputs.{name}.factor", given.factor)
    for name, measured in written.outputs.items():
        look.up(f"$.outputs.{name}", name, ("output", "local", "input"))
        look.factor(f"$.outputs.{name}.factor", measured.factor)
        if measured.noise is not None and not 0.0 < measured.noise < math.inf:
            raise ScenarioError(f"{source}: $.outputs.{name}.noise must be positive, but is {measured.noise!r}")
    _check_ports(written, look)
    for name, signal in written.signals.items():
        look.factor(f"$.signals.{name}.factor", signal.factor)
        if not math.isfinite(signal.reference):
            raise ScenarioError(f"{source}: $.signals.{name}.reference must be finite, but is {signal.reference!r}")
    _check_connections(written, subject, look)
    if not 0.0 < written.options.time_factor < math.inf:
        raise ScenarioError(f"{source}: $.options.time_factor must be positive, but is {written.options.time_factor:g}")
    if written.options.header is not None and written.options.header < 0:
        raise ScenarioError(f"{source}: $.options.header must be a line, or 0, but is {written.options.header}")
    if not 1 <= written.options.substeps <= 1000:
        raise ScenarioError(f"{source}: $.options.substeps must be 1 to 1000, but is {written.options.substeps}")
    uncertain: list[ModelParameter] = []
    fixed: dict[str, Value] = dict(subject.given)
    for table, entries in (("parameters", written.parameters), ("start", written.start)):
        for name, entry in entries.items():
            if look.is_set(f"$.{table}.{name}", name, entry):
                fixed[name] = look.fixed(f"$.{table}.{name}", name, entry, subject.given.get(name))
                continue
            found = look.uncertain(f"$.{table}.{name}", name, entry, subject.given.get(name))
            if found.uncertainty > 0.0:
                uncertain.append(found)
                fixed.pop(name, None)
            else:
                fixed[name] = found.value
    return Map(
        {n: msgspec.structs.replace(e, column=e.column or n) for n, e in written.inputs.items()},
        {n: msgspec.structs.replace(e, column=e.column or n) for n, e in written.outputs.items()},
        {n: msgspec.structs.replace(e, position=e.position or e.velocity or "") for n, e in written.ports.items()},
        tuple(uncertain),
        fixed,
        written.options,
        source,
        {n: msgspec.structs.replace(e, column=e.column or n) for n, e in written.signals.items()},
        written.cuts,
        tuple(u.name for u in uncertain if subject.model.variables[u.name].variability == "tunable"),
        tuple(u.name for u in uncertain if u.name in written.start),
        units={
            name: resolve(text, subject.model.units)
            for name in (*written.inputs, *written.outputs)
            if (text := subject.model.variables[name].unit)
        },
    )


def _check_ports(written: MapFile, look: "_Look") -> None:
    """Refuse ports without a motion or flow, or of what is no input or output."""
    for name, port in written.ports.items():
        look.up(f"$.ports.{name}.input", port.input, ("input",))
        if not port.position and port.velocity is None:
            raise ScenarioError(
                f"{look.source}: $.ports.{name} must have `position`, `velocity` or both, but has neither"
            )
        if port.position:
            look.up(f"$.ports.{name}.position", port.position, ("output", "local"))
        if port.velocity is not None:
            look.up(f"$.ports.{name}.velocity", port.velocity, ("output", "local"))


def _check_connections(written: MapFile, subject: Subject, look: "_Look") -> None:
    """Refuse cuts where nothing is handed on, and inputs that are fed from elsewhere."""
    targets = {c.target for c in subject.connections}
    for name, cut in written.cuts.items():
        look.up(f"$.cuts.{name}.input", cut.input, ("input",))
        if cut.input not in targets:
            raise ScenarioError(
                f"{look.source}: $.cuts.{name}.input must be what one FMU of a scenario hands to another, but "
                f"{cut.input!r} is not connected"
            )
        if cut.far is None and cut.effort is None:
            raise ScenarioError(f"{look.source}: $.cuts.{name} must have `far`, `effort` or both, but has neither")
        for key, variable in (("far", cut.far), ("effort", cut.effort)):
            if variable is not None:
                look.up(f"$.cuts.{name}.{key}", variable, ("output", "local"))
    for name in subject.fed:
        if name not in written.inputs:
            raise ScenarioError(f"{look.source}: $.inputs must give {name!r} a column: the scenario feeds it")


class _Look:
    """Looks names up, and says where one is wrong."""

    def __init__(self, variables: Any, source: str) -> None:
        self._variables, self.source = variables, source

    def up(self, where: str, name: str, causalities: tuple[str, ...]) -> Variable:
        """Return a variable of type Real."""
        import difflib

        if name not in self._variables:
            near = difflib.get_close_matches(name, self._variables, 1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise ScenarioError(f"{self.source}: {where} must be a variable of the FMU, but {name!r} is not{hint}")
        variable: Variable = self._variables[name]
        if variable.type != "Real":
            raise ScenarioError(f"{self.source}: {where} must be of type Real, but is {variable.type}")
        if variable.causality not in causalities:
            wanted = " or ".join(causalities)
            raise ScenarioError(f"{self.source}: {where} must be of causality {wanted}, but is {variable.causality}")
        return variable

    def factor(self, where: str, factor: float) -> None:
        """Refuse a factor that cannot be one."""
        if not (math.isfinite(factor) and factor != 0.0):
            raise ScenarioError(f"{self.source}: {where} must be finite and not 0, but is {factor!r}")

    def is_set(self, where: str, name: str, entry: ParameterEntry) -> bool:
        """Whether a parameter is of a type that can be set, but not fitted."""
        variable = self._variables.get(name)
        if variable is None or variable.type == "Real":
            return False
        if entry.uncertainty not in (0.0, ""):
            raise ScenarioError(
                f"{self.source}: {where} must be of type Real to be fitted, but is {variable.type}: it can be set, "
                "with `value` and without `uncertainty`"
            )
        return True

    def fixed(self, where: str, name: str, entry: ParameterEntry, given: Value | None) -> Value:
        """Return the value of a parameter that is no Real."""
        variable: Variable = self._variables[name]
        value = next((v for v in (entry.value, given, variable.start) if v is not None), None)
        if value is None:
            raise ScenarioError(f"{self.source}: {where}.value must be given: the FMU states no start value")
        typed, text = typed_value(variable, value)
        if typed is None:
            raise ScenarioError(f"{self.source}: {where}.value {text}")
        return typed

    def uncertain(self, where: str, name: str, entry: ParameterEntry, given: Value | None) -> ModelParameter:
        """Return a parameter with its uncertainty as a number."""
        variable = self.up(where, name, ("parameter", "local", "output", "input"))
        value = next((v for v in (entry.value, given) if v is not None), variable.start)
        if isinstance(value, (bool, str)):
            raise ScenarioError(f"{self.source}: {where}.value must be a number, but is {value!r}")
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise ScenarioError(f"{self.source}: {where}.value must be given: the FMU states no start value")
        spread = _spread(f"{self.source}: {where}.uncertainty", entry.uncertainty, float(value))
        low = -math.inf if variable.minimum is None else float(variable.minimum)
        high = math.inf if variable.maximum is None else float(variable.maximum)
        if not low <= value <= high:
            raise ScenarioError(f"{self.source}: {where}.value must be {low:g} to {high:g}, but is {value:g}")
        return ModelParameter(name, float(value), spread, variable.unit or "", low, high)


def _spread(where: str, given: str | float, value: float) -> float:
    if isinstance(given, str):
        text = given.strip()
        try:
            share = float(text.removesuffix("%")) / 100.0
        except ValueError:
            share = -1.0
        if not text.endswith("%") or not 0.0 <= share < math.inf:
            raise ScenarioError(f'{where} must be a number or a share such as "5 %", but is {given!r}')
        if share > 0.0 and value == 0.0:
            raise ScenarioError(f"{where} must be a number where the value is 0, but is {given!r}")
        return share * abs(value)
    if not 0.0 <= given < math.inf:
        raise ScenarioError(f"{where} must be finite and not negative, but is {given!r}")
    return float(given)
