"""Files that no command can use: exit code 2 and one line that says how to mend them."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from tests.support.independent_plant import make_record

Table = dict[str, np.ndarray]
Make = Callable[[Path, Table], object]
NAME = "data.csv"


@pytest.fixture(scope="module")
def table() -> Table:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def _csv(columns: Table, head: str | None = None, separator: str = ",", spec: str = ".9g") -> str:
    rows = [separator.join(format(v, spec) for v in row) for row in zip(*columns.values(), strict=True)]
    return "\n".join([separator.join(columns) if head is None else head, *rows]) + "\n"


def _text(change: Callable[[str], str]) -> Make:
    return lambda path, table: path.write_text(change(_csv(table)), encoding="utf-8")


def _columns(change: Callable[[Table], Table], head: str | None = None) -> Make:
    return lambda path, table: path.write_text(_csv(change(dict(table)), head), encoding="utf-8")


def _bytes(data: bytes) -> Make:
    return lambda path, _: path.write_bytes(data)


def _cell(row: int, column: int, text: str) -> Make:
    def change(whole: str) -> str:
        lines = whole.split("\n")
        cells = lines[row].split(",")
        cells[column] = text
        lines[row] = ",".join(cells)
        return "\n".join(lines)

    return _text(change)


def _head(head: str) -> Make:
    return _text(lambda whole: head + whole[whole.index("\n") :])


def _zip(path: Path, _: Table) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data.csv", "time,u\n")


def _workbook(path: Path, _: Table) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")


def _archive_of(entry: str) -> Make:
    def make(path: Path, _: Table) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(entry, "<root/>")

    return make


def _pickle(path: Path, _: Table) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    path.write_bytes(buffer.getvalue())


def _claims(path: Path, table: Table) -> None:
    np.save(path.with_suffix(".npy"), table["time"])
    path.write_bytes(path.with_suffix(".npy").read_bytes().replace(b"(800,)", b"(9999999999,)"[:6].ljust(6)))


def _short_mat(path: Path, table: Table) -> None:
    import scipy.io

    scipy.io.savemat(path.with_suffix(".mat"), table)
    path.write_bytes(path.with_suffix(".mat").read_bytes()[:3000])


def _mat_without(path: Path, _: Table) -> None:
    import scipy.io

    scipy.io.savemat(path.with_suffix(".mat"), {"note": "nothing here"})
    path.write_bytes(path.with_suffix(".mat").read_bytes())


def _mat_lengths(path: Path, table: Table) -> None:
    import scipy.io

    scipy.io.savemat(path.with_suffix(".mat"), table | {"u": table["u"][:700]})
    path.write_bytes(path.with_suffix(".mat").read_bytes())


def _jitter(t: Table) -> Table:
    """Return stamps that may be nearer to another row's time: below half a step they would be taken as jitter."""
    rng = np.random.default_rng(0)
    return t | {"time": np.sort(t["time"] + 0.004 * rng.uniform(-1.0, 1.0, t["time"].size))}


def _hold(t: Table, name: str, rows: slice) -> Table:
    values = t[name].copy()
    values[rows] = values[rows.start or 0]
    return t | {name: values}


def _without(t: Table, name: str) -> Table:
    return {key: values for key, values in t.items() if key != name}


# Each: how the file is made, the model file beside it, what the line must name, and the cure that it must offer.
UNUSABLE: dict[str, tuple[Make, str, str, str]] = {
    "absent": (lambda path, _: None, "", "cannot be read", "No such file"),
    "directory": (lambda path, _: path.mkdir(), "", "this is a directory", "must be a file"),
    "empty": (_bytes(b""), "", "file is empty", "must have a header and rows"),
    "blank": (_bytes(b"\n\n  \n"), "", "file is empty", "must have a header and rows"),
    "gzip": (_bytes(b"\x1f\x8b\x08" + bytes(20)), "", "compressed (gzip)", "unpack it first"),
    "zip": (_zip, "", "zip archive", "unpack it first"),
    "FMU": (_archive_of("modelDescription.xml"), "", "is an FMU", "`inspect FILE.fmu` with the option"),
    "SSP": (_archive_of("SystemStructure.ssd"), "", "is an SSP file", "`inspect FILE.ssp` with the option"),
    "workbook": (_workbook, "", "Excel workbook", "save the sheet as CSV"),
    "old workbook": (_bytes(b"\xd0\xcf\x11\xe0" + bytes(20)), "", "Excel workbook", "save the sheet as CSV"),
    "tdms": (_bytes(b"TDSm" + bytes(40)), "", "TDMS", "export it as CSV"),
    "binary": (_bytes(bytes(range(256)) * 4), "", "another binary format", "export it as CSV"),
    "pickle": (_pickle, "", "must be a NumPy file of plain numbers", "plain numbers"),
    "claims more": (_claims, "", "must be a NumPy file", "plain numbers"),
    "cut MAT": (_short_mat, "", "must be a whole MAT file", "whole MAT file"),
    "MAT without vectors": (_mat_without, "", "must hold vectors of numbers", "save arrays"),
    "MAT of two lengths": (_mat_lengths, "", "`u` must have as many rows", "name channels of one raster"),
    "broken MDF": (_bytes(b"MDF     4.10    " + bytes(300)), "", "must be a whole MDF file", "whole MDF file"),
    "broken Parquet": (_bytes(b"PAR1" + bytes(60)), "", "must be a whole Parquet file", "whole Parquet file"),
    "broken HDF5": (_bytes(b"\x89HDF\r\n\x1a\n" + bytes(90)), "", "must be a whole HDF5 file", "whole HDF5 file"),
    "prose": (_bytes(b"Dear colleague,\nhere is the data.\n"), "", "no rows of numbers", "columns of numbers"),
    "no names": (_text(lambda s: s[s.index("\n") + 1 :]), "", "has no names", '[columns.time] name = "#1"'),
    "semicolon head": (_head("time;u;theta_m;theta_l"), "", "must have 4 names", "like the rows below it"),
    "unknown names": (_head("a,b,c,d"), "", "column `time` must be there", '[columns.time] name = "..."'),
    "no torque": (
        _columns(lambda t: _without(_without(t, "u"), "theta_l")), "", "column `u` must", '[columns.u] name = "..."',
    ),
    "two torques": (_head("time,torque 1,theta_m,torque 2"), "", "both look like", '[columns.u] name = "torque 1"'),
    "twice": (_head("time,u,theta_m,theta_m"), "", "must appear once", '[columns.theta_m] name = "#3"'),
    "named, not there": (_text(str), '[columns.u]\nname = "trq"\n', "column `trq`", "there is `time,u,theta_m"),
    "volts": (_head("time,u [V],theta_m,theta_l"), "", "is in volts", "[columns.u] resistance = ..."),
    "percent": (_head("time,u [%],theta_m,theta_l"), "", "is in percent", "[columns.u] rated_value = ..."),
    "amperes": (_head("time,u [A],theta_m,theta_l"), "", "is in amperes", "[columns.u] torque_constant = ..."),
    "counts": (_head("time,u,theta_m [counts],theta_l"), "", "is in counts", "counts_per_rev = ..."),
    "sample number": (_head("sample,u,theta_m,theta_l"), "", "is a sample number", "[columns.time] rate = ..."),
    "word in a cell": (_cell(40, 1, "off"), "", "row 40, column `u`", "must be a number, but is `off`"),
    "thousands": (_cell(40, 1, '"1.234,5"'), "", "row 40, column `u`", "without thousands separators"),
    "decimal comma": (_text(lambda s: s.replace(".", ",")), "", "", "`;`"),
    "cut row": (_cell(40, 1, "3\n0"), "", "row 40 must have 4 fields", "delete it"),
    "short and long row": (
        _text(lambda s: s.replace("\n0.1,", "\n0.1;", 1).replace("\n0.2,", "\n0.2,0,", 1)), "", "4 fields", "delete"
    ),
    "infinite": (_cell(40, 2, "-inf"), "", "row 40, column `theta_m`", "mend or empty the cell"),
    "short": (_text(lambda s: "\n".join(s.split("\n")[:150])), "", "200 rows, but has 149", "log a longer run"),
    "time goes back": (_cell(300, 0, "0.1"), "", "row 300, column `time` must increase", "part` START:END"),
    "milliseconds": (_columns(lambda t: t | {"time": 1e3 * t["time"]}), "", "looks like milliseconds", 'unit = "ms"'),
    "half lost": (
        _text(lambda s: "\n".join(s.split("\n")[:300] + s.split("\n")[600:])), "", "of its rows missing", "part`"
    ),
    "all zero torque": (
        _columns(lambda t: t | {"u": 0.0 * t["u"]}), "", "is 0 in all 800 rows", '[columns.u] name = "..."'
    ),
    "stuck encoder": (_columns(lambda t: _hold(t, "theta_l", slice(200, 700))), "", "encoder is", "part`"),
    "wrapping angle": (
        _columns(lambda t: t | {"theta_m": np.degrees(t["theta_m"]) % 360.0}), "", "jumps by", "modulo = 360"
    ),
    "degrees": (
        _columns(lambda t: t | {"theta_l": np.degrees(t["theta_l"])}), "", "seems to be in degrees", 'unit = "deg"'
    ),
    "wrong sign": (_columns(lambda t: t | {"u": -t["u"]}), "", "sign of `u`", "factor = -1"),
    "exchanged": (
        _columns(lambda t: t | {"theta_m": t["theta_l"], "theta_l": t["theta_m"]}), "", "exchanged", "name ="
    ),
    "5 for 5 %": (
        _text(str), "[parameters.J_l]\nrelative_uncertainty = 5\n", "must be a share below 1", "5 % is 0.05"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", UNUSABLE)
def test_an_unusable_file_is_one_line_that_names_the_cure(
    name: str, table: Table, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, model, complaint, cure = UNUSABLE[name]
    path = tmp_path / NAME
    make(path, table)
    words = ["estimate", str(path), "--out", str(tmp_path / "out")]
    if model:
        (tmp_path / "model.toml").write_text(model)
        words += ["--model", str(tmp_path / "model.toml")]
    assert _status(words) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert complaint in told.err
    assert cure in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda path: None, "cannot be read: No such file"),
        (lambda path: path.mkdir(), "must be a file"),
        (lambda path: path.write_bytes(b"%PDF-1.4\n1 0 obj\n"), "is a PDF: export the data as CSV"),
    ],
)
@pytest.mark.parametrize("option", [[], ["--columns"]])
def test_inspect_drafts_no_model_file_of_what_is_no_log(
    make: Callable[[Path], object], complaint: str, option: list[str], tmp_path: Path, capsys
) -> None:
    make(tmp_path / NAME)
    assert _status(["inspect", str(tmp_path / NAME), "--out", str(tmp_path / "out"), *option]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert complaint in told.err
    assert "blanks" not in told.err
    assert told.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def _status(words: list[str]) -> int:
    try:
        return main(words)
    except SystemExit as ending:
        return int(ending.code or 0)


def test_there_are_forty() -> None:
    assert len(UNUSABLE) >= 40
