#!/usr/bin/env bash
# Guess: Integer(...) and Real(..., causality=parameter) of PythonFMU, with nothing else stated, give variables that FMI 2.0
#   allows: Integers are discrete, parameters fixed or tunable. A value that is no whole number is refused or rounded.
# What happens: the variability is left out, which means continuous: forbidden for both. PythonFMU builds the FMU without a
#   word. FMPy refuses one with such an Integer unless validate=False, and one with such a parameter always; libcosim notes it
#   in its log and runs both. An Integer output that a step sets to 2.7 is 2. Where `variability` is stated, all take the FMU.
# Version: pythonfmu 0.7.0, FMPy 0.3.32, libcosimpy 0.0.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pythonfmu==0.7.0 FMPy==0.3.32 libcosimpy==0.0.6

slave() {  # NAME, what is added to the Integer, what is added to the parameter
    cat > "$1.py" <<PYTHON
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class $1(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.counts, self.ratio = 0, 2.7
        self.register_variable(Integer("counts", causality=Fmi2Causality.output$2))
        self.register_variable(Real("ratio", causality=Fmi2Causality.parameter$3))

    def do_step(self, current_time, step_size):
        self.counts = self.ratio if current_time < 0.15 else -self.ratio
        return True
PYTHON
    venv/bin/pythonfmu build -f "$1.py" > "$1.txt"
}
slave Plain "" ""
slave Tuned "" ", variability=Fmi2Variability.tunable"
slave Stated ", variability=Fmi2Variability.discrete" ", variability=Fmi2Variability.tunable"

cat > fmpy_runs.py <<'PYTHON'
import fmpy


def run(name, **options):
    try:
        rows = fmpy.simulate_fmu(f"{name}.fmu", stop_time=0.4, output_interval=0.1, **options)
        return rows["counts"].tolist()
    except Exception as error:
        return " ".join(str(error).split())


print("FMPy", fmpy.__version__)
seen = {}
lenient = {"validate": False}
for name, options in (("Plain", {}), ("Plain", lenient), ("Tuned", {}), ("Tuned", lenient), ("Stated", {})):
    seen[name, bool(options)] = run(name, **options)
    print(name, options or "", str(seen[name, bool(options)])[:115])
refused = 'illegal combination of causality="parameter" and variability="continuous"'
assert refused in seen["Plain", False] and refused in seen["Plain", True]
assert 'must have variability != "continuous"' in seen["Tuned", False]
assert seen["Tuned", True] == seen["Stated", False] == [0, 2, 2, -2, -2]
PYTHON
venv/bin/python fmpy_runs.py

cat > libcosim_runs.py <<'PYTHON'
import sys
from importlib.metadata import version

from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

execution = CosimExecution.from_step_size(step_size=100_000_000)
slave = execution.add_local_slave(local_slave=CosimLocalSlave(fmu_path=f"{sys.argv[1]}.fmu", instance_name="slave"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer=observer)
assert execution.step(step_count=2)
variable = next(v for v in execution.slave_variables(slave_index=slave) if v.name == b"counts")
assert variable.type == CosimVariableType.INTEGER.value
counts = observer.last_integer_values(slave_index=slave, variable_references=[variable.reference])
print("libcosimpy", version("libcosimpy"), sys.argv[1], counts)
assert list(counts) == [2]
PYTHON
venv/bin/python libcosim_runs.py Plain > log.txt 2>&1 || { cat log.txt; exit 1; }
grep '^libcosimpy' log.txt
grep -q "Setting variability to 'fixed'" log.txt
echo "as described"
