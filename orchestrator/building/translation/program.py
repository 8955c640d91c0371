"""A whole program in C: the functions that are asked for and all that they call, with their types and constants."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from typing import Any

from orchestrator.building.translation.definitions import Function, Owner, comment_of
from orchestrator.building.translation.kinds import KEYWORDS, ArrayKind, KindNames
from orchestrator.building.translation.source import ModuleSource, docstring, read_source
from orchestrator.errors import FmuError

# Names that the headers of the C library take at file scope.
_TAKEN = (
    "abs acos asin atan atan2 ceil copysign cos cosh div erf erfc exit exp fabs floor fmax fmin fmod free frexp gamma "
    "hypot isfinite isinf isnan j0 j1 jn labs ldexp lgamma log log10 main malloc modf nan pow powf printf qsort rand "
    "remainder remove rename rint round sin sinh sqrt system tan tanh tgamma time trunc y0 y1 yn clock signal index"
)
_MACROS = "EOF NULL NAN INFINITY DOMAIN SING OVERFLOW UNDERFLOW PLOSS TLOSS HUGE"
RESERVED = KEYWORDS | {"self", "fault", *_MACROS.split()}
TAKEN = RESERVED | frozenset(_TAKEN.split())

Translator = Callable[["Program", ModuleSource, ast.FunctionDef, str, Owner | None], Function]


class Program:
    """What is translated so far.

    Args:
        translate: the translator of one function: program, module, definition, name in C and owner.
        owner: the slave whose methods are translated, or ``None`` for functions alone.
        taken: names at file scope that the C around it uses.
        beside: the program of plain numbers in the same file; this one is of pairs then, each number with its
            derivative, and shares the constants.
        checked: arithmetic raises where Python does; else it goes on with infinities and NaN, as IEEE 754 says.
    """

    def __init__(
        self,
        translate: Translator,
        owner: Owner | None = None,
        taken: frozenset[str] = frozenset(),
        neighbours: Program | None = None,
        checked: bool = True,
    ) -> None:
        self._translate = translate
        self._taken = TAKEN | taken
        self.paired = neighbours is not None
        self.checked = checked
        self.names: KindNames = KindNames(self._taken, None if neighbours is None else neighbours.names)
        self.owner = owner
        self.owner_name = owner.cls.__name__ if owner is not None else ""
        self._functions: dict[tuple[str, str], Function] = {}
        self._underway: list[tuple[str, str]] = []
        self._given: set[str] = set()  # names of functions, those underway included
        self._constants: dict[str, float | int] = {} if neighbours is None else dict(neighbours._constants)
        self._shared = frozenset(self._constants)
        self._sources: dict[str, ModuleSource] = {}

    # Names --------------------------------------------------------------------------------------------------

    @staticmethod
    def local_name(name: str) -> str:
        return f"{name}_" if name in RESERVED else name

    @staticmethod
    def attribute_name(name: str) -> str:
        plain = name.lstrip("_")
        return f"{plain}_" if plain in RESERVED else plain

    def _global_name(self, name: str, module: str) -> str:
        taken = self._given | set(self._constants) | self._taken
        plain = f"{name.lstrip('_')}{'_pair' if self.paired else ''}"
        given = plain if plain not in taken else _name_in(module, plain)
        self._given.add(given)
        return given

    def constant(self, source: ModuleSource, name: str, value: float | int) -> str:
        """Return the name of a constant, which is defined once."""
        plain = name.lstrip("_")
        for candidate in (plain, _name_in(source.name, plain)):
            known = self._constants.get(candidate)
            if known is None and candidate not in self._taken:
                self._constants[candidate] = value
                return candidate
            if known is not None and known == value and isinstance(known, type(value)):
                return candidate
        raise FmuError(f"{source.path}: the constant `{name}` must have a name of its own, but two modules use it")

    # Functions ----------------------------------------------------------------------------------------------

    def function(self, user: ModuleSource | None, node: ast.AST | None, target: Callable[..., Any]) -> Function:
        source = self._source(target.__module__)
        name = target.__name__
        definition = source.functions.get(name)
        if definition is None:
            raise FmuError(f"{source.path}: `{name}` must be a function of this module, but is not")
        if name in vars(source.module).get("IN_C", ()):
            return _function_in_c(source, definition)
        return self._translate_function(user, node, (target.__module__, name), source, definition, None)

    def method(self, user: ModuleSource | None, node: ast.AST | None, name: str) -> Function:
        assert self.owner is not None
        for cls in self.owner.cls.__mro__:
            if name in vars(cls) and cls.__module__ not in BASE_MODULES:
                source = self._source(cls.__module__)
                body = next(n for n in source.tree.body if isinstance(n, ast.ClassDef) and n.name == cls.__name__)
                definition = next(n for n in body.body if isinstance(n, ast.FunctionDef) and n.name == name)
                return self._translate_function(user, node, (cls.__qualname__, name), source, definition, self.owner)
        message = f"`{self.owner_name}` must have a method `{name}` of its own, but has none"
        if user is not None and node is not None:
            user.refuse(node, message)
        raise FmuError(message)

    def _translate_function(
        self,
        user: ModuleSource | None,
        node: ast.AST | None,
        key: tuple[str, str],
        source: ModuleSource,
        definition: ast.FunctionDef,
        owner: Owner | None,
    ) -> Function:
        if key in self._underway:
            (user or source).refuse(node or definition, f"`{key[1]}` must not call itself")
        if key not in self._functions:
            self._underway.append(key)
            name = f"{self.owner_name}_{key[1].lstrip('_')}" if owner is not None else key[1]
            function = self._translate(self, source, definition, self._global_name(name, source.name), owner)
            self._underway.pop()
            self._functions[key] = function
        return self._functions[key]

    def _source(self, module: str) -> ModuleSource:
        source = read_source(module)
        if source.name not in self._sources:
            self._sources[source.name] = source
            for imported in source.imports():
                self._source(imported)
            for name, kind in source.aliases():
                self.names.suggest(kind, name)
        return source

    # Text -----------------------------------------------------------------------------------------------------

    def types(self) -> str:
        return "\n\n".join(self.names.definitions())

    def constants(self) -> str:
        """Return the definitions of the constants in use."""
        own = {n: v for n, v in self._constants.items() if n not in self._shared}
        wholes = {n: v for n, v in own.items() if isinstance(v, int) and abs(v) < 2**31}
        lines = [f"enum {{ {name} = {value} }};" for name, value in sorted(wholes.items())]
        others = {n: v for n, v in own.items() if n not in wholes}
        kinds = {name: "int64_t" if isinstance(value, int) else "double" for name, value in others.items()}
        lines += [f"static const {kinds[name]} {name} = {value!r};" for name, value in sorted(others.items())]
        return "\n".join(lines)

    def prototypes(self) -> str:
        return "\n".join(f"{function.head};" for function in self._in_order())

    def definitions(self) -> str:
        """Return every function, module by module."""
        parts: list[str] = []
        module = ""
        for function in self._in_order():
            if function.module != module:
                module = function.module
                first = docstring(self._sources[module].tree).split("\n\n")[0]
                title = f"{module.partition('[')[0].replace('.', '/')}.py: {first}"
                parts.append(f"/* {'-' * 110} */\n{comment_of(title)}".rstrip())
            parts.append(function.text)
        return "\n\n".join(parts)

    def _in_order(self) -> list[Function]:
        modules = list(dict.fromkeys(function.module for function in self._functions.values()))
        return sorted(self._functions.values(), key=lambda f: (modules.index(f.module), f.line))


def _name_in(module: str, name: str) -> str:
    """Return a name in C with that of its module, ``laws.friction`` or ``hybrid.machine[axis]``, in front."""
    return f"{re.sub(r'[^A-Za-z0-9]+', '_', module).strip('_')}_{name}"


def _function_in_c(source: ModuleSource, node: ast.FunctionDef) -> Function:
    """Return what the headers define already: a function of numbers and arrays, which it may fill."""
    parameters = [(argument.arg, source.annotation(argument.annotation, argument)) for argument in node.args.args]
    function = Function(
        node.name, node.name, source.name, node.lineno, parameters, source.annotation(node.returns, node), {}, False
    )
    function.mutated = {name for name, kind in parameters if isinstance(kind, ArrayKind)}
    return function


BASE_MODULES = ("pyfmu_sources.adapters.slave_base", "pyfmu_sources.adapters.sampled_slave")
