#!/usr/bin/env bash
# Guess: PID_S of bdsim, "discrete-time PID control", computes its output at the ticks of its clock and holds it until the next one; so does
#   DERIV_S: the speed of a ramp of 2 rad/s is 2 from the second tick on.
# What happens: only the integral part is held. P and D follow the input between the ticks, and D takes the difference to the sample at
#   the last tick over a whole period: for the ramp it grows from 0 to 2 in each period, 1 on average, so that the angle that
#   is summed from it is half. A loop around an integrator with P = 30 1/s and a period of 0.1 s, which diverges on any real controller
#   (P T > 2), settles in the simulation. Nothing is said. A ZOH with the same clock before the block makes both right.
# Version: bdsim 1.4.0, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q bdsim==1.4.0 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import bdsim
import numpy as np

print("bdsim", version("bdsim"))
simulator = bdsim.BDSim(graphics=False, banner=False, progress=False)


def run(diagram, blocks, duration):
    """Run a diagram; return times and the outputs of blocks, a column each."""
    sink = diagram.NULL(len(blocks))
    for place, block in enumerate(blocks):
        diagram.connect(block, sink[place])
    diagram.compile()
    result = simulator.run(diagram, T=duration, dt=0.01, watch=blocks)
    return result.t, result.y


def differentiate(held):
    """Return the speed of a ramp of 2 rad/s by DERIV_S, and its integral."""
    diagram = simulator.blockdiagram()
    clock = diagram.clock(0.1, unit="s")
    ramp, speed, angle = diagram.FUNCTION(lambda t: 2.0 * t), diagram.DERIV_S(clock), diagram.INTEGRATOR()
    diagram.connect(diagram.TIME(), ramp)
    if held:
        hold = diagram.ZOH(clock)
        diagram.connect(ramp, hold)
        diagram.connect(hold, speed)
    else:
        diagram.connect(ramp, speed)
    diagram.connect(speed, angle)
    return run(diagram, [speed, angle], 1.05)


def close_loop(held):
    """Return the output of an integrator that a PID_S with P = 30 1/s and little else brings to 1."""
    diagram = simulator.blockdiagram()
    clock = diagram.clock(0.1, unit="s")
    law, plant = diagram.PID_S(clock, P=30.0, I=1e-6), diagram.INTEGRATOR()
    measured = plant
    if held:
        measured = diagram.ZOH(clock)
        diagram.connect(plant, measured)
    diagram.connect(measured, law[0])
    diagram.connect(diagram.CONSTANT(1.0), law[1])
    diagram.connect(law, plant)
    return run(diagram, [plant], 1.05)


time, (speed, angle) = (lambda t, y: (t, y.T))(*differentiate(held=False))
between = (time > 0.5001) & (time < 0.5999)
print("DERIV_S of a ramp of 2 rad/s from 0.5 to 0.6 s:", np.round(speed[between], 2).tolist())
print(f"its integral after {time[-1]:.2f} s: {angle[-1]:.3f} rad of {2.0 * time[-1]:.3f}")
assert np.allclose(speed[between], 20.0 * (time[between] - 0.5), atol=1e-6)
assert angle[-1] < 0.51 * 2.0 * time[-1]
time, y = differentiate(held=True)
assert np.allclose(y[time > 0.21, 0], 2.0)

settled, diverged = close_loop(held=False)[1][:, 0], close_loop(held=True)[1][:, 0]
print(f"loop with P T = 3 after 1.05 s: {settled[-1]:.6f}; with a ZOH before PID_S {diverged[-1]:.3g}")
assert abs(settled[-1] - 1.0) < 1e-4 and settled.max() < 1.001
assert np.abs(diverged).max() > 100.0
PYTHON
venv/bin/python run.py | grep -v "^package\|^$\|^ \|^>>>\|^<<<\|: *$\|ndarray\|(list)\|::"
echo "as described"
