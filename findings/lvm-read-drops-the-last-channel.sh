#!/usr/bin/env bash
# Guess: lvm_read gives every column of a LabVIEW measurement file (.lvm), for each of its three layouts (`X_Columns` No, One, Multi).
# What happens: a segment of N channels has N + 1 columns for lvm_read, whatever the layout is. With `Multi`, where each channel has a column
#   of times of its own, the two channels of a drive come back as times, torque, times: the angle is not there, and its
#   times look like a channel. With `No` there is no time, and X0 and Delta_X are left to the reader. Nothing is said.
# Version: lvm_read 1.26, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q lvm_read==1.26 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version

import lvm_read

HEAD = [
    "LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab", "Decimal_Separator\t.",
    "Multi_Headings\tNo", "X_Columns\t{layout}", "Time_Pref\tRelative", "Date\t2024/01/02", "Time\t10:00:00.0",
    "***End_of_Header***", "",
]  # fmt: skip
ROWS = {
    "No": ("{0}\t{1}", [("", k, 10 * k) for k in range(4)]),
    "One": ("{0}\t{1}", [(0.1 * k, k, 10 * k) for k in range(4)]),
    "Multi": ("{0}\t\t{1}", [(0.1 * k, k, 0.2 * k, 10 * k) for k in range(4)]),
}
NAMES = {"No": "X_Value\tu\ttheta", "One": "X_Value\tu\ttheta", "Multi": "X_Value\tu\tX_Value\ttheta"}

print("lvm_read", version("lvm_read"))
for layout, (pair, rows) in ROWS.items():
    segment = ["Channels\t2"]
    for name, values in {"Samples": (4, 4), "X_Dimension": ("Time", "Time"), "X0": (0, 0), "Delta_X": (0.1, 0.2)}.items():
        segment.append(f"{name}\t" + pair.format(*values))
    segment += ["***End_of_Header***", NAMES[layout] + "\tComment"]
    lines = [line.format(layout=layout) for line in HEAD] + segment
    lines += ["\t".join(str(value) if value == "" else f"{value:.6f}" for value in row) for row in rows]
    with open("drive.lvm", "w", newline="") as file:
        file.write("\r\n".join(lines) + "\r\n")
    found = lvm_read.read("drive.lvm", read_from_pickle=False, dump_file=False)[0]
    print(layout, found["Channel names"], "last row", found["data"][-1].tolist())
    assert ("theta" in found["Channel names"]) == (layout != "Multi")
    assert (30.0 in found["data"][-1]) == (layout != "Multi")
PYTHON
venv/bin/python run.py
echo "as described"
