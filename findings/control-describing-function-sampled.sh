#!/usr/bin/env bash
# Guess: describing_function_response() of python-control takes a sampled loop as it takes a continuous one, and returns
#   amplitude and frequency [rad/s] of its cycle; `refine`, which is on, makes them more exact.
# What happens: the amplitude is right, and the "frequency" is the imaginary part of a point of the unit circle, sin(omega dt):
#   0.18 in place of 0.91 rad/s for a step of 0.2 s. The refinement evaluates the loop at z = j omega, where no frequency
#   is; with a step of 0.5 s it moves to a negative one without a warning. The phase crossover of margin(), the same
#   point without the nonlinearity, is in rad/s.
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

AMPLITUDES = np.linspace(1.01, 20.0, 300)
plant = control.tf([10.0], [1.0, 2.0, 1.0, 0.0])
limit = control.saturation_nonlinearity(1.0)


def cycle(loop, highest, refine):
    """Amplitude and frequency of the one cycle of a loop with saturation."""
    frequencies = np.logspace(-1.0, np.log10(highest), 600)
    response = control.describing_function_response(loop, limit, AMPLITUDES, frequencies, refine=refine)
    (found,) = response.intersections
    return tuple(float(value) for value in found)


def simulated(step):
    """Frequency [rad/s] of the cycle that the sampled loop runs into."""
    loop = control.c2d(control.ss(plant), step)
    x, outputs = np.array([[0.3], [0.0], [0.0]]), []
    for _ in range(40_000):
        outputs.append((loop.C @ x).item())
        x = loop.A @ x - loop.B * np.clip(outputs[-1], -1.0, 1.0)
    tail = np.array(outputs[-8000:])
    up = np.flatnonzero((tail[1:] >= 0.0) & (tail[:-1] < 0.0))
    return 2.0 * np.pi * (up.size - 1) / ((up[-1] - up[0]) * step)


print("control", control.__version__, "continuous:", cycle(plant, 10.0, True))
assert np.isclose(cycle(plant, 10.0, True)[1], 1.0, atol=1e-3)
for step in (0.2, 0.5):
    loop = control.c2d(plant, step)
    crossover = float(control.margin(loop)[2])
    rough, fine = (cycle(loop, 0.9 * np.pi / step, refine) for refine in (False, True))
    print(f"step {step}: rough {rough}, refined {fine}; margin() {crossover:.4f}, simulated {simulated(step):.4f} rad/s")
    assert np.isclose(rough[1], np.sin(crossover * step), rtol=1e-3)
    assert np.isclose(simulated(step), crossover, rtol=0.05)
assert fine[1] < 0.0
PYTHON
venv/bin/python -W ignore run.py
echo "as described"
