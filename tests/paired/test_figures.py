"""What the figures of pairs, sweeps and scenarios show, read from the figures themselves."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from orchestrator.paired import figures
from orchestrator.paired.cosimulation import LoopRun
from orchestrator.paired.figures import draw_errors, draw_estimates, draw_pair, draw_signals


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """The last figure that was written, and its path."""
    saved = {}

    def save(figure, path, **options):
        saved.update(figure=figure, path=path, options=options)

    monkeypatch.setattr(Figure, "savefig", save)
    saved["to"] = tmp_path / "figure.png"
    return saved


def curves(axis):
    """Label and values of each curve of a panel."""
    return {line.get_label(): line.get_ydata() for line in axis.lines}


def looks(axis):
    """Colour, style and width of each curve of a panel."""
    return [(line.get_color(), line.get_linestyle(), line.get_linewidth()) for line in axis.lines]


def grid_of(axis):
    return axis.xaxis.get_gridlines()[0].get_visible()


def loop(contact, **signals):
    time = np.arange(len(contact), dtype=float)
    names = ("theta_l", "theta_l_hat", "u", "T_shaft")
    values = {name: np.full(len(contact), signals.get(name, 0.0)) for name in names}
    return LoopRun(time, values | {"contact": np.array(contact, dtype=float)})


def test_a_pair_shows_angles_their_difference_and_torques(drawn):
    with_gap = loop([1, 0, 0, 1, 0], theta_l=2.0, theta_l_hat=0.5, u=3.0, T_shaft=4.0)
    draw_pair(drawn["to"], with_gap, loop([1] * 5, theta_l=1.0, theta_l_hat=0.25, u=5.0), np.full(5, 7.0), "A pair")
    angles, difference, torques = drawn["figure"].axes
    assert {name: values[0] for name, values in curves(angles).items()} == {
        "reference": 7.0, "without backlash": 1.0, "with backlash": 2.0
    }  # fmt: skip
    assert [values[0] for values in curves(difference).values()] == [250.0]
    assert [values[0] for values in curves(torques).values()] == [5.0, 3.0, 4.0]
    # Curves that lie on each other are told apart by dashes, too, and the reference is in the background.
    assert looks(angles) == [(figures.GREY, ":", 1.0), (figures.BLUE, "-", 1.5), (figures.ORANGE, "--", 1.5)]
    assert looks(torques) == [(figures.BLUE, "-", 0.9), (figures.ORANGE, "--", 0.9), (figures.GREY, "-", 0.9)]
    (area,) = difference.collections
    assert set(area.get_paths()[0].vertices[:, 1]) == {0.0, 250.0}
    for axis in drawn["figure"].axes:  # what a panel shows stands left of its numbers, a little within the figure
        place = axis.get_position()
        assert 8.0 * (place.x0 + axis.yaxis.label.get_position()[0] * place.width) == pytest.approx(figures.LABEL)
    assert [axis.get_ylabel() for axis in drawn["figure"].axes] == [
        "load angle [rad]", "difference [mrad]", "torque [N.m]"
    ]  # fmt: skip
    assert angles.get_title() == "A pair"
    assert torques.get_xlabel() == "time [s]"
    for axis in drawn["figure"].axes:
        spans = [patch for patch in axis.patches if patch.get_facecolor()[:3] != (0.0, 0.0, 0.0)]
        assert [(p.get_x(), p.get_x() + p.get_width()) for p in spans] == [(1.0, 3.0), (4.0, 4.0)]
        assert [text.get_text() for text in axis.get_legend().get_texts()].count("in the gap") == 1
        assert axis.get_xlim() == (0.0, 4.0)
        assert grid_of(axis)
    assert angles.get_shared_x_axes().joined(angles, torques)
    assert drawn["options"] == {"dpi": figures.DPI, "metadata": {"Software": None}}


ACTUAL, NOISE = np.array([0.01, 0.02, 0.04]), np.array([0.0, 0.0, 1e-4])


def test_estimates_have_intervals_and_deviations(drawn):
    estimated = np.array([0.011, 0.02, 0.03])
    draw_estimates(drawn["to"], ACTUAL, estimated, estimated - 0.001, estimated + 0.002, NOISE, "Estimates")
    sizes, deviations = drawn["figure"].axes
    (_, quiet), (_, noisy) = [(c.get_label(), c) for c in sizes.containers]
    assert [c.get_label() for c in sizes.containers] == ["no noise", "encoder noise 0.0001 rad"]
    np.testing.assert_allclose(quiet.lines[0].get_ydata(), estimated[:2])
    np.testing.assert_allclose(noisy.lines[2][0].get_segments()[0][:, 1], [0.029, 0.032])
    np.testing.assert_allclose(deviations.containers[0].lines[0].get_ydata(), [10.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(deviations.containers[1].lines[2][0].get_segments()[0][:, 1], [-27.5, -20.0])
    assert (sizes.get_yscale(), deviations.get_yscale(), sizes.get_xscale()) == ("log", "linear", "log")
    for ticks in (sizes.yaxis, deviations.xaxis):
        assert ticks.get_major_formatter()(0.02, 0) == "0.02"
        assert ticks.get_minor_formatter()(0.02, 0) == ""
        assert {0.01, 0.02, 0.05} <= {
            float(f"{tick:.3g}") for tick in ticks.get_major_locator().tick_values(0.01, 0.05)
        }
    assert sizes.get_title() == "Estimates"
    assert sizes.get_ylabel() == "estimated half-gap [rad]"
    assert (deviations.get_ylabel(), deviations.get_xlabel()) == (
        "deviation from the actual [%]", "actual half-gap [rad]"
    )  # fmt: skip
    assert all(grid_of(axis) and axis.get_legend() for axis in drawn["figure"].axes)


def test_errors_are_in_percent_above_a_floor(drawn):
    draw_errors(drawn["to"], ACTUAL, np.array([0.011, 0.02, 0.03]), NOISE, "Errors")
    (axis,) = drawn["figure"].axes
    quiet, noisy = curves(axis).values()
    assert tuple(drawn["figure"].get_size_inches()) == (7.0, 4.2)
    np.testing.assert_allclose(quiet, [10.0, 1e-7])
    np.testing.assert_allclose(noisy, [25.0])
    assert (axis.get_yscale(), axis.get_title(), axis.get_ylabel()) == ("log", "Errors", "error of the estimate [%]")
    assert grid_of(axis)
    assert axis.get_legend()


def test_of_many_cases_of_a_noise_level_some_are_drawn(drawn):
    count = 2 * figures.MOST_POINTS + 1
    sizes = np.linspace(0.01, 0.02, count)
    draw_errors(drawn["to"], sizes, sizes, np.zeros(count), "Errors")
    (curve,) = curves(drawn["figure"].axes[0]).values()
    assert len(curve) == -(-count // 3)


def test_signals_of_one_unit_share_a_panel(drawn):
    signals = {"a": np.array([1.0, 2.0]), "b": np.array([3.0, 4.0]), "c": np.array([5.0, 6.0])}
    draw_signals(drawn["to"], np.array([0.0, 1.0]), signals, {"a": "rad", "b": "", "c": "rad"})
    first, second = drawn["figure"].axes
    assert {name: list(values) for name, values in curves(first).items()} == {"a": [1.0, 2.0], "c": [5.0, 6.0]}
    assert {name: list(values) for name, values in curves(second).items()} == {"b": [3.0, 4.0]}
    assert (first.get_ylabel(), second.get_ylabel(), second.get_xlabel()) == ("[rad]", "", "time [s]")
    assert first.get_shared_x_axes().joined(first, second)
    assert first.get_xlim() == (0.0, 1.0)
    assert grid_of(first)
    assert tuple(drawn["figure"].get_size_inches()) == pytest.approx((8.0, 5.6))
