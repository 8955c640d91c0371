"""Calls of a slave's functions by address, for loops that numba compiles; see ``NativeCalls``."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_WHOLE, _REAL, _STATUS, _BYTE = ir.IntType(64), ir.DoubleType(), ir.IntType(32), ir.IntType(8)


def _emit_call(builder: Any, address: Any, arguments: Any, kinds: Any) -> Any:
    kind = ir.FunctionType(_STATUS, kinds)
    return builder.call(builder.inttoptr(address, kind.as_pointer()), arguments)


def _transfer_code(typing: Any, address: Any, component: Any, references: Any, count: Any, values: Any) -> Any:
    """Call ``status f(component, references, count, values)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _emit_call(builder, arguments[0], arguments[1:], [_WHOLE] * 4)

    return types.int32(*[types.int64] * 5), generate


def _transfer_code_with_size(
    typing: Any, address: Any, component: Any, references: Any, count: Any, values: Any
) -> Any:
    """Call ``status f(component, references, count, values, count)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _emit_call(builder, arguments[0], [*arguments[1:], arguments[3]], [_WHOLE] * 5)

    return types.int32(*[types.int64] * 5), generate


def _step_code(typing: Any, address: Any, component: Any, time: Any, length: Any) -> Any:
    """Call ``status f(component, time, length, true)`` at ``address``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [_WHOLE, _REAL, _REAL, _STATUS]
        return _emit_call(builder, arguments[0], [*arguments[1:], _STATUS(1)], kinds)

    return types.int32(types.int64, types.int64, types.float64, types.float64), generate


def _step_code_with_report(typing: Any, address: Any, component: Any, time: Any, length: Any, report: Any) -> Any:
    """Call ``status f(component, time, length, true, event, end, early, reached)`` at ``address``.

    The four pointers are to bytes 0, 1, 2 and 8 of ``report``.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        report = arguments[4]
        pointers = [builder.add(report, _WHOLE(offset)) for offset in (0, 1, 2, 8)]
        kinds = [_WHOLE, _REAL, _REAL, _BYTE, *[_WHOLE] * 4]
        return _emit_call(builder, arguments[0], [*arguments[1:4], _BYTE(1), *pointers], kinds)

    return types.int32(types.int64, types.int64, types.float64, types.float64, types.int64), generate


call_transfer: Any = intrinsic(_transfer_code)
call_sized_transfer: Any = intrinsic(_transfer_code_with_size)
call_step: Any = intrinsic(_step_code)
call_reporting_step: Any = intrinsic(_step_code_with_report)
