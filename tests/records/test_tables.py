"""One reader for records of FMUs and for tables of scenarios: the dialects that records of machines have, too."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.io

from orchestrator.diagnosis.fmu.mapping import InputEntry, Options, OutputEntry
from orchestrator.diagnosis.fmu.record import read_fmu_record
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.master.protocol import Unit
from orchestrator.master.units import resolve
from orchestrator.records.tables import column_names
from orchestrator.scenarios.tables import read_table

ROWS = 150
INPUT = 10.0 * (np.arange(ROWS) // 10 % 2)
OUTPUT = np.round(20.0 + 3.0 * np.sin(0.05 * np.arange(ROWS)), 4)
UNITS = {"Q": resolve("W", {}), "T": resolve("degC", {})}


def _map(units: dict[str, Unit] = UNITS, unit: str = "", factor: float = 1.0, **options: object) -> SimpleNamespace:
    entry = OutputEntry("T", factor=factor, unit=unit)
    return SimpleNamespace(
        options=Options(**options), inputs={"Q": InputEntry("Q")}, outputs={"T": entry}, signals={}, units=units
    )


def _write(path: Path, head: str, form: str = "{t},{q},{y}", comma: bool = False, step: float = 0.5) -> None:
    rows = [form.format(n=n, t=step * n, q=q, y=y) for n, (q, y) in enumerate(zip(INPUT, OUTPUT, strict=True))]
    text = "\n".join(rows) + "\n"
    path.write_text(head + (text.replace(".", ",") if comma else text), encoding="utf-8-sig")


# Head, form of a row, whether there are decimal commas, and the step in the numbers of the file.
DIALECTS = {
    "plain": ("time,Q,T\n", "{t},{q},{y}", False, 0.5),
    "spaces": ("time, Q, T\n", "{t}, {q}, {y}", False, 0.5),
    "semicolons": ("time;Q;T\n", "{t};{q};{y}", True, 0.5),
    "tabs and units": ("Zeit [ms]\tQ [W]\tT [°C]\n", "{t}\t{q}\t{y}", False, 500.0),
    "row of units": ("time;Q;T\nms;W;degC\n", "{t};{q};{y}", True, 500.0),
    "dates": ("timestamp,Q,T\n", "2024-05-13T08:{n:02d}:00,{q},{y}", False, 0.0),
    "key values above": ("Logger;7\nStation;bench\ntime;Q;T\n", "{t};{q};{y}", False, 0.5),
    "a name with the unit": ("time_ms,Q_kW,T\n", "{t},{q}e-3,{y}", False, 500.0),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_of_a_record_of_an_fmu(dialect: str, tmp_path: Path) -> None:
    head, form, comma, step = DIALECTS[dialect]
    path = tmp_path / "log.csv"
    if dialect == "dates":
        form = form.replace("08:{n:02d}:00", "08:00:00.{n:03d}")
        _write(path, head, form)
        assert read_fmu_record(path, _map()).step == pytest.approx(1e-3)
    else:
        _write(path, head, form, comma, step)
        assert read_fmu_record(path, _map()).step == pytest.approx(0.5)
    data = read_fmu_record(path, _map())
    np.testing.assert_allclose(data.inputs[:, 0], INPUT)
    np.testing.assert_allclose(data.outputs[:, 0], OUTPUT)
    assert data.notes[0].startswith("CSV")


def test_units_are_converted_to_those_of_the_fmu(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, "time,Q [kW],T [K]\n")
    data = read_fmu_record(path, _map())
    np.testing.assert_allclose(data.inputs[:, 0], 1e3 * INPUT)
    np.testing.assert_allclose(data.outputs[:, 0], OUTPUT - 273.15)
    np.testing.assert_allclose(read_fmu_record(path, _map({})).outputs[:, 0], OUTPUT)  # the FMU states none
    np.testing.assert_allclose(read_fmu_record(path, _map(unit="degC")).outputs[:, 0], OUTPUT)  # the map goes first
    np.testing.assert_allclose(read_fmu_record(path, _map(factor=2.0)).outputs[:, 0], 2.0 * OUTPUT)


@pytest.mark.parametrize("text", ["furlong", "grad", "W", "rad"])
def test_units_that_do_not_fit_are_refused_and_the_advice_works(text: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, f"time,Q,T [{text}]\n")
    with pytest.raises(RecordError, match=r'say `unit = "..."` in \$.outputs.T of the map, or `factor`'):
        read_fmu_record(path, _map())
    np.testing.assert_allclose(read_fmu_record(path, _map(unit="degC")).outputs[:, 0], OUTPUT)
    np.testing.assert_allclose(read_fmu_record(path, _map(factor=0.5)).outputs[:, 0], 0.5 * OUTPUT)


def test_a_time_in_an_unknown_unit(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, "time [ticks],Q,T\n", step=1.0)
    with pytest.raises(RecordError, match=r"say `time_factor = \.\.\.`"):
        read_fmu_record(path, _map())
    assert read_fmu_record(path, _map(time_factor=0.01)).step == pytest.approx(0.01)


def test_lost_rows_and_empty_cells_are_filled_and_said(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, "time,Q,T\n")
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    lines[31] = "15.0,," + lines[31].rsplit(",", 1)[1]
    lines[61] = lines[61].rsplit(",", 1)[0] + ","
    del lines[91]
    path.write_text("\n".join(lines) + "\n")
    data = read_fmu_record(path, _map())
    assert data.time.size == ROWS
    np.testing.assert_allclose(data.inputs[:, 0], np.where(np.isin(np.arange(ROWS), (30, 90)), INPUT[[29]], INPUT))
    np.testing.assert_allclose(np.delete(data.outputs[:, 0], 30), np.delete(OUTPUT, 30), atol=2e-3)
    assert any("2 samples of T are missing and were interpolated" in note for note in data.notes)
    assert any("2 samples of Q are missing; the one before is held" in note for note in data.notes)


@pytest.mark.parametrize(
    ("rows", "said"),
    [(slice(50, 60), "rows are missing"), (slice(50, 140, 5), "rows are missing"), (slice(1, 2), None)],
)
def test_what_is_too_much_to_fill_is_refused(rows: slice, said: str | None, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, "time,Q,T\n")
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    del lines[rows]
    path.write_text("\n".join(lines) + "\n")
    if said is None:
        assert read_fmu_record(path, _map()).time.size == ROWS - 1
    else:
        with pytest.raises(RecordError, match=said):
            read_fmu_record(path, _map())


def test_columns_by_number_and_a_stated_line(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _write(path, "time,Q,T\na,b,c\n")
    with pytest.raises(RecordError, match="no such column: 'Q' of `a,b,c`"):
        read_fmu_record(path, _map(time="a"))
    assert read_fmu_record(path, _map(header=1)).time.size == ROWS
    given = _map(time="#1")
    given.inputs, given.outputs = {"Q": InputEntry("#2")}, {"T": OutputEntry("#3")}
    assert read_fmu_record(path, given).time.size == ROWS
    _write(path, "time,Q,T,T\n", "{t},{q},{y},{y}")
    assert column_names(path) == ["time", "Q", "T", "T"]
    with pytest.raises(RecordError, match="2 of them: name it by number, such as `#3`"):
        read_fmu_record(path, _map())


def test_columns_of_two_lengths_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"time": 0.5 * np.arange(ROWS), "Q": INPUT, "T": OUTPUT[:-1]})
    with pytest.raises(RecordError, match="column `T` must have as many rows as `time`, but has 149, not 150: name"):
        read_fmu_record(path, _map())


@pytest.mark.parametrize(
    "text",
    [
        "time,f\n0,0\n0.5,1\n1,1\n", "\ufefftime,f\n0,0\n0.5,1\n1,1\n\n", "time;f\n0;0\n0,5;1\n1;1\n",
        "time\tf\n0\t0\n0.5\t1\n1\t1\n", "time, f\n0, 0\n0.5, 1\n1, 1\n", "time;f\ns;V\n0;0\n0.5;1\n1;1\n",
        "made by hand\ntime [ms],f\n0,0\n500,1\n1000,1\n", "time f\n0 0\n0.5 1\n1 1\n",
        "t,f\n0,false\n0.5,true\n1,TRUE\n",
    ],
)  # fmt: skip
def test_dialects_of_a_table(text: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    signal, unit = read_table(path, "f")
    np.testing.assert_allclose(signal.sample(np.array([0.0, 0.25, 0.5, 1.0, 2.0])), [0.0, 0.5, 1.0, 1.0, 1.0])
    assert unit == ("V" if "V" in text else "")


def test_two_rows_at_one_time_are_a_jump(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("time,f\n0,0\n0.3,1\n0.3,5\n1,5\n")
    signal, _ = read_table(path, "f")
    times = 0.1 * np.arange(8)  # 0.30000000000000004 among them
    np.testing.assert_allclose(signal.sample(times), [0.0, 1 / 3, 2 / 3, 5.0, 5.0, 5.0, 5.0, 5.0])
    np.testing.assert_allclose(
        signal.sample(np.array([0.3 - 1e-3, 0.3 - 1e-16, 0.3])), [0.999 - 1 / 300 + 1e-3, 5.0, 5.0], atol=1e-2
    )
    assert signal.breaks(0.0, 1.0) == [0.3]
    held, _ = read_table(path, "f", hold=True)
    np.testing.assert_allclose(held.sample(times), [0.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 5.0])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,f\n0,0\n2,1\n1,1\n", "must not go back"),
        ("time,f\n0,0\n0.5,\n1,1\n", "fill the cell, or delete the row"),
        ("time [ticks],f\n0,0\n1,1\n", "write the times in seconds"),
        ("time,g\n0,0\n1,1\n", "no such column: 'f' of `time,g`"),
        ("", "the file is empty"),
    ],
)
def test_tables_that_cannot_be_used(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=said):
        read_table(path, "f")
