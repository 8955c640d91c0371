#!/usr/bin/env bash
# Guess: a tool that runs an SSP file applies the LinearTransformation of a connection or refuses it, and converts between the
#   units of the connectors, as SSP 1.0 asks for, or refuses that.
# What happens: libcosim applies the transformation, FMPy drops it without a word: 3 becomes 7 in one and stays 3 in the other.
#   Neither converts units: an angle of 3 rad arrives as 3 deg, though the file defines both units.
# Version: FMPy 0.3.32, libcosimpy 0.0.6, pythonfmu 0.7.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q fmpy==0.3.32 libcosimpy==0.0.6 pythonfmu==0.7.0

cat > blocks.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Source(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 3.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
PYTHON
cp blocks.py source.py
sed -e 's/class Source/class Sink/' -e 's/self.y = 3.0/self.u = 0.0/' -e 's/"y", causality=Fmi2Causality.output/"u", causality=Fmi2Causality.input, start=0.0/' blocks.py > sink.py
venv/bin/pythonfmu build -f source.py > /dev/null
venv/bin/pythonfmu build -f sink.py > /dev/null

cat > run.py <<'PYTHON'
import importlib.metadata
import sys
import tempfile
import zipfile

import fmpy
from fmpy.ssp.simulation import simulate_ssp
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

STRUCTURE = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" name="line" version="1.0">
  <ssd:System name="root">
    <ssd:Elements>
      <ssd:Component name="A" type="application/x-fmu-sharedlibrary" source="resources/Source.fmu">
        <ssd:Connectors><ssd:Connector name="y" kind="output"><ssc:Real{0}/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
      <ssd:Component name="B" type="application/x-fmu-sharedlibrary" source="resources/Sink.fmu">
        <ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real{1}/></ssd:Connector></ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="A" startConnector="y" endElement="B" endConnector="u">{2}</ssd:Connection>
    </ssd:Connections>
  </ssd:System>{3}
  <ssd:DefaultExperiment startTime="0" stopTime="1"/>
</ssd:SystemStructureDescription>"""
UNITS = """<ssd:Units>
    <ssc:Unit name="rad"><ssc:BaseUnit rad="1"/></ssc:Unit>
    <ssc:Unit name="deg"><ssc:BaseUnit rad="1" factor="0.017453292519943295"/></ssc:Unit>
  </ssd:Units>"""
FILES = {
    "transformation": ("", "", '<ssc:LinearTransformation factor="2" offset="1"/>', ""),
    "units": (' unit="rad"', ' unit="deg"', "", UNITS),
}
arrived = {}
for name, parts in FILES.items():
    with zipfile.ZipFile(f"{name}.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", STRUCTURE.format(*parts))
        for fmu in ("Source", "Sink"):
            archive.write(f"{fmu}.fmu", f"resources/{fmu}.fmu")
    rows = simulate_ssp(f"{name}.ssp", stop_time=1.0, step_size=0.1)
    folder = tempfile.mkdtemp(dir=".")
    zipfile.ZipFile(f"{name}.ssp").extractall(folder)
    execution = CosimExecution.from_ssp_file(ssp_path=folder, step_size=10**8)
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    execution.simulate_until(10**9)
    there = observer.last_real_values(execution.slave_index_from_instance_name("B"), [0])[0]
    arrived[name] = {"FMPy": float(rows["B.u"][-1]), "libcosim": there}
print("FMPy", fmpy.__version__, "libcosimpy", importlib.metadata.version("libcosimpy"), "3 arrives as", arrived)
assert arrived["transformation"] == {"FMPy": 3.0, "libcosim": 7.0}
assert arrived["units"] == {"FMPy": 3.0, "libcosim": 3.0}
PYTHON
venv/bin/python run.py 2>&1 | grep -v FMILIB
echo "as described"
