#!/usr/bin/env bash
# Guess: era() of python-control gives back the discrete system whose impulse_response() it is handed; and the impulse response
#   of a discrete system is the same numbers in python-control and SciPy.
# What happens: python-control's discrete impulse is 1/dt high, SciPy's is 1. era() takes the numbers for those of a unit
#   impulse unless it is told `dt`, though the response that it is handed has its times: with dt = 0.1 s the gain is 20 in
#   place of 2, and the system has no step. With `dt` it is right for a response of python-control, and a response of
#   SciPy gives a gain of 0.2. Poles are right every time, so nothing looks wrong.
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
import scipy.signal

STEP = 0.1
system = control.ss([[0.5]], [[1.0]], [[1.0]], 0, STEP)
response = control.impulse_response(system, np.arange(20) * STEP)
peer = scipy.signal.dimpulse(([1.0], [1.0, -0.5], STEP), n=20)[1][0].ravel()
print("control", control.__version__, response.outputs[:4].tolist(), "SciPy:", peer[:4].tolist())
assert np.allclose(response.outputs, peer / STEP)

found = {
    "as it is": control.era(response, 1)[0],
    "with dt": control.era(response, 1, dt=STEP)[0],
    "SciPy's, with dt": control.era(peer, 1, dt=STEP)[0],
    "SciPy's": control.era(peer, 1)[0],
}
gains = {name: float(one.dcgain()) for name, one in found.items()}
print("true gain:", float(system.dcgain()), {name: round(gain, 6) for name, gain in gains.items()})
assert all(np.allclose(one.poles(), 0.5) for one in found.values())
assert found["as it is"].dt is True
assert np.allclose(list(gains.values()), [20.0, 2.0, 0.2, 2.0])
PYTHON
venv/bin/python -W ignore run.py
echo "as described"
