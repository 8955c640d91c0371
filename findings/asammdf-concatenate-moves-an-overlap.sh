#!/usr/bin/env bash
# Guess: MDF.concatenate() of asammdf joins two files by their start times (`sync`, its default). Where the second begins a
#   little before the first ends, the samples keep their times, or the files are refused.
# What happens: each group whose first stamp is not after its last one is moved behind it, all of it and for good, and the other
#   groups are not. Two files that overlap by 40 ms: the angle, sampled each 10 ms, is 50 ms late from there on, and the torque,
#   each 100 ms, is not: a dead time that no drive has. Handed over in the wrong order, the older file is put behind the newer
#   one. Nothing is said. stack() keeps all times.
# Version: asammdf 8.8.28, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 numpy==2.4.6

cat > run.py <<'PYTHON'
from datetime import datetime, timedelta, timezone

import asammdf
import numpy as np
from asammdf import MDF, Signal

BEGIN = datetime(2026, 1, 1, tzinfo=timezone.utc)
STEPS = {"angle": 0.01, "torque": 0.1}


def write(path, start, end):
    """Write both signals from start to end [s]; the value of a sample is its true time."""
    with MDF() as file:
        file.start_time = BEGIN + timedelta(seconds=start)
        for name, step in STEPS.items():
            true = step * np.arange(np.ceil(round(start / step, 6)), np.floor(round(end / step, 6)) + 1)
            file.append(Signal(true, true - start, name=name, unit="s"))
        file.save(path, overwrite=True)


def late(file, name):
    """Return the largest distance of a signal's stamps from its true times [s]."""
    signal = file.get(name)
    return round(float(np.max(np.abs(signal.timestamps - signal.samples))), 4)


write("first.mf4", 0.0, 0.99)
write("next.mf4", 1.02, 2.0)  # no overlap
write("second.mf4", 0.95, 2.0)  # begins 0.04 s before the end of the first
print("asammdf", asammdf.__version__)
with MDF.concatenate(["first.mf4", "next.mf4"]) as file:
    print("without overlap, late by:", {name: late(file, name) for name in STEPS})
    assert all(late(file, name) < 1e-6 for name in STEPS)
with MDF.concatenate(["first.mf4", "second.mf4"]) as file:
    found = {name: late(file, name) for name in STEPS}
    print("overlap of 0.04 s, late by:", found)
    assert found == {"angle": 0.05, "torque": 0.0}
    angle = file.get("angle")
    print("true times of the angle about the joint:", angle.samples[97:103].round(2).tolist())
with MDF.concatenate(["next.mf4", "first.mf4"]) as file:
    print("newer file first, late by:", {name: late(file, name) for name in STEPS})
    assert all(late(file, name) > 1.0 for name in STEPS)
with MDF.stack(["first.mf4", "second.mf4"]) as file:
    stacked = [file.get("angle", group=group, index=index) for group, index in file.whereis("angle")]
    print("stacked, first stamps of the angle:", [round(float(signal.timestamps[0]), 4) for signal in stacked])
    assert all(np.allclose(signal.timestamps, signal.samples) for signal in stacked)
PYTHON
venv/bin/python run.py
echo "as described"
