#!/usr/bin/env bash
# Guess: a MuJoCo joint with `frictionloss` of 1 N.m rests under a motor torque of 0.5 N.m, to rounding; it slides above 1 N.m.
# What happens: it slides at once, at a speed that grows with the torque, as under viscous friction: v = 1.0556 ms * torque / inertia
#   with the default solver values, whatever the frictionloss and the time step are (Euler, implicitfast, RK4 alike). A servo with
#   1e-3 kg.m2 turns at 0.53 rad/s under half of its dry friction. `noslip_iterations` brings it to rest; so does an impedance near 1
#   (`solimpfriction`) almost. The sliding friction itself is right: nothing but a joint that should stick shows the fault.
# Version: mujoco 4.0.0, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q mujoco==4.0.0 numpy==2.4.6

cat > run.py <<'PYTHON'
import mujoco

TORQUE = 0.5


def speed_after(seconds, inertia=0.1, friction=1.0, step=0.001, integrator="Euler", joint="", option="", torque=TORQUE):
    """Speed [rad/s] of a body on a hinge, from rest under a constant torque [N.m]."""
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="{step}" integrator="{integrator}" gravity="0 0 0" {option}/>
      <worldbody><body>
        <joint name="axis" type="hinge" axis="0 0 1" frictionloss="{friction}" {joint}/>
        <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
      </body></worldbody>
      <actuator><motor joint="axis"/></actuator>
    </mujoco>""")
    data = mujoco.MjData(model)
    data.ctrl[0] = torque
    while data.time < seconds:
        mujoco.mj_step(model, data)
    return float(data.qvel[0])


print("mujoco", mujoco.__version__)
for integrator in ("Euler", "implicitfast", "RK4"):
    for step in (0.001, 0.01):
        speed = speed_after(5.0, step=step, integrator=integrator)
        print(f"{integrator}, steps of {1e3 * step:.0f} ms: creeps at {speed:.6f} rad/s")
        assert abs(speed - 1.05556e-3 * TORQUE / 0.1) < 1e-6
for friction in (0.6, 1.0, 10.0):
    speed = speed_after(2.0, friction=friction)
    print(f"frictionloss {friction}: {speed:.6f} rad/s")
    assert abs(speed - 1.05556e-3 * TORQUE / 0.1) < 1e-6
speed = speed_after(2.0, inertia=1e-3)
print(f"1e-3 kg.m2: {speed:.4f} rad/s")
assert abs(speed - 0.5278) < 1e-3
sliding = speed_after(1.0, torque=1.5)
print(f"1.5 N.m for 1 s: {sliding:.3f} rad/s, without creep 5.000")
assert abs(sliding - 5.0) < 0.06
stuck = speed_after(2.0, option='noslip_iterations="10"')
stiff = speed_after(2.0, joint='solimpfriction="0.9999 0.9999 0.001"')
print(f"noslip_iterations 10: {stuck:.2e} rad/s, solimpfriction 0.9999: {stiff:.2e} rad/s")
assert abs(stuck) < 1e-6 and 0.0 < stiff < 1e-5
PYTHON
venv/bin/python run.py
echo "as described"
