#!/usr/bin/env bash
# Guess: endaq.calc takes the sampling interval of a record from its usual step, so that a pause in the record leaves the frequencies of
#   psd.welch() where they are, or the record is refused.
# What happens: it is (last stamp - first stamp) / (rows - 1). One pause stretches every interval: a record of 2 s at 1 kHz with a
#   pause of 1 s has its peak of 50 Hz at 33 Hz, and one whose clock was set back by 1 s has it at 100 Hz. An angle
#   that is integrated from the speed is half as large again. No word is said of the pause.
# Version: endaq 1.5.3, pandas 3.1.1, numpy 2.3.5, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q endaq==1.5.3 pandas==3.1.1 numpy==2.3.5 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
import pandas as pd
from endaq.calc import integrate, psd, utils

TIMES = np.arange(2000) * 0.001
VALUES = 2.0 + np.sin(2 * np.pi * 50 * TIMES)


def record(jump):
    """Return the record whose second half is stamped later by jump [s]."""
    return pd.DataFrame({"speed": VALUES}, index=TIMES + np.where(np.arange(2000) < 1000, 0.0, jump))


def find_peak(frame):
    return float(psd.welch(frame, bin_width=1)["speed"].idxmax())


print("endaq", version("endaq"))
for jump, step, peak in ((0.0, 0.001, 50.0), (1.0, 0.0015, 33.0), (-1.0, 0.0005, 100.0)):
    found = utils.sample_spacing(record(jump)), find_peak(record(jump))
    print(f"jump {jump} s: interval {found[0]:.6f} s, peak {found[1]:.2f} Hz")
    assert abs(found[0] - step) < 1e-6 and abs(found[1] - peak) < 1.0
angles = [float(integrate.integrals(record(jump), n=1)[1]["speed"].iloc[-1]) for jump in (0.0, 1.0)]
print("angle after the record:", [round(angle, 2) for angle in angles], "rad")
assert abs(angles[0] - 4.0) < 0.01 and abs(angles[1] - 6.0) < 0.01
PYTHON
venv/bin/python run.py
echo "as described"
