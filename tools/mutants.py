"""Change one thing at a time in the rooms that matter most and see whether their tests notice.

    python -m tools.mutants --count 60 --room records --out mutants.json

Each mutant changes one operator, comparison, constant, branch or statement of one module in a copy of the project and
runs the fast tests of its room there, up to the first that fails; with ``--every`` all of them, and a table says which
tests catch what no other does. ``--marks "night or not slow"`` runs the tests of the night too. A mutant that passes
them all has survived; one whose run has to be ended counts as neither caught nor survived. Slices of one seed share one
sample of mutants; results are merged into the file, so that the slices may run at different times. A mutant that was
not caught is tried again by a later run.
"""

import argparse
import ast
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tools import mutant_order
from tools.mutant_order import LIMIT, NOTES, PLACE

ROOT = Path(__file__).resolve().parents[1]
# s of one test run, for a mutant may loop for ever: processor time of the tests' process, and by the clock.
TIME_LIMIT, CLOCK_LIMIT = 300.0, 3600.0
MARKS = "not slow"  # tests of a day that are quick

COMPARED = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
            ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is}  # fmt: skip
REVERSED = {ast.Lt: ast.Gt, ast.LtE: ast.GtE, ast.Gt: ast.Lt, ast.GtE: ast.LtE}
CALCULATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
              ast.Mod: ast.Mult, ast.Pow: ast.Mult}  # fmt: skip
RENAMED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin",
           "any": "all", "all": "any", "floor": "ceil", "ceil": "floor"}  # fmt: skip


@dataclass(frozen=True)
class Room:
    """Modules whose mutants are made, and the tests that should notice.

    Attributes:
        modules: files, or folders with all that is in them.
        tests: the same.
    """

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS = (
    Room("records", ("orchestrator/records",), ("tests/records",)),
    Room("reporting", ("orchestrator/reporting",), ("tests/reporting",)),
    Room("paired", ("orchestrator/paired",), ("tests/paired",)),
    Room("checking", ("orchestrator/checking",), ("tests/checking",)),
    Room(
        "search",
        ("orchestrator/diagnosis/selection/search.py", "orchestrator/diagnosis/selection/screening.py"),
        ("tests/diagnosis/test_search.py",),
    ),
    Room("grades", ("orchestrator/diagnosis/selection/grading.py",), ("tests/diagnosis/test_grading.py",)),
    Room(
        "fits",
        ("orchestrator/diagnosis/inference/fitting.py", "orchestrator/diagnosis/inference/problem.py"),
        ("tests/diagnosis/test_fitting.py", "tests/diagnosis/test_search.py"),
    ),
    Room("likelihood", ("orchestrator/estimation/innovations.py",), ("tests/estimation/test_innovations.py",)),
    Room(
        "contact",
        ("pyfmu_sources/drivetrain/contact.py", "pyfmu_sources/drivetrain/equations.py"),
        ("tests/plants/test_contact.py", "tests/plants/test_effects_in_equations.py"),
    ),
    Room("journal", ("orchestrator/engine/journal.py",), ("tests/engine/test_engine_journal.py",)),
    Room(
        "extraction",
        ("orchestrator/shared/isolation/archives.py", "orchestrator/shared/output.py"),
        ("tests/shared/isolation/test_archives.py", "tests/shared/test_output.py"),
    ),
)


@dataclass(frozen=True)
class Mutant:
    """One change: where it is, what it does, and the text of the changed line."""

    room: str
    module: str
    line: int
    change: str
    text: str


def changes(tree: ast.Module) -> Iterator[tuple[int, str, int, int]]:
    """Yield (line, change, place of the node, number of its change) of every change in a module's functions."""
    for place, node in enumerate(_mutable(tree)):
        for number, (change, _) in enumerate(_of(node)):
            yield node.lineno, change, place, number


def changed(text: str, place: int, number: int) -> str:
    """Return the source of a module with one of its ``changes``."""
    tree = ast.parse(text)
    node = list(_mutable(tree))[place]
    list(_of(node))[number][1](node)
    return ast.unparse(tree)


def _mutable(tree: ast.Module) -> Iterator[Any]:
    """Yield the nodes of functions that may change: no docstrings, messages, annotations."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            yield from _inside(function.body[1:] if ast.get_docstring(function) else function.body)


def _inside(body: list[ast.stmt]) -> Iterator[ast.AST]:
    waiting: list[ast.AST] = list(reversed(body))
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.FunctionDef, ast.Raise, ast.JoinedStr, ast.Assert)) or _is_strict(node):
            continue  # inner functions come by themselves; texts and checks of what holds anyway are no behaviour
        yield node
        skipped = {id(node.annotation)} if isinstance(node, ast.AnnAssign) else set()
        waiting += [child for child in reversed(list(ast.iter_child_nodes(node))) if id(child) not in skipped]


def _is_strict(node: ast.AST) -> bool:
    """Return whether a node is ``strict=True`` of ``zip``, which checks as ``assert`` does."""
    return isinstance(node, ast.keyword) and node.arg == "strict"


def _of(node: ast.AST) -> Iterator[tuple[str, Callable[[Any], object]]]:
    """Yield (description, function that makes the change in such a node)."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        kind = type(node.ops[0])
        if kind in COMPARED:
            yield f"{kind.__name__} -> {COMPARED[kind].__name__}", lambda n: n.ops.__setitem__(0, COMPARED[kind]())
        if kind in REVERSED:
            yield f"{kind.__name__} -> {REVERSED[kind].__name__}", lambda n: n.ops.__setitem__(0, REVERSED[kind]())
    elif isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in CALCULATED:
        operator = type(node.op)
        yield (
            f"{operator.__name__} -> {CALCULATED[operator].__name__}",
            lambda n: setattr(n, "op", CALCULATED[operator]()),
        )
    elif isinstance(node, ast.BoolOp):
        other = ast.Or if isinstance(node.op, ast.And) else ast.And
        yield f"{type(node.op).__name__} -> {other.__name__}", lambda n: setattr(n, "op", other())
        yield (
            "last condition left out",
            lambda n: n.values.pop() if len(n.values) > 2 else n.values.__setitem__(1, n.values[0]),
        )
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        plain = ast.UAdd if isinstance(node.op, ast.USub) else None
        if plain is not None:
            yield "sign changed", lambda n: setattr(n, "op", plain())
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        value: Any = node.value
        yield f"{value} -> {value + 1}", lambda n: setattr(n, "value", value + 1)
        if value not in (0, 1, 2, -1):
            yield f"{value} -> {0.5 * value}", lambda n: setattr(n, "value", type(value)(0.5 * value))
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield f"{node.value} -> {not node.value}", lambda n: setattr(n, "value", not n.value)
    elif isinstance(node, (ast.If, ast.IfExp)):
        yield "never taken", lambda n: setattr(n, "test", ast.Constant(False))
        yield "always taken", lambda n: setattr(n, "test", ast.Constant(True))
    elif isinstance(node, (ast.Attribute, ast.Name)):
        name = node.attr if isinstance(node, ast.Attribute) else node.id
        if name in RENAMED:
            field = "attr" if isinstance(node, ast.Attribute) else "id"
            yield f"{name} -> {RENAMED[name]}", lambda n: setattr(n, field, RENAMED[name])
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield "call left out", lambda n: setattr(n, "value", ast.Constant(None))


def all_mutants(root: Path) -> Iterator[tuple[Mutant, int, int]]:
    """Yield every mutant of every room with the place of its node and the number of its change."""
    for room in ROOMS:
        for module in _files(root, room.modules):
            text = (root / module).read_text(encoding="utf-8")
            lines = text.splitlines()
            for line, change, place, number in changes(ast.parse(text)):
                yield Mutant(room.name, module, line, change, lines[line - 1].strip()), place, number


def _files(root: Path, modules: tuple[str, ...]) -> Iterator[str]:
    for module in modules:
        place = root / module
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            yield path.relative_to(root).as_posix()


def sample(root: Path, count: int, seed: int) -> list[tuple[Mutant, str]]:
    """Return ``count`` mutants of every room with their changed sources."""
    found = list(all_mutants(root))
    generator = random.Random(seed)
    chosen: list[tuple[Mutant, int, int]] = []
    for room in ROOMS:
        own = [entry for entry in found if entry[0].room == room.name]
        chosen += generator.sample(own, min(count, len(own)))
    generator.shuffle(chosen)
    return [(m, changed((root / m.module).read_text(encoding="utf-8"), node, number)) for m, node, number in chosen]


def outcome(
    root: Path, tests: tuple[str, ...], place: str = "", every: bool = False, marks: str = MARKS
) -> tuple[str, list[str]]:
    """Run tests in a copy of the project.

    The limit of processor time holds for the tests' process alone: a child that it ended would be a failed test.

    Args:
        root: of the copy.
        tests: files or folders, from there.
        place: of the change, as ``module:line``; empty: there is none, and what the tests call is noted.
        every: go on after the first test that fails.
        marks: which of the tests, as ``pytest -m`` says it.

    Returns:
        ``"survived"``; ``"caught"`` where a test fails or a module cannot be imported; ``"no end"`` where the run was
        ended by its limit of time or by another signal: nothing is known then. And the tests that failed.
    """
    environment = os.environ | {
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        LIMIT: str(TIME_LIMIT),
        NOTES: str(root.parent / f"notes-{Path(tests[0]).stem}.json"),
    }
    environment |= {PLACE: place} if place else {}
    first = [] if every else ["-x"]
    command = [sys.executable, "-m", "pytest", *first, "-q", "--no-header", "-m", marks, "-p", "no:cacheprovider"]
    with tempfile.TemporaryFile() as output:
        run = subprocess.Popen(
            [*command, "-p", mutant_order.__name__, *tests], cwd=root, env=environment, stdout=output, stderr=output,
            start_new_session=True,
        )  # fmt: skip
        try:
            code = run.wait(CLOCK_LIMIT)
        except subprocess.TimeoutExpired:
            code = -signal.SIGKILL
        if code < 0:
            with suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)
            run.wait()
        output.seek(0)
        failed = re.findall(rb"^(?:FAILED|ERROR) (\S+)", output.read(), re.MULTILINE)
    # pytest: 0 all passed, 1 tests failed, 2 stopped by an error while collecting.
    found = {0: "survived", 1: "caught", 2: "caught"}.get(code, "no end")
    return found, list(dict.fromkeys(name.decode() for name in failed))


def print_tests(results: list[dict[str, Any]]) -> None:
    """Print for each test how many mutants it catches, and how many of them no other does.

    A test that is never alone says nothing that the others do not say, as far as this sample goes.
    """
    caught = [result["by"] for result in results if result["outcome"] == "caught"]
    counts, alone = Counter(name for by in caught for name in by), Counter(by[0] for by in caught if len(by) == 1)
    for name, count in sorted(counts.items(), key=lambda item: (-alone[item[0]], -item[1])):
        print(f"{count:5} {alone[name]:5} {name}")


def main() -> int:
    """Run a slice of the mutants and add what came out to the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60, help="mutants of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slice", default="1/1", help="which part of the sample: 3/8 is the third of eight")
    parser.add_argument("--room", help="one room alone")
    parser.add_argument("--out", type=Path, default=Path("mutants.json"))
    parser.add_argument("--marks", default=MARKS, help="which tests run, as `pytest -m` says it")
    parser.add_argument("--every", action="store_true", help="note all tests that catch a mutant, not the first alone")
    parser.add_argument("--seconds", type=float, default=1e9, help="start no mutant after this time")
    options = parser.parse_args()
    part, parts = (int(word) for word in options.slice.split("/"))
    results = json.loads(options.out.read_text()) if options.out.exists() else []
    results = [result for result in results if result["outcome"] == "caught"]
    known = {(r["module"], r["line"], r["change"], r["text"]) for r in results}
    rooms = {room.name: room for room in ROOMS}
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "copy"
        shutil.copytree(ROOT, root, ignore=shutil.ignore_patterns(".venv", ".git", "fmus"))
        for room in ROOMS:
            if options.room in (None, room.name) and outcome(root, room.tests, marks=options.marks)[0] != "survived":
                sys.exit(f"the tests of {room.name} fail without any change")
        for mutant, source in sample(root, options.count, options.seed)[part - 1 :: parts]:
            key = (mutant.module, mutant.line, mutant.change, mutant.text)
            if key in known or (options.room and mutant.room != options.room):
                continue
            if time.monotonic() - begun > options.seconds:
                break
            original = (root / mutant.module).read_text(encoding="utf-8")
            (root / mutant.module).write_text(source, encoding="utf-8")
            room, place = rooms[mutant.room], f"{mutant.module}:{mutant.line}"
            found, by = outcome(root, room.tests, place, options.every, options.marks)
            (root / mutant.module).write_text(original, encoding="utf-8")
            results.append(asdict(mutant) | {"outcome": found, "by": by})
            options.out.write_text(json.dumps(results, indent=1))
            if found != "caught":
                print(f"{found}: {mutant.module}:{mutant.line} {mutant.change}: {mutant.text}", flush=True)
    counts = Counter(result["outcome"] for result in results)
    if options.every:
        print_tests(results)
    print(f"{counts['caught']} of {len(results)} mutants caught, {counts['no end']} of unknown outcome")
    return 0


if __name__ == "__main__":
    sys.exit(main())
