"""Contact and shaft torque, number by number: what the equations give at chosen states, worked out by hand."""

import math

import pytest

from pyfmu_sources.drivetrain import contact as c
from pyfmu_sources.drivetrain import equations as dt
from pyfmu_sources.drivetrain import equations as eq
from pyfmu_sources.laws import backlash_models as models

I, K, C, J_M, J_L, ALPHA = 3.984, 3300.0, 1.0, 0.4, 5.6, 0.01
REST = (0.0, 0.0, 0.0, 0.0)  # bristles, memory of the shaft, filtered request


def p_of(model: int = models.DEAD_ZONE, **values: float) -> tuple[float, ...]:
    return dt.parameters(**({"backlash_model": float(model), "alpha": ALPHA} | values))


def state(twist: float, omega_m: float = 0.0, omega_l: float = 0.0, T_m: float = 0.0, s: float = 0.0) -> eq.State:
    """A state whose shaft is twisted by ``twist``, the load at 0.3 rad."""
    return (I * (0.3 + twist), omega_m, 0.3, omega_l, T_m, 0.3, 0.0, s, *REST)


def test_the_shaft_torque_starts_at_the_half_gap_exactly() -> None:
    """An error of 1e-7 rad in the half-gap would be 3.3e-4 N.m here."""
    for flank in (-1, 1):
        torque = eq.elastic_torque(state(flank * 0.013, 2.0, 0.1), flank, p_of())
        rate = 2.0 / I - 0.1
        assert torque == pytest.approx(flank * K * 0.003 + C * rate, abs=1e-9)
    assert eq.elastic_torque(state(0.013), 0, p_of()) == 0.0
    assert eq.elastic_torque(state(0.013), 1, p_of(models.NONE)) == pytest.approx(K * 0.013, abs=1e-9)
    assert eq.elastic_torque(state(0.013), 1, p_of(alpha=0.0)) == pytest.approx(K * 0.013, abs=1e-9)
    hard = eq.elastic_torque(state(0.013), 1, dt.with_values(p_of(), {"effects.hardening_stiffness.cubic": 1e6}))
    assert hard == pytest.approx(K * 0.003 + 1e6 * 0.003**3, abs=1e-9)
    tooth = p_of(models.ELASTIC_IMPACT, contact_stiffness=500.0, contact_damping=3.0)
    assert eq.elastic_torque(state(0.013, 0.0, 0.2), 1, tooth) == pytest.approx(500.0 * 0.003 - 3.0 * 0.2, abs=1e-9)


def test_rates_are_newtons_law_on_either_side_of_the_gear() -> None:
    """Rates of both bodies from the shaft's torque: Newton's law on either side of the gear."""
    x = state(0.012, 1.0, 0.2, 5.0)
    rates = eq.rates(x, 1, 0.0, 0.0, p_of(), 7.0, 0.5)
    shaft = K * 0.002 + C * (1.0 / I - 0.2)
    assert rates[0] == 1.0
    assert rates[1] == pytest.approx((5.0 - 0.1 * 1.0 - shaft / I) / J_M, abs=1e-9)
    assert rates[2] == 0.2
    assert rates[3] == pytest.approx((shaft - 1.0 * 0.2 - 0.5) / J_L, abs=1e-9)
    assert rates[4] == pytest.approx((7.0 - 5.0) / 1.0)
    free = eq.rates(state(0.0, 1.0, 0.2, 5.0, s=0.001), 0, 0.0, 0.0, p_of(models.NORDIN), 7.0, 0.0)
    assert free[1] == pytest.approx((5.0 - 0.1) / J_M)
    assert free[7] == pytest.approx(-K * 0.001 / C)
    assert eq.rates(state(0.0), 0, 0.0, 0.0, p_of(models.NORDIN), 7.0, 0.0)[7] == 0.0


def test_friction_and_effects_act_against_the_motion() -> None:
    values = {
        "effects.coulomb_friction.motor.torque": 0.7, "effects.coulomb_friction.load.torque": 1.1,
        "effects.torque_ripple.amplitude": 0.3, "effects.torque_ripple.cycles_per_rev": 2.0,
        "effects.torque_ripple.phase": 0.4, "effects.load_torque.torque": 0.9, "effects.gravity_load.amplitude": 2.0,
        "effects.gravity_load.phase": 0.2, "effects.quadratic_drag.coefficient": 0.6,
    }  # fmt: skip
    p = dt.with_values(p_of(), values)
    x = state(0.0, 2.0, -0.5, 4.0)
    ripple = 0.3 * math.sin(2.0 * x[0] + 0.4)
    assert eq.motor_torque(x, 0.0, 1.0, p) == pytest.approx(4.0 + ripple - 0.1 * 2.0 - 0.7)
    against = 0.25 + 0.9 + 1.0 * -0.5 - 1.1 + 2.0 * math.sin(0.3 + 0.2) - 0.6 * 0.25
    assert eq.load_torque(x, 0.0, -1.0, p, 0.25) == pytest.approx(-against)


def test_an_added_resonance_pulls_both_ways() -> None:
    values = {"inertia": 0.2, "frequency": 30.0, "damping_ratio": 0.05}
    p = dt.with_values(p_of(), {f"effects.extra_resonance.{name}": value for name, value in values.items()})
    x = (*state(0.0, 0.0, 0.4)[:5], 0.25, 0.1, 0.0, *REST)
    pull = 0.2 * (30.0**2 * (0.3 - 0.25) + 2.0 * 0.05 * 30.0 * (0.4 - 0.1))
    assert eq.load_torque(x, 0.0, 0.0, p, 0.0) == pytest.approx(-(1.0 * 0.4 + pull))
    rates = eq.rates(x, 0, 0.0, 0.0, p, 0.0, 0.0)
    assert rates[5] == 0.1
    assert rates[6] == pytest.approx(pull / 0.2)


def test_twist_of_an_eccentric_gear() -> None:
    names = ("amplitude", "cycles_per_rev", "phase")
    p = dt.with_values(
        p_of(), {f"effects.gear_eccentricity.{n}": v for n, v in zip(names, (0.02, 2.0, 0.3), strict=True)}
    )
    x = (1.2, 0.7, 0.1, 0.2, 0.0, 0.0, 0.0, 0.0, *REST)
    assert eq.twist(x, p) == pytest.approx(1.2 / I - 0.1 + 0.02 * math.sin(2.0 * 1.2 + 0.3))
    slope = 1.0 / I + 0.04 * math.cos(2.0 * 1.2 + 0.3)
    assert eq.twist_slope(x, p) == pytest.approx(slope)
    assert eq.twist_rate(x, p) == pytest.approx(0.7 * slope - 0.2)
    assert eq.gear(x, p) == pytest.approx(1.0 / slope)
    assert eq.gear_acceleration(x, p) == pytest.approx(-0.08 * math.sin(2.0 * 1.2 + 0.3) * 0.49)
    assert eq.gear(x, p_of()) == I


@pytest.mark.parametrize(("angle", "flank"), [(0.011, 1), (0.01, 0), (0.0, 0), (-0.01, 0), (-0.011, -1)])
def test_the_flank_is_told_by_the_twist(angle: float, flank: int) -> None:
    assert eq.contact_of(angle, ALPHA) == flank


@pytest.mark.parametrize(
    ("model", "gap", "acts", "rigid", "pulls_not"),
    [
        (models.NONE, 0.0, models.NONE, False, False),
        (models.DEAD_ZONE, 0.01, models.DEAD_ZONE, False, False),
        (models.DEAD_ZONE, 0.0, models.NONE, False, False),
        (models.NORDIN, 0.01, models.NORDIN, False, True),
        (models.NORDIN, 0.0, models.NONE, False, False),
        (models.HYSTERESIS, 0.0, models.HYSTERESIS, True, False),
        (models.RIGID_IMPACT, 0.01, models.RIGID_IMPACT, True, False),
        (models.ELASTIC_IMPACT, 0.0, models.ELASTIC_IMPACT, False, True),
    ],
)
def test_traits_of_the_models(model: int, gap: float, acts: int, rigid: bool, pulls_not: bool) -> None:
    p = p_of(model, alpha=gap, contact_stiffness=7.0, contact_damping=2.0)
    assert eq.backlash_model(p) == acts
    assert eq.is_rigid(p) is rigid
    assert eq.teeth_never_pull(p) is pulls_not
    assert eq.shaft_stiffness(p) == (7.0 if model == models.ELASTIC_IMPACT else K)
    assert eq.shaft_damping(p) == (2.0 if model == models.ELASTIC_IMPACT else C)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_impacts_keep_the_momentum_and_reverse_the_slip(restitution: float) -> None:
    before = (1.0, 3.0, 0.2, -0.4, 2.0, 0.5, 0.6, 0.7, *REST)
    after = c.collide(before, restitution, p_of(models.RIGID_IMPACT))
    momentum = [J_M * I * x[1] + J_L * x[3] for x in (before, after)]
    assert momentum[1] == pytest.approx(momentum[0])
    slip = [x[1] / I - x[3] for x in (before, after)]
    assert slip[1] == pytest.approx(-restitution * slip[0], abs=1e-12)
    assert [after[n] for n in (0, 2, 4, 5, 6, 7)] == [before[n] for n in (0, 2, 4, 5, 6, 7)]
    if restitution == 0.0:
        assert after[3] == after[1] / I


def test_rigid_rates_by_hand() -> None:
    p = p_of(models.HYSTERESIS)
    x = state(ALPHA, 2.0, 2.0 / I, 4.0)
    total = I * (4.0 - 0.1 * 2.0) - 1.0 * 2.0 / I - 0.5
    together = total / (J_M * I**2 + J_L)
    assert eq.rigid_acceleration(x, 0.0, 0.0, p, 0.5) == pytest.approx(together)
    assert eq.rigid_rates(x, 1, 0.0, 0.0, p, 0.5) == pytest.approx((together * I, together))
    assert eq.rigid_rates(x, 2, 0.0, 0.0, p, 0.5) == (0.0, 0.0)
    assert eq.rigid_rates(x, -2, 0.0, 0.0, p, 0.5) == (0.0, 0.0)
    alone = (4.0 - 0.2) / J_M
    assert eq.rigid_rates(x, 0, 0.0, 0.0, p, 0.5) == pytest.approx((alone, 0.0))
    impact = eq.rigid_rates(x, 0, 0.0, 0.0, p_of(models.RIGID_IMPACT), 0.5)
    assert impact == pytest.approx((alone, (-1.0 * 2.0 / I - 0.5) / J_L))
    names = ("amplitude", "cycles_per_rev", "phase")
    q = dt.with_values(p, {f"effects.gear_eccentricity.{n}": v for n, v in zip(names, (0.02, 2.0, 0.3), strict=True)})
    i, own = eq.gear(x, q), eq.gear_acceleration(x, q)
    drive = i * (4.0 - 0.2) - 2.0 / I - 0.5 + J_M * i * i * own
    joined = drive / (J_M * i * i + J_L)
    assert eq.rigid_acceleration(x, 0.0, 0.0, q, 0.5) == pytest.approx(joined)
    assert eq.rigid_rates(x, 1, 0.0, 0.0, q, 0.5) == pytest.approx(((joined - own) * i, joined))
    assert eq.rates(x, 1, 0.0, 0.0, p, 4.0, 0.5)[1] == pytest.approx(together * I)


def test_parting_teeth_leave_the_shaft_its_twist() -> None:
    assert c.parted_twist(state(0.008), 1, p_of(models.NORDIN)) == pytest.approx(-0.002)
    assert c.parted_twist(state(-0.008), -1, p_of(models.NORDIN)) == pytest.approx(0.002)
    assert c.parted_twist(state(0.008), 1, p_of(models.NORDIN, c=0.0)) == 0.0
    assert c.parted_twist(state(0.008), 1, p_of(models.NORDIN, c=3e-4)) == 0.0  # relaxes within 1e-7 s
    assert c.parted_twist(state(0.008), 1, p_of(models.NORDIN, c=4e-4)) == pytest.approx(-0.002)
    assert c.part_teeth((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, *REST), 0.5) == (
        1.0,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
        7.0,
        0.5,
        *REST,
    )
    turning = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, *REST)
    assert c.stop_bodies(turning) == (1.0, 0.0, 3.0, 0.0, 5.0, 6.0, 7.0, 8.0, *REST)


@pytest.mark.parametrize("side", [-1, 1])
def test_rigid_teeth_are_put_on_their_flank_at_one_speed(side: int) -> None:
    p = p_of(models.RIGID_IMPACT)
    off = state(side * 0.013, 2.0, 0.1, s=0.5)
    on = c.join_teeth(off, side, p)
    assert eq.twist(on, p) == pytest.approx(side * ALPHA, abs=1e-15)
    assert on[1] / I == pytest.approx(on[3])
    assert on[7] == 0.0
    assert c.join_teeth(on, side, p) is on
    near = state(side * ALPHA, I * 0.1, 0.1)
    assert c.join_teeth(near, side, p) is near
    sliding = state(side * ALPHA, I * 0.1 + 1e-6, 0.1)
    assert c.join_teeth(sliding, side, p) is not sliding
    apart = state(side * (ALPHA + 1e-8), I * 0.1, 0.1)
    assert c.join_teeth(apart, side, p) is not apart


def after(x, contact, which, model, events=0, push_m=0.0, push=0.0, held_m=0.0, held=0.0, **values):
    return c.after_event(x, contact, which, events, push_m, push, p_of(model, **values), held_m, held)


def test_elastic_teeth_meet_and_part() -> None:
    x = state(ALPHA, 1.0, 0.0, s=0.5)
    for which, flank in ((0, 1), (1, -1)):
        new, contact = after(x, 0, which, models.DEAD_ZONE)
        assert (contact, new[7]) == (flank, 0.0)
        assert new[:7] == x[:7]
    new, contact = after(state(0.008), 1, 0, models.NORDIN)
    assert contact == 0
    assert new[7] == pytest.approx(-0.002)
    assert after(x, 1, 0, models.DEAD_ZONE) == (x, 0)


def test_rigid_teeth_bounce_rest_and_do_not_bounce_for_ever() -> None:
    fast = state(ALPHA, 1.0, 0.0)
    new, contact = after(fast, 0, 0, models.RIGID_IMPACT, restitution=0.5)
    assert contact == 0
    assert new[1] / I - new[3] == pytest.approx(-0.5 / I)
    for x, events, restitution in ((fast, 200, 0.5), (fast, 0, 0.0), (state(ALPHA, 3.9e-6, 0.0), 0, 0.5)):
        new, contact = after(x, 0, 1, models.RIGID_IMPACT, events=events, restitution=restitution)
        assert contact == -1
        assert new[1] / I == pytest.approx(new[3])
    assert after(state(ALPHA, 4.1e-6, 0.0), 0, 0, models.RIGID_IMPACT, restitution=0.5)[1] == 0
    assert after(fast, 0, 0, models.RIGID_IMPACT, events=199, restitution=0.5)[1] == 0


def test_the_play_model_engages_turns_and_rests() -> None:
    moving, still = state(ALPHA, 1.0, 0.0), state(ALPHA, 0.0, 0.0)
    new, contact = after(moving, 0, 0, models.HYSTERESIS, push_m=1.0, push=1.0)
    assert contact == 1
    assert new[1] / I == pytest.approx(new[3])
    assert new[3] == pytest.approx(J_M * I * 1.0 / (J_M * I**2 + J_L))
    backwards = after(state(-ALPHA, 1.0, 0.0), 0, 1, models.HYSTERESIS, push_m=-1.0, push=-1.0)
    assert backwards[0][1] == 0.0  # moves away from the flank: it stops first
    assert backwards[1] == -1
    assert after(still, 1, 0, models.HYSTERESIS, push_m=-1.0, held_m=0.5) == (still, 0)
    assert after(still, 1, 0, models.HYSTERESIS, push_m=-0.5, held_m=0.5) == (still, 0)
    assert after(still, 1, 0, models.HYSTERESIS, push_m=-0.4, push=0.1, held_m=0.5, held=0.2) == (still, 2)
    assert after(still, 1, 0, models.HYSTERESIS, push_m=1.0, push=0.2, held=0.2) == (still, 2)
    assert after(still, 1, 0, models.HYSTERESIS, push_m=1.0, push=0.3, held=0.2) == (still, 1)
    assert after(still, -1, 0, models.HYSTERESIS, push_m=-1.0, push=-0.3, held=0.2) == (still, -1)
    assert after(moving, 1, 0, models.HYSTERESIS, push_m=1.0, push=1.0)[0] == c.stop_bodies(moving)
    for contact in (-2, 2):
        assert after(still, contact, 0, models.HYSTERESIS) == (still, 0)
        assert after(still, contact, 1, models.HYSTERESIS) == (still, contact // 2)


def test_where_a_simulation_starts() -> None:
    assert c.initial_contact(state(0.0), p_of(models.NONE)) == 1
    assert c.initial_contact(state(0.0), p_of(alpha=0.0)) == 1
    assert c.initial_contact(state(0.0), p_of(models.HYSTERESIS, alpha=0.0)) == 1
    assert c.initial_contact(state(0.013), p_of()) == 1
    assert c.initial_contact(state(-0.013), p_of()) == -1
    assert c.initial_contact(state(0.013, I * 0.5, 0.5), p_of(models.RIGID_IMPACT)) == 1
    assert c.initial_contact(state(0.013, I * 0.6, 0.5), p_of(models.RIGID_IMPACT)) == 0
    assert c.initial_contact(state(0.013, 0.0, 1.0), p_of(models.NORDIN)) == 1  # 9.9 N.m of stiffness against 1
    assert c.initial_contact(state(0.013, 0.0, 10.0), p_of(models.NORDIN)) == 0
    assert c.initial_contact(state(-0.013, 0.0, -10.0), p_of(models.NORDIN)) == 0
    assert c.initial_contact(state(0.013, 0.0, 10.0), p_of(models.DEAD_ZONE)) == 1


def test_starts_are_made_consistent() -> None:
    for side in (-1, 1):
        wound = state(side * 0.015, 1.0, 0.5, s=0.3)
        rigid = c.consistent_start(wound, p_of(models.RIGID_IMPACT))
        assert eq.twist(rigid, p_of()) == pytest.approx(side * ALPHA)
        assert (rigid[1], rigid[3], rigid[7]) == (1.0, 0.5, 0.0)
        play = c.consistent_start(wound, p_of(models.HYSTERESIS))
        assert eq.twist(play, p_of()) == pytest.approx(side * ALPHA)
        assert (play[1], play[3]) == (1.0, 0.0)
    inside = c.consistent_start(state(0.004, 1.0, 0.5), p_of(models.RIGID_IMPACT))
    assert inside[2] == 0.3
    tight = c.consistent_start(state(0.004, 1.0, 0.5), p_of(models.RIGID_IMPACT, alpha=0.0))
    assert tight[1] / I == pytest.approx(tight[3])
    parts = c.consistent_start(state(0.013, 0.0, 10.0, s=0.1), p_of(models.NORDIN))
    assert parts[7] == pytest.approx(0.003)
    assert c.consistent_start(state(0.013, 0.0, 0.0, s=0.1), p_of(models.NORDIN))[7] == 0.0
    assert c.consistent_start(state(0.004, 0.0, 0.0, s=0.1), p_of())[7] == 0.0
