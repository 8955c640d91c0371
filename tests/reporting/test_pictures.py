"""What a picture of plots shows, read from the figure itself."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from orchestrator.reporting.model import Plot, Series, Span
from orchestrator.reporting.pictures import NAMES, ROWS, draw_plots

X = np.array([0.0, 1.0, 2.0, 3.0])


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Draw plots, and return the panels of the figure that is saved."""
    saved = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **options: saved.append(figure))

    def draw(*plots):
        draw_plots(tmp_path / "a.png", plots)
        return saved[-1].axes

    return draw


def curves(axis):
    return {line.get_label(): list(line.get_ydata()) for line in axis.lines}


def test_each_kind_of_series_is_drawn_with_its_interval(drawn):
    y = np.array([1.0, 4.0, np.nan, 2.0])
    band = {"low": y - 0.5, "high": y + 1.0}
    (axis,) = drawn(
        Plot("All", "x [m]", "y [s]", (
            Series("line", X, y, "line", **band), Series("steps", X, y, "steps"),
            Series("dots", X, y, "points", **band),
        ))
    )  # fmt: skip
    assert (axis.get_title(), axis.get_xlabel(), axis.get_ylabel()) == ("All", "x [m]", "y [s]")
    np.testing.assert_equal(curves(axis)["line"], y)
    styles = {line.get_label(): line.get_drawstyle() for line in axis.lines}
    assert (styles["line"], styles["steps"]) == ("default", "steps-post")
    assert {0.5, 5.0} <= set(axis.collections[0].get_paths()[0].vertices[:, 1])
    (dots,) = axis.containers
    np.testing.assert_allclose(dots.lines[2][0].get_segments()[1][:, 1], [3.5, 5.0])
    shown = [text.get_text() for text in axis.get_legend().get_texts()]
    assert sorted(shown) == ["dots", "line", "steps"]


def test_spans_are_shaded_moments_are_lines_and_each_is_named_once(drawn):
    spans = (Span(0.5, 1.0, "gap"), Span(2.0, 2.5, "gap"), Span(1.5, 1.5, "start"))
    (axis,) = drawn(Plot("One", "time [s]", "y", (Series("y", X, X),), spans))
    assert [(p.get_x(), p.get_x() + p.get_width()) for p in axis.patches] == [(0.5, 1.0), (2.0, 2.5)]
    assert list(axis.lines[0].get_xdata()) == [1.5, 1.5]
    assert sorted(text.get_text() for text in axis.get_legend().get_texts()) == ["gap", "start", "y"]


def test_logarithmic_scales_and_the_diagonal_are_those_of_the_plot(drawn):
    x = np.array([0.01, 0.02, 0.1])
    (axis,) = drawn(
        Plot("Sizes", "actual [rad]", "found [rad]", (Series("a", x, 2.0 * x, "points"),), (), True, True, True)
    )
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "log")
    diagonal = next(line for line in axis.lines if line.get_linestyle() == "-" and len(line.get_xdata()) == 2)
    assert list(diagonal.get_xdata()) == list(diagonal.get_ydata())
    assert axis.get_legend() is None  # a single curve is named by its axis


def test_plots_over_the_same_x_share_its_scale_and_no_name_is_a_formula(drawn):
    names = [f"${n}$" for n in range(NAMES + 1)]
    many = Plot("Many", "time [s]", "y", tuple(Series(name, X, X) for name in names))
    first, second, third = drawn(
        many, Plot("B", "time [s]", "y", (Series("y", X, X),)), Plot("C", "x", "y", (Series("y", X, X),))
    )
    assert first.get_shared_x_axes().joined(first, second)
    assert not first.get_shared_x_axes().joined(first, third)
    assert [text.get_text() for text in first.get_legend().get_texts()] == [rf"\${n}\$" for n in range(NAMES + 1)]


def test_of_a_long_curve_the_extremes_are_drawn(drawn):
    y = np.zeros(50 * ROWS)
    y[777], y[-3] = 5.0, -5.0
    (axis,) = drawn(Plot("Long", "x", "y", (Series("y", np.arange(y.size), y),)))
    (line,) = axis.lines
    assert line.get_ydata().size <= ROWS + 2
    assert (line.get_ydata().max(), line.get_ydata().min()) == (5.0, -5.0)


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_pictures_of_each_format_are_written(tmp_path, ending):
    path = tmp_path / f"a.{ending}"
    draw_plots(path, (Plot("A", "x", "y", (Series("y", X, X),)),))
    assert path.read_bytes()[:4] in (b"\x89PNG", b"<?xm", b"%PDF")
