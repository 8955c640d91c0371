#!/usr/bin/env bash
# Guess: fmucontainer makes one FMU of an SSP file with its parameter values, or says which of them it cannot take.
# What happens: it takes components and connections. Values of .ssv files and those within the description are dropped
#   without a word: the container runs with the start values of the FMUs, and does not offer the parameters either.
# Version: fmu-manipulation-toolbox 2.0, pythonfmu 0.7.0, FMPy 0.3.32, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q fmu-manipulation-toolbox==2.0 pythonfmu==0.7.0 fmpy==0.3.32

cat > line.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Line(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.b, self.y = 2.0, 1.0, 0.0
        for name, start in (("k", 2.0), ("b", 1.0)):
            parameter = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
            self.register_variable(Real(name, start=start, **parameter))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y = self.k * (time + step) + self.b
        return True
PYTHON
venv/bin/pythonfmu build -f line.py > build.txt

cat > pack.py <<'PYTHON'
import zipfile

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"))
)
PARAMETER = '<ssv:Parameter name="{}"><ssv:Real value="{}"/></ssv:Parameter>'
SET = '<ssv:ParameterSet {} version="1.0" name="values"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet>'
within = SET.format("", PARAMETER.format("b", 10.0))
system = f"""<ssd:SystemStructureDescription {SPACES} version="1.0" name="one"><ssd:System name="system">
<ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors><ssd:Elements>
<ssd:Component name="line" type="application/x-fmu-sharedlibrary" source="resources/Line.fmu">
 <ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector></ssd:Connectors>
 <ssd:ParameterBindings>
  <ssd:ParameterBinding><ssd:ParameterValues>{within}</ssd:ParameterValues></ssd:ParameterBinding>
  <ssd:ParameterBinding type="application/x-ssp-parameter-set" source="resources/line.ssv"/>
 </ssd:ParameterBindings>
</ssd:Component></ssd:Elements><ssd:Connections>
 <ssd:Connection startElement="line" startConnector="y" endConnector="y"/>
</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"""
with zipfile.ZipFile("one.ssp", "w") as archive:
    archive.writestr("SystemStructure.ssd", HEAD + system)
    archive.writestr("resources/line.ssv", HEAD + SET.format(SPACES, PARAMETER.format("k", 100.0)))
    archive.write("Line.fmu", "resources/Line.fmu")
PYTHON
venv/bin/python pack.py
venv/bin/fmucontainer -container one.ssp:0.1 -fmu-directory . > said.txt 2>&1
cat said.txt
if grep -qi 'ssv\|parameter \|parameterset\|binding\|dropped\|ignored' said.txt; then echo "it says something of parameters now"; exit 1; fi

cat > run.py <<'PYTHON'
import fmpy

row = fmpy.simulate_fmu("one.fmu", stop_time=1.0, output_interval=0.1)[-1]
found = dict(zip(row.dtype.names, map(float, row)))
print("at the end:", found, "- with the values of the SSP file y is 110")
assert abs(found.pop("time") - 1.0) < 1e-9
((name, y),) = found.items()
assert name.endswith("y") and abs(y - 3.0) < 1e-9
names = [v.name for v in fmpy.read_model_description("one.fmu").modelVariables]
print("variables of the container:", names)
assert not any(name.split(".")[-1] in ("k", "b") for name in names)
PYTHON
venv/bin/python run.py
echo "as described"
