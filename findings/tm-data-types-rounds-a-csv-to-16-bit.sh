#!/usr/bin/env bash
# Guess: tm_data_types (of the maker of the oscilloscopes) reads a waveform from CSV or MATLAB files with the numbers in the file.
# What happens: both readers scale the samples to integers of 16 bits between the smallest and largest value, and keep those. Zero comes
#   back as -2.9e-5 V of a range of 3.75 V; a ramp over 1000 rad comes back in steps of 0.015 rad, so that a speed taken from
#   it jumps. The file has nine digits. A .wfm of the same waveform keeps every digit. Nothing is said.
# Version: tm_data_types 0.5.0, numpy 1.26.4, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q tm_data_types==0.5.0 numpy==1.26.4

cat > run.py <<'PYTHON'
import warnings
from importlib.metadata import version

import numpy as np
import tm_data_types


def store(values, name):
    """Write volts at 1 ms as floats; return what is read back."""
    waveform = tm_data_types.AnalogWaveform()
    waveform.y_axis_values, waveform.x_axis_spacing = np.asarray(values, dtype=np.float32), 1e-3
    waveform.trigger_index = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tm_data_types.write_file(name, waveform)
        return tm_data_types.read_file(name)


print("tm_data_types", version("tm_data_types"))
for name in ("short.wfm", "short.csv", "short.mat"):
    found = store([0.0, 1.5, -2.25], name)
    print(name, found.y_axis_values.dtype, found.normalized_vertical_values.tolist())
    exact = np.array_equal(found.normalized_vertical_values, [0.0, 1.5, -2.25])
    assert exact == name.endswith(".wfm")
    assert (found.y_axis_values.dtype == np.int16) == (not exact)
print("in the CSV file:", [line.strip() for line in open("short.csv") if "00000e" in line])

ramp = np.linspace(0.0, 1000.0, 200_001)
steps = np.diff(store(ramp, "ramp.csv").normalized_vertical_values)
print(f"ramp of 5 rad/s: speeds from {1e3 * steps.min():.2f} to {1e3 * steps.max():.2f} rad/s")
assert steps.min() == 0.0 and 0.015 < steps.max() < 0.016
PYTHON
venv/bin/python run.py
echo "as described"
