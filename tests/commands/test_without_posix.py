"""The main commands where the modules, functions and files of POSIX are missing: the same numbers, and exit code 0."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.example_record import copy_examples
from tests.support.sources import nodes_of

ROOT = Path(__file__).resolve().parents[2]
OF_ONE_SYSTEM = {
    "fcntl",
    "resource",
    "grp",
    "pwd",
    "termios",
    "tty",
    "pty",
    "posix",
    "msvcrt",
    "winreg",
    "winsound",
    "nt",
}
COMMANDS = (
    "--help",
    "build LqrController --out built --force",
    "simulate --alpha 0.02",
    "sweep --sizes 0.01,0.02 --noise 1e-4 --seeds 1 --workers 1",
    "inspect machine.csv",
    "estimate machine.csv --no-diagnose",
    "check built/LqrController.fmu",
)
MEASURED = {"seconds", "time", "duration", "cases_per_second", "wall"}


def run(module: str, words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import runpy; runpy.run_module('{module}', None, '__main__')"
    )
    quiet = "ignore:only soft file lock"  # filelock's word for a POSIX system without fcntl, which there is not
    command = [sys.executable, "-W", quiet, "-c", program, *words.split()]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def numbers(value: object) -> object:
    """A result without what was measured with a clock, and without rules of memory, which needs a file of POSIX."""
    if isinstance(value, dict):
        if str(value.get("rule")).startswith("resources."):
            return None
        return {k: numbers(v) for k, v in value.items() if k not in MEASURED}
    return [numbers(v) for v in value] if isinstance(value, list) else value


@pytest.mark.slow
def test_the_main_commands_give_the_same_numbers(tmp_path: Path) -> None:
    here, hidden = tmp_path / "here", tmp_path / "hidden"
    for folder in (here, hidden):
        folder.mkdir()
        copy_examples(folder)
    for words in COMMANDS:
        done = run("tests.support.without_posix", words, hidden)
        cost = r"The fit of \d+ rows will take about \d+ s of processor time\n" if "estimate" in words else ""
        assert re.fullmatch(cost, done.stderr), (words, done.stderr[-2000:])
        assert done.returncode == 0
        assert run("orchestrator", words, here).returncode == 0
    written = sorted(p.relative_to(here) for p in here.rglob("results/*/*.json"))
    assert [p.stem for p in written] == ["build", "check", "estimate", "inspect", "simulate", "sweep"]
    for path in written:
        one, other = (numbers(json.loads((folder / path).read_text())) for folder in (here, hidden))
        assert one == other, path
    assert (here / "built" / "LqrController.fmu").read_bytes() == (hidden / "built" / "LqrController.fmu").read_bytes()


def test_one_module_alone_imports_what_one_system_has() -> None:
    found: dict[str, set[str]] = {}
    for path in sorted((ROOT / "orchestrator").rglob("*.py")):
        for node in nodes_of(path):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if OF_ONE_SYSTEM & set(names):
                found.setdefault(path.name, set()).update(OF_ONE_SYSTEM & set(names))
    assert found == {"operating_system.py": {"fcntl", "resource"}}
