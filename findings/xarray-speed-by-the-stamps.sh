#!/usr/bin/env bash
# Guess: differentiate("time") of xarray makes a speed per second out of an angle whose times are dates, or per nanosecond; at any
#   rate the same number for the same record. So do integrate() and the slope of polyfit().
# What happens: the unit is the one that the stamps happen to be stored in, which depends on where they come from: 2 rad/s is
#   2e-6 for dates of pandas 3 (microseconds), and 2e-9 after the same record was saved as netCDF and opened again. integrate()
#   has the inverse of it. The slope of polyfit() is per nanosecond whatever the stamps are, so that it agrees with
#   differentiate() for one kind of stamps only. Nothing is said; datetime_unit="s" is right for all.
# Version: xarray 2026.9.0, pandas 3.1.1, netCDF4 1.7.5.1.post1, numpy 2.4.6, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q xarray==2026.9.0 pandas==3.1.1 netCDF4==1.7.5.1.post1 numpy==2.4.6

cat > run.py <<'PYTHON'
from importlib.metadata import version

import numpy as np
import pandas as pd
import xarray as xr

print({name: version(name) for name in ("xarray", "pandas", "netCDF4")})

# An angle that moves at 2 rad/s, each 100 ms.
times = pd.date_range("2026-01-01", periods=11, freq="100ms", name="time")
first = pd.DataFrame({"angle": 0.2 * np.arange(11)}, index=times).to_xarray()
first.to_netcdf("record.nc")
with xr.open_dataset("record.nc") as opened:
    second = opened.load()
assert (first.time.values == second.time.values).all() and first.angle.equals(second.angle)

for record, unit, per_second in [(first, "us", 1e6), (second, "ns", 1e9)]:
    angle = record.angle
    speed = float(angle.differentiate("time")[5])
    area = float(angle.integrate("time"))
    slope = float(angle.polyfit("time", 1).polyfit_coefficients[0])
    right = float(angle.differentiate("time", datetime_unit="s")[5])
    print(f"{angle.time.dtype}: differentiate {speed:.4g}, integrate {area:.4g}, polyfit {slope:.4g}; in seconds {right:.4g}")
    assert angle.time.dtype == f"datetime64[{unit}]"
    assert abs(speed * per_second - 2.0) < 1e-6
    assert abs(area / per_second - 1.0) < 1e-6
    assert abs(slope * 1e9 - 2.0) < 1e-3
    assert abs(right - 2.0) < 1e-9
PYTHON
venv/bin/python run.py
