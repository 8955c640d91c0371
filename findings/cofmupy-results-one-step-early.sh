#!/usr/bin/env bash
# Guess: get_results() of CoFmuPy has the outputs of a run at the times at which the FMUs had them: the initial values at the start,
#   and after a step the outputs of its end. Its file storage has the same rows.
# What happens: the outputs of the end of a step have the time of its begin, and the initial values are not there. An FMU whose
#   output is its own time shows 0.25 s at 0, and 1 s at 0.75 s. The file storage of the same run has the right times. A
#   curve from get_results(), save_results() included, is one step early against a measurement and against other hosts, and a
#   dead time that is read from it is one step short.
# Version: cofmupy 1.0.0, FMPy 0.3.20, pythonfmu 0.6.3, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q cofmupy==1.0.0 FMPy==0.3.20 pythonfmu==0.6.3 numpy==2.4.6

cat > clock.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Clock(Fmi2Slave):
    """Its output is the time that it has reached [s]."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.reached = 0.0
        self.register_variable(Real("reached", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.reached = current_time + step_size
        return True
PYTHON
venv/bin/pythonfmu build -f clock.py > build.txt

cat > run.py <<'PYTHON'
import csv
import json
import logging
from importlib.metadata import version
from pathlib import Path

logging.disable(logging.CRITICAL)
import fmpy  # noqa: E402
from cofmupy import Coordinator  # noqa: E402

source = {"type": "fmu", "id": "clock", "variable": "reached"}
store = {"type": "storage", "id": "rows", "alias": "reached"}
Path("case.json").write_text(
    json.dumps(
        {
            "fmus": [{"id": "clock", "path": "Clock.fmu"}],
            "connections": [{"source": source, "target": [store]}],
            "data_storages": [{"name": "rows", "type": "file", "config": {"path": "rows/rows.csv"}}],
            "root": ".",
        }
    )
)
run = Coordinator()
run.start("case.json")
run.run_simulation(0.25, 1.0, save_data=True)
results = run.get_results()
times, reached = (list(map(float, results[key])) for key in ("time", ("clock", "reached")))
print("cofmupy", version("cofmupy"))
print("get_results:", list(zip(times, reached)))
assert times == [0.0, 0.25, 0.5, 0.75] and reached == [0.25, 0.5, 0.75, 1.0]
with open("rows/rows.csv") as file:
    rows = [list(map(float, row)) for row in list(csv.reader(file))[1:]]
print("file storage:", rows)
assert rows == [[t, t] for t in (0.25, 0.5, 0.75, 1.0)]
other = fmpy.simulate_fmu("Clock.fmu", stop_time=1.0, output_interval=0.25)
print("FMPy", fmpy.__version__, "of the same FMU:", [tuple(map(float, row)) for row in other])
assert all(row["time"] == row["reached"] for row in other)
PYTHON
venv/bin/python run.py
echo "as described"
