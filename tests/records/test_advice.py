"""Every advice in an error of the records is followed: the input that raises it, then the same input as advised.

A row of ``ADVICE`` is a bad input, words of the error that it raises, and what the error says to do. An input is a text
or a function that writes a file, with the columns of a model file, how it is read, and perhaps a model.
"""

import gzip
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from orchestrator.errors import InputError
from orchestrator.records.model_file import Model, default_model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Column, Reading, read_record
from tests.support.independent_plant import make_record

Table = dict[str, np.ndarray]


@dataclass(frozen=True)
class Input:
    """A file and how it is read."""

    write: Callable[[Path, Table], object]
    columns: dict[str, Column] = field(default_factory=dict)
    reading: Reading = field(default_factory=Reading)
    model: dict[str, float] | None = None
    """Parameters that differ from the default model; None: the record is not compared with a model."""

    def read(self, path: Path, table: Table) -> None:
        path.unlink(missing_ok=True)
        self.write(path, table)
        record = read_record(path, self.columns, reading=self.reading)
        if self.model is not None:
            check_plausible(record, _model(self.model))


def _model(changed: dict[str, float]) -> Model:
    base = default_model()
    parameters = {name: replace(p, value=changed.get(name, p.value)) for name, p in base.parameters.items()}
    return replace(base, parameters=parameters)


def _lines(table: Table, head: str | None = None, separator: str = ",") -> list[str]:
    rows = [separator.join(f"{v:.12g}" for v in row) for row in zip(*table.values(), strict=True)]
    return [separator.join(table) if head is None else head, *rows]


def _csv(head: str | None = None, change: Callable[[Table], Table] = lambda t: t) -> Callable[[Path, Table], object]:
    return lambda path, table: path.write_text("\n".join(_lines(change(dict(table)), head)) + "\n")


def _edited(change: Callable[[list[str]], list[str]]) -> Callable[[Path, Table], object]:
    return lambda path, table: path.write_text("\n".join(change(_lines(table))) + "\n")


def _cell(row: int, column: int, text: str) -> Callable[[Path, Table], object]:
    def change(lines: list[str]) -> list[str]:
        cells = lines[row].split(",")
        cells[column] = text
        return [*lines[:row], ",".join(cells), *lines[row + 1 :]]

    return _edited(change)


def _held(rows: slice) -> Callable[[Table], Table]:
    def change(table: Table) -> Table:
        values = table["theta_m"].copy()
        values[rows] = values[rows.start]
        return table | {"theta_m": values}

    return change


def _scaled(**factors: float) -> Callable[[Table], Table]:
    return lambda table: {name: factors.get(name, 1.0) * values for name, values in table.items()}


def _with(name: str, make: Callable[[Table], np.ndarray]) -> Callable[[Table], Table]:
    return lambda table: table | {name: make(table)}


def _without(*names: str) -> Callable[[Table], Table]:
    return lambda table: {name: values for name, values in table.items() if name not in names}


def _mat(content: Callable[[Table], dict[str, Any]]) -> Callable[[Path, Table], object]:
    def write(path: Path, table: Table) -> None:
        scipy.io.savemat(path.with_suffix(".mat"), content(table))
        path.with_suffix(".mat").rename(path)

    return write


def _two_rasters(path: Path, table: Table) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for name, slow in (("u", 1), ("theta_m", 1), ("theta_l", 2)):
            file.append([asammdf.Signal(table[name][::slow], table["time"][::slow], name=name)])
        file.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


PLAIN = _csv()
COUNTS = _csv("time,u,theta_m [counts],theta_l", _scaled(theta_m=8192.0 / (2.0 * np.pi)))
PERCENT = _csv("time,u [%],theta_m,theta_l", _scaled(u=2.0))
WRAPPED = _csv(None, lambda t: t | {"theta_m": np.degrees(t["theta_m"]) % 360.0, "theta_l": np.degrees(t["theta_l"])})
OVERFLOW = _csv("time [ms],u,theta_m,theta_l", _with("time", lambda t: np.round(1e3 * t["time"] + 64000.0) % 65536.0))
SECONDS = _csv(None, _with("time", lambda t: np.round((t["time"] + 57.5) % 60.0, 9)))
TWO_RUNS = _edited(lambda lines: [*lines, *lines[1:]])
ROUNDED = _csv(None, _with("time", lambda t: np.floor(t["time"] * 20.0) / 20.0))
SAME_NAMES = _csv("time,u,q,q", lambda t: t)
DEGREES_L = _csv(None, _scaled(theta_l=57.29578))
DEGREES_M = _csv(None, lambda t: _without("theta_l")(_scaled(theta_m=57.29578)(t)))
EXCHANGED = _csv("time,u,theta_l,theta_m")
ONE = _without("theta_l")

ADVICE: dict[str, tuple[Input, str, Input]] = {
    "unit that is not known": (
        Input(_csv("time,u [gcm],theta_m,theta_l")), 'say `[columns.u] unit = "..."`',
        Input(_csv("time,u [gcm],theta_m,theta_l"), {"u": Column(unit="N.m", factor=9.80665e-5)}),
    ),
    "unit of another kind, by another name": (
        Input(_csv("time,u,theta_m [A],theta_l,q", _with("q", lambda t: t["theta_m"]))), "name another by",
        Input(_csv("time,u,theta_m [A],theta_l,q", _with("q", lambda t: t["theta_m"])), {"theta_m": Column("q")}),
    ),
    "unit of another kind, by its unit": (
        Input(_csv("time,u,theta_m [A],theta_l")), "or mend it by `unit`",
        Input(_csv("time,u,theta_m [A],theta_l"), {"theta_m": Column(unit="rad")}),
    ),
    "volts": (
        Input(_csv("time,u [V],theta_m,theta_l"), {"u": Column("u")}),
        "say `[columns.u] resistance = ...` and `[columns.u] torque_constant = ...`",
        Input(_csv("time,u [V],theta_m,theta_l"), {"u": Column("u", resistance=1.0, torque_constant=1.0)}),
    ),
    "counts": (Input(COUNTS), "say `[columns.theta_m] counts_per_rev",
        Input(COUNTS, {"theta_m": Column(counts_per_rev=8192.0)})),
    "percent": (Input(PERCENT), "say `[columns.u] rated_value", Input(PERCENT, {"u": Column(rated_value=50.0)})),
    "amperes": (
        Input(_csv("time,u [A],theta_m,theta_l")), "say `[columns.u] torque_constant",
        Input(_csv("time,u [A],theta_m,theta_l"), {"u": Column(torque_constant=1.0)}),
    ),
    "angle that wraps": (
        Input(WRAPPED, {n: Column(unit="deg") for n in ("theta_m", "theta_l")}), "say `[columns.theta_m] modulo = 360`",
        Input(WRAPPED, {"theta_m": Column(unit="deg", modulo=360.0), "theta_l": Column(unit="deg")}, model={}),
    ),
    "time counter that overflows": (
        Input(OVERFLOW), "say `[columns.time] modulo = 65536`",
            Input(OVERFLOW, {"time": Column(modulo=65536.0)}, model={}),
    ),
    "seconds of a minute": (
        Input(SECONDS), "say `[columns.time] modulo = 60`", Input(SECONDS, {"time": Column(modulo=60.0)}, model={}),
    ),
    "two runs, by a part": (
        Input(TWO_RUNS), "keep one run by `part` START:END", Input(TWO_RUNS, reading=Reading(part=(0.0, 4.0))),
    ),
    "infinite cell, emptied": (Input(_cell(40, 2, "-inf")), "mend or empty the cell", Input(_cell(40, 2, ""))),
    "many missing, by a part": (
        Input(_edited(lambda ls: [*ls[:400], *(line.rsplit(",", 1)[0] + "," for line in ls[400:])])),
        "keep a part with values by `part` START:END",
        Input(
            _edited(lambda ls: [*ls[:400], *(line.rsplit(",", 1)[0] + "," for line in ls[400:])]),
            reading=Reading(part=(0.0, 1.9)),
        ),
    ),
    "huge angle": (
        Input(_csv(None, _scaled(theta_m=1e7))), 'say its unit, such as `unit = "counts"`',
        Input(_csv(None, _scaled(theta_m=1e7)), {"theta_m": Column(unit="counts", counts_per_rev=2e7 * np.pi)},
            model={}),
    ),
    "no torque at all": (
        Input(_csv(None, lambda t: t | {"trq": t["u"], "u": 0.0 * t["u"]})), '[columns.u] name = "..."',
        Input(_csv(None, lambda t: t | {"trq": t["u"], "u": 0.0 * t["u"]}), {"u": Column("trq")}, model={}),
    ),
    "stuck throughout": (
        Input(_csv(None, lambda t: t | {"q": t["theta_m"], "theta_m": 0.0 * t["u"]})), "name another column",
        Input(_csv(None, lambda t: t | {"q": t["theta_m"], "theta_m": 0.0 * t["u"]}), {"theta_m": Column("q")}),
    ),
    "stuck for a while": (
        Input(_csv(None, _held(slice(400, 760)))), "keep a part without that by `part` START:END",
        Input(_csv(None, _held(slice(400, 760))), reading=Reading(part=(0.0, 1.9))),
    ),
    "one name twice": (
        Input(_csv("time,u,theta_m,theta_m")), 'say `[columns.theta_m] name = "#3"`',
        Input(_csv("time,u,theta_m,theta_m"), {"theta_m": Column("#3")}),
    ),
    "a name that is not there": (
        Input(_csv("time,u,q_motor,theta_l"), {"theta_m": Column("q_motr")}), "did you mean `q_motor`?",
        Input(_csv("time,u,q_motor,theta_l"), {"theta_m": Column("q_motor")}),
    ),
    "two that look alike": (
        Input(_csv("time,torque 1,theta_m,torque 2")), 'say `[columns.u] name = "torque 1"` (or `torque 2`)',
        Input(_csv("time,torque 1,theta_m,torque 2"), {"u": Column("torque 1")}),
    ),
    "two of one name": (
        Input(SAME_NAMES), 'say `[columns.theta_m] name = "#3"` (or `#4`)',
            Input(SAME_NAMES, {"theta_m": Column("#3")}),
    ),
    "no names": (
        Input(_edited(lambda ls: ls[1:])), 'say `[columns.time] name = "#1"`',
        Input(_edited(lambda ls: ls[1:]), {n: Column(f"#{k}") for k, n in enumerate(("time", "u", "theta_m"), 1)}),
    ),
    "no time, by a rate": (
        Input(_csv(None, _without("time"))), "or `rate = ...` [Hz]",
        Input(_csv(None, _without("time")), {"time": Column(rate=200.0)}, model={}),
    ),
    "no torque by name": (
        Input(_csv("time,a,theta_m,b")), 'say `[columns.u] name = "..."`',
        Input(_csv("time,a,theta_m,b"), {"u": Column("a")}),
    ),
    "sample number": (
        Input(_csv("sample,u,theta_m,theta_l", _with("time", lambda t: np.arange(t["u"].size)))),
        "say `[columns.time] rate = ...`",
        Input(
            _csv("sample,u,theta_m,theta_l", _with("time", lambda t: np.arange(t["u"].size))),
            {"time": Column(rate=200.0)}, model={},
        ),
    ),
    "another raster": (
        Input(_two_rasters,
            {"u": Column("u")}), "state how to interpolate it to those of `theta_m`: `resample` linear or cubic",
        Input(_two_rasters, {"u": Column("u")}, Reading(resample="linear")),
    ),
    "coarse stamps": (
        Input(ROUNDED), "say `[columns.time] rate = ...`", Input(ROUNDED, {"time": Column(rate=200.0)}, model={}),
    ),
    "milliseconds": (
        Input(_csv(None, _scaled(time=1e3))), 'say `[columns.time] unit = "ms"`',
        Input(_csv(None, _scaled(time=1e3)), {"time": Column(unit="ms")}, model={}),
    ),
    "hours": (
        Input(_csv(None, _scaled(time=1e-7))), "say its `[columns.time] unit`",
        Input(_csv(None, _scaled(time=1e-7)), {"time": Column(unit="h")}),
    ),
    "half lost": (
        Input(_edited(lambda ls: ls[:300] + ls[600:])), "keep a part without it by `part` START:END",
        Input(_edited(lambda ls: ls[:300] + ls[600:]), reading=Reading(part=(0.0, 1.45))),
    ),
    "a rate that leaves too little": (
        Input(PLAIN, reading=Reading(rate=20.0)), "ask for a higher rate", Input(PLAIN, reading=Reading(rate=100.0)),
    ),
    "a part that is not there": (
        Input(PLAIN, reading=Reading(part=(90.0, 99.0))), "must lie within the record's 0 to",
            Input(PLAIN, reading=Reading(part=(1.0, 3.0))),
    ),
    "load in degrees": (
        Input(DEGREES_L, model={}), 'say `[columns.theta_l] unit = "deg"`',
        Input(DEGREES_L, {"theta_l": Column(unit="deg")}, model={}),
    ),
    "motor in degrees": (
        Input(DEGREES_M, model={}), 'seems to be in degrees',
            Input(DEGREES_M, {"theta_m": Column(unit="deg")}, model={}),
    ),
    "exchanged": (
        Input(EXCHANGED, model={}), 'say `[columns.theta_m] name = "theta_l"` and the reverse',
        Input(EXCHANGED, {"theta_m": Column("theta_l"), "theta_l": Column("theta_m")}, model={}),
    ),
    "another ratio": (
        Input(PLAIN, model={"i": 25.0}), "or mend `[parameters.i] value`", Input(PLAIN, model={}),
    ),
    "sign of the load": (
        Input(_csv(None, _scaled(theta_l=-1.0)), model={}), "say `[columns.theta_l] factor = -1`",
        Input(_csv(None, _scaled(theta_l=-1.0)), {"theta_l": Column(factor=-1.0)}, model={}),
    ),
    "sign of the torque": (
        Input(_csv(None, _scaled(u=-1.0)), model={}), "say `[columns.u] factor = -1`",
        Input(_csv(None, _scaled(u=-1.0)), {"u": Column(factor=-1.0)}, model={}),
    ),
    "an inertia 30 times too large": (
        Input(_csv(None, ONE), model={"J_m": 30.0 * 0.4, "J_l": 30.0 * 5.6}), "`[parameters.J_m] value`",
        Input(_csv(None, ONE), model={}),
    ),
    "a torque that is too large": (
        Input(_csv(None, lambda t: ONE(_scaled(u=1e3)(t))), model={}), "say `[columns.u] unit`",
        Input(_csv(None, lambda t: ONE(_scaled(u=1e3)(t))), {"u": Column(unit="mN.m")}, model={}),
    ),
    "a shaft that is too quick": (
        Input(PLAIN, model={"k": 1e9}), "or mend `k`", Input(PLAIN, model={}),
    ),
    "gzip": (
        Input(lambda path, t: path.write_bytes(gzip.compress("\n".join(_lines(t)).encode()))), "unpack it first",
            Input(PLAIN),
    ),
    "a heading of another width": (
        Input(_edited(lambda ls: ["time;u;theta_m;theta_l", *ls[1:]])), "say `header = LINE` (0: no names)",
        Input(
            _edited(lambda ls: ["time;u;theta_m;theta_l", *ls[1:]]),
            {n: Column(f"#{k}") for k, n in enumerate(("time", "u", "theta_m"), 1)}, Reading(header=0),
        ),
    ),
    "names above rows of numbers": (
        Input(_edited(lambda ls: [*ls[:20], ls[0], *ls[1:]])), "say `header = LINE`",
        Input(_edited(lambda ls: [*ls[:20], ls[0], *ls[1:]]), reading=Reading(header=21)),
    ),
    "a header of what is no text": (
        Input(_mat(dict), reading=Reading(header=1)), "`header` must be left out",
            Input(_mat(dict)),
    ),
    "thousands": (Input(_cell(40, 1, '"1.234,5"')), "export without thousands separators",
        Input(_cell(40, 1, "1234.5"))),
    "decimal commas": (
        Input(lambda path, t: path.write_text("\n".join(_lines(t)).replace(".", ","))), "export with `;`",
        Input(lambda path, t: path.write_text("\n".join(_lines(t, ";".join(t), ";")).replace(".", ","))),
    ),
    "a cut row": (
        Input(_edited(lambda ls: [*ls[:40], "0.2,3", *ls[40:]])), "the row is cut off; delete it", Input(PLAIN),
    ),
    "MAT without vectors": (
        Input(_mat(lambda t: {"note": "x"})), "save('record.mat', '-struct', 's')", Input(_mat(dict)),
    ),
    "vectors of two lengths": (
        Input(_mat(lambda t: t | {"u": t["u"][:700], "trq": t["u"]})), "name channels of one raster",
        Input(_mat(lambda t: t | {"u": t["u"][:700], "trq": t["u"]}), {"u": Column("trq")}),
    ),
    "many missing, by another name": (
        Input(_csv(None, lambda t: t | {"q": t["theta_m"], "theta_m": np.where(t["time"] < 2, t["theta_m"], np.nan)})),
        "or name another column",
        Input(
            _csv(None, lambda t: t | {"q": t["theta_m"], "theta_m": np.where(t["time"] < 2.0, t["theta_m"], np.nan)}),
            {"theta_m": Column("q")},
        ),
    ),
    "rows that are not sorted": (
        Input(_edited(lambda ls: [*ls[:101], *ls[201:301], *ls[101:201], *ls[301:]])), "sort the rows by time",
        Input(PLAIN),
    ),
    "rows without a time": (
        Input(_csv(None, _with("time", lambda t: np.where(t["time"] < 2.0, t["time"], np.nan)))),
        "or say `[columns.time] rate = ...`",
        Input(
            _csv(None, _with("time", lambda t: np.where(t["time"] < 2.0, t["time"], np.nan))),
            {"time": Column(rate=200.0)}, model={},
        ),
    ),
    "a load that does not follow": (
        Input(_csv(None, lambda t: t | {"q": t["theta_l"], "theta_l": np.cos(9.0 * t["time"])}), model={}),
        "name the right column by `[columns.theta_l] name",
        Input(
            _csv(None, lambda t: t | {"q": t["theta_l"], "theta_l": np.cos(9.0 * t["time"])}), {"theta_l": Column("q")},
            model={},
        ),
    ),
    "a short record": (Input(_edited(lambda ls: ls[:150])), "log a longer run", Input(PLAIN)),
    "a binary file": (Input(lambda path, t: path.write_bytes(bytes(range(256)) * 4)), "export it as CSV", Input(PLAIN)),
}  # fmt: skip


@pytest.fixture(scope="module")
def table() -> Table:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


@pytest.mark.parametrize("name", ADVICE)
def test_advice_that_is_followed_works(name: str, table: Table, tmp_path: Path) -> None:
    bad, words, good = ADVICE[name]
    path = tmp_path / "log.dat"
    with pytest.raises(InputError) as caught:
        bad.read(path, table)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    good.read(path, table)


# What a part leaves out is not looked at: each of these is refused as a whole, and read without its second half.
OUTSIDE: dict[str, Callable[[Path, Table], object]] = {
    "a word": _cell(600, 1, "off"),
    "a short row": _edited(lambda ls: [*ls[:600], "1,2", *ls[601:]]),
    "an infinite value": _cell(600, 2, "inf"),
    "a jump of a full range": _csv(None, _with("theta_m", lambda t: np.where(t["time"] < 3.0, t["theta_m"], -5e3))),
    "lost rows": _edited(lambda ls: ls[:500] + ls[700:]),
    "a time that is no number": _cell(600, 0, "?"),
    "another run": TWO_RUNS,
    "a counter that overflows": _csv(
        None, _with("time", lambda t: np.round(np.where(t["time"] < 2.5, t["time"] + 57.5, t["time"] - 2.5), 9))
    ),
    "a stuck encoder": _csv(None, _held(slice(500, 799))),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_a_part_leaves_out_is_not_looked_at(name: str, table: Table, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    OUTSIDE[name](path, table)
    with pytest.raises(InputError):
        read_record(path)
    record = read_record(path, reading=Reading(part=(0.5, 2.0)))
    np.testing.assert_allclose(record.theta_m, table["theta_m"][100:401], rtol=1e-9, atol=1e-9)


def test_a_part_names_rows_as_the_file_does(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    _cell(300, 1, "off")(path, table)
    with pytest.raises(InputError, match="row 300, column `u` must be a number"):
        read_record(path, reading=Reading(part=(1.0, 3.0)))
