"""The size of the pages' programs, as of modules in Python: functions of at most 60 lines, files of at most 300."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1] / "orchestrator"
FILES = sorted([*ROOT.glob("workbench/static/*.js"), *ROOT.glob("reporting/templates/*.js")])
LONGEST_FUNCTION, LONGEST_FILE = 60, 300
# A line that opens a function, a method, or an arrow function with a body.
OPENS = re.compile(
    r"^\s*(?:export )?(?!(?:if|for|while|switch|catch)\b)(?:.*\bfunction\b.*|.*=> |(?:\w+ )*\w+\(.*\) )\{$"
)


def functions(lines: list[str]) -> list[tuple[int, int]]:
    """Return first line and length of each function; it ends where its indentation comes back."""
    found = []
    for n, line in enumerate(lines):
        if OPENS.match(line):
            margin = line[: len(line) - len(line.lstrip())]
            end = next(k for k in range(n + 1, len(lines)) if lines[k].startswith(f"{margin}}}"))
            found.append((n + 1, end - n + 1))
    return found


def test_functions_and_files_are_short() -> None:
    text = [
        "export function a(b) {",
        "  return 1;",
        "}",
        "",
        "class C {",
        "  async d() {",
        "    if (e) {",
        "    }",
        "  }",
        "}",
    ]
    assert functions(text) == [(1, 3), (6, 4)]
    assert len(FILES) > 20
    assert sum(len(functions(path.read_text(encoding="utf-8").splitlines())) for path in FILES) > 200
    long = []
    for path in FILES:
        lines = path.read_text(encoding="utf-8").splitlines()
        long += [f"{path.name}:{n} has {count} lines" for n, count in functions(lines) if count > LONGEST_FUNCTION]
        if len(lines) > LONGEST_FILE:
            long.append(f"{path.name} has {len(lines)} lines")
    assert long == []
