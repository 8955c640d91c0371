#!/usr/bin/env bash
# Guess: SysIdData.downsample(4) of llsi leaves each fourth sample and makes the step four times as large; a model that is identified from
#   the rest has the time constants of the machine.
# What happens: the step is multiplied once for every signal in the record. With input and output it is 16 times as large, and 64 times
#   with a third signal, used or not. A record of 20 s lasts 80 s after it, a lag of 0.5 s is identified as 1.87 s, or as 7.5 s, and
#   Model.Ts carries the wrong step on. The discrete poles fit the data, so that a simulation beside the record looks right. Nothing
#   is said.
# Version: llsi 0.5.0, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q llsi==0.5.0 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import llsi
import numpy as np

STEP, LAG, FACTOR = 0.01, 0.5, 4
pole = np.exp(-STEP / LAG)
generator = np.random.default_rng(0)
torque = np.repeat(generator.choice([-1.0, 1.0], 250), 8)
speed = np.zeros(len(torque))
for k in range(len(torque) - 1):
    speed[k + 1] = pole * speed[k] + (1 - pole) * torque[k]


def lag_of(record):
    model = llsi.sysid(record, "speed", "torque", (1,), method="n4sid")
    assert model.Ts == record.Ts
    return float((-model.Ts / np.log(np.linalg.eigvals(model.A).real)).item())


print("llsi", version("llsi"))
for others in ({}, {"current": torque}):
    record = llsi.SysIdData(Ts=STEP, torque=torque, speed=speed, **others)
    before, length = lag_of(record), record.time()[-1]
    record.downsample(FACTOR)
    after = lag_of(record)
    signals = 2 + len(others)
    print(f"{signals} signals: step {record.Ts} s, {record.N} samples, {length} s become {record.time()[-1]} s, lag {before:.3f} s becomes {after:.3f} s")
    assert abs(before - LAG) < 1e-3 and record.N == len(torque) // FACTOR
    assert np.isclose(record.Ts, STEP * FACTOR**signals)
    assert abs(after * FACTOR / FACTOR**signals - LAG) < 0.05
PYTHON
venv/bin/python run.py
echo "as described"
