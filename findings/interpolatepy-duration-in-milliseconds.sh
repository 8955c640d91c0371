#!/usr/bin/env bash
# Guess: the position of InterpolatePy's DoubleSTrajectory is the integral of its velocity, and both keep the limits that were set. A short
#   move has a lower speed and goes from its start to its end.
# What happens: the duration is rounded to whole milliseconds, and the second half of the move is counted back from its end. In between,
#   the position jumps by up to 0.5 ms of motion, forwards or backwards: by 0.13 rad at 3000 rpm, which a following drive sees as a
#   speed that nobody allowed. evaluate_velocity() has no jump. A move that needs less than 1 % of the acceleration
#   allowed is planned at full speed: one of 1 mm runs to 353 mm, jumps to -353 mm, and comes to 1 mm. Nothing is said.
# Version: InterpolatePy 3.3.2, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q InterpolatePy==3.3.2 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
from interpolatepy import DoubleSTrajectory, StateParams, TrajectoryBounds


def move(distance, speed, acceleration, jerk):
    """Duration, exact duration, largest jump against the velocity, and the range of the position."""
    trajectory = DoubleSTrajectory(StateParams(0.0, distance, 0.0, 0.0), TrajectoryBounds(speed, acceleration, jerk))
    phases = trajectory.get_phase_durations()
    exact = phases["acceleration"] + phases["constant_velocity"] + phases["deceleration"]
    times = np.linspace(0.0, trajectory.get_duration(), 20001)
    position = np.array([trajectory.evaluate(time) for time in times])
    velocity = np.array([trajectory.evaluate_velocity(time) for time in times])
    assert position[0] == 0.0 and np.isclose(position[-1], distance)
    integral = np.diff(times) * (velocity[1:] + velocity[:-1]) / 2
    beyond = np.diff(position) - integral
    jump = float(beyond[np.argmax(np.abs(beyond))])
    print(f"{distance} at {speed}: {trajectory.get_duration()} s of {exact:.6f} s, jump {jump:.6f}, {position.min():.4f} to {position.max():.4f}")
    return trajectory.get_duration(), exact, jump, position, velocity


print("InterpolatePy", version("InterpolatePy"))
for distance, speed, acceleration, jerk in ((10.0, 5.0, 10.0, 30.0), (7.0, 1.3, 13.0, 130.0), (500.12, 314.0, 3000.0, 1e5)):
    duration, exact, jump, position, velocity = move(distance, speed, acceleration, jerk)
    assert duration == round(exact, 3) and abs(duration - exact) > 1e-4
    assert abs(jump - speed * (exact - duration)) < 0.02 * abs(jump) and velocity.max() < speed + 1e-9
assert abs(jump - 0.127) < 0.002
duration, exact, jump, position, velocity = move(10.0, 5.0, 10.0, 20.0)
assert duration == round(exact, 3) == 3.0 and abs(jump) < 1e-6
_, _, _, position, velocity = move(0.001, 5.0, 1000.0, 1000.0)
assert position.max() > 0.35 and position.min() < -0.35 and velocity.max() > 4.9
PYTHON
venv/bin/python run.py
echo "as described"
