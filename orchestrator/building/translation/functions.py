"""One function of the sources as a C function."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

from orchestrator.building.translation.definitions import Function, Owner
from orchestrator.building.translation.expressions import expression
from orchestrator.building.translation.kinds import NOTHING, REAL, TRUTH, WHOLE, ArrayKind, Items, Kind, Tuple, size_of
from orchestrator.building.translation.program import Program
from orchestrator.building.translation.scope import Scope
from orchestrator.building.translation.source import ModuleSource, docstring
from orchestrator.building.translation.statements import block

MOST_PASSES = 8
# Tuples of more numbers are handed on by address to functions that can change nothing.
LARGEST_BY_VALUE = 12
_TEXTS = re.compile(r'/\*.*?\*/|"[^"]*"')
_CALLED = re.compile(r"\b([A-Za-z_]\w*)\(")


def translate(
    program: Program, source: ModuleSource, node: ast.FunctionDef, c_name: str, owner: Owner | None = None
) -> Function:
    """Return the function in C; what it calls is translated before."""
    function = _signature(source, node, c_name, owner)
    mutated: set[str] = set()
    function.by_address = _by_address(function, node)
    kinds: dict[str, Kind] = {}
    found = _survey(source, node, [name for name, _ in function.parameters])
    covered: set[str] = set()
    for _ in range(MOST_PASSES):
        scope = Scope(program, source, expression, owner, function.returns)
        scope.kinds = kinds | dict(function.parameters)
        scope.pointers = {name for name, kind in function.parameters if isinstance(kind, Items)} | function.by_address
        scope.fixed = function.by_address
        scope.mutated, scope.covered = set(mutated), set(covered)
        scope.read, scope.once, scope.homes = set(found.read), set(found.once), dict(found.homes)
        body = block(scope, node.body[ast.get_docstring(node) is not None :])
        mutated = scope.mutated
        parameters = {name for name, _ in function.parameters}
        kinds = {name: kind for name, kind in scope.kinds.items() if name not in parameters}
        covered |= _names_at_file_scope(scope, body) & {scope.local(name) for name in (*scope.kinds, *found.counters)}
        if not scope.changed and covered == scope.covered:
            break
    if function.returns != NOTHING and not _leaves(node.body):
        source.refuse(node, f"`{node.name}` must end with `return` on every path")
    function.mutated = {
        name for name, kind in function.parameters if isinstance(kind, Items | ArrayKind) and name in mutated
    }
    function.faults = scope.faults > 0
    late = [name for name in scope.homes if name in scope.kinds and scope.homes[name] is node]
    unused = [name for name, _ in function.parameters if name not in scope.read]
    voids = [f"(void){scope.local(name)};" for name in unused]
    function.body = [*voids, *_late_declarations(scope, late), *body]
    function.head = _head(scope, function)
    return function


def _names_at_file_scope(scope: Scope, body: list[str]) -> set[str]:
    """Return the names at file scope that a body needs: of functions, constants and types."""
    called = {name for line in body for name in _CALLED.findall(_TEXTS.sub("", line))}
    return called | scope.constants | scope.program.names.in_use()


def _signature(source: ModuleSource, node: ast.FunctionDef, c_name: str, owner: Owner | None) -> Function:
    arguments = node.args
    if arguments.vararg or arguments.kwarg or arguments.posonlyargs or arguments.kwonlyargs or node.decorator_list:
        source.refuse(node, f"`{node.name}` must have plain parameters and no decorator")
    names = arguments.args[1:] if owner is not None else arguments.args
    parameters = [(argument.arg, source.annotation(argument.annotation, argument)) for argument in names]
    defaults = dict(
        zip([a.arg for a in names][len(names) - len(arguments.defaults) :], arguments.defaults, strict=True)
    )
    returns = source.annotation(node.returns, node)
    if isinstance(returns, ArrayKind):
        source.refuse(node, f"`{node.name}` must not return an array: fill one that it is given")
    return Function(
        node.name,
        c_name,
        source.name,
        node.lineno,
        parameters,
        returns,
        defaults,
        owner is not None,
        comment=docstring(node),
    )


def _by_address(function: Function, node: ast.FunctionDef) -> set[str]:
    """Return the parameters, never assigned, that are NamedTuples, or large tuples of a function without lists."""
    if function.owned:
        return set()
    stored = {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    lists = any(isinstance(kind, Items) for _, kind in function.parameters)
    least = float("inf") if lists else LARGEST_BY_VALUE
    large = {n for n, kind in function.parameters if size_of(kind) > least or (isinstance(kind, Tuple) and kind.names)}
    return large - stored


def _head(scope: Scope, function: Function) -> str:
    program = scope.program
    parameters = [f"{program.owner_name} *self"] if function.owned else []
    for name, kind in function.parameters:
        local = scope.local(name)
        if isinstance(kind, Items) or name in function.by_address:
            constant = "" if name in function.mutated else "const "
            parameters.append(f"{constant}{program.names.c(kind)} *{local}")
        else:
            c = program.names.c(kind)
            parameters.append(f"{c}{local}" if c.endswith("*") else f"{c} {local}")
    if function.faults:
        parameters.append("Fault *fault")
    often = "RARELY " if program.paired else ""
    return f"{often}static {program.names.c(function.returns)} {function.c}({', '.join(parameters) or 'void'})"


def _late_declarations(scope: Scope, names: list[str]) -> list[str]:
    """Declare at the top what is first assigned inside a branch or a loop and read outside."""
    lines = []
    for name in names:
        kind = scope.kinds[name]
        if name in scope.pointers or name in scope.ranges or name not in scope.read:
            continue
        paired = scope.program.paired and kind == REAL
        empty = "{0}" if paired or isinstance(kind, Tuple | Items) else {REAL: "0.0", WHOLE: "0", TRUTH: "false"}[kind]  # type: ignore[index]
        lines.append(f"{scope.program.names.c(kind)} {scope.local(name)} = {empty};")
    return lines


# Where variables begin ----------------------------------------------------------------------------------------


class _Locals(NamedTuple):
    """The locals of a function: those that are read, those that are assigned once, where each begins; loops' own."""

    read: set[str]
    once: set[str]
    homes: dict[str, ast.AST]
    counters: set[str]


def _survey(source: ModuleSource, node: ast.FunctionDef, parameters: list[str]) -> _Locals:
    """Return what the text of a function says about its locals."""
    places: dict[str, list[tuple[tuple[int, ...], ast.stmt, bool]]] = {}
    loops = [loop.target for loop in ast.walk(node) if isinstance(loop, ast.For | ast.comprehension)]
    counted = [name for target in loops for name in ast.walk(target) if isinstance(name, ast.Name)]
    counters = {name.id for name in counted}
    seen = _Locals(set(), set(), {}, counters)
    for path, statement in _statements(node.body, ()):
        for own in _own_names(statement):
            stored = isinstance(own.ctx, ast.Store)
            if stored and own.id in counters and own not in counted:
                source.refuse(statement, f"`{own.id}` is the variable of a loop and must not be assigned elsewhere")
            places.setdefault(own.id, []).append((path, statement, stored))
    for name, found in places.items():
        stores = [place for place in found if place[2]]
        if any(not store for *_, store in found) or any(isinstance(s, ast.AugAssign) for _, s, _ in found):
            seen.read.add(name)
        if not stores or name in parameters or name in counters:
            continue
        if len(stores) == 1 and not isinstance(stores[0][1], ast.AugAssign):
            seen.once.add(name)
        seen.homes[name] = _home(node, found, stores[0][1])
    return seen


def _home(node: ast.FunctionDef, place: list[tuple[tuple[int, ...], ast.stmt, bool]], first: ast.stmt) -> ast.AST:
    """Return the statement that declares a variable, or the function itself."""
    inside = min((path for path, *_ in place), key=len)
    block_of = next(path for path, statement, _ in place if statement is first)
    direct = isinstance(first, ast.Assign | ast.AnnAssign) and place[0][1] is first
    value = first.value if isinstance(first, ast.Assign | ast.AnnAssign) else None
    reads_itself = value is not None and any(not store and s is first for _, s, store in place)
    covers = all(path[: len(block_of)] == block_of for path, *_ in place)
    return first if direct and covers and not reads_itself and len(block_of) <= len(inside) else node


def _statements(body: list[ast.stmt], path: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], ast.stmt]]:
    """Yield every statement with the path of its block."""
    for statement in body:
        yield path, statement
        for n, inner in enumerate((getattr(statement, "body", []), getattr(statement, "orelse", []))):
            yield from _statements(inner, (*path, statement.lineno * 2 + n))


def _own_names(statement: ast.stmt) -> list[ast.Name]:
    """Return the names in a statement without the statements inside it, loads before stores."""
    found: list[ast.Name] = []
    waiting: list[ast.AST] = [child for child in ast.iter_child_nodes(statement) if not isinstance(child, ast.stmt)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name):
            found.append(node)
        waiting += [child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.stmt)]
    return sorted(found, key=lambda name: isinstance(name.ctx, ast.Store))


def _leaves(body: list[ast.stmt]) -> bool:
    last = body[-1]
    if isinstance(last, ast.Return | ast.Raise):
        return True
    return isinstance(last, ast.If) and bool(last.orelse) and _leaves(last.body) and _leaves(last.orelse)
