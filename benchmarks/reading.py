"""Reading a log of a million rows: memory and processor time of two checkouts, in turn, as ratios.

::

    python -m benchmarks.reading                       # this checkout alone
    python -m benchmarks.reading --against ../other    # and its ratios to another one, in one run
    python -m benchmarks.reading --rows 200000 --rounds 3

For CSV, MF4 and Parquet: ``load`` reads the columns of the file, ``record`` makes a checked record of them. Each is run
in a process of its own, behind a small file that loads what is loaded once. Memory is the peak above what the process
had before, in MiB, that of the reader's child process beside it; time is processor time of both. ``numpy.loadtxt`` of
the same CSV shows what such a file costs at least.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NAMES = ("time", "u", "theta_m", "theta_l")
HERE = Path(__file__).resolve().parents[1]
WARMING_ROWS = 2000


def columns(rows: int) -> dict[str, NDArray[np.float64]]:
    """Return columns of a simulated machine at 5 kHz, (rows,) each."""
    rng = np.random.default_rng(1)
    t = np.arange(rows) / 5000.0
    u = 13.0 * np.sin(4.4 * t) + 3.0 * np.sin(11.0 * t)
    m = 3.0 * np.sin(1.3 * t) + 1e-4 * rng.standard_normal(rows)
    return {"time": t, "u": u, "theta_m": m, "theta_l": 0.25 * m + 1e-4 * rng.standard_normal(rows)}


def write_csv(path: Path, table: dict[str, NDArray[np.float64]]) -> None:
    with path.open("w") as file:
        file.write(",".join(NAMES) + "\n")
        lines = zip(*(table[name].tolist() for name in NAMES), strict=True)
        file.writelines(f"{t:.4f},{u:.6g},{m:.7f},{angle:.7f}\n" for t, u, m, angle in lines)


def write_mf4(path: Path, table: dict[str, NDArray[np.float64]]) -> None:
    import asammdf

    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(table[name], table["time"], name=name) for name in NAMES[1:]])
        file.save(path, overwrite=True)


def write_parquet(path: Path, table: dict[str, NDArray[np.float64]]) -> None:
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(table), path)


FORMATS = {"csv": write_csv, "mf4": write_mf4, "parquet": write_parquet}


def measure(task: str, warming: Path, path: Path) -> dict[str, float]:
    """Return what one reading costs, in this process and in its children."""
    work = _work(task)
    work(warming)
    before = _used()
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    start = _memory("VmRSS")
    work(path)
    after = _used()
    return {
        "memory": (_memory("VmHWM") - start) / 1024.0,
        "child": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024.0,
        "time": after - before,
    }


def _work(task: str) -> Callable[[Path], object]:
    if task == "loadtxt":
        return lambda path: np.loadtxt(path, delimiter=",", skiprows=1)
    if task == "record":
        from orchestrator.records.record import read_record

        return read_record
    from orchestrator.records.formats import open_source

    def load(path: Path) -> object:
        with open_source(path) as source:
            return source.load(range(len(source.heads)))

    return load


def _used() -> float:
    """Return the processor time of this process and of its children that have ended [s]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _memory(key: str) -> int:
    """Return a line of the process's status [KiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(key))


def run(checkout: Path, task: str, warming: Path, path: Path) -> dict[str, float]:
    """Return what a checkout needs for a task, measured in a process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(checkout), "PYTHONWARNINGS": "ignore"}
    words = [sys.executable, __file__, "--measure", task, str(warming), str(path)]
    done = subprocess.run(words, env=environment, cwd=checkout, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def compare(checkouts: dict[str, Path], rows: int, rounds: int) -> None:
    """Print a table."""
    table = columns(rows)
    print(f"{'':16}" + "".join(f"{name:>32}" for name in checkouts) + f"{'ratio: memory, time':>24}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for suffix, write in FORMATS.items():
            write(folder / f"big.{suffix}", table)
            write(folder / f"small.{suffix}", {key: values[:WARMING_ROWS] for key, values in table.items()})
        tasks = [(task, suffix) for suffix in FORMATS for task in ("load", "record")]
        for task, suffix in [*tasks, ("loadtxt", "csv")]:
            found: dict[str, list[dict[str, float]]] = {key: [] for key in checkouts}
            for _ in range(rounds):
                for key, checkout in checkouts.items():
                    found[key].append(run(checkout, task, folder / f"small.{suffix}", folder / f"big.{suffix}"))
            _print_row(f"{task} {suffix}", found)


def _print_row(title: str, found: dict[str, list[dict[str, float]]]) -> None:
    line, middle = f"{title:16}", []
    for several in found.values():
        # Others use the machine, too: the least time is the nearest to what the work takes.
        value = {key: statistics.median(one[key] for one in several) for key in ("memory", "child")}
        value["time"] = min(one["time"] for one in several)
        middle.append(value)
        child = f" + {value['child']:.0f}" if value["child"] else ""
        words = f"{value['memory']:.0f}{child} MiB, {value['time']:.2f} s"
        line += f"{words:>32}"
    if len(middle) > 1:
        first, second = middle
        memory = (first["memory"] + first["child"]) / (second["memory"] + second["child"])
        words = f"{memory:.2f}, {first['time'] / second['time']:.2f}"
        line += f"{words:>24}"
    print(line, flush=True)


def main() -> None:
    """Measure, or compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--measure", nargs=3, metavar=("TASK", "SMALL", "FILE"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        task, warming, path = arguments.measure
        print(json.dumps(measure(task, Path(warming), Path(path))))
        return
    checkouts = {"this checkout": HERE}
    if arguments.against is not None:
        checkouts["the other"] = arguments.against.resolve()
    compare(checkouts, arguments.rows, arguments.rounds)


if __name__ == "__main__":
    main()
