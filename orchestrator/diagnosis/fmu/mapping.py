"""The map between a record and an FMU: which column is which variable, what is uncertain, where effects may act.

docs/any-fmu.md shows what a map says, as TOML.
"""

import math
from pathlib import Path
from typing import Any

import msgspec

from orchestrator.diagnosis.fmu.system import FmuSystem
from orchestrator.errors import ScenarioError
from orchestrator.master.protocol import Unit, Value, Variable
from orchestrator.master.units import unit_of
from orchestrator.master.values import coerce_value
from orchestrator.records.model_file import ModelParameter
from orchestrator.shared.toml_files import read_toml

MAXIMUM_BYTES = 1 << 24


class ColumnEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A column, and what its numbers are multiplied by, or its unit."""

    column: str = ""
    factor: float = 1.0
    unit: str = ""


class InputEntry(ColumnEntry, frozen=True):
    """An input that a column drives."""

    hold: str = "zero"


class OutputEntry(ColumnEntry, frozen=True):
    """An output that a column measures."""

    noise: float | None = None


class SignalEntry(ColumnEntry, frozen=True):
    """A column that parameters may depend on, and its value at which they are what the map says."""

    reference: float = 0.0


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


class Map(MapFile, frozen=True):
    """A map that has been checked against its FMU, with columns filled in."""

    uncertain: tuple[ModelParameter, ...] = ()  # what is re-fitted
    fixed: dict[str, Value] = {}  # values by name of what is set and not re-fitted
    source: str = ""  # file name, for messages
    tunable: tuple[str, ...] = ()  # those of what is re-fitted that their FMU says may change within a run
    initial: tuple[str, ...] = ()  # those of what is re-fitted that one record begins with
    units: dict[str, Unit] = {}  # of inputs and outputs, where the FMU states them


def read_map(path: Path, system: FmuSystem) -> Map:
    """Read a map, and check it against an FMU, or several."""
    try:
        written = msgspec.convert(read_toml(path, MAXIMUM_BYTES), type=MapFile)
    except msgspec.ValidationError as error:
        raise ScenarioError(f"{path}: {error}") from None
    return _MapCheck(written, system, str(path)).map()


class _MapCheck:
    """Looks up what a map names, and says where it is wrong."""

    def __init__(self, written: MapFile, system: FmuSystem, source: str) -> None:
        self._written, self._system, self._source = written, system, source
        self._variables = system.model.variables

    def map(self) -> Map:
        """Return the map, columns filled in."""
        written, source = self._written, self._source
        for table, entries in (("inputs", written.inputs), ("outputs", written.outputs)):
            self._require(bool(entries), f"$.{table} must name at least one {table[:-1]} with a column, but names none")
        self._check_columns()
        self._check_ports()
        self._check_connections()
        options = written.options
        self._require(0.0 < options.time_factor < math.inf,
                      f"$.options.time_factor must be positive, but is {options.time_factor:g}")  # fmt: skip
        self._require(options.header is None or options.header >= 0,
                      f"$.options.header must be a line, or 0, but is {options.header}")  # fmt: skip
        self._require(1 <= options.substeps <= 1000, f"$.options.substeps must be 1 to 1000, but is {options.substeps}")
        uncertain: list[ModelParameter] = []
        fixed: dict[str, Value] = dict(self._system.given)
        for table, parameters in (("parameters", written.parameters), ("start", written.start)):
            for name, entry in parameters.items():
                value = self._parameter(f"$.{table}.{name}", name, entry)
                if isinstance(value, ModelParameter) and value.uncertainty > 0.0:
                    uncertain.append(value)
                    fixed.pop(name, None)
                else:
                    fixed[name] = value.value if isinstance(value, ModelParameter) else value
        columns: dict[str, Any] = {
            table: _with_columns(getattr(written, table)) for table in ("inputs", "outputs", "signals")
        }
        ports = {
            n: msgspec.structs.replace(e, position=e.position or e.velocity or "") for n, e in written.ports.items()
        }
        units = {
            name: unit
            for name in (*written.inputs, *written.outputs)
            if (unit := unit_of(self._variables[name], self._system.model.units)) is not None
        }
        tunable = tuple(u.name for u in uncertain if self._variables[u.name].variability == "tunable")
        initial = tuple(u.name for u in uncertain if u.name in written.start)
        checked: dict[str, Any] = {
            "ports": ports,
            "cuts": written.cuts,
            "options": options,
            "uncertain": tuple(uncertain),
        }
        return Map(**columns, **checked, fixed=fixed, source=source, tunable=tunable, initial=initial, units=units)

    def _require(self, holds: bool, text: str) -> None:
        if not holds:
            raise ScenarioError(f"{self._source}: {text}")

    def _check_columns(self) -> None:
        for name, given in self._written.inputs.items():
            self._variable(f"$.inputs.{name}", name, ("input",))
            self._require(given.hold in ("zero", "linear"),
                          f'$.inputs.{name}.hold must be "zero" or "linear", but is {given.hold!r}')  # fmt: skip
        for name, measured in self._written.outputs.items():
            self._variable(f"$.outputs.{name}", name, ("output", "local", "input"))
            self._require(measured.noise is None or 0.0 < measured.noise < math.inf,
                          f"$.outputs.{name}.noise must be positive, but is {measured.noise!r}")  # fmt: skip
        for name, signal in self._written.signals.items():
            self._require(math.isfinite(signal.reference),
                          f"$.signals.{name}.reference must be finite, but is {signal.reference!r}")  # fmt: skip
        for table in ("inputs", "outputs", "signals"):
            for name, entry in getattr(self._written, table).items():
                self._require(math.isfinite(entry.factor) and entry.factor != 0.0,
                              f"$.{table}.{name}.factor must be finite and not 0, but is {entry.factor!r}")  # fmt: skip

    def _check_ports(self) -> None:
        """Refuse ports without a motion or flow, or of what is no input or output."""
        for name, port in self._written.ports.items():
            self._variable(f"$.ports.{name}.input", port.input, ("input",))
            self._require(bool(port.position) or port.velocity is not None,
                          f"$.ports.{name} must have `position`, `velocity` or both, but has neither")  # fmt: skip
            for key, variable in (("position", port.position or None), ("velocity", port.velocity)):
                if variable is not None:
                    self._variable(f"$.ports.{name}.{key}", variable, ("output", "local"))

    def _check_connections(self) -> None:
        """Refuse cuts where nothing is handed on, and inputs that are fed from elsewhere."""
        targets = {c.target for c in self._system.connections}
        for name, cut in self._written.cuts.items():
            self._variable(f"$.cuts.{name}.input", cut.input, ("input",))
            self._require(cut.input in targets, f"$.cuts.{name}.input must be what one FMU of a scenario hands to "
                          f"another, but {cut.input!r} is not connected")  # fmt: skip
            self._require(cut.far is not None or cut.effort is not None,
                          f"$.cuts.{name} must have `far`, `effort` or both, but has neither")  # fmt: skip
            for key, variable in (("far", cut.far), ("effort", cut.effort)):
                if variable is not None:
                    self._variable(f"$.cuts.{name}.{key}", variable, ("output", "local"))
        for name in self._system.fed:
            self._require(name in self._written.inputs, f"$.inputs must give {name!r} a column: the scenario feeds it")

    def _variable(self, where: str, name: str, causalities: tuple[str, ...]) -> Variable:
        """Return a variable of type Real."""
        import difflib

        if name not in self._variables:
            near = difflib.get_close_matches(name, self._variables, 1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise ScenarioError(f"{self._source}: {where} must be a variable of the FMU, but {name!r} is not{hint}")
        variable: Variable = self._variables[name]
        self._require(variable.type == "Real", f"{where} must be of type Real, but is {variable.type}")
        wanted = " or ".join(causalities)
        self._require(variable.causality in causalities,
                      f"{where} must be of causality {wanted}, but is {variable.causality}")  # fmt: skip
        return variable

    def _parameter(self, where: str, name: str, entry: ParameterEntry) -> ModelParameter | Value:
        """Return a parameter with its uncertainty as a number; the value alone of what is no Real, and not fitted."""
        variable = self._variables.get(name)
        given = (entry.value, self._system.given.get(name), None if variable is None else variable.start)
        value = next((v for v in given if v is not None), None)
        if variable is not None and variable.type != "Real":
            self._require(entry.uncertainty in (0.0, ""), f"{where} must be of type Real to be fitted, but is "
                          f"{variable.type}: it can be set, with `value` and without `uncertainty`")  # fmt: skip
            if value is None:
                raise ScenarioError(f"{self._source}: {where}.value must be given: the FMU states no start value")
            typed, text = coerce_value(variable, value)
            if typed is None:
                raise ScenarioError(f"{self._source}: {where}.value {text}")
            return typed
        variable = self._variable(where, name, ("parameter", "local", "output", "input"))
        self._require(not isinstance(value, (bool, str)), f"{where}.value must be a number, but is {value!r}")
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise ScenarioError(f"{self._source}: {where}.value must be given: the FMU states no start value")
        spread = _uncertainty(f"{self._source}: {where}.uncertainty", entry.uncertainty, float(value))
        low = -math.inf if variable.minimum is None else float(variable.minimum)
        high = math.inf if variable.maximum is None else float(variable.maximum)
        self._require(low <= value <= high, f"{where}.value must be {low:g} to {high:g}, but is {value:g}")
        return ModelParameter(name, float(value), spread, variable.unit or "", low, high)


def _with_columns(entries: dict[str, ColumnEntry]) -> dict[str, ColumnEntry]:
    """Return entries, each with the name of its variable as that of the column where it has none."""
    return {name: msgspec.structs.replace(entry, column=entry.column or name) for name, entry in entries.items()}


def _uncertainty(where: str, given: str | float, value: float) -> float:
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
