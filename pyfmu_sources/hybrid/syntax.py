"""The syntax tree of Python source, safe to ask for from several threads at once."""

import ast
from threading import Lock

# CPython up to 3.11.9 and 3.12.4 counts the depth of all threads' trees together: two at once end in
# "SystemError: AST constructor recursion depth mismatch" (gh-106905).
_ONE_AT_A_TIME = Lock()


def parse_python(source: bytes | str) -> ast.Module:
    """Return the syntax tree of a module, or raise ``SyntaxError``."""
    with _ONE_AT_A_TIME:
        return ast.parse(source)


def parse_expression(source: str) -> ast.expr:
    """Return the syntax tree of an expression, or raise ``SyntaxError``."""
    with _ONE_AT_A_TIME:
        return ast.parse(source, mode="eval").body
