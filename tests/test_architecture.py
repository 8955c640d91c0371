"""Imports point one way, modules and functions stay small, public names are documented."""

import ast
import re
from functools import cache

from orchestrator.cli import COMMANDS, build_parser
from orchestrator.shared.equation_files import read_imports
from tests.support.sources import ROOT, SOURCES, nodes_of, tree_of

# Words without which a command line is refused.
NEEDED = {
    "diagnose": ["a.csv"],
    "inspect": ["a.csv"],
    "calibrate": ["a.csv", "--fmu", "a.fmu", "--map", "a.toml"],
    "ssp": ["run"],
    "report": ["results"],
}
MOST_LINES = 400
LONGEST_CHAIN = 8  # of modules of the diagnosis that import one another
MOST_FUNCTION_LINES = 60

# Lower layers first; a module may import from its own layer's package and from the layers below. A room within a room
# has a layer of its own where it stands apart from its neighbours.
LAYERS = (
    {"plain_text"},
    {"errors"},
    {"shared"},
    {"shared.isolation", "shared.inference"},
    {"effects", "building.translation"},
    {"plants"},
    {"records"},
    {"master", "engine"},
    {"fmi"},
    {"building"},
    {"scenarios"},
    {"checking"},
    {"paired", "estimation", "control"},
    {"estimation.inspection", "estimation.methods"},
    {"diagnosis.settings"},
    {"diagnosis.data"},
    {"diagnosis.model"},
    {"diagnosis.inference"},
    {"diagnosis.selection"},
    {"diagnosis.result"},
    {"diagnosis.report"},
    {"diagnosis"},
    {"diagnosis.fmu"},
    {"reporting"},
    {"api"},
    {"workbench"},
    {"commands"},
    {"cli"},
    {"__main__"},
)


ROOMS = {name for names in LAYERS for name in names}


def room_of(words):
    """The room of a module, by the words of its name behind `orchestrator`."""
    return next((room for room in (".".join(words[:2]), words[0]) if room in ROOMS), None)


def layer_of(room):
    return next((n for n, names in enumerate(LAYERS) if room in names), None)


def words_of(path):
    return path.relative_to(ROOT / "orchestrator").with_suffix("").parts


def imports(path):
    """Full names of the project's modules that a file imports, function bodies included."""
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_sources_are_found():
    assert len(SOURCES) > 30


def test_the_sources_of_the_fmus_stand_alone():
    for path in (ROOT / "pyfmu_sources").rglob("*.py"):
        for name in imports(path):
            assert name.split(".")[0] not in {"orchestrator", "numpy", "scipy", "fmpy"}, f"{path}: {name}"


SOURCE_LAYERS = (
    {"laws"}, {"hybrid"}, {"adapters"}, {"axis", "drivetrain"}, {"halves", "train"}, {"controllers"}, {"estimators"},
)  # fmt: skip


def test_imports_between_rooms_of_the_sources_point_one_way():
    level = {room: n for n, rooms in enumerate(SOURCE_LAYERS) for room in rooms}
    top, wrong = ROOT / "pyfmu_sources", []
    for path in top.rglob("*/*.py"):
        room = path.relative_to(top).parts[0]
        for target in read_imports(path):
            other = target.relative_to(top).parts[0]
            if other != room and level[other] >= level[room]:
                wrong.append(f"{path.relative_to(ROOT)} imports {target.relative_to(top)}")
    assert wrong == []


def test_every_part_of_the_orchestrator_has_a_layer():
    parts = {words_of(path) for path in (ROOT / "orchestrator").rglob("*.py")}
    assert not {words for words in parts if words != ("__init__",) and room_of(words) is None}


def test_imports_point_one_way():
    wrong = []
    for path in (ROOT / "orchestrator").rglob("*.py"):
        part = room_of(words_of(path))
        for name in imports(path):
            words = name.split(".")
            if words[0] != "orchestrator" or len(words) < 2:
                continue
            target = room_of(words[1:])
            if target == part or target is None or part is None:
                continue
            if layer_of(target) >= layer_of(part):
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def sources_of(path, known):
    """The files that a file imports, by module name, imports within the package of the FMUs' sources included."""
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = ".".join((*package[: len(package) - node.level + 1], *([node.module] if node.module else [])))
            yield from (name for name in (base, *(f"{base}.{alias.name}" for alias in node.names)) if name in known)
    yield from (name for name in imports(path) if name in known)


def test_no_circle_of_imports():
    """No file imports a file that imports it, be it inside a function or for type checking alone."""
    known = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in SOURCES}
    left = {name: set(sources_of(path, known)) - {name} for name, path in known.items()}
    while free := {name for name, needs in left.items() if not needs & left.keys()}:
        left = {name: needs for name, needs in left.items() if name not in free}
    users = {name for needs in left.values() for name in needs}
    assert not {name: sorted(needs & left.keys()) for name, needs in left.items() if name in users}


def reached_from(name, needs):
    """All modules that a module imports, directly or through others, and the packages that they lie in."""
    reached, left = set(), [name]
    while left:
        module = left.pop()
        if module in needs and module not in reached:
            reached.add(module)
            left += [*needs[module], module.rpartition(".")[0]]
    return reached


def test_a_command_needs_no_more_lines_than_the_page_of_the_architecture_says():
    known = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in SOURCES}
    needs = {name: set(sources_of(path, known)) for name, path in known.items()}
    lines = {name: path.read_text(encoding="utf-8").count("\n") for name, path in known.items()}
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    most = {name: int(text.replace(",", "")) for name, text in re.findall(r"^\| `(\w+)` \| ([\d,]+) \|$", page, re.M)}
    found = {
        command: sum(lines[name] for name in reached_from(f"orchestrator.commands.{command}", needs))
        for command in COMMANDS
    }
    assert most.keys() == found.keys()
    assert not {name: count for name, count in found.items() if count > most[name]}


def test_the_diagnosis_has_short_chains_of_imports():
    known = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in SOURCES if "diagnosis" in path.parts
    }
    needs = {name: set(sources_of(path, known)) - {name} for name, path in known.items()}

    @cache
    def chain(name):
        return 1 + max(map(chain, needs[name]), default=0)

    assert max(map(chain, known)) <= LONGEST_CHAIN


def test_only_commands_print():
    for path in SOURCES:
        if "commands" in path.parts:
            continue
        for node in nodes_of(path):
            called = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            assert not called, f"{path} prints"


def test_flags_are_named_in_commands_alone():
    """Errors and docstrings of the library speak of arguments by their names in Python; commands put flags there.

    The workbench makes command lines, which have flags.
    """
    flags = {
        option
        for command in COMMANDS
        for option in build_parser(command).parse_args([command, *NEEDED.get(command, [])]).flags.values()
    }
    assert "--scheduler" in flags
    named = re.compile("|".join(sorted(rf"(?<![\w-]){flag}(?![\w-])" for flag in flags if flag.startswith("--"))))
    wrong = []
    for path in SOURCES:
        if {"commands", "workbench"} & {*path.parts} or path.name in ("cli.py", "__main__.py"):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            if "--" in line and named.search(line):
                wrong.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()}")
    assert not wrong


def sizes(text, nodes):
    """(name, lines) of each function, and of the module under the name of "". Docstrings of functions do not count."""
    documented = 0
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            if ast.get_docstring(node):
                documented += node.body[0].end_lineno - node.body[0].lineno
            first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
            yield node.name, node.end_lineno - first.lineno + 1
    yield "", len(text.splitlines()) - documented


def test_modules_and_functions_stay_small():
    found = [(path, *size) for path in SOURCES for size in sizes(path.read_text(encoding="utf-8"), nodes_of(path))]
    large = [(path, name, n) for path, name, n in found if n > (MOST_FUNCTION_LINES if name else MOST_LINES)]
    assert not [f"{path.relative_to(ROOT)} {name}: {n} lines" for path, name, n in large]


def test_sizes_leave_docstrings_of_functions_out():
    text = '"""Module."""\n\n\ndef f(x):\n    """One.\n\n    Two.\n    """\n    y = x\n    return y\n'
    assert list(sizes(text, ast.walk(ast.parse(text)))) == [("f", 2), ("", 7)]


def undocumented(path):
    """Public names of a module that have no docstring."""
    tree = tree_of(path)
    public = [n for n in tree.body if isinstance(n, (ast.FunctionDef, ast.ClassDef)) and not n.name.startswith("_")]
    return [getattr(n, "name", "") for n in [tree, *public] if not ast.get_docstring(n) and path.name != "__main__.py"]


def test_public_names_are_documented():
    assert not {str(path.relative_to(ROOT)): names for path in SOURCES if (names := undocumented(path))}


def test_no_class_name_means_two_things():
    places = {}
    for path in SOURCES:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_rooms_keep_their_private_names():
    """No name with an underscore leaves its room; the command line's front is of the room of the commands."""

    def room(words):
        return "commands" if words[1:2] == ["cli"] else words[1] if len(words) > 1 else ""

    wrong = []
    for path in SOURCES:
        own = room([part.removesuffix(".py") for part in path.relative_to(ROOT).parts])
        for name in imports(path):
            words = name.split(".")
            private = [word for word in words if word.startswith("_") and not word.startswith("__")]
            if words[0] == "orchestrator" and private and room(words) != own:
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def test_no_test_reads_a_place_of_one_machine():
    named = re.compile(r"""Path\(f?["']/(home|root|srv|Users|work)\b""")
    assert [path for path in (ROOT / "tests").rglob("*.py") if named.search(path.read_text(encoding="utf-8"))] == []


def headers_in_use(folder):
    """Of each C header, the others whose functions, types and macros it uses."""
    texts = {path.name: re.sub(r"/\*.*?\*/", " ", path.read_text(), flags=re.DOTALL) for path in folder.glob("*.h")}
    defined = {}
    made = r"^(?:static (?:inline )?[\w ]+[ *]+(\w+)\([^;{]*\)\s*\{|#define (\w+)|\} (\w+);)"
    for name, text in texts.items():
        for match in re.finditer(made, text, re.MULTILINE):
            defined.setdefault(next(filter(None, match.groups())), set()).add(name)
    owners = {word: next(iter(names)) for word, names in defined.items() if len(names) == 1}
    return {
        name: {owners[word] for word in re.findall(r"\b[A-Za-z_]\w*", text) if owners.get(word, name) != name}
        for name, text in texts.items()
    }


def circle_in(uses):
    """The names of a circle, else nothing: what uses nothing that is left is taken away until all is."""
    left = dict(uses)
    while free := [name for name in left if not left[name] & set(left) - {name}]:
        left = {name: used for name, used in left.items() if name not in free}
    return sorted(left)


def test_headers_of_native_fmus_use_one_another_one_way(tmp_path):
    uses = headers_in_use(ROOT / "orchestrator" / "building" / "native_fmu")
    assert "slave_core.h" in uses["fmi3_modes.h"]
    assert "fmi3_clock.h" in uses["fmi3_steps.h"]
    assert circle_in(uses) == []
    (tmp_path / "a.h").write_text("static int f(int x)\n{\n    return g(x);\n}\n")
    (tmp_path / "b.h").write_text("static int g(int x)\n{\n    return f(x);\n}\n")
    (tmp_path / "c.h").write_text("static int h(int x)\n{\n    return f(x);\n}\n")
    assert circle_in(headers_in_use(tmp_path)) == ["a.h", "b.h", "c.h"]


MATHEMATICS = {"sin", "cos", "exp", "sqrt", "abs", "sine", "cosine"}


def shape_of(node: ast.expr, names: dict[str, str]) -> str:
    """An expression with its names as they come, so that the same law in other letters looks the same."""
    if isinstance(node, ast.BinOp):
        return f"({shape_of(node.left, names)} {type(node.op).__name__} {shape_of(node.right, names)})"
    if isinstance(node, ast.UnaryOp):
        return f"({type(node.op).__name__} {shape_of(node.operand, names)})"
    if isinstance(node, ast.Constant):
        return repr(node.value)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MATHEMATICS:
        return f"{node.func.id}({', '.join(shape_of(given, names) for given in node.args)})"
    return names.setdefault(ast.unparse(node), f"n{len(names)}")


def test_a_law_stands_once():
    """What a law returns, if it is more than a product, stands nowhere else; only waves have sines."""
    rooms = ("pyfmu_sources", "orchestrator/plants", "orchestrator/effects", "orchestrator/diagnosis/fmu")
    files = {path: path.relative_to(ROOT).as_posix() for path in SOURCES}
    laws, places = set(), {}
    for path, file in files.items():
        if not file.startswith(rooms) or file.endswith("learned_law.py"):
            continue
        for node in nodes_of(path):
            if isinstance(node, ast.BinOp):
                places.setdefault(shape_of(node, {}), set()).add(file)
            if isinstance(node, ast.Return) and "/laws/" in file and isinstance(node.value, ast.BinOp):
                laws.add(shape_of(node.value, {}))
    long = {s for s in laws if s.count("(") > (2 if any(f"{name}(" in s for name in MATHEMATICS) else 3)}
    stand = {shape: sorted(places[shape]) for shape in long}
    assert len(stand) > 8
    assert {shape: found for shape, found in stand.items() if len(found) > 1} == {}
    sines = [f for p, f in files.items() if f.startswith(rooms[:2]) and {"math.sin", "math.cos"} & set(imports(p))]
    assert sines == ["pyfmu_sources/laws/waves.py"]
