#!/usr/bin/env bash
# Guess: CoFmuPy steps the FMUs of a loop by `gauss_seidel` in the order of the file, or of the connections: one that follows from
#   the configuration, so that two runs of one file agree.
# What happens: a loop is a set of names, and the order is that in which Python happens to list the set, which changes from process
#   to process. Who comes first works with the values of the step before, so a plant and its controller have a dead time
#   of one step at the one's input in some runs and at the other's in the rest; the results differ, and the order of the FMUs
#   in the file decides nothing. Nothing is said. PYTHONHASHSEED fixes the order; `jacobi`, the default, does not depend on it.
# Version: cofmupy 1.0.0, FMPy 0.3.20, pythonfmu 0.6.3, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q cofmupy==1.0.0 FMPy==0.3.20 pythonfmu==0.6.3 numpy==2.4.6

cat > blocks.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Blocks(Fmi2Slave):
    """A sampled lag: y moves half of the way to 1 - u."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=0.0))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y += 0.5 * (1.0 - self.u - self.y)
        return True
PYTHON
venv/bin/pythonfmu build -f blocks.py > build.txt

cat > run.py <<'PYTHON'
import json
import logging
import sys
from pathlib import Path

logging.disable(logging.CRITICAL)
from cofmupy import Coordinator  # noqa: E402


def connect(source, sink):
    ends = ({"type": "fmu", "id": source, "variable": "y"}, {"type": "fmu", "id": sink, "variable": "u"})
    return {"source": ends[0], "target": [ends[1]]}


method = sys.argv[1]
case = {
    "fmus": [{"id": name, "path": "Blocks.fmu"} for name in ("plant", "controller")],
    "connections": [connect("plant", "controller"), connect("controller", "plant")],
    "cosim_method": method,
    "root": ".",
}
Path(f"{method}.json").write_text(json.dumps(case))
run = Coordinator()
run.start(f"{method}.json")
run.run_simulation(0.5, 2.0)
print("plant", [round(float(y), 4) for y in run.get_results()["plant", "y"]])
PYTHON
echo "cofmupy $(venv/bin/python -c 'from importlib.metadata import version; print(version("cofmupy"))')"
for method in jacobi gauss_seidel; do
    for seed in 0 1 2 3 4 5 6 7 8 9; do
        PYTHONHASHSEED=$seed venv/bin/python run.py "$method" | grep plant
    done | sort | uniq -c | tee "$method.txt" | sed "s/^/$method: runs /"
done
test "$(wc -l < jacobi.txt)" = 1
test "$(wc -l < gauss_seidel.txt)" = 2
echo "as described"
