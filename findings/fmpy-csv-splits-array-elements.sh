#!/usr/bin/env bash
# Guess: read_csv() of FMPy reads what its write_csv() writes, for names of array elements too, such as `A[1,2]` of Modelica.
# What happens: write_csv puts the names between quotes, and read_csv splits them at the comma all the same: `A[1,2]` becomes two
#   columns, each name after it has the values of the next one, and the last name is gone: `speed` holds the torque. Nothing is
#   said. simulate() on the command line reads its input file so, and compares runs so. Other readers of CSV take the file.
# Version: FMPy 0.3.32, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q FMPy==0.3.32 numpy==2.4.6

cat > run.py <<'PYTHON'
import csv
from pathlib import Path

import fmpy
import numpy as np
from fmpy.util import read_csv, write_csv


def round_trip(names):
    rows = np.array([(0.0, 11.0, 12.0, 300.0), (1.0, 11.5, 12.5, 301.0)], dtype=[(name, float) for name in names])
    write_csv("rows.csv", rows)
    return read_csv("rows.csv")


print("FMPy", fmpy.__version__)
plain = round_trip(["time", "A[1]", "A[2]", "speed"])
assert plain.dtype.names == ("time", "A[1]", "A[2]", "speed")
assert plain["speed"].tolist() == [300.0, 301.0]

torn = round_trip(["time", "A[1,2]", "speed", "torque"])
print(Path("rows.csv").read_text().splitlines()[0], "->", torn.dtype.names)
print("speed:", torn["speed"].tolist(), "- written were [12.0, 12.5]")
assert torn.dtype.names == ("time", "A[1", "2]", "speed")
assert torn["speed"].tolist() == [300.0, 301.0]

with open("rows.csv", newline="") as file:  # the file is good
    assert next(csv.reader(file)) == ["time", "A[1,2]", "speed", "torque"]
PYTHON
venv/bin/python run.py
echo "as described"
