"""Statements of the subset in C."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable
from typing import Any

from orchestrator.building.translation.assignments import translate_annotated, translate_assignment, translate_augmented
from orchestrator.building.translation.building_tuples import with_loop, without_loop
from orchestrator.building.translation.calls import message
from orchestrator.building.translation.constants import constant_value, interval
from orchestrator.building.translation.kinds import NOTHING, WHOLE, Items, Tuple, describe
from orchestrator.building.translation.scope import PRIMARY, SUM, Code, Scope, member, part_of

REFUSALS = {"StepRefusedError": "STEP_REFUSED", "ValueError": "VALUE_ERROR"}


def block(scope: Scope, statements: list[ast.stmt]) -> list[str]:
    """Translate a block; the lines are not indented."""
    lines: list[str] = []
    for node in statements:
        lines += [f"/* {text} */" for text in scope.source.comments(node)]
        lines += statement(scope, node)
    return lines


def statement(scope: Scope, node: ast.stmt) -> list[str]:
    """Translate one statement, with what has to be computed before it."""
    handler = _HANDLERS.get(type(node))
    if handler is None:
        scope.refuse(node, f"the statement `{ast.unparse(node).splitlines()[0]}` is outside the subset")
    outer, scope.before = scope.before, []
    lines = handler(scope, node)
    before, scope.before = scope.before, outer
    return before + lines


def _return(scope: Scope, node: ast.Return) -> list[str]:
    if node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None):
        if scope.returns != NOTHING:
            scope.refuse(node, f"a value must be {describe(scope.returns)}, but is None")
        return ["return;"]
    return [f"return {scope.expression(node.value, scope.returns).text};"]


def _raise(scope: Scope, node: ast.Raise) -> list[str]:
    call = node.exc
    name = call.func.id if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) else ""
    if name not in REFUSALS or not isinstance(call, ast.Call) or len(call.args) != 1:
        scope.refuse(node, f"`raise` must be of {' or '.join(REFUSALS)} with one message")
    text = message(scope, call.args[0])
    return [f"raise_fault({scope.fault()}, {REFUSALS[name]}, {text});", f"return{scope.empty_result()};"]


def _expression(scope: Scope, node: ast.Expr) -> list[str]:
    if isinstance(node.value, ast.Constant):
        return []
    if not isinstance(node.value, ast.Call):
        scope.refuse(node, "an expression by itself must be a call")
    function = node.value.func
    if isinstance(function, ast.Attribute) and function.attr in ("append", "clear"):
        target = scope.expression(function.value)
        if isinstance(target.kind, Items):
            return _on_list(scope, node.value, function, target)
    before = scope.faults
    code = scope.expression(node.value)
    lines = [f"{code.text};" if code.kind == NOTHING else f"(void){code.within(PRIMARY)};"]
    return lines + scope.check_faults(before)


def _on_list(scope: Scope, call: ast.Call, function: ast.Attribute, target: Code) -> list[str]:
    assert isinstance(target.kind, Items)
    base = member(target)
    scope.note_mutation(function.value)
    if function.attr == "clear":
        return [f"{base}n = 0;"]
    before = scope.faults
    value = scope.expression(call.args[0], target.kind.item)
    index = scope.temporary("end")
    place = f"const int64_t {index} = next_item(&{base}n, {target.kind.capacity}, {scope.fault()});"
    return [place, f"{base}v[{index}] = {value.text};", *scope.check_faults(before)]


def _delete(scope: Scope, node: ast.Delete) -> list[str]:
    """``del items[:count]``."""
    target = node.targets[0]
    if len(node.targets) != 1 or not isinstance(target, ast.Subscript) or not isinstance(target.slice, ast.Slice):
        scope.refuse(node, "only the first items of a list can be deleted: `del items[:count]`")
    items, part = scope.expression(target.value), target.slice
    if not isinstance(items.kind, Items) or part.lower is not None or part.upper is None or part.step is not None:
        scope.refuse(node, "only the first items of a list can be deleted: `del items[:count]`")
    scope.note_mutation(target.value)
    base = member(items)
    count = scope.expression(part.upper, WHOLE).text
    return [f"{base}n = drop_items({base}v, {base}n, {count}, sizeof {base}v[0]);"]


def _if(scope: Scope, node: ast.If) -> list[str]:
    before = scope.faults
    test = scope.condition(node.test).text
    if scope.may_raise(before):
        name = scope.temporary("test")
        scope.before += [f"const bool {name} = {test};", scope.fault_check()]
        test = name
    lines = [f"if ({test}) {{", *_indent(block(scope, node.body))]
    if not node.orelse:
        return [*lines, "}"]
    other = block(scope, node.orelse)
    if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If) and other[0].startswith("if ("):
        return [*lines, f"}} else {other[0]}", *other[1:]]
    return [*lines, "} else {", *_indent(other), "}"]


def _indent(lines: list[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _while(scope: Scope, node: ast.While) -> list[str]:
    before = scope.faults
    test = scope.condition(node.test)
    if scope.before or node.orelse:
        scope.refuse(node, "the condition of `while` must be simple, and `else` after a loop is outside the subset")
    body = _indent(block(scope, node.body))
    stop = " && !fault->kind" if scope.faults > before else ""
    return [f"while ({test.within(PRIMARY if ' || ' in test.text and stop else 0)}{stop}) {{", *body, "}"]


def _for(scope: Scope, node: ast.For) -> list[str]:
    if node.orelse:
        scope.refuse(node, "`else` after a loop is outside the subset")
    if isinstance(node.iter, ast.Call) and isinstance(node.iter.func, ast.Name) and node.iter.func.id == "range":
        return _translate_range(scope, node, node.iter)
    return _over_items(scope, node)


def _translate_range(scope: Scope, node: ast.For, call: ast.Call) -> list[str]:
    if not isinstance(node.target, ast.Name):
        scope.refuse(node, "the variable of a counted loop must be a name")
    arguments = [ast.Constant(0), *call.args] if len(call.args) == 1 else list(call.args)
    step = interval(scope, arguments[2]) if len(arguments) == 3 else (1, 1)
    if step is None or step[0] != step[1] or step[0] == 0:
        scope.refuse(node, "the step of a range must be a constant other than zero")
    start = scope.expression(arguments[0], WHOLE).text
    stop = _stop(scope, node, arguments[1])
    ends = (interval(scope, arguments[0]), interval(scope, arguments[1]))
    variable = scope.temporary("pass") if node.target.id == "_" else scope.local(node.target.id)
    if node.target.id != "_":
        with_loop(scope, node.target.id, 0, 1)
        _narrow(scope, node.target.id, ends, step[0])
    before = scope.faults
    body = _indent(block(scope, node.body))
    stopped = " && !fault->kind" if scope.faults > before and scope.owner is None else ""
    sign = "<" if step[0] > 0 else ">"
    change = {1: f"{variable}++", -1: f"{variable}--"}.get(step[0], f"{variable} += {step[0]}")
    without_loop(scope, node.target.id)
    return [f"for (int64_t {variable} = {start}; {variable} {sign} {stop}{stopped}; {change}) {{", *body, "}"]


def _narrow(scope: Scope, name: str, ends: tuple[Any, Any], step: int) -> None:
    """Note between which numbers the variable of a loop stays, where both ends are known."""
    scope.ranges.pop(name)
    first, last = ends
    if first is not None and last is not None:
        scope.ranges[name] = (first[0], last[1] - 1) if step > 0 else (last[0] + 1, first[1])


def _stop(scope: Scope, node: ast.For, end: ast.expr) -> str:
    """Return the end of a range, which Python evaluates once."""
    code = scope.expression(end, WHOLE)
    bounds = interval(scope, end)
    stored = {name.id for name in ast.walk(node) if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)}
    if (bounds is not None and bounds[0] == bounds[1]) or (isinstance(end, ast.Name) and end.id not in stored):
        return code.within(SUM)
    return scope.hoist(node, code, "count").text


def _over_items(scope: Scope, node: ast.For) -> list[str]:
    """``for item in list`` and ``for n, item in enumerate(list)``."""
    numbers = constant_value(scope, node.iter)
    if isinstance(numbers, tuple) and all(type(number) is int for number in numbers):
        return _unroll(scope, node, numbers)
    counted = isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func) == "enumerate"
    source = scope.expression(node.iter.args[0] if counted and isinstance(node.iter, ast.Call) else node.iter)
    target: ast.expr = node.target
    index = scope.temporary("n")
    if counted:
        if not isinstance(target, ast.Tuple) or not isinstance(target.elts[0], ast.Name):
            scope.refuse(node, "enumerate must be unpacked into a name and an item")
        index, target = scope.local(target.elts[0].id), target.elts[1]
    if isinstance(source.kind, Items):
        length, item = f"{member(source)}n", source.kind.item
    elif isinstance(source.kind, Tuple) and source.kind.uniform and source.place:
        length, item = str(len(source.kind.items)), source.kind.items[0]
    else:
        scope.refuse(node, "a loop must be over a range, a list or a tuple of one kind that has a name")
    if isinstance(item, Items):
        scope.refuse(node, "a loop over lists must be over their numbers: `for n in range(len(lists))`")
    value = Code(f"{member(source)}v[{index}]", item, place=True)
    names = {name.id for name in ast.walk(node.target) if isinstance(name, ast.Name)}
    for name in names:
        scope.kinds.pop(name, None)
    if counted:
        assert isinstance(node.target, ast.Tuple)
        with_loop(scope, ast.unparse(node.target.elts[0]), 0, 1)
        scope.ranges.pop(ast.unparse(node.target.elts[0]))
    head = _item_lines(scope, node, target, value)
    before = scope.faults
    body = [*head, *block(scope, node.body)]
    stopped = " && !fault->kind" if scope.faults > before and scope.owner is None else ""
    for name in names:
        without_loop(scope, name)
    return [f"for (int64_t {index} = 0; {index} < {length}{stopped}; {index}++) {{", *_indent(body), "}"]


def _unroll(scope: Scope, node: ast.For, numbers: tuple[int, ...]) -> list[str]:
    """``for n in NUMBERS``, whole numbers that the module holds: the body once for each."""
    name = node.target.id if isinstance(node.target, ast.Name) else ""
    inner = [item for line in node.body for item in ast.walk(line)]
    stored = {item.id for item in inner if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store)}
    if not name or name in stored or any(isinstance(item, ast.Break | ast.Continue) for item in inner):
        scope.refuse(node, "a loop over constants must have one variable that only the loop sets, and no way out of it")
    lines: list[str] = []
    for number in numbers:
        for line in node.body:
            lines += block(scope, [_Fixed(name, number).visit(copy.deepcopy(line))])
    return lines


class _Fixed(ast.NodeTransformer):
    """A statement with a number in the place of a name."""

    def __init__(self, name: str, number: int) -> None:
        self._name, self._number = name, number

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return ast.copy_location(ast.Constant(self._number), node) if node.id == self._name else node


def _item_lines(scope: Scope, node: ast.For, target: ast.expr, value: Code) -> list[str]:
    if isinstance(target, ast.Tuple) and isinstance(value.kind, Tuple):
        pairs = [(part, part_of(scope, value, n)) for n, part in enumerate(target.elts)]
    else:
        pairs = [(target, value)]
    lines = []
    for part, code in pairs:
        if not isinstance(part, ast.Name):
            scope.refuse(node, "the items of a loop must be unpacked into names")
        scope.kinds[part.id] = code.kind
        read = any(isinstance(n, ast.Name) and n.id == part.id for line in node.body for n in ast.walk(line))
        if read:
            lines.append(f"const {scope.program.names.c(code.kind)} {scope.local(part.id)} = {code.text};")
    return lines


def _simple(text: str) -> Callable[[Scope, Any], list[str]]:
    return lambda scope, node: [text] if text else []


_HANDLERS: dict[type, Callable[[Scope, Any], list[str]]] = {
    ast.Assign: translate_assignment,
    ast.AnnAssign: translate_annotated,
    ast.AugAssign: translate_augmented,
    ast.Return: _return,
    ast.Raise: _raise,
    ast.Expr: _expression,
    ast.If: _if,
    ast.While: _while,
    ast.For: _for,
    ast.Break: _simple("break;"),
    ast.Continue: _simple("continue;"),
    ast.Pass: _simple(""),
    ast.Delete: _delete,
}
