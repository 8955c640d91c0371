"""A torque that changes all the time, logged at rarer rows, is read as sampled: the drive keeps its lag."""

from pathlib import Path

import numpy as np

import orchestrator as oc
from benchmarks.torque_rasters import make_log, nominal_model


def test_a_sampled_torque_leaves_the_lag_of_the_drive_as_it_is(tmp_path: Path) -> None:
    log = make_log(5, 31, 4.0)
    columns = {name: log.columns[name] for name in ("time", "theta_m", "theta_l")}
    nothing = np.full(columns["time"].size - log.own.size, np.nan)
    columns |= {"time_u": np.append(log.own, nothing), "u": np.append(log.torque, nothing)}
    np.savez(tmp_path / "log.npz", **columns)
    diagnosis = oc.diagnose(tmp_path / "log.npz", nominal_model()).diagnosis
    grades = {one.name: one.grade.word for one in (*diagnosis.effects, *diagnosis.nuisances)}
    assert grades["sampled_torque"] in ("certain", "likely")
    assert grades["backlash"] == "certain"
    assert abs(diagnosis.parameters["tau"].value - log.tau) < 0.5e-3  # a torque that is held: 6 ms off
