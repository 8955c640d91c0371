#!/usr/bin/env bash
# Guess: where one of two sensors is masked in a row, filter() and loglikelihood() of pykalman use the other one.
# What happens: the whole row counts as missing, which docstrings say and no message does. With an encoder at the motor in each
#   row, and a better one in each tenth, nine of ten good samples are dropped: the second sensor makes the estimate 16 times
#   worse than the first one alone has it. The likelihood, to which em() fits, is that of the complete rows. filter_update with
#   the observation matrices of the sensors that are there uses all.
# Version: pykalman 0.11.2, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pykalman==0.11.2 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
from pykalman import KalmanFilter

rng = np.random.default_rng(1)
angle = np.cumsum(rng.normal(0.0, 0.1, 400))  # rad, a walk
seen = angle[:, None] + rng.normal(0.0, [0.01, 0.001], (400, 2))
each_tenth = np.ma.masked_array(seen, mask=False)
each_tenth[np.arange(400) % 10 != 0, 1] = np.ma.masked


def make(noises):
    return KalmanFilter(
        transition_matrices=[[1.0]],
        transition_covariance=[[0.01]],
        observation_matrices=np.ones((len(noises), 1)),
        observation_covariance=np.diag(noises),
        initial_state_mean=[0.0],
        initial_state_covariance=[[1.0]],
    )


def rms(means):
    return float(np.sqrt(np.mean((np.ravel(means) - angle) ** 2)))


one, both = make([1e-4]), make([1e-4, 1e-6])
alone = rms(one.filter(seen[:, :1])[0])
masked = rms(both.filter(each_tenth)[0])

rows = each_tenth.copy()
rows[np.arange(400) % 10 != 0] = np.ma.masked
print("pykalman", version("pykalman"))
assert np.array_equal(both.filter(rows)[0], both.filter(each_tenth)[0])
assert both.loglikelihood(rows) == both.loglikelihood(each_tenth)

mean, covariance, means = np.zeros(1), np.eye(1), []
for row in each_tenth:
    there = ~np.ma.getmaskarray(row)
    noises = np.diag(np.array([1e-4, 1e-6])[there])
    mean, covariance = one.filter_update(
        mean, covariance, row.data[there], observation_matrix=np.ones((len(noises), 1)), observation_covariance=noises
    )
    means.append(mean)
print(f"rms error: encoder alone {alone:.4f} rad, with the other one {masked:.4f} rad, row by row {rms(means):.4f} rad")
assert masked > 10.0 * alone and rms(means) < alone
PYTHON
venv/bin/python run.py
echo "as described"
