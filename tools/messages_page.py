"""The page of messages: those that a user can meet, as the source has them. The site is built with it.

python -m tools.messages_page prints it.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import chain
from pathlib import Path

from tools import refuse_arguments

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted(path for room in ("orchestrator", "pyfmu_sources") for path in (ROOT / room).rglob("*.py"))
HEAD = """# Messages

The messages that commands and the library give, by what they are. `…` stands for names and values of the moment. The
second column names the part of the library. The rules behind findings are in [rules](rules.md), those that lower a
grade in [settings](settings.md#rules). This page is made from the source when the site is built.

"""
# Bases of the classes whose texts reach the user, and what their section is called.
ERRORS = {
    "RecordError": "Errors: records",
    "NotApplicableError": "Errors: methods that do not apply",
    "ScenarioError": "Errors: scenarios, models, maps and SSP files",
    "FmuError": "Errors: FMUs",
    "ConnectionMismatchError": "Errors: connections",
    "DesignError": "Errors: controllers and estimators",
    "CalibrationError": "Errors: calibrations",
    "OutputError": "Errors: results that cannot be written",
    "InputError": "Errors: other input",
    "SlaveError": "Errors: calls of an FMU",
    "ChildError": "Errors: child processes",
    "ConvergenceError": "Errors: iterations",
    "SimulationError": "Errors: runs",
    "StepRefusedError": "Refusals of our FMUs",
}
NOTES = "Notes, remarks and reasons"
FINDINGS = "Findings of check"
# Names that hold texts for the user, and calls that take one.
HOLDERS = {"notes", "reasons", "remarks", "warnings", "red", "amber", "remark", "warning", "message", "said"}
TAKERS = {"Reason", "RunRemark", "warn", "Finding"}
FINDING_TAKERS = {"report", "report_difference", "_add"}  # of the room of checking
ADDERS = {"append", "extend"}
WORD = re.compile(r"[A-Za-z]{2,}")
LEAST_WORDS = 3


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    messages = collect(SOURCES)
    for title in (*ERRORS.values(), NOTES, FINDINGS):
        rows = sorted({f"| {text} | {room} |\n" for text, room in messages[title]}, key=str.casefold)
        if rows:
            parts.append(f"## {title}\n\n| message | from |\n|---|---|\n{''.join(rows)}\n")
    return "".join(parts).rstrip() + "\n"


def collect(paths: list[Path]) -> dict[str, list[tuple[str, str]]]:
    """Return the messages of files by the title of their section, each with its room."""
    read = {path: [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))] for path in paths}
    titles = _titles(chain(*read.values()))
    functions = {node.name: node for node in chain(*read.values()) if isinstance(node, ast.FunctionDef)}
    collected: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for path, nodes in read.items():
        package, room = path.relative_to(ROOT).parts[:2]
        room = room.removesuffix(".py") if package == "orchestrator" else "FMU"
        for scope in (node for node in nodes if isinstance(node, (ast.Module, ast.FunctionDef))):
            for title, value in _messages(scope, titles, TAKERS | FINDING_TAKERS if room == "checking" else TAKERS):
                texts = list(_texts(value, scope))
                for call in ast.walk(value) if title == NOTES else ():
                    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in functions:
                        texts += _returned(functions[call.func.id])
                section = FINDINGS if title == NOTES and room == "checking" else title
                collected[section] += [(_escaped(text), room) for text in texts if _is_sentence(text)]
    return collected


def _titles(nodes: Iterable[ast.AST]) -> dict[str, str]:
    """Return the title of each class of errors; a class without one of its own has that of its base."""
    bases = {
        node.name: [base.id for base in node.bases if isinstance(base, ast.Name)]
        for node in nodes
        if isinstance(node, ast.ClassDef)
    }

    def title(name: str) -> str | None:
        return ERRORS.get(name) or next(filter(None, map(title, bases.get(name, ()))), None)

    return {name: found for name in bases if (found := title(name))}


@cache
def _scope_nodes(scope: ast.AST) -> list[ast.AST]:
    """Return what is in a module or function and in no function within it."""
    found = []
    waiting = [scope]
    while waiting:
        found.append(node := waiting.pop())
        waiting += [child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.FunctionDef)][::-1]
    return found[1:]


def _messages(scope: ast.AST, titles: dict[str, str], takers: set[str]) -> Iterator[tuple[str, ast.expr]]:
    """Yield the expressions of a scope that are messages, with the title of their section."""
    for node in _scope_nodes(scope):
        if isinstance(node, ast.Call):
            name = _name(node.func)
            if name in titles:
                yield from ((titles[name], argument) for argument in node.args[:1])
            elif name in takers or (name in ADDERS and _name(getattr(node.func, "value", node.func)) in HOLDERS):
                yield from ((NOTES, argument) for argument in node.args)
            yield from ((NOTES, word.value) for word in node.keywords if word.arg in HOLDERS)
        elif isinstance(node, (ast.Assign, ast.AugAssign, ast.AnnAssign)) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(_name(target) in HOLDERS for target in targets):
                yield NOTES, node.value


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _returned(function: ast.FunctionDef) -> list[str]:
    """Return the texts that a function returns or yields."""
    given = [n.value for n in _scope_nodes(function) if isinstance(n, (ast.Return, ast.Yield)) and n.value is not None]
    return [text for value in given for text in _texts(value, function)]


def _texts(node: ast.expr, scope: ast.AST) -> Iterator[str]:
    """Yield the texts that an expression may be; values in them are dots."""
    match node:
        case ast.Constant(value=str(text)):
            yield text
        case ast.JoinedStr(values=parts):
            yield "".join(str(p.value) if isinstance(p, ast.Constant) else _value(p, scope) for p in parts)
        case ast.IfExp(body=one, orelse=other):
            yield from (*_texts(one, scope), *_texts(other, scope))
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            lefts, rights = list(_texts(left, scope)), list(_texts(right, scope))
            yield from (f"{a}{b}" for a in lefts or ["…"] for b in rights or ["…"] if lefts or rights)
        case ast.List(elts=items) | ast.Tuple(elts=items):
            for item in items:
                yield from _texts(item, scope)
        case ast.ListComp(elt=item) | ast.GeneratorExp(elt=item) | ast.Starred(value=item):
            yield from _texts(item, scope)
        case ast.Name(id=name):
            for given in (n for n in _scope_nodes(scope) if isinstance(n, ast.Assign)):
                if name in map(_name, given.targets) and name not in map(_name, ast.walk(given.value)):
                    yield from _texts(given.value, scope)


def _is_sentence(text: str) -> bool:
    return min(len(text.split()), len(WORD.findall(text))) >= LEAST_WORDS


def _value(part: ast.expr, scope: ast.AST) -> str:
    """Return what stands for a value within a text: the one text that it may be, else dots."""
    named = isinstance(part, ast.FormattedValue) and isinstance(part.value, ast.Name)
    texts = list(_texts(part.value, scope)) if named else []  # type: ignore[attr-defined]
    return texts[0] if len(texts) == 1 else "…"


def _escaped(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;").replace("……", "…")


if __name__ == "__main__":
    refuse_arguments(__doc__)
    print(page())
