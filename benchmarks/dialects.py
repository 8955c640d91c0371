"""One record in twelve dialects through ``estimate`` on the command line: the same half-gap from each, by one command.

::

    python -m benchmarks.dialects          # 8 s at 200 Hz
    python -m benchmarks.dialects --seed 7 --seconds 15

The first row is the plain CSV. A dialect's record differs from it by the digits that the format keeps; the table has
the largest difference of its angles and torque, and that of the half-gap, absolute and in standard errors.
"""

import argparse
import contextlib
import io
import json
import tempfile
from pathlib import Path

import numpy as np

from orchestrator.cli import main as command
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Record, read_record
from tests.support.dialects import DIALECTS
from tests.support.independent_plant import make_record, write_csv


def estimated(path: Path, model: Path | None, out: Path) -> tuple[float, float]:
    """Return half-gap and standard error [rad] of ``estimate PATH [--model MODEL]``."""
    words = ["estimate", str(path), "--no-diagnose", "--out", str(out)]
    words += [] if model is None else ["--model", str(model)]
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = command(words)
    if code != 0:
        raise SystemExit(f"{' '.join(words)}: exit code {code}\n{said.getvalue()}")
    found = json.loads((out / "estimate.json").read_text())["results"]
    return float(found["alpha"]), float(found["standard_error"])


def largest_difference(first: Record, other: Record) -> float:
    """Return the largest difference of two records' torques [N.m] and angles [rad]."""
    pairs = ((first.u, other.u), (first.theta_m, other.theta_m), (first.theta_l, other.theta_l))
    return max(float(np.abs(a - b).max()) for a, b in pairs if a is not None and b is not None)


def main() -> None:
    """Write the dialects, estimate each, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=8.0)
    arguments = parser.parse_args()
    columns, _ = make_record({"alpha": 0.01}, arguments.seed, arguments.seconds)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plain = folder / "plain.csv"
        write_csv(plain, columns)
        first, error = estimated(plain, None, folder / "plain")
        print(f"{'plain':20}{first:.12f} +- {error:.3g} rad")
        for write in DIALECTS:
            path, text = write(folder, columns)
            model = folder / f"{path.stem}.toml" if text else None
            if model is not None:
                model.write_text(text)
            record = read_record(path, read_model(model).columns)
            off = largest_difference(record, read_record(plain))
            alpha, _ = estimated(path, model, folder / write.__name__)
            shift = alpha - first
            print(f"{write.__name__:20}{alpha:.12f}  data {off:8.1e}  half-gap {shift:9.1e} = {shift / error:8.1e} se")


if __name__ == "__main__":
    main()
