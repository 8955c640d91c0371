"""What the first answer costs, and the second: commands in this checkout and in another, in turn.

    python -m benchmarks.first_answer --other ../before --commands diagnose,estimate
    python -m benchmarks.first_answer --other COMMIT --commands cases,long-diagnose --rows 1000000

Each command runs twice in a copy of either checkout, at first with an empty home: nothing that a run leaves is there,
such as FMUs, bytecode or caches beside the sources, but kernels that were compiled at installation. Printed are user
processor time of the command and its children, and the largest resident memory of any of them, with the ratios of this
checkout to the other. Commands that begin with "long" read a log of ``--rows`` rows at 5 kHz, which is simulated
beforehand. A commit of this repository is unpacked into a temporary folder.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.support.independent_plant import make_record
from tools.release import committed

ROOT = Path(__file__).resolve().parents[1]
RECORD, MODEL = "docs/examples/machine.csv", "docs/examples/machine.toml"
COMMANDS = {
    "diagnose": ["diagnose", RECORD, "--model", MODEL],
    "estimate": ["estimate", RECORD],
    "inspect": ["inspect", RECORD],
    "simulate": ["simulate"],
    "sweep": ["sweep"],
    "cases": ["sweep", "--sizes", "random:2000", "--workers", "1"],
    "help": ["estimate", "--help"],
    "build": ["build", "--native", "--force"],
    "long-inspect": ["inspect", "{log}"],
    "long-estimate": ["estimate", "{log}", "--no-diagnose"],
    "long-diagnose": ["diagnose", "{log}", "--model", MODEL],
}
RATE = 5000.0  # Hz, of the long log
USUAL = ("diagnose", "estimate", "inspect", "simulate", "sweep")
_RUN = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([done.returncode, used.ru_utime, used.ru_maxrss / 1024, done.stderr[-300:]]))
"""


@dataclass(frozen=True)
class Cost:
    """User processor time [s] and largest resident memory [MiB] of a run."""

    seconds: float
    memory: float


def run(root: Path, command: list[str], home: Path) -> Cost:
    """Run a command of a checkout with a home of its own."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "PYTHON"))}
    environment |= {"PYTHONPATH": str(root), "HOME": str(home)}
    out = [] if "--help" in command else ["--out", str(home / "out")]
    words = [sys.executable, "-m", "orchestrator", *command, *out]
    done = subprocess.run(
        [sys.executable, "-c", _RUN, *words], cwd=root, env=environment, capture_output=True, text=True, check=True
    )

    code, seconds, memory, text = json.loads(done.stdout)
    if code:
        raise SystemExit(f"{root}: {' '.join(command)} ended with {code}: {text}")
    return Cost(seconds, memory)


def write_log(path: Path, rows: int) -> None:
    """Write a record of a drivetrain with a half-gap of 0.01 rad."""
    columns, _ = make_record({"alpha": 0.01}, 77, rows / RATE, RATE)
    names = ("u", "theta_m", "theta_l")
    values = zip(*(columns[name].tolist() for name in names), strict=True)
    lines = (f"{n / RATE:.4f}," + ",".join(format(value, ".9g") for value in row) for n, row in enumerate(values))
    path.write_text("\n".join([",".join(("time", *names)), *lines]) + "\n")


def checkout(name: str, folder: Path) -> Path:
    """Return a checkout: a folder that is one, else this repository's commit of that name, unpacked."""
    return Path(name).resolve() if Path(name).is_dir() else committed(ROOT, folder, name)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--other", required=True, help="a checkout or a commit, whose libraries this Python has")
    parser.add_argument("--commands", default=",".join(USUAL), help=f"of {', '.join(COMMANDS)} (default: %(default)s)")
    parser.add_argument("--rows", type=int, default=1_000_000, help="of the long log (default: %(default)s)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        compare(arguments.commands.split(","), checkout(arguments.other, Path(folder) / "other"), arguments.rows)


def compare(names: list[str], other_root: Path, rows: int) -> None:
    """Print the table of these commands."""
    print(
        f"{'command':14}{'run':6}{'this s':>8}{'other s':>9}{'ratio':>7}{'this MiB':>10}{'other MiB':>11}{'ratio':>7}"
    )
    with tempfile.TemporaryDirectory() as shared:
        log = Path(shared) / "log.csv"
        if any(name.startswith("long") for name in names):
            write_log(log, rows)
        for name in names:
            compare_command(name, other_root, log)


def compare_command(name: str, other_root: Path, log: Path) -> None:
    """Print the rows of one command."""
    with tempfile.TemporaryDirectory() as folder:
        homes = [Path(folder) / "this", Path(folder) / "other"]
        copies = [home / "checkout" for home in homes]
        for root, copy in zip((ROOT, other_root), copies, strict=True):
            shutil.copytree(root, copy, ignore=shutil.ignore_patterns(".*", "__pycache__", "*.fmu"))
        command = [word.replace("{log}", str(log)) for word in COMMANDS[name]]
        for state in ("cold", "warm"):
            this, other = (run(root, command, home) for root, home in zip(copies, homes, strict=True))
            print(
                    f"{name:14}{state:6}{this.seconds:8.1f}{other.seconds:9.1f}{this.seconds / other.seconds:7.2f}"
                    f"{this.memory:10.0f}{other.memory:11.0f}{this.memory / other.memory:7.2f}", flush=True,
                )  # fmt: skip


if __name__ == "__main__":
    main()
