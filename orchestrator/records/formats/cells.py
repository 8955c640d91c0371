"""Cells of a line of text, and what they are: numbers, times, truth values, words."""

import csv
import re

from orchestrator.records.stamps import is_stamp

TRUTHS = {"true": "1", "false": "0"}
MISSING = frozenset(("", "n/a", "na", "null", "none", "-", "--", "#n/a"))
# Minus signs and dashes that programs set in place of the hyphen.
DASHES = "\u2212\u2013\u2010\u2011"
# What is no number as C libraries print it, Microsoft's too: -nan(ind), nan(0x8000), 1.#QNAN0, -1.#IND00.
_NOT_A_NUMBER = r"nan(?:\([^()]*\))?|1[.,]#(?:qnan|snan|ind)0*"
_INFINITE = r"inf(?:inity)?|1[.,]#inf0*"
_SIGN = rf"[+\-{DASHES}]?"
_POINT = re.compile(rf"{_SIGN}(?:(?:\d+\.?\d*|\.\d+)(?:[eE]{_SIGN}\d+)?|(?i:{_NOT_A_NUMBER}|{_INFINITE}))")
_COMMA = re.compile(rf"{_SIGN}(?:(?:\d+,?\d*|,\d+)(?:[eE]{_SIGN}\d+)?|(?i:{_NOT_A_NUMBER}|{_INFINITE}))")
_SPECIAL = re.compile(rf"({_SIGN})(?:({_NOT_A_NUMBER})|{_INFINITE})")
# A whole number with a sign between its thousands, or a number with three decimals: the cells beside it tell.
GROUPED = re.compile(rf"{_SIGN}[1-9]\d{{0,2}}(?:[.,]\d{{3}})+")
SMALL = re.compile(rf"{_SIGN}(?:0|[1-9]\d{{0,2}})")  # whole and below a thousand
_HYPHENS = str.maketrans(dict.fromkeys(DASHES, "-"))


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


def is_missing(cell: str) -> bool:
    """Return whether a cell says that there is no value."""
    return cell.lower() in MISSING


def is_value(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number, a truth value or a time."""
    return is_number(cell, decimal) or cell.lower() in TRUTHS or is_stamp(cell)


def is_word(cell: str) -> bool:
    """Return whether a cell is neither empty nor a number."""
    return bool(cell) and not is_number(cell, ".") and not is_number(cell, ",")


def plain_signs(text: str) -> str:
    """Return a text with hyphens in place of typographic minus signs."""
    return text if text.isascii() else text.translate(_HYPHENS)


def plain_number(cell: str, decimal: str) -> str:
    """Return a cell as ``float`` reads it: nan where it says that there is no value; what is no number stays."""
    plain = plain_signs(cell.strip().lower())
    if plain in MISSING:
        return "nan"
    special = _SPECIAL.fullmatch(plain)
    if special is not None:
        return "nan" if special[2] else f"{special[1]}inf"
    return TRUTHS.get(plain, plain.replace(",", ".") if decimal == "," else plain)
