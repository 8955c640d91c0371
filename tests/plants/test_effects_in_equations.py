"""Every effect's place in the drivetrain's equations, number by number: laws worked out by hand at chosen states."""

import math

import pytest

from pyfmu_sources.drivetrain import contact as c
from pyfmu_sources.drivetrain import equations as dt
from pyfmu_sources.drivetrain import equations as eq
from pyfmu_sources.laws import backlash_models as models
from pyfmu_sources.laws.friction import sliding_friction

I, K, C, J_M, J_L, ALPHA = 3.984, 3300.0, 1.0, 0.4, 5.6, 0.01
# Every value is another one, so that no state or parameter stands for its neighbour.
X = (1.7, 2.3, 0.31, -0.6, 4.1, 0.25, 0.13, 0.0, 0.0, 0.0, 0.35, 6.2)


def p_of(model: int = models.DEAD_ZONE, **effects: float) -> tuple[float, ...]:
    """Parameters with effects; ``site__name`` stands for ``site.name``."""
    values = {f"effects.{name.replace('__', '.')}": value for name, value in effects.items()}
    return dt.with_values(dt.parameters(backlash_model=float(model), alpha=ALPHA), values)


def added(x: eq.State, **effects: float) -> float:
    """What effects add to the torque that the load needs."""
    return eq.load_torque(x, 0.0, 0.0, p_of(), 0.0) - eq.load_torque(x, 0.0, 0.0, p_of(**effects), 0.0)


def at(**states: float) -> eq.State:
    places = {"theta_m": 0, "omega_m": 1, "theta_l": 2, "omega_l": 3}
    x = list(X)
    for name, value in states.items():
        x[places[name]] = value
    return tuple(x)


STOPS = {"end_stop__lower": -0.2, "end_stop__upper": 0.25, "end_stop__stiffness": 400.0, "end_stop__dissipation": 0.3}


def test_end_stops_push_back_where_the_load_is() -> None:
    for omega_l in (0.5, -0.5):
        upper = 400.0 * 0.06 * (1.0 + 0.3 * omega_l)
        assert added(at(theta_l=0.31, omega_l=omega_l), **STOPS) == pytest.approx(upper)
        lower = -400.0 * 0.03 * (1.0 - 0.3 * omega_l)
        assert added(at(theta_l=-0.23, omega_l=omega_l), **STOPS) == pytest.approx(lower)
    for inside in (-0.2, 0.0, 0.25):
        assert added(at(theta_l=inside, omega_l=0.5), **STOPS) == 0.0
    # A stop never pulls, however fast the load leaves it.
    assert added(at(theta_l=0.31, omega_l=-9.0), **STOPS) == 0.0
    assert added(at(theta_l=-0.23, omega_l=9.0), **STOPS) == 0.0


def test_springs_and_drag_of_the_load() -> None:
    way = 0.31 - 0.2
    spring = {"spring_load__angle": 0.2}
    assert added(X, spring_load__stiffness=60.0, **spring) == pytest.approx(60.0 * way)
    assert added(X, spring_load__cubic=25.0, **spring) == pytest.approx(25.0 * way**3)
    assert added(X, spring_load__cubic=25.0, spring_load__stiffness=60.0) == pytest.approx(60 * 0.31 + 25 * 0.31**3)
    assert added(X, quadratic_drag__coefficient=0.7) == pytest.approx(-0.7 * 0.36)


def test_friction_differs_by_direction() -> None:
    for speed in (-0.6, 0.6):
        assert added(at(omega_l=speed), directional_friction__load__difference=0.5) == pytest.approx(0.3)
        x = at(omega_m=speed)
        motor = p_of(directional_friction__motor__difference=0.4)
        less = eq.motor_torque(x, 0.0, 0.0, p_of()) - eq.motor_torque(x, 0.0, 0.0, motor)
        assert less == pytest.approx(0.24)


@pytest.mark.parametrize("site", ["motor", "load"])
def test_dry_friction_depends_on_speed_torque_and_angle(site: str) -> None:
    of, angle, speed = (eq.motor_friction, 1.7, 2.3) if site == "motor" else (eq.load_friction, 0.31, -0.6)

    def friction(carried: float, p: eq.Parameters) -> float:
        return sliding_friction(of(p), speed, angle, carried)

    coulomb = {f"coulomb_friction__{site}__torque": 0.7}
    loaded = {f"load_dependent_friction__{site}__coefficient": 0.06}
    wavy = {f"periodic_friction__{site}__{name}": value
            for name, value in (("amplitude", 0.5), ("cycles_per_rev", 3.0), ("phase", 0.4))}  # fmt: skip
    wave = 0.5 * math.sin(3.0 * angle + 0.4)
    assert friction(-12.0, p_of(**coulomb)) == 0.7
    assert friction(-12.0, p_of(**coulomb, **loaded)) == pytest.approx(0.7 + 0.06 * 12.0)
    assert friction(-12.0, p_of(**coulomb, **wavy)) == pytest.approx(0.7 + wave)
    assert friction(5.0, p_of(**coulomb, **loaded, **wavy)) == pytest.approx(0.7 + 0.06 * 5.0 + wave)
    stribeck = {f"stribeck_friction__{site}__{name}": value
                for name, value in (("coulomb", 0.9), ("breakaway", 1.6), ("stribeck_speed", 1.5))}  # fmt: skip
    falling = 0.9 + 0.7 * math.exp(-((speed / 1.5) ** 2))
    assert friction(5.0, p_of(**stribeck)) == pytest.approx(falling)


def test_ripple_has_three_harmonics() -> None:
    one, two, three = (math.sin(n * 5.0 * 1.7 + phase) for n, phase in ((1, 0.2), (2, 0.3), (3, 1.0)))
    base = {"torque_ripple__cycles_per_rev": 5.0, "torque_ripple__phase": 0.2}
    second = {"torque_ripple__second__amplitude": 0.7, "torque_ripple__second__phase": 0.3}
    third = {"torque_ripple__third__amplitude": -0.5, "torque_ripple__third__phase": 1.0}
    first = {"torque_ripple__amplitude": 1.1}
    assert eq.of_body.ripple(1.7, p_of(**base)) == 0.0
    assert eq.of_body.ripple(1.7, p_of(**base, **first)) == pytest.approx(1.1 * one)
    assert eq.of_body.ripple(1.7, p_of(**base, **second)) == pytest.approx(0.7 * two)
    assert eq.of_body.ripple(1.7, p_of(**base, **third)) == pytest.approx(-0.5 * three)
    all_three = p_of(**base, **first, **second, **third)
    assert eq.of_body.ripple(1.7, all_three) == pytest.approx(1.1 * one + 0.7 * two - 0.5 * three)


def test_a_resonance_turns_with_the_load() -> None:
    values = {"inertia": 0.2, "frequency": 30.0, "damping_ratio": 0.05}
    p = p_of(**{f"extra_resonance__{name}": value for name, value in values.items()})
    pull = 0.2 * (30.0**2 * (0.31 - 0.25) + 2.0 * 0.05 * 30.0 * (-0.6 - 0.13))
    assert eq.load_torque(X, 0.0, 0.0, p_of(), 0.0) - eq.load_torque(X, 0.0, 0.0, p, 0.0) == pytest.approx(pull)
    rates = eq.rates(X, 0, 0.0, 0.0, p, 0.0, 0.0)
    assert rates[5:7] == pytest.approx((0.13, pull / 0.2))
    assert eq.rates(X, 0, 0.0, 0.0, p_of(), 0.0, 0.0)[5:8] == (0.13, 0.0, 0.0)


def test_inertia_that_varies_with_the_angle() -> None:
    wave = {f"varying_inertia__{n}": v for n, v in (("amplitude", 1.4), ("cycles_per_rev", 2.0), ("phase", 0.5))}
    p = p_of(**wave)
    angle = 2.0 * 0.31 + 0.5
    inertia = J_L + 1.4 * math.sin(angle)
    assert eq.load_inertia(X, p_of()) == J_L
    assert eq.load_inertia(X, p) == pytest.approx(inertia)
    centrifugal = 0.5 * 1.4 * 2.0 * math.cos(angle) * 0.36
    assert added(X, **wave) == pytest.approx(centrifugal)
    assert eq.rates(X, 0, 0.0, 0.0, p, 0.0, 0.2)[3] == pytest.approx((0.6 - 0.2 - centrifugal) / inertia)
    deep = p_of(**wave | {"varying_inertia__amplitude": -60.0})
    assert eq.load_inertia(X, deep) == pytest.approx(1e-3 * J_L)


def test_the_shaft_s_stiffness_damping_and_hysteresis_vary() -> None:
    wound = 1.7 / I - 0.31 - ALPHA
    rate = 2.3 / I + 0.6
    plain = K * wound + C * rate
    torque = lambda model, **effects: eq.elastic_torque(X, 1, p_of(model, **effects))  # noqa: E731
    assert torque(models.DEAD_ZONE) == pytest.approx(plain)
    wave = {f"varying_stiffness__{n}": v for n, v in (("amplitude", 0.3), ("cycles_per_rev", 2.0), ("phase", 0.5))}
    relative = 1.0 + 0.3 * math.sin(2.0 * 1.7 + 0.5)
    assert torque(models.DEAD_ZONE, **wave) == pytest.approx(K * relative * wound + C * rate)
    part = 1.0 - math.exp(-wound / 0.05)
    assert torque(models.DEAD_ZONE, impact_damping__depth=0.05) == pytest.approx(K * wound + C * part * rate)
    assert torque(models.NORDIN, impact_damping__depth=0.05) == pytest.approx(plain)
    bent = {"shaft_hysteresis__torque": 30.0, "shaft_hysteresis__twist": 0.004}
    assert torque(models.DEAD_ZONE, **bent) == pytest.approx(plain + 30.0 * 0.35)
    p = p_of(**bent)
    turning = (rate - 0.5 * rate * 0.35 - 0.5 * rate * 0.35) / 0.004
    assert eq.rates(X, 1, 0.0, 0.0, p, 0.0, 0.0)[8:] == pytest.approx((0.0, 0.0, turning, 0.0))
    assert eq.rates(X, 0, 0.0, 0.0, p, 0.0, 0.0)[8:] == (0.0, 0.0, 0.0, 0.0)
    assert eq.rates(X, 1, 0.0, 0.0, p_of(), 0.0, 0.0)[8:] == (0.0, 0.0, 0.0, 0.0)


def test_each_side_s_friction_feels_its_own_torque() -> None:
    """The load's carries the shaft's torque, the motor's what the gear makes of it."""
    names = ("load_dependent_friction__motor__coefficient", "load_dependent_friction__load__coefficient")
    p = p_of(**dict(zip(names, (0.06, 0.04), strict=True)))
    shaft = eq.elastic_torque(X, 1, p)
    rates = eq.rates(X, 1, 1.0, -1.0, p, 0.0, 0.5)
    assert rates[1] == pytest.approx((4.1 - 0.1 * 2.3 - 0.06 * shaft / I - shaft / I) / J_M)
    assert rates[3] == pytest.approx((shaft - 0.5 + 0.6 + 0.04 * shaft) / J_L)


def test_a_request_is_filtered_and_limited_in_rate() -> None:
    """The drive lags behind the filtered request, here by 1 s."""
    plain = eq.rates(X, 0, 0.0, 0.0, p_of(), 7.0, 0.0)
    assert (plain[4], plain[11]) == pytest.approx((7.0 - 4.1, 0.0))
    for effects, follows in (
        ({"drive_filter__time_constant": 0.05}, (7.0 - 6.2) / 0.05),
        ({"rate_limit__rate": 3.0}, 3.0),
        ({"drive_filter__time_constant": 0.5, "rate_limit__rate": 3.0}, (7.0 - 6.2) / 0.5),
    ):
        found = eq.rates(X, 0, 0.0, 0.0, p_of(**effects), 7.0, 0.0)
        assert (found[4], found[11]) == pytest.approx((6.2 - 4.1, follows))


def test_a_parted_shaft_unwinds_with_its_hardening() -> None:
    x = (*X[:7], 0.002, *X[8:])
    p = p_of(models.NORDIN, hardening_stiffness__cubic=1e8)
    assert eq.rates(x, 0, 0.0, 0.0, p, 0.0, 0.0)[7] == pytest.approx(-(K * 0.002 + 1e8 * 0.002**3) / C)
    assert eq.rates(x, 1, 0.0, 0.0, p, 0.0, 0.0)[7] == 0.0


@pytest.mark.parametrize("model", [models.DEAD_ZONE, models.ELASTIC_IMPACT])
def test_a_sharp_hardening_adds_the_fifth_power(model: int) -> None:
    x = at(theta_m=I * 0.02, omega_m=0.0, theta_l=0.0, omega_l=0.0)
    plain, sharp = (
        eq.elastic_torque(x, 1, p_of(model, hardening_stiffness__cubic=1e6, hardening_stiffness__sharpness=q))
        for q in (0.0, 1.2)
    )
    k = K if model == models.DEAD_ZONE else p_of().contact_stiffness
    wound = 0.02 - ALPHA
    assert sharp - plain == pytest.approx(1.2 * 1e12 / k * wound**5)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_lever_arm_of_an_eccentric_gear_takes_its_share(share: float) -> None:
    x = at(theta_m=0.7, omega_m=0.0, omega_l=0.0)
    wave = {"gear_eccentricity__amplitude": 0.02, "gear_eccentricity__cycles_per_rev": 3.0}
    p = p_of(models.NONE, gear_eccentricity__lever_arm=share, **wave)
    shaft = eq.elastic_torque(x, 1, p)
    moved = eq.rates(x, 1, 0.0, 0.0, p, 0.0, 0.0)
    arm = 1.0 / I + share * 0.06 * math.cos(2.1)
    assert J_M * moved[1] == pytest.approx(eq.motor_torque(x, 0.0, 0.0, p) - arm * shaft)


def test_a_gear_whose_ratio_is_infinite_is_cut_off() -> None:
    x = at(theta_m=0.0)
    assert eq.gear(x, p_of(gear_eccentricity__amplitude=-1.0 / I)) == 1e12
    assert eq.gear(x, p_of(gear_eccentricity__amplitude=0.1)) == pytest.approx(1.0 / (1.0 / I + 0.1))


def test_impacts_feel_the_inertia_at_their_angle() -> None:
    p = p_of(models.RIGID_IMPACT, varying_inertia__amplitude=1.4, varying_inertia__phase=0.5)
    after = c.collide(X, 0.5, p)
    inertia = eq.load_inertia(X, p)
    assert inertia > J_L
    assert J_M * I * after[1] + inertia * after[3] == pytest.approx(J_M * I * 2.3 - inertia * 0.6)
    assert after[1] / I - after[3] == pytest.approx(-0.5 * (2.3 / I + 0.6))


@pytest.mark.parametrize(
    "effect",
    [
        "spring_load__stiffness", "spring_load__cubic", "directional_friction__motor__difference",
        "directional_friction__load__difference", "load_dependent_friction__motor__coefficient",
        "load_dependent_friction__load__coefficient", "periodic_friction__motor__amplitude",
        "periodic_friction__load__amplitude", "torque_ripple__amplitude", "torque_ripple__second__amplitude",
        "torque_ripple__third__amplitude", "varying_inertia__amplitude", "varying_stiffness__amplitude",
        "shaft_hysteresis__torque", "impact_damping__depth", "gear_eccentricity__amplitude",
        "drive_filter__time_constant", "rate_limit__rate", "extra_resonance__inertia",
        "stribeck_friction__motor__breakaway", "load_torque__torque", "stribeck_friction__load__breakaway",
        "gravity_load__amplitude", "hardening_stiffness__cubic",
    ],
)  # fmt: skip
def test_one_unit_of_an_effect_acts(effect: str) -> None:
    """No effect takes a size of one for off."""
    without, having = (eq.rates(X, 1, 1.0, -1.0, p, 20.0, 0.0) for p in (p_of(), p_of(**{effect: 1.0})))
    assert without != having


def test_an_eccentricity_of_one_radian_drives_rigid_teeth() -> None:
    p = p_of(models.RIGID_IMPACT, gear_eccentricity__amplitude=1.0, gear_eccentricity__phase=0.3)
    own = -math.sin(1.7 + 0.3) * 2.3**2
    i = 1.0 / (1.0 / I + math.cos(1.7 + 0.3))
    drive = i * (4.1 - 0.23) + 0.6 + J_M * i * i * own
    joined = drive / (J_M * i * i + J_L)
    assert eq.rigid_rates(X, 1, 0.0, 0.0, p, 0.0) == pytest.approx(((joined - own) * i, joined))
