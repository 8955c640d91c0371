"""Calls of the subset in C: built-in and ``math`` functions, the source's own functions and methods."""

from __future__ import annotations

import ast
import builtins
import math
from typing import Any

from orchestrator.building.translation.array_items import array_length
from orchestrator.building.translation.building_tuples import tuple_built
from orchestrator.building.translation.constants import constant_value
from orchestrator.building.translation.definitions import Function
from orchestrator.building.translation.kinds import REAL, TRUTH, WHOLE, ArrayKind, Items, Kind, Tuple, describe, kind_of
from orchestrator.building.translation.scope import (
    NUMBERS,
    UNARY,
    Code,
    Scope,
    address_of,
    as_real,
    compound,
    convert,
    member,
    truth,
    value_of,
)

# Functions of `math` that return the C library's result, and whether they can raise.
_MATH = {
    **dict.fromkeys(("fabs", "copysign", "atan", "atan2", "tanh", "erf", "erfc"), False),
    **dict.fromkeys(("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "sinh", "cosh"), True),
}
_PAIRED = ("fabs", "copysign", "atan", "tanh", "sqrt", "exp", "log", "sin", "cos")
_ROUNDED = ("ceil", "floor")
_TESTS = ("isfinite", "isnan", "isinf")


def call(scope: Scope, node: ast.Call, wanted: Kind | None) -> Code:
    """Translate a call. Return the call, or what stands for it, in C."""
    if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name) and node.func.value.id == "self":
        return _method(scope, node, node.func.attr)
    target = _target(scope, node.func)
    if getattr(target, "__name__", "") == "_make" and hasattr(target.__self__, "_fields"):
        kind = kind_of(target.__self__)
        return convert(scope, node, tuple_built(scope, node, kind), kind)
    name = getattr(target, "__name__", "")
    if name and target is getattr(math, name, None):
        return _math(scope, node, name)
    if name and target is getattr(builtins, name, None):
        return _builtin(scope, node, name, wanted)
    if isinstance(target, type) and hasattr(target, "_fields"):
        return _construct(scope, node, target)
    if callable(target) and hasattr(target, "__wrapped__"):  # a cached function returns what the function returns
        target = target.__wrapped__
    if not hasattr(target, "__code__"):
        scope.refuse(node, f"`{ast.unparse(node.func)}` must be a function of the sources, of `math` or a built-in one")
    return invoke(scope, node, scope.program.function(scope.source, node, target))


def _target(scope: Scope, node: ast.expr) -> Any:
    if isinstance(node, ast.Name):
        if scope.source.has(node.id):
            return scope.source.value(node.id)
        return getattr(builtins, node.id, None)
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and scope.source.has(node.value.id):
        return getattr(scope.source.value(node.value.id), node.attr, None)
    return None


def _method(scope: Scope, node: ast.Call, name: str) -> Code:
    if scope.owner is None:
        scope.refuse(node, "only methods of a slave may call methods")
    return invoke(scope, node, scope.program.method(scope.source, node, name))


def invoke(scope: Scope, node: ast.Call, function: Function) -> Code:
    """Return the call of a translated function."""
    arguments = _order_arguments(scope, node, function)
    texts = ["self"] if function.owned else []
    for (name, kind), argument in zip(function.parameters, arguments, strict=True):
        texts.append(_pass_argument(scope, argument, kind, name in function.mutated, name in function.by_address))
    if function.faults:
        texts.append(scope.fault())
    return Code(f"{function.c}({', '.join(texts)})", function.returns)


def _order_arguments(scope: Scope, node: ast.Call, function: Function) -> list[ast.expr]:
    names = [name for name, _ in function.parameters]
    given: dict[str, ast.expr] = dict(zip(names, node.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg}
    filled = {**function.defaults, **given}
    starred = any(isinstance(argument, ast.Starred) for argument in node.args)
    if starred or any(k.arg is None for k in node.keywords) or len(node.args) > len(names) or set(filled) != set(names):
        scope.refuse(node, f"`{function.name}` must be called with its {len(names)} arguments, each by itself")
    return [filled[name] for name in names]


def _pass_argument(scope: Scope, node: ast.expr, kind: Kind, mutated: bool, by_address: bool) -> str:
    code = scope.expression(node, kind)
    if isinstance(kind, ArrayKind) and mutated:
        scope.note_mutation(node)
    if not isinstance(kind, Items) and not by_address:
        return code.text
    if mutated:
        scope.note_mutation(node)
    if not code.place and not code.address:
        code = scope.hoist(node, code, "items")
    return address_of(code)


def _math(scope: Scope, node: ast.Call, name: str) -> Code:
    codes = [scope.expression(argument, REAL) for argument in node.args]
    if name in (*_TESTS, *_ROUNDED):  # which are the same for all derivatives
        codes = [value_of(scope, code) for code in codes]
    arguments = ", ".join(code.text for code in codes)
    if name in _TESTS:
        return Code(f"{name}({arguments})", TRUTH)
    if name in _ROUNDED:
        return Code(f"checked_{name}({arguments}, {scope.fault()})", WHOLE)
    if name not in _MATH:
        scope.refuse(node, f"`math.{name}` is outside the subset ({', '.join((*_MATH, *_ROUNDED, *_TESTS))})")
    if scope.program.paired and name not in _PAIRED:
        scope.refuse(node, f"`math.{name}` has no derivative here ({', '.join(_PAIRED)} have)")
    if scope.program.paired:
        return Code(f"pair_{name}({arguments}{f', {scope.fault()}' if _MATH[name] else ''})", REAL)
    if _MATH[name] and scope.program.checked:
        return Code(f"checked_{name}({arguments}, {scope.fault()})", REAL)
    return Code(f"{name}({arguments})", REAL)


def _builtin(scope: Scope, node: ast.Call, name: str, wanted: Kind | None) -> Code:
    if name == "tuple":
        return tuple_built(scope, node, wanted)
    if name == "float" and len(node.args) == 1 and isinstance(node.args[0], ast.Constant):
        text = str(node.args[0].value)
        if text in ("nan", "inf"):
            number = Code("(double)NAN" if text == "nan" else "(double)INFINITY", REAL, UNARY)
            return Code(f"pair_of({number.text})", REAL) if scope.program.paired else number
    codes = [scope.expression(argument) for argument in node.args]
    if name in ("min", "max") and len(codes) > 1 and all(code.kind in NUMBERS for code in codes):
        if any(code.kind == REAL for code in codes):
            codes = [as_real(scope, code) for code in codes]
        paired = scope.program.paired and codes[0].kind == REAL
        return _extreme(f"{'pair_' if paired else ''}{'lesser' if name == 'min' else 'greater'}", codes)
    if len(codes) == 1:
        found = _call_of_one_argument(scope, name, codes[0])
        if found is not None:
            return found
    return scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset")


def _extreme(function: str, codes: list[Code]) -> Code:
    whole = all(code.kind == WHOLE for code in codes)
    text = codes[0].text
    for code in codes[1:]:
        text = f"{function}{'_whole' if whole else ''}({text}, {code.text})"
    return Code(text, WHOLE if whole else REAL)


def _call_of_one_argument(scope: Scope, name: str, code: Code) -> Code | None:
    if name == "len":
        return _length(scope, code)
    if name == "bool":
        return truth(value_of(scope, code))
    if code.kind not in (*NUMBERS, TRUTH):
        return None
    if name == "abs" and code.kind in NUMBERS:
        real = "pair_fabs" if scope.program.paired else "fabs"
        return Code(f"{real if code.kind == REAL else 'whole_magnitude'}({code.text})", code.kind)
    if name == "float":
        if scope.program.paired:
            return as_real(scope, code)
        return code if code.kind == REAL else Code(f"(double){code.within(UNARY)}", REAL, UNARY)
    if name == "int":
        if code.kind == REAL:
            return Code(f"truncated({value_of(scope, code).text}, {scope.fault()})", WHOLE)
        return Code(f"(int64_t){code.within(UNARY)}" if code.kind == TRUTH else code.text, WHOLE, UNARY)
    return None


def _length(scope: Scope, code: Code) -> Code | None:
    if isinstance(code.kind, Items):
        return Code(f"{member(code)}n", WHOLE)
    if isinstance(code.kind, Tuple):
        return Code(str(len(code.kind.items)), WHOLE)
    if isinstance(code.kind, ArrayKind):
        return array_length(code, 0)
    return None


def _construct(scope: Scope, node: ast.Call, target: Any) -> Code:
    kind = kind_of(target)
    assert isinstance(kind, Tuple)
    given: dict[str, ast.expr] = dict(zip(kind.names, node.args, strict=False))
    given |= {keyword.arg: keyword.value for keyword in node.keywords if keyword.arg}
    if set(given) != set(kind.names):
        scope.refuse(node, f"`{target.__name__}` must be given {', '.join(kind.names)}")
    parts = [scope.expression(given[name], item) for name, item in zip(kind.names, kind.items, strict=True)]
    if scope.program.paired and not all(part.plain or part.kind != REAL for part in parts):
        scope.refuse(node, "a NamedTuple must be made of parameters where derivatives are taken: it holds none")
    return compound(scope, kind, ", ".join(part.plain or part.text for part in parts))


def message(scope: Scope, node: ast.expr) -> str:
    """Return the arguments by which the C runtime formats a text: a format, then values."""
    parts = node.values if isinstance(node, ast.JoinedStr) else [node]
    text, values = "", []
    for part in parts:
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            text += part.value.replace("%", "%%")
        elif isinstance(part, ast.FormattedValue):
            letter, found = _format_part(scope, part)
            text += letter
            values += found
        else:
            scope.refuse(node, "a message must be a string or an f-string")
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return ", ".join([f'"{escaped}"', *values])


def _format_part(scope: Scope, part: ast.FormattedValue) -> tuple[str, list[str]]:
    value = constant_value(scope, part.value)
    if isinstance(value, str):
        return value.replace("%", "%%"), []
    code = value_of(scope, scope.expression(part.value))
    spec = ast.unparse(part.format_spec).strip("f'\"") if part.format_spec else ""
    if code.kind == WHOLE and not spec:
        return "%i", [code.text]
    if code.kind == REAL and spec in ("", "g"):
        return ("%g" if spec else "%r"), [code.text]
    if isinstance(code.kind, Tuple) and code.kind.uniform and code.kind.items[0] == REAL and not spec:
        count = len(code.kind.items)
        if not code.place:
            code = scope.hoist(part, code, "shown")
        return "%t", [f"{member(code)}v", str(count)]
    return scope.refuse(part, f"`{ast.unparse(part.value)}` ({describe(code.kind)}) cannot be put into a message so")
