#!/usr/bin/env bash
# Guess: harold and python-control, handed the same system, frequency and input, return the same response and the same discrete
#   system: angular frequencies, and inputs that go straight from sample to sample.
# What happens: harold's frequencies are in Hz: frequency_response(1/(s+1), w=1) is that of 6.28 rad/s, and prewarp_at=3 warps
#   about 3 Hz where prewarp_frequency=3 of python-control means 3 rad/s. simulate_linear_system holds the input for one sample,
#   where python-control and SciPy go straight to the next: a step comes half a sample later. All agree about step responses
#   and about `tustin` without prewarping, where one would look first.
# Version: harold 1.0.3, control 0.10.2, numpy 2.3.5, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q harold==1.0.3 control==0.10.2 numpy==2.3.5 scipy==1.17.1

cat > run.py <<'PYTHON'
import importlib.metadata

import control
import harold
import numpy as np
import scipy.signal

ours, peer = harold.Transfer([1], [1, 1]), control.tf([1], [1, 1])
print("harold", importlib.metadata.version("harold"), "control", control.__version__)

one = complex(harold.frequency_response(ours, w=np.array([1.0]))[0][0])
print("at w=1:", one, "control:", complex(peer(1j)))
assert np.isclose(peer(1j), 1 / (1 + 1j)) and np.isclose(one, 1 / (1 + 2j * np.pi))

num, den = [1.0], [1.0, 1.0, 100.0]


def tustin(**options):
    return harold.discretize(harold.Transfer(num, den), 0.1, "tustin", **options).den.ravel()


plain = control.sample_system(control.tf(num, den), 0.1, "tustin").den[0][0]
warped = control.sample_system(control.tf(num, den), 0.1, "tustin", prewarp_frequency=3.0).den[0][0]
print("prewarped at 3:", tustin(prewarp_at=3.0).round(4), "control:", warped.round(4))
assert np.allclose(tustin(), plain) and np.allclose(tustin(prewarp_at=3.0 / (2 * np.pi)), warped)
assert not np.allclose(tustin(prewarp_at=3.0), warped, atol=0.1)

times = np.arange(11) * 0.1
step = (times >= 0.3).astype(float)
held = harold.simulate_linear_system(ours, step, times)[0].ravel()
straight = control.forced_response(peer, times, step).outputs
print("input from 0.3 s on:", held[3:6].round(4), "control:", straight[3:6].round(4))
assert np.allclose(held[3:], 1 - np.exp(-(times[3:] - 0.3)))
assert np.allclose(straight, scipy.signal.lsim(([1], [1, 1]), step, times)[1]) and straight[3] > 0.04
assert np.allclose(harold.simulate_step_response(ours, times)[0].ravel(), control.step_response(peer, times).outputs)
PYTHON
venv/bin/python -W ignore run.py
echo "as described"
