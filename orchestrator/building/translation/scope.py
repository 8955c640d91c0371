"""What the translator knows while it is inside one function."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

from orchestrator.building.translation.definitions import Owner
from orchestrator.building.translation.kinds import (
    NOTHING,
    REAL,
    TRUTH,
    WHOLE,
    ArrayKind,
    Items,
    Kind,
    Tuple,
    describe,
    field_name,
)
from orchestrator.building.translation.program import Program
from orchestrator.building.translation.source import ModuleSource

# Precedence in C, the higher the tighter.
TERNARY, OR, AND, EQUALITY, RELATION, SUM, PRODUCT, UNARY, PRIMARY = range(9)
NUMBERS = (REAL, WHOLE)
Bounds = tuple[int, int]


@dataclass(frozen=True)
class Code:
    """An expression in C.

    ``place`` says that it names something whose address can be taken; ``address`` is the address of what is chosen
    between two such. ``plain`` is the number in a pair whose derivative is zero.
    """

    text: str
    kind: Kind
    level: int = PRIMARY
    place: bool = False
    address: str = ""
    plain: str = ""

    def within(self, level: int) -> str:
        """Return the text, in parentheses where the operator around it binds tighter."""
        return self.text if self.level >= level else f"({self.text})"


@dataclass
class Scope:
    """One function under translation.

    ``expressions`` is the translator of expressions: those of statements, calls and lists reach it by
    :meth:`expression`, because an expression may hold any of them again.
    """

    program: Program
    source: ModuleSource
    expressions: Callable[[Scope, ast.expr, Kind | None], Code]
    owner: Owner | None = None
    returns: Kind = NOTHING
    kinds: dict[str, Kind] = field(default_factory=dict)
    pointers: set[str] = field(default_factory=set)
    mutated: set[str] = field(default_factory=set)
    ranges: dict[str, Bounds] = field(default_factory=dict)
    before: list[str] = field(default_factory=list)
    conditional: int = 0
    faults: int = 0
    temporaries: int = 0
    changed: bool = False
    fixed: set[str] = field(default_factory=set)
    aliases: dict[str, str] = field(default_factory=dict)
    homes: dict[str, ast.AST] = field(default_factory=dict)
    once: set[str] = field(default_factory=set)
    read: set[str] = field(default_factory=set)
    begun: set[str] = field(default_factory=set)
    constants: set[str] = field(default_factory=set)
    covered: set[str] = field(default_factory=set)

    def refuse(self, node: ast.AST, message: str) -> NoReturn:
        self.source.refuse(node, message)

    def expression(self, node: ast.expr, wanted: Kind | None = None) -> Code:
        """Translate an expression; ``wanted`` is the kind to which it is converted, if that is known."""
        return self.expressions(self, node, wanted)

    def condition(self, node: ast.expr) -> Code:
        return truth(value_of(self, self.expression(node)))

    def fault(self) -> str:
        """Return the argument by which a call can raise, and remember that it can."""
        self.faults += 1
        return "fault"

    def may_raise(self, before: int) -> bool:
        """Tell whether a slave's method can have raised since there were ``before`` faults; functions go on."""
        return self.owner is not None and self.faults > before

    def check_faults(self, before: int) -> list[str]:
        """Return the statement that leaves a method if it can have raised since there were ``before`` faults."""
        return [self.fault_check()] if self.may_raise(before) else []

    def fault_check(self) -> str:
        """Return the statement that leaves a function once something was raised."""
        return f"if (fault->kind) return{self.empty_result()};"

    def empty_result(self) -> str:
        """Return what a function gives back when it raises, which nobody looks at."""
        if self.returns == NOTHING:
            return ""
        if isinstance(self.returns, Tuple | Items):
            return f" ({self.program.names.c(self.returns)}){{0}}"
        return " pair_of(0.0)" if self.program.paired and self.returns == REAL else " 0"

    def local(self, name: str) -> str:
        """Return the C name of a local variable, which covers nothing that the function needs by that name."""
        plain = self.program.local_name(name)
        while plain in self.covered or (plain != name and plain in self.kinds):
            plain += "_"
        return plain

    def note_mutation(self, node: ast.expr) -> None:
        """Note that the list to which ``node`` leads is changed."""
        while isinstance(node, ast.Subscript | ast.Attribute):
            node = node.value
        if isinstance(node, ast.Name):
            name = node.id
            while name not in self.mutated:
                self.mutated.add(name)
                self.changed = True
                name = self.aliases.get(name, name)

    def temporary(self, stem: str) -> str:
        while True:
            self.temporaries += 1
            name = f"{stem}_{self.temporaries}"
            if name not in self.kinds:
                return name

    def hoist(self, node: ast.AST, code: Code, stem: str) -> Code:
        """Give a value a name before the statement in which it stands."""
        if self.conditional:
            self.refuse(node, "this value must be given a name first, because it is needed under a condition")
        name = self.temporary(stem)
        self.before.append(f"const {self.program.names.c(code.kind)} {name} = {code.text};")
        return Code(name, code.kind, place=True)

    def assign_kind(self, node: ast.AST, name: str, kind: Kind) -> None:
        """Note that a local variable takes a value of ``kind``; whole numbers widen to reals."""
        known = self.kinds.get(name)
        if known is None:
            self.kinds[name] = kind
            self.changed = True
        elif known != kind:
            if {known, kind} != {REAL, WHOLE}:
                self.refuse(node, f"`{name}` must keep its type {describe(known)}, but is assigned {describe(kind)}")
            if known == WHOLE:
                self.kinds[name] = REAL
                self.changed = True


def convert(scope: Scope, node: ast.AST, code: Code, kind: Kind) -> Code:
    """Return ``code`` as a value of ``kind``, or refuse."""
    if code.kind == kind:
        return code
    if kind == REAL and code.kind == WHOLE:
        return as_real(scope, code)
    if isinstance(kind, Tuple) and isinstance(code.kind, Tuple) and code.kind.items == kind.items:
        return code if code.kind.uniform == kind.uniform else _rename_tuple(scope, node, code, kind)
    if isinstance(kind, ArrayKind) and isinstance(code.kind, ArrayKind) and _fits(code.kind, kind):
        return code
    return scope.refuse(node, f"a value must be {describe(kind)}, but is {describe(code.kind)}")


def _fits(given: ArrayKind, wanted: ArrayKind) -> bool:
    same = given.item == wanted.item and len(given.shape) == len(wanted.shape)
    return same and all(b is None or a == b for a, b in zip(given.shape, wanted.shape, strict=False))


def as_real(scope: Scope, code: Code) -> Code:
    """Return a number as a float; in C plain ones convert by themselves."""
    if not scope.program.paired:
        return Code(code.text, REAL, code.level) if code.kind == WHOLE else code
    return code if code.kind == REAL else constant_pair(f"(double){code.within(UNARY)}")


def constant_pair(plain: str) -> Code:
    """Return a number that does not depend on what is differentiated by."""
    return Code(f"pair_of({plain})", REAL, plain=plain)


def value_of(scope: Scope, code: Code) -> Code:
    """Return a number without its derivative, as conditions and messages take it."""
    if not scope.program.paired or code.kind != REAL:
        return code
    return Code(f"({code.plain})" if code.plain else f"{member(code)}v", REAL)


def _rename_tuple(scope: Scope, node: ast.AST, code: Code, kind: Tuple) -> Code:
    assert isinstance(code.kind, Tuple)
    if not code.place:
        code = scope.hoist(node, code, "pair")
    if scope.program.paired:
        scope.refuse(node, "a NamedTuple must not be made where derivatives are taken: it holds none")
    parts = ", ".join(item_of(code, n).text for n in range(len(kind.items)))
    return compound(scope, kind, parts)


def compound(scope: Scope, kind: Kind, parts: str) -> Code:
    """Return a tuple made of ``parts``."""
    assert isinstance(kind, Tuple)
    braces = f"{{{{{parts}}}}}" if kind.uniform else f"{{{parts}}}"
    return Code(f"({scope.program.names.c(kind)}){braces}", kind)


def item_of(code: Code, n: int) -> Code:
    """Return the item ``n``, from 0, of a tuple that has a name."""
    assert isinstance(code.kind, Tuple)
    field = f"v[{n}]" if code.kind.uniform else field_name(code.kind, n)
    return Code(member(code) + field, code.kind.items[n], place=True)


def part_of(scope: Scope, code: Code, n: int) -> Code:
    """Return :func:`item_of`; one of parameters has no derivative."""
    item = item_of(code, n)
    paired = scope.program.paired and isinstance(code.kind, Tuple) and code.kind.names and item.kind == REAL
    return constant_pair(item.text) if paired else item


def member(base: Code) -> str:
    """Return ``base.`` or, for what is behind a pointer, ``base->``."""
    return f"{base.text[1:]}->" if base.text.startswith("*") else f"{base.within(PRIMARY)}."


def address_of(code: Code) -> str:
    """Return the address of a place."""
    if code.address:
        return code.address
    return code.text[1:] if code.text.startswith("*") else f"&{code.within(PRIMARY)}"


def join_kinds(scope: Scope, node: ast.AST, first: Kind, other: Kind) -> Kind:
    """Return the kind of a value that is of either kind."""
    if first == other:
        return first
    if {first, other} == {REAL, WHOLE}:
        return REAL
    return scope.refuse(node, f"both values must be of one type, but are {describe(first)} and {describe(other)}")


def truth(code: Code) -> Code:
    """Return a value as a condition, as Python takes it."""
    if code.kind == TRUTH:
        return code
    if isinstance(code.kind, Items):
        return Code(f"{code.within(PRIMARY)}.n > 0", TRUTH, RELATION)
    return Code(f"{code.within(EQUALITY + 1)} != 0", TRUTH, EQUALITY)
