"""The two-stage drivetrain beside an independent solution, in its limits beside the drivetrain, and its energy."""

import itertools
import math

import numpy as np
import pytest

from pyfmu_sources.drivetrain import drivetrain
from pyfmu_sources.drivetrain.equations import parameters
from pyfmu_sources.hybrid.event_numbers import NO_EVENT
from pyfmu_sources.laws.parameter_rows import with_values
from pyfmu_sources.train.train_equations import (
    DEFAULTS,
    NAMES,
    Mode,
    Parameters,
    State,
    initial_mode,
    stage_torques,
    twists,
)
from pyfmu_sources.train.train_modes import after_events
from pyfmu_sources.train.train_steps import advance, advance_to_event
from pyfmu_sources.train.train_transition import prepare
from tests.support.two_stage_record import COUNTS, MISMATCHED, NOISE, make_two_stage_record
from tests.support.two_stage_record import FRICTION as FRICTION_OF_RECORDS
from tests.support.two_stage_solution import solve_two_stages, start_values

STEP = 1e-3
FRICTION = {
    "effects.coulomb_friction.motor.torque": 1.0,
    "effects.coulomb_friction.shaft.torque": 0.4,
    "effects.coulomb_friction.load.torque": 4.0,
}
CASES: dict[str, dict[str, float]] = {
    "both gaps": {},
    "stage 1": {"alpha_2": 0.0},
    "stage 2": {"alpha_1": 0.0},
    "no gap": {"alpha_1": 0.0, "alpha_2": 0.0},
    "wide gaps": {"alpha_1": 0.05, "alpha_2": 0.02},
    "light shaft": {"J_s": 0.004},
    "heavy shaft": {"J_s": 0.5, "b_s": 0.5},
    "slow drive": {"tau": 1.0},
    "quick drive": {"tau": 2e-4},
    "very quick drive": {"tau": 2e-5},
    "friction": FRICTION,
    "friction, gap of stage 2": FRICTION | {"alpha_1": 0.0},
    "one friction": {"effects.coulomb_friction.shaft.torque": 2.0},
    "load torque": {"effects.load_torque.torque": 5.0},
    "in motion": {"theta_m_start": 0.3, "omega_m_start": -3.0, "theta_s_start": 0.12, "omega_s_start": 2.0,
                  "theta_l_start": 0.1, "omega_l_start": 0.4, "T_m_start": 20.0},
}  # fmt: skip


def torques(count: int = 500, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """A request that reverses, and a load torque that comes and goes."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(5.0, 25.0, count // 50 + 1) * (-1.0) ** np.arange(count // 50 + 1), 50)[:count]
    return u, np.where(np.arange(count) % 200 < 80, 3.0, 0.0)


def run(
    p: Parameters, x: State, u: np.ndarray, T_l: np.ndarray, step: float, splits: int = 1
) -> tuple[np.ndarray, list[Mode]]:
    """The states (n + 1, 7) and modes of the plant; each sample in ``splits`` steps."""
    mode = initial_mode(x, p, float(T_l[0]))
    table = prepare(p, step / splits)
    states, modes = [x], [mode]
    for n in range(len(u)):
        for _ in range(splits):
            x, mode = advance(x, mode, p, float(u[n]), float(T_l[n]), step / splits, table)
        states.append(x)
        modes.append(mode)
    return np.array(states), modes


def all_values(values: dict[str, float]) -> dict[str, float]:
    return dict(zip(NAMES, DEFAULTS, strict=True)) | values


def plant(values: dict[str, float]) -> tuple[Parameters, State]:
    own = {name: value for name, value in values.items() if not name.endswith("_start")}
    return with_values(DEFAULTS, own), tuple(map(float, start_values(values)))


@pytest.mark.parametrize("case", CASES)
def test_the_motion_is_that_of_an_independent_solution(case: str) -> None:
    values = all_values(CASES[case])
    u, T_l = torques()
    wanted, flanks, instants = solve_two_stages(values, u, T_l, STEP)
    p, x = plant(values)
    found, modes = run(p, x, u, T_l, STEP)
    assert np.abs(found - wanted).max(axis=0)[[0, 2, 4]].max() < 1e-9, "rad"
    assert np.abs(found - wanted).max() < 1e-7, "rad/s and N.m"
    contacts = np.array([mode[:2] for mode in modes])
    for stage, name in enumerate(("alpha_1", "alpha_2")):
        if values[name] > 0.0:
            assert (contacts[:, stage] == flanks[:, stage]).all()
    assert len(instants) > 3 or values["alpha_1"] + values["alpha_2"] == 0.0


def draw_values(rng: np.random.Generator) -> dict[str, float]:
    """A machine of any proportions, with or without each gap, friction and motion at the start."""
    sizes = {
        "J_m": (0.02, 2.0), "J_s": (0.005, 2.0), "J_l": (0.1, 20.0), "i_1": (0.4, 15.0), "i_2": (0.4, 15.0),
        "k_1": (200.0, 2e4), "k_2": (200.0, 2e4), "c_1": (0.01, 5.0), "c_2": (0.01, 5.0), "b_m": (0.01, 1.0),
        "b_s": (0.001, 0.5), "b_l": (0.01, 5.0), "tau": (1e-3, 1.0), "alpha_1": (1e-3, 0.05), "alpha_2": (1e-3, 0.05),
        **dict.fromkeys(FRICTION, (0.1, 3.0)),
    }  # fmt: skip
    drawn = {name: float(np.exp(rng.uniform(*np.log(bounds)))) for name, bounds in sizes.items()}
    for name in ("alpha_1", "alpha_2", *FRICTION):
        drawn[name] *= float(rng.integers(2))
    starts = ("theta_m_start", "omega_m_start", "omega_s_start", "omega_l_start", "T_m_start")
    moves = float(rng.integers(2))
    return drawn | {n: moves * size * float(rng.normal()) for n, size in zip(starts, (0.02, 3, 2, 0.5, 5), strict=True)}


@pytest.mark.parametrize("seed", range(6))
def test_so_is_that_of_machines_of_any_proportions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values, step = all_values(draw_values(rng)), float(rng.choice([5e-4, 1e-3, 4e-3]))
    u, T_l = torques(150, seed)
    wanted, _, _ = solve_two_stages(values, u, T_l, step)
    found, _ = run(*plant(values), u, T_l, step)
    assert np.abs(found - wanted).max(axis=0)[[0, 2, 4]].max() < 1e-8


def energy(x: State, mode: Mode, p: Parameters) -> float:
    """Kinetic energy and that of both shafts [J]."""
    first, second = twists(x, p)
    wound = ((first - mode[0] * p.alpha_1) if mode[0] else 0.0, (second - mode[1] * p.alpha_2) if mode[1] else 0.0)
    kinetic = p.J_m * x[1] ** 2 + p.J_s * x[3] ** 2 + p.J_l * x[5] ** 2
    return 0.5 * (kinetic + p.k_1 * wound[0] ** 2 + p.k_2 * wound[1] ** 2)


def power(x: State, mode: Mode, p: Parameters, T_l: float) -> float:
    """What the drive gives, less what load, friction and damping take [W]."""
    first, second = stage_torques((0.0, x[1], 0.0, x[3], 0.0, x[5], 0.0), 0.0, mode, p)
    damping = first * (x[1] / p.i_1 - x[3]) + second * (x[3] / p.i_2 - x[5])
    viscous = p.b_m * x[1] ** 2 + p.b_s * x[3] ** 2 + p.b_l * x[5] ** 2
    rubbing = (
        p.coulomb_friction_motor_torque * abs(x[1])
        + p.coulomb_friction_shaft_torque * abs(x[3])
        + p.coulomb_friction_load_torque * abs(x[5])
    )
    return x[6] * x[1] - T_l * x[5] - damping - viscous - rubbing


def test_without_losses_energy_is_kept_through_every_contact() -> None:
    values = dict.fromkeys(("c_1", "c_2", "b_m", "b_s", "b_l"), 0.0) | {"omega_m_start": 4.0, "omega_l_start": -1.0}
    p, x = plant(all_values(values))
    zero = np.zeros(2000)
    states, modes = run(p, x, zero, zero, STEP)
    total = np.array([energy(tuple(row), mode, p) for row, mode in zip(states, modes, strict=True)])
    changes = sum(a[:2] != b[:2] for a, b in itertools.pairwise(modes))
    assert changes > 50
    assert np.ptp(total) < 1e-10 * total[0]


@pytest.mark.parametrize("friction", [{}, FRICTION], ids=["no friction", "friction"])
def test_energy_changes_by_what_is_given_and_taken(friction: dict[str, float]) -> None:
    p, x = plant(all_values(friction))
    u, T_l = torques(200)
    splits = 100
    fine = np.repeat(u, splits), np.repeat(T_l, splits)
    states, modes = run(p, x, *fine, STEP / splits)
    flow = [power(tuple(row), mode, p, 0.0) for row, mode in zip(states, modes, strict=True)]
    flow = np.array(flow[:-1]) - fine[1] * states[:-1, 5], np.array(flow[1:]) - fine[1] * states[1:, 5]
    given = np.cumsum(0.5 * (flow[0] + flow[1])) * STEP / splits
    total = np.array([energy(tuple(row), mode, p) for row, mode in zip(states, modes, strict=True)])
    assert total.max() > 1.0
    assert np.abs(total[1:] - total[0] - given).max() < 1e-4 * total.max()


def of_drivetrain(p: Parameters, **values: float) -> np.ndarray:
    """Angles of motor and load of a drivetrain of one stage under the same torques."""
    q = parameters(J_m=p.J_m, b_m=p.b_m, i=p.i_1 * p.i_2, tau=p.tau, **values)
    u, T_l = torques()
    x = drivetrain.consistent_start((0.0,) * 8, q)
    mode, table, found = drivetrain.initial_mode(x, q), drivetrain.prepare(q, STEP), [x]
    for n in range(len(u)):
        x, mode = drivetrain.advance(x, mode, q, float(u[n]), float(T_l[n]), STEP, table)
        found.append(x)
    return np.array(found)[:, [0, 2]]


def deviation(values: dict[str, float], one_stage: dict[str, float]) -> float:
    p, x = plant(all_values(values))
    states, _ = run(p, x, *torques(), STEP)
    return float(np.abs(states[:, [0, 4]] - of_drivetrain(p, **one_stage)).max())


@pytest.mark.parametrize("gap", [1, 2])
def test_a_light_shaft_makes_one_stage_of_two(gap: int) -> None:
    """Both springs in a row, where damping over stiffness is the same: the deviation vanishes with the inertia."""
    i_2, load = 2.0, {"J_l": 5.6, "b_l": 1.0}
    springs = {"i_2": i_2, "k_1": 1500.0, "c_1": 0.6, "k_2": 7500.0, "c_2": 3.0, "b_s": 0.0, "tau": 0.05, **load}
    gaps = {"alpha_1": 0.02 if gap == 1 else 0.0, "alpha_2": 0.01 if gap == 2 else 0.0}
    one = 1.0 / (1500.0 * i_2**2), 1.0 / 7500.0
    k = 1.0 / sum(one)
    same = {"k": k, "c": k * 4e-4, "alpha": 0.01, **load}
    rough, fine = (deviation({**springs, **gaps, "J_s": inertia}, same) for inertia in (2e-4, 2e-5))
    assert rough < 2e-3
    assert fine < 0.2 * rough


@pytest.mark.parametrize("gap", [1, 2])
def test_a_stiff_stage_makes_one_body_of_two(gap: int) -> None:
    """The intermediate shaft turns with the load (stage 2 is stiff) or with the motor: a deviation of 1 / stiffness."""
    found = []
    for stiffness in (1e6, 1e7):
        if gap == 1:
            values = {"k_2": stiffness, "c_2": stiffness * 1e-4, "alpha_2": 0.0, "alpha_1": 0.02, "i_2": 2.0}
            same = {"J_l": 5.6 + 4.0 * 0.04, "b_l": 1.0 + 4.0 * 0.02, "k": 4.0 * 1660.0, "c": 4.0 * 0.5, "alpha": 0.01}
        else:
            values = {"k_1": stiffness, "c_1": stiffness * 1e-4, "alpha_1": 0.0, "alpha_2": 0.01}
            values |= {"J_m": 0.4 - 0.04 / 4.0, "b_m": 0.1 - 0.02 / 4.0}
            same = {"J_l": 5.6, "b_l": 1.0, "k": 6600.0, "c": 2.0, "alpha": 0.01}
        p, x = plant(all_values({**values, "tau": 0.05}))
        states, _ = run(p, x, *torques(), STEP)
        whole = p._replace(J_m=0.4, b_m=0.1)
        found.append(float(np.abs(states[:, [0, 4]] - of_drivetrain(whole, **same)).max()))
    assert found[0] < 2e-3
    assert found[1] < 0.2 * found[0]


@pytest.mark.parametrize("case", ["both gaps", "light shaft", "friction", "in motion"])
def test_steps_of_any_size_lead_to_the_same_motion(case: str) -> None:
    """Short steps, long ones of several parts, and power series alone are one solution."""
    p, x = plant(all_values(CASES[case]))
    u, T_l = np.repeat(torques(60)[0], 10), np.zeros(600)
    fine, _ = run(p, x, u, T_l, STEP, splits=3)
    coarse, _ = run(p, x, u[::10], T_l[::10], 10 * STEP)
    table, mode, y = prepare(p, 10 * STEP), initial_mode(x, p, 0.0), x
    assert table[4] > 1
    for n in range(60):
        y, mode = advance(y, mode, p, float(u[10 * n]), 0.0, 10 * STEP, (*table[:4], 0))
    assert np.abs(fine[::10] - coarse).max() < 1e-8
    assert np.abs(fine[-1] - y).max() < 1e-8


def test_a_short_contact_is_never_stepped_over() -> None:
    """Steps that take the matrix and steps that look for every event have the same contacts."""
    rng = np.random.default_rng(8)
    for _ in range(30):
        values = {
            "alpha_1": 10 ** rng.uniform(-5, -2),
            "alpha_2": 10 ** rng.uniform(-5, -2),
            "J_s": rng.uniform(0.02, 0.2),
        }
        p, x = plant(all_values(values))
        mode = other = initial_mode(x, p, 0.0)
        y = x
        table = prepare(p, STEP)
        assert table[4] == 1
        for n in range(150):
            u = float(30.0 * math.sin(2.0 * math.pi * 25.0 * n * STEP) + 4.0)
            x, mode = advance(x, mode, p, u, 0.0, STEP, table)
            y, other = advance(y, other, p, u, 0.0, STEP, (*table[:4], 0))
            assert mode == other
        assert np.abs(np.subtract(x, y)).max() < 1e-7


def test_an_event_ends_a_step_at_the_flank() -> None:
    p, x = plant(all_values({"omega_m_start": 1.0}))
    mode, table, found = initial_mode(x, p, 0.0), prepare(p, 0.05), []
    time = 0.0
    while len(found) < 10 and time < 1.0:
        x, after, taken, which = advance_to_event(x, mode, p, 0.0, 0.0, 0.05, table)
        time += taken
        if which == NO_EVENT:
            mode = after
            continue
        twist, alpha = twists(x, p)[which // 2], (p.alpha_1, p.alpha_2)[which // 2]
        assert abs(abs(twist) - alpha) < 1e-13
        x, mode = after_events(x, after, which, p, 0.0)
        assert mode != after
        found.append(which)
    assert {which // 2 for which in found} == {0, 1}


def test_friction_holds_a_body_until_the_torque_breaks_it_loose() -> None:
    """A load that rests holds against the spring's torque up to its friction, then breaks away."""
    p, x = plant(all_values({"effects.coulomb_friction.load.torque": 6.0, "tau": 0.2}))
    u = np.full(400, 2.5)
    states, modes = run(p, x, u, np.zeros(400), STEP)
    held = [n for n, mode in enumerate(modes) if mode[4] == 0]
    assert held[0] == 0
    first = next(n for n, mode in enumerate(modes) if mode[4] != 0)
    assert (states[:first, 4] == 0.0).all()
    second = [stage_torques(tuple(row), 1.0, mode, p)[1] for row, mode in zip(states, modes, strict=True)]
    assert max(map(abs, second[:first])) <= 6.0 + 1e-9
    assert states[-1, 4] > 0.01


@pytest.mark.parametrize("late", [0.0, 0.002])
def test_made_up_records_are_of_the_same_machine(late: float) -> None:
    """The simulator of records, small steps without located events, moves as the FMU does."""
    effects = {"alpha_1": 0.015, "alpha_2": 0.01, "T0": 2.0}
    columns, truth = make_two_stage_record(
        effects, 5, 0.05, 0.5, noise_factor=0.0, torque_noise=0.0, counts=None, late=late, substeps=200
    )
    assert columns["theta_m"].tobytes() == truth["states"][:, 0].tobytes()
    p, x = plant(all_values({**truth["linear"], "alpha_1": 0.015, "alpha_2": 0.01, "effects.load_torque.torque": 2.0}))
    shift = round(late * 1000.0)
    u = np.concatenate([np.zeros(shift), columns["u"]])[: len(columns["u"])]
    states, _ = run(p, x, u, np.zeros(len(u)), STEP)
    assert np.abs(states[:-1] - truth["states"])[:, [0, 2, 4]].max() < 1e-5
    assert np.ptp(states[:, 4]) > 0.05


def test_records_have_the_noise_and_the_mismatch_that_is_asked_for() -> None:
    quiet, truth = make_two_stage_record({"alpha_1": 0.02} | FRICTION_OF_RECORDS, 6, 0.02, mismatch=0.05)
    loud, _ = make_two_stage_record({"alpha_1": 0.02} | FRICTION_OF_RECORDS, 6, 0.02, mismatch=0.05, noise_factor=5.0)
    angles = truth["states"][:, [0, 4]]
    for columns, factor in ((quiet, 1.0), (loud, 5.0)):
        errors = np.column_stack([columns["theta_m"], columns["theta_l"]]) - angles
        rounding = 2.0 * np.pi / np.array(COUNTS) / np.sqrt(12.0)
        expected = np.hypot(factor * np.array(NOISE), rounding)
        np.testing.assert_allclose(errors.std(axis=0), expected, rtol=0.1)
    shares = [truth["linear"][name] / truth["nominal"][name] - 1.0 for name in MISMATCHED]
    assert 0.02 < max(map(abs, shares)) <= 0.05
    assert truth["nominal"]["J_s"] == pytest.approx(0.02 * truth["nominal"]["J_m"])
