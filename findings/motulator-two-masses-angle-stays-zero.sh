#!/usr/bin/env bash
# Guess: TwoMassMechanicalSystem of motulator, a motor and a load on a shaft with compliance, has the motor's angle as StiffMechanicalSystem
#   has it: the result holds it, and a control with an encoder (sensorless=False) reaches the same speed on both.
# What happens: the angle is held as exp(j theta), which begins at 0 in place of 1, and so remains 0. The motor turns by 12 rad, and its angle
#   is 0 in every row and for the encoder. The same control that brings the stiff system to 30 rad/s leaves the one with two masses at
#   some other speed. Without an encoder both reach 30 rad/s, so that the angle alone shows the fault. meas_load_position() raises an
#   AttributeError, for it asks for a state that is not there. Nothing is said of the rest.
# Version: motulator 0.5.0, numpy 2.4.6, scipy 1.17.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q motulator==0.5.0 numpy==2.4.6 scipy==1.17.1

cat > run.py <<'PYTHON'
from importlib.metadata import version

import motulator.drive.control.sm as control
import numpy as np
from motulator.drive import model
from motulator.drive.utils import SynchronousMachinePars, TwoMassMechanicalSystemPars

print("motulator", version("motulator"))


def run(mechanics, sensorless):
    """A step of the speed's reference to 30 rad/s; return the mechanics after 0.5 s."""
    machine = SynchronousMachinePars(n_p=3, R_s=3.6, L_d=0.036, L_q=0.051, psi_f=0.545)
    drive = model.Drive(model.VoltageSourceConverter(u_dc=540), model.SynchronousMachine(machine), mechanics)
    limits = control.CurrentReferenceCfg(machine, nom_w_m=2 * np.pi * 75, max_i_s=10)
    law = control.CurrentVectorControl(machine, limits, J=0.015, sensorless=sensorless)
    law.ref.w_m = lambda t: (t > 0.05) * 3 * 30.0  # electrical
    model.Simulation(drive, law).simulate(t_stop=0.5)
    return drive.mechanics


found = {}
for sensorless in (True, False):
    two = TwoMassMechanicalSystemPars(J_M=0.005, J_L=0.01, K_S=700, C_S=0.13)
    for name, mechanics in (
        ("stiff", model.StiffMechanicalSystem(J=0.015)),
        ("two masses", model.TwoMassMechanicalSystem(two)),
    ):
        system = run(mechanics, sensorless)
        speed, angle = system.data.w_M, system.data.theta_M
        turned = float(np.trapezoid(speed, system.data.t))
        found[name, sensorless] = float(speed[-1])
        print(
            f"{name}, {'without' if sensorless else 'with'} encoder: {speed[-1]:.3f} rad/s after {turned:.2f} rad; "
            f"theta_M from {angle.min():.2f} to {angle.max():.2f}, meas_position() {system.meas_position():.2f}"
        )
        if name == "stiff":
            assert angle.max() > 3.0 and angle.min() < -3.0
        else:
            assert not np.any(angle) and system.meas_position() == 0.0
            assert not sensorless or turned > 12.0
try:
    system.meas_load_position()
    raise SystemExit("the load's angle is there")
except AttributeError as error:
    print("meas_load_position():", error)
assert all(abs(found[name, True] - 30.0) < 0.1 for name in ("stiff", "two masses"))
assert abs(found["stiff", False] - 30.0) < 0.1 and abs(found["two masses", False] - 30.0) > 10.0
PYTHON
venv/bin/python run.py
echo "as described"
