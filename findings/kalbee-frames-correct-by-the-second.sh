#!/usr/bin/env bash
# Guess: `dt` of kalbee's filter_dataframe() and filter_series(), "time step for filter predict", is the step of the filter: an alpha-beta-gamma
#   filter that is handed the angle of an axis each millisecond finds its speed per second. Samples that are NaN are missing for both.
# What happens: the prediction gets `dt`, and the correction does not: it takes 1 s. The speed is corrected by a thousandth of what
#   it should be, so that at 10 rad/s it is 1.8 rad/s after 1 s and 3.3 after 2 s, while the angle looks right. Calls of predict() and
#   update() with dt find 10 at once. KalmanFilter takes `dt` and does not use it. After one NaN all that filter_series() returns is NaN,
#   where filter_dataframe() predicts. Nothing is said.
# Version: kalbee 1.0.0, numpy 2.4.6, pandas 3.1.1, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q kalbee==1.0.0 numpy==2.4.6 pandas==3.1.1 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
import pandas as pd
from kalbee import AlphaBetaGammaFilter, KalmanFilter, filter_dataframe, filter_series

print("kalbee", version("kalbee"))
STEP = 0.001
angle = 10.0 * STEP * np.arange(2000)
frame = pd.DataFrame({"angle": angle})


def alpha_beta():
    return AlphaBetaGammaFilter(np.zeros((3, 1)), alpha=0.5, beta=0.1, gamma=0.0)


def kalman():
    transition = np.array([[1.0, STEP], [0.0, 1.0]])
    noise = np.diag([1e-8, 1e-3])
    return KalmanFilter(np.zeros((2, 1)), 100.0 * np.eye(2), transition, noise, np.array([[1.0, 0.0]]), np.array([[1e-4]]))


by_hand = alpha_beta()
for sample in angle:
    by_hand.predict(dt=STEP)
    by_hand.update(np.array([[sample]]), dt=STEP)
found = filter_dataframe(frame, alpha_beta(), ["angle"], dt=STEP)
speed = found["state_1"].to_numpy()
print(f"alpha-beta: {speed[1000]:.3f} rad/s after 1 s, {speed[-1]:.3f} after 2 s; by hand {by_hand.state[1, 0]:.3f}")
assert abs(by_hand.state[1, 0] - 10.0) < 1e-3
assert speed[1000] < 2.0 and speed[-1] < 3.5 and abs(found["state_0"].iloc[-1] - angle[-1]) < 0.02

same = [filter_dataframe(frame, kalman(), ["angle"], dt=dt)["state_1"].iloc[-1] for dt in (STEP, 0.5)]
print("KalmanFilter with dt of 1 ms and of 0.5 s:", same)
assert same[0] == same[1]

holed = frame.copy()
holed.loc[500, "angle"] = np.nan
series = filter_series(holed["angle"], kalman(), dt=STEP).to_numpy()
table = filter_dataframe(holed, kalman(), ["angle"], dt=STEP)["state_0"].to_numpy()
print(f"after one NaN: {np.isnan(series).sum()} of {series.size} are NaN by filter_series, {np.isnan(table).sum()} by filter_dataframe")
assert np.isfinite(series[:500]).all() and np.isnan(series[500:]).all() and np.isfinite(table).all()
PYTHON
venv/bin/python run.py
echo "as described"
