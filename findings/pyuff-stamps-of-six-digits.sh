#!/usr/bin/env bash
# Guess: a record with stamps of its own that is written to a universal file (data set 58, double precision, as text) by pyuff keeps its
#   stamps to the 12 digits that its samples have. write_sets(..., mode="overwrite") replaces the file, in binary form too.
# What happens: the format has 12 digits for a double and 6 for its stamp. From 100 s on, the steps of a record at 10 kHz are 0 or
#   1 ms. Data that are declared evenly spaced get the first step of `x` for all, whatever `abscissa_inc` says: one early sample by
#   1 % makes the record 1 % shorter. In binary form `overwrite` leaves seven bytes, the mark of the end: the file is
#   opened anew for each part, and begins at nothing each time. Nothing is said.
# Version: pyuff 2.5.8, numpy 2.3.5, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pyuff==2.5.8 numpy==2.3.5

cat > run.py <<'PYTHON'
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pyuff


def write(name, times, even, binary, mode):
    """Write an angle over times [s]; return what was handed over."""
    data = pyuff.prepare_58(
        binary=binary, func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, x=times, data=np.sin(times) + 1e3,
        id1="angle", ord_data_type=4, abscissa_spacing=even, abscissa_inc=0.0001, abscissa_min=times[0],
        orddenom_spec_data_type=0,
    )  # fmt: skip
    pyuff.UFF(name).write_sets(data, mode=mode)
    return data


print("pyuff", version("pyuff"))
times = 100.0 + 0.0001 * np.arange(1000)
handed = write("text.uff", times, even=0, binary=0, mode="add")
found = pyuff.UFF("text.uff").read_sets(0)
steps = sorted(set(np.diff(found["x"]).round(6).tolist()))
print("text: steps [s]", steps, "- samples off by", float(np.max(np.abs(found["data"] - handed["data"]))))
assert steps == [0.0, 0.001]
assert np.max(np.abs(found["data"] - handed["data"])) < 1e-8

shifted = times.copy()
shifted[1] -= 0.000001
write("even.uff", shifted, even=1, binary=0, mode="add")
found = pyuff.UFF("even.uff").read_sets(0)["x"]
print("evenly spaced, one stamp early: duration", float(found[-1] - found[0]), "s of", float(times[-1] - times[0]), "s")
assert abs((found[-1] - found[0]) / (times[-1] - times[0]) - 0.99) < 1e-4

write("added.uff", times, even=1, binary=1, mode="add")
write("replaced.uff", times, even=1, binary=1, mode="overwrite")
sizes = {name: Path(name).stat().st_size for name in ("added.uff", "replaced.uff")}
print("binary: bytes", sizes, "- data sets", [pyuff.UFF(name).get_n_sets() for name in sizes])
assert sizes["added.uff"] > 8000 and sizes["replaced.uff"] == 7
PYTHON
venv/bin/python run.py
echo "as described"
