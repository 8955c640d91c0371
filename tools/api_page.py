"""Write ``docs/api.md`` and ``orchestrator/__init__.pyi``: what ``import orchestrator as oc`` offers.

python -m tools.api_page
"""

import inspect
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import orchestrator as oc

PAGE = Path(__file__).resolve().parents[1] / "docs" / "api.md"
STUB = Path(oc.__file__).with_suffix(".pyi")
HEAD = """# Python API

`import orchestrator as oc` gives these names. Angles are in rad, torques in N.m, times in s, all others in SI units.
How they work together is in [python.md](python.md). This page is written from the docstrings by
`python -m tools.api_page`.
"""
SECTIONS = ("Args", "Attributes", "Returns", "Yields", "Raises", "Example")


def page() -> str:
    """Build the page.

    Returns:
        Its Markdown text.
    """
    objects = {name: getattr(oc, name) for name in sorted(dir(oc)) if not name.startswith("_")}
    functions = {n: o for n, o in objects.items() if inspect.isfunction(o)}
    errors = {n: o for n, o in objects.items() if inspect.isclass(o) and issubclass(o, Exception)}
    classes = {n: o for n, o in objects.items() if n not in functions and n not in errors}
    parts = [HEAD, "\n## Functions\n"]
    parts += [_function(name, function) for name, function in functions.items()]
    parts.append("\n## Results and other types\n")
    parts += [_class(name, kind) for name, kind in classes.items()]
    parts.append("\n## Errors\n\n| error | is a | meaning |\n|---|---|---|\n")
    for name, kind in errors.items():
        parts.append(f"| `{name}` | `{kind.__bases__[0].__name__}` | {_inline(_head(kind))} |\n")
    return "".join(parts)


def stub() -> str:
    """Build what a type checker and an editor read in place of the lazy names.

    Returns:
        Its text.
    """
    homes = {**vars(oc)["_PUBLIC"], "__version__": "orchestrator.shared.version"}
    lines = sorted(f"from {home} import {name} as {name}\n" for name, home in homes.items())
    return "# What a type checker and an editor see of the package; the names are loaded lazily.\n" + "".join(lines)


def _head(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")


def _inline(text: str) -> str:
    return text.replace("``", "`").replace("|", "\\|")


def _function(name: str, function: Any) -> str:
    return f"\n### `{name}`\n\n```python\n{_signature(name, function)}\n```\n\n{_document(function)}"


def _signature(name: str, function: Any) -> str:
    """Return name and arguments, one a line where they are many, without types."""
    given = []
    for argument in inspect.signature(function).parameters.values():
        if argument.kind is argument.KEYWORD_ONLY and "*" not in given:
            given.append("*")
        default = argument.default
        shown = getattr(default, "__name__", None) or repr(default)
        text = f"**{argument.name}" if argument.kind is argument.VAR_KEYWORD else argument.name
        given.append(text if default is argument.empty else f"{text}=..." if callable(default) else f"{text}={shown}")
    line = f"oc.{name}({', '.join(given)})"
    return line if len(line) <= 110 else f"oc.{name}(\n    " + ",\n    ".join(given) + ",\n)"


def _document(thing: Any) -> str:
    text = inspect.getdoc(thing) or ""
    pieces = re.split(rf"(?m)^({'|'.join(SECTIONS)}):\n", text)
    out = [_inline(pieces[0].strip()) + "\n"]
    for title, body in zip(pieces[1::2], pieces[2::2], strict=True):
        out.append(_section(title, inspect.cleandoc(body)))
    return "\n".join(out)


def _section(title: str, body: str) -> str:
    if title == "Example":
        return f"```python\n{body}\n```\n"
    if title in ("Returns", "Yields"):
        return f"**{title}:** {_inline(' '.join(body.split()))}\n"
    rows = [re.sub(r"\s+", " ", entry) for entry in re.split(r"\n(?! )", body)]
    lines = []
    for row in rows:
        name, _, meaning = row.partition(": ")
        lines.append(f"- `{name}`: {_inline(meaning)}")
    return f"**{title}:**\n\n" + "\n".join(lines) + "\n"


def _class(name: str, kind: Any) -> str:
    lines = [f"\n### `{name}`\n\n{_document(kind)}"]
    members = [f"- {_member(member, value)}\n" for member, value in _members(kind)]
    if members:
        lines.append("\n" + "".join(members))
    return "".join(lines)


def _members(kind: Any) -> Iterator[tuple[str, Any]]:
    """Yield public properties and methods, those of bases of ours included, each once."""
    seen: set[str] = set()
    for base in kind.__mro__:
        if not base.__module__.startswith("orchestrator"):
            continue
        for name, value in vars(base).items():
            wanted = isinstance(value, (property, cached_property)) or inspect.isfunction(value)
            if wanted and not name.startswith("_") and name not in seen and inspect.getdoc(value):
                seen.add(name)
                yield name, value


def _member(name: str, value: Any) -> str:
    if not inspect.isfunction(value):
        return f"`{name}`: {_inline(_head(value))}"
    arguments = [p.name for p in inspect.signature(value).parameters.values() if p.name != "self"]
    return f"`{name}({', '.join(arguments)})`: {_inline(_head(value))}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    STUB.write_text(stub(), encoding="utf-8")
