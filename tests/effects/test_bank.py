"""The one bank of effects: what a body resists with makes no energy."""

from collections.abc import Callable

import numpy as np
import pytest

from orchestrator.effects.effect import Effect, PlaceScales
from orchestrator.effects.of_fmus import BANK, PORT, FmuEffect
from orchestrator.effects.of_plants import PLANT_BANK
from pyfmu_sources.axis import axis_equations
from pyfmu_sources.drivetrain import equations
from pyfmu_sources.laws import body as port
from pyfmu_sources.laws.parameter_rows import with_values

ROUNDS, SAMPLES = 6, 4000
PLACE = PlaceScales(0.01, 1.0, 2.0, np.linspace(-1.0, 1.0, 50), speed=1.0, span=2.0, cycles=(5.0,))
# What is no resistance, or whose size depends on the direction or the place.
MAY_DRIVE = {"sensor_offset@load", "directional_friction@load", "directional_friction@port", "stribeck_friction@port",
             "extra_resonance@load", "varying_inertia@load"}  # fmt: skip
RESIST_AT_LOAD = [row for row in PLANT_BANK if row.site == "load" and row.label not in MAY_DRIVE]
# Two rounds of one motion each: at equal speeds both ways, and quicker one way than back.
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


def motions() -> list[Motion]:
    """Motions that come back to where they began: position, speed and time step."""
    time = np.linspace(0.0, 2.0 * np.pi * ROUNDS, SAMPLES * ROUNDS + 1)
    warped = time - 0.6 * np.cos(time)  # quick up, slow down
    found = []
    for phase in (time, warped):
        x = np.sin(phase) + 0.3 * np.sin(2.0 * phase)
        found.append((0.5 * (x[1:] + x[:-1]), np.diff(x) / np.diff(time), np.diff(time)))
    return found


def work(force: Callable[[float, float, float, float], float], motion: Motion) -> float:
    """What a force against a motion takes from it, once round after round [its unit by that of the way]."""
    x, v, h = motion
    a = np.gradient(v) / h
    last = len(x) * (ROUNDS - 1) // ROUNDS  # what builds up has done so by then
    taken = [force(*row) * row[1] * row[3] for row in zip(x, v, a, h, strict=True)]
    return float(np.sum(taken[last:]))


def at_port(effect: FmuEffect, values: np.ndarray) -> Callable[[float, float, float, float], float]:
    """The force of a law around an FMU, with its memory."""
    law, q, memory = effect.row.law, [*values, 0.0, 0.0, 0.0, 0.0], [0.0]

    def force(x: float, v: float, a: float, h: float) -> float:
        half = 0.0
        if port.has_memory(law):
            distance = port.distance_of(law, q[1], q[3])
            half = port.built_up(law, memory[0], v, distance, 0.5 * h)
            memory[0] = port.built_up(law, memory[0], v, distance, h)
        return port.resistance(law, x, v, a, half, q[0], q[1], q[2])

    return force


def least_work(row: Effect) -> float:
    """The least that a law at a port takes from a motion, over many values that are possible."""
    effect, rng, found = FmuEffect(row, "p", PLACE), np.random.default_rng(2), []
    while len(found) < 8:
        _, values = effect.at(tuple(rng.uniform(-1.0, 1.0, len(row.parameters)) * rng.choice([0.3, 1.0, 6.0])))
        if (effect.is_possible(tuple(values)) and not (values <= 1e-200).any()) or row.signed:
            found += [work(at_port(effect, values), motion) / np.abs(values).max() for motion in motions()]
    return min(found)


@pytest.mark.parametrize("row", [row for row in BANK.values() if row.site == PORT], ids=lambda row: row.name)
def test_a_law_at_a_port_makes_no_energy(row: Effect) -> None:
    if row.label not in MAY_DRIVE:
        assert least_work(row) > -2e-3
    elif row.name == "directional_friction":
        assert least_work(row) < -1e-2  # quicker one way than back, it drives


def of_axis(values: dict[str, float]) -> Callable[[float, float, float, float], float]:
    p, plain = with_values(axis_equations.DEFAULTS, values), axis_equations.DEFAULTS

    def force(x: float, v: float, a: float, h: float) -> float:
        sign = 1.0 if v > 0.0 else -1.0
        rates = [axis_equations.rates((x, v, 0.0, 0.0, 0.0), sign, q, 0.0, 0.0)[1] for q in (plain, p)]
        return (rates[0] - rates[1]) * plain.J

    return force


def of_load(values: dict[str, float]) -> Callable[[float, float, float, float], float]:
    plain = equations.parameters(backlash_model=0.0, k=0.0, c=0.0)
    p = with_values(plain, values)

    def force(x: float, v: float, a: float, h: float) -> float:
        state, sign = (0.0, 0.0, x, v, 0.0, x, v, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0 if v > 0.0 else -1.0
        rates = [equations.rates(state, 0, 0.0, sign, q, 0.0, 0.0)[3] for q in (plain, p)]
        return (rates[0] - rates[1]) * plain.J_l

    return force


@pytest.mark.parametrize("row", RESIST_AT_LOAD, ids=lambda row: row.name)
def test_a_law_of_the_plants_makes_no_energy(row: Effect) -> None:
    sizes = {"angle": 0.4, "stiffness": 3.0, "phase": 0.7, "stribeck_speed": 0.5, "coulomb": 0.5}
    values = {full: sizes.get(short, 1.0) for short, full in row.parameters.items()}
    for force in (of_load(values), *([of_axis(values)] if set(values) <= set(axis_equations.NAMES) else [])):
        taken = [work(force, motion) for motion in motions()]
        assert min(taken) > -2e-3, taken


def test_laws_that_may_make_energy_are_in_the_bank() -> None:
    assert {row.label for row in (*PLANT_BANK, *BANK.values())} >= MAY_DRIVE
