#!/usr/bin/env bash
# Guess: two sampled blocks of PathSim in a row (SampleHold, FIR, ...) with the same period and phase work in the order of their
#   connections, or both from the values before the instant. In which order a simulation lists its blocks means nothing.
# What happens: at an instant the blocks sample in the order of the list. Listed along the signal, the second one takes the value
#   that the first one has just sampled; listed the other way round, it takes the one of the instant before: a delay of one
#   period more in the same diagram, for each such pair. Nothing is said. A loop of sampler and controller gets its dead time
#   so. A phase of 1e-9 s (tau) for the second block makes it the same in both orders.
# Version: pathsim 0.27.1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pathsim==0.27.1 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version
from itertools import permutations

from pathsim import Connection, Simulation
from pathsim.blocks import FIR, SampleHold, Scope, Source

print("pathsim", version("pathsim"))


def run(order, phase=0.0):
    """A ramp of 1 rad/s through a sampler and a filter that changes nothing; return what both show after 0.55 s."""
    source, scope = Source(lambda t: t), Scope()
    chain = {"sampler": SampleHold(T=0.1), "filter": FIR([1.0], T=0.1, tau=phase)}
    connections = [
        Connection(source, chain["sampler"]),
        Connection(chain["sampler"], chain["filter"], scope[0]),
        Connection(chain["filter"], scope[1]),
    ]
    simulation = Simulation([source, *(chain[name] for name in order), scope], connections, dt=0.01, log=False)
    simulation.run(0.55)
    _, signals = scope.read()
    return [round(float(signal[-1]), 9) for signal in signals]


shown = {}
for order in permutations(["sampler", "filter"]):
    shown[order] = run(order)
    print(f"listed as {order}: {shown[order]} at 0.55 s; with a phase of 1e-9 s {run(order, 1e-9)}")
    assert run(order, 1e-9) == [0.5, 0.5]
assert shown["sampler", "filter"] == [0.5, 0.5]
assert shown["filter", "sampler"] == [0.5, 0.4]
PYTHON
venv/bin/python run.py
