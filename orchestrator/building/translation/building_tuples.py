"""``tuple(... for ...)`` and lists that are made whole, as loops in C."""

from __future__ import annotations

import ast

from orchestrator.building.translation.constants import interval
from orchestrator.building.translation.kinds import WHOLE, Items, Kind, Tuple
from orchestrator.building.translation.scope import Code, Scope, convert, member


def tuple_built(scope: Scope, node: ast.Call, wanted: Kind | None) -> Code:
    """Translate ``tuple(expression for n in range(count))`` with a constant count, or a tuple of a tuple."""
    argument = node.args[0] if len(node.args) == 1 else None
    if not isinstance(argument, ast.GeneratorExp):
        if argument is not None:
            code = scope.expression(argument)
            if isinstance(code.kind, Tuple):
                return code
        scope.refuse(node, "`tuple` must be given a generator over a constant range")
    if scope.conditional:
        scope.refuse(node, "a tuple of this kind must be given a name first, because it is needed under a condition")
    name = scope.temporary("made")
    outer, scope.before = scope.before, []
    kind = _fill(scope, argument, name, wanted if isinstance(wanted, Tuple) else None)
    body, scope.before = scope.before, outer
    scope.before += [f"{scope.program.names.c(kind)} {name};", *body]
    return Code(name, kind, place=True)


def _fill(scope: Scope, node: ast.GeneratorExp, place: str, wanted: Tuple | None) -> Tuple:
    """Append to ``scope.before`` the loop that fills ``place``; return the kind of what it fills."""
    variable, start, stop = constant_range(scope, node)
    item_wanted = wanted.items[0] if wanted is not None and wanted.uniform else None
    inner_before, scope.before = scope.before, []
    with_loop(scope, variable, start, stop)
    local = scope.local(variable)
    where = f"{place}.v[{local}]" if start == 0 else f"{place}.v[{local} - {start}]"
    inner = node.elt
    if isinstance(inner, ast.Call) and isinstance(inner.func, ast.Name) and inner.func.id == "tuple":
        generator = inner.args[0]
        if not isinstance(generator, ast.GeneratorExp):
            scope.refuse(inner, "`tuple` must be given a generator over a constant range")
        item: Kind = _fill(scope, generator, where, item_wanted if isinstance(item_wanted, Tuple) else None)
        lines = scope.before
    else:
        code = scope.expression(inner, item_wanted)
        item = code.kind
        lines = [*scope.before, f"{where} = {code.text};"]
    scope.before = inner_before
    scope.before.append(f"for (int64_t {local} = {start}; {local} < {stop}; {local}++) {{")
    scope.before += [f"    {line}" for line in lines] + ["}"]
    without_loop(scope, variable)
    return Tuple((item,) * (stop - start))


def constant_range(scope: Scope, node: ast.GeneratorExp | ast.ListComp) -> tuple[str, int, int]:
    """Return variable, start and stop of the one ``for ... in range(...)`` with constant ends, or refuse."""
    loop = node.generators[0]
    call = loop.iter
    fits = len(node.generators) == 1 and not loop.ifs and isinstance(loop.target, ast.Name)
    if fits and isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range":
        ends = [interval(scope, argument) for argument in call.args]
        if len(ends) in (1, 2) and all(end is not None and end[0] == end[1] for end in ends):
            numbers = [end[0] for end in ends if end is not None]
            start, stop = (0, numbers[0]) if len(numbers) == 1 else numbers
            assert isinstance(loop.target, ast.Name)
            if stop > start:
                return loop.target.id, start, stop
    return scope.refuse(node, "a generator must be over one `range` with constant ends, without `if`")


def with_loop(scope: Scope, variable: str, start: int, stop: int) -> None:
    """Make the variable of a loop known."""
    if variable in scope.kinds and variable not in scope.ranges:
        scope.kinds.pop(variable)
    scope.kinds[variable] = WHOLE
    scope.ranges[variable] = (start, stop - 1)


def without_loop(scope: Scope, variable: str) -> None:
    """Forget the variable of a loop."""
    scope.kinds.pop(variable, None)
    scope.ranges.pop(variable, None)


def list_lines(scope: Scope, node: ast.expr, place: Code) -> list[str] | None:
    """Return the statements that fill ``place`` with a whole list, or ``None`` if ``node`` is none."""
    kind = place.kind
    assert isinstance(kind, Items)
    base = member(place)
    if isinstance(node, ast.List):
        return _translate_list(scope, node, kind, base)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult) and isinstance(node.left, ast.List):
        return _translate_repetition(scope, node, kind, base)
    if isinstance(node, ast.ListComp):
        return _translate_comprehension(scope, node, kind, place)
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "list"
        and len(node.args) == 1
    ):
        return [f"{place.text} = {scope.expression(node.args[0], kind).text};"]
    return None


def _translate_list(scope: Scope, node: ast.List, kind: Items, base: str) -> list[str]:
    if len(node.elts) > kind.capacity:
        scope.refuse(node, f"a list of at most {kind.capacity} is given {len(node.elts)} items")
    lines = [f"{base}v[{n}] = {scope.expression(item, kind.item).text};" for n, item in enumerate(node.elts)]
    return [*lines, f"{base}n = {len(node.elts)};"]


def _translate_repetition(scope: Scope, node: ast.BinOp, kind: Items, base: str) -> list[str]:
    assert isinstance(node.left, ast.List)
    count = interval(scope, node.right)
    if len(node.left.elts) != 1 or count is None or count[0] != count[1] or not 0 <= count[0] <= kind.capacity:
        scope.refuse(node, f"a list must be [value] * constant, at most {kind.capacity}")
    value = scope.expression(node.left.elts[0], kind.item).text
    index = scope.temporary("n")
    return [
        f"for (int64_t {index} = 0; {index} < {count[0]}; {index}++)",
        f"    {base}v[{index}] = {value};",
        f"{base}n = {count[0]};",
    ]


def _translate_comprehension(scope: Scope, node: ast.ListComp, kind: Items, place: Code) -> list[str]:
    """``[list(f) for f in other]`` and ``[... for n in range(constant)]``."""
    base = member(place)
    loop = node.generators[0]
    if not isinstance(loop.iter, ast.Call):
        source = scope.expression(loop.iter, kind)
        copied = isinstance(node.elt, ast.Call) and ast.unparse(node.elt) == f"list({ast.unparse(loop.target)})"
        if not copied or loop.ifs or len(node.generators) > 1:
            scope.refuse(node, "a list of lists must be copied by `[list(item) for item in other]`")
        return [f"{place.text} = {source.text};"]
    variable, start, stop = constant_range(scope, node)
    if stop - start > kind.capacity:
        scope.refuse(node, f"a list of at most {kind.capacity} is given {stop - start} items")
    with_loop(scope, variable, start, stop)
    local = scope.local(variable)
    item = Code(f"{base}v[{local}{f' - {start}' if start else ''}]", kind.item, place=True)
    inner = list_lines(scope, node.elt, item) if isinstance(kind.item, Items) else None
    if inner is None:
        inner = [f"{item.text} = {convert(scope, node, scope.expression(node.elt), kind.item).text};"]
    without_loop(scope, variable)
    head = f"for (int64_t {local} = {start}; {local} < {stop}; {local}++) {{"
    return [head, *(f"    {line}" for line in inner), "}", f"{base}n = {stop - start};"]
