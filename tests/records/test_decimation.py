"""A record at a lower rate: what is slow stays as it is, what is quick goes, torques are averaged."""

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.arrays import Record
from orchestrator.records.filters import decimate, follow_motion

STEP = 1e-3
TIME = STEP * np.arange(3000)


def record(**changes: object) -> Record:
    slow = np.sin(2.0 * np.pi * 3.0 * TIME)
    columns = {"u": 2.0 * TIME, "theta_m": slow, "theta_l": 0.5 * slow, "further": {"q": 3.0 * slow}}
    return Record(TIME, source="log.csv", notes=("CSV",), **(columns | changes))


def test_the_rate_is_the_nearest_whole_fraction_above() -> None:
    less = decimate(record(), 180.0)
    assert less.step == pytest.approx(5.0 * STEP)
    assert less.averaged == 5
    # The filter reaches 25 rows to either side, and the mean of the torque 4 rows further.
    assert less.time[0] == pytest.approx(25.0 * STEP)
    assert less.size == len(range(25, 3000 - 25 - 5, 5))
    assert less.notes == ("CSV", "brought from 1000 to 200 Hz: filter to 100 Hz, every 5th sample kept")
    assert decimate(record(), 501.0).size == 3000
    assert decimate(record(), 500.0).step == pytest.approx(2.0 * STEP)


def test_slow_motion_is_neither_delayed_nor_damped_and_quick_motion_goes() -> None:
    quick = 0.1 * np.sin(2.0 * np.pi * 160.0 * TIME)
    plain = record()
    less = decimate(record(theta_m=plain.theta_m + quick), 200.0)
    slow = np.sin(2.0 * np.pi * 3.0 * less.time)
    np.testing.assert_allclose(less.theta_m, slow, atol=2e-4)
    np.testing.assert_allclose(less.theta_l, 0.5 * slow, atol=2e-4)
    np.testing.assert_allclose(less.further["q"], 3.0 * slow, atol=6e-4)
    assert decimate(record(theta_l=None), 200.0).theta_l is None


def test_noise_stays_white_and_loses_what_the_lower_rate_does_not_show() -> None:
    noise = np.random.default_rng(0).normal(size=TIME.size)
    less = decimate(record(theta_m=noise), 200.0).theta_m
    assert np.var(less) == pytest.approx(1.0 / 5.0, rel=0.15)
    assert abs(np.corrcoef(less[:-1], less[1:])[0, 1]) < 0.15


def test_a_torque_is_averaged_over_the_sample_that_holds_it() -> None:
    less = decimate(record(), 200.0)
    np.testing.assert_allclose(less.u, 2.0 * (less.time + 2.0 * STEP), atol=1e-9)
    lost = np.zeros(TIME.size)
    lost[1001:1003] = 0.3
    less = decimate(record(u_deviation=lost), 200.0)
    assert np.flatnonzero(less.u_deviation).tolist() == [np.flatnonzero(np.isclose(less.time, 1.0))[0]]
    assert less.u_deviation.max() == pytest.approx(np.sqrt(2.0 * 0.3**2 / 5.0))


def test_missing_samples_are_bridged_where_they_weigh_little() -> None:
    theta = np.sin(2.0 * np.pi * 3.0 * TIME)
    few, many = theta.copy(), theta.copy()
    few[1017] = np.nan
    many[1000:1040] = np.nan
    slow = decimate(record(), 100.0)
    np.testing.assert_allclose(decimate(record(theta_m=few), 100.0).theta_m, slow.theta_m, atol=1e-4)
    slow = decimate(record(), 200.0)
    lost = slow.time[np.isnan(decimate(record(theta_m=many), 200.0).theta_m)]
    assert (lost.min(), lost.max()) == (pytest.approx(0.995), pytest.approx(1.045))
    torque = 2.0 * TIME
    torque[500] = np.nan
    np.testing.assert_allclose(decimate(record(u=torque), 200.0).u, slow.u, atol=1e-9)


def test_a_rate_that_leaves_too_few_rows_is_refused() -> None:
    with pytest.raises(RecordError, match="`rate` must leave at least 200 rows, but 20 Hz leaves 49: ask for a higher"):
        decimate(record(), 20.0)


def test_a_long_record_comes_to_the_rate_of_its_motion_and_a_short_one_stays() -> None:
    rng, step, rows = np.random.default_rng(2), 2e-4, 200_000
    time = step * np.arange(rows)
    slow = np.sin(2.0 * np.pi * 1.3 * time)

    def of(angle: np.ndarray) -> Record:
        return Record(time, np.zeros(rows), angle + rng.normal(0.0, 1e-4, rows))

    (found,) = follow_motion([of(slow)], 0.0)
    assert 20_000 * 0.9 < found.size <= 20_000  # the motion alone would do with less
    assert found.averaged == 10
    assert "the motion shows up to" in found.notes[-1]
    assert follow_motion([of(slow)], 2000.0)[0].averaged == 2  # of a stiff shaft
    quick = of(slow + 0.3 * np.sin(2.0 * np.pi * 60.0 * time))
    assert follow_motion([quick], 0.0)[0].averaged in (3, 4)  # twenty rows a period
    short = quick.part(0, 39_000)
    assert follow_motion([short], 0.0)[0] is short
    longer, shorter = of(slow), of(slow).part(0, 90_000)  # repeats, whose rows are compared
    pair = follow_motion([longer, short, shorter], 0.0)
    assert [one.averaged for one in pair] == [4, 1, 4]
