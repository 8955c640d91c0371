#!/usr/bin/env bash
# Guess: a command of moteus whose registers are set to 16 bits, so that more of them fit into a CAN frame, is refused where a value does not
#   fit, or needs more bits then; other values are rounded to the nearest step of 0.1 mrev, 0.25 mrev/s or 0.01 N.m.
# What happens: values beyond the range are sent as its end: 5 revolutions as 3.2767, and 20 rev/s as 8.19 rev/s. Values within the
#   range are cut towards zero: a maximum torque of 0.019 N.m is sent as 0.01 N.m, and one of 0.009 N.m as 0. Of the positions 0,
#   0.0001, ... 1 rev, all of them whole steps, one in four is sent a step too small. Nothing is said. With the default, floats,
#   the command holds the values.
# Version: moteus 1.1.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q moteus==1.1.1

cat > run.py <<'PYTHON'
import math
from importlib.metadata import version

import moteus

print("moteus", version("moteus"))
short = moteus.PositionResolution()
short.position = short.velocity = short.maximum_torque = moteus.INT16
short_drive, drive = moteus.Controller(id=1, position_resolution=short), moteus.Controller(id=1)
REGISTERS = {
    "position": moteus.Register.COMMAND_POSITION,
    "velocity": moteus.Register.COMMAND_VELOCITY,
    "maximum_torque": moteus.Register.COMMAND_POSITION_MAX_TORQUE,
}
STEPS = {"position": 1e-4, "velocity": 2.5e-4, "maximum_torque": 0.01}


def send(controller, **values):
    """Return what the frame of a command holds, in rev, rev/s and N.m."""
    frame = {part.register: part for part in moteus.parse_frame(controller.make_position(**values).data)}
    parts = {name: frame[REGISTERS[name]] for name in values}
    return {name: part.value * (STEPS[name] if part.resolution == moteus.INT16 else 1.0) for name, part in parts.items()}


for values in (
    {"position": 5.0, "velocity": 20.0},
    {"position": 0.5, "maximum_torque": 0.019},
    {"position": 0.5, "maximum_torque": 0.009},
):
    print(values, "with 16 bits:", {name: round(value, 5) for name, value in send(short_drive, **values).items()})
    assert all(math.isclose(send(drive, **values)[name], value, rel_tol=1e-6) for name, value in values.items())
found = send(short_drive, position=5.0, velocity=20.0)
assert math.isclose(found["position"], 3.2767) and math.isclose(found["velocity"], 8.19175)
assert math.isclose(send(short_drive, position=0.5, maximum_torque=0.019)["maximum_torque"], 0.01)
assert send(short_drive, position=0.5, maximum_torque=0.009)["maximum_torque"] == 0.0

wrong = [n for n in range(10_001) if round(send(short_drive, position=n / 10_000)["position"] * 10_000) != n]
print(f"{len(wrong)} of 10001 positions are a step too small, the first {wrong[:5]}")
assert len(wrong) > 2500
PYTHON
venv/bin/python run.py
echo "as described"
