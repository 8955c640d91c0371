#!/usr/bin/env bash
# Guess: an MF4 file that python-can makes of an older log (BLF, candump) has the time of its first frame as start time and begins at zero,
#   as a recorder writes it; frames of channel 0 get the bus channel 1, as in its BLF and ASC files.
# What happens: the start time is the moment of the conversion, and every stamp is counted from there: in November 2026 a log of 2023 begins at
#   minus 96 million seconds, and a log whose times began at zero at minus 1.8e9 s, where a double has steps of 0.2 us. Dates come out
#   right, but cut(0, 1) of asammdf is empty. The bus channel is 0, so that a DBC for channel 1 finds no frame. python-can
#   reads its own file back as it was. Nothing is said.
# Version: python-can 4.6.1, asammdf 8.8.28, cantools 45.1.0, numpy 2, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q python-can==4.6.1 asammdf==8.8.28 cantools==45.1.0

cat > drive.dbc <<'DBC'
VERSION ""
NS_ :
BS_:
BU_: A
BO_ 291 Drive: 8 A
 SG_ speed : 0|16@1- (0.01,0) [-327|327] "rad/s" A
DBC
cat > run.py <<'PYTHON'
import time

import asammdf
import can
import cantools

FIRST, FRAMES = 1_700_000_000.0, 101
drive = cantools.database.load_file("drive.dbc")
print("python-can", can.__version__, "asammdf", asammdf.__version__)


def convert(begin):
    """Write a log as BLF, convert it to MF4, and return its speed as asammdf decodes it with the DBC for each channel."""
    with can.BLFWriter("old.blf") as writer:
        for k in range(FRAMES):
            data = drive.encode_message("Drive", {"speed": k - 50})
            writer(can.Message(timestamp=begin + 0.01 * k, arbitration_id=291, is_extended_id=False, channel=0, data=data))
    with can.LogReader("old.blf") as reader, can.MF4Writer("new.mf4") as writer:
        for message in reader:
            writer(message)
    with can.LogReader("new.mf4") as reader:
        stamps = [message.timestamp for message in reader]
    assert abs(stamps[0] - begin) < 1e-5 and len(stamps) == FRAMES
    found = {}
    for channel in (0, 1):
        decoded = asammdf.MDF("new.mf4").extract_bus_logging({"CAN": [("drive.dbc", channel)]})
        found[channel] = decoded.get("speed") if "speed" in decoded else None
        if channel == 0:
            left = decoded.cut(start=0.0, stop=1.0)
            rows = len(left.get("speed")) if "speed" in left else 0
    return found, rows


for begin in (FIRST, 0.0):
    found, rows = convert(begin)
    speed = found[0]
    print(f"log from {begin:.0f} s: speed from {speed.timestamps[0]:.2f} s, {len(speed)} samples; cut(0, 1) leaves {rows}; on channel 1: {found[1]}")
    assert len(speed) == FRAMES and list(speed.samples[:2]) == [-50.0, -49.0] and rows == 0 and found[1] is None
    assert abs(speed.timestamps[0] - (begin - time.time())) < 60
PYTHON
venv/bin/python run.py
echo "as described"
