#!/usr/bin/env bash
# Guess: derivative.dxdt(x, t, kind="finite_difference", k=1) takes the stamps `t` for what they are: exact for a parabola inside, first
#   order at the ends.
# What happens: the distance of the first two stamps is taken for all rows. A log whose first period was twice as long gives half of every
#   speed, to the last row; one lost row gives 1.5 times the speed beside it. The signature asks for `t`, the description of
#   the method says equally spaced data, and nothing is checked. "spline" and "savitzky_golay" of the same function use the stamps.
# Version: derivative 0.6.3, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q derivative==0.6.3 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
from derivative import dxdt

print("derivative", version("derivative"))
even = 0.001 * np.arange(1000)
for name, times in {
    "even stamps": even,
    "first period of 2 ms": np.concatenate(([-0.001], even[1:])),
    "one row lost": np.delete(even, 500),
}.items():
    speed = dxdt(10.0 * times, times, kind="finite_difference", k=1)
    spline = dxdt(10.0 * times, times, kind="spline", s=1e-9)
    fitted = dxdt(10.0 * times, times, kind="savitzky_golay", left=0.005, right=0.005, order=2)
    middle = np.median(speed)
    print(f"{name}: speed {middle:.3f} rad/s, largest {speed.max():.3f} (10 is right)")
    assert np.allclose(middle, 5.0 if "first" in name else 10.0)
    assert np.allclose(speed.max(), {"even stamps": 10.0, "one row lost": 15.0}.get(name, 10.0))
    assert np.allclose(spline, 10.0) and np.allclose(fitted[10:-10], 10.0)
PYTHON
venv/bin/python run.py
echo "as described"
