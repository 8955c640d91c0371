"""What the thesis printed, recomputed."""

import control
import numpy as np
import pytest

from benchmarks.thesis import __main__ as thesis
from benchmarks.thesis import published
from benchmarks.thesis.errata import errata
from benchmarks.thesis.recompute import (
    C_L,
    C,
    error_covariance,
    gain_comparisons,
    model_behind_the_gains,
    observer_gain,
    size_hidden_in_the_filter,
    table_comparison,
)


def test_every_printed_gain_is_recovered():
    agrees = {c.what: c.agrees for c in gain_comparisons()}
    assert agrees == {
        "A, row 2": False,
        "A, row 4": True,
        "K": True,
        "K_fl, with backlash": True,
        "K_flno, without": True,
    }
    # Of the row that does not agree, one entry alone is the cause.
    row = gain_comparisons()[0]
    off = [round(p - r, 2) for p, r in zip(row.published, row.recomputed, strict=True)]
    assert off == [-0.03, -5.32, 0.22, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("place", "name", "rounding"),
    [(0, "A_ROW_2", 5e-4), (1, "A_ROW_4", 5e-4), (2, "K", 5e-5), (3, "K_FL", 5e-5), (4, "K_FLNO", 5e-5)],
)
def test_printed_numbers_are_recovered_to_their_last_digit(monkeypatch, place, name, rounding):
    exact = gain_comparisons()[place].recomputed
    largest = max(map(abs, exact))
    for share, agrees in ((0.9, True), (1.1, False)):
        printed = tuple(v * (1.0 + share * rounding * (abs(v) == largest)) for v in exact)
        monkeypatch.setattr(published, name, printed)
        assert gain_comparisons()[place].agrees == agrees


def test_table_4_1():
    table = table_comparison()
    assert table.largest_deviation == pytest.approx(0.014388, abs=1e-6)
    assert table.mean_error_percent == pytest.approx(3.02, abs=0.005)
    assert table.mse == pytest.approx(7.399e-3, rel=1e-4)
    for printed, error in zip(published.TABLE_4_1, table.errors_percent, strict=True):
        assert error == pytest.approx(printed.error_percent, abs=0.006)


def test_the_filter_was_told_the_size():
    assert size_hidden_in_the_filter() == pytest.approx(4.48754, abs=1e-4)


def test_errata_are_complete_and_show_numbers():
    found = errata()
    assert [e.number for e in found] == list(range(1, 10))
    assert found[0].right.startswith("-0.4075 ")
    assert found[1].right == (
        "(A, B) has rank 5 of 6; the five-state model has K = [-261.6, 101.8, 1432.6, 150.9, 96.7] at 1 ms"
    )
    assert found[6].right == "MSE 7.399e-03, mean error 3.02 %"
    said = [e.shown_by for e in found]
    assert said[1].startswith("the design is refused: `model` must be stabilisable")
    assert [*said[:1], *said[2:]] == [
        "Fig. 3.4's second gain, printed 4400.9, is 4400.9 with -5.7297 and 5286.6 with -0.4075",
        "as an observer A - K'C has its slowest pole at -0.08786 1/s, as feedback of the controllable states A - BK "
        "has one at -0.02363 1/s",
        "a request of 1 N.m ends at a motor torque of +1 N.m with +1/tau and -1 N.m with -1/tau",
        "with the gear turned as one piece by 1 rad the spring as printed pulls with 9847 N.m, mended with 0; at 1 "
        "rad/s the damper as printed with 4.984 N.m, mended with 0",
        "the printed K_fl alone gives the size away: V_d = 4.4875 reproduces it best, printed 4.4875",
        "the eight squares add up to 0.0591943, not to 0.059544",
        "third entry of the printed gain 214.2064: with the inverse 214.2054, as printed 2.14e-06",
        "the load passes 4.2 rad after 0.342 s with a half-gap of 4.7684 rad and after 0.245 s without",
    ]


def test_the_benchmark_prints_everything():
    text = thesis.text_of(thesis.compared_numbers())
    assert "Table 4.1" in text
    assert "7.399e-03" in text
    assert all(e.where in text for e in errata())
    assert max(abs(e - r.alpha) for e, r in zip(thesis.our_estimates(), published.TABLE_4_1, strict=True)) < 1e-3


def test_gains_are_those_of_python_control():
    A = model_behind_the_gains()
    for output, V_d, V_n in ((C, 1.0, published.R), (C_L, published.V_D_EXAMPLE, published.V_N)):
        expected, covariance, _ = control.lqr(A.T, output.T, V_d * np.eye(6), np.array([[V_n]]))
        np.testing.assert_allclose(observer_gain(A, output, V_d, V_n), expected[0], rtol=1e-12)
        np.testing.assert_allclose(error_covariance(A, output, V_d, V_n), covariance, rtol=1e-9)
