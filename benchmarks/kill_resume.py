"""Kills a sweep or its workers with SIGKILL at random moments, resumes it, and compares its table with a calm one's.

    python -m benchmarks.kill_resume --kills 100 --workers 30     # a sweep of an FMU that is not ours, behind walls
    python -m benchmarks.kill_resume --kills 50 --table table.csv -- \\
        python -m tests.support.engine_driver {out} 2000 0.02 2
    python -m benchmarks.kill_resume --cluster 2000               # pairs on a Dask cluster, which loses its scheduler

``{out}`` in a command stands for the result directory; ``--resume`` is appended to it. Exit code 1 when the
tables differ, when a case is lost or double, when a worker process outlives its sweep, or when the temporary
directory is not empty at the end.
"""

import argparse
import contextlib
import csv
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.c_fmu import build_c_fmu
from tests.support.engine_process import children, finished_cases, wait_until_gone

SCENARIO = """
stop = 100.0
record = ["slave.x", "slave.v"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""
ROOT = Path(__file__).parents[1]


def temporary() -> Path:
    """Where the sweep's temporary files go."""
    return Path(os.environ["TMPDIR"])


def foreign_sweep(folder: Path) -> list[str]:
    """Write a scenario of an FMU that is not ours, and return the command that sweeps it."""
    folder.mkdir()
    build_c_fmu(folder)
    (folder / "scenario.toml").write_text(SCENARIO)
    words = ["sweep", "--scenario", str(folder / "scenario.toml"), "--vary", "slave.stiffness=range:30:50:60"]
    return [sys.executable, "-m", "orchestrator", *words, "--workers", "2", "--out", "{out}"]


def run(command: list[str], out: Path) -> float:
    """Run the command to its end and return the seconds that it took."""
    start = time.monotonic()
    subprocess.run([word.replace("{out}", str(out)) for word in command], cwd=ROOT, check=True, capture_output=True)
    return time.monotonic() - start


def kill_cluster(folder: Path, pairs: int) -> None:
    """Sweep on a Dask cluster of two workers; kill a worker, then the scheduler; resume on this machine and compare."""
    from tests.support.dask_cluster import DaskProcesses

    words = [sys.executable, "-m", "orchestrator", "sweep", "--sizes", f"random:{pairs}", "--noise", "1e-4"]
    tables = {}
    for workers in ("1", "2"):
        out = folder / f"calm{workers}"
        print(f"{workers} workers: {run([*words, '--workers', workers, '--out', str(out)], out):.1f} s", flush=True)
        tables[workers] = (out / "sweep.csv").read_bytes()
    with DaskProcesses(folder, workers=2) as cluster:
        calm, out = folder / "cluster", folder / "killed"
        command = [*words, "--scheduler", cluster.address, "--out"]
        print(f"Dask, two workers: {run([*command, str(calm)], calm):.1f} s", flush=True)
        tables["Dask"] = (calm / "sweep.csv").read_bytes()
        if len(set(tables.values())) != 1:
            raise SystemExit("one worker, two workers and a cluster give different tables")
        process = subprocess.Popen(
            [*command, str(out)], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        for share, kill in ((0.2, lambda: cluster.kill_worker(0)), (0.5, cluster.kill_scheduler)):
            while process.poll() is None and finished_cases(out) < share * pairs:
                time.sleep(0.01)
            kill()
        said = process.communicate()[1].strip().splitlines()
    kept = finished_cases(out)
    if process.returncode != 1 or not share * pairs <= kept < pairs:
        raise SystemExit(f"the sweep ended with {process.returncode}, {kept} cases kept: {said}")
    run([*words, "--workers", "2", "--out", str(out), "--resume"], out)
    compare(tables["1"], out / "sweep.csv")
    print(f"without worker and scheduler: {said[-1]}; resumed: same bytes")


def kill_workers(process: "subprocess.Popen[str]", out: Path, dice: random.Random, most: int) -> int:
    """Kill at most ``most`` workers, each at a random moment after a case has come in; return how many were killed."""
    lost = 0
    while lost < most:
        known = finished_cases(out)
        while process.poll() is None and finished_cases(out) <= known:
            time.sleep(0.01)
        time.sleep(dice.uniform(0.0, 0.5))
        workers = children(process.pid)
        if process.poll() is not None or not workers:
            break
        with contextlib.suppress(ProcessLookupError):
            os.kill(dice.choice(workers), signal.SIGKILL)
            lost += 1
    return lost


def kill_once(command: list[str], out: Path, dice: random.Random, after: float) -> tuple[bool, int, int]:
    """Start or resume the sweep, kill workers (in every other run) and then the sweep.

    Returns:
        Whether the sweep was killed, the cases kept, and the number of workers killed.
    """
    words = [*(word.replace("{out}", str(out)) for word in command), "--resume"]
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    lost = kill_workers(process, out, dice, 3) if dice.random() < 0.5 else 0
    try:
        _, errors = process.communicate(timeout=after)
    except subprocess.TimeoutExpired:
        workers = children(process.pid)
        process.kill()
        process.communicate()
        wait_until_gone(workers)
        return True, finished_cases(out), lost
    if process.returncode not in {0, 1} or "error:" in errors:
        raise SystemExit(f"the sweep ended with {process.returncode}: {errors}")
    return False, 0, lost


def main() -> int:
    """Kill, resume, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50, help="of sweeps, at least")
    parser.add_argument("--workers", type=int, default=0, help="kills of workers, at least")
    parser.add_argument("--cluster", type=int, metavar="PAIRS", help="a sweep of pairs on a Dask cluster instead")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--longest", type=float, default=4.0, help="seconds until a kill, at most")
    parser.add_argument("--table", default="sweep.csv")
    parser.add_argument("command", nargs="*")
    args = parser.parse_args()
    dice = random.Random(args.seed)
    with tempfile.TemporaryDirectory() as scratch:
        if args.cluster:
            kill_cluster(Path(scratch), args.cluster)
            return 0
        command = args.command or foreign_sweep(Path(scratch) / "scenario")
        os.environ["TMPDIR"] = str(Path(scratch) / "temporary")
        temporary().mkdir()
        calm = Path(scratch) / "calm"
        print(f"undisturbed: {run(command, calm):.1f} s")
        reference = (calm / args.table).read_bytes()
        kills, workers, sweeps, kept = 0, 0, 0, 0
        while kills < args.kills or workers < args.workers:
            out = Path(scratch) / f"killed{sweeps}"
            killed, found, lost = kill_once(command, out, dice, dice.uniform(0.2, args.longest))
            kills += killed
            workers += lost
            if (out / args.table).exists():  # it was killed after its results were there
                killed = False
            if killed and found < kept:
                raise SystemExit(f"cases lost: {found} after {kept}")
            kept = found if killed else 0
            if not killed:
                sweeps += 1
                compare(reference, out / args.table)
        last = Path(scratch) / f"killed{sweeps}"
        run([*command, "--resume"], last)
        compare(reference, last / args.table)
        left = sorted(path.name for path in temporary().iterdir())
        if left:
            raise SystemExit(f"left in the temporary directory: {', '.join(left)}")
        print(
            f"{kills} kills of sweeps and {workers} of workers over {sweeps + 1} sweeps: no case lost, none double, "
            "same bytes, nothing left in the temporary directory"
        )
    return 0


def compare(reference: bytes, path: Path) -> None:
    """End the program when the table is not the undisturbed one."""
    content = path.read_bytes()
    if content != reference:
        rows = list(csv.reader(content.decode().splitlines()))
        raise SystemExit(f"{path.name} differs from the undisturbed one ({len(rows) - 1} rows, {len(content)} bytes)")


if __name__ == "__main__":
    sys.exit(main())
