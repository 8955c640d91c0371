#!/usr/bin/env bash
# Guess: the `comtrade` package holds times and samples of a COMTRADE record as doubles: a record at 10 kHz has steps of 0.1 ms from
#   its first row to its last, and the whole numbers of a position encoder are what the file has.
# What happens: both are held in single precision, seven digits. After 20 minutes at 10 kHz the steps are 0 or 0.122 ms, two in
#   eleven of them 0, and a speed from differences is a division by zero; the counts 16777217 and 16777218 differ by 2. Nothing
#   is said. Comtrade(use_double_precision=True) is right.
# Version: comtrade 0.2.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q comtrade==0.2.0

cat > run.py <<'PYTHON'
from collections import Counter
from importlib.metadata import version

from comtrade import Comtrade

BEGIN, ROWS, COUNT = 1_200_000_000, 2000, 16_777_216  # BEGIN in microseconds
HEAD = """drive,recorder,1999
1,1A,0D
1,angle,,,counts,1,0,0,0,99999999,1,1,P
50
0
0,2000
01/01/2026,00:00:00.000000
01/01/2026,00:20:00.000000
ASCII
1
"""
rows = "".join(f"{k + 2},{BEGIN + 100 * k},{COUNT + k}\n" for k in range(ROWS - 1))
data = f"1,0,{COUNT - 1}\n" + rows

print("comtrade", version("comtrade"))
for options in ({}, {"use_double_precision": True}):
    record = Comtrade(**options)
    record.read(HEAD, data)
    times, angle = list(record.time), list(record.analog[0])
    steps = Counter(round(b - a, 6) for a, b in zip(times[1:], times[2:]))
    counts = Counter(b - a for a, b in zip(angle[1:], angle[2:]))
    print(options, "steps [s]:", dict(steps), "steps of the count:", dict(counts))
    if options:
        assert set(steps) == {0.0001} and set(counts) == {1.0}
    else:
        assert set(steps) == {0.0, 0.000122} and 300 < steps[0.0] < 420
        assert set(counts) == {0.0, 2.0}
PYTHON
venv/bin/python run.py
echo "as described"
