"""Expressions of the subset in C."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from typing import Any

from orchestrator.building.translation.array_items import array_item, array_length, index_within, quotient
from orchestrator.building.translation.calls import call
from orchestrator.building.translation.constants import axis_of, constant_value, interval
from orchestrator.building.translation.kinds import REAL, TRUTH, WHOLE, ArrayKind, Items, Kind, Store, Tuple, describe
from orchestrator.building.translation.scope import (
    AND,
    EQUALITY,
    NUMBERS,
    OR,
    PRIMARY,
    PRODUCT,
    RELATION,
    SUM,
    TERNARY,
    UNARY,
    Code,
    Scope,
    address_of,
    as_real,
    compound,
    constant_pair,
    convert,
    join_kinds,
    member,
    part_of,
    value_of,
)

_ARITHMETIC: dict[type, tuple[str, int]] = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
_PAIRED: dict[type, str] = {ast.Add: "pair_sum", ast.Sub: "pair_difference", ast.Mult: "pair_product"}
_COMPARED: dict[type, tuple[str, int]] = {
    ast.Eq: ("==", EQUALITY),
    ast.NotEq: ("!=", EQUALITY),
    ast.Lt: ("<", RELATION),
    ast.LtE: ("<=", RELATION),
    ast.Gt: (">", RELATION),
    ast.GtE: (">=", RELATION),
}


def expression(scope: Scope, node: ast.expr, wanted: Kind | None = None) -> Code:
    """Translate an expression; ``wanted`` is the kind to which it is converted, if that is known."""
    handler = _HANDLERS.get(type(node))
    if handler is None:
        scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset")
    code = handler(scope, node, wanted)
    return code if wanted is None else convert(scope, node, code, wanted)


def constant(scope: Scope, value: Any, node: ast.AST, name: str = "") -> Code:
    """Return a number that Python knows already, by its name where it has one."""
    if isinstance(value, bool):
        return Code("true" if value else "false", TRUTH)
    if not isinstance(value, int | float) or not math.isfinite(value):
        scope.refuse(node, f"`{name or value}` must be a finite number, but is {value!r}")
    kind = WHOLE if isinstance(value, int) else REAL
    text = scope.program.constant(scope.source, name, value) if name else repr(value)
    scope.constants.add(text)
    if scope.program.paired and kind == REAL:
        return constant_pair(text)
    return Code(text, kind, UNARY if value < 0 and not name else PRIMARY)


def _literal(scope: Scope, node: ast.Constant, wanted: Kind | None) -> Code:
    return constant(scope, node.value, node)


def _name(scope: Scope, node: ast.Name, wanted: Kind | None) -> Code:
    if node.id in scope.kinds:
        text = scope.local(node.id)
        if node.id in scope.pointers:
            return Code(f"*{text}", scope.kinds[node.id], UNARY, place=True)
        return Code(text, scope.kinds[node.id], place=True)
    value = constant_value(scope, node)
    if value is None:
        scope.refuse(node, f"`{node.id}` has no value here")
    if isinstance(value, tuple):
        return _constant_tuple(scope, value, node)
    return constant(scope, value, node, node.id)


def _constant_tuple(scope: Scope, value: tuple[Any, ...], node: ast.AST) -> Code:
    parts = [constant(scope, item, node) for item in value]
    return compound(scope, Tuple(tuple(part.kind for part in parts)), ", ".join(part.text for part in parts))


def _attribute(scope: Scope, node: ast.Attribute, wanted: Kind | None) -> Code:
    if isinstance(node.value, ast.Name) and node.value.id == "self" and scope.owner is not None:
        return _attribute_of_self(scope, node)
    value = constant_value(scope, node)
    if value is not None:
        return constant(scope, value, node, node.attr)
    base = scope.expression(node.value)
    if isinstance(base.kind, Tuple) and node.attr in base.kind.names:
        return part_of(scope, base, base.kind.names.index(node.attr))
    return scope.refuse(node, f"`{ast.unparse(node)}` has no value here")


def _attribute_of_self(scope: Scope, node: ast.Attribute) -> Code:
    assert scope.owner is not None
    if node.attr in ("real", "integer"):
        return Code(f"self->{node.attr}", Store(node.attr, scope.owner.variables))
    kind = scope.owner.attributes.get(node.attr)
    if kind is not None:
        return Code(f"self->{scope.program.attribute_name(node.attr)}", kind, place=True)
    value = getattr(scope.owner.cls, node.attr, None)
    if isinstance(value, int | float):
        return constant(scope, value, node)
    return scope.refuse(node, f"`self.{node.attr}` must be declared in the class with its type (hidden state)")


def _binary(scope: Scope, node: ast.BinOp, wanted: Kind | None) -> Code:
    if isinstance(node.left, ast.List) and isinstance(node.op, ast.Mult):
        scope.refuse(node, "a list of equal items must be assigned to a variable of declared type")
    if isinstance(node.op, ast.Pow):
        return _power(scope, node)
    left, right = (scope.expression(operand) for operand in (node.left, node.right))
    for code in (left, right):
        if code.kind not in NUMBERS:
            scope.refuse(node, f"arithmetic must be of numbers, but one is {describe(code.kind)}")
    both_whole = left.kind == WHOLE and right.kind == WHOLE
    if scope.program.paired and not both_whole and type(node.op) in _PAIRED:
        return _combine_pairs(type(node.op), as_real(scope, left), as_real(scope, right))
    if type(node.op) in _ARITHMETIC:
        sign, level = _ARITHMETIC[type(node.op)]
        text = f"{left.within(level)} {sign} {right.within(level + 1)}"
        return Code(text, WHOLE if both_whole else REAL, level)
    if isinstance(node.op, ast.Div):
        return _translate_division(scope, node, left, right)
    if isinstance(node.op, ast.FloorDiv | ast.Mod) and both_whole:
        function = "floor_divided" if isinstance(node.op, ast.FloorDiv) else "remainder_of"
        return Code(f"{function}({left.text}, {right.text}, {scope.fault()})", WHOLE)
    return scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset")


def _combine_pairs(op: type[ast.operator], left: Code, right: Code) -> Code:
    """Return a sum, difference or product of pairs; what is constant has no derivative to compute."""
    if left.plain and right.plain:
        return constant_pair(f"(({left.plain}) {_ARITHMETIC[op][0]} ({right.plain}))")
    if op is ast.Mult and (left.plain or right.plain):
        plain, other = (left.plain, right) if left.plain else (right.plain, left)
        return Code(f"pair_scaled({plain}, {other.text})", REAL)
    return Code(f"{_PAIRED[op]}({left.text}, {right.text})", REAL)


def _translate_division(scope: Scope, node: ast.BinOp, left: Code, right: Code) -> Code:
    if scope.program.paired:
        left, right = as_real(scope, left), as_real(scope, right)
        if left.plain and right.plain:
            return constant_pair(f"divided({left.plain}, {right.plain}, {scope.fault()})")
        function = "pair_parted" if right.plain else "pair_divided"
        return Code(f"{function}({left.text}, {right.plain or right.text}, {scope.fault()})", REAL)
    divisor = node.right.value if isinstance(node.right, ast.Constant) else constant_value(scope, node.right)
    return quotient(scope, left, right, isinstance(divisor, int | float) and bool(divisor))


def _power(scope: Scope, node: ast.BinOp) -> Code:
    exponent = node.right.value if isinstance(node.right, ast.Constant) else None
    if isinstance(exponent, int | float) and exponent in (2, 3):
        scope.refuse(
            node, "squares and cubes must be written as products: compilers and libm round a power differently"
        )
    left, right = scope.expression(node.left), scope.expression(node.right)
    if left.kind != REAL or right.kind not in NUMBERS:
        scope.refuse(node, "a power must have a float as its base")
    if scope.program.paired:
        return Code(f"pair_pow({left.text}, {as_real(scope, right).text}, {scope.fault()})", REAL)
    if not scope.program.checked:
        return Code(f"pow({left.text}, {right.text})", REAL)
    return Code(f"checked_pow({left.text}, {right.text}, {scope.fault()})", REAL)


def _unary(scope: Scope, node: ast.UnaryOp, wanted: Kind | None) -> Code:
    if isinstance(node.op, ast.Not):
        inner = scope.condition(node.operand)
        return Code(f"!{inner.within(UNARY)}", TRUTH, UNARY)
    inner = scope.expression(node.operand)
    if inner.kind not in NUMBERS or not isinstance(node.op, ast.USub | ast.UAdd):
        scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset")
    if scope.program.paired and inner.kind == REAL:
        if isinstance(node.op, ast.UAdd):
            return inner
        return constant_pair(f"-({inner.plain})") if inner.plain else Code(f"pair_negated({inner.text})", REAL)
    return Code(f"-{inner.within(PRIMARY)}", inner.kind, UNARY) if isinstance(node.op, ast.USub) else inner


def _boolean(scope: Scope, node: ast.BoolOp, wanted: Kind | None) -> Code:
    sign, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
    inner = AND if level == AND else EQUALITY
    parts = [scope.condition(node.values[0]).within(inner)]
    scope.conditional += 1
    parts += [scope.condition(value).within(inner) for value in node.values[1:]]
    scope.conditional -= 1
    return Code(f" {sign} ".join(parts), TRUTH, level)


def _compare(scope: Scope, node: ast.Compare, wanted: Kind | None) -> Code:
    if isinstance(node.ops[0], ast.In | ast.NotIn):
        return _membership(scope, node)
    operands = [value_of(scope, scope.expression(operand)) for operand in (node.left, *node.comparators)]
    for n, operand in enumerate(operands):
        if operand.kind not in (*NUMBERS, TRUTH):
            scope.refuse(node, f"comparisons must be of numbers, but one is {describe(operand.kind)}")
        if 0 < n < len(operands) - 1 and "(" in operand.text:
            operands[n] = scope.hoist(node, operand, "middle")
    parts = []
    for op, left, right in zip(node.ops, operands[:-1], operands[1:], strict=True):
        if type(op) not in _COMPARED:
            scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset")
        sign, level = _COMPARED[type(op)]
        parts.append(Code(f"{left.within(SUM)} {sign} {right.within(SUM)}", TRUTH, level))
    if len(parts) == 1:
        return parts[0]
    return Code(" && ".join(part.text for part in parts), TRUTH, AND)


def _membership(scope: Scope, node: ast.Compare) -> Code:
    choices = node.comparators[0]
    named = constant_value(scope, choices)  # a tuple of numbers that the module holds
    if isinstance(named, tuple) and named and all(type(number) is int for number in named):
        choices = ast.copy_location(ast.Tuple([ast.Constant(number) for number in named], ast.Load()), node)
    if len(node.ops) != 1 or not isinstance(choices, ast.Tuple):
        scope.refuse(node, "`in` must be followed by a tuple of numbers")
    value = value_of(scope, scope.expression(node.left))
    if "(" in value.text and not scope.conditional and not value.place:
        value = scope.hoist(node, value, "value")
    negated = isinstance(node.ops[0], ast.NotIn)
    sign = "!=" if negated else "=="
    tests = [
        f"{value.within(RELATION)} {sign} {value_of(scope, scope.expression(item)).within(RELATION)}"
        for item in choices.elts
    ]
    return Code((" && " if negated else " || ").join(tests), TRUTH, AND if negated else OR)


def _choice(scope: Scope, node: ast.IfExp, wanted: Kind | None) -> Code:
    test = scope.condition(node.test)
    scope.conditional += 1
    then, other = (scope.expression(arm, wanted) for arm in (node.body, node.orelse))
    scope.conditional -= 1
    kind = join_kinds(scope, node, then.kind, other.kind)
    if kind == REAL:
        then, other = as_real(scope, then), as_real(scope, other)
    if then.plain and other.plain:
        return constant_pair(f"({test.within(OR)} ? {then.plain} : {other.plain})")
    address = ""
    if isinstance(kind, Tuple) and (then.place or then.address) and (other.place or other.address):
        address = f"{test.within(OR)} ? {address_of(then)} : {address_of(other)}"
    text = f"{test.within(OR)} ? {then.within(OR)} : {other.within(TERNARY)}"
    return Code(text, kind, TERNARY, address=address)


def _tuple(scope: Scope, node: ast.Tuple, wanted: Kind | None) -> Code:
    kinds: tuple[Kind | None, ...] = (None,) * len(node.elts)
    if isinstance(wanted, Tuple) and len(wanted.items) == len(node.elts):
        kinds = wanted.items
    parts = [scope.expression(item, kind) for item, kind in zip(node.elts, kinds, strict=True)]
    kind = wanted if kinds[0] is not None and wanted else Tuple(tuple(part.kind for part in parts))
    return compound(scope, kind, ", ".join(part.text for part in parts))


def _subscript(scope: Scope, node: ast.Subscript, wanted: Kind | None) -> Code:
    if isinstance(node.slice, ast.Slice):
        scope.refuse(node, "slices are outside the subset")
    whole, place = constant_value(scope, node.value), interval(scope, node.slice)
    if isinstance(whole, tuple) and place is not None and place[0] == place[1] and 0 <= place[0] < len(whole):
        return constant(scope, whole[place[0]], node)
    axis = axis_of(scope, node)
    if axis is not None:
        return array_length(scope.expression(axis[0]), axis[1])
    base = scope.expression(node.value)
    kind = base.kind
    if isinstance(kind, ArrayKind):
        return array_item(scope, node, base)
    if isinstance(kind, Tuple) and not kind.uniform:
        n = interval(scope, node.slice)
        if n is None or n[0] != n[1] or not -len(kind.items) <= n[0] < len(kind.items):
            scope.refuse(node, "an item of a mixed tuple must be taken by a constant index")
        return part_of(scope, base, n[0] % len(kind.items))
    if isinstance(kind, Tuple):
        return Code(f"{member(base)}v[{index_within(scope, node.slice, len(kind.items))}]", kind.items[0], place=True)
    if isinstance(kind, Items):
        length = f"{member(base)}n"
        return Code(f"{member(base)}v[{index_within(scope, node.slice, kind.capacity, length)}]", kind.item, place=True)
    if isinstance(kind, Store):
        item = REAL if kind.attribute == "real" else WHOLE
        return Code(f"{base.within(PRIMARY)}[{index_within(scope, node.slice, kind.length)}]", item, place=True)
    return scope.refuse(node, f"`{ast.unparse(node.value)}` has no items")


def _lists(scope: Scope, node: ast.expr, wanted: Kind | None) -> Code:
    return scope.refuse(node, "a list must be assigned to a variable of declared type: `x: Name = ...`")


_HANDLERS: dict[type, Callable[[Scope, Any, Kind | None], Code]] = {
    ast.Constant: _literal,
    ast.Name: _name,
    ast.Attribute: _attribute,
    ast.BinOp: _binary,
    ast.UnaryOp: _unary,
    ast.BoolOp: _boolean,
    ast.Compare: _compare,
    ast.IfExp: _choice,
    ast.Tuple: _tuple,
    ast.Subscript: _subscript,
    ast.Call: call,
    ast.List: _lists,
    ast.ListComp: _lists,
}
