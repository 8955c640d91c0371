"""Messages of a logger of C with their arguments filled in, as ``printf`` would, without a library of C for it.

The logger of FMI 2.0 is variadic. A callback of ctypes is not; so it is declared with integer arguments and then with
floating point ones, as many as come in registers. Each conversion of the format takes the next of its
kind, which is where the calling convention of the platform puts it.
"""

import ctypes
import platform
import re
import sys
from collections.abc import Iterator, Sequence
from ctypes import c_char_p, c_double, c_int, c_size_t, c_void_p

_MOST_CONVERSIONS = 24
_LONGEST = 1000
_FIRST_PAGE = 4096  # no text lies below this address
_CONVERSION = re.compile(rb"%([-+ #0]*)(\*|\d+)?(?:\.(\*|\d+)?)?(hh|h|ll|l|q|j|z|t|L)?([a-zA-Z%])")
_BITS = {b"hh": 8, b"h": 16, None: 32, b"": 32}


def _registers() -> tuple[int, int]:
    """How many integer registers the variable part passes over, and how many doubles of it come in registers.

    Without such registers doubles travel as integers do: on Windows, and on macOS with ARM, where the variable part is
    on the stack alone.
    """
    if sys.platform == "win32":
        return 0, 0
    return (3, 0) if sys.platform == "darwin" and platform.machine() == "arm64" else (0, 8)


_PASSED_OVER, _DOUBLES = _registers()
LOGGER = ctypes.CFUNCTYPE(
    None, c_void_p, c_char_p, c_int, c_char_p, c_void_p,
    *(c_size_t,) * (_PASSED_OVER + _MOST_CONVERSIONS), *(c_double,) * _DOUBLES,
)  # fmt: skip
"""Type of the logger's callback: environment, instance, status, category, format's address, and the variable part."""


def fill_in(address: int, arguments: Sequence[int | float]) -> str:
    """Return the text of a message, whose format is at ``address``; 0 for none."""
    template = _text(address)
    words = iter([int(v) for v in arguments[_PASSED_OVER : _PASSED_OVER + _MOST_CONVERSIONS]])
    doubles = iter([float(v) for v in arguments[_PASSED_OVER + _MOST_CONVERSIONS :]])
    # The stack is shared: a double that found no register lies among the integers there.
    try:
        return _CONVERSION.sub(lambda m: _convert(m, words, doubles), template).decode("utf-8", "replace").strip()
    except (StopIteration, RuntimeError, ValueError, OverflowError):
        return template.decode("utf-8", "replace").strip()


def _convert(match: re.Match[bytes], words: Iterator[int], doubles: Iterator[float]) -> bytes:
    flags, width, precision, size, kind = match.groups()
    if kind == b"%":
        return b"%"
    if width == b"*":
        width = str(ctypes.c_int(next(words)).value).encode()
    if precision == b"*":
        precision = str(ctypes.c_int(next(words)).value).encode()
    form = "%" + (flags + (width or b"")).decode()
    if b"." in match[0]:
        form += "." + (precision or b"0").decode()
    if kind in b"eEfFgGaA":
        value = next(doubles, None)
        number = c_double.from_buffer_copy(c_size_t(next(words))).value if value is None else value
        return (number.hex() if kind in b"aA" else (form + kind.decode()) % number).encode()
    word = next(words)
    if kind == b"s":
        return (form.encode() + b"s") % _text(word)
    if kind == b"c":
        return bytes([word & 0xFF])
    if kind == b"p":
        return hex(word).encode()
    bits = _BITS.get(size, 64)
    integer = word & ((1 << bits) - 1)
    if kind in b"di" and integer >> (bits - 1):
        integer -= 1 << bits
    return ((form + ("d" if kind in b"diu" else kind.decode())) % integer).encode()


def _text(address: int | None) -> bytes:
    if not address or address < _FIRST_PAGE:
        return b"(null)" if address is not None else b""
    return ctypes.string_at(address)[:_LONGEST]
