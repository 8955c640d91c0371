"""How the values of an FMU's variables are reached: by which functions, at which references, in which C types."""

import ctypes
from typing import Any, NamedTuple

FMI2_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
"""The C type of a value, by what FMI 2.0 calls the functions after that set and read it."""
FMI3_TYPES: dict[str, Any] = {
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
    "Int8": ctypes.c_int8,
    "UInt8": ctypes.c_uint8,
    "Int16": ctypes.c_int16,
    "UInt16": ctypes.c_uint16,
    "Int32": ctypes.c_int32,
    "UInt32": ctypes.c_uint32,
    "Int64": ctypes.c_int64,
    "UInt64": ctypes.c_uint64,
    "Boolean": ctypes.c_bool,
    "String": ctypes.c_char_p,
}
"""The same for FMI 3.0."""
FLOATS = (ctypes.c_double, ctypes.c_float)


class Access(NamedTuple):
    """Where one scalar value is."""

    kind: str  # what the functions that set and read it are called after: a key of ``FMI2_TYPES`` or ``FMI3_TYPES``
    reference: int  # value reference; of the whole array where it is an element of one
    element: int = 0  # place in the array
    size: int = 1  # number of the array's elements; 1: it is none


def whole_range(kind: str) -> tuple[int, int] | None:
    """Return the smallest and the largest number of a whole type of FMI 3.0, such as "UInt8"; None for others."""
    c_type = FMI3_TYPES.get(kind)
    if kind in {"Boolean", "String"} or c_type is None or c_type in FLOATS:
        return None
    bits = 8 * ctypes.sizeof(c_type)
    return (0, 2**bits - 1) if kind.startswith("U") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
