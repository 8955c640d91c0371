"""Fuzz of CSV records and model files: no traceback, no hang, no partial output.

::

    python -m benchmarks.fuzz_record 600      # seconds

Every case mutates a good record (cells, rows, header, bytes) or model file, and hands it to the command line in this
process with the quick method; what comes out must be exit code 0, 1 or 2 with at most one line on standard error, and
a result directory that is either complete or not there.
"""

import argparse
import contextlib
import io
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from orchestrator.cli import main as command
from tests.support.independent_plant import make_record, write_csv

CELLS = (
    "",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "1e308",
    "-1e308",
    "0",
    "-0",
    "abc",
    "1,2",
    '"',
    "1e-320",
    "٣",
    "0x10",
    "1_0",
    " ",
)
LONGEST_CASE = 60
FAST_METHODS = ("operating_data", "speed_difference", "torque_pulse", "ekf")
MODEL = """fmu = "Drivetrain"
[parameters.J_l]
value = 5.6
relative_uncertainty = 0.05
[encoders.theta_m]
counts_per_rev = 10000
[columns.theta_l]
name = "theta_l"
unit = "rad"
"""


def _cells(lines: list[str], rng: random.Random) -> None:
    for _ in range(rng.choice((1, 1, 3, 50))):
        row = rng.randrange(len(lines))
        cells = lines[row].split(",")
        cells[rng.randrange(len(cells))] = rng.choice(CELLS)
        lines[row] = ",".join(cells)


def _rows(lines: list[str], rng: random.Random) -> None:
    row, count = rng.randrange(1, len(lines)), rng.choice((1, 5, 300, 5000))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[row : row + count]
    elif kind == 1:
        lines[row:row] = lines[row : row + count]
    elif kind == 2:
        rng.shuffle(lines)
    else:
        lines[row] = rng.choice(("", ",", ",,,", "a" * 100_000, "1,2,3", '"'))


def _header(lines: list[str], rng: random.Random) -> None:
    names = ["time", "u", "theta_m", "theta_l", "theta_m", "THETA_M", "", "theta_m [deg]"]
    lines[0] = ",".join(rng.choices(names, k=rng.choice((1, 3, 4, 4, 4, 8))))


def _scale(lines: list[str], rng: random.Random) -> None:
    column, factor = rng.randrange(4), rng.choice((0.0, -1.0, 57.3, 1e-6, 1e6, 1e-300, 1e9))
    for row in range(1, len(lines)):
        cells = lines[row].split(",")
        cells[column] = f"{float(cells[column]) * factor:.9g}"
        lines[row] = ",".join(cells)


def _hold(lines: list[str], rng: random.Random) -> None:
    column, first = rng.randrange(1, 4), rng.randrange(1, len(lines))
    last = min(len(lines), first + rng.choice((30, 200, 2000)))
    value = lines[first].split(",")[column]
    for row in range(first, last):
        cells = lines[row].split(",")
        cells[column] = value
        lines[row] = ",".join(cells)


def _bytes(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 10, 1000))):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed[: rng.randrange(len(changed) + 1)] if rng.random() < 0.2 else changed)


MUTATIONS: tuple[Callable[[list[str], random.Random], None], ...] = (_cells, _rows, _header, _scale, _hold)


class _HangError(Exception):
    """A case took longer than it may."""


def _alarm(*_: object) -> None:
    raise _HangError


def run_case(seed: int, good: list[str], folder: Path) -> str:
    """Run one case and return what came out, or raise ``AssertionError``."""
    rng = random.Random(seed)
    record, model, out = folder / "data.csv", folder / "model.toml", folder / "out"
    lines = list(good)
    data = b""
    if rng.random() < 0.75:
        rng.choice(MUTATIONS)(lines, rng)
    data = ("\n".join(lines) + "\n").encode()
    if rng.random() < 0.25:
        data = _bytes(data, rng)
    record.write_bytes(data)
    words = ["estimate", str(record), "--method", rng.choice(FAST_METHODS), "--out", str(out)]
    if rng.random() < 0.4:
        text = MODEL.encode()
        model.write_bytes(_bytes(text, rng) if rng.random() < 0.8 else text)
        words += ["--model", str(model)]
    if rng.random() < 0.2:
        words += ["--motor-only"]
    output, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(error):
        code = command(words)
    assert code in (0, 1, 2), f"exit code {code}"
    assert "Traceback" not in error.getvalue()
    if code:
        assert error.getvalue().count("\n") == 1, error.getvalue()
        assert not out.exists(), "partial output"
    else:
        assert (out / "estimate.json").exists(), "no result"
    assert not list(folder.glob("out/.partial*"))
    shutil.rmtree(out, ignore_errors=True)
    return f"exit {code}"


def main() -> int:
    """Fuzz for the given number of seconds; return 1 when a case broke a rule."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    columns, _ = make_record({"alpha": 0.02}, 70, 3.0)
    counts: Counter[str] = Counter()
    failures = 0
    signal.signal(signal.SIGALRM, _alarm)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_csv(folder / "good.csv", columns)
        good = (folder / "good.csv").read_text().splitlines()
        end = time.monotonic() + arguments.seconds
        seed = arguments.seed
        while time.monotonic() < end:
            signal.alarm(LONGEST_CASE)
            try:
                counts[run_case(seed, good, folder)] += 1
            except (Exception, SystemExit):
                failures += 1
                print(f"seed {seed}:")
                traceback.print_exc(limit=-6, file=sys.stdout)
                shutil.rmtree(folder / "out", ignore_errors=True)
            finally:
                signal.alarm(0)
            seed += 1
    print(f"{seed - arguments.seed} cases: {dict(counts)}, {failures} broke a rule")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
