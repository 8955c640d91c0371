"""Cells of a line of text, and what they are: numbers, times, truth values, words."""

import csv
import re

from orchestrator.records.stamps import is_stamp

TRUTHS = {"true": "1", "false": "0"}
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")


def cells_of(line: str, separator: str) -> list[str]:
    """Return the stripped cells of a line; quotes are taken off."""
    if separator == " ":
        return line.split()
    if '"' in line:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
        except csv.Error:
            return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in line.split(separator)]


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with this decimal sign."""
    return (_COMMA if decimal == "," else _POINT).fullmatch(cell.strip()) is not None


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number, a truth value or a time."""
    return is_number(cell, decimal) or cell.lower() in TRUTHS or is_stamp(cell)


def is_word(cell: str) -> bool:
    """Return whether a cell is neither empty nor a number."""
    return bool(cell) and not is_number(cell, ".") and not is_number(cell, ",")
