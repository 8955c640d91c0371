#!/usr/bin/env bash
# Guess: Backlash(width=0.1) of PathSim is a gap of 0.1: an input that moves on in one direction is followed by half of it later,
#   0.05, at any speed, and behind a reversal the output rests for 0.1.
# What happens: beyond the gap the output is a lag of first order, so to the half-width comes speed / f_max, with f_max in rad/s
#   and 100 by default. At 10 rad/s the output is 0.15 behind, as if the gap were three times as wide; who reads the
#   width from the two angles finds 0.12 at 1 rad/s and 0.3 at 10 rad/s. At the reversal the output moves on for another
#   while, the wrong way. A large f_max makes it right, and asks for a step below 2 / f_max.
# Version: pathsim 0.27.1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pathsim==0.27.1 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import Backlash, Scope, Source

print("pathsim", version("pathsim"))


def run(speed, **words):
    """The input goes up at a speed for 1 s and comes back; return times, the input and the output."""
    source = Source(lambda t: speed * min(t, 2.0 - t))
    gap, scope = Backlash(width=0.1, **words), Scope()
    connections = [Connection(source, gap, scope[0]), Connection(gap, scope[1])]
    simulation = Simulation([source, gap, scope], connections, dt=2e-4, log=False)
    simulation.run(2.0)
    times, (put_in, got) = scope.read()
    return times, put_in, got


for speed, words, expected in [(1.0, {}, 0.06), (10.0, {}, 0.15), (10.0, {"f_max": 1000.0}, 0.06)]:
    times, put_in, got = run(speed, **words)
    up, down = np.searchsorted(times, [0.9, 1.9])
    behind = put_in[up] - got[up]
    width = behind - (put_in[down] - got[down])
    print(f"width 0.1, {speed:4.0f} rad/s, {words or 'f_max by default'}: {behind:.3f} behind, width by both {width:.3f}")
    assert abs(behind - expected) < 1e-3  # a gap: 0.05
    assert abs(width - 2.0 * expected) < 2e-3  # a gap: 0.1

times, put_in, got = run(10.0)
at_reversal = got[np.searchsorted(times, 1.0)]
print(f"10 rad/s: {got.max() - at_reversal:.4f} further after the reversal")
assert 0.02 < got.max() - at_reversal < 0.05  # a gap: 0
PYTHON
venv/bin/python run.py
