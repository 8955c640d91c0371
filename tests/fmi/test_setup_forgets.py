"""An FMU that forgets in fmi2SetupExperiment what was set before it, as some exporters' do, runs with its values."""

import pytest

from orchestrator.fmi.instances import make_slave
from tests.support.box_fmu import DOMAINS, write_fmu
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="no C compiler")


def way(path):
    slave = make_slave("spring", path)
    try:
        ends = []
        for mass in (2.0, 4.0):
            slave.set({"m": mass, "k": 0.0, "c": 0.0})
            slave.begin(0.0, None, None)
            slave.set({"F": 3.0})
            slave.start()
            slave.do_step(0.0, 0.1)
            ends.append(slave.get(["x"])[0])
            slave.reset()
        return ends
    finally:
        slave.close()


@pytest.mark.parametrize("fault", ["", "setup_forgets"])
def test_start_values_hold_in_every_run(tmp_path, fault):
    path = write_fmu(tmp_path / "Spring.fmu", DOMAINS[0], fault)
    assert way(path) == pytest.approx([0.5 * 3.0 / mass * 0.1**2 for mass in (2.0, 4.0)], rel=1e-6)
