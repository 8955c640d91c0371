"""A log of a million rows through ``estimate`` on the command line, brought down to 200 Hz: what each second goes into.

::

    python -m benchmarks.long_log              # 200 s at 5 kHz; its simulation takes a minute beforehand
    python -m benchmarks.long_log --rows 200000

Processor time counts all threads; wall time is that of the machine as busy as it is.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.independent_plant import make_record

RATE = 5000.0  # Hz


def write_log(path: Path, rows: int) -> None:
    """Write a record of a drivetrain with a half-gap of 0.01 rad."""
    columns, _ = make_record({"alpha": 0.01}, 77, rows / RATE, RATE)
    names = ("u", "theta_m", "theta_l")
    values = zip(*(columns[name].tolist() for name in names), strict=True)
    lines = (f"{n / RATE:.4f}," + ",".join(format(value, ".9g") for value in row) for n, row in enumerate(values))
    path.write_text("\n".join([",".join(("time", *names)), *lines]) + "\n")


def main() -> None:
    """Write the log, estimate, print times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=1_000_000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "log.csv"
        write_log(log, arguments.rows)
        command = ["estimate", str(log), "--rate", "200", "--no-diagnose", "--out", str(Path(name) / "out")]
        begun, before = time.monotonic(), os.times()
        subprocess.run([sys.executable, "-m", "orchestrator", *command], check=True)
        wall, after = time.monotonic() - begun, os.times()
        used = after.children_user + after.children_system - before.children_user - before.children_system
        print(f"{arguments.rows} rows, {log.stat().st_size / 1e6:.0f} MB: {wall:.0f} s wall, {used:.0f} s of processor")


if __name__ == "__main__":
    main()
