#!/usr/bin/env bash
# Guess: asammdf exports the groups of an MDF file to CSV with the times that they have, or all moved by the same amount.
# What happens: each group has a file of its own whose times begin at zero (time_from_zero, which is the default, holds for each
#   group alone): a torque that was logged from 5.0 s on and an angle from 4.9 s on begin together, and the angle is 0.1 s
#   late. With single_time_base=True both are moved by the same amount; MAT keeps the times of each group as they are.
# Version: asammdf 8.8.28, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 scipy==1.17.1

cat > run.py <<'PYTHON'
import asammdf
import numpy as np
import scipy.io

fast, slow = 5.0 + np.arange(200) * 0.01, 4.9 + np.arange(100) * 0.02
with asammdf.MDF(version="4.10") as file:
    file.append([asammdf.Signal(np.sin(fast), fast, name="torque", unit="N.m")])
    file.append([asammdf.Signal(np.sin(slow), slow, name="angle", unit="rad")])  # the same function of time
    file.save("log.mf4", overwrite=True)

file = asammdf.MDF("log.mf4")

file.export("csv", "log.csv")
groups = [np.genfromtxt(f"log.ChannelGroup_{k}_Python.csv", delimiter=",", names=True) for k in (0, 1)]
begin = [float(group["timestamps"][0]) for group in groups]
moved = [first - float(group["timestamps"][0]) for first, group in zip((5.0, 4.9), groups)]
print("asammdf", asammdf.__version__, "CSV begins at", begin, "moved by", moved)
assert begin == [0.0, 0.0] and np.allclose(moved, [5.0, 4.9])
assert np.allclose(groups[0]["torque"], np.sin(groups[0]["timestamps"] + 5.0))
assert np.allclose(groups[1]["angle"], np.sin(groups[1]["timestamps"] + 4.9))

file.export("csv", "one.csv", single_time_base=True)
one = np.genfromtxt("one.csv", delimiter=",", names=True)
inner = (one["timestamps"] > 0.1) & (one["timestamps"] < 1.8)
error = np.abs(one["torque"] - one["angle"])[inner].max()
print("one time base: torque and angle differ by", float(error))
assert error < 1e-3

file.export("mat", "log.mat")
mat = scipy.io.loadmat("log.mat")
begin = [float(mat[f"DGM{k}_timestamps"][0, 0]) for k in (0, 1)]
print("MAT begins at", begin)
assert begin == [5.0, 4.9]
PYTHON
venv/bin/python run.py
echo "as described"
