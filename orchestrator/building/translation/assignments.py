"""Assignments of the subset in C: to locals, which are declared where they begin, to items and attributes."""

from __future__ import annotations

import ast
import math

from orchestrator.building.translation.array_items import quotient
from orchestrator.building.translation.building_tuples import list_lines
from orchestrator.building.translation.constants import constant_value, interval
from orchestrator.building.translation.kernel_arrays import scratch
from orchestrator.building.translation.kinds import (
    NOTHING,
    REAL,
    WHOLE,
    ArrayKind,
    Items,
    Kind,
    Store,
    Tuple,
    describe,
    size_of,
)
from orchestrator.building.translation.scope import UNARY, Code, Scope, address_of, convert, part_of

# Larger tuples that are parts of fixed parameters are not copied.
LARGEST_COPIED = 12
_SIGNS: dict[type, str] = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*="}


def translate_assignment(scope: Scope, node: ast.Assign) -> list[str]:
    """Translate an assignment."""
    if len(node.targets) != 1:
        scope.refuse(node, "an assignment must have one target")
    target = node.targets[0]
    if isinstance(target, ast.Tuple):
        return _unpack(scope, node, target)
    return _translate_target(scope, node, target, node.value)


def translate_annotated(scope: Scope, node: ast.AnnAssign) -> list[str]:
    """Translate an assignment to a local variable of declared type."""
    if node.value is None or not isinstance(node.target, ast.Name):
        scope.refuse(node, "a declared variable must be a name and be given a value")
    kind = scope.source.annotation(node.annotation, node)
    scope.assign_kind(node, node.target.id, kind)
    return _translate_target(scope, node, node.target, node.value)


def _translate_target(scope: Scope, node: ast.stmt, target: ast.expr, value: ast.expr) -> list[str]:
    if isinstance(target, ast.Name):
        return _to_name(scope, node, target.id, value)
    before = scope.faults
    place = _place(scope, target)
    if isinstance(place.kind, Items):
        lines = list_lines(scope, value, place)
        if lines is None:
            lines = [f"{place.text} = {scope.expression(value, place.kind).text};"]
        return lines + scope.check_faults(before)
    return _store(scope, node, place, scope.expression(value, place.kind), before)


def _store(scope: Scope, node: ast.AST, place: Code, code: Code, before: int) -> list[str]:
    """Store into what outlives the function; what was raised on the way must not get there."""
    if scope.may_raise(before):
        name = scope.temporary("value")
        return [
            f"const {scope.program.names.c(place.kind)} {name} = {code.text};",
            *scope.check_faults(before),
            f"{place.text} = {name};",
        ]
    cast = "(int)" if ".integer[" in place.text or "->integer[" in place.text else ""
    return [f"{place.text} = {cast}{code.within(UNARY) if cast else code.text};"]


def _place(scope: Scope, target: ast.expr) -> Code:
    place = scope.expression(target)
    if not place.place:
        scope.refuse(target, f"`{ast.unparse(target)}` cannot be assigned to")
    if isinstance(target, ast.Subscript):
        owner = scope.expression(target.value)
        if not isinstance(owner.kind, Items | Store | ArrayKind) or isinstance(place.kind, ArrayKind):
            scope.refuse(target, "items of a tuple cannot be assigned to")
        scope.note_mutation(target.value)
    return place


def _to_name(scope: Scope, node: ast.stmt, name: str, value: ast.expr) -> list[str]:
    before = scope.faults
    declared = scope.kinds.get(name)
    if isinstance(value, ast.Call) and constant_value(scope, value.func) is scratch:
        return _scratch(scope, node, name, value)
    if isinstance(declared, Items) and name not in scope.pointers:
        whole = list_lines(scope, value, Code(scope.local(name), declared, place=True))
        if whole is not None:
            return [*_declare(scope, node, name, declared, None), *whole, *scope.check_faults(before)]
    code = scope.expression(value, declared if isinstance(declared, Tuple) else None)
    if name in scope.once and scope.homes.get(name) is node and _is_fixed(scope, code, value):
        scope.assign_kind(node, name, code.kind)
        scope.pointers.add(name)
        return [f"const {scope.program.names.c(code.kind)} *const {scope.local(name)} = {address_of(code)};"]
    if isinstance(code.kind, ArrayKind):
        return _part_of_array(scope, node, name, code, value)
    if isinstance(code.kind, Store) or (isinstance(code.kind, Items) and code.place):
        return _alias(scope, node, name, code, value)
    if code.kind == NOTHING:
        scope.refuse(node, "the call returns nothing that could be assigned")
    scope.assign_kind(node, name, code.kind)
    kind = scope.kinds[name]
    if kind != code.kind:
        code = convert(scope, node, code, kind)
    if name not in scope.read and not isinstance(code.kind, Items):
        return [f"(void){code.within(UNARY)};", *scope.check_faults(before)]
    return [*_declare(scope, node, name, kind, code.text), *scope.check_faults(before)]


def _declare(scope: Scope, node: ast.AST, name: str, kind: Kind, text: str | None) -> list[str]:
    """Return the assignment, which declares the variable if it begins here."""
    local = scope.local(name)
    if scope.homes.get(name) is not node:
        return [] if text is None else [f"{local} = {text};"]
    scope.begun.add(name)
    constant = "const " if name in scope.once and text is not None and not isinstance(kind, Items) else ""
    return [f"{constant}{scope.program.names.c(kind)} {local}{'' if text is None else f' = {text}'};"]


def _is_fixed(scope: Scope, code: Code, value: ast.expr) -> bool:
    """Tell whether a large tuple is part of parameters that never change, so that its address will do."""
    if not isinstance(code.kind, Tuple) or not (code.place or code.address) or size_of(code.kind) <= LARGEST_COPIED:
        return False
    names = {n.id for n in ast.walk(value) if isinstance(n, ast.Name) and isinstance(scope.kinds.get(n.id), Tuple)}
    return bool(names) and names <= scope.fixed


def _alias(scope: Scope, node: ast.AST, name: str, code: Code, value: ast.expr) -> list[str]:
    """A second name for a list or for the values of a slave: a pointer."""
    if name not in scope.once:
        scope.refuse(node, f"`{name}` names a list and must be assigned once; copy a list by `list(...)`")
    scope.assign_kind(node, name, code.kind)
    if isinstance(code.kind, Store):
        return [f"{scope.program.names.c(code.kind)}const {scope.local(name)} = {code.text};"]
    root = value
    while isinstance(root, ast.Subscript | ast.Attribute):
        root = root.value
    scope.pointers.add(name)
    if isinstance(root, ast.Name) and root.id != "self":
        scope.aliases[name] = root.id
    constant = "" if name in scope.mutated or (isinstance(root, ast.Name) and root.id in scope.mutated) else "const "
    return [f"{constant}{scope.program.names.c(code.kind)} *const {scope.local(name)} = {address_of(code)};"]


def _scratch(scope: Scope, node: ast.stmt, name: str, value: ast.Call) -> list[str]:
    """``name = scratch(5, 5)``: an array of zeros that lives as long as the block."""
    lengths = [interval(scope, argument) for argument in value.args]
    if scope.homes.get(name) is not node or not lengths or value.keywords:
        scope.refuse(node, f"`{name}` must be given a scratch array once, where all that use it can see it")
    if any(length is None or length[0] != length[1] or length[0] < 1 for length in lengths):
        scope.refuse(node, "the lengths of a scratch array must be constants, at least 1")
    shape = tuple(length[0] for length in lengths if length is not None)
    kind, local, data = ArrayKind(REAL, shape), scope.local(name), f"{name}_data"
    scope.assign_kind(node, name, kind)
    return [
        f"double {data}[{math.prod(shape)}] = {{0.0}};",
        f"const {scope.program.names.c(kind)} {local} = {{{data}, {{{', '.join(map(str, shape))}}}}};",
    ]


def _part_of_array(scope: Scope, node: ast.stmt, name: str, code: Code, value: ast.expr) -> list[str]:
    """A name for an array or a part of one."""
    if name not in scope.once or scope.homes.get(name) is not node:
        scope.refuse(node, f"`{name}` names an array and must be assigned once")
    scope.assign_kind(node, name, code.kind)
    root = value
    while isinstance(root, ast.Subscript):
        root = root.value
    if not isinstance(root, ast.Name):
        scope.refuse(node, f"`{ast.unparse(value)}` must be an array that has a name, or a part of one")
    scope.aliases[name] = root.id
    if name in scope.mutated:
        scope.note_mutation(root)
    return [f"const {scope.program.names.c(code.kind)} {scope.local(name)} = {code.text};"]


def _unpack(scope: Scope, node: ast.Assign, target: ast.Tuple) -> list[str]:
    """``a, b = ...``."""
    used = {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
    stored = {n.id for n in ast.walk(target) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    before = scope.faults
    if isinstance(node.value, ast.Tuple) and len(node.value.elts) == len(target.elts):
        codes = [scope.expression(item) for item in node.value.elts]
        if used & stored or scope.may_raise(before):
            codes = [scope.hoist(node, code, "value") for code in codes]
    else:
        code = scope.expression(node.value)
        if not isinstance(code.kind, Tuple) or len(code.kind.items) != len(target.elts):
            scope.refuse(node, f"{len(target.elts)} names must be given as many items, but get {describe(code.kind)}")
        if not code.place or used & stored:
            code = scope.hoist(node, code, "result")
        codes = [part_of(scope, code, n) for n in range(len(target.elts))]
    lines = scope.check_faults(before)
    for part, code in zip(target.elts, codes, strict=True):
        lines += _part(scope, node, part, code)
    return lines


def _part(scope: Scope, node: ast.Assign, part: ast.expr, code: Code) -> list[str]:
    if isinstance(part, ast.Name):
        scope.assign_kind(node, part.id, code.kind)
        if part.id not in scope.read:
            return []
        kind = scope.kinds[part.id]
        return _declare(scope, node, part.id, kind, convert(scope, node, code, kind).text)
    place = _place(scope, part)
    return [f"{place.text} = {convert(scope, node, code, place.kind).text};"]


def translate_augmented(scope: Scope, node: ast.AugAssign) -> list[str]:
    """``x += ...``, which rounds as ``x = x + ...``."""
    before = scope.faults
    place = _place(scope, node.target) if not isinstance(node.target, ast.Name) else scope.expression(_load(node))
    value = scope.expression(node.value)
    if scope.program.paired and place.kind == REAL and value.kind in (REAL, WHOLE):
        whole = ast.copy_location(ast.BinOp(_load(node), node.op, node.value), node)
        return _translate_target(scope, node, node.target, whole)
    if isinstance(node.op, ast.Div) and place.kind == REAL and value.kind in (REAL, WHOLE):
        found = quotient(scope, place, value)
        if scope.owner is not None:
            found = scope.hoist(node, found, "value")
        return [*scope.check_faults(before), f"{place.text} = {found.text};"]
    if type(node.op) not in _SIGNS or place.kind not in (REAL, WHOLE) or value.kind not in (REAL, WHOLE):
        scope.refuse(node, f"`{ast.unparse(node)}` is outside the subset (+=, -=, *= and /= of numbers are in it)")
    if isinstance(node.target, ast.Name):
        scope.assign_kind(node, node.target.id, REAL if REAL in (place.kind, value.kind) else WHOLE)
    elif place.kind == WHOLE and value.kind == REAL:
        scope.refuse(node, "a float cannot be added to an int in place")
    if scope.may_raise(before):
        value = scope.hoist(node, value, "value")
        return [*scope.check_faults(before), f"{place.text} {_SIGNS[type(node.op)]} {value.text};"]
    return [f"{place.text} {_SIGNS[type(node.op)]} {value.text};"]


def _load(node: ast.AugAssign) -> ast.expr:
    if not isinstance(node.target, ast.Name):
        return node.target
    return ast.copy_location(ast.Name(node.target.id, ast.Load()), node.target)
