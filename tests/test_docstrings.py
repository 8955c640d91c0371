"""The public API says what it takes, gives and raises; no line of a docstring only repeats a name."""

import ast
import re
from functools import cache

import orchestrator
from tests.support.sources import ROOT, SOURCES, nodes_of, tree_of

# What others build on: base classes and protocols, beside all that `orchestrator` exports.
PROTOCOLS = (
    "orchestrator.estimation.protocol",
    "orchestrator.master.protocol",
)
SECTION = re.compile(r"^ *(Args|Attributes|Returns|Yields|Raises|Examples):$")
# A unit, a shape, a number, code or a mapping: lines with one of these say something however short they are.
CONTENT = re.compile(r"\[[^\]]+\]|\(\w+,|\d|`|shape|\"|->")
FEWEST_WORDS = 4


@cache
def trees():
    """The sources by the names of their modules."""
    return {path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): tree_of(path) for path in SOURCES}


@cache
def classes():
    """All classes of the sources by name."""
    return {node.name: node for tree in trees().values() for node in tree.body if isinstance(node, ast.ClassDef)}


def inherited(name):
    """Names of the methods that the bases of a class document."""
    bases = [base.id for base in classes()[name].bases if isinstance(base, ast.Name) and base.id in classes()]
    known = {f.name for base in bases for f in classes()[base].body if isinstance(f, ast.FunctionDef)}
    return known.union(*(inherited(base) for base in bases))


def raises(node):
    """Whether the function itself raises an error, rather than a function inside it or again what it caught."""
    left = list(node.body)
    while left:
        n = left.pop()
        if isinstance(n, ast.Raise) and n.exc is not None:
            return True
        if not isinstance(n, (ast.FunctionDef, ast.ClassDef, ast.Lambda)):
            left += ast.iter_child_nodes(n)
    return False


def lacking(node):
    """Which sections a function's docstring lacks."""
    text = ast.get_docstring(node) or ""
    arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    decorators = {d.id for d in node.decorator_list if isinstance(d, ast.Name)}
    gives = node.returns is not None and not (isinstance(node.returns, ast.Constant) and node.returns.value is None)
    lack = []
    if set(arguments) - {"self", "cls"} and "Args:" not in text:
        lack.append("Args")
    if gives and not decorators & {"property", "cached_property"} and "Returns:" not in text and "Yields:" not in text:
        lack.append("Returns")
    if raises(node) and "Raises:" not in text:
        lack.append("Raises")
    return lack


def public_nodes():
    """Functions and classes that are exported, and those of the protocols, with their modules."""
    for name, module in {**vars(orchestrator)["_PUBLIC"], "Result": "orchestrator.api.shown"}.items():
        yield from ((module, node) for node in trees()[module].body if getattr(node, "name", None) == name)
    for module in PROTOCOLS:
        public = [n for n in trees()[module].body if isinstance(n, (ast.FunctionDef, ast.ClassDef))]
        yield from ((module, node) for node in public if not node.name.startswith("_"))


def public_functions(module, node):
    """The function itself, or the public methods of a class, those aside that a base class documents."""
    known = inherited(node.name) if isinstance(node, ast.ClassDef) else set()
    functions = [f for f in getattr(node, "body", []) if isinstance(f, ast.FunctionDef)]
    functions = [node] if isinstance(node, ast.FunctionDef) else [f for f in functions if f.name not in known]
    forms = [f for f in functions if any("overload" in ast.dump(d) for d in f.decorator_list)]
    return [f for f in functions if f not in forms and not f.name.startswith("_")]


def test_the_public_api_says_what_it_takes_gives_and_raises():
    functions = [(f"{m}.{node.name}", f) for m, node in public_nodes() for f in public_functions(m, node)]
    assert len(functions) > 100
    assert not [f"{place}, {f.name}: {lacking(f)}" for place, f in functions if lacking(f)]


def entries(text):
    """(section, entry) of a docstring, entries joined to one line."""
    section, entry = "", ""
    for line in [*text.splitlines(), ""]:
        start = SECTION.match(line)
        begins = re.match(r" {4}\S", line)
        if entry and (start or begins or not line.strip()):
            yield section, entry
            entry = ""
        if start:
            section = start[1]
        elif section and line.startswith("    "):
            entry = f"{entry} {line.strip()}".strip()
        elif line.strip():
            section = ""


def empty_words(nodes):
    """Lines on arguments, attributes and results that say no more than their names do."""
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            for section, entry in entries(ast.get_docstring(node) or ""):
                text = entry.split(": ", 1)[-1] if section in ("Args", "Attributes") else entry
                few = len(re.findall(r"\w+", text)) < FEWEST_WORDS and not CONTENT.search(text)
                if section in ("Args", "Attributes", "Returns", "Yields") and (few or text.startswith("True when it ")):
                    yield f"{node.name}, {section}: {entry}"


def test_lines_on_arguments_say_more_than_the_name():
    assert not [f"{path.name}: {line}" for path in SOURCES for line in empty_words(nodes_of(path))]


def test_lines_that_repeat_a_name_are_found():
    lines = ["Open.", "", "Args:", "    path: the file.", "    step: [s].", "", "Returns:", "    True when it does."]
    nodes = ast.walk(ast.parse("def open_it(path, step):\n    '" + "\\n".join(lines) + "'"))
    assert list(empty_words(nodes)) == [
        "open_it, Args: path: the file.",
        "open_it, Returns: True when it does.",
    ]
