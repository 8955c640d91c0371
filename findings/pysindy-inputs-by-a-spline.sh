#!/usr/bin/env bash
# Guess: a model of PySINDy that is simulated with an input given as an array holds each value for one sample, or goes straight
#   from one to the next. A torque that is either 0 or 1 N.m stays between them.
# What happens: simulate() lays a cubic spline through the values, which swings beyond them. x' = -x + u with u = 1, 0, 1, 0, ...
#   each 0.5 s ends its first sample at 0.0039; between straight lines it is 0.180, and held 0.393. For a relay or a random
#   binary signal, the usual input of an identification, a right model seems wrong. All that is said
#   is that the last sample is left out. interpolator_kws={"kind": "linear"} changes nothing unless `interpolator` comes with it.
# Version: pysindy 2.1.0, numpy 2.3.5, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pysindy==2.1.0 numpy==2.3.5 scipy==1.17.1

cat > run.py <<'PYTHON'
import importlib.metadata

import numpy as np
import pysindy
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline, interp1d


def solve(source, times):
    return solve_ivp(lambda t, x: -x + source(t), times[[0, -1]], [0.0], t_eval=times, rtol=1e-9, atol=1e-11, max_step=0.05).y[0]


fine = np.arange(0.0, 10.0, 0.01)
motion = solve(lambda t: np.sin(3 * t), fine)
model = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(1))
model.fit(motion[:, None], t=0.01, u=np.sin(3 * fine)[:, None])
offset, rate, gain = model.coefficients()[0]
print("pysindy", importlib.metadata.version("pysindy"), f"x' = {offset:.4f} + {rate:.4f} x + {gain:.4f} u")
assert abs(rate + 1) < 2e-3 and abs(gain - 1) < 2e-3

times = np.arange(11) * 0.5
torque = (np.arange(11)[:, None] % 2 == 0).astype(float)
run = model.simulate([0.0], times, u=torque).ravel()
asked = model.simulate([0.0], times, u=torque, interpolator_kws={"kind": "linear"}).ravel()
both = model.simulate([0.0], times, u=torque, interpolator=interp1d, interpolator_kws={"axis": 0, "fill_value": "extrapolate"}).ravel()
spline = CubicSpline(times, torque.ravel())
straight = solve(lambda t: np.interp(t, times, torque.ravel()), times)
bent = solve(spline, times)
inside = spline(np.linspace(0.0, 5.0, 501))
print("simulated:", run[:4].round(4), "a spline:", bent[:4].round(4), "straight lines:", straight[:4].round(4))
print("the spline goes from", round(float(inside.min()), 2), "to", round(float(inside.max()), 2))
assert np.allclose(run, bent[: run.size], atol=3e-3) and run.size == 10
assert np.array_equal(asked, run) and np.allclose(both, straight[: run.size], atol=3e-3)
assert straight[1] > 0.17 and run[1] < 0.02
assert inside.min() < -0.2
PYTHON
venv/bin/python -W ignore run.py
echo "as described"
