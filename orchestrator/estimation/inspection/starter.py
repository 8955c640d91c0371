"""A model file to start from: every parameter, unit and comment, and what was assumed."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.plain_text import plain_text
from orchestrator.records.columns import COLUMNS, KINDS, Column, lacking_numbers
from orchestrator.records.formats import open_source
from orchestrator.records.formats.source import Head
from orchestrator.records.loading import choose_channels
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.model_text import entry_texts
from orchestrator.records.preview import preview_log
from orchestrator.records.units import parse_unit

# What the unit of a column needs where nothing is stated, by its kind; and the sentence that says so.
ASSUMED: Mapping[str, tuple[Mapping[str, Any], str]] = {
    "counts": ({"counts_per_rev": 4096.0}, "4096 counts per revolution of {}"),
    "share": ({"rated_value": 100.0}, "100 N.m at 100 % of {}"),
    "current": ({"torque_constant": 1.0}, "1 N.m per ampere of {}"),
    "voltage": ({"resistance": 1.0, "torque_constant": 1.0}, "1 ohm and 1 N.m per ampere of {}, in volts"),
}
OF_DEFAULT = "of the thesis's drivetrain, whose gear ratio and inertia the record shows"
# What says of an assumption that the scale of a signal hangs on it.
SCALES = ("counts per revolution", "N.m at 100 %", "N.m per ampere", "samples per second")
# What a number of a column is, and where a data sheet has it.
SHEET = {
    "counts_per_rev": "counts per turn; encoder: resolution; a quadrature encoder has 4 counts per line",
    "rated_value": "what 100 % is, N.m; drive: rated or reference torque",
    "torque_constant": "N.m/A at the motor; motor: torque constant kT, per rms ampere if the log has those",
    "resistance": "ohm; motor: winding resistance, phase to phase",
    "back_emf_constant": "V.s/rad; motor: back-EMF constant, volts per 1000 rpm divided by 104.7",
    "inductance": "H; motor: winding inductance, phase to phase",
    "modulo": "counts after which the counter starts again from zero",
    "sign_bit": "what negative numbers have in addition",
    "rate": "samples per second; drive: sample time of the trace",
}
# What a parameter of a drivetrain is, and where a data sheet has it.
MEANING = {
    "J_m": "inertia of the motor; motor: rotor inertia, and that of gearbox and coupling at the motor's shaft",
    "J_l": "inertia of the load; mass times radius squared, or the machine's CAD",
    "k": "stiffness of the shaft, at the load; gearbox: torsional rigidity, N.m/arcmin times 3438",
    "c": "damping of the shaft, at the load; in no data sheet: 1 to 5 % of critical damping is usual",
    "b_m": "viscous friction of the motor; motor: no-load torque over speed",
    "b_l": "viscous friction of the load; in no data sheet",
    "i": "gear ratio: motor angle over load angle; gearbox: ratio",
    "tau": "time constant of the drive's torque; drive: 1/(2 pi bandwidth of the current loop), 0.5 to 5 ms of a servo",
}
UNCERTAIN = {"i": 0.0, "c": 0.3, "b_m": 0.3, "b_l": 0.3}  # relative, where a data sheet is not good to 5 %
DRAFT_LAG = 0.002  # s, of the current loop of a servo drive
EXAMPLES = {"u": "A", "theta_m": "counts", "theta_l": "counts"}
UNIT_KINDS = {"u": "current", "theta_m": "counts", "theta_l": "counts", "time": "time"}


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
        numbers, sentence = ASSUMED.get(unit.kind if unit is not None else "", ({}, ""))
        filling = {key: value for key, value in numbers.items() if getattr(column, key) is None}
        changed = replace(column, **filling)
        said += [sentence.format(name)] if filling else []
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
    """Return the text of a model file; values that hang on assumed numbers of the columns are comments."""
    lines = [f"# A model of the machine that made {record}: look at every line that says ASSUMED or ROUGH.", ""]
    hanging = any(unit in text for unit in SCALES for text in assumed)
    lines += [f'fmu = "{model.fmu}"']
    if model.header is not None:
        lines.append(f"header = {model.header}   # line of the record that holds the names")
    lines.append("")
    for name in COLUMNS:
        if name in columns:
            lines += [f"[columns.{name}]", *_column_lines(columns[name], assumed, name), ""]
        elif name == "u":
            lines += ["# [columns.u]   # the log shows no torque; if it has one, name the column of torque or current"]
            lines += ['# name = "..."', ""]
    for name in ("theta_m", "theta_l"):
        if name in columns:
            lines += [f"# [encoders.{name}]", "# counts_per_rev = ...   # absent: found from the record"]
            lines += ["# noise = ...            # rad, before rounding; absent: estimated", ""]
    if hanging:
        lines += [
            "# First put in the ASSUMED numbers of the columns, and inspect the log again with this file as its model.",
            "# That replaces the parameters below, which follow from these numbers and are comments until then.", "",
        ]  # fmt: skip
    for name, said in origin.items():
        mark = "# " if hanging and name not in model.stated else ""
        entry = model.parameters[name]
        share = entry.uncertainty / abs(entry.value) if entry.value else 0.0
        meaning = MEANING.get(name) or model.plant.table[list(model.parameters).index(name)].description
        says = "off by at most this share; the fit finds the value" if share else "exact: the fit holds the value"
        lines += [
            f"# {meaning}", f"{mark}[parameters.{name}]",
            f"{mark}value = {entry.value:.6g}   # {entry.unit or '1'}; {said}",
            f"{mark}relative_uncertainty = {share:.3g}   # {says}",
        ]  # fmt: skip
        if "ASSUMED" in said or "ROUGH" in said or entry.assumed:
            lines.append(f"{mark}assumed = true   # no result is doubted for this value; leave it out with your own")
        lines.append("")
    lines += ["# Effects such as friction, gravity or a torque limit: `diagnose` finds which of them the machine has."]
    return "\n".join(lines).rstrip() + "\n"


def _column_lines(column: Column, assumed: Sequence[str], name: str) -> list[str]:
    unit = "samples per second" if name == "time" else f" of {name}"
    mark = "ASSUMED: put in the drive's; " if any(unit in text for text in assumed) else ""
    return [
        f"{key} = {text}{f'   # {mark}{SHEET[key]}' if key in SHEET else ''}"
        for key, text in entry_texts(column).items()
    ]


def blank_starter(path: Path, columns: Mapping[str, Column], header: int | None, problem: str) -> str:
    """Return the text of a model file for a log that is refused: what is known of its columns, and blanks.

    Args:
        path: of a log, of any format.
        columns: what is stated of its columns.
        header: line of the names of a text; see ``preview_log``.
        problem: why it is refused, in one line.

    Raises:
        RecordError: the file is no log at all.
    """
    seen = preview_log(path, columns, header)
    labels = [channel.label for channel in seen.channels]
    lines = [
        f"# A model of the machine that made {plain_text(path.name)}, with blanks. The log was refused:",
        f"# {plain_text(problem)}",
        "# Fill in the blanks of the columns and delete the `#` before them. Then inspect the log again with this",
        "# file as its model: parameters that you leave out are proposed.\n",
        f'fmu = "Drivetrain"\n\n# Columns of the log: {plain_text(", ".join(labels)) or "none were found"}\n',
    ]
    for taken in seen.columns:
        stated = columns.get(taken.column, Column())
        name = labels[taken.place] if taken.place is not None else stated.name
        unknown = taken.unit if taken.unit and not taken.kind else ""
        column = replace(stated, name=name, unit="" if unknown or taken.column == "time" else taken.unit)
        lines += [f"[columns.{taken.column}]   # {taken.meaning}", *_column_lines(column, (), taken.column)]
        if not name:
            lines.append('# name = ""   # FILL IN: the column of the log')
        if not column.unit and taken.column != "time":
            lines.append(
                f'# unit = "{EXAMPLES[taken.column]}"   # FILL IN{f"; {unknown!r} is not known" * bool(unknown)}'
            )
        needs = taken.needs or (() if column.unit else lacking_numbers(Column(), UNIT_KINDS[taken.column]))
        lines += [*(f"# {key} =    # FILL IN: {SHEET[key]}" for key in needs if getattr(column, key) is None), ""]
    model = read_model(None)
    lines.append("[parameters]   # of the data sheets")
    for name, meaning in MEANING.items():
        value, share = DRAFT_LAG if name == "tau" else "", UNCERTAIN.get(name, 0.05)
        entry = f"{name} = {{ value = {value}, relative_uncertainty = {share} }}"
        lines.append(f"# {entry}   # {model.parameters[name].unit or '1'}; FILL IN: {meaning}")
    return "\n".join(lines).rstrip() + "\n"
