"""A fault-injection FMU in a sweep: every fault becomes its row, the rest is right."""

import csv

import pytest

from orchestrator.engine import CaseLimits, DesignCases, LocalProcesses, run_cases, write_csv
from orchestrator.engine.grid import Listed, Product
from tests.support import faulty_slave as faulty
from tests.support import faulty_sweep

GAINS = (1.0, -2.5)
EXPECTED = {
    0: ("done", ""),
    faulty.RAISES: ("error", "faulty"),
    faulty.HANGS: ("time_limit", "took more than 1.5 s"),
    faulty.CRASHES: ("crash", "the worker process died"),
    faulty.NAN: ("non_finite", "not finite: y"),
    faulty.LEAKS: ("error", "faulty"),
    faulty.EXITS: ("crash", "the worker process died"),
    faulty.REFUSES: ("error", "faulty"),
    faulty.PRINTS: ("done", ""),
    faulty.HANGS_LOCKED: ("time_limit", "took more than 1.5 s"),
}


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return faulty_sweep.build(tmp_path_factory.mktemp("fmu"))


def test_every_fault_of_an_fmu_becomes_its_row_and_the_rest_is_right(tmp_path, fmu):
    design = Product((Listed("faulty.gain", GAINS), Listed("faulty.fault", tuple(float(f) for f in EXPECTED))))
    cases = DesignCases(design, seed=0)
    limits = CaseLimits(time=1.5, memory=150_000_000)
    with run_cases(cases, faulty_sweep.work(fmu), tmp_path / "j", open_pool=LocalProcesses(2), limits=limits) as sweep:
        write_csv(tmp_path / "t.csv", cases.names, sweep.columns, sweep.rows())
        assert sweep.failed == len(GAINS) * sum(status != "done" for status, _ in EXPECTED.values())
    for row in csv.DictReader((tmp_path / "t.csv").read_text().splitlines()):
        status, said = EXPECTED[int(float(row["faulty.fault"]))]
        assert row["status"] == status, row
        assert said in row["message"], row
        assert "\n" not in row["message"]
        if status == "done":
            assert float(row["y"]) == pytest.approx(float(row["faulty.gain"]), rel=1e-12)
        else:
            assert row["y"] == ""
