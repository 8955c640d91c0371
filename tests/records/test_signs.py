"""Signs of torque and angles are told before any fit, in position loops with dry friction and over small travel too."""

from contextlib import nullcontext

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.model_file import default_model
from orchestrator.records.plausibility import _check_directions, check_plausible
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record

MODEL = default_model()
LOOPS = [
    ({"Fc_m": 2.0}, 20.0), ({"Fc_m": 4.0, "Fc_l": 10.0, "alpha": 0.02}, 6.0), ({"Fc_l": 30.0}, 6.0),
    ({"Fc_l": 30.0}, 20.0), ({"alpha": 0.02, "T0": 20.0}, 6.0),
]  # fmt: skip


@pytest.mark.parametrize(("effects", "duration"), LOOPS)
def test_the_sign_of_the_torque_in_a_position_loop(effects: dict[str, float], duration: float) -> None:
    """What a loop with friction asks for follows the angle more than the acceleration."""
    log, _ = make_record(effects, 3, duration, excitation="closed_loop", substeps=30)
    check_plausible(record_from_columns(log, "log"), MODEL)
    with pytest.raises(RecordError, match=r"say `\[columns.u\] factor = -1`"):
        check_plausible(record_from_columns(log | {"u": -log["u"]}, "log"), MODEL)


@pytest.mark.parametrize("excitation", ["multisine", "levels"])
@pytest.mark.parametrize("torque", [0.05, 0.2, 1.0])
def test_the_direction_of_the_load_over_small_travel(excitation: str, torque: float) -> None:
    log, _ = make_record({"alpha": 0.005}, 4, 8.0, excitation=excitation, torque=torque, substeps=30)
    check_plausible(record_from_columns(log, "log"), MODEL)
    for flipped in ({"theta_l": -log["theta_l"]}, {"theta_m": -log["theta_m"], "u": -log["u"]}):
        with pytest.raises(RecordError, match=r"`\[columns.theta_l\] factor = -1`"):
            check_plausible(record_from_columns(log | flipped, "log"), MODEL)


def test_a_load_that_swings_against_the_motor_is_no_wrong_sign() -> None:
    """Beyond the frequency of the load on a held motor the two go opposite ways; what they do together is slow."""
    step, time = 5e-3, np.arange(2000) * 5e-3
    p = {name: entry.value for name, entry in MODEL.parameters.items()}
    held = np.sqrt(p["k"] / p["J_l"])
    for slow in (0.0, 0.05):
        motor, load = np.zeros(time.size), np.zeros(time.size)
        for amplitude, w in ((0.4, 1.6 * held), (slow, 0.5)):
            motor += amplitude * np.sin(w * time)
            load += amplitude / p["i"] * np.sin(w * time) / (1.0 - (w / held) ** 2)
        record = Record(time, np.gradient(np.gradient(motor, step), step), motor, load)
        assert np.corrcoef(motor, load)[0, 1] < 0.0
        assert record.theta_l is not None
        _check_directions(record, record.theta_l, p)
        with pytest.raises(RecordError, match="must grow with `theta_m`, but falls") if slow else nullcontext():
            _check_directions(record, -record.theta_l, p)
