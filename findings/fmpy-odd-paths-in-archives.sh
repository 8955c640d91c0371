#!/usr/bin/env bash
# Guess: FMPy takes an FMU whose entries begin with `./`, as bsdtar and libarchive write them, or refuses it as a whole.
# What happens: `extract` unpacks it and finds nothing wrong, `read_model_description` of the same file raises a KeyError, and
#   `simulate_fmu` says that the FMU cannot be simulated on this platform; yet the folder that was unpacked runs. An FMU with
#   backslashes is read and not unpacked, and `simulate_fmu` blames the platform again.
# Version: FMPy 0.3.32, pythonfmu 0.7.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q fmpy==0.3.32 pythonfmu==0.7.0

cat > ramp.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Ramp(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y += step
        return True
PYTHON
venv/bin/pythonfmu build -f ramp.py > build.txt

cat > run.py <<'PYTHON'
import zipfile

import fmpy


def repack(target, rename):
    with zipfile.ZipFile("Ramp.fmu") as source, zipfile.ZipFile(target, "w") as sink:
        for name in source.namelist():
            sink.writestr(rename(name), source.read(name))


def outcome(call, *arguments, **options):
    try:
        call(*arguments, **options)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "works"


repack("dots.fmu", lambda name: f"./{name}")
repack("backslashes.fmu", lambda name: name.replace("/", "\\"))
print("FMPy", fmpy.__version__)
found = {}
for name in ("dots.fmu", "backslashes.fmu"):
    calls = {"read": (fmpy.read_model_description,), "unpack": (fmpy.extract,), "run": (fmpy.simulate_fmu,)}
    for what, (call,) in calls.items():
        found[name, what] = outcome(call, name)
        print(f"{name}: {what}: {found[name, what]}")
found["folder"] = outcome(fmpy.simulate_fmu, fmpy.extract("dots.fmu"), stop_time=0.1)
print("folder of dots.fmu: run:", found["folder"])
assert found["dots.fmu", "unpack"] == found["folder"] == found["backslashes.fmu", "read"] == "works"
assert found["dots.fmu", "read"].startswith("KeyError") and "forward slashes" in found["backslashes.fmu", "unpack"]
assert all("cannot be simulated on the current platform" in found[name, "run"] for name in ("dots.fmu", "backslashes.fmu"))
PYTHON
venv/bin/python run.py
echo "as described"
