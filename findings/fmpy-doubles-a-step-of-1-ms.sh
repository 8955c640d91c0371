#!/usr/bin/env bash
# Guess: simulate_fmu() of FMPy, told nothing but the file, steps an FMU for co-simulation by the stepSize of its default
#   experiment; and step_size=0.001 sets the step.
# What happens: the step is doubled until at most 1000 of them fill the time: an FMU that asks for 1 ms and 10 s is stepped by
#   16 ms, and by 1 ms where 1 s is asked for. A sampled controller then misses 15 of 16 samples, and a torque that jumps comes
#   up to 16 ms late. Nothing is said. step_size changes nothing, for it is that of the solver Euler; output_interval is the step.
# Version: FMPy 0.3.32, pythonfmu 0.7.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q FMPy==0.3.32 pythonfmu==0.7.0

cat > controller.py <<'PYTHON'
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Real


class Controller(Fmi2Slave):
    """Counts its samples: y is their number, h the last step [s]."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = self.h = 0.0
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=10.0, step_size=0.001)
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("h", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y, self.h = self.y + 1.0, step_size
        return True
PYTHON
venv/bin/pythonfmu build -f controller.py > build.txt

cat > run.py <<'PYTHON'
import fmpy

experiment = fmpy.read_model_description("Controller.fmu").defaultExperiment
print("FMPy", fmpy.__version__, "- the FMU asks for steps of", experiment.stepSize, "s until", experiment.stopTime, "s")
assert (float(experiment.stepSize), float(experiment.stopTime)) == (0.001, 10.0)


def count(**options):
    rows = fmpy.simulate_fmu("Controller.fmu", **options)
    print(options, "->", int(rows["y"][-1]), "steps, of", round(float(rows["h"][1]), 6), "s")
    return int(rows["y"][-1]), round(float(rows["h"][1]), 6)


assert count() == (625, 0.016)
assert count(stop_time=1.0) == (1000, 0.001)
assert count(stop_time=1.001)[1] == 0.002
assert count(step_size=0.001) == (625, 0.016)
assert count(output_interval=0.001) == (10000, 0.001)
PYTHON
venv/bin/python run.py
echo "as described"
