#!/usr/bin/env bash
# Guess: update(None), FilterPy's way for a sample that is missing, adds nothing to the likelihood of the record.
# What happens: log_likelihood is then that of a measurement that met its prediction exactly, with the covariance of the last
#   innovation. The sum over a record grows with each sample that is lost, most where the noise is assumed to be small. With
#   half of the samples missing, the likelihood is largest at the smallest noise that is tried, a hundredth of the true
#   variance; leaving the missing steps out of the sum gives the true one.
# Version: filterpy 2.0.0, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
import filterpy
import numpy as np
from filterpy.kalman import KalmanFilter

TRUE_VARIANCE = 0.04
rng = np.random.default_rng(0)
speed, values = 0.0, []
for k in range(2000):
    speed = 0.95 * speed + rng.normal(0.0, 0.05)
    values.append(None if rng.random() < 0.5 else speed + rng.normal(0.0, TRUE_VARIANCE**0.5))


def likelihoods(variance):
    """Sum over all steps, and over those with a measurement."""
    kalman = KalmanFilter(dim_x=1, dim_z=1)
    kalman.F, kalman.H, kalman.Q, kalman.R, kalman.P = (np.array([[v]]) for v in (0.95, 1.0, 0.0025, variance, 0.03))
    everything, measured = 0.0, 0.0
    for value in values:
        kalman.predict()
        kalman.update(value)
        everything += kalman.log_likelihood
        measured += 0.0 if value is None else kalman.log_likelihood
    return everything, measured


kalman = KalmanFilter(dim_x=1, dim_z=1)
kalman.predict()
kalman.update(0.3)
kalman.predict()
kalman.update(None)
print("filterpy", filterpy.__version__, "log-likelihood of a missing sample:", kalman.log_likelihood)
assert abs(kalman.log_likelihood + 0.5 * np.log(2 * np.pi * kalman.S[0, 0])) < 1e-12

variances = np.geomspace(0.0004, 0.08, 24)
sums = np.array([likelihoods(v) for v in variances])
found, found_measured = (float(variances[k]) for k in sums.argmax(axis=0))
print(f"variance: true {TRUE_VARIANCE}, by all steps {found:.4f}, by steps with a measurement {found_measured:.4f}")
assert found == variances[0]
assert 0.9 * TRUE_VARIANCE < found_measured < 1.1 * TRUE_VARIANCE
PYTHON
venv/bin/python run.py
echo "as described"
