#!/usr/bin/env bash
# Guess: FMPy converts a start value that comes with a display unit as FMI says: 20 degC are 293.15 K, and a difference of 20
#   degC (relativeQuantity) is 20 K.
# What happens: it is the other way round. Where the unit is that of a declared type, as Modelica tools write it, the offset is
#   always left out: the FMU starts at 20 K. Where the unit stands at the variable, the offset is always applied, so that a
#   difference of 20 degC starts at 293.15 K. Nothing is said. `relativeQuantity` of a variable is looked for among the
#   children of its element and never found; that of a type is always there, true or not.
# Version: FMPy 0.3.32, pythonfmu 0.7.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q fmpy==0.3.32 pythonfmu==0.7.0

cat > room.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Room(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.T, self.y = 300.0, 0.0
        self.register_variable(Real("T", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable, start=300.0))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = self.T
        return True
PYTHON
venv/bin/pythonfmu build -f room.py > /dev/null

cat > run.py <<'PYTHON'
import zipfile

import fmpy

UNITS = """<UnitDefinitions><Unit name="K"><BaseUnit K="1"/><DisplayUnit name="degC" offset="-273.15"/></Unit></UnitDefinitions>"""
TYPES = """<TypeDefinitions><SimpleType name="Temperature"><Real unit="K"{}/></SimpleType></TypeDefinitions>"""


def start(of_type, of_variable):
    """Run an FMU whose parameter T has the attributes given, and return T after a start value of 20 degC."""
    with zipfile.ZipFile("Room.fmu") as source, zipfile.ZipFile("room2.fmu", "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                head, rest = content.decode().split("<LogCategories", 1)
                rest = rest.replace('<Real start="300', f'<Real {of_variable} start="300')
                assert of_variable in rest
                types = "" if of_type is None else TYPES.format(of_type)
                content = (head + UNITS + types + "<LogCategories" + rest).encode()
            target.writestr(name, content)
    rows = fmpy.simulate_fmu("room2.fmu", stop_time=1.0, start_values={"T": (20.0, "degC")}, output=["y"])
    return float(rows["y"][-1])


cases = {
    "type": start("", 'declaredType="Temperature"'),
    "type, no difference": start(' relativeQuantity="false"', 'declaredType="Temperature"'),
    "type, a difference": start(' relativeQuantity="true"', 'declaredType="Temperature"'),
    "variable": start(None, 'unit="K"'),
    "variable, a difference": start(None, 'unit="K" relativeQuantity="true"'),
}
print("FMPy", fmpy.__version__, "20 degC in K:", cases)
assert [cases[name] for name in ("type", "type, no difference", "type, a difference")] == [20.0] * 3
assert abs(cases["variable"] - 293.15) < 1e-9 and abs(cases["variable, a difference"] - 293.15) < 1e-9
PYTHON
venv/bin/python run.py
echo "as described"
