#!/usr/bin/env bash
# Guess: component-model writes start values in the unit that it states for the variable, and display units as FMI says:
#   value shown = factor * value.
# What happens: start="90 deg" becomes start="90.0" with unit="radian" and displayUnit="degree": an importer reads 90 rad,
#   14 turns. The factor of the display unit is 0.01745 where FMI means 57.3. The unit radian has no exponent of rad, so it
#   cannot be converted to deg at all. A value in kelvin shown in degC gets the offset of the other direction too.
# Version: component-model 0.4.0, pythonfmu 0.7.0, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q component-model==0.4.0 pythonfmu==0.7.0 fmpy==0.3.32

cat > valve.py <<'PYTHON'
from component_model.model import Model
from component_model.variable import Variable


class Valve(Model):
    def __init__(self, **kwargs):
        super().__init__("Valve", "an angle and a temperature", "nobody", "1.0", **kwargs)
        for name, start in (("angle", "90 deg"), ("temperature", "20 degC")):
            Variable(self, name, name, causality="parameter", variability="tunable", start=start)

    def do_step(self, current_time, step_size):
        return super().do_step(current_time, step_size)
PYTHON
cat > run.py <<'PYTHON'
from importlib.metadata import version

import fmpy
from component_model.model import Model

Model.build("valve.py", dest="Valve.fmu")
description = fmpy.read_model_description("Valve.fmu", validate=False)
units = {unit.name: unit for unit in description.unitDefinitions}
print("component-model", version("component-model"))
for v in description.modelVariables:
    unit = units[v.unit]
    shown = {d.name: (d.factor, d.offset) for d in unit.displayUnits}
    base = unit.baseUnit
    print(v.name, "start", v.start, v.unit, "shown in", v.displayUnit, shown, "rad", base.rad, "factor", base.factor)
by_name = {v.name: v for v in description.modelVariables}
angle, radian = by_name["angle"], units[by_name["angle"].unit]
assert (float(angle.start), angle.unit, angle.displayUnit) == (90.0, "radian", "degree")
assert abs(float(radian.displayUnits[0].factor) - 0.0174533) < 1e-6 and int(radian.baseUnit.rad or 0) == 0
temperature = by_name["temperature"]
assert float(temperature.start) == 20.0 and temperature.unit == "kelvin"
assert float(units["kelvin"].displayUnits[0].offset) > 200.0
PYTHON
venv/bin/python run.py
echo "as described"
