"""Arrays in C: their items, the parts that lie within them, their lengths, and the quotients of unchecked kernels."""

from __future__ import annotations

import ast

from orchestrator.building.translation.constants import interval
from orchestrator.building.translation.kinds import REAL, WHOLE, ArrayKind
from orchestrator.building.translation.scope import PRODUCT, UNARY, Code, Scope, member


def index_within(scope: Scope, node: ast.expr, size: int, length: str = "") -> str:
    """Return an index that is inside whatever happens; negative ones count from the end.

    Args:
        size: that there is room for; of a fixed length, the length.
        length: in C, where it is known only when the code runs.
    """
    bounds = interval(scope, node)
    text = scope.expression(node, WHOLE).text
    if bounds is not None and bounds[0] >= 0 and bounds[1] < size:
        return text
    if bounds is not None and not length and bounds[0] == bounds[1] and -size <= bounds[0] < 0:
        return str(size + bounds[0])
    return f"item_at({text}, {length or size}, {scope.fault()})"


def array_item(scope: Scope, node: ast.Subscript, base: Code) -> Code:
    """Return an item of an array, or the part of it that fewer indices than it has axes name."""
    kind = base.kind
    assert isinstance(kind, ArrayKind)
    indices = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
    if len(indices) > len(kind.shape) or any(isinstance(index, ast.Slice) for index in indices):
        scope.refuse(node, f"an array of {len(kind.shape)} axes must have as many indices at most, and no slices")
    place = ""
    for axis, index in enumerate(indices):
        fixed = kind.shape[axis]
        text = index_within(scope, index, fixed or 0, "" if fixed else array_length(base, axis).text)
        place = f"({place}) * {array_length(base, axis).text} + {text}" if place else text
    left = range(len(indices), len(kind.shape))
    if not left:
        return Code(f"{member(base)}v[{place}]", kind.item, place=True)
    part = ArrayKind(kind.item, tuple(kind.shape[axis] for axis in left))
    lengths = [array_length(base, axis).text for axis in left]
    start = f"{member(base)}v + ({place}) * {' * '.join(lengths)}"
    return Code(f"(({scope.program.names.c(part)}){{{start}, {{{', '.join(lengths)}}}}})", part)


def array_length(base: Code, axis: int) -> Code:
    """Return the length of an array along an axis, from 0."""
    assert isinstance(base.kind, ArrayKind)
    fixed = base.kind.shape[axis]
    return Code(f"{member(base)}n[{axis}]" if fixed is None else str(fixed), WHOLE)


def quotient(scope: Scope, left: Code, right: Code, never_zero: bool = False) -> Code:
    """Return a quotient of plain numbers, of which the divisor may be zero unless it is ``never_zero``."""
    if scope.program.checked and not never_zero:
        return Code(f"divided({left.text}, {right.text}, {scope.fault()})", REAL)
    cast = "(double)" if left.kind == WHOLE and right.kind == WHOLE else ""
    return Code(f"{cast}{left.within(UNARY if cast else PRODUCT)} / {right.within(PRODUCT + 1)}", REAL, PRODUCT)
