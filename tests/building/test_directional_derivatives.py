"""Directional derivatives of native FMUs, against differences of their own derivatives and outputs."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave

from orchestrator.building.compilers import find_compiler

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

POINTS = 5
NUDGE = 1e-5  # of a nominal value: truncation and rounding of a central difference are both below AGREE
AGREE = 1e-6  # of the largest entry in a column
SHAFT = {
    "alpha": 0.01,
    "theta_m_start": 0.08,
    "effects.hardening_stiffness.cubic": 2e4,
    "effects.hardening_stiffness.sharpness": 0.7,
    "effects.varying_stiffness.amplitude": 0.1,
    "effects.shaft_hysteresis.torque": 2.0,
    "effects.gear_eccentricity.amplitude": 1e-3,
    "effects.gear_eccentricity.lever_arm": 0.3,
    "effects.impact_damping.depth": 1e-3,
}
FRICTION = {
    "alpha": 0.01,
    "effects.stribeck_friction.motor.coulomb": 0.8,
    "effects.stribeck_friction.motor.breakaway": 1.4,
    "effects.coulomb_friction.load.torque": 2.0,
    "effects.presliding.motor.distance": 1e-3,
    "effects.load_dependent_friction.load.coefficient": 0.05,
    "effects.periodic_friction.load.amplitude": 0.5,
    "effects.directional_friction.motor.difference": 0.02,
}
LOAD = {
    "effects.gravity_load.amplitude": 5.0,
    "effects.quadratic_drag.coefficient": 0.3,
    "effects.extra_resonance.inertia": 0.5,
    "effects.spring_load.stiffness": 3.0,
    "effects.spring_load.cubic": 2.0,
    "effects.end_stop.upper": 0.1,
    "effects.varying_inertia.amplitude": 0.4,
    "effects.torque_ripple.amplitude": 1.0,
    "effects.torque_ripple.second.amplitude": 0.3,
    "effects.drive_filter.time_constant": 0.02,
}
CASES = {
    **{f"model {n}": {"alpha": 0.01, "backlash_model": n, "theta_m_start": 0.08} for n in range(1, 7)},
    "shaft": SHAFT,
    "friction": FRICTION,
    "load": LOAD,
}


@pytest.fixture(scope="module")
def plant(build_native: Callable[..., dict[str, Path]]) -> Path:
    return build_native(["Drivetrain"])["Drivetrain"]


@pytest.fixture(scope="module")
def opened(plant):
    description = read_model_description(str(plant))
    return description, extract(str(plant)), {v.name: v.valueReference for v in description.modelVariables}


def started(opened, kind, start):
    """An instance behind its initialisation."""
    description, folder, references = opened
    interface = description.modelExchange if kind is FMU2Model else description.coSimulation
    fmu = kind(guid=description.guid, unzipDirectory=folder, modelIdentifier=interface.modelIdentifier)
    fmu.instantiate()
    for name, value in start.items():
        whole = name == "backlash_model"
        (fmu.setInteger if whole else fmu.setReal)([references[name]], [value])
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu


def ended(fmu):
    fmu.terminate()
    fmu.freeInstance()


def known_and_unknown(references):
    states = [name for name in references if name.startswith("state.")]
    outputs = ["theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft"]
    return [*states, "u", "T_l"], [*(f"der({name})" for name in states), *outputs]


@pytest.mark.parametrize("name", CASES)
def test_columns_are_those_of_differences(opened, name):
    _, _, references = opened
    known, unknown = known_and_unknown(references)
    count = len(known) - 2
    nominal = np.array([1.0, 10.0, 1.0, 10.0, 100.0, 1.0, 10.0, 1e-2, 1e-3, 1e-3, 1.0, 100.0, 100.0, 100.0])
    rng = np.random.default_rng(sorted(CASES).index(name))
    fmu = started(opened, FMU2Model, CASES[name])

    def response(point):
        fmu.setReal([references["u"], references["T_l"]], point[count:].tolist())
        fmu.setContinuousStates((ctypes.c_double * count)(*point[:count]), count)
        return np.array(fmu.getReal([references[n] for n in unknown]))

    fmu.setReal([references["u"], references["T_l"]], [1.0, 0.5])
    fmu.newDiscreteStates()
    fmu.enterContinuousTimeMode()
    nonzero = 0
    for _ in range(POINTS):
        point = rng.normal(0.0, 0.05, len(known)) * nominal
        for n, variable in enumerate(known):
            step = np.zeros(len(known))
            step[n] = NUDGE * nominal[n]
            expected = (response(point + step) - response(point - step)) / (2.0 * step[n])
            response(point)
            column = fmu.getDirectionalDerivative([references[v] for v in unknown], [references[variable]], [1.0])
            column = np.array(column)
            assert np.max(np.abs(column - expected)) <= AGREE * max(np.max(np.abs(expected)), 1.0), (variable, column)
            nonzero += np.count_nonzero(column)
        seeds = rng.normal(0.0, 1.0, len(known))
        places = ([references[v] for v in unknown], [references[v] for v in known])
        columns = [fmu.getDirectionalDerivative(places[0], [r], [s]) for r, s in zip(places[1], seeds, strict=True)]
        whole = np.array(fmu.getDirectionalDerivative(*places, seeds.tolist()))
        assert np.allclose(whole, np.sum(columns, axis=0), rtol=1e-12, atol=1e-9)
    assert nonzero >= 10 * POINTS
    ended(fmu)


def test_a_rigid_gear_hands_the_load_torque_on_in_co_simulation(opened):
    """In co-simulation outputs follow inputs where they do in the model: the shaft torque of a closed rigid gear."""
    _, _, references = opened
    fmu = started(opened, FMU2Slave, {"alpha": 0.0, "backlash_model": 5, "theta_m_start": 0.0})
    fmu.setReal([references["u"]], [5.0])
    fmu.doStep(0.0, 0.01)
    torque, slope = [references["T_shaft"]], fmu.getDirectionalDerivative
    found = slope(torque, [references["T_l"]], [1.0])[0]
    values = []
    for load in (-0.5, 0.5):
        fmu.setReal([references["T_l"]], [load])
        values.append(fmu.getReal(torque)[0])
    assert found == pytest.approx(values[1] - values[0], rel=1e-9, abs=1e-12)
    assert slope([references["theta_m"]], [references["T_l"]], [1.0]) == [0.0]
    ended(fmu)


@pytest.mark.parametrize(("unknown", "known"), [("contact", "u"), ("u", "u"), ("theta_m", "alpha"), ("theta_m", "T_m")])
def test_what_has_no_derivative_is_refused(opened, unknown, known):
    _, _, references = opened
    fmu = started(opened, FMU2Slave, {})
    with pytest.raises(FMICallException):
        fmu.getDirectionalDerivative([references[unknown]], [references[known]], [1.0])
    ended(fmu)


def test_the_description_says_so(opened):
    description = opened[0]
    assert description.modelExchange.providesDirectionalDerivative
    assert description.coSimulation.providesDirectionalDerivative
