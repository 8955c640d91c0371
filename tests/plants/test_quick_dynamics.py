"""Plants with what is far quicker than a communication step: the drive's lag, friction that falls with speed."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pyfmu_sources.axis import axis_equations, servo_axis
from pyfmu_sources.drivetrain import drivetrain, smooth_mode
from pyfmu_sources.drivetrain.equations import NAMES, parameters
from pyfmu_sources.laws.parameter_rows import with_values


def axis(values: dict[str, float]) -> tuple[float, ...]:
    return with_values(axis_equations.DEFAULTS, values)


@pytest.mark.parametrize("tau", [1e-6, 1e-3, 0.5])
def test_a_drive_of_any_lag_moves_a_pendulum_as_its_equations_say(tau):
    """Communication points 0.1 s apart: its lag may be a hundred thousandth of that."""
    p = with_values(parameters(tau=tau), {"effects.gravity_load.amplitude": 40.0})
    v = dict(zip(NAMES, p, strict=True))
    torques, h = [60.0, -20.0, 5.0], 0.1
    x, states = drivetrain.consistent_start((0.0,) * 12, p), []
    mode, table = drivetrain.initial_mode(x, p), drivetrain.prepare(p, h)
    for u in torques:
        x, mode = drivetrain.advance(x, mode, p, u, 0.0, h, table)
        states.append(np.array(x))

    def rates(t, y, u, before):
        torque = u + (before - u) * math.exp(-t / tau)
        twist, rate = y[0] / v["i"] - y[2], y[1] / v["i"] - y[3]
        shaft = v["k"] * twist + v["c"] * rate
        load = shaft - v["b_l"] * y[3] - 40.0 * math.sin(y[2])
        return [y[1], (torque - v["b_m"] * y[1] - shaft / v["i"]) / v["J_m"], y[3], load / v["J_l"]]

    y, drive = np.zeros(4), 0.0
    for u, found in zip(torques, states, strict=True):
        layer = min(50.0 * tau, h)
        for begin, end in ((0.0, layer), (layer, h)):
            if end > begin:
                y = solve_ivp(rates, (begin, end), y, args=(u, drive), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        drive = u + (drive - u) * math.exp(-h / tau)
        assert np.abs(found[:4] - y).max() < 1e-9 * np.abs(y).max()
        assert found[4] == pytest.approx(drive, abs=1e-9)


@pytest.mark.parametrize("tau", [1e-6, 1e-3, 0.05])
def test_a_sliding_axis_with_a_lag_moves_as_its_closed_form_says(tau):
    J, b, dry, h = 0.01, 0.05, 0.2, 8e-3
    p = axis({"J": J, "b": b, "tau": tau, "effects.coulomb_friction.motor.torque": dry})
    x, mode, drive = servo_axis.start(0.0, 3.0, 0.0, p), 1, 0.0
    angle, speed, slow, quick = 0.0, 3.0, b / J, 1.0 / tau
    for u in (1.0, 0.4, 0.8):
        x, mode = servo_axis.advance(x, mode, p, u, 0.0, h)
        part, rest = (drive - u) / J / (slow - quick), (u - dry) / b
        free = speed - rest - part
        angle += free * -math.expm1(-slow * h) / slow + rest * h + part * -math.expm1(-quick * h) / quick
        speed = free * math.exp(-slow * h) + rest + part * math.exp(-quick * h)
        drive = u + (drive - u) * math.exp(-quick * h)
        assert x[0] == pytest.approx(angle, rel=5e-9)
        assert x[1] == pytest.approx(speed, rel=5e-9)
        assert x[2] == pytest.approx(drive, abs=1e-12)


@pytest.mark.parametrize("stribeck_speed", [3e-4, 0.05, 2.0])
def test_friction_that_falls_at_any_speed_slows_an_axis_as_its_equation_says(stribeck_speed):
    """Down through the speed at which it falls, to rest, in steps that each method chooses for itself."""
    J, b, dry, more = 0.01, 0.05, 0.2, 0.15
    names = ("coulomb", "breakaway", "stribeck_speed")
    values = {
        f"effects.stribeck_friction.motor.{n}": v for n, v in zip(names, (dry, more + dry, stribeck_speed), strict=True)
    }
    p = axis({"J": J, "b": b} | values)

    def rates(_, y):
        level = dry + more * math.exp(-((y[1] / stribeck_speed) ** 2))
        return [y[1], (-b * y[1] - level) / J]

    def stops(_, y):
        return y[1]

    stops.terminal = True
    truth = solve_ivp(rates, (0.0, 1.0), [0.0, 3.0], events=stops, method="LSODA", rtol=1e-11, atol=1e-13)
    x, mode = servo_axis.start(0.0, 3.0, 0.0, p), 1
    for _ in range(20):
        x, mode = servo_axis.advance(x, mode, p, 0.0, 0.0, 8e-3)
    assert truth.t[-1] < 0.16
    assert x[1] == 0.0
    assert x[0] == pytest.approx(truth.y[0, -1], rel=1e-6)


def counted(monkeypatch, module, name) -> list[int]:
    """Count from now on how often a module calls a function."""
    calls, function = [0], getattr(module, name)

    def call(*given):
        calls[0] += 1
        return function(*given)

    monkeypatch.setattr(module, name, call)
    return calls


@pytest.mark.parametrize(
    "values",
    [
        {"tau": 1e-6, "effects.coulomb_friction.motor.torque": 0.05},
        {"effects.stribeck_friction.motor.breakaway": 0.1, "effects.stribeck_friction.motor.stribeck_speed": 4e-4},
    ],
)
def test_an_axis_takes_short_steps_only_while_they_are_needed(monkeypatch, values):
    """A step follows the lag while the torque is behind, and falling friction while the speed is near its own."""
    steps, p = counted(monkeypatch, servo_axis.machine, "runge_kutta"), axis({"J": 0.0023, "b": 0.046} | values)
    x, mode = servo_axis.start(0.0, 0.5, 0.0, p), 1
    for n in range(25):
        x, mode = servo_axis.advance(x, mode, p, 0.3 * math.sin(0.35 * n + 0.3), 0.0, 8e-3)
    assert np.isfinite(x).all()
    assert steps[0] < 25 * 250


def test_a_quick_drive_asks_a_drivetrain_for_no_short_steps(monkeypatch):
    steps = counted(monkeypatch, smooth_mode.machine, "runge_kutta")
    p = with_values(parameters(tau=1e-6), {"effects.gravity_load.amplitude": 0.5})
    x = drivetrain.consistent_start((0.0,) * 12, p)
    mode, table = drivetrain.initial_mode(x, p), drivetrain.prepare(p, 1.2e-3)
    for n in range(40):
        x, mode = drivetrain.advance(x, mode, p, 0.6 * math.sin(0.1 * n), 0.0, 1.2e-3, table)
    assert steps[0] < 40 * 60
