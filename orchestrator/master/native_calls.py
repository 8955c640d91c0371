"""Calls of an FMU's functions by address, for loops that numba compiles."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


def _transfer_code(typing: Any, address: Any, component: Any, references: Any, count: Any, values: Any) -> Any:
    """Call ``status f(component, references, count, values)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        kind = ir.FunctionType(ir.IntType(32), [whole, whole, whole, whole])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    return types.int32(types.int64, types.int64, types.int64, types.int64, types.int64), generate


def _step_code(typing: Any, address: Any, component: Any, time: Any, length: Any) -> Any:
    """Call ``status f(component, time, length, true)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        real, flag = ir.DoubleType(), ir.IntType(32)
        kind = ir.FunctionType(ir.IntType(32), [ir.IntType(64), real, real, flag])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(function, [*arguments[1:], flag(1)])

    return types.int32(types.int64, types.int64, types.float64, types.float64), generate


call_transfer: Any = intrinsic(_transfer_code)
call_step: Any = intrinsic(_step_code)
