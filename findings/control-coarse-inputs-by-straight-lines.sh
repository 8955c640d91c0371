#!/usr/bin/env bash
# Guess: forced_response() of python-control, handed a discrete system and times that are a multiple of its step apart, holds each
#   input until the next one, or refuses, as input_output_response() does. `interpolate`, which is off, would make it go
#   between them.
# What happens: the inputs go straight from one to the next all the same; `interpolate` only says whether the samples between
#   are shown. A system that delays by one sample of 0.1 s shows 0.5 for an input of 0, 1, 0, 1 each 0.2 s, a value that no
#   command had. A relay, a drive's raster or a random binary signal is another one so. Nothing is said.
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
times, commands = 0.2 * np.arange(5), np.array([0.0, 1.0, 0.0, 1.0, 0.0])
late = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], 0.1)  # y[k] = u[k - 1]

shown = control.forced_response(late, times, commands)
print("forced_response, steps of 0.2 s:", shown.outputs)
assert np.allclose(shown.time, times) and np.allclose(shown.outputs, [0.0, 0.5, 0.5, 0.5, 0.5])
dense = control.forced_response(late, times, commands, interpolate=True)
print("with interpolate:", dense.outputs)
assert np.allclose(dense.outputs[::2], shown.outputs)

held = control.forced_response(late, 0.1 * np.arange(9), np.repeat(commands, 2)[:9])
print("inputs held by hand:", held.outputs[::2])
assert np.allclose(held.outputs[::2], [0.0, 0.0, 1.0, 0.0, 1.0])
try:
    control.input_output_response(late, times, commands)
except ValueError as error:
    print("input_output_response:", error)
else:
    raise SystemExit("no refusal")
PYTHON
venv/bin/python run.py
