#!/usr/bin/env bash
# Guess: a sample that an MDF file marks as invalid is missing in what asammdf makes of the file, or is marked there too; and
#   another reader of MDF leaves it out as well.
# What happens: get() leaves such samples out. to_dataframe() and CSV hold a number instead: floats are interpolated across
#   them, whole numbers repeat the last valid one, and at an end the nearest valid one is repeated. MAT, MDF 3.30 and
#   mdfreader have the invalid numbers as they were, as good ones. Nothing is said.
# Version: asammdf 8.8.28, mdfreader 4.3, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 mdfreader==4.3 scipy==1.17.1

cat > run.py <<'PYTHON'
import asammdf
import mdfreader
import numpy as np
import scipy.io

time = np.arange(8) * 0.1
marks = np.array([0, 0, 0, 1, 1, 0, 0, 1], dtype=bool)  # rows 3, 4 and 7 are invalid
torque = np.where(marks, 1000.0, np.array([0.0, 1.0, 1.0, 0.0, 0.0, 4.0, 4.0, 0.0]))
count = np.where(marks, 1000, np.arange(8)).astype(np.int32)
with asammdf.MDF(version="4.10") as file:
    file.append([
        asammdf.Signal(torque, time, name="torque", unit="N.m", invalidation_bits=marks),
        asammdf.Signal(count, time, name="count", invalidation_bits=marks),
        asammdf.Signal(time, time, name="beside"),  # all of it valid
    ])
    file.save("log.mf4", overwrite=True)

file = asammdf.MDF("log.mf4")
read = file.get("torque")
print("asammdf", asammdf.__version__, "get:", read.samples.tolist(), "at", read.timestamps.tolist())
assert read.samples.tolist() == [0, 1, 1, 4, 4]

table = file.to_dataframe()
print("to_dataframe:", table["torque"].round(6).tolist(), table["count"].tolist())
assert np.allclose(table["torque"], [0, 1, 1, 2, 3, 4, 4, 4]) and not table.isna().any().any()
assert table["count"].tolist() == [0, 1, 2, 2, 2, 5, 6, 6]

file.export("csv", "log.csv")
rows = np.genfromtxt("log.ChannelGroup_0_Python.csv", delimiter=",", names=True)
print("CSV:", rows["torque"].round(6).tolist())
assert np.allclose(rows["torque"], table["torque"])

file.export("mat", "log.mat")
matlab = scipy.io.loadmat("log.mat")["DG0_torque"].ravel()
old = file.convert("3.30").get("torque").samples
other = mdfreader.Mdf("log.mf4").get_channel_data("torque")
print("MAT:", matlab.tolist(), "MDF 3.30:", old.tolist(), "mdfreader:", other.tolist())
assert all(np.array_equal(values, torque) for values in (matlab, old, other))
PYTHON
venv/bin/python run.py
echo "as described"
