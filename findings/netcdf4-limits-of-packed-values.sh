#!/usr/bin/env bash
# Guess: limits of a packed variable (int16 with scale_factor) are kept as they are written, valid_max = 2.0 and 2.5 alike, and
#   netCDF4-python and xarray mask the same samples. Bytes with _Unsigned can be read when a sample is out of range.
# What happens: netCDF4-python stores valid_max = 2.0 as the int16 2, since that loses nothing, and reads it as a packed
#   number: all above 2 * scale_factor is masked. 2.5 stays a double, and is then not applied at all. xarray applies neither
#   of these limits, and shows what netCDF masks as never written. Of unsigned bytes with a sample beyond valid_max,
#   netCDF4-python returns none: TypeError, for the fill value -127 does not fit into uint8.
# Version: netCDF4 1.7.5.1.post1, xarray 2026.9.0, numpy 2, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q netCDF4==1.7.5.1.post1 xarray==2026.9.0

cat > run.py <<'PYTHON'
import warnings

import netCDF4
import numpy as np
import xarray

warnings.simplefilter("ignore")  # a limit that is not applied is told by a warning


def write(name, kind, numbers, **attributes):
    with netCDF4.Dataset(name, "w") as file:
        file.createDimension("n", len(numbers))
        variable = file.createVariable("angle", kind, ("n",))
        for key, value in attributes.items():
            setattr(variable, key, value)
        variable.set_auto_maskandscale(False)
        variable[:] = numbers


def read(name):
    with netCDF4.Dataset(name) as file:
        stored = file["angle"].valid_max if "valid_max" in file["angle"].ncattrs() else None
        values = file["angle"][:]
    with xarray.open_dataset(name) as file:
        others = file["angle"].values
    print(f"{name}: valid_max {stored!r}, netCDF4 {values}, xarray {others}")
    return stored, np.ma.getmaskarray(values).tolist(), others


print("netCDF4", netCDF4.__version__, "xarray", xarray.__version__, "numpy", np.__version__)
numbers = np.array([1, 15, 24, 30], dtype="i2")  # 0.1, 1.5, 2.4 and 3.0
write("whole.nc", "i2", numbers, scale_factor=0.1, valid_max=2.0)
stored, masked, others = read("whole.nc")
assert stored.dtype == np.int16 and masked == [False, True, True, True]
assert np.allclose(others, [0.1, 1.5, 2.4, 3.0])

write("fraction.nc", "i2", numbers, scale_factor=0.1, valid_max=2.5)
stored, masked, others = read("fraction.nc")
assert stored.dtype == np.float64 and masked == [False] * 4
assert np.allclose(others, [0.1, 1.5, 2.4, 3.0])

write("unwritten.nc", "i2", np.array([1, -32767, 3], dtype="i2"), scale_factor=0.1)
_, masked, others = read("unwritten.nc")
assert masked == [False, True, False] and np.allclose(others, [0.1, -3276.7, 0.3])

write("bytes.nc", "i1", np.array([1, 200, 254], "u1").view("i1"), _Unsigned="true", valid_max=np.int8(-6))  # 250
try:
    read("bytes.nc")
except TypeError as error:
    print("bytes.nc:", error)
    assert "fill_value -127" in str(error)
else:
    raise SystemExit("unsigned bytes are read")
PYTHON
venv/bin/python run.py
echo "as described"
