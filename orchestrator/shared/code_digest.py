"""A digest of all that a compiled function is made of: its own code, and what its code reaches by name.

Two functions with one digest compile to the same machine code; a source, a constant or a function far below that
changes, changes the digest.
"""

import builtins
import dis
import hashlib
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher

_FIXED = ("math", "numpy")  # modules that change with their version only


def digest_of(function: FunctionType | Dispatcher) -> str | None:
    """Return a digest of a function and of everything that it calls or reads.

    Returns:
        64 hexadecimal digits, or None where it reaches something whose content is not known to stay.

    Examples:
        >>> scale = 2.0
        >>> def scaled(x: float) -> float:
        ...     return scale * x
        >>> before = digest_of(scaled)
        >>> scale = 3.0
        >>> digest_of(scaled) == before
        False
    """
    walk = _Walk()
    try:
        walk.value(function)
    except TypeError:
        return None
    return walk.digest.hexdigest()


class _Walk:
    """Goes once through all that a function reaches, in an order that only its content decides."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256(np.__version__.encode())
        self._met: dict[int, int] = {}

    def value(self, value: Any) -> None:
        """Add a value: a number, an array, a function."""
        if isinstance(value, Dispatcher):
            self._add("compiled", repr(sorted(value.targetoptions.items())))
            self.value(value.py_func)
        elif isinstance(value, FunctionType):
            self._function(value)
        elif isinstance(value, tuple):
            self._add("tuple", len(value))
            for entry in value:
                self.value(entry)
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
            self._add("array", value.dtype.str, value.shape)
            self.digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, ModuleType) and value.__name__ in _FIXED:
            self._add("module", value.__name__)
        elif isinstance(value, BuiltinFunctionType) and value.__module__ in (*_FIXED, "builtins"):
            self._add("builtin", value.__module__, value.__name__)
        elif value is None or isinstance(value, (bool, int, float, str, np.generic)):
            self._add(type(value).__name__, repr(value))
        elif isinstance(value, type) and value.__module__ == "builtins":  # float, int, range
            self._add("type", value.__name__)
        elif isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
            self._add("named tuple", value.__module__, value.__qualname__, *value._fields)
        else:
            raise TypeError(value)

    def _function(self, function: FunctionType) -> None:
        if id(function) in self._met:  # it calls itself, or was met before
            self._add("again", self._met[id(function)])
            return
        self._met[id(function)] = len(self._met)
        self._code(function.__code__, function)
        self.value(function.__defaults__ or ())
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            self._add("free", name)
            self.value(cell.cell_contents)

    def _code(self, code: CodeType, function: FunctionType) -> None:
        self._add("code", code.co_name, code.co_varnames, code.co_argcount, code.co_names)
        self.digest.update(code.co_code)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._code(constant, function)
            else:
                self.value(constant)
        for name in sorted({step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}):
            self._add("global", name)
            self.value(function.__globals__[name] if name in function.__globals__ else getattr(builtins, name))

    def _add(self, *parts: object) -> None:
        self.digest.update(f"{parts!r}\n".encode())
