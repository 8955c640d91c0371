#!/usr/bin/env bash
# Guess: pythonfmu3 refuses a wrong number of values (nValues) with an error, or takes no notice of it.
# What happens: fmi3GetFloat64 with room for two values and one scalar returns fmi3OK, and leaves the exception that it met
#   inside set in the thread. A host in Python gets that exception from a later line, which has nothing to do with it; with
#   ctypes the status of the call is lost as well (SystemError: ... returned a result with an exception set).
# Version: pythonfmu3 0.3.4, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pythonfmu3==0.3.4 fmpy==0.3.32

cat > ramp.py <<'PYTHON'
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability


class Ramp(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.y = 0.0, 3.0
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        self.register_variable(Float64("y", causality=Fmi3Causality.output, variability=Fmi3Variability.continuous))

    def do_step(self, time, step):
        self.y += step
        return True
PYTHON
venv/bin/pythonfmu3 build -f ramp.py > build.txt

cat > run.py <<'PYTHON'
import ctypes
from importlib.metadata import version

import fmpy

description = fmpy.read_model_description("Ramp.fmu")
fmu = fmpy.instantiate_fmu(fmpy.extract("Ramp.fmu"), description, "CoSimulation")
fmu.enterInitializationMode()
fmu.exitInitializationMode()
reference = next(v.valueReference for v in description.modelVariables if v.name == "y")
get = ctypes.CDLL(fmu.dll._name).fmi3GetFloat64
returned = []
get.restype = returned.append  # sees the status before the interpreter looks for exceptions
for room in (1, 2):
    values = (ctypes.c_double * room)()
    arguments = (ctypes.c_void_p(fmu.component), (ctypes.c_uint32 * 1)(reference), ctypes.c_size_t(1), values, ctypes.c_size_t(room))
    try:
        get(*arguments)
        left = None
    except SystemError as error:
        left = error
        while left.__cause__ is not None:
            left = left.__cause__
    print("pythonfmu3", version("pythonfmu3"), "room for", room, "status:", returned[-1], list(values), "left:", repr(left))
    assert returned[-1] == 0 and values[0] == 3.0
    assert (left is None) == (room == 1)
PYTHON
venv/bin/python run.py
echo "as described"
