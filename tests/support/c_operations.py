"""The most operations that a function of our generated C can take: counted in its text, every loop to its bound.

The text is that of the translator: operators between blanks, one statement a line, blocks by their braces. Of the
branches of a condition the dearer counts for each operation, and no early return or break is believed. What works on
whole numbers alone, such as places in a list, is left out.
"""

import re
from collections import Counter
from collections.abc import Mapping

OPERATORS = {
    "additions": re.compile(r" [+-]=? "),
    "multiplications": re.compile(r" \*=? "),
    "divisions": re.compile(r" /=? "),
    "functions": re.compile(r"\b(?:sqrt|exp|log|pow|erfc|sin|cos|tanh)\("),
}
HEAD = re.compile(r"^(?:static (?:inline )?)?\w+ \*?(\w+)\([^;]*\)( \{ .* \})?$")
CONSTANT = re.compile(r"enum \{ (\w+) = (\d+) \}")
WHOLE = frozenset({"item_at", "next_item", "drop_items", "covariance", "floor_divided", "lesser_whole"})
INDEX = re.compile(r"\[[^\[\]]*\]")
COMMENT = re.compile(r"/\*.*?\*/", re.S)


class Operations:
    """Counts of a source; ``bounds``: of the variables that end loops, within a function: "function.variable"."""

    def __init__(self, source: str, bounds: Mapping[str, int]) -> None:
        text = COMMENT.sub("", source)
        self._bodies = functions_of(text.splitlines())
        self._bounds = {name: int(value) for name, value in CONSTANT.findall(text)} | dict(bounds)
        self._known: dict[str, Counter[str]] = {}

    def of(self, function: str) -> Counter[str]:
        """Return the most operations of a call."""
        if function not in self._known:
            lines = [line.strip() for line in self._bodies[function] if line.strip()]
            self._known[function] = self._block(lines, function)
        return self._known[function]

    def _block(self, lines: list[str], function: str) -> Counter[str]:
        total: Counter[str] = Counter()
        at = 0
        while at < len(lines):
            line = lines[at]
            body, at = body_of(lines, at)
            if line.startswith("for ("):
                total.update(self._line(line.split(";")[0], function))
                once = self._block(body, function) + self._line(line.partition(";")[2], function)
                total.update({kind: self._bound(line, function) * n for kind, n in once.items()})
            elif line.startswith("if ("):
                branches = [self._block(body, function)]
                total.update(self._line(line, function))
                while at < len(lines) and lines[at].removeprefix("} ").startswith("else"):
                    total.update(self._line(lines[at], function))
                    body, at = body_of(lines, at)
                    branches.append(self._block(body, function))
                total.update({kind: max(one[kind] for one in branches) for kind in OPERATORS})
            elif not line.startswith("}"):
                assert not re.match(r"(while|do|switch|goto)\b", line), line
                total.update(self._line(line, function))
        return total

    def _line(self, line: str, function: str) -> Counter[str]:
        found: Counter[str] = Counter()
        for name in re.findall(r"\b(\w+)\(", line):
            if name in self._bodies and name not in (function, *WHOLE):
                found.update(self.of(name))
        while INDEX.search(line):
            line = INDEX.sub("", line)
        found.update({kind: len(operator.findall(line)) for kind, operator in OPERATORS.items()})
        return found

    def _bound(self, line: str, function: str) -> int:
        """Return how often a loop runs at most, begun at zero."""
        end = re.search(r"< (\w+)", line)
        assert end is not None, line
        name = end[1]
        return int(name) if name.isdigit() else self._bounds.get(f"{function}.{name}", self._bounds.get(name, -1))


def functions_of(lines: list[str]) -> dict[str, list[str]]:
    """Return the lines of each function's body."""
    found = {}
    for at, line in enumerate(lines):
        head = HEAD.match(line)
        if head is not None and head[2]:
            found[head[1]] = [head[2].strip(" {}")]
        elif head is not None and lines[at + 1] == "{":
            found[head[1]] = lines[at + 2 : lines.index("}", at)]
    return found


def body_of(lines: list[str], at: int) -> tuple[list[str], int]:
    """Return the lines that a statement holds, and where the next one is; a closing brace before `else` is that one."""
    if lines[at].endswith("{"):
        depth, end = 1, at
        while depth:
            end += 1
            depth += lines[end].endswith("{") - lines[end].startswith("}")
            if depth == 1 and lines[end].startswith("} else"):
                return lines[at + 1 : end], end
        return lines[at + 1 : end], end + 1
    if re.match(r"(for|if|else) ?\(.*\)$|else$|else if \(.*\)$", lines[at]):
        _, end = body_of(lines, at + 1)
        return lines[at + 1 : end], end
    return [], at + 1
