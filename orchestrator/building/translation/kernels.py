"""Kernels in machine code: translated, compiled and loaded at their first call.

``Kernels("orchestrator.estimation.filter.kernel").run_free(...)`` calls the kernel ``run_free`` of that module. Its
library is that of the installation, else one that the user's cache keeps, else it is made there now. Arithmetic is
that of IEEE 754 in double precision without any shortcut (``machine_code.FLAGS``), so that all machines with the same
elementary functions compute the same bits, as plain Python does.
"""

import ctypes
import json
import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from orchestrator.building.translation.library import HEADERS, bind_module, library_stem, library_text
from orchestrator.errors import KernelError
from orchestrator.shared.cores import cache_once
from orchestrator.shared.machine_code import INSTALLED, compile_text, compiler_command, machine_code_folder

SPARE = 1024  # items behind an array of none, which an index that is refused may still read

_RAISED = {1: ValueError, 2: ValueError, 3: ZeroDivisionError, 4: OverflowError, 5: IndexError}
_NUMBERS = {"float": ctypes.c_double, "int": ctypes.c_int64, "bool": ctypes.c_bool}
_DTYPES = {"float": np.dtype(np.float64), "int": np.dtype(np.int64)}


class _Fault(ctypes.Structure):
    _fields_ = (("kind", ctypes.c_int), ("message", ctypes.c_char * 512))


class Kernels:
    """The kernels of a module, as attributes: functions of numbers and arrays of NumPy.

    Args:
        name: of the module, maybe bound to another, ``module[other]``.
        checked: arithmetic raises where Python does, such as a division by zero; else it goes on with infinities and
            NaN.
    """

    def __init__(self, name: str, checked: bool = False) -> None:
        self._name, self._checked = name, checked

    @cached_property
    def python(self) -> Any:
        """The module itself, in plain Python."""
        return bind_module(self._name)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        found = self.load()
        if name not in found:
            raise AttributeError(f"{self._name} offers no kernel {name}")
        self.__dict__[name] = found[name]
        return found[name]

    def load(self) -> dict[str, Callable[..., Any]]:
        """Return all kernels by name, compiled now if they are nowhere yet."""
        return load_library(self._name, self._checked)


@cache_once
def load_library(name: str, checked: bool) -> dict[str, Callable[..., Any]]:
    """Return the kernels of a module by name, compiled now if they are nowhere yet."""
    path = compile_text(library_stem(name, checked), lambda: library_text(name, checked), HEADERS, INSTALLED)
    if path is None:
        reason = "there is no C compiler: install one (gcc or clang), or `pip install ziglang`"
        if (words := compiler_command()) is not None:
            reason = f"`{' '.join(words)}` makes no library of its C text in {machine_code_folder()}"
        raise KernelError(f"{name} must be compiled, but {reason}")
    library = ctypes.CDLL(str(path))
    text = ctypes.string_at(ctypes.addressof(ctypes.c_char.in_dll(library, "kernels")))
    return {entry[0]: _Kernel(library, *entry).call for entry in json.loads(text)}


class _Parameter:
    def __init__(self, kernel: str, name: str, word: str, shape: list[int | None] | None, filled: bool) -> None:
        self.where, self.shape, self.filled = f"`{name}` of the kernel {kernel}", shape, filled
        self.dtype = _DTYPES.get(word)
        self.types = [_NUMBERS[word]] if shape is None else [ctypes.c_void_p, *[ctypes.c_int64] * len(shape)]

    def array(self, value: Any) -> Any:
        """Return an array as the kernel takes it; one that is filled must be so already."""
        if not self.filled:
            value = np.asarray(value)
            if value.dtype != self.dtype and not np.can_cast(value.dtype, self.dtype or value.dtype, "same_kind"):
                self._refuse(f"of {self.dtype}", f"of {value.dtype}")
            value = np.ascontiguousarray(value, dtype=self.dtype)
        elif not isinstance(value, np.ndarray) or value.dtype != self.dtype:
            self._refuse(f"an array of {self.dtype}", getattr(value, "dtype", type(value).__name__))
        elif not (value.flags.c_contiguous and value.flags.writeable):
            self._refuse("contiguous and writeable", "not")
        assert self.shape is not None
        if len(value.shape) != len(self.shape) or any(
            wanted not in (None, length) for wanted, length in zip(self.shape, value.shape, strict=True)
        ):
            wanted = ", ".join("n" if length is None else str(length) for length in self.shape)
            self._refuse(f"of shape ({wanted})", f"of {value.shape}")
        return value

    def _refuse(self, wanted: object, given: object) -> None:
        raise TypeError(f"{self.where} must be {wanted}, but is {given}")


class _Kernel:
    def __init__(self, library: ctypes.CDLL, name: str, returns: str, parameters: list[Any]) -> None:
        self._name = name
        self._parameters = [_Parameter(name, *parameter) for parameter in parameters]
        self._result = _NUMBERS.get(returns)
        self._function = getattr(library, f"call_{name}")
        self._function.argtypes = [
            *(kind for parameter in self._parameters for kind in parameter.types), ctypes.c_void_p, ctypes.c_void_p
        ]  # fmt: skip

    def call(self, *values: Any) -> Any:
        """Call it; numbers and arrays in the order of its parameters."""
        if len(values) != len(self._parameters):
            raise TypeError(f"{self._name} must be given {len(self._parameters)} arguments, but is given {len(values)}")
        arguments, kept = [], []
        for parameter, value in zip(self._parameters, values, strict=True):
            if parameter.shape is None:
                arguments.append(value)
                continue
            array = parameter.array(value)
            spared = array if array.size else np.zeros(max(SPARE, math.prod(n for n in array.shape if n)), array.dtype)
            kept += [array, spared]
            arguments += [spared.ctypes.data, *array.shape]
        fault = _Fault()
        result: Any = None if self._result is None else self._result()
        place = None if result is None else ctypes.byref(result)
        if kind := self._function(*arguments, place, ctypes.byref(fault)):
            raise _RAISED[kind](fault.message.decode())
        return None if result is None else result.value
