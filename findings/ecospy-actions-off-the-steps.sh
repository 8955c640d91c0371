#!/usr/bin/env bash
# Guess: a timed action of a scenario of Ecos that falls between two steps is applied at the next one, or is refused; one at 0.3 s
#   with steps of 0.1 s is applied at the third step.
# What happens: an action is applied only at a step whose time is its own to the last bits, and else never. At 0.25 s it is
#   lost, and so is one at 0.3 s, for three steps of 0.1 s add up to 0.30000000000000004 s; one at 0.2 s is applied. Nothing
#   is said: the run goes on without its load step, its fault or its change of gain. set_real() between two steps is applied.
# Version: ecospy 0.7.2, pythonfmu 0.7.0, tbb 2023.2.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q ecospy==0.7.2 pythonfmu==0.7.0 tbb==2023.2.0

cat > block.py <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Block(Fmi2Slave):
    """y = u."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=0.0))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = self.u
        return True
PYTHON
venv/bin/pythonfmu build -f block.py > build.txt

cat > run.py <<'PYTHON'
from importlib.metadata import version

from ecospy import EcosSimulation, EcosSimulationStructure


def run(step, actions):
    """Return times [s] and outputs of ten steps."""
    with EcosSimulationStructure() as structure:
        structure.add_model("block", "Block.fmu")
        simulation = EcosSimulation(structure=structure, step_size=step)
        simulation.add_scenario(real_actions=[(time, "block::u", value) for time, value in actions])
        simulation.init()
        rows = []
        for _ in range(10):
            simulation.step(1)
            rows.append((simulation.get_time(), simulation.get_real("block::y")))
        simulation.terminate()
        simulation.free()
    return rows


print("ecospy", version("ecospy"))
for step, actions, expected in (
    (0.1, [(0.2, 1.0)], 1.0),
    (0.1, [(0.25, 1.0)], 0.0),
    (0.1, [(0.3, 1.0)], 0.0),
    (0.125, [(0.375, 1.0)], 1.0),
):
    rows = run(step, actions)
    print("steps of", step, "s, actions", actions, "-> outputs", [y for _, y in rows])
    assert rows[-1][1] == expected
assert run(0.1, [(0.2, 1.0)])[2][0] == 0.30000000000000004
PYTHON
LD_LIBRARY_PATH="$folder/venv/lib" venv/bin/python run.py
echo "as described"
