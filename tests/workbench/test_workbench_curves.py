"""Curves of a log: levels of detail against the rows themselves, and the walls around what reads logs of others."""

import asyncio
import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.columns import Column
from orchestrator.records.preview import LogPreview, preview_log
from orchestrator.shared.isolation.walls import support
from orchestrator.workbench import curves, log_readers
from orchestrator.workbench.curves import STRETCH, CurvesAsked, CurvesShown, LogReader, LookAsked
from orchestrator.workbench.log_readers import LogReaders
from orchestrator.workbench.settings import WorkbenchSettings
from tests.support.engine_process import children, wait_until_gone
from tests.support.waiting import wait_until
from tests.support.workbench import workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")

ROWS = 9000


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    """Time, a torque that is cut off at 2, and a walk with holes."""
    rng = np.random.default_rng(5)
    walk = rng.normal(size=ROWS).cumsum()
    walk[rng.random(ROWS) < 0.1] = np.nan
    return np.column_stack([np.arange(ROWS) / 1000.0, np.minimum(3.0 * rng.normal(size=ROWS), 2.0), walk])


@pytest.fixture(scope="module", params=["csv", "npz"])
def log(request: pytest.FixtureRequest, values: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("curves") / f"walk.{request.param}"
    if request.param == "npz":
        np.savez(path, time=values[:, 0], u=values[:, 1], walk=values[:, 2])
        return path
    rows = [",".join("" if np.isnan(one) else repr(float(one)) for one in row) for row in values]
    path.write_text("\n".join(["time [s],u [N.m],walk", *rows]) + "\n")
    return path


def whole(reader: LogReader, **asked: Any) -> CurvesShown:
    found = reader.answer(CurvesAsked((0, 1, 2), **asked))
    while found.share < 1.0:
        found = reader.answer(CurvesAsked((0, 1, 2), **asked))
    return found


def test_stretches_hold_the_extremes_of_their_rows(log: Path, values: np.ndarray) -> None:
    found = whole(LogReader(log), stretches=50)
    assert found.rows == ROWS
    torque, walk = found.curves[1:]
    assert torque.most == 2.0
    assert torque.at_most == pytest.approx(np.mean(values[:, 1] == 2.0))
    assert torque.at_least == pytest.approx(1 / ROWS)
    assert walk.missing == pytest.approx(np.mean(np.isnan(values[:, 2])))
    for place, curve in enumerate(found.curves):
        assert 40 <= len(curve.rows) <= 50
        for n, (first, end) in enumerate(zip(curve.rows, (*curve.rows[1:], ROWS), strict=True)):
            assert first % STRETCH == 0
            part = values[first:end, place]
            assert (curve.low[n], curve.high[n]) == pytest.approx((np.nanmin(part), np.nanmax(part)), rel=1e-6)


def test_few_rows_in_view_are_shown_as_they_are(log: Path, values: np.ndarray) -> None:
    reader = LogReader(log)
    whole(reader)
    found = whole(reader, first=4000, last=4099, stretches=300)
    for place, curve in enumerate(found.curves):
        assert curve.rows == tuple(range(4000, 4100))
        shown = [np.nan if one is None else one for one in curve.high]
        assert shown == pytest.approx(values[4000:4100, place], rel=1e-6, nan_ok=True)
        assert curve.low == curve.high


@pytest.mark.parametrize("log", ["csv"], indirect=True)  # other formats are read at once
def test_a_log_is_drawn_as_far_as_it_is_read(log: Path, values: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter((0.0, 0.0, 1.0))  # the second look is too late: one block is read
    monkeypatch.setattr(curves, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    reader = LogReader(log)
    first = reader.answer(CurvesAsked((1,)))
    assert 0 < first.rows < ROWS
    assert not first.curves[0].whole
    assert max(first.curves[0].high) == pytest.approx(values[: first.rows, 1].max(), rel=1e-6)
    monkeypatch.undo()
    assert whole(reader).curves[1].whole


def test_what_is_no_column_of_numbers_is_left_out_or_told(tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    path.write_text("when,u,state\n" + "".join(f"2024-01-01 10:00:{n:02d},{n},on\n" for n in range(60)))
    found = LogReader(path).answer(CurvesAsked((0, 1, 2, 7)))
    assert [curve.place for curve in found.curves] == [1, 2]
    assert found.curves[1].missing == 1.0
    assert found.curves[1].least is None


def test_a_look_is_the_command_lines_own(log: Path) -> None:
    stated = {"theta_m": Column(name="walk", unit="deg")}
    assert LogReader(log).answer(LookAsked(stated, None)) == preview_log(log, stated)


def run(folder: Path, act: Any) -> Any:
    """Run a coroutine with the readers of a session."""

    async def running() -> Any:
        readers = LogReaders(folder, WorkbenchSettings(logs_open=1, answer_seconds=20.0))
        try:
            return await act(readers)
        finally:
            readers.close()

    return asyncio.run(running())


def test_a_reader_that_dies_is_told_and_replaced(tmp_path: Path) -> None:
    for name in ("one.csv", "two.csv"):
        (tmp_path / name).write_text("time,u,theta_m\n" + "".join(f"{n},1,{n / 7:.4f}\n" for n in range(50)))

    async def act(readers: LogReaders) -> None:
        look = LookAsked({}, None)
        assert (await readers.ask(tmp_path / "one.csv", look, LogPreview)).file == "one.csv"
        (one,) = readers._open.values()
        os.kill(one.jail.pid, signal.SIGKILL)
        with pytest.raises(RecordError, match=r"one.csv: cannot be read: the process was ended by SIGKILL"):
            await readers.ask(tmp_path / "one.csv", look, LogPreview)
        assert (await readers.ask(tmp_path / "one.csv", look, LogPreview)).problem == ""
        await readers.ask(tmp_path / "two.csv", look, LogPreview)
        assert [path.name for path in readers._open] == ["two.csv"]  # no more than are kept

    run(tmp_path, act)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.csv", "two.csv"]


@pytest.mark.skipif(bool(support().not_enforced), reason="the kernel has no walls")
def test_what_reads_a_log_sees_no_other_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a hostile log would have it, once it has taken its reader over."""
    (tmp_path / "mine.csv").write_text("1")
    (tmp_path / "others.csv").write_text("2")
    monkeypatch.setattr(log_readers, "ENTRY", "tests.support.log_thief:reader")

    async def act(readers: LogReaders) -> dict[str, str]:
        return await readers.ask(tmp_path / "mine.csv", str(tmp_path), dict[str, str])

    done = run(tmp_path, act)
    assert done.pop("own log") == "done"
    assert set(done) == {"other log", "write beside", "write into", "socket", "process", "signal"}
    assert all(said.startswith("PermissionError") for said in done.values()), done
    assert (tmp_path / "mine.csv").read_text() == "1"


def test_requests_for_curves_that_are_none_are_refused_and_the_end_takes_all(tmp_path: Path) -> None:
    with workbench(tmp_path / "session") as served:
        log = served.ask("PUT", "upload/log.csv", b"time,u,theta_m\n" + b"0,1,2\n1,3,4\n" * 30)[1]["file"]
        for wrong in (
            {"places": "0"}, {"places": [0.5]}, {"places": list(range(101))}, {}, {"places": [1], "first": -1},
            {"places": [1], "stretches": 10**6}, {"places": [1], "header": "x"}, {"places": [1], "file": "/etc/passwd"},
            {"places": [1], "file": "files/../session.json"}, {"places": [1], "file": 7},
        ):  # fmt: skip
            status, said = served.ask("POST", "curves", {"file": log, **wrong})
            assert (status, said["error"] != "") == (400, True), wrong
        assert served.ask("POST", "curves", {"file": log, "places": [1, -1, 99]})[1]["rows"] == 60
        served.ask("PUT", "upload/picture.csv", b"\x89PNG\r\n\x1a\n" + bytes(3000))
        assert served.ask("POST", "curves", {"file": "files/picture.csv", "places": [0]})[0] == 422
        running = children(served.process.pid)
        assert running
        served.process.send_signal(signal.SIGKILL)
        served.process.wait()
        wait_until_gone(running)
    with workbench(tmp_path / "session"):
        wait_until(lambda: not list((tmp_path / "session").glob("backlash-cosim-*-log-*/*.csv")))
