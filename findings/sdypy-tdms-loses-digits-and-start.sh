#!/usr/bin/env bash
# Guess: write_tdms() of sdypy-io-tdms writes the samples, the unit, the step and the start time of a signal, and read_tdms() gives
#   them back. A channel of another writer keeps its name.
# What happens: samples are written in single precision: an angle of 12345 rad that grows by 0.1 mrad a sample comes back in steps of 0
#   and 0.98 mrad, so that its speed is 0 or ten times too high. The start time is nowhere in the file but as text without its hour,
#   "2026/11/29 H:20:00". read_tdms() cuts names at a slash: of "speed [rad/s]" there remains "speed [r", and "acc/x" and "acc/y"
#   are both "a". Nothing is said.
# Version: sdypy-io-tdms 0.1.2, npTDMS 1.13.0, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q sdypy-io-tdms==0.1.2 npTDMS==1.13.0 numpy==2.4.6

cat > run.py <<'PYTHON'
from datetime import datetime
from importlib.metadata import version

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from sdypy_io_tdms import tdms

print("sdypy-io-tdms", version("sdypy-io-tdms"), "npTDMS", version("npTDMS"))
angle = 12345.0 + 1e-4 * np.arange(1000)
signal = {"group": "drive", "name": "angle", "data": angle, "fs": 1000.0, "unit_str": "rad"}
tdms.write_tdms({**signal, "start_timestamp": datetime(2026, 11, 29, 10, 20)}, "own.tdms")
(found,) = tdms.read_tdms("own.tdms")
steps = np.unique(np.diff(found["data"]))
print(f"steps of the angle: {steps} rad, speeds {1000 * steps} rad/s in place of 0.1")
assert found["data"].dtype == np.float32 and found["unit_str"] == "rad" and found["fs"] == 1000.0
assert steps[0] == 0 and np.allclose(steps[1:], 2**-10)
file = TdmsFile.read("own.tdms")
print("start:", found.get("start_timestamp"), "in the file:", file.properties["datestring"], dict(file["drive"]["angle"].properties))
assert "start_timestamp" not in found and file.properties["datestring"] == "2026/11/29 H:20:00"
assert set(file["drive"]["angle"].properties) == {"unit_string", "wf_increment"}

names = ["speed [rad/s]", "acc/x", "acc/y", "torque"]
with TdmsWriter("other.tdms") as writer:
    writer.write_segment([ChannelObject("drive", name, np.zeros(3), properties={"wf_increment": 0.001}) for name in names])
assert [channel.name for channel in TdmsFile.read("other.tdms")["drive"].channels()] == names
cut = [signal["name"] for signal in tdms.read_tdms("other.tdms")]
print(names, "are read as", cut)
assert cut == ["speed [r", "a", "a", "torque"]
PYTHON
venv/bin/python run.py
echo "as described"
