#!/usr/bin/env bash
# Guess: a TDMS file is copied by npTDMS by handing the channels that were read to the writer, or their data and properties,
#   and the copy reads as the original does. Counts with a scale in their properties are no exception.
# What happens: the data that are read are scaled, and the properties still hold the scale: a copy of both is scaled twice,
#   which makes -5.05 N.m of -5 N.m. Channels handed over as they are, the way of its documentation, are written as scaled
#   doubles under the type of the counts: 16 bit counts make a file that cannot be read back, 64 bit counts one that reads as
#   numbers of 1e16. The writer says nothing. TdmsWriter.defragment() copies well.
# Version: npTDMS 1.13.0, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q npTDMS==1.13.0 numpy==2.4.6

cat > run.py <<'PYTHON'
import nptdms
import numpy as np
from nptdms import ChannelObject, RootObject, TdmsFile, TdmsWriter

SCALE = {
    "NI_Scaling_Status": "unscaled",
    "NI_Number_Of_Scales": 1,
    "NI_Scale[0]_Scale_Type": "Linear",
    "NI_Scale[0]_Linear_Slope": 0.01,
    "NI_Scale[0]_Linear_Y_Intercept": -5.0,
    "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,  # the counts of the file
}


def write(path, kind):
    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("drive", "torque", np.arange(5, dtype=kind) * 100, SCALE)])
    return TdmsFile.read(path)


print("npTDMS", nptdms.__version__)
first = write("first.tdms", "int16")
channel = first["drive"]["torque"]
print("original:", channel[:].tolist())
assert channel[:].tolist() == [-5, -4, -3, -2, -1]

with TdmsWriter("second.tdms") as writer:
    writer.write_segment([ChannelObject("drive", "torque", channel[:], channel.properties)])
twice = TdmsFile.read("second.tdms")["drive"]["torque"][:]
print("data and properties:", twice.round(4).tolist())
assert np.allclose(twice, [-5.05, -5.04, -5.03, -5.02, -5.01])


def copy(original, path):  # as the documentation copies a file
    channels = [channel for group in original.groups() for channel in group.channels()]
    with TdmsWriter(path) as writer:
        writer.write_segment([RootObject(original.properties), *original.groups(), *channels])


copy(first, "third.tdms")
try:
    TdmsFile.read("third.tdms")
    raise SystemExit("the copy of 16 bit counts can be read")
except ValueError as error:
    print("channels of 16 bit:", str(error)[:60])

copy(write("wide.tdms", "int64"), "fourth.tdms")
wide = TdmsFile.read("fourth.tdms")["drive"]["torque"][:]
print("channels of 64 bit:", wide[:2].tolist())
assert np.all(np.abs(wide) > 1e15)

TdmsWriter.defragment("first.tdms", "fifth.tdms")
assert TdmsFile.read("fifth.tdms")["drive"]["torque"][:].tolist() == channel[:].tolist()
PYTHON
venv/bin/python run.py
echo "as described"
