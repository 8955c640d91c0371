#!/usr/bin/env bash
# Guess: frd(..., smooth=True) of python-control goes from point to point by magnitude and phase, which 10 points a decade make
#   right to a few per cent away from a resonance, and refuses frequencies outside its data, as it does without `smooth`.
# What happens: real and imaginary part are cubic splines over the frequency itself. A peak makes them swing several points
#   away: a shaft with a resonance at 100 rad/s has seven times its gain at 300 rad/s, between two points that are right;
#   straight lines of magnitude and phase over the logarithm are right to a few per cent there. Beyond the data the last
#   cubic goes on: a lag that is known to 10 rad/s has the gain 109 at 100 rad/s in place of 0.01. Nothing is said.
# Version: control 0.10.2, scipy 1.17.1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q control==0.10.2 scipy==1.17.1 numpy==2.4.6

cat > run.py <<'PYTHON'
import control
import numpy as np

print("control", control.__version__)

# Torque to angle, with a lightly damped resonance: ten points a decade.
known = np.logspace(0.0, 3.0, 31)
shaft = control.tf([1e4], [1.0, 2.0, 1e4]) * control.tf([1.0], [1.0, 0.0])
measured = control.frd(shaft, known, smooth=True)
assert np.allclose(measured(1j * known), shaft(1j * known), rtol=1e-6)
between = 300.0
straight = np.exp(np.interp(np.log(between), np.log(known), np.log(abs(shaft(1j * known)))))
ratio = abs(measured(1j * between)) / abs(shaft(1j * between))
by_lines = straight / abs(shaft(1j * between))
print(f"at {between:g} rad/s, between two points: {ratio:.3g} times the gain; by straight lines {by_lines:.3g} times")
assert 5.0 < ratio < 10.0
assert 0.95 < by_lines < 1.05

# A lag that is known up to 10 rad/s.
known = np.logspace(-1.0, 1.0, 50)
lag = control.tf([1.0], [1.0, 1.0])
measured = control.frd(lag, known, smooth=True)
gain = abs(measured(100j))
print(f"at 100 rad/s, ten times the last frequency: gain {gain:.3g}, true {abs(lag(100j)):.3g}")
assert gain > 50.0
try:
    control.frd(lag, known)(100j)
except ValueError as error:
    print("without smooth:", error)
else:
    raise SystemExit("no refusal")
PYTHON
venv/bin/python run.py
