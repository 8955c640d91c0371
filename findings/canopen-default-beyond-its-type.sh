#!/usr/bin/env bash
# Guess: canopen reads the hexadecimal numbers of a drive's EDS file alike: 0xFF38 of an INTEGER16 is -200, as a default value
#   (DefaultValue) as well as a limit (LowLimit).
# What happens: limits are taken as the two's complement of the type, and default values are not: a torque of -200 per mille is
#   65336, far beyond the limits beside it, and more than its own type can hold. A local node that is asked for the object aborts
#   the transfer with a general error, and writing the default to it raises. With the decimal -200 both work.
# Version: canopen 2.4.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q canopen==2.4.1

cat > run.py <<'PYTHON'
import logging
from importlib.metadata import version
from pathlib import Path

import canopen

logging.disable()  # what a node says when it aborts
EDS = """[OptionalObjects]
SupportedObjects=1
1=0x6071
[6071]
ParameterName=Target torque
ObjectType=0x7
DataType=0x0003
AccessType=rw
LowLimit=0xFC18
HighLimit=0x03E8
DefaultValue={}
"""


def read(default):
    """Return the default value as read, what a node answers and what writing it to the node does."""
    Path("drive.eds").write_text(EDS.format(default))
    ends = canopen.Network(), canopen.Network()
    for end in ends:
        end.connect(interface="virtual", channel="bus")
    drive, master = ends[0].create_node(2, "drive.eds"), ends[1].add_node(2, "drive.eds")
    torque = drive.object_dictionary[0x6071]
    assert (torque.min, torque.max) == (-1000, 1000)
    try:
        answer = master.sdo[0x6071].raw
    except canopen.SdoAbortedError as error:
        answer = str(error)
    try:
        drive.sdo[0x6071].raw = torque.default
        written = True
    except ValueError as error:
        written = str(error)
    for end in ends:
        end.disconnect()
    print("DefaultValue", default, "->", torque.default, "answered:", answer, "written:", written)
    return torque.default, answer, written


print("canopen", version("canopen"), "limits -1000 to 1000, as read")
assert read("-200") == (-200, -200, True)
default, answer, written = read("0xFF38")
assert default == 65336
assert "0x08000000" in answer and "does not fit" in written
PYTHON
venv/bin/python run.py
echo "as described"
