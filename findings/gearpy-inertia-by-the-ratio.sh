#!/usr/bin/env bash
# Guess: gearpy refers inertias through a gear by the square of its ratio, and its efficiency counts in both directions: a motor that
#   accelerates a load behind a gear of 4 turns at T / (J1 + J2 / 16), and a load that drives the motor loses power in the gear.
# What happens: inertias are referred by the ratio itself, J1 * 4 + J2 at the load. With 0.01 and 0.16 kg.m2, 1 N.m accelerates
#   the motor at 80 rad/s2 in place of 50: after 1 s both inertias hold 1.6 times the work that went into them. The efficiency is
#   taken off the motor's torque alone; a load that drives has all of its own. Nothing is said, and steady states are right: only
#   a run-up or a settling time shows it.
# Version: gearpy 1.3.1, numpy 2.3.5, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q gearpy==1.3.1 numpy==2.3.5

cat > run.py <<'PYTHON'
from importlib.metadata import version

from gearpy.mechanical_objects import DCMotor, SpurGear
from gearpy.powertrain import Powertrain
from gearpy.solver import Solver
from gearpy.units import AngularPosition, AngularSpeed, InertiaMoment, TimeInterval, Torque
from gearpy.utils import add_fixed_joint, add_gear_mating

J1, J2, RATIO = 0.01, 0.16, 4


def accelerate(torque, load=0.0, efficiency=1.0):
    """Return the motor's speed [rad/s] one second after standstill; torques in N.m, the load's against the motion."""
    motor = DCMotor("motor", InertiaMoment(J1, "kgm^2"), AngularSpeed(1e9, "rad/s"), Torque(torque, "Nm"))
    pinion = SpurGear("pinion", 10, InertiaMoment(1e-12, "kgm^2"))
    wheel = SpurGear("wheel", 10 * RATIO, InertiaMoment(J2, "kgm^2"))
    add_fixed_joint(motor, pinion)
    add_gear_mating(pinion, wheel, efficiency)
    wheel.external_torque = lambda time, angular_position, angular_speed: Torque(load, "Nm")
    wheel.angular_position, wheel.angular_speed = AngularPosition(0, "rad"), AngularSpeed(0, "rad/s")
    Solver(Powertrain(motor)).run(TimeInterval(0.001, "sec"), TimeInterval(1, "sec"))
    return motor.time_variables["angular speed"][-1].to("rad/s").value


print("gearpy", version("gearpy"))
speed = accelerate(1.0)
print(f"speed after 1 s: {speed:.3f} rad/s, with the square of the ratio {1.0 / (J1 + J2 / RATIO**2):.3f}")
assert abs(speed - 1.0 * RATIO / (J1 * RATIO + J2) * RATIO) < 1e-3
work, energy = 1.0 * speed / 2.0, (J1 + J2 / RATIO**2) * speed**2 / 2.0
print(f"work of the motor {work:.2f} J, energy of both inertias {energy:.2f} J")
assert energy > 1.55 * work
driving, driven = accelerate(1.0, efficiency=0.5), accelerate(1e-9, load=-4.0, efficiency=0.5)
print(f"efficiency 0.5: motor drives {driving:.3f} rad/s, load drives with 4 N.m {driven:.3f} rad/s")
assert abs(driving - 0.5 * speed) < 1e-3 and abs(driven - speed) < 1e-3
PYTHON
venv/bin/python run.py
echo "as described"
