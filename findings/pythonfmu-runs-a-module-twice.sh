#!/usr/bin/env bash
# Guess: an instance of a Python FMU runs its module once, as any import does, and a second instance does not run it again.
# What happens: PythonFMU imports the module and executes its text once more: what stands at the top of the file happens twice
#   for the first instance, and again for every further one. A counter or a cache of the module begins anew under an instance
#   that lives, as soon as another one is made.
# Version: pythonfmu 0.7.0, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pythonfmu==0.7.0 fmpy==0.3.32

cat > counter.py <<'PYTHON'
import os

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

with open(os.environ["EXECUTIONS"], "a") as stream:
    stream.write("x")
steps = 0


class Counter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        global steps
        steps += 1
        self.y = float(steps)
        return True
PYTHON
export EXECUTIONS="$folder/executions"
venv/bin/python -m pythonfmu build -f counter.py
cat > run.py <<'PYTHON'
import os
from importlib.metadata import version
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

print("pythonfmu", version("pythonfmu"), "FMPy", version("fmpy"))
log = Path(os.environ["EXECUTIONS"])
folder, description = extract("Counter.fmu"), read_model_description("Counter.fmu")
identifier = description.coSimulation.modelIdentifier


def instance(name):
    log.write_text("")
    slave = FMU2Slave(
        guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName=name
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave, len(log.read_text())


def step(slave, time):
    slave.doStep(time, 0.1)
    return slave.getReal([v.valueReference for v in description.modelVariables if v.name == "y"])[0]


first, executions = instance("first")
counted = [step(first, 0.0), step(first, 0.1)]
second, more = instance("second")
counted.append(step(first, 0.2))
print("executions of the module for the first instance:", executions, "for the second:", more)
print("steps that the first instance counts in a global of the module, the last after a second instance came:", counted)
assert (executions, more) == (2, 1)
assert counted == [1.0, 2.0, 1.0]
PYTHON
venv/bin/python run.py
