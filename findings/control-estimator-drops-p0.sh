#!/usr/bin/env bash
# Guess: the estimator that create_estimator_iosystem(sys, QN, RN, P0) of python-control returns begins with the covariance P0,
#   or without one with that of the steady state, as its documentation says.
# What happens: P0 is checked for its shape and dropped. The covariance is part of the state that input_output_response()
#   begins with, and that is zero unless it is handed over there: the estimator is certain of its first state. With P0 = 100
#   and a constant measurement of 5 it is at 0.0094 after two samples; handed over as the initial state it is at 5.002. For a
#   discrete system the steady state that nobody uses is that of a continuous one with the same matrices.
# Version: control 0.10.2, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q control==0.10.2 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
import control
import numpy as np

system = control.ss([[1.0, 0.1], [0.0, 1.0]], [[0.005], [0.1]], [[1.0, 0.0]], 0, 0.1)
times = np.arange(30) * 0.1
signals = [np.full(30, 5.0), np.zeros(30)]
QN, RN = [[1.0]], [[0.04]]


def estimate(P0, *initial):
    estimator = control.create_estimator_iosystem(system, QN, RN, P0=P0)
    return control.input_output_response(estimator, times, signals, *initial).outputs[0]


runs = {name: estimate(P0) for name, P0 in (("none", None), ("1e-6", 1e-6 * np.eye(2)), ("100", 100.0 * np.eye(2)))}
for name, run in runs.items():
    print("control", control.__version__, f"P0 {name}:", run[:5].round(4).tolist())
assert all(np.array_equal(run, runs["none"]) for run in runs.values())
assert abs(runs["100"][2]) < 0.01

stated = estimate(None, [np.zeros(2), 100.0 * np.eye(2).ravel()])
print("as initial state:", stated[:5].round(4).tolist())
assert abs(stated[2] - 5.0) < 0.01

A, C = np.array(system.A), np.array(system.C)
gain, P, _ = control.dlqe(system, QN, RN)
begins = estimate(None, [np.zeros(2), P.ravel()])
print("from the steady state:", begins[:5].round(4).tolist())
assert abs(begins[1] - runs["none"][1]) > 1.0
PYTHON
venv/bin/python -W ignore run.py
echo "as described"
