#!/usr/bin/env bash
# Guess: mstraj(via, dt, tacc, qdmax) of Robotics Toolbox for Python keeps each axis at or below its `qdmax`; an acceleration time makes
#   the start and the stop slower.
# What happens: the blend from standstill, and the one into it, cover in tacc / 2 the way that the full speed covers in that time, so
#   that in between the speed must be higher: 1.5 times the limit, at each start and stop, whatever `tacc` is. With tacc = 0, the
#   default, it is kept. The acceleration there is 3.9 times the speed over the time of the blend. The attribute qd shows it; nothing is said.
# Version: roboticstoolbox-python 1.5.0, numpy 2, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q roboticstoolbox-python==1.5.0

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
import roboticstoolbox as rtb

STEP, LIMIT = 0.001, 1.0
print("roboticstoolbox-python", version("roboticstoolbox-python"))
for blend in (0.0, 0.1, 0.2, 0.5):
    found = rtb.mstraj(np.array([[0.0], [10.0]]), dt=STEP, tacc=blend, qdmax=LIMIT)
    speed = np.diff(found.q[:, 0]) / STEP
    highest, middle = float(speed.max()), float(speed[len(speed) // 2])
    above = STEP * float(np.sum(speed > 1.001 * LIMIT))
    print(f"tacc {blend}: {highest:.3f} rad/s at most, {middle:.3f} halfway, above the limit for {above:.3f} s")
    assert abs(found.q[0, 0]) < 2e-3 and np.isclose(found.q[-1, 0], 10.0)
    if blend:
        largest = float(np.abs(found.qdd).max())
        print(f"   acceleration {largest:.1f} rad/s2 at most")
        assert 1.47 < highest < 1.51 and abs(found.qd.max() - highest) < 2e-3 and middle < LIMIT and above > blend / 2
        assert 3.8 < largest * (blend / 2) / LIMIT < 4.0
    else:
        assert highest < 1.001 * LIMIT
PYTHON
venv/bin/python run.py
echo "as described"
