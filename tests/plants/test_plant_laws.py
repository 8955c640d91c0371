"""Every law of the plants against the independent simulator, which shares no code with them."""

import numpy as np
import pytest

from pyfmu_sources.axis import axis_equations
from pyfmu_sources.drivetrain.equations import NAMES, parameters
from pyfmu_sources.laws.parameter_rows import with_values
from tests.support import independent_plant as truth
from tests.support.compiled_plants import compiled_plant

RATE = 200.0
BREAKAWAY_M, BREAKAWAY_L = 0.9, 3.0

# Friction that depends on load or position does so at once while a part slides; the independent simulator's bristle
# follows with a lag of its distance. Its own friction is of first order: its error is what the other tolerances allow.
# Law -> (of the independent simulator, of the plant, tolerance [rad]).
LAWS = {
    "spring": (
        {"ks": 60.0, "ks3": 25.0, "ks_x": 0.2},
        {"spring_load.stiffness": 60.0, "spring_load.cubic": 25.0, "spring_load.angle": 0.2}, 1e-7),
    "end stops": (
        {"stop": 0.25, "stop_k": 4000.0, "stop_d": 0.3},
        {"end_stop.lower": -0.25, "end_stop.upper": 0.25, "end_stop.stiffness": 4000.0, "end_stop.dissipation": 0.3},
        2e-5),
    "directional": (
        {"dv_m": 0.08, "dv_l": -0.5},
        {"directional_friction.motor.difference": 0.08, "directional_friction.load.difference": -0.5}, 1e-6),
    "harmonics": (
        {"rip": 1.0, "rip_n": 6.0, "rip2": 0.7, "rip2_ph": 0.3, "rip3": -0.5, "rip3_ph": 1.0},
        {"torque_ripple.amplitude": 1.0, "torque_ripple.second.amplitude": 0.7, "torque_ripple.second.phase": 0.3,
         "torque_ripple.third.amplitude": -0.5, "torque_ripple.third.phase": 1.0}, 1e-6),
    "varying stiffness": (
        {"kvar": 0.3, "kvar_n": 2.0, "kvar_ph": 0.5},
        {"varying_stiffness.amplitude": 0.3, "varying_stiffness.cycles_per_rev": 2.0, "varying_stiffness.phase": 0.5},
        1e-7),
    "varying inertia": (
        {"jvar": 0.2},
        {"varying_inertia.amplitude": 0.2 * 5.6, "varying_inertia.phase": np.pi / 2.0}, 1e-7),
    "shaft hysteresis": (
        {"bw": 30.0, "bw_x": 0.004}, {"shaft_hysteresis.torque": 30.0, "shaft_hysteresis.twist": 0.004}, 1e-6),
    "second lag": ({"tau2": 0.05}, {"drive_filter.time_constant": 0.05}, 2e-6),
    "rate limit": ({"slew": 400.0}, {"rate_limit.rate": 400.0}, 2e-6),
    "both": (
        {"tau2": 0.02, "slew": 900.0}, {"drive_filter.time_constant": 0.02, "rate_limit.rate": 900.0}, 2e-6),
    "presliding": (
        {"Fc_m": BREAKAWAY_M, "Fc_l": BREAKAWAY_L},
        {"coulomb_friction.motor.torque": BREAKAWAY_M, "coulomb_friction.load.torque": BREAKAWAY_L}, 4e-5),
    "presliding, falling": (
        {"Fc_m": BREAKAWAY_M, "Fs_m": 0.5, "vs": 0.5},
        {"stribeck_friction.motor.coulomb": BREAKAWAY_M, "stribeck_friction.motor.breakaway": BREAKAWAY_M + 0.5,
         "stribeck_friction.motor.stribeck_speed": 0.5}, 2e-5),
    "load-dependent": (
        {"Fc_m": BREAKAWAY_M, "mu_m": 0.06, "Fc_l": BREAKAWAY_L, "mu_l": 0.04},
        {"coulomb_friction.motor.torque": BREAKAWAY_M, "coulomb_friction.load.torque": BREAKAWAY_L,
         "load_dependent_friction.motor.coefficient": 0.06, "load_dependent_friction.load.coefficient": 0.04}, 4e-3),
    "position-dependent": (
        {"Fc_m": BREAKAWAY_M, "wav_m": 0.5, "wav_n": 3.0, "wav_ph": 0.4},
        {"coulomb_friction.motor.torque": BREAKAWAY_M, "periodic_friction.motor.amplitude": 0.5,
         "periodic_friction.motor.cycles_per_rev": 3.0, "periodic_friction.motor.phase": 0.4}, 3e-3),
}  # fmt: skip


def bristles(values: dict[str, float]) -> dict[str, float]:
    """The distances and dampings that the independent simulator's bristles have."""
    found = {}
    for site, sigma in (("motor", truth.SIGMA_M), ("load", truth.SIGMA_L)):
        coulomb = values.get(f"coulomb_friction.{site}.torque", 0.0)
        rest = max(coulomb, values.get(f"stribeck_friction.{site}.breakaway", 0.0))
        rest += values.get(f"load_dependent_friction.{site}.coefficient", 0.0)  # of 1 N.m of the shaft's torque
        if rest > 0.0:
            found[f"presliding.{site}.distance"] = rest / sigma
            found[f"presliding.{site}.damping"] = 0.02 * np.sqrt(sigma)
    return found


def record(hidden: dict[str, float], seconds: float = 6.0) -> tuple[dict, dict]:
    return truth.make_record(
        hidden, 5, seconds, RATE, mismatch=0.0, noise=(0.0, 0.0), counts=None, excitation="levels", substeps=400,
        torque=0.5, linear={"tau": 0.1},
    )  # fmt: skip


def simulated(own: dict[str, float], u: np.ndarray) -> np.ndarray:
    plant = compiled_plant("drivetrain")
    p = with_values(parameters(tau=0.1), {f"effects.{name}": value for name, value in own.items()})
    x = plant.consistent_start((0.0,) * 8, p)
    mode, table, angles = plant.initial_mode(x, p), plant.prepare(p, 1.0 / RATE), []
    for torque in u:
        angles.append((x[0], x[2]))
        x, mode = plant.advance(x, mode, p, float(torque), 0.0, 1.0 / RATE, table)
    return np.array(angles)


@pytest.mark.parametrize("law", LAWS)
def test_law_agrees_with_the_independent_simulator(law: str) -> None:
    hidden, own, tolerance = LAWS[law]
    columns, _ = record(hidden)
    plain, _ = record({})
    measured = np.column_stack([columns["theta_m"], columns["theta_l"]])
    change = np.abs(columns["theta_m"] - plain["theta_m"]).max()
    found = simulated(own | bristles(own), columns["u"])
    assert change > 1e-3
    assert np.abs(found - measured).max() < tolerance
    assert np.abs(found - measured).max() < 0.05 * change


def test_every_effect_of_the_table_is_off_by_default() -> None:
    plant = compiled_plant("drivetrain")
    assert not plant.has_nonlinear_effect(parameters())
    assert len(NAMES) == len(set(NAMES))


def test_friction_that_builds_up_over_no_distance_is_the_set_valued_one() -> None:
    u = 6.0 * np.cos(2.0 * np.pi * 1.2 * np.arange(400) / RATE)
    own = {"coulomb_friction.motor.torque": 1.0, "coulomb_friction.load.torque": 2.0}
    exact = simulated(own, u)
    errors = []
    for distance in (1e-3, 1e-4, 1e-5):
        near = own | {"presliding.motor.distance": distance, "presliding.load.distance": distance / 4.0}
        errors.append(np.abs(simulated(near, u) - exact).max())
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2] > 0.0


AXIS = {
    "spring": ({"spring_load_stiffness": 6.0, "spring_load_cubic": 2.0, "spring_load_angle": 0.1}, 1e-7),
    "end stops": ({"end_stop_lower": -0.2, "end_stop_upper": 0.3, "end_stop_stiffness": 500.0}, 1e-5),
    "harmonics": (
        {
            "torque_ripple_amplitude": 0.5,
            "torque_ripple_second_amplitude": 0.3,
            "torque_ripple_third_amplitude": 0.2,
            "torque_ripple_third_phase": 0.4,
        },
        1e-6,
    ),
    "varying inertia": ({"varying_inertia_amplitude": 0.3, "varying_inertia_cycles_per_rev": 2.0}, 1e-7),
    "presliding": (
        {"coulomb_friction_motor_torque": 1.0, "presliding_motor_distance": 2e-3, "presliding_motor_damping": 1.0},
        1e-6,
    ),
    "presliding, falling": (
        {
            "stribeck_friction_motor_coulomb": 0.8,
            "stribeck_friction_motor_breakaway": 1.4,
            "stribeck_friction_motor_stribeck_speed": 0.3,
            "presliding_motor_distance": 1e-3,
        },
        1e-5,
    ),
    "second lag": ({"tau": 0.03, "drive_filter_time_constant": 0.05}, 1e-6),
    "position-dependent": (
        {
            "coulomb_friction_motor_torque": 1.0,
            "presliding_motor_distance": 2e-3,
            "periodic_friction_motor_amplitude": 0.5,
            "periodic_friction_motor_cycles_per_rev": 4.0,
        },
        2e-4,
    ),
}


def textbook(v: dict[str, float], u: np.ndarray, h: float) -> np.ndarray:
    """The axis's equations written out once more, integrated by scipy."""
    from scipy.integrate import solve_ivp

    def rates(_: float, y: np.ndarray, asked: float) -> list[float]:
        x, w, drive, z, request = y
        tau, tau2 = v.get("tau", 0.0), v.get("drive_filter_time_constant", 0.0)
        torque = drive if tau > 0.0 else asked
        cycles = v.get("torque_ripple_cycles_per_rev", 6.0)
        torque += v.get("torque_ripple_amplitude", 0.0) * np.sin(cycles * x) + v.get(
            "torque_ripple_second_amplitude", 0.0
        ) * np.sin(2 * cycles * x)
        torque += v.get("torque_ripple_third_amplitude", 0.0) * np.sin(
            3 * cycles * x + v.get("torque_ripple_third_phase", 0.0)
        )
        way = x - v.get("spring_load_angle", 0.0)
        torque -= 1.0 * w + v.get("spring_load_stiffness", 0.0) * way + v.get("spring_load_cubic", 0.0) * way**3
        if "end_stop_stiffness" in v and (x > v["end_stop_upper"] or x < v["end_stop_lower"]):
            side, edge = (1.0, v["end_stop_upper"]) if x > v["end_stop_upper"] else (-1.0, v["end_stop_lower"])
            torque -= side * max(0.0, v["end_stop_stiffness"] * side * (x - edge) * (1.0 + 0.1 * side * w))
        bend = 0.0
        if "presliding_motor_distance" in v:
            rest = v.get("coulomb_friction_motor_torque", 0.0) + max(
                v.get("stribeck_friction_motor_coulomb", 0.0), v.get("stribeck_friction_motor_breakaway", 0.0)
            )
            slope = np.exp(-((w / v.get("stribeck_friction_motor_stribeck_speed", 1.0)) ** 2))
            level = v.get("coulomb_friction_motor_torque", 0.0) + v.get("stribeck_friction_motor_coulomb", 0.0)
            level += (
                v.get("stribeck_friction_motor_breakaway", 0.0) - v.get("stribeck_friction_motor_coulomb", 0.0)
            ) * slope
            level = max(
                0.0,
                level
                + v.get("periodic_friction_motor_amplitude", 0.0)
                * np.sin(v.get("periodic_friction_motor_cycles_per_rev", 1.0) * x),
            )
            stiffness = rest / v["presliding_motor_distance"]
            bend = w - abs(w) * z * stiffness / level
            torque -= stiffness * z + v.get("presliding_motor_damping", 0.0) * bend
        cycles = v.get("varying_inertia_cycles_per_rev", 1.0)
        inertia = 1.0 + v.get("varying_inertia_amplitude", 0.0) * np.sin(cycles * x)
        torque -= 0.5 * v.get("varying_inertia_amplitude", 0.0) * cycles * np.cos(cycles * x) * w * w
        follows = (asked - request) / tau2 if tau2 > 0.0 else 0.0
        lag = ((request if tau2 > 0.0 else asked) - drive) / tau if tau > 0.0 else 0.0
        return [w, torque / inertia, lag, bend, follows]

    y, angles = np.array([0.0, 0.0, 0.0, 0.0, u[0]]), []  # the drive has settled at what is asked first
    for asked in u:
        angles.append(y[0])
        run = solve_ivp(rates, (0.0, h), y, args=(asked,), method="LSODA", rtol=1e-9, atol=1e-11)
        y = run.y[:, -1]
    return np.array(angles)


@pytest.mark.parametrize("law", AXIS)
def test_axis_agrees_with_its_equations_written_out(law: str) -> None:
    values, tolerance = AXIS[law]
    source, h = compiled_plant("servo_axis"), 0.01
    p = axis_equations.DEFAULTS._replace(**values)
    u = 4.0 * np.cos(2.0 * np.pi * 0.7 * h * np.arange(300)) + 0.5
    x = source.start(0.0, 0.0, 0.0, p)
    mode, angles = source.initial_mode(x, p, float(u[0])), []
    for asked in u:
        angles.append(x[0])
        x, mode = source.advance(x, mode, p, float(asked), 0.0, h)
    expected = textbook(values, u, h)
    assert np.ptp(expected) > 0.05
    assert np.abs(np.array(angles) - expected).max() < tolerance
