#!/usr/bin/env bash
# Guess: python-can reads an ASC log that says `timestamps relative`, where each stamp counts from the event before it, into
#   times that go on; or it says that it cannot.
# What happens: the stamps are handed out as they stand: six frames of a cyclic message, 0.01 s apart, all come at 0.01 s, and a
#   speed that is computed from an angle over these times is a division by zero. relative_timestamp=False adds the date of the
#   file's head to each alone. The same log with `timestamps absolute` is right, and what is written from the first one
#   (ASC again, CSV, BLF) has the wrong times as good ones. Nothing is said.
# Version: python-can 4.6.1, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q python-can==4.6.1

cat > run.py <<'PYTHON'
from pathlib import Path

import can

HEAD = """date Mon Sep 30 10:00:00.000 am 2024
base hex  timestamps {}
internal events logged
Begin Triggerblock Mon Sep 30 10:00:00.000 am 2024
   0.000000 Start of measurement
"""


def write(kind, stamps):
    frames = [f"   {stamp:.6f} 1  100             Rx   d 2 {number:02X} 00\n" for number, stamp in enumerate(stamps)]
    Path(f"{kind}.asc").write_text(HEAD.format(kind) + "".join(frames) + "End TriggerBlock\n")


def times(path, **options):
    with can.LogReader(path, **options) as reader:
        return [round(message.timestamp, 6) for message in reader]


write("absolute", [0.01, 0.02, 0.03, 0.04, 0.05, 0.06])
write("relative", [0.01] * 6)
print("python-can", can.__version__)
print("absolute:", times("absolute.asc"))
print("relative:", times("relative.asc"))
assert times("absolute.asc") == [0.01, 0.02, 0.03, 0.04, 0.05, 0.06]
assert times("relative.asc") == [0.01] * 6

dated = times("relative.asc", relative_timestamp=False)
print("relative, with the date:", dated[:2])
assert len(set(dated)) == 1

with can.LogReader("relative.asc") as reader, can.Logger("again.csv") as logger:
    for message in reader:
        logger(message)
assert times("again.csv") == [0.01] * 6
PYTHON
venv/bin/python run.py
echo "as described"
