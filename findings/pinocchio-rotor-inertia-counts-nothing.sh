#!/usr/bin/env bash
# Guess: in Pinocchio, `model.rotorInertia` and `model.rotorGearRatio` of a joint add inertia * ratio^2 to its joint-space inertia, and
#   the friction and damping that buildModelFromXML reads from a URDF's <dynamics> brake it.
# What happens: crba, aba and rnea leave all four out, without a word. A geared motor counts by `model.armature` alone, which nobody
#   fills from the rotor's values and no URDF carries. A joint whose rotor is as heavy, seen through its gear, as its link
#   accelerates twice as fast as it should; its friction of 0.5 N.m and damping of 0.3 N.m.s/rad brake nothing.
# Version: pin 4.1.0, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pin==4.1.0 numpy==2.4.6

cat > run.py <<'PYTHON'
import numpy as np
import pinocchio

URDF = """<robot name="joint">
  <link name="base"/>
  <link name="arm"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="axis" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="5" velocity="9"/><dynamics damping="0.3" friction="0.5"/></joint>
</robot>"""


def look(model):
    """Inertia [kg.m2], acceleration by 1 N.m from rest [rad/s2], torque that a steady 1 rad/s takes [N.m]."""
    data, one, zero = model.createData(), np.ones(1), np.zeros(1)
    return (
        float(pinocchio.crba(model, data, zero)[0, 0]),
        float(pinocchio.aba(model, data, zero, zero, one)[0]),
        float(pinocchio.rnea(model, data, zero, one, zero)[0]),
    )


print("pin", pinocchio.__version__)
model = pinocchio.buildModelFromXML(URDF)
print("read from the URDF: damping", model.damping[0], "friction", model.upperDryFrictionLimit[0])
assert model.damping[0] == 0.3 and model.upperDryFrictionLimit[0] == 0.5
plain = look(model)
print("as read: inertia %.3f, acceleration %.3f, torque at 1 rad/s %.3f" % plain)
assert np.allclose(plain, (0.1, 10.0, 0.0))
model.rotorInertia[:], model.rotorGearRatio[:] = 1e-3, 10.0
print("with rotor of 1e-3 kg.m2 behind a ratio of 10: inertia %.3f, acceleration %.3f, torque %.3f" % look(model))
assert look(model) == plain and model.armature[0] == 0.0
model.armature[:] = 1e-3 * 10.0**2
print("with armature 0.1: inertia %.3f, acceleration %.3f, torque %.3f" % look(model))
assert np.allclose(look(model), (0.2, 5.0, 0.0))
PYTHON
venv/bin/python run.py
echo "as described"
