"""Model exchange of the native single axis: against its co-simulation, located events and differences."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model

from orchestrator.building.compilers import find_compiler
from pyfmu_sources.axis import servo_axis
from pyfmu_sources.axis.axis_equations import DEFAULTS, NAMES
from pyfmu_sources.laws.parameter_rows import with_values
from tests.support.model_exchange import (
    END,
    STEP,
    compare_directional_derivatives,
    event_times,
    first_time,
    request,
    stepped_and_exchanged,
)

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

COULOMB = {"tau": 0.02, "effects.coulomb_friction.motor.torque": 15.0}
STOPS = {"effects.end_stop.upper": 0.4, "effects.end_stop.lower": -0.4, "effects.end_stop.stiffness": 2000.0}
CASES = {
    "lag": {"tau": 0.05},
    "stick_slip": COULOMB,
    "stribeck_and_ripple": {
        "effects.stribeck_friction.motor.coulomb": 3.0,
        "effects.stribeck_friction.motor.breakaway": 5.0,
        "effects.torque_ripple.amplitude": 1.0,
        "effects.periodic_friction.motor.amplitude": 0.5,
    },
    "bristle": {
        "effects.coulomb_friction.motor.torque": 5.0,
        "effects.presliding.motor.distance": 1e-2,
        "effects.presliding.motor.damping": 0.5,
    },
    "end_stops": STOPS,
    "filter_and_load": {
        "effects.drive_filter.time_constant": 0.05,
        "effects.torque_saturation.limit": 15.0,
        "effects.spring_load.stiffness": 20.0,
        "effects.gravity_load.amplitude": 4.0,
        "effects.varying_inertia.amplitude": 0.2,
    },
}
OUTPUTS = ["theta_m", "omega_m", "T_m"]


@pytest.fixture(scope="module")
def axis(build_native: Callable[..., dict[str, Path]]) -> Path:
    return build_native(["ServoAxis"])["ServoAxis"]


@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_the_cosimulation(axis: Path, name: str) -> None:
    stepped, integrated = stepped_and_exchanged(axis, CASES[name], OUTPUTS)
    assert len(integrated) == len(stepped) == round(END / STEP) + 1
    assert np.ptp(stepped["theta_m"]) > 0.1
    assert np.max(np.abs(integrated["theta_m"] - stepped["theta_m"])) < 1e-6


@pytest.mark.parametrize(("start", "kind"), [(COULOMB, "turns"), (COULOMB, "breaks away"), (STOPS, "stop")])
def test_events_are_met_at_their_time(axis: Path, start: dict[str, float], kind: str) -> None:
    """The first of a kind, against the time found by halving a step of the co-simulated axis."""
    p = with_values(DEFAULTS, {name: value for name, value in start.items() if name in NAMES})
    x = servo_axis.start(0.0, 0.0, 0.0, p)
    mode = servo_axis.initial_mode(x, p, request(0))

    def reached(x: tuple[float, ...], mode: int) -> bool:
        if kind == "stop":
            return servo_axis.past_stop(x, p) != 0
        return mode != 1 if kind == "turns" else mode != 0

    n, slides = 0, kind != "turns"
    while n * STEP < END:
        after, mode_after = servo_axis.advance(x, mode, p, request(n), 0.0, STEP)
        if slides and reached(after, mode_after):
            break
        slides = slides or mode_after == 1
        x, mode, n = after, mode_after, n + 1
    event = n * STEP + first_time(lambda h: reached(*servo_axis.advance(x, mode, p, request(n), 0.0, h)))
    assert min(abs(t - event) for t in event_times(axis, start)) < 1e-9


@pytest.mark.parametrize("name", CASES)
def test_directional_derivatives_are_those_of_differences(axis: Path, name: str) -> None:
    description = read_model_description(str(axis))
    references = {v.name: v.valueReference for v in description.modelVariables}
    states = [n for n in references if n.startswith("state.")]
    known, unknown = [*states, "u", "T_l"], [*(f"der({n})" for n in states), *OUTPUTS]
    nominal = np.array([1.0, 10.0, 10.0, 1e-3, 10.0, 10.0, 10.0])
    fmu = started(axis, CASES[name])
    fmu.setReal([references["u"]], [30.0])
    fmu.newDiscreteStates()
    fmu.enterContinuousTimeMode()

    compare_directional_derivatives(fmu, references, known, unknown, nominal, sorted(CASES).index(name))
    fmu.terminate()
    fmu.freeInstance()


def started(axis: Path, start: dict[str, float]) -> FMU2Model:
    """An instance behind its initialisation."""
    description = read_model_description(str(axis))
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Model(guid=description.guid, unzipDirectory=extract(str(axis)), modelIdentifier="ServoAxis")
    fmu.instantiate()
    for name, value in start.items():
        fmu.setReal([references[name]], [value])
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu


@pytest.mark.parametrize("start", [{"effects.input_delay.delay": 0.1}, {"effects.rate_limit.rate": 5.0}])
def test_what_needs_time_events_is_refused(axis: Path, start: dict[str, float]) -> None:
    with pytest.raises(FMICallException):
        started(axis, start)
