"""The hybrid machine with the simplest plant: a ball that falls and bounces, whose motion has a closed form."""

import pytest

from pyfmu_sources.hybrid import machine
from pyfmu_sources.hybrid.event_numbers import NO_EVENT
from pyfmu_sources.hybrid.plant import Parameters
from pyfmu_sources.laws.parameter_rows import BIG

HEIGHT, WEIGHT, MASS, RESTITUTION = 2.0, 5.0, 0.5, 0.6
BALL = Parameters(MASS, RESTITUTION, 1e-3, 0.0, BIG)
FALL = (2.0 * HEIGHT * MASS / WEIGHT) ** 0.5  # s
FLIGHTS = [FALL * 2.0 * RESTITUTION**n for n in (1, 2, 3)]  # s, from one bounce to the next


@pytest.mark.parametrize("step", [1e-3, 0.013, 0.1, 1.3])
def test_a_ball_bounces_when_and_as_high_as_it_must(step):
    x, mode, end = (HEIGHT, 0.0, 0.0, 0.0), (0,), FALL + sum(FLIGHTS[:2]) + 0.5 * FLIGHTS[2]  # the third summit
    whole = int(end / step)
    for h in (*[step] * whole, end - whole * step):
        x, mode = machine.advance(x, mode, BALL, 0.0, WEIGHT, h)
    assert x[0] == pytest.approx(HEIGHT * RESTITUTION**6, abs=1e-9)
    assert x[1] == pytest.approx(0.0, abs=1e-8)


def test_an_event_is_where_it_must_be_and_has_had_no_effect_yet():
    x, _, elapsed, which = machine.advance_to_event((HEIGHT, 0.0, 0.0, 0.0), (0,), BALL, 0.0, WEIGHT, 5.0)
    assert which == 0
    assert elapsed == pytest.approx(FALL, abs=1e-11)
    assert x[1] == pytest.approx(-WEIGHT / MASS * FALL, abs=1e-9)
    again = machine.advance_to_event((HEIGHT, 0.0, 0.0, 0.0), (0,), BALL, 0.0, WEIGHT, 0.5 * FALL)
    assert again[2:] == (0.5 * FALL, NO_EVENT)


def test_what_no_step_resolves_is_refused():
    stiff = BALL._replace(drive_filter_time_constant=1e-3, tau=1e-15)  # a filtered drive has no closed form
    x, _ = machine.advance((HEIGHT, 0.0, 0.0, 0.0), (0,), stiff, 3.0, WEIGHT, 0.1)
    assert x[0] != x[0]
