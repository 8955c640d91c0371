"""Results in a notebook: their plots stand beside their tables, and can be zoomed."""

from html import unescape

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.api.plotted import ROWS, Figures, PlottedResult
from orchestrator.reporting import Plot, Report, Series
from tests.support import browser as browsers


@pytest.fixture(scope="module")
def pair():
    return oc.run_pair(alpha=0.02)


def test_a_result_shows_its_tables_and_the_plots_of_its_page(pair):
    shown = pair._repr_html_()
    assert shown.startswith("<table>")
    assert shown.count("<iframe") == 1
    page = unescape(shown.partition('srcdoc="')[2].partition('"')[0])
    assert page.startswith("<!doctype html>")
    assert page.count('<figure class="plot"') == len(pair.plot().titles) == 5


def test_plot_returns_the_plots_and_draws_only_into_a_given_file(pair, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = pair.plot()
    assert "Load angle" in found.titles
    assert str(found).startswith("Figures: Load angle, ")
    assert list(tmp_path.iterdir()) == []
    assert pair.plot("loops.png") is found
    assert (tmp_path / "loops.png").read_bytes().startswith(b"\x89PNG")


def test_a_result_without_plots_says_so(tmp_path):
    class Plain(PlottedResult):
        figures = Figures(Report("t", "s", ()))
        blocks = results = None

    with pytest.raises(oc.InputError, match="`path` must be absent"):
        Plain().plot(tmp_path / "a.png")


def test_a_long_record_does_not_fill_the_notebook():
    time = np.arange(1_000_000.0)
    figures = Figures(Report("t", "s", (Plot("p", "time [s]", "y", (Series("y", time, np.sin(time)),)),)))
    assert len(figures._repr_html_()) < 40 * ROWS


def test_a_result_without_plots_shows_no_empty_frame():
    assert Figures(Report("t", "s", ()))._repr_html_() == ""


@pytest.mark.skipif(bool(browsers.missing()), reason=browsers.missing() or "never")
def test_the_plots_are_alive_inside_a_notebook(pair, tmp_path):
    cell = tmp_path / "cell.html"
    cell.write_text(f'<!doctype html><html lang="en"><title>cell</title><body>{pair._repr_html_()}</body></html>')
    with browsers.browser() as driver:
        browsers.set_screen(driver, 1000, 1400, "light")
        driver.get(cell.as_uri())
        driver.switch_to.frame(driver.find_element("css selector", "iframe"))
        ready = "const d = arguments[0], w = () => window.Plot && Plot.all.length === 5 ? d() : setTimeout(w, 20); w();"
        driver.execute_async_script(ready.replace("window.Plot &&", "typeof Plot !== 'undefined' &&"))
        assert driver.execute_script("return document.querySelectorAll('path.curve').length") > 5
        assert [entry["message"] for entry in driver.get_log("browser")] == []
