"""What is known of an expression before it runs: global names, and between which whole numbers it lies."""

from __future__ import annotations

import ast
from types import ModuleType
from typing import Any

from orchestrator.building.translation.kinds import ArrayKind
from orchestrator.building.translation.scope import Bounds, Scope


def constant_value(scope: Scope, node: ast.expr) -> Any:
    """Return the value of a global name or of an attribute of a module; ``None`` where it is neither."""
    if isinstance(node, ast.Name) and node.id not in scope.kinds and scope.source.has(node.id):
        return scope.source.value(node.id)
    if isinstance(node, ast.Attribute):
        base = constant_value(scope, node.value)
        if isinstance(base, ModuleType):
            return getattr(base, node.attr, None)
    return None


def interval(scope: Scope, node: ast.expr) -> Bounds | None:
    """Return between which whole numbers a value lies, as far as constants and loops tell."""
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return (node.value, node.value)
    if isinstance(node, ast.Name) and node.id in scope.ranges:
        return scope.ranges[node.id]
    value = constant_value(scope, node)
    if type(value) is int:
        return (value, value)
    length = fixed_length(scope, node)
    if length is not None:
        return (length, length)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        inner = interval(scope, node.operand)
        return None if inner is None else (-inner[1], -inner[0])
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub | ast.Mult):
        a, b = interval(scope, node.left), interval(scope, node.right)
        if a is None or b is None:
            return None
        if isinstance(node.op, ast.Add):
            return (a[0] + b[0], a[1] + b[1])
        if isinstance(node.op, ast.Sub):
            return (a[0] - b[1], a[1] - b[0])
        corners = [x * y for x in a for y in b]
        return (min(corners), max(corners))
    return None


def axis_of(scope: Scope, node: ast.expr) -> tuple[ast.expr, int] | None:
    """Return array and axis of ``len(array)`` or ``array.shape[constant]``; None where a node is neither."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "len" and len(node.args) == 1:
        array, axis = node.args[0], 0
    elif isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
        place = interval(scope, node.slice)
        if place is None or place[0] != place[1]:
            return None
        array, axis = node.value.value, place[0]
    else:
        return None
    kind = scope.kinds.get(array.id) if isinstance(array, ast.Name) else None
    return (array, axis) if isinstance(kind, ArrayKind) and 0 <= axis < len(kind.shape) else None


def fixed_length(scope: Scope, node: ast.expr) -> int | None:
    """Return the length that a node asks for where the array's kind says it."""
    found = axis_of(scope, node)
    if found is None or not isinstance(found[0], ast.Name):
        return None
    kind = scope.kinds[found[0].id]
    return kind.shape[found[1]] if isinstance(kind, ArrayKind) else None
