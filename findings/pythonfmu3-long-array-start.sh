#!/usr/bin/env bash
# Guess: pythonfmu3 writes the start values of an array into modelDescription.xml, or none where they are too many.
# What happens: beyond 1000 characters of text it writes the first character of the text as the only start value: an array
#   of 300 times 12.5 has start="1". The FMU itself starts at 12.5, so what an importer
#   shows and what runs differ. With FMI 3.0 one start value counts for all elements: nothing looks wrong.
# Version: pythonfmu3 0.3.4, numpy 2.2.6, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pythonfmu3==0.3.4 numpy==2.2.6 fmpy==0.3.32

cat > table.py <<'PYTHON'
import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability


class Table(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.few, self.many = np.full(200, 12.5), np.full(300, 12.5)
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        for name, size in (("few", "200"), ("many", "300")):
            self.register_variable(
                Float64(name, causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable,
                        dimensions=[Dimension(start=size)])
            )

    def do_step(self, time, step):
        return True
PYTHON
venv/bin/pythonfmu3 build -f table.py > build.txt

cat > run.py <<'PYTHON'
from importlib.metadata import version

import fmpy

description = fmpy.read_model_description("Table.fmu")
starts = {v.name: v.start for v in description.modelVariables}
print("pythonfmu3", version("pythonfmu3"), "start of 200 elements:", str(starts["few"])[:24], "... of 300:", starts["many"])
fmu = fmpy.instantiate_fmu(fmpy.extract("Table.fmu"), description, "CoSimulation")
fmu.enterInitializationMode()
references = {v.name: v.valueReference for v in description.modelVariables}
values = list(fmu.getFloat64([references["many"]], nValues=300))
print("the FMU has:", sorted(set(values)))
few = starts["few"].split() if isinstance(starts["few"], str) else list(starts["few"])
many = starts["many"].split() if isinstance(starts["many"], str) else list(starts["many"])
assert len(few) == 200 and {float(x) for x in few} == {12.5}
assert len(many) == 1 and float(many[0]) == 1.0 and set(values) == {12.5}
PYTHON
venv/bin/python run.py
echo "as described"
