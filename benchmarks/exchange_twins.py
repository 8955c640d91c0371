"""FMUs of other tools as model exchange: ours beside FMPy's, and beside their own co-simulation in our master.

python -m benchmarks.exchange_twins FMU ...        # prints a row for each
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np

from orchestrator.api.simulate import simulate
from orchestrator.errors import OrchestratorError
from orchestrator.fmi.model_description import read_description

POINTS, LONGEST = 200, 10.0
OF_FMPY = """
import json, sys
import fmpy, numpy as np
fmu, names, stop, step = json.loads(sys.argv[1])
found = fmpy.simulate_fmu(fmu, fmi_type="ModelExchange", solver="CVode", stop_time=stop, output_interval=step,
                          relative_tolerance=1e-8, output=names, record_events=False)
np.save(sys.argv[2], [np.asarray(found[name], dtype=float) for name in ["time", *names]])
"""
"""FMPy runs in a process of its own, without walls: give it FMUs that are trusted."""


def run_ours(
    fmu: Path, names: list[str], stop: float, step: float, folder: Path, interface: str
) -> tuple[np.ndarray, int]:
    """Return times and values, a row each, and the number of events."""
    path = folder / "run.toml"
    record = json.dumps([f"a.{name}" for name in names])
    path.write_text(
        f'stop = {stop!r}\nrecord = {record}\n[master]\nstep = {step!r}\n[instances.a]\nfmu = "{fmu}"\n'
        f'interface = "{interface}"\n'
    )
    result = simulate(path)
    table = np.array([result.time, *(result[f"a.{name}"] for name in names)])
    return table, len(result.run.statistics.events.times)


def difference(one: np.ndarray, other: np.ndarray) -> str:
    """Return the largest difference at common times, as a share of the largest value or of 1."""
    last = np.append(np.diff(other[0]) > 0.0, True)  # the values after an event
    other = other[:, last]
    count = min(one.shape[1], other.shape[1])
    scale = np.maximum(1.0, np.abs(other[1:]).max(axis=1, keepdims=True))
    return f"{np.max(np.abs(one[1:, :count] - other[1:, :count]) / scale):.1e}"


def compare(fmu: Path, folder: Path) -> str:
    """Return the row of one FMU."""
    variables = read_description(fmu, exchange=True).model.variables.values()
    kinds = ("Real", "Integer", "Boolean")
    scalars = [v for v in variables if v.type in kinds and "[" not in v.name]
    outputs = [v.name for v in scalars if v.causality == "output"]
    names = (outputs or [v.name for v in scalars if (v.causality, v.variability) == ("local", "continuous")])[:6]
    if not names:
        return f"| {fmu.stem} | | no scalar to compare | |"
    experiment = fmpy.read_model_description(str(fmu), validate=False).defaultExperiment
    stop = min(float(getattr(experiment, "stopTime", None) or 1.0), LONGEST)
    ours, events = run_ours(fmu, names, stop, stop / POINTS, folder, "model_exchange")
    asked = json.dumps([str(fmu), names, stop, stop / POINTS])
    file = folder / "fmpy.npy"
    theirs = subprocess.run([sys.executable, "-c", OF_FMPY, asked, str(file)], capture_output=True, check=False)
    against = difference(ours, np.load(file)) if theirs.returncode == 0 else "refused"
    try:
        stepped = difference(run_ours(fmu, names, stop, stop / POINTS, folder, "co_simulation")[0], ours)
    except OrchestratorError:
        stepped = "refused"
    return f"| {fmu.stem} | {events} | {against} | {stepped} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fmus", nargs="+", type=Path)
    print("| FMU | events found | from FMPy's model exchange | from its own co-simulation |\n|---|---|---|---|")
    for fmu in parser.parse_args().fmus:
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(compare(fmu.resolve(), Path(folder)), flush=True)
            except OrchestratorError as error:
                print(f"| {fmu.stem} | | {error} | |", flush=True)


if __name__ == "__main__":
    main()
