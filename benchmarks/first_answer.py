"""What the first answer costs, and the second: commands in this checkout and in another, in turn.

    python -m benchmarks.first_answer --other ../before --commands diagnose,estimate

Each command runs twice in a copy of either checkout, at first with an empty home: nothing that a run leaves is there,
such as FMUs, bytecode or caches beside the sources, but kernels that were compiled at installation. Printed are user
processor time of the command and its children, and the largest resident memory of any of them, with the ratios of this
checkout to the other.
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

ROOT = Path(__file__).resolve().parents[1]
RECORD, MODEL = "docs/examples/machine.csv", "docs/examples/machine.toml"
COMMANDS = {
    "diagnose": ["diagnose", RECORD, "--model", MODEL],
    "estimate": ["estimate", RECORD],
    "inspect": ["inspect", RECORD],
    "simulate": ["simulate"],
    "sweep": ["sweep"],
}
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
    words = [sys.executable, "-m", "orchestrator", *command, "--out", str(home / "out")]
    done = subprocess.run(
        [sys.executable, "-c", _RUN, *words], cwd=root, env=environment, capture_output=True, text=True, check=True
    )

    code, seconds, memory, text = json.loads(done.stdout)
    if code:
        raise SystemExit(f"{root}: {' '.join(command)} ended with {code}: {text}")
    return Cost(seconds, memory)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--other", type=Path, required=True, help="a checkout, whose libraries this Python has")
    parser.add_argument("--commands", default=",".join(COMMANDS))
    arguments = parser.parse_args()
    print(
        f"{'command':10}{'run':6}{'this s':>8}{'other s':>9}{'ratio':>7}{'this MiB':>10}{'other MiB':>11}{'ratio':>7}"
    )
    for name in arguments.commands.split(","):
        with tempfile.TemporaryDirectory() as folder:
            homes = [Path(folder) / "this", Path(folder) / "other"]
            copies = [home / "checkout" for home in homes]
            for root, copy in zip((ROOT, arguments.other.resolve()), copies, strict=True):
                shutil.copytree(root, copy, ignore=shutil.ignore_patterns(".*", "__pycache__", "*.fmu"))
            for state in ("cold", "warm"):
                this, other = (run(root, COMMANDS[name], home) for root, home in zip(copies, homes, strict=True))
                print(
                    f"{name:10}{state:6}{this.seconds:8.1f}{other.seconds:9.1f}{this.seconds / other.seconds:7.2f}"
                    f"{this.memory:10.0f}{other.memory:11.0f}{this.memory / other.memory:7.2f}", flush=True,
                )  # fmt: skip


if __name__ == "__main__":
    main()
