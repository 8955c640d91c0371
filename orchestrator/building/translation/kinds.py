"""The kinds of value in the translated subset: numbers, fixed tuples, lists of declared capacity, arrays."""

from __future__ import annotations

import types
import typing
from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_origin


@dataclass(frozen=True)
class Scalar:
    """A number, a truth value or nothing, with its name in C."""

    c: str
    word: str


REAL = Scalar("double", "float")
WHOLE = Scalar("int64_t", "int")
TRUTH = Scalar("bool", "bool")
NOTHING = Scalar("void", "None")


@dataclass(frozen=True)
class Tuple:
    """A tuple of fixed length; a NamedTuple has a title and names: it holds parameters, which have no derivative."""

    items: tuple[Kind, ...]
    names: tuple[str, ...] = ()
    title: str = ""

    @property
    def uniform(self) -> bool:
        """Whether all items are of one kind, so that an array holds them."""
        return not self.names and all(item == self.items[0] for item in self.items)


@dataclass(frozen=True)
class Items:
    """A list of at most ``capacity`` items of one kind."""

    item: Kind
    capacity: int


@dataclass(frozen=True)
class Store:
    """``self.real`` or ``self.integer`` of a slave: values by value reference."""

    attribute: str
    length: int


@dataclass(frozen=True)
class ArrayKind:
    """A contiguous array of floats or ints that the caller owns; a length is ``None`` where only the call says it.

    In sources it stands in an annotation, ``Annotated[Any, ArrayKind(REAL, (None, 2))]``; see :mod:`kernel_arrays`.
    """

    item: Scalar
    shape: tuple[int | None, ...]


Kind = Scalar | Tuple | Items | Store | ArrayKind
_SCALARS: dict[Any, Scalar] = {float: REAL, int: WHOLE, bool: TRUTH, None: NOTHING, type(None): NOTHING}
_KEYWORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true "
    "false"
)
KEYWORDS = frozenset(_KEYWORDS.split())
ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")


class KindError(ValueError):
    """An annotation is outside the subset."""


def kind_of(annotation: Any) -> Kind:
    """Return the kind that an evaluated annotation, such as ``float`` or ``tuple[float, float]``, stands for."""
    if isinstance(annotation, type | None) and annotation in _SCALARS:
        return _SCALARS[annotation]
    if isinstance(annotation, type) and issubclass(annotation, tuple) and hasattr(annotation, "_fields"):
        hints = typing.get_type_hints(annotation, include_extras=True)
        return Tuple(
            tuple(kind_of(hints[name]) for name in annotation._fields), tuple(annotation._fields), annotation.__name__
        )
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated and isinstance(arguments[1], ArrayKind):
        return arguments[1]
    if origin is Annotated:
        return _with_capacity(arguments[0], arguments[1])
    if origin is tuple and arguments and arguments[-1] is Ellipsis:
        raise KindError(
            "a tuple must have a length: tuple[float, float], Annotated[tuple[float, ...], N] or a NamedTuple"
        )
    if origin is tuple and arguments:
        return Tuple(tuple(kind_of(argument) for argument in arguments))
    if origin is list or annotation is list:
        raise KindError("a list must have a capacity: Annotated[list[T], N]")
    name = annotation.__name__ if isinstance(annotation, type) else str(annotation)
    raise KindError(f"a type must be float, int, bool, a fixed tuple or a list of declared capacity, but is {name}")


def _with_capacity(base: Any, capacity: Any) -> Kind:
    if not isinstance(capacity, int) or capacity < 1:
        raise KindError(f"a capacity must be a positive integer, but is {capacity!r}")
    if get_origin(base) is list:
        return Items(kind_of(get_args(base)[0]), capacity)
    if get_origin(base) is tuple and get_args(base)[1:] == (Ellipsis,):
        return Tuple((kind_of(get_args(base)[0]),) * capacity)
    raise KindError("only a list or a tuple such as tuple[float, ...] has a capacity")


def is_type(value: Any) -> bool:
    """Tell whether a module's global is an alias of a tuple or list, or a NamedTuple."""
    if isinstance(value, types.GenericAlias) or get_origin(value) is Annotated:
        return True
    return isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields")


def describe(kind: Kind) -> str:
    """Return the kind in words, for messages."""
    match kind:
        case Scalar():
            return kind.word
        case Tuple():
            return f"tuple[{', '.join(describe(item) for item in kind.items)}]"
        case Items():
            return f"list[{describe(kind.item)}] of at most {kind.capacity}"
        case Store():
            return f"self.{kind.attribute}"
        case ArrayKind():
            return f"array of {kind.item.word}, ({', '.join('n' if n is None else str(n) for n in kind.shape)})"


def size_of(kind: Kind) -> int:
    """Return how many numbers a value holds: 1 for what is no tuple."""
    if isinstance(kind, Tuple):
        return sum(size_of(item) for item in kind.items)
    return 1


PAIR = "Pair"  # a value and its derivative, in C


class KindNames:
    """The names of tuples and lists in C: those of the source's aliases, else made from the items.

    Args:
        plain: the names of plain numbers in the same file; floats are pairs of a value and its derivative here.
    """

    def __init__(self, taken: frozenset[str] = frozenset(), plain: KindNames | None = None) -> None:
        self._taken = taken
        self._plain = plain
        self._paired = plain is not None
        self._names: dict[Kind, str] = {}
        self._order: list[Kind] = []

    def suggest(self, kind: Kind, name: str) -> None:
        """Let ``kind`` be called ``name`` unless it has a name or the name is taken."""
        name = kind.title if isinstance(kind, Tuple) and kind.title else self._unique_name(name)
        free = name not in self._names.values() and name not in self._taken
        if isinstance(kind, Tuple | Items) and kind not in self._names and free:
            self._names[kind] = name

    def c(self, kind: Kind) -> str:
        """Return the C type of a value of this kind, and remember that it has to be defined."""
        match kind:
            case Scalar():
                return PAIR if self._paired and kind == REAL else kind.c
            case Store():
                return "double *" if kind.attribute == "real" else "int *"
            case ArrayKind():
                return f"{'Reals' if kind.item == REAL else 'Wholes'}{len(kind.shape)}"
        if self._plain is not None and isinstance(kind, Tuple) and kind.names:
            return self._plain.c(kind)
        if kind not in self._order:
            for item in kind.items if isinstance(kind, Tuple) else (kind.item,):
                self.c(item)
            self._order.append(kind)
        if kind not in self._names:
            name = plain = self._unique_name(self._make(kind))
            while name in self._names.values() or name in self._taken:  # two modules may call their tuples the same
                name += f"_of_{plain}"
            self._names[kind] = name
        return self._names[kind]

    def in_use(self) -> set[str]:
        """Return the names of all that was asked for."""
        return {self._names[kind] for kind in self._order}

    def _unique_name(self, name: str) -> str:
        return f"{name}{PAIR}" if self._paired and PAIR not in name else name

    def _make(self, kind: Tuple | Items) -> str:
        if isinstance(kind, Items):
            return f"List_of_{kind.capacity}_{self.c(kind.item)}"
        if kind.title:
            return kind.title
        names = [self.c(item) for item in kind.items]
        if kind.uniform:
            return f"{names[0]}_x{len(names)}"
        return "_and_".join(names)

    def definitions(self) -> list[str]:
        """Return the typedefs of all that was asked for, items first."""
        return [self._definition(kind) for kind in self._order]

    def _definition(self, kind: Kind) -> str:
        name = self._names[kind]
        if isinstance(kind, Items):
            return f"typedef struct {{\n    int64_t n;\n    {self.c(kind.item)} v[{kind.capacity}];\n}} {name};"
        assert isinstance(kind, Tuple)
        if kind.uniform:
            return f"typedef struct {{\n    {self.c(kind.items[0])} v[{len(kind.items)}];\n}} {name};"
        fields = "\n".join(f"    {self.c(item)} {field_name(kind, n)};" for n, item in enumerate(kind.items))
        return f"typedef struct {{\n{fields}\n}} {name};"


def field_name(kind: Tuple, n: int) -> str:
    """Return the name of the field ``n``, from 0, of a tuple that is not uniform."""
    if kind.names:
        return f"{kind.names[n]}_" if kind.names[n] in KEYWORDS else kind.names[n]
    return ORDINALS[n] if n < len(ORDINALS) else f"item{n + 1}"
