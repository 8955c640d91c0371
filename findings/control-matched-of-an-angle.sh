#!/usr/bin/env bash
# Guess: sample_system(..., method="matched") of python-control, which is for transfer functions, takes the one from a motor's
#   torque to its angle, as `zoh`, `tustin` and the rest do; where the gain at zero frequency is infinite, another
#   frequency serves to match it, or the method is refused.
# What happens: the gain is matched at zero frequency alone, and for an integrator or a differentiator it is 0/0: a discrete
#   transfer function comes back, poles and zeros right, whose gain is nan. A RuntimeWarning of NumPy about a division is
#   all that is said, and it is said once; every response of the system is nan.
# Version: control 0.10.2, scipy 1.17.1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q control==0.10.2 scipy==1.17.1 numpy==2.4.6

cat > run.py <<'PYTHON'
import warnings

import control
import numpy as np

print("control", control.__version__)
warnings.simplefilter("ignore", RuntimeWarning)
step, omega = 0.01, 1.0
point = np.exp(1j * omega * step)
plants = {
    "torque to speed": control.tf([1.0], [0.4, 0.1]),
    "torque to angle": control.tf([1.0], [0.4, 0.1, 0.0]),
    "torque to acceleration": control.tf([1.0, 0.0], [0.4, 0.1]),
}
for title, plant in plants.items():
    errors = {}
    for method in ("zoh", "tustin", "matched"):
        sampled = control.sample_system(plant, step, method=method)
        errors[method] = abs(sampled(point)) / abs(plant(1j * omega)) - 1.0
        assert np.isfinite(sampled.den[0][0]).all() and sampled.dt == step
    print(title, {method: f"{100.0 * error:.3g} %" for method, error in errors.items()})
    assert abs(errors["zoh"]) < 0.01 and abs(errors["tustin"]) < 0.01
    assert np.isnan(errors["matched"]) == (title != "torque to speed")
PYTHON
venv/bin/python run.py
