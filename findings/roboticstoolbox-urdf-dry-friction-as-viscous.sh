#!/usr/bin/env bash
# Guess: Robotics Toolbox for Python reads <dynamics damping="0.3" friction="0.5"/> of a URDF joint as 0.3 N.m.s/rad and 0.5 N.m:
#   rne() holds 1.1 N.m for them at 2 rad/s. A joint that follows another one through a gear (<mimic>) follows it, or is refused.
# What happens: the number of the dry friction becomes the coefficient of the viscous one, and the damping is dropped: 1.0 N.m at 2 rad/s,
#   so that it looks right where one tries it, 0.05 N.m in place of 0.53 at 0.1 rad/s and 10 in place of 6.5 at 20 rad/s. A joint
#   with damping alone has no losses at all. The joint behind the gear is one more free joint. Nothing is said.
# Version: roboticstoolbox-python 1.5.0, numpy 2, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q roboticstoolbox-python==1.5.0

cat > run.py <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import roboticstoolbox as rtb
from roboticstoolbox.models.URDF.URDFRobot import URDF_read

SPEEDS = (0.1, 2.0, 20.0)
INERTIA = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def read(joints):
    links = "".join(f'<link name="{name}">{INERTIA}</link>' for name in ("base", *(child for child, _ in joints)))
    text = "".join(
        f'<joint name="{child}_axis" type="continuous"><parent link="base"/><child link="{child}"/><axis xyz="0 0 1"/>{inner}</joint>'
        for child, inner in joints
    )
    Path("machine.urdf").write_text(f'<robot name="machine">{links}{text}</robot>')
    found, name, *_ = URDF_read(Path("machine.urdf").resolve())
    return rtb.Robot(found, name=name)


print("roboticstoolbox-python", version("roboticstoolbox-python"))
for damping, friction in ((0.3, 0.5), (0.3, 0.0)):
    robot = read([("load", f'<dynamics damping="{damping}" friction="{friction}"/>')])
    torques = [float(robot.rne([0.0], [speed], [0.0], gravity=[0, 0, 0])[0]) for speed in SPEEDS]
    print(f"damping {damping}, friction {friction}: B = {robot.links[1].B}, Tc = {robot.links[1].Tc}")
    for speed, torque in zip(SPEEDS, torques):
        print(f"   {speed} rad/s: {torque:.3f} N.m, by the URDF {damping * speed + friction:.3f}")
        assert abs(torque - friction * speed) < 1e-9
geared = read([("motor", ""), ("load", '<mimic joint="motor_axis" multiplier="0.1"/>')])
print("joints of a motor with a load behind a gear:", geared.n)
assert geared.n == 2
PYTHON
venv/bin/python run.py
echo "as described"
