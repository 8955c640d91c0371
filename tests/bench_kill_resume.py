"""Kills a sweep with SIGKILL at random moments, resumes it, and compares its table with an undisturbed one's.

    python -m tests.bench_kill_resume --kills 50
    python -m tests.bench_kill_resume --kills 50 --table sweep.csv -- python -m orchestrator sweep --out {out} ...

``{out}`` in the command stands for the result directory; ``--resume`` is appended to it. Exit code 1 when the
tables differ, when a case is lost or double, or when a worker process outlives its sweep.
"""

import argparse
import csv
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.engine_process import children, finished_cases, wait_until_gone

DRIVER = [sys.executable, "-m", "tests.support.engine_driver", "{out}", "2000", "0.02", "2"]
ROOT = Path(__file__).parents[1]


def run(command: list[str], out: Path) -> float:
    """Run the command to its end and return the seconds that it took."""
    start = time.monotonic()
    subprocess.run([word.replace("{out}", str(out)) for word in command], cwd=ROOT, check=True, capture_output=True)
    return time.monotonic() - start


def kill_once(command: list[str], out: Path, after: float) -> tuple[bool, int]:
    """Start or resume the sweep, kill it after a while; return whether it was killed, and the cases kept."""
    words = [*(word.replace("{out}", str(out)) for word in command), "--resume"]
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        _, errors = process.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        workers = children(process.pid)
        process.kill()
        process.communicate()
        wait_until_gone(workers, limit=60.0)
        return True, finished_cases(out)
    if process.returncode not in {0, 1}:
        raise SystemExit(f"the sweep ended with {process.returncode}: {errors}")
    return False, 0


def main() -> int:
    """Kill, resume, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--longest", type=float, default=4.0, help="seconds until a kill, at most")
    parser.add_argument("--table", default="table.csv")
    parser.add_argument("command", nargs="*", default=DRIVER)
    args = parser.parse_args()
    dice = random.Random(args.seed)
    with tempfile.TemporaryDirectory() as scratch:
        calm = Path(scratch) / "calm"
        print(f"undisturbed: {run(args.command, calm):.1f} s")
        reference = (calm / args.table).read_bytes()
        kills, sweeps, kept = 0, 0, 0
        while kills < args.kills:
            out = Path(scratch) / f"killed{sweeps}"
            killed, found = kill_once(args.command, out, dice.uniform(0.2, args.longest))
            kills += killed
            if killed and found < kept:
                raise SystemExit(f"cases lost: {found} after {kept}")
            kept = found
            if not killed:
                sweeps += 1
                compare(reference, out / args.table)
        last = Path(scratch) / f"killed{sweeps}"
        run([*args.command, "--resume"], last)
        compare(reference, last / args.table)
        print(f"{kills} kills over {sweeps + 1} sweeps: no case lost, none double, same bytes")
    return 0


def compare(reference: bytes, path: Path) -> None:
    """End the program when the table is not the undisturbed one."""
    content = path.read_bytes()
    if content != reference:
        rows = list(csv.reader(content.decode().splitlines()))
        raise SystemExit(f"{path.name} differs from the undisturbed one ({len(rows) - 1} rows, {len(content)} bytes)")


if __name__ == "__main__":
    sys.exit(main())
