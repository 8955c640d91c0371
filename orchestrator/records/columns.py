"""Where a column of a record comes from, and its conversion to SI.

In all functions: ``values``: (n,), in the unit of the file.
"""

from collections.abc import Callable
from dataclasses import dataclass

from orchestrator.errors import RecordError
from orchestrator.records.units import SI, TURN, RecordUnit, parse_unit
from orchestrator.records.words import ANGLE, CURRENT, SPEED, TORQUE, VOLTAGE, words_of
from orchestrator.shared.arrays import Array

__all__ = ["COLUMNS", "KINDS", "SI", "Column"]

COLUMNS = ("time", "u", "theta_m", "theta_l")
OPTIONAL = ("theta_l",)
MEANINGS = {
    "time": "the time",
    "u": "the torque that the drive was asked for",
    "theta_m": "the motor's angle",
    "theta_l": "the load's angle",
}
# The kinds of unit that each column may come in; the first is what a column without a unit is taken to be.
KINDS = {
    "time": ("time",),
    "u": ("torque", "force", "share", "current", "voltage"),
    "theta_m": ("angle", "length", "counts", "speed", "velocity"),
    "theta_l": ("angle", "length", "counts", "speed", "velocity"),
}
EXAMPLES = {
    "time": "s, ms, us, min",
    "u": "N.m, mN.m, N.mm, lbf.in, N, % (with rated_value), A (with torque_constant), "
    "V (with resistance and torque_constant)",
    "theta_m": "rad, deg, rev, m, mm, counts (with counts_per_rev), rpm, rad/s",
}
EXAMPLES["theta_l"] = EXAMPLES["theta_m"]
# What a unit needs besides, by its kind: numbers of the column, what they make of one, what both are in words.
NEEDS: dict[str, tuple[tuple[str, ...], Callable[[float], float], str, str]] = {
    "counts": (("counts_per_rev",), lambda counts: TURN / counts, "counts", "counts of one revolution"),
    "share": (("rated_value",), lambda rated: 0.01 * rated, "percent", "what 100 % is, in N.m"),
    "current": (("torque_constant",), float, "amperes", "N.m per ampere"),
    "voltage": (
        ("resistance", "torque_constant"), lambda _: 1.0, "volts",
        "ohm, N.m per ampere; perhaps `back_emf_constant`, `inductance`",
    ),
}  # fmt: skip
# Kinds of unit that a number of a column is for, and the unit that a message proposes.
UNITS_OF = {
    "counts_per_rev": (("counts",), "counts"),
    "rated_value": (("share",), "%"),
    "resistance": (("voltage",), "V"),
    "back_emf_constant": (("voltage",), "V"),
    "inductance": (("voltage",), "V"),
    "torque_constant": (("current", "voltage"), "A"),
}


@dataclass(frozen=True)
class Column:
    """Where a column of a record comes from, and how its numbers become SI.

    The file's number times ``factor`` plus ``offset`` is the value in ``unit``.
    """

    name: str = ""  # name in the file, or ``#3`` for the third column; empty: the column's own name, or recognised
    unit: str = ""  # unit in the file; empty: what the file says, or SI
    factor: float = 1.0  # of the file's numbers; -1 turns a sign round
    offset: float = 0.0  # added after ``factor`` [unit]
    counts_per_rev: float | None = None  # counts of one revolution, for ``counts``
    rated_value: float | None = None  # what 100 % is [N.m or N], for ``%``
    torque_constant: float | None = None  # [N.m/A], for ``A`` and ``V``
    resistance: float | None = None  # of the winding [ohm], for ``V``
    back_emf_constant: float | None = None  # [V.s/rad], for ``V``; None: the torque constant, which is the same in SI
    inductance: float | None = None  # of the winding [H], for ``V``; None: none
    relative_uncertainty: float = 0.0  # of the scale of ``u``, as a share: of the torque constant, for instance
    # value at which an angle or a time starts again from zero [unit]; None: it does not. Of a torque what the file's
    # numbers have in addition, before ``factor``, where they are negative, such as 65536
    modulo: float | None = None
    # what the file's numbers have in addition where they are negative, such as 32768; None: nothing
    sign_bit: float | None = None
    rate: float | None = None  # samples per second, where the time is a sample number


def unit_of(name: str, column: Column, written: str, label: str, source: str) -> RecordUnit | None:
    """Return the unit of a column: the model file's, else the one ``written`` in the file; None: SI."""
    text = column.unit or written
    unit = parse_unit(text, KINDS[name])
    if not text:
        _check_word(name, column, label, source)
    if unit is None and text:
        raise RecordError(
            f"{source}: column `{label}` must be in a unit that is known ({EXAMPLES[name]}), but is in {text!r}: say "
            f'`[columns.{name}] unit = "..."` in the model file (`model`), with `factor` where none of these is it'
        )
    if unit is not None and unit.kind not in KINDS[name]:
        raise RecordError(
            f"{source}: column `{label}` must be {MEANINGS[name]} ({EXAMPLES[name]}), but is in {text!r}; name "
            f'another by `[columns.{name}] name = "..."`, or mend it by `unit`, in the model file (`model`)'
        )
    return unit


def check_numbers(name: str, column: Column, unit: RecordUnit | None, label: str, source: str) -> None:
    """Refuse numbers of a unit that the column is not in: nothing would use them."""
    kind = "" if unit is None else unit.kind
    for key, (kinds, text) in UNITS_OF.items():
        if getattr(column, key) is not None and kind not in kinds:
            shown = "has no unit" if unit is None else f"is in a unit of {kind}"
            raise RecordError(
                f"{source}: column `{label}` {shown}, but `[columns.{name}] {key}` is for {text}: say "
                f'`[columns.{name}] unit = "{text}"` in the model file (`model`), or leave `{key}` out'
            )


def _check_word(name: str, column: Column, label: str, source: str) -> None:
    """Refuse a column without a unit whose name says that it is not what the column's SI unit measures."""
    said = set(words_of(label))
    others = (("a current", CURRENT, "A"), ("a voltage", VOLTAGE, "V")) if name == "u" else (("a speed", SPEED, "rpm"),)
    if name == "time" or column.factor != 1.0 or said & (TORQUE - {"u"} if name == "u" else ANGLE - {"q"}):
        return
    for what, known, text in others:
        if said & known:
            si = SI[KINDS[name][0]]
            raise RecordError(
                f"{source}: column `{label}` must have a unit, as its name says that it is {what}: say "
                f'`[columns.{name}] unit = "{text}"`, or "{si}" where it is in {si}, in the model file (`model`)'
            )


def scale_of(name: str, column: Column, unit: RecordUnit | None, label: str, source: str) -> float:
    """Return the factor from the column's unit to SI."""
    if unit is None or unit.kind not in NEEDS:
        return 1.0 if unit is None else unit.factor
    _, worth, spoken, meaning = NEEDS[unit.kind]
    lacking = lacking_numbers(column, unit.kind)
    if lacking and unit.kind == "share" and unit.factor == 100.0:
        raise RecordError(
            f"{source}: column `{label}` has no dimension: say `[columns.{name}] rated_value = ...` (what 1 is, in "
            f'N.m), or `[columns.{name}] unit = "..."` where that is not so, in the model file (`model`)'
        )
    if lacking:
        said = " and ".join(f"`[columns.{name}] {key} = ...`" for key in lacking)
        raise RecordError(
            f"{source}: column `{label}` is in {spoken}: say {said} ({meaning}) in the model file (`model`)"
        )
    return unit.factor * worth(getattr(column, NEEDS[unit.kind][0][0]))


def lacking_numbers(column: Column, kind: str) -> list[str]:
    """Return the numbers that a unit of a kind needs and the column does not state."""
    return [key for key in NEEDS[kind][0] if getattr(column, key) is None] if kind in NEEDS else []


def scale_values(values: Array, factor: float, offset: float) -> Array:
    """Return ``values * factor + offset``: the values themselves where that is the same."""
    if factor == 1.0 and offset == 0.0:
        return values
    out = values * factor
    out += offset
    return out
