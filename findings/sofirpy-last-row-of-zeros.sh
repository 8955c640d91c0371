#!/usr/bin/env bash
# Guess: simulate(stop_time=1.7, step_size=0.1) of sofirpy, co-simulation of FMUs and Python models, takes 17 steps and returns 18 rows, the
#   last at 1.7 s.
# What happens: the times are made by numpy.arange, and the last one is dropped where rounding puts it above stop_time; the number of rows is
#   made by another division, which rounds otherwise. For two in five of the stop times up to 5.9 s the run lacks its last step. Some of
#   these results end with a row in which time and all values are 0, so that a motor jumps back to its start, some have a row
#   less, and some runs end with an IndexError. Nothing else is said. Steps that doubles hold exactly (0.125 s) are right.
# Version: sofirpy 1.0.2, FMPy 0.3.32, pandas 3.1.1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q sofirpy==1.0.2 fmpy==0.3.32 pandas==3.1.1 numpy==2.4.6

cat > run.py <<'PYTHON'
import logging
from collections import Counter
from importlib.metadata import version

from sofirpy import SimulationEntity, simulate

print("sofirpy", version("sofirpy"))


class Axis(SimulationEntity):
    """An axis that turns by 1 rad a step."""

    def __init__(self):
        self.angle = 5.0

    def do_step(self, time):
        self.angle += 1.0

    def get_parameter_value(self, name):
        return self.angle

    def set_parameter(self, name, value):
        raise NotImplementedError

    def get_dtype_of_parameter(self, name):
        return float


def run(stop, step):
    return simulate(stop, step, model_classes={"axis": Axis}, parameters_to_log={"axis": ["angle"]})


def judge(stop, step, steps):
    try:
        rows = run(stop, step).to_numpy()
    except IndexError as error:
        return str(error)
    if len(rows) == steps + 1 and abs(rows[-1, 0] - stop) < 1e-9:
        return "right"
    return "a row of zeros at the end" if not rows[-1].any() else f"{steps + 1 - len(rows)} row less"


logging.disable()
print(run(1.7, 0.1).tail(3))
last = run(1.7, 0.1).to_numpy()[-2:]
assert last[0].round(9).tolist() == [1.6, 21.0] and last[1].tolist() == [0.0, 0.0]
last = run(0.3, 0.1).to_numpy()
assert len(last) == 3 and last[-1].round(9).tolist() == [0.2, 7.0]
kinds = Counter(judge(round(0.1 * n, 6), 0.1, n) for n in range(2, 60))
print(dict(kinds))
assert kinds["right"] < 0.75 * kinds.total() and kinds["a row of zeros at the end"] > 0 and kinds["1 row less"] > 0
assert any("out of bounds" in kind for kind in kinds)
assert {judge(0.125 * n, 0.125, n) for n in range(2, 60)} == {"right"}
PYTHON
venv/bin/python run.py 2>bars.txt
echo "as described"
