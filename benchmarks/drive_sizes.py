"""``inspect``, then ``estimate`` with the model file that it drafts, on drives of many sizes: cost told and used.

::

    python -m benchmarks.drive_sizes 30              # ratio 1 to 160, load of 1e-5 to 10 kg.m2, amperes and degrees
    python -m benchmarks.drive_sizes 30 --first 1000

The simulator is independent of the library. Every second model file keeps 1 N.m per ampere as it was assumed; in the
others the torque constant is put in. Processor time is that of the whole command, compilations of a first run included.
Seeds 0 to 11 were looked at while the cost was made.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.support.sized_drive import Drive, draw_drive, write_drive_log

TOLD = re.compile(r"will take about (\d+) s of processor time.*?record, (\d+) s more")
MOST = 60.0  # s
HEAD = (
    "seed", "ratio", "load [kg.m2]", "torque [N.m]", "rows", "told [s]", "used [s]", "within", "half-gap", "found",
    "method", "trust",
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What one drive came to: told and used processor time [s], and the half-gap [rad]."""

    drive: Drive
    rows: int
    told: float
    used: float
    code: int
    found: float | None
    method: str
    trust: str

    @property
    def within(self) -> bool:
        """Return whether the command kept to what it told, whose diagnosis may follow or not."""
        return self.code == 0 and self.used <= min(self.told, MOST)

    def line(self) -> str:
        """Return the row of the table."""
        p = self.drive.linear
        found = "none" if self.found is None else f"{self.found:.5f}"
        told, used = f"{self.told:.0f}", f"{self.used:.0f}"
        size = (f"{p['i']:g}", f"{p['J_l']:.2g}", f"{self.drive.torque:.2g}", self.rows)
        gap = (f"{self.drive.gap:.5f}", found, self.method, self.trust)
        cells = (self.drive.seed, *size, told, used, "yes" if self.within else "NO", *gap)
        return f"| {' | '.join(map(str, cells))} |"


def measure(folder: Path, seed: int) -> Row:
    """Return what ``inspect`` and ``estimate`` make of a drive's log, on the command line."""
    drive = draw_drive(seed)
    log, out = folder / f"drive_{seed}.csv", folder / f"out_{seed}"
    write_drive_log(log, drive)
    _run("inspect", str(log), "--out", str(out / "inspect"))
    model = out / "inspect" / "model.toml"
    if seed % 2:
        text = model.read_text(encoding="utf-8")
        model.write_text(re.sub(r"(?m)^torque_constant = \S+", f"torque_constant = {drive.torque_constant}", text))
    code, said, used = _run("estimate", str(log), "--model", str(model), "--out", str(out / "estimate"))
    told = TOLD.search(said)
    path = out / "estimate" / "estimate.json"
    results = json.loads(path.read_text())["results"] if path.is_file() else {}
    if code:
        print(said.strip().splitlines()[-1])
    return Row(
        drive,
        round(drive.seconds * drive.rate),
        sum(map(float, told.groups())) if told else 0.0,
        used,
        code,
        results.get("alpha"),
        results.get("method") or "",
        (results.get("trust") or {}).get("level", ""),
    )


def _run(*arguments: str) -> tuple[int, str, float]:
    """Return exit code, standard error and processor time [s] of a command."""
    before = os.times()
    done = subprocess.run(
        [sys.executable, "-m", "orchestrator", *arguments], capture_output=True, text=True, check=False
    )
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return done.returncode, done.stderr, used


def main() -> None:
    """Measure, print the table and the sums."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=30)
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(arguments.first, arguments.first + arguments.count):
            rows.append(measure(Path(name), seed))
            print(rows[-1].line(), flush=True)
    ended, within = sum(row.code == 0 for row in rows), sum(row.within for row in rows)
    print(f"{ended} of {len(rows)} end, {within} within what was told; at most {max(row.used for row in rows):.0f} s")


if __name__ == "__main__":
    main()
