"""One record in the dialects of the field, each with the model file that it needs, if any."""

import math
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

COUNTS = (10_000, 20_000)
RATED = 127.0  # N.m
Columns = Mapping[str, np.ndarray]


def _rows(columns: Columns, spec: str = ".9g") -> list[list[str]]:
    return [[format(value, spec) for value in row] for row in zip(*columns.values(), strict=True)]


def _text(rows: list[list[str]], separator: str, head: list[str], comma: bool = False) -> str:
    lines = [separator.join(row) for row in rows]
    if comma:
        lines = [line.replace(".", ",") for line in lines]
    return "\r\n".join([*head, *lines]) + "\r\n"


def excel_german(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "excel_de.csv"
    head = ["Zeit [s];Drehmoment Soll [Nm];Winkel Motor [rad];Winkel Last [rad]"]
    path.write_bytes(b"\xef\xbb\xbf" + _text(_rows(columns), ";", head, comma=True).encode())
    return path, ""


def excel_english(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "excel_en.csv"
    rows = [[f'"{cell}"' for cell in row] for row in _rows(columns)]
    path.write_bytes(
        _text(rows, ",", ['"Time (s)","Torque command (N.m)","Motor angle (rad)","Load angle (rad)"']).encode()
    )
    return path, ""


def logger(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "logger.txt"
    head = [
        "# DataLogger 3.2",
        "# Machine: press 7",
        "# Channels: 4",
        "",
        "t\tTrq_cmd\tpos_motor\tpos_load",
        "ms\tN.m\tdeg\tdeg",
    ]
    table = dict(columns)
    table["time"] = 1e3 * columns["time"]
    table["theta_m"], table["theta_l"] = np.degrees(columns["theta_m"]), np.degrees(columns["theta_l"])
    path.write_bytes(_text(_rows(table, ".14g"), "\t", head).encode())
    return path, ""


def utf16(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "utf16.csv"
    path.write_bytes(_text(_rows(columns), "\t", ["time\tu\ttheta_m\ttheta_l"]).encode("utf-16"))
    return path, ""


def mdf(folder: Path, columns: Columns) -> tuple[Path, str]:
    import asammdf

    path = folder / "record.mf4"
    units = {"u": "Nm", "theta_m": "rad", "theta_l": "rad"}
    names = {"u": "TorqueRef", "theta_m": "MotorPos", "theta_l": "LoadPos"}
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(columns[name], columns["time"], name=names[name], unit=unit)
                for name, unit in units.items()
            ]
        )
        file.save(path, overwrite=True)
    return path, ""


def parquet(folder: Path, columns: Columns) -> tuple[Path, str]:
    import pyarrow
    import pyarrow.parquet

    path = folder / "record.parquet"
    pyarrow.parquet.write_table(pyarrow.table({name: pyarrow.array(values) for name, values in columns.items()}), path)
    return path, ""


def mat5(folder: Path, columns: Columns) -> tuple[Path, str]:
    import scipy.io

    path = folder / "record5.mat"
    scipy.io.savemat(path, {"log": {"t": columns["time"], **{k: v for k, v in columns.items() if k != "time"}}})
    return path, ""


def mat73(folder: Path, columns: Columns) -> tuple[Path, str]:
    import h5py

    path = folder / "record73.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            data = file.create_dataset(name, data=values[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")
    return path, ""


def counts_and_percent(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "counts.csv"
    lines = ["time,torque_ref [%],enc_motor [counts],enc_load [counts]"]
    for t, u, m, l in zip(*columns.values(), strict=True):
        cells = (round(m * COUNTS[0] / (2.0 * math.pi)), round(l * COUNTS[1] / (2.0 * math.pi)))
        lines.append(f"{t:.6g},{100.0 * u / RATED:.12g},{cells[0]},{cells[1]}")
    path.write_text("\n".join(lines) + "\n")
    model = (
        f"[columns.u]\nrated_value = {RATED}\n[columns.theta_m]\ncounts_per_rev = {COUNTS[0]}\n"
        f"[columns.theta_l]\ncounts_per_rev = {COUNTS[1]}\n"
    )
    return path, model


def rpm(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "rpm.csv"
    step = float(columns["time"][1] - columns["time"][0])
    table = {"time": columns["time"], "u": columns["u"]}
    for name in ("theta_m", "theta_l"):
        table[name] = np.diff(columns[name], prepend=0.0) / step * 60.0 / (2.0 * math.pi)
    path.write_text(_text(_rows(table, ".15g"), ",", ["time,u,n_mot,n_load"]))
    model = '[columns.theta_m]\nname = "n_mot"\nunit = "rpm"\n[columns.theta_l]\nname = "n_load"\nunit = "rpm"\n'
    return path, model


def sample_number(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "samples.csv"
    rate = 1.0 / float(columns["time"][1] - columns["time"][0])
    rows = [[str(n), *row[1:]] for n, row in enumerate(_rows(columns))]
    path.write_text(_text(rows, ";", [f"Sample rate: {rate:g} Hz", "Sample;u;theta_m;theta_l"]))
    return path, ""


def iso_time(folder: Path, columns: Columns) -> tuple[Path, str]:
    path = folder / "iso.csv"
    start = datetime(2026, 3, 29, 0, 59, 55)
    rows = [
        [f"{(start + timedelta(seconds=t)).isoformat(timespec='microseconds')}+01:00", *row[1:]]
        for t, row in zip(columns["time"].tolist(), _rows(columns), strict=True)
    ]
    path.write_text(_text(rows, ",", ["timestamp,u,theta_m,theta_l"]))
    return path, ""


DIALECTS: tuple[Callable[[Path, Columns], tuple[Path, str]], ...] = (
    excel_german, excel_english, logger, utf16, mdf, parquet, mat5, mat73, counts_and_percent, rpm, sample_number,
    iso_time,
)  # fmt: skip
