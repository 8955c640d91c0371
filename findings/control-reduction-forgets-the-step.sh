#!/usr/bin/env bash
# Guess: python-control reduces a discrete system to a discrete one (modred, balred), or says that it cannot.
# What happens: both return a system of continuous time, without a word, though modred looks at the step for its check of
#   stability, and refuses `matchdc` for it. The matrices that modred keeps are the discrete ones: a gain of 14.3 becomes -1.1,
#   and a decaying pole of 0.9 a growing one. balred takes poles between 0 and 1 for unstable ones, which it must keep: asked
#   for one state it returns both, with a gain of -3.7. canonical_form, minreal and similarity_transform keep the step.
# Version: control 0.10.2, slycot 0.7.1, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q control==0.10.2 slycot==0.7.1 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
import warnings

import control
import numpy as np

warnings.simplefilter("error", UserWarning)
system = control.ss([[0.9, 0.2], [0.0, 0.3]], [[1.0], [1.0]], [[1.0, 1.0]], 0, 0.1)
print("control", control.__version__, "dt", system.dt, "gain", float(system.dcgain()))

kept = control.modred(system, [1], "truncate")
print("modred: dt", kept.dt, "poles", kept.poles().real, "gain", float(kept.dcgain()))
assert kept.dt == 0 and np.allclose(kept.poles(), 0.9) and np.isclose(kept.dcgain(), -1 / 0.9)
try:
    control.modred(system, [1], "matchdc")
    raise SystemExit("matchdc is not refused")
except NotImplementedError as error:
    print("modred, matchdc:", error)

for method in ("truncate", "matchdc"):
    reduced = control.balred(system, 1, method=method)
    print("balred,", method, ": dt", reduced.dt, "states", reduced.nstates, "gain", float(reduced.dcgain()))
    assert reduced.dt == 0 and reduced.nstates == 2 and np.isclose(reduced.dcgain(), -100 / 27)

others = {
    "canonical_form": control.canonical_form(system, "modal")[0],
    "minreal": control.minreal(system, verbose=False),
    "similarity_transform": control.similarity_transform(system, np.eye(2)),
}
print("kept by", {name: other.dt for name, other in others.items()})
assert all(other.dt == 0.1 and np.isclose(other.dcgain(), system.dcgain()) for other in others.values())
PYTHON
venv/bin/python run.py
echo "as described"
