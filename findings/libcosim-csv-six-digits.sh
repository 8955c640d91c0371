#!/usr/bin/env bash
# Guess: the CSV files of libcosim's file observer (CosimObserver.create_to_dir) hold times and values to the digits of a double, or to so many
#   that a run can be compared with another one.
# What happens: each number has six significant digits, which is as many as C++ prints unless it is told otherwise. A motor's angle of 1234 rad
#   that grows by 1 mrad a step stands still and jumps by 10 mrad, wider than many a gap of a gear; its speed from differences is zero or
#   ten times too high. From 100 s on, times 0.5 ms apart repeat. The observer of the last values has all digits. Nothing is said.
# Version: libcosimpy 0.0.6, pythonfmu 0.7.0, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q libcosimpy==0.0.6 pythonfmu==0.7.0 numpy==2.4.6 setuptools==80.9.0

cat > axis.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Axis(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.angle = 1234.0
        self.register_variable(Real("angle", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.angle += 0.001
        return True
PYTHON
venv/bin/pythonfmu build -f axis.py -d . >built.txt

cat > run.py <<'PYTHON'
import gc
import os
from importlib.metadata import version
from pathlib import Path

import numpy as np
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

print("libcosimpy", version("libcosimpy"))
STEP = 500_000  # ns
Path("log").mkdir()


def run(last):
    """Run to ``last`` [ns]; return the angle that the observer of last values has. The file is whole after it."""
    execution = CosimExecution.from_step_size(step_size=STEP)
    place = execution.add_local_slave(CosimLocalSlave(fmu_path="Axis.fmu", instance_name="axis"))
    values, files = CosimObserver.create_last_value(), CosimObserver.create_to_dir(log_dir="log")
    execution.add_observer(values)
    execution.add_observer(files)
    execution.simulate_until(target_time=last)
    return values.last_real_values(slave_index=place, variable_references=[0])[0]


steps = 200_020  # 100.01 s
kept = run(steps * STEP)
gc.collect()
(path,) = Path("log").glob("*.csv")
rows = path.read_text().splitlines()
print(rows[0], rows[2], rows[-1], sep="\n")
table = np.array([row.split(",") for row in rows[1:]], dtype=float)
time, angle = table[:, 0], table[:, 2]
moves = np.unique(np.round(np.diff(angle[:1000]), 6)).tolist()
late = np.unique(np.round(np.diff(time[-20:]), 6)).tolist()
print("steps of the angle [rad]:", moves, "; steps of the time from 100 s on [s]:", late, "; last value", kept)
assert moves == [0.0, 0.01]
assert late == [0.0, 0.001]
assert abs(kept - (1234.0 + 0.001 * steps)) < 1e-6 and angle[-1] != kept
PYTHON
venv/bin/python run.py 2>fmi.txt | grep -v FMILIB
echo "as described"
