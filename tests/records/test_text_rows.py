"""Texts whose rows are not all whole, whose numbers are written oddly, or whose times stand above them."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.record import Column, Reading, Record, read_record
from tests.support.independent_plant import make_record

HEAD = "time,u,theta_m,theta_l"


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=5, duration=4.0)[0]


@pytest.fixture(scope="module")
def rows(columns: dict[str, np.ndarray]) -> list[str]:
    return [",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)]


def _read(path: Path, lines: list[str], given: dict[str, Column] | None = None, **how: object) -> Record:
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_record(path, given, (), Reading(**how))  # type: ignore[arg-type]


REMARKS = (
    "overrun",
    "*** buffer overrun (3) ***",
    "# 12:00:01 operator: press start",
    "Marker,start",
    "2026-01-02 08:00:00 reconnected",
    "-- pause --",
    HEAD,
    "overrun,,,",
    '"lost packet, retry"',
)


@pytest.mark.parametrize("remark", REMARKS)
def test_a_remark_among_the_rows_is_left_out_with_a_note(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], remark: str
) -> None:
    record = _read(tmp_path / "log.csv", [HEAD, *rows[:700], remark, *rows[700:]])
    assert f"line 702 `{remark[:40]}` is no row and is left out" in record.notes[0]
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-7)
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-9)


@pytest.mark.parametrize("separator", ["\t", ";", " "])
def test_a_remark_in_other_dialects(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], separator: str
) -> None:
    lines = [line.replace(",", separator) for line in (HEAD, *rows)]
    lines.insert(650, "overrun at sample 649")
    record = _read(tmp_path / "log.txt", lines)
    assert "line 651 `overrun at sample 649` is no row" in record.notes[0]
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-7)


SUMMARIES = (
    ["Mean,1.5,0.3,0.2"],
    ["", "Min,-13,-2,-1", "Max,13,2,1"],
    ["Samples,800"],
    ["Total: 800 rows"],
    ["END"],
    ["---", "average u = 0.25", "average theta = 3"],
)


@pytest.mark.parametrize("summary", SUMMARIES)
def test_a_summary_below_the_rows_is_left_out_with_a_note(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], summary: list[str]
) -> None:
    record = _read(tmp_path / "log.csv", [HEAD, *rows, *summary])
    filled = [line for line in summary if line]
    assert f"`{filled[0][:40]}`" in record.notes[0]
    assert record.notes[0].endswith("left out")
    assert record.size == columns["time"].size
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-7)


def test_rows_without_a_time_are_left_out_with_a_note(tmp_path: Path, rows: list[str]) -> None:
    record = _read(tmp_path / "log.csv", [HEAD, *rows, ",0.5,1.0,0.25"])
    assert record.size == len(rows)
    assert "1 row without a time left out" in record.notes


def test_a_part_counts_rows_as_the_whole_does(tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str]) -> None:
    lines = [HEAD, *rows[:100], "overrun", *rows[100:]]
    record = _read(tmp_path / "log.csv", lines, part=(1.0, 3.0))
    np.testing.assert_allclose(record.u, columns["u"][200:601], atol=1e-7)


def test_what_stands_outside_the_part_is_not_looked_at(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str]
) -> None:
    bad = [*rows[:20], rows[20].rpartition(",")[0], *rows[21:700], rows[700].replace(",", ",off", 1), *rows[701:]]
    record = _read(tmp_path / "log.csv", [HEAD, *bad], part=(1.0, 3.0))
    np.testing.assert_allclose(record.u, columns["u"][200:601], atol=1e-7)
    with pytest.raises(RecordError, match="row 21 must have 4 fields"):
        read_record(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ("3.5,off,1,1", "row 701, column `u` must be a number, but is `off`: mend or empty the cell"),
        ("bad,1,2,3", "row 701, column `time` must be a number, but is `bad`: mend or empty the cell"),
        ("3.5,1,2", "row 701 must have 4 fields like the header, but has 3: the row is cut off; delete it"),
        ("3.5,1,2,3,4", "row 701 must have 4 fields like the header, but has 5: mend or delete it"),
        ("Marker,3.5,1", "row 701 must have 4 fields like the header, but has 3"),
    ],
)
def test_a_row_that_holds_values_is_refused_and_the_cure_works(
    tmp_path: Path, rows: list[str], bad: str, said: str
) -> None:
    path = tmp_path / "log.csv"
    with pytest.raises(RecordError, match=said):
        _read(path, [HEAD, *rows[:700], bad, *rows[700:]])
    mended = bad.replace("off", "").replace("bad", "") if "cell" in said else None
    record = _read(path, [HEAD, *rows[:700], *([mended] if mended else []), *rows[700 + (mended is not None) :]])
    assert record.size == len(rows)


def test_a_remark_is_refused_where_the_time_is_made_of_rows(tmp_path: Path, rows: list[str]) -> None:
    lines = ["u,theta_m,theta_l", *(row.partition(",")[2] for row in rows)]
    given = {"time": Column(rate=200.0)}
    assert _read(tmp_path / "log.csv", [*lines, "END"], given).size == len(rows)
    with pytest.raises(RecordError, match=r"line 301 `overrun` is no row .* nobody knows whether samples are lost"):
        _read(tmp_path / "log.csv", [*lines[:300], "overrun", *lines[300:]], given)


NOTHING = (
    "-nan(ind)",
    "nan(snan)",
    "1.#QNAN",
    "-1.#IND",
    "1.#IND00",
    "-1.#QNAN0",
    "1.#SNAN",
    "-nan",
    "NaN",
    "N/A",
    "nan(0x8000)",
)


@pytest.mark.parametrize("cell", NOTHING)
def test_what_c_libraries_print_for_no_number_is_missing(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], cell: str
) -> None:
    fields = rows[500].split(",")
    for bad, sep in ((",".join([*fields[:2], cell, fields[3]]), ","), (";".join([*fields[:2], cell, fields[3]]), ";")):
        lines = [row.replace(",", sep) for row in (HEAD, *rows)]
        lines[501] = bad
        if sep == ";":
            lines = [line.replace(".", ",") for line in lines]
        record = _read(tmp_path / "log.csv", lines)
        assert np.flatnonzero(record.is_missing).tolist() == [500]
        np.testing.assert_allclose(np.delete(record.theta_m, 500), np.delete(columns["theta_m"], 500), atol=1e-7)


@pytest.mark.parametrize("cell", ["1.#INF", "-1.#INF00", "inf", "-Infinity"])
def test_what_c_libraries_print_for_infinity_is_infinite(tmp_path: Path, rows: list[str], cell: str) -> None:
    fields = rows[500].split(",")
    with pytest.raises(RecordError, match=r"row 501, column `u` must be a finite number, but is -?inf: mend or empty"):
        _read(tmp_path / "log.csv", [HEAD, *rows[:500], ",".join([fields[0], cell, *fields[2:]]), *rows[501:]])


@pytest.mark.parametrize("sign", ["\u2212", "\u2013", "\u2010", "\u2011"])
@pytest.mark.parametrize("comma", [False, True])
def test_typographic_signs_are_minus_signs(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], sign: str, comma: bool
) -> None:
    lines = [HEAD, *rows]
    if comma:
        lines = [line.replace(",", ";").replace(".", ",") for line in lines]
    record = _read(tmp_path / "log.csv", [line.replace("-", sign) for line in lines])
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-7)
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-7)


@pytest.mark.parametrize(
    "line",
    ["Sampling interval: 5 ms", "Sample Interval;0.005;s", "Sampling period [ms]: 5", "Abtastintervall = 5,0 ms",
     "dt = 0.005 s", "Sample time (us): 5000", "Delta_X\t0.005", "Zykluszeit: 5 ms", "Sample rate: 0.2 kHz"],
)  # fmt: skip
def test_the_interval_of_samples_above_the_names(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], line: str
) -> None:
    lines = [line, "u;theta_m;theta_l", *(row.partition(",")[2].replace(",", ";") for row in rows)]
    record = _read(tmp_path / "log.csv", lines)
    assert "time from the row and 200 Hz" in record.notes[1]
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-9)
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-7)


@pytest.mark.parametrize(
    "line", ["Sampling interval: 5", "Sampling interval: 5 ms\nSample rate: 100 Hz", "Sampling interval: -5 ms",
             "Sampling points: 800", "Measurement time: 4 s"],
)  # fmt: skip
def test_what_states_no_interval_is_not_taken_for_one(tmp_path: Path, rows: list[str], line: str) -> None:
    lines = [line, "u;theta_m;theta_l", *(row.partition(",")[2].replace(",", ";") for row in rows)]
    with pytest.raises(RecordError, match=r"column `time` must be there .* or `rate = ...` \[Hz\]"):
        _read(tmp_path / "log.csv", lines)
    assert _read(tmp_path / "log.csv", lines, {"time": Column(rate=200.0)}).step == pytest.approx(0.005)


def test_milliseconds_in_a_column_of_their_own(tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str]) -> None:
    lines = ["Date and time;ms;u;theta_m;theta_l"]
    for t, row in zip(columns["time"].tolist(), rows, strict=True):
        second, count = divmod(round(1e3 * t), 1000)
        lines.append(f"31.12.2025 23:59:{58 + second}" if second < 2 else f"01.01.2026 00:00:{second - 2:02d}")
        lines[-1] += f";{count};" + row.partition(",")[2].replace(",", ";")
    record = _read(tmp_path / "log.csv", lines)
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-6)
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-7)
    part = read_record(tmp_path / "log.csv", None, (), Reading(part=(1.0, 3.0)))
    np.testing.assert_allclose(part.u, columns["u"][200:601], atol=1e-7)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_blocks_of_any_encoding_make_one_table(
    tmp_path: Path,
    columns: dict[str, np.ndarray],
    rows: list[str],
    encoding: str,
    end: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("orchestrator.records.formats.text_file.BLOCK", 999)
    path = tmp_path / "log.csv"
    path.write_bytes(end.join(["Prüfstand", HEAD, *rows]).encode(encoding))
    record = read_record(path)
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-7)
    assert record.size == len(rows)


def test_a_byte_of_another_encoding_far_down_is_found(tmp_path: Path, rows: list[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("\n".join([HEAD + ",Größe", *(row + ",a" for row in rows)]).encode() + b"\xe4")
    assert "Windows-1252" in read_record(path).notes[0]
    data = "\n".join([HEAD, *rows]).encode("utf-16")
    path.write_bytes(data[:-1])
    with pytest.raises(RecordError, match=f"must be text, but byte {len(data) - 2} is no utf-16: save it as UTF-8"):
        read_record(path)


def test_a_text_is_not_held_in_memory(tmp_path: Path) -> None:
    size = 200_000
    time = np.arange(size) / 5000.0
    path = tmp_path / "log.csv"
    with path.open("w") as file:
        file.write(HEAD + "\n")
        file.writelines(f"{t:.4f},{np.sin(t):.6f},{t * t:.7f},{t:.7f}\n" for t in time.tolist())
    tracemalloc.start()
    try:
        with open_source(path) as source:
            found = source.load(range(4))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(found[2], time * time, atol=1e-6)
    assert peak < 4 * 8 * size + 5_000_000  # the arrays, and a few blocks


def test_inspect_prints_what_was_left_out(tmp_path: Path, rows: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEAD, *rows[:700], "overrun", *rows[700:]]) + "\n")
    assert main(["inspect", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "`overrun` is no row and is left out" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("kind", ["epoch, microseconds", "epoch, milliseconds", "seconds", "clock", "date"])
def test_fractions_without_leading_zeros_are_refused_and_the_cure_works(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str], kind: str
) -> None:
    lines = []
    for n, row in enumerate(rows):
        second, count = divmod(5 * n, 1000)
        stamp = {
            "epoch, microseconds": f"{1_700_000_000 + second}.{1000 * count}",
            "epoch, milliseconds": f"{1_700_000_000 + second}.{count}",
            "seconds": f"{second}.{count}",
            "clock": f"08:59:{57 + second}.{count}" if second < 3 else f"09:00:{second - 3:02d}.{count}",
            "date": f"2026-01-02 08:59:{50 + second}.{count}",
        }[kind]
        lines.append(stamp + "," + row.partition(",")[2])
    with pytest.raises(
        RecordError, match=r"goes back .* without leading zeros .* or say `\[columns.time\] rate = ...`"
    ):
        _read(tmp_path / "log.csv", [HEAD, *lines])
    record = read_record(tmp_path / "log.csv", {"time": Column(rate=200.0)})
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-9)
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-7)


def test_two_runs_have_fractions_with_zeros(tmp_path: Path, rows: list[str]) -> None:
    with pytest.raises(
        RecordError, match=r"goes back .* sort the rows by time, delete repeats, or keep one run by `part`"
    ):
        _read(tmp_path / "log.csv", [HEAD, *rows, *rows])
    assert read_record(tmp_path / "log.csv", None, (), Reading(part=(0.0, 10.0))).size == len(rows)


def test_a_torque_without_dimension_asks_for_what_one_is(
    tmp_path: Path, columns: dict[str, np.ndarray], rows: list[str]
) -> None:
    lines = ["time,u [-],theta_m,theta_l", *rows]
    with pytest.raises(RecordError, match=r"column `u \[-\]` has no dimension: say .* rated_value .*, or .* unit = "):
        _read(tmp_path / "log.csv", lines)
    for given, factor in ((Column(rated_value=20.0), 20.0), (Column(unit="mN.m"), 1e-3)):
        record = read_record(tmp_path / "log.csv", {"u": given})
        np.testing.assert_allclose(record.u, factor * columns["u"], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("fraction", [".", ","])
def test_a_date_between_tabs_is_no_column_more(fraction: str, tmp_path: Path) -> None:
    """The blank within the date would give as many values, in more cells."""
    rows = [
        f"04.05.2026 11:59:5{n // 200}{fraction}{5 * (n % 200):03d}\t{np.cos(0.02 * n):.6f}\t{np.sin(0.02 * n):.6f}"
        for n in range(800)
    ]
    path = tmp_path / "log.txt"
    text = "\n".join(row if fraction == "." else row.replace(".", ",").replace("04,05,", "04.05.") for row in rows)
    path.write_text("Zeit\tu\ttheta_m\n" + text + "\n", encoding="utf-8")
    record = read_record(path)
    assert record.step == pytest.approx(0.005)
    np.testing.assert_allclose(record.theta_m, np.sin(0.02 * np.arange(800)), atol=1e-6)
