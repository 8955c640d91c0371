"""Fuzz of scenario files: ``python -m benchmarks.fuzz_scenario SECONDS [SEED]``.

Good files are mutated (bytes, tokens, values, lines, whole keys) and loaded; what loads is run if it is short.
Whatever the file holds, the outcome must be a result or one of the project's errors with a one-line text: anything else
is printed with the file that did it, and the exit code is 1. What takes long is interrupted, and must stop. Nothing may
be left beside the file.
"""

import math
import random
import re
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from orchestrator.errors import OrchestratorError
from orchestrator.scenarios.scenario import load_scenario, simulate
from tests.scenarios.test_scenario import GOOD, LOOP

MORE = """
[[sources]]
kind = "table"
to = "plant.T_l"
file = "torque.csv"
column = "u"
[[sources]]
kind = "noise"
to = "plant.T_l"
deviation = 0.1
seed = 3
"""
SEEDS = (GOOD, LOOP, GOOD + MORE)
TABLE = "time,u\n0,0\n0.01,5\n0.02,5\n"
VALUES = (
    "nan", "inf", "-inf", "1e400", "-0.0", "0", "-1", "1e-300", "1e300", "true", '""', '"x"', "[]", "[[]]", "{}",
    "9" * 400, "'''\n'''", "1979-05-27T07:32:00Z", "0xff", "1_000", '"plant."', '".u"', '"plant.u"', '"\\u0000"',
    '"../../etc/passwd"',
)  # fmt: skip
SHORT_STEPS = 200
SLOW = 5.0
"""Processor time [s] after which a file is interrupted, as by Ctrl-C: absurd torques make a plant's steps slow."""

PATIENCE = 2.0
"""Processor time [s] within which the interrupt must have ended the run: more is a failure."""


def mutated(text: str, draw: random.Random) -> bytes:
    """Return ``text`` after one to four mutations."""
    for _ in range(draw.randint(1, 4)):
        text = draw.choice(MUTATIONS)(text, draw)
    content = bytearray(text.encode("utf-8", "surrogatepass"))
    if draw.random() < 0.2 and content:
        for _ in range(draw.randint(1, 8)):
            content[draw.randrange(len(content))] = draw.randrange(256)
    return bytes(content)


def _value(text: str, draw: random.Random) -> str:
    places = list(re.finditer(r"= *([^\n,}\]]+)", text))
    if not places:
        return text
    place = draw.choice(places)
    return text[: place.start(1)] + draw.choice(VALUES) + text[place.end(1) :]


def _line(text: str, draw: random.Random) -> str:
    lines = text.split("\n")
    k = draw.randrange(len(lines))
    action = draw.randrange(4)
    if action == 0:
        del lines[k]
    elif action == 1:
        lines.insert(draw.randrange(len(lines) + 1), lines[k])
    elif action == 2:
        other = draw.randrange(len(lines))
        lines[k], lines[other] = lines[other], lines[k]
    else:
        lines.insert(k, f"{draw.choice(('step', 'x', 'order', 'kind', 'to', 'unit'))} = {draw.choice(VALUES)}")
    return "\n".join(lines)


def _word(text: str, draw: random.Random) -> str:
    words = list(re.finditer(r"[A-Za-z_]+", text))
    if len(words) < 2:
        return text
    a, b = draw.choice(words), draw.choice(words)
    return text[: a.start()] + b.group() + text[a.end() :]


def _characters(text: str, draw: random.Random) -> str:
    k = draw.randrange(len(text) + 1)
    return text[:k] + "".join(draw.choice("[]{}=\"'.,#\n\t 0e-é\u202e") for _ in range(draw.randint(1, 3))) + text[k:]


def _cut(text: str, draw: random.Random) -> str:
    a, b = sorted(draw.randrange(len(text) + 1) for _ in range(2))
    return text[:a] + text[b:] if b - a < len(text) // 2 else text[a:b]


def _deep(text: str, draw: random.Random) -> str:
    depth = draw.choice((10, 100, 5000))
    return text + f"\nx = {'[' * depth}{']' * depth}\n"


MUTATIONS: tuple[Callable[[str, random.Random], str], ...] = (
    _value,
    _value,
    _value,
    _line,
    _line,
    _word,
    _characters,
    _cut,
    _deep,
)


def outcome(path: Path) -> str:
    """Load and perhaps run one file; return what came of it.

    Raises:
        AssertionError: an error's text is not one line.
        Exception: whatever is not one of the project's errors.
    """
    try:
        scenario = load_scenario(path)
        if (scenario.stop - scenario.start) / scenario.algorithm.step > SHORT_STEPS:
            return "long"
        result = simulate(scenario)
        return "ran" if all(math.isfinite(t) for t in result.time) else "times not finite"
    except OrchestratorError as error:
        text = str(error)
        assert text, "no text"
        assert "\n" not in text, f"more than one line: {text!r}"
        return type(error).__name__


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def main(arguments: list[str]) -> int:
    """Fuzz for some seconds and print the counts."""
    seconds, seed = float(arguments[0]), int(arguments[1]) if len(arguments) > 1 else 1
    signal.signal(signal.SIGPROF, _interrupt)
    draw, counts, slowest, failures = random.Random(seed), Counter[str](), 0.0, 0
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "torque.csv").write_text(TABLE, encoding="utf-8")
        path = folder / "scenario.toml"
        while time.monotonic() < end:
            content = mutated(draw.choice(SEEDS), draw)
            path.write_bytes(content)
            begin = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, SLOW)
            try:
                counts[outcome(path)] += 1
            except KeyboardInterrupt:
                counts["interrupted"] += 1
            except Exception as error:
                failures += 1
                print(f"FAILED {type(error).__name__}: {error}\n{content!r}\n", flush=True)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            took = time.process_time() - begin
            slowest = max(slowest, took)
            if took > SLOW + PATIENCE:
                failures += 1
                print(f"FAILED to stop for {took - SLOW:.1f} s\n{content!r}\n", flush=True)
            left = sorted(p.name for p in folder.iterdir())
            assert left == ["scenario.toml", "torque.csv"], left
    files = sum(counts.values()) + failures
    print(f"seed {seed}: {files} files, {failures} failures, slowest {slowest:.2f} s of processor time")
    print(", ".join(f"{kind} {count}" for kind, count in counts.most_common()))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
