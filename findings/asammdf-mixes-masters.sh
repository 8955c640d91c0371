#!/usr/bin/env bash
# Guess: groups of an MDF file whose master is an angle or an index are kept apart from those over time: a table of all
#   channels is refused or has an index for each kind, and cutting from 0.2 s to 0.5 s leaves what is not over time alone.
# What happens: asammdf takes every master as the same axis. to_dataframe() puts seconds, degrees and row numbers into one
#   index, called timestamps, and interpolates across them; cut(0.2, 0.5) also cuts from 0.2 to 0.5 degrees, which leaves two
#   samples that no row of the file has; resample(0.01) gives all three groups the same 35,641 stamps, up to 356.4. Nothing
#   is said, and the groups keep their kinds.
# Version: asammdf 8.8.28, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q asammdf==8.8.28

cat > run.py <<'PYTHON'
import asammdf
import numpy as np

time = np.arange(100) / 100.0
with asammdf.MDF(version="4.10") as file:
    file.append([asammdf.Signal(np.sin(time), time, name="torque", unit="Nm")])
    file.append([asammdf.Signal(np.cos(time), 3.6 * np.arange(100), name="pressure", unit="bar", master_metadata=("crank", 2))])
    file.append([asammdf.Signal(np.cos(time), np.arange(100.0), name="level", unit="mm", master_metadata=("row", 4))])
    file.save("log.mf4", overwrite=True)

file = asammdf.MDF("log.mf4")
names = ("torque", "pressure", "level")
kinds = [group.channels[file.masters_db[n]].sync_type for n, group in enumerate(file.groups)]
print("asammdf", asammdf.__version__, "kinds of masters (1 time, 2 angle, 4 index):", kinds)
assert kinds == [1, 2, 4]

table = file.to_dataframe()
print("one table:", table.shape, table.index.name, table.index.min(), "to", table.index.max())
assert table.shape == (293, 3) and table.index.name == "timestamps"
assert table.index.max() > 356.0 and not table.isna().any().any()

cut = file.cut(0.2, 0.5)
print("cut(0.2, 0.5):", {name: cut.get(name).timestamps[[0, -1]].tolist() for name in names})
assert [cut.get(name).samples.size for name in names] == [31, 2, 2]

even = file.resample(0.01)
print("resample(0.01):", {name: (even.get(name).samples.size, float(even.get(name).timestamps[-1])) for name in names})
assert [even.get(name).samples.size for name in names] == [35641] * 3
assert [group.channels[even.masters_db[n]].sync_type for n, group in enumerate(even.groups)] == [1, 2, 4]
PYTHON
venv/bin/python run.py
echo "as described"
