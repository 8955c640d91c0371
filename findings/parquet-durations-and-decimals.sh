#!/usr/bin/env bash
# Guess: a duration that one library writes to Parquet is a duration for the next, and a decimal becomes the nearest double.
# What happens: fastparquet writes a duration as a time of day, and 30 h read by pyarrow are 6 o'clock; the whole number behind
#   it is right, and goes on beyond a day. DuckDB's interval is twelve bytes without a type for pyarrow. A duration of polars is a
#   plain BIGINT of microseconds for DuckDB. pyarrow's cast of a decimal to a double is not correctly rounded: of 20,000 decimals
#   with six digits behind the point three in ten are one unit in the last place off.
# Version: pyarrow 26.0.1, fastparquet 2026.9.0, duckdb 2.0.1, polars 2.1.0, Python 3.11.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q pyarrow==26.0.1 fastparquet==2026.9.0 duckdb==2.0.1 polars==2.1.0

cat > run.py <<'PYTHON'
from decimal import Decimal

import duckdb
import fastparquet
import numpy as np
import pandas
import polars
import pyarrow
import pyarrow.parquet

hours = pandas.DataFrame({"t": pandas.to_timedelta([0, 10, 20, 30], unit="h"), "u": [1.0, 2.0, 3.0, 4.0]})
fastparquet.write("hours.parquet", hours)
times = pyarrow.parquet.read_table("hours.parquet").column("t")
print("fastparquet -> pyarrow:", times.type, [str(time) for time in times.to_pylist()], times.cast("int64").to_pylist())
assert pyarrow.types.is_time(times.type) and times.to_pylist()[3].hour == 6
assert times.cast("int64").to_pylist()[3] == 30 * 3600 * 10**6

duckdb.sql("copy (select n * interval 5 millisecond as t from range(3) r(n)) to 'intervals.parquet' (format parquet)")
kind = pyarrow.parquet.read_schema("intervals.parquet").field("t").type
print("DuckDB interval -> pyarrow:", kind)
assert kind == pyarrow.binary(12)

polars.DataFrame({"t": polars.Series([0, 5000]).cast(polars.Duration("us"))}).write_parquet("steps.parquet")
kind = duckdb.sql("describe select * from 'steps.parquet'").fetchall()[0][1]
print("polars duration -> DuckDB:", kind)
assert kind == "BIGINT"

numbers = np.random.default_rng(0).integers(-(10**9), 10**9, 20_000).tolist()
decimals = [Decimal(number).scaleb(-6) for number in numbers]
cast = pyarrow.array(decimals, pyarrow.decimal128(18, 6)).cast(pyarrow.float64()).to_pylist()
off = [(str(exact), value) for exact, value in zip(decimals, cast) if float(exact) != value]
print(f"decimal -> double, pyarrow {pyarrow.__version__}: {len(off)} of {len(cast)} off, such as {off[0]}")
assert 0.25 * len(cast) < len(off) < 0.35 * len(cast)
assert all(value in (np.nextafter(float(exact), -np.inf), np.nextafter(float(exact), np.inf)) for exact, value in off)
PYTHON
venv/bin/python run.py
echo "as described"
