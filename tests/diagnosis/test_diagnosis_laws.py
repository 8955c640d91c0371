"""Laws that machines have, hidden by the independent simulator: named, sized, and carried into the corrected FMU."""

import math

import numpy as np
import pytest

from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.proof.corrected import start_values
from orchestrator.plants.known.drivetrain import PLANT, realised
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from pyfmu_sources import drivetrain_parameters as dt
from pyfmu_sources.drive_request import followed_request
from tests.support.independent_plant import SIGMA_M, make_record

MODEL = default_model()

# What is hidden -> (label, parameter, its value).
HIDDEN = {
    "second lag": ({"tau2": 0.04}, "drive_filter@actuator", "time_constant", 0.04),
    "directional friction": ({"dv_l": 0.6}, "directional_friction@load", "difference", 0.6),
    "spring": ({"ks": 12.0}, "spring_load@load", "stiffness", 12.0),
    "varying inertia": ({"jvar": 0.1}, "varying_inertia@load", "amplitude", 0.56),
    "rate limit": ({"slew": 1500.0}, "rate_limit@actuator", "rate", 1500.0),
    "friction with load": ({"mu_m": 0.03}, "load_dependent_friction@motor", "coefficient", 0.03),
    "hysteresis": ({"bw": 30.0, "bw_x": 0.01}, "shaft_hysteresis@shaft", "torque", 30.0),
}


def record_of(hidden: dict[str, float], seed: int, seconds: float = 14.0):
    columns, truth = make_record(hidden, seed, seconds)
    return record_from_columns(columns, f"record-{seed}"), truth


@pytest.mark.slow
@pytest.mark.parametrize("law", HIDDEN)
def test_a_law_is_named_and_sized(law: str) -> None:
    hidden, label, parameter, value = HIDDEN[law]
    record, truth = record_of(hidden, 4100)
    found = diagnose(record, MODEL)
    assert [f"{effect.name}@{effect.site}" for effect in found.effects] == [label]
    if law == "varying inertia":
        value = 0.1 * truth["linear"]["J_l"]
    assert abs(found.effects[0].parameters[parameter].value) == pytest.approx(value, rel=0.03)
    assert max(misfit.after / misfit.noise for misfit in found.misfit) < 1.5


@pytest.mark.slow
def test_both_end_stops_are_named_with_one_stiffness() -> None:
    record, _ = record_of({"stop": 0.5, "stop_k": 2e4, "stop_d": 0.2}, 4103)
    found = diagnose(record, MODEL)
    stops = {effect.name: effect.parameters for effect in found.effects}
    assert set(stops) == {"lower_end_stop", "upper_end_stop"}
    for name, angle in (("lower_end_stop", -0.5), ("upper_end_stop", 0.5)):
        assert stops[name]["angle"].value == pytest.approx(angle, rel=1e-3)
        assert stops[name]["stiffness"].value == pytest.approx(2e4, rel=0.02)
        assert stops[name]["dissipation"].value == pytest.approx(0.2, rel=0.05)
    values = start_values(PLANT, found.workings.final.p)
    assert values["effects.end_stop.upper"] == pytest.approx(0.5, rel=1e-3)
    assert values["effects.end_stop.lower"] == pytest.approx(-0.5, rel=1e-3)


def test_friction_that_builds_up_is_part_of_the_corrected_plant() -> None:
    record, _ = record_of({"Fc_m": 1.0}, 4200)
    found = diagnose(record, MODEL)
    assert {effect.name for effect in found.effects} <= {"coulomb_friction", "stribeck_friction"}
    assert max(misfit.after / misfit.noise for misfit in found.misfit) < 1.5
    values = start_values(PLANT, found.workings.final.p)
    # A nuisance that a sample of 5 ms shows to a factor of two at best: the misfit above is what matters.
    assert 0.5 / SIGMA_M < values["effects.presliding.motor.distance"] < 2.0 / SIGMA_M
    assert "effects.presliding.load.distance" not in values


def test_distances_reach_the_fmu_only_with_their_effect() -> None:
    p = PLANT.extended(dt.DEFAULTS)
    p[PLANT.index("presliding.motor")] = math.log(1e-4)
    p[PLANT.index("contact.onset")] = math.log(2e-4)
    assert tuple(realised(p)) == dt.DEFAULTS
    p[dt.P_COULOMB_M], p[dt.P_COULOMB_L], p[dt.P_ALPHA] = 1.0, 2.0, 0.01
    own = realised(p)
    assert own[dt.P_PRESLIDING_M] == pytest.approx(1e-4)
    assert own[dt.P_PRESLIDING_L] == 0.0  # at its default: nothing was fitted
    assert own[dt.P_ONSET] == pytest.approx(2e-4)
    p[PLANT.index("presliding.motor")] = math.log(1e-9)
    assert realised(p)[dt.P_PRESLIDING_M] == 0.0
    p[PLANT.index("presliding.motor")] = PLANT.extended(dt.DEFAULTS)[PLANT.index("presliding.motor")]
    p[dt.P_PRESLIDING_M] = 3e-3
    assert realised(p)[dt.P_PRESLIDING_M] == 3e-3


@pytest.mark.parametrize(("lag", "limit"), [(0.02, 1e12), (0.0, 300.0), (0.02, 300.0), (0.0, 1e12)])
def test_a_request_behind_lag_and_rate_limit_follows_its_equation(lag: float, limit: float) -> None:
    end, mean = followed_request(-1.0, 2.0, lag, limit, 0.03)
    fine, request, total = 200_000, -1.0, 0.0
    for _ in range(fine):
        wanted = (2.0 - request) / lag if lag > 0.0 else np.inf
        step = min(min(wanted, limit) * 0.03 / fine, 2.0 - request)
        total += (request + 0.5 * step) / fine
        request += step
    assert end == pytest.approx(request, abs=1e-4)
    assert mean == pytest.approx(total, abs=1e-4)
