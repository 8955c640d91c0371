"""Cells of a line of text, and what they are: numbers, times, truth values, words."""

import csv
import re

from orchestrator.records.stamps import is_stamp

TRUTHS = {"true": "1", "false": "0"}
_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")
_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|[+-]?(?i:nan|inf|infinity)")


def cells_of(line: str, separator: str) -> list[str]:
    """Return the stripped cells of a line; quotes are taken off.

    Args:
        line: of the file.
        separator: between cells; a blank stands for any run of blanks.

    Returns:
        The cells.
    """
    if separator == " ":
        return line.split()
    if '"' in line:
        try:
            return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
        except csv.Error:
            return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in line.split(separator)]


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with this decimal sign.

    Args:
        cell: its text.
        decimal: "." or ",".

    Returns:
        True when it is.
    """
    return (_COMMA if decimal == "," else _POINT).fullmatch(cell.strip()) is not None


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number, a truth value or a time.

    Args:
        cell: its text.
        decimal: "." or ",".

    Returns:
        True when it is.
    """
    return is_number(cell, decimal) or cell.lower() in TRUTHS or is_stamp(cell)


def is_word(cell: str) -> bool:
    """Return whether a cell is neither empty nor a number.

    Args:
        cell: its text.

    Returns:
        True when it is.
    """
    return bool(cell) and not is_number(cell, ".") and not is_number(cell, ",")
