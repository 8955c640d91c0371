#!/usr/bin/env bash
# Guess: InformationFilter of FilterPy, which has the estimates of KalmanFilter to rounding, has its log-likelihood too.
# What happens: what it calls S, and takes the likelihood from, is the information of the state after the sample, a matrix of the size of the
#   state: the inverse of what belongs there, of another size and in other units. One residual counts for every state. A better model of the
#   noise gets a lower likelihood: for a record with R = 0.04 KalmanFilter finds 0.04 among candidates from 0.0025 to 0.64, and
#   InformationFilter finds 0.64, the largest. In `S` and `log_likelihood` alone it is wrong, and nothing is said.
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
from filterpy.kalman import InformationFilter, KalmanFilter

STEP, TRUE = 0.1, 0.04
F = np.array([[1.0, STEP], [0.0, 1.0]])
Q = 0.1 * np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]])
CANDIDATES = (0.0025, 0.01, 0.04, 0.16, 0.64)


def run(kind, measured, variance):
    """Estimates, sum of the log-likelihoods and the last S of a record."""
    estimator = kind(dim_x=2, dim_z=1)
    estimator.x, estimator.F, estimator.H, estimator.Q = np.zeros((2, 1)), F, np.array([[1.0, 0.0]]), Q
    if kind is InformationFilter:
        estimator.P_inv, estimator.R_inv = np.eye(2), np.array([[1 / variance]])
    else:
        estimator.P, estimator.R = np.eye(2), np.array([[variance]])
    states, total = [], 0.0
    for value in measured:
        estimator.predict()
        estimator.update(np.array([[value]]))
        states.append(estimator.x.ravel())
        total += float(estimator.log_likelihood)
    return np.array(states), total, estimator.S


print("filterpy", filterpy.__version__)
generator = np.random.default_rng(2)
root, truth = np.linalg.cholesky(Q), [np.zeros(2)]
for _ in range(999):
    truth.append(F @ truth[-1] + root @ generator.normal(size=2))
measured = np.array(truth)[:, 0] + np.sqrt(TRUE) * generator.normal(size=1000)
likelihood = {}
for variance in CANDIDATES:
    states, likelihood[KalmanFilter, variance], right = run(KalmanFilter, measured, variance)
    same, likelihood[InformationFilter, variance], other = run(InformationFilter, measured, variance)
    assert np.allclose(states, same, atol=1e-9) and right.shape == (1, 1) and other.shape == (2, 2)
    print(f"R = {variance}: KalmanFilter {likelihood[KalmanFilter, variance]:.1f}, InformationFilter {likelihood[InformationFilter, variance]:.1f}")
best = {kind: max(CANDIDATES, key=lambda variance: likelihood[kind, variance]) for kind in (KalmanFilter, InformationFilter)}
print("largest at", best[KalmanFilter], "and", best[InformationFilter])
assert best == {KalmanFilter: 0.04, InformationFilter: 0.64}
PYTHON
venv/bin/python run.py
echo "as described"
