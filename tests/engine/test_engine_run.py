"""The engine on processes of this machine: order, faults, bounds, tables."""

import csv
import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.engine import CaseLimits, DesignCases, LocalProcesses, Status, run_cases, write_csv, write_parquet
from orchestrator.engine.grid import Listed, Product, Ranged
from orchestrator.errors import FmuError, OutputError, ScenarioError, SimulationError
from tests.support import engine_work

SIZES = DesignCases(Ranged("size", 0.0, 2.0, 41), seed=3)
ONE = LocalProcesses(1)
TWO = LocalProcesses(2)


def table(tmp_path, cases, work, pool=TWO, **options):
    """Run and return the CSV's text."""
    with run_cases(cases, work, tmp_path / "j", open_pool=pool, **options) as sweep:
        write_csv(tmp_path / "t.csv", cases.names, sweep.columns, sweep.rows())
        sweep.discard_journal()
    return (tmp_path / "t.csv").read_text()


def test_rows_are_right_and_in_case_order(tmp_path):
    rows = list(csv.DictReader(table(tmp_path, SIZES, engine_work.work()).splitlines()))
    assert [int(r["case"]) for r in rows] == list(range(41))
    assert all(float(r["square"]) == float(r["size"]) ** 2 for r in rows)
    assert [float(r["noise"]) for r in rows] == [SIZES[i].generator().standard_normal() for i in range(41)]
    assert {r["status"] for r in rows} == {"done"}


def test_the_same_bytes_with_any_number_of_workers(tmp_path):
    assert table(tmp_path, SIZES, engine_work.work(), ONE) == table(
        tmp_path, SIZES, engine_work.work(), LocalProcesses(3)
    )


def test_every_fault_becomes_its_row_and_the_rest_is_right(tmp_path):
    expected = {
        "raises": ("error", "SlaveError: plant: doStep returned fmi2Error at <object object at 0x…>"),
        "exits": ("error", "SystemExit: 3"),
        "hangs": ("time_limit", "took more than 1.5 s"),
        "hangs in C": ("time_limit", "took more than 1.5 s"),
        "crashes": ("crash", "the worker process died"),
        "killed": ("crash", "the worker process died"),
        "nan": ("non_finite", "not finite: square"),
        "leaks": ("error", "MemoryError"),
        "prints": ("done", ""),
        "none": ("done", ""),
    }
    cases = DesignCases(Product((Listed("fault", tuple(expected)), Listed("size", (1.0, 3.0)))), seed=1)
    text = table(tmp_path, cases, engine_work.work(engine_work.run_faulty), limits=CaseLimits(1.5, 100_000_000))
    rows = list(csv.DictReader(text.splitlines()))
    assert len(rows) == 2 * len(expected)
    for row in rows:
        assert (row["status"], row["message"]) == expected[row["fault"]], row
        assert row["square"] == (str(float(row["size"]) ** 2) if row["status"] == "done" else "")


def test_in_the_middle_of_a_batch_a_fault_is_still_its_own_row(tmp_path):
    faults = ["none"] * 400
    faults[150], faults[151], faults[301] = "hangs", "crashes", "raises"
    cases = DesignCases(Listed("fault", tuple(faults)), seed=1)
    work = engine_work.work(engine_work.run_faulty_of_size_two)
    text = table(tmp_path, cases, work, ONE, limits=CaseLimits(2.0, 0))
    rows = list(csv.DictReader(text.splitlines()))
    assert {int(r["case"]): r["status"] for r in rows if r["status"] != "done"} == {
        150: "time_limit",
        151: "crash",
        301: "error",
    }
    assert {r["square"] for r in rows if r["status"] == "done"} == {"4.0"}


@pytest.mark.parametrize("kills", [1, 4])
def test_workers_that_somebody_kills_cost_nothing(tmp_path, kills):
    work = engine_work.work(engine_work.run_killed, marker=str(tmp_path / "marker"), kills=kills)
    disturbed = table(tmp_path, SIZES, work)
    assert (tmp_path / "marker").stat().st_size == kills
    assert disturbed == table(tmp_path, SIZES, engine_work.work())


def test_failures_are_counted_as_progress_goes(tmp_path):
    cases = DesignCases(Product((Listed("fault", ("nan", "none")), Ranged("size", 0.0, 1.0, 5))), seed=1)
    seen = []
    with run_cases(
        cases, engine_work.work(engine_work.run_faulty), tmp_path / "j", open_pool=ONE, on_progress=seen.append
    ) as sweep:
        assert sweep.failed == 5
        assert [r.outcome.status for r in sweep.rows()].count(Status.NON_FINITE) == 5
    assert (seen[-1].done, seen[-1].total, seen[-1].failed, seen[-1].resumed) == (10, 10, 5, 0)
    assert all(a.done <= b.done for a, b in itertools.pairwise(seen))


def test_a_worker_that_grows_is_replaced_and_nobody_notices(tmp_path):
    cases = DesignCases(Listed("size", tuple(float(i) for i in range(6))), seed=1)
    with run_cases(
        cases,
        engine_work.work(engine_work.run_hoarding),
        tmp_path / "j",
        open_pool=ONE,
        limits=CaseLimits(10.0, 100_000_000),
    ) as sweep:
        rows = list(sweep.rows())
    assert {r.outcome.status for r in rows} == {Status.DONE}
    assert len({r.outcome.values[3] for r in rows}) > 1


def test_files_reach_the_workers_by_content(tmp_path):
    (tmp_path / "model.fmu").write_bytes(b"x" * 1234)
    work = replace(engine_work.work(), files={"blob": tmp_path / "model.fmu"})
    rows = list(csv.DictReader(table(tmp_path, SIZES, work).splitlines()))
    assert {r["count"] for r in rows} == {"1234"}
    with pytest.raises(FmuError, match=r"none\.fmu"):
        run_cases(SIZES, replace(work, files={"blob": tmp_path / "none.fmu"}), tmp_path / "j")


def test_a_changed_file_is_another_sweep(tmp_path):
    model = tmp_path / "model.fmu"
    model.write_bytes(b"one")
    work = replace(engine_work.work(), files={"blob": model})
    run_cases(SIZES, work, tmp_path / "j", open_pool=ONE).__exit__()
    model.write_bytes(b"two")
    with pytest.raises(ScenarioError, match="differs in: files"):
        run_cases(SIZES, work, tmp_path / "j", open_pool=ONE, resume=True)


@pytest.mark.parametrize(
    ("prepare", "error", "said"),
    [
        (engine_work.prepare_refused, FmuError, "must be an FMU"),
        (engine_work.prepare_killed, SimulationError, "died while it was prepared"),
    ],
)
def test_workers_that_cannot_be_prepared_end_the_run_and_leave_nothing(tmp_path, prepare, error, said):
    with pytest.raises(error, match=said):
        run_cases(SIZES, replace(engine_work.work(), prepare=prepare), tmp_path / "out" / "j", open_pool=TWO)
    assert list(tmp_path.iterdir()) == []


def test_work_that_cannot_travel_is_refused(tmp_path):
    work = replace(engine_work.work(), run=lambda prepared, case: {})
    with pytest.raises(ScenarioError, match="module-level"):
        run_cases(SIZES, work, tmp_path / "j")


@pytest.mark.parametrize(
    "make", [lambda: LocalProcesses(0), lambda: CaseLimits(time=0.0), lambda: CaseLimits(memory=-1)]
)
def test_bad_bounds_are_refused(make):
    with pytest.raises(ScenarioError, match="must"):
        make()


def test_parquet_holds_what_the_csv_holds(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra [parquet] is not installed")
    cases = DesignCases(Product((Listed("fault", ("nan", "none")), Ranged("size", 0.0, 1.0, 5))), seed=1)
    work = engine_work.work(engine_work.run_faulty)
    with run_cases(cases, work, tmp_path / "j", open_pool=ONE) as sweep:
        for name in ("a", "b"):
            write_parquet(tmp_path / f"{name}.parquet", cases.names, sweep.columns, sweep.rows())
        write_csv(tmp_path / "t.csv", cases.names, sweep.columns, sweep.rows())
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    rows = parquet.read_table(tmp_path / "a.parquet").to_pylist()
    for row, line in zip(rows, csv.DictReader((tmp_path / "t.csv").read_text().splitlines()), strict=True):
        assert {k: "" if v is None else str(v) for k, v in row.items()} == line


def test_floats_survive_the_table_exactly(tmp_path):
    values = (0.1, 1e-300, math.pi * 1e17, 2.0**-1074)
    cases = DesignCases(Listed("size", values), seed=1)
    rows = list(csv.DictReader(table(tmp_path, cases, engine_work.work(), ONE).splitlines()))
    assert tuple(float(r["size"]) for r in rows) == values


@pytest.mark.parametrize("path", ["/proc/nowhere/t.csv", "/dev/full"])
def test_a_table_that_cannot_be_written_is_named_and_can_be_written_later(path):
    with pytest.raises(OutputError, match=r"cannot write .*`resume` writes it"):
        write_csv(Path(path), (), (), [])


def test_columns_that_the_work_forgets_are_named(tmp_path):
    cases = DesignCases(Product((Listed("fault", ("forgets",)), Listed("size", (1.0,)))), seed=1)
    text = table(tmp_path, cases, engine_work.work(engine_work.run_faulty), ONE)
    assert "must return the columns" in text
