"""A model file to start from: every parameter, unit and comment, and what was assumed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.estimation.inspection.machine import ROUGH
from orchestrator.records.columns import COLUMNS, KINDS, Column
from orchestrator.records.formats import open_source
from orchestrator.records.formats.source import Head
from orchestrator.records.loading import choose_channels
from orchestrator.records.model_file import Model
from orchestrator.records.model_text import entry_texts
from orchestrator.records.units import parse_unit

ASSUMED_COUNTS = 4096.0
MACHINE_KEYS = (
    "counts_per_rev", "rated_value", "resistance", "torque_constant", "back_emf_constant", "inductance", "modulo",
    "sign_bit", "rate",
)  # fmt: skip
OF_DEFAULT = "of the thesis's drivetrain, whose gear ratio and inertia the record shows"
MEANING = {
    "J_m": "inertia of the motor",
    "J_l": "inertia of the load",
    "k": "stiffness of the shaft, at the load",
    "c": "damping of the shaft, at the load",
    "b_m": "viscous friction of the motor",
    "b_l": "viscous friction of the load",
    "i": "gear ratio: motor angle over load angle",
    "tau": "time constant of the drive's torque",
}


def assume_columns(
    path: Path, columns: Mapping[str, Column], header: int | None = None
) -> tuple[dict[str, Column], tuple[str, ...]]:
    """Return the columns with what their units still need, and a sentence on each assumption."""
    with open_source(path, header) as source:
        chosen = choose_channels(source, columns, str(path), torque_needed=False)
    filled, said = dict(columns), []
    for name, choice in chosen.items():
        column = filled.get(name, Column())
        head = source.heads[choice.place]
        unit = parse_unit(column.unit or head.unit, KINDS[name])
        kind = unit.kind if unit is not None else ""
        changed = column
        if kind == "counts" and column.counts_per_rev is None:
            changed = replace(column, counts_per_rev=ASSUMED_COUNTS)
            said.append(f"{ASSUMED_COUNTS:g} counts per revolution of {name}")
        elif kind == "share" and column.rated_value is None:
            changed = replace(column, rated_value=100.0)
            said.append(f"100 N.m at 100 % of {name}")
        elif kind == "current" and column.torque_constant is None:
            changed = replace(column, torque_constant=1.0)
            said.append(f"1 N.m per ampere of {name}")
        elif kind == "voltage" and (column.resistance is None or column.torque_constant is None):
            changed = replace(
                column, resistance=column.resistance or 1.0, torque_constant=column.torque_constant or 1.0
            )
            said.append(f"1 ohm and 1 N.m per ampere of {name}, in volts")
        if choice.numbered and column.rate is None and source.rate is None:
            changed = replace(changed, rate=1000.0)
            said.append("1000 samples per second")
        filled[name] = replace(changed, name=column.name or _column_title(head, choice.place))
        if not column.unit and head.unit and name != "time":
            filled[name] = replace(filled[name], unit=head.unit)
    return filled, tuple(said)


def _column_title(head: Head, place: int) -> str:
    return head.full or head.name or f"#{place + 1}"


def starter(
    model: Model, columns: Mapping[str, Column], origin: Mapping[str, str], assumed: Sequence[str], record: str
) -> str:
    """Return the text of a model file."""
    lines = [f"# A model of the machine that made {record}: look at every line that says ASSUMED or ROUGH.", ""]
    lines += [f'fmu = "{model.fmu}"']
    if model.header is not None:
        lines.append(f"header = {model.header}   # line of the record that holds the names")
    lines.append("")
    for name in COLUMNS:
        if name in columns:
            lines += [f"[columns.{name}]", *_column_lines(columns[name], assumed, name), ""]
    for name in ("theta_m", "theta_l"):
        if name in columns:
            lines += [f"# [encoders.{name}]", "# counts_per_rev = ...   # absent: found from the record"]
            lines += ["# noise = ...            # rad, before rounding; absent: estimated", ""]
    for name, said in origin.items():
        entry = model.parameters[name]
        share = entry.uncertainty / abs(entry.value) if entry.value else 0.0
        meaning = MEANING.get(name) or model.plant.table[list(model.parameters).index(name)].description
        lines += [f"[parameters.{name}]", f"value = {entry.value:.6g}   # {entry.unit or '1'}: {meaning}; {said}"]
        says = "off by at most this share; the fit finds the value" if share else "exact: the fit holds the value"
        lines += [f"relative_uncertainty = {share:.3g}   # {says}", ""]
    lines += _further(model, origin)
    return "\n".join(lines).rstrip() + "\n"


def _column_lines(column: Column, assumed: Sequence[str], name: str) -> list[str]:
    unit = "samples per second" if name == "time" else f" of {name}"
    mark = "   # ASSUMED: put in the drive's" if any(unit in text for text in assumed) else ""
    return [f"{key} = {text}{mark if key in MACHINE_KEYS else ''}" for key, text in entry_texts(column).items()]


def _further(model: Model, written: Mapping[str, str]) -> list[str]:
    """Return the parameters that are not ``written`` as comments: what the FMU has when nothing is said."""
    lines = ["# What the machine may have besides, as it stands in the model; `diagnose` finds which of them it has."]
    for name, entry in model.parameters.items():
        if name not in written:
            lines.append(f'# [parameters."{name}"]   value = {entry.value:g}   # {entry.unit or "1"}')
    return lines


__all__ = ["ROUGH", "assume_columns", "starter"]
