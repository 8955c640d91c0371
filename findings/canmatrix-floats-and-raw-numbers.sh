#!/usr/bin/env bash
# Guess: canmatrix writes a float signal of a DBC file into a SYM file as float, or says that it cannot. Frame.encode() turns
#   what Frame.decode() calls physical values back into the same bytes.
# What happens: a float is written as `signed`, for every float of a DBC file is signed as well: the speed 1.5 rad/s is read
#   back as 1069547520. encode() takes numbers for raw ones and cuts them down to whole ones, but takes texts for physical ones:
#   a torque of 23.7 N.m at 0.1 N.m a bit is sent as 23 bits, which is 2.3 N.m, and "23.7" as 237 bits. Nothing is said.
# Version: canmatrix 1.2, cantools 45.1.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q canmatrix==1.2 cantools==45.1.0

cat > drive.dbc <<'DBC'
VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Drive: 8 ECU
 SG_ torque : 0|16@1- (0.1,0) [-3000|3000] "Nm" ECU
 SG_ speed : 16|32@1- (1,0) [0|0] "rad/s" ECU
SIG_VALTYPE_ 256 speed : 1;
DBC

cat > run.py <<'PYTHON'
import importlib.metadata
import struct

import canmatrix.formats
import cantools

data = struct.pack("<hfxx", 237, 1.5)
peer = cantools.database.load_file("drive.dbc").messages[0]
matrix = canmatrix.formats.loadp("drive.dbc")[""]
frame = matrix.frames[0]
read = {name: float(value.phys_value) for name, value in frame.decode(data).items()}
print("canmatrix", importlib.metadata.version("canmatrix"), "DBC:", read, "cantools:", peer.decode(data))
assert read == {"torque": 23.7, "speed": 1.5}

canmatrix.formats.dumpp({"": matrix}, "drive.sym")
print(*(line for line in open("drive.sym", encoding="utf-8").read().splitlines() if line.startswith("Var=speed")))
other = canmatrix.formats.loadp("drive.sym")[""].frames[0]
speed = float(other.decode(data)["speed"].phys_value)
print("speed by way of SYM:", speed)
assert speed == 1069547520.0

sent = {text: struct.unpack_from("<h", frame.encode({"torque": text}))[0] for text in (23.7, "23.7")}
print("bits of the torque:", sent, "cantools:", struct.unpack_from("<h", peer.encode(read))[0])
assert sent == {23.7: 23, "23.7": 237}
assert peer.encode(read)[:2] == data[:2]
PYTHON
venv/bin/python run.py 2>/dev/null
echo "as described"
