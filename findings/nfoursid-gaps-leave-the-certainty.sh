#!/usr/bin/env bash
# Guess: Kalman.step(None, u) of nfoursid, for a sample that is missing, steps the model alone: the standard deviation in to_dataframe() grows
#   over a gap of the record, and the first sample behind it is trusted accordingly.
# What happens: the state is that of the model alone, and its covariance is updated as if the sample had come. Behind a gap of 1000 samples
#   the standard deviation is what it was before, 0.105, where it must be 0.333; and the gain is 0.095 where it must be 0.91, so that an
#   encoder which moved meanwhile is still 0.61 of the way behind after five samples. Nothing is said. A filter that predicts over the gap
#   is 0.02 of the way behind.
# Version: nfoursid 1.0.2, numpy 2.4.6, pandas 3.1.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q nfoursid==1.0.2 numpy==2.4.6 pandas==3.1.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
from nfoursid.kalman import Kalman
from nfoursid.state_space import StateSpace

print("nfoursid", version("nfoursid"))
DRIFT, NOISE = 1e-4, 1e-2  # variances of a step of the angle, and of its encoder
one, none = np.eye(1), np.zeros((1, 1))
steps = [0.0] * 300 + [None] * 1000 + [1.0] * 5


def by_hand():
    """Return deviations of the output after each step, and the estimates, of a filter that predicts over gaps."""
    x, variance, deviations, estimates = 0.0, 1.0, [], []
    for y in steps:
        gain = 0.0 if y is None else variance / (variance + NOISE)
        x += gain * ((y or 0.0) - x)
        variance *= 1.0 - gain
        deviations.append(float(np.sqrt(variance + NOISE)))
        estimates.append(x)
        variance += DRIFT
    return deviations, estimates


kalman = Kalman(StateSpace(one, none, one, none), np.diag([NOISE, DRIFT]))
for y in steps:
    kalman.step(None if y is None else np.array([[y]]), none)
frame = kalman.to_dataframe()
(column,) = (name for name in frame.columns if name[1:] == ("filtered", "standard deviation"))
deviation = frame[column].to_numpy()
estimate = [float(x[0, 0]) for x in kalman.x_filtereds]
true_deviation, true_estimate = by_hand()
print(f"before the gap: {deviation[299]:.4f}, by hand {true_deviation[299]:.4f}")
print(f"at its end: {deviation[1299]:.4f}, by hand {true_deviation[1299]:.4f}")
print("five samples behind it:", np.round(estimate[1300:], 3).tolist(), "by hand", np.round(true_estimate[1300:], 3).tolist())
assert abs(deviation[299] - true_deviation[299]) < 1e-9 and abs(estimate[299]) < 1e-12
assert deviation[1299] == deviation[299] and true_deviation[1299] > 0.33
assert estimate[-1] < 0.4 and true_estimate[-1] > 0.95
PYTHON
venv/bin/python run.py
echo "as described"
