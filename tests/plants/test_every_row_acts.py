"""Every row of the plants' tables acts, alone: a run shows it, whichever way of solving it leads through."""

import math

import pytest

from pyfmu_sources.axis import axis_equations
from pyfmu_sources.axis.servo_axis_slave import ServoAxis
from pyfmu_sources.drivetrain import drivetrain, equations
from pyfmu_sources.drivetrain.drivetrain_slave import Drivetrain
from pyfmu_sources.drivetrain.equations import NAMES, parameters
from pyfmu_sources.laws.parameter_rows import BIG, Parameter, with_values
from pyfmu_sources.train import train_equations
from pyfmu_sources.train.two_stage_train_slave import TwoStageTrain
from tests.support.native_bits import EFFECTS

# What a row is set to, by its unit; a half of what is usual where that is not zero.
SIZES = {
    "N.m": 3.0, "rad": 0.2, "kg.m2": 0.3, "1": 0.3, "s": 0.05, "N.m/s": 20.0, "N.m.s/rad": 0.3, "N.m.s2/rad2": 0.2,
    "N.m/rad": 40.0, "N.m/rad3": 1e6, "rad/s": 30.0, "s/rad": 3.0,
}  # fmt: skip
STOPS = {"effects.end_stop.lower": 0.15, "effects.end_stop.upper": -0.15}
# What a row only shapes has another name.
SHAPED = {"presliding": "coulomb_friction"}
# Effects that need the torque of an elastic shaft.
ELASTIC = ("hardening_stiffness", "presliding", "load_dependent_friction", "varying_stiffness", "shaft_hysteresis")
# Rows that act with teeth that part, and the model that has them.
MODELS = {"alpha": 1, "restitution": 4, "contact_stiffness": 5, "contact_damping": 5}


def size_of(row: Parameter) -> float:
    """A value at which the row acts."""
    if row.name.endswith(".breakaway"):
        return 5.0
    if row.name in STOPS:
        return STOPS[row.name]
    if row.name == "backlash_model":
        return 2.0
    return 0.6 * row.default if 0.0 < abs(row.default) < BIG else SIZES[row.unit]


def law_of(row: Parameter, rows: tuple[Parameter, ...]) -> dict[str, float]:
    """The values that switch on what a row is a part of."""
    if not row.name.startswith("effects."):
        model = MODELS.get(row.name, 1 if row.name != "backlash_model" else 0)
        return {"backlash_model": float(model), "alpha": 0.01} if row.name in (*MODELS, "backlash_model") else {}
    effect = row.name.split(".")[1]
    beside = f"effects.{SHAPED.get(effect, effect)}."
    site = {"motor", "load"} & set(row.name.split("."))
    of_law = [other for other in rows if other.name.startswith(beside) and not other.linear]
    bends = [other for other in rows if effect == "presliding" and other.name.endswith(".distance")]
    return {other.name: size_of(other) for other in (*of_law, *bends) if site <= set(other.name.split("."))}


class RefusedError(Exception):
    """The values were refused at the start."""


def run_of(slave: type, values: dict[str, float]) -> list[tuple[float, ...]]:
    """The outputs of a quarter of a second from a start in motion."""
    numbers = {variable.name: n for n, variable in enumerate(slave.table)}
    made = slave(instance_name="a")
    starts = {"theta_m_start": 0.1, "omega_m_start": -1.0, "theta_l_start": 0.02, "omega_l_start": -0.25}
    given = starts | {"T_m_start": 30.0} | values
    for name, value in given.items():
        if name not in numbers:
            continue
        if slave.table[numbers[name]].type == "Real":
            made.set_real([numbers[name]], [value])
        else:
            made.set_integer([numbers[name]], [int(value) + 1])
    made.setup_experiment(0.0)
    made.enter_initialization_mode()
    made.exit_initialization_mode()
    if made.log_queue:
        raise RefusedError(made.log_queue[0].msg)
    outputs = [n for n, v in enumerate(slave.table) if v.causality == "output" and v.type == "Real"]
    found = []
    for n in range(25):
        made.set_real([numbers["u"]], [20.0 * math.sin(0.3 * n) + 5.0])
        assert made.do_step(0.01 * n, 0.01), made.log_queue
        found.append(tuple(made.get_real(outputs)))
    assert not made.log_queue
    return found


@pytest.mark.parametrize(
    ("slave", "rows"),
    [
        (Drivetrain, equations.PARAMETERS),
        (ServoAxis, axis_equations.PARAMETERS),
        (TwoStageTrain, train_equations.PARAMETERS),
    ],
    ids=["drivetrain", "axis", "two stages"],
)
def test_every_row_changes_a_run(slave: type, rows: tuple[Parameter, ...]) -> None:
    idle = []
    for row in rows:
        law = {name: value for name, value in law_of(row, rows).items() if name != row.name}
        if not row.linear:
            law = {}  # alone
        before, after = run_of(slave, law), run_of(slave, law | {row.name: size_of(row)})
        change = max(abs(a - b) for x, y in zip(before, after, strict=True) for a, b in zip(x, y, strict=True))
        if not change > 1e-6:
            idle.append(row.name)
    assert idle == []


@pytest.mark.parametrize("model", range(len(equations.MODELS)))
def test_every_effect_acts_with_a_backlash_model_or_is_refused(model: int) -> None:
    """Rigid teeth have no shaft torque, and damping of teeth sets in with the dead zone alone."""
    chosen = {"alpha": 0.01, "backlash_model": float(model)}
    plain, refused = run_of(Drivetrain, chosen), {}
    for effect, values in EFFECTS.items():
        try:
            found = run_of(Drivetrain, chosen | values)
        except RefusedError as error:
            refused[effect] = str(error)
            continue
        assert found != plain or (effect, model) == ("impact_damping", 0), effect
    of_shaft = set(ELASTIC) if model in (3, 4) else set()
    assert set(refused) == of_shaft | ({"impact_damping"} if model >= 2 else set())
    for effect, message in refused.items():
        assert f"effects.{effect}" in message
        assert "dead_zone" in message


@pytest.mark.parametrize("night", [False, pytest.param(True, marks=pytest.mark.night)])
@pytest.mark.parametrize("model", range(len(equations.MODELS)))
def test_the_linear_solution_is_taken_where_it_holds(model: int, night: bool) -> None:
    """A row alone is solved as the integrator solves it, whether it is said to be linear or not.

    By day each row with one model.
    """
    wrong = []
    for place, row in enumerate(equations.PARAMETERS):
        if row.name in ("backlash_model", "alpha") or ((model + place) % len(equations.MODELS) > 0) != night:
            continue
        p = with_values(parameters(backlash_model=float(model), alpha=0.01, i=1.0), {row.name: size_of(row)})
        start = drivetrain.consistent_start((0.013, 1.0, 0.0, 0.5, 2.0, 0.0, 0.5, 0.0), p)
        table = drivetrain.prepare(p, 0.01)
        ends = []
        for nonlinear in (table[4], True):
            x, mode = start, drivetrain.initial_mode(start, p)
            for n in range(10):
                x, mode = drivetrain.advance(x, mode, p, 20.0 * math.sin(0.4 * n), 0.0, 0.01, (*table[:4], nonlinear))
            ends.append(x)
        if any(abs(a - b) > 1e-7 * (1.0 + abs(b)) for a, b in zip(ends[0][:5], ends[1][:5], strict=True)):
            wrong.append((row.name, ends))
    assert wrong == []


def test_nothing_is_linear_unless_it_is_said_so() -> None:
    assert not Parameter("effects.fan.coefficient", "N.m.s3/rad3", 0.0, 0.0, BIG, "Cubic drag of a fan").linear
    nonlinear = [name for name in NAMES if drivetrain.has_nonlinear_effect(with_values(parameters(), {name: 0.31}))]
    assert nonlinear == [row.name for row in equations.PARAMETERS if not row.linear]
