#!/usr/bin/env bash
# Guess: a channel of an MDF file that holds counts with a scale, and a text for one count (65535 is "not available"), is
#   scaled alike by all readers, and keeps its values when the file is converted to version 3.
# What happens: asammdf reads it right, with the text as NaN. mdfreader takes the limits of the range for the scale: 0.1 N.m
#   a count becomes 60000 N.m a count, as texts. convert("3.30") of asammdf leaves empty texts in place of the values, and
#   turns a table from ranges to values into one that is interpolated between the ranges: 10, -1, 20, -1 become 10, 12.5,
#   17.5, 20. Nothing is said.
# Version: asammdf 8.8.28, mdfreader 4.3, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28 mdfreader==4.3

cat > run.py <<'PYTHON'
import asammdf
import mdfreader
import numpy as np
from asammdf.blocks.conversion_utils import from_dict

scale = from_dict({"a": 0.1, "b": 0.0})
with_text = from_dict(
    {"lower_0": 0, "upper_0": 60000, "text_0": scale, "lower_1": 65535, "upper_1": 65535, "text_1": b"not available"}
)
gears = from_dict({"lower_0": 0.0, "upper_0": 2.0, "phys_0": 10.0, "lower_1": 4.0, "upper_1": 6.0, "phys_1": 20.0, "default": -1.0})
time = np.arange(4) * 0.1
with asammdf.MDF(version="4.10") as file:
    counts = np.array([10, 20, 65535, 40], dtype=np.uint16)
    file.append([asammdf.Signal(counts, time, name="torque", unit="N.m", conversion=with_text)])
    file.append([asammdf.Signal(np.array([1.0, 3.0, 5.0, 9.0]), time, name="gear", conversion=gears)])
    file.save("log.mf4", overwrite=True)

file = asammdf.MDF("log.mf4")
torque, gear = file.get("torque").samples, file.get("gear").samples
print("asammdf", asammdf.__version__, torque.tolist(), gear.tolist())
assert np.allclose(torque, [1.0, 2.0, np.nan, 4.0], equal_nan=True) and gear.tolist() == [10, -1, 20, -1]

other = mdfreader.Mdf("log.mf4").get_channel_data("torque")
print("mdfreader:", other.tolist())
assert [float(other[k]) for k in (0, 1, 3)] == [10 * 60000.0, 20 * 60000.0, 40 * 60000.0]

file.convert("3.30").save("log.mdf", overwrite=True)
old = asammdf.MDF("log.mdf")
torque, gear = old.get("torque").samples, old.get("gear").samples
print("MDF 3.30:", torque.tolist(), gear.tolist())
assert torque.tolist() == [b"", b"", b"not available", b""]
assert np.allclose(gear, [10, 12.5, 17.5, 20])
PYTHON
venv/bin/python run.py
echo "as described"
