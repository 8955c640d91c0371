"""Pages as text: complete, safe, reproducible."""

import base64
import json
import math
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from orchestrator.reporting import Facts, Findings, Plot, Remark, Report, ReportTable, Series, TableColumn, Text, render
from orchestrator.reporting.plots import (
    CURVE_LIMIT,
    PAGE_LIMIT,
    pack,
    pack_times,
    plot_data,
    rows_of_a_curve,
    thin_series,
)
from orchestrator.reporting.quantities import interval_words, mark_prose
from orchestrator.shared.numbers import cell_text
from tests.support.report import example


class Structure(HTMLParser):
    """Collects identifiers, links and whether every element is closed in order."""

    VOID = frozenset({"meta", "link", "br"})

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.sources = [], [], [], []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.ids += [given["id"]] if "id" in given else []
        self.links += [given["href"]] if "href" in given else []
        self.sources += [given["src"]] if "src" in given else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def parsed(page):
    structure = Structure()
    structure.feed(page)
    assert structure.open == []
    return structure


def test_the_page_is_well_formed_and_needs_no_network(tmp_path):
    structure = parsed(render(example(tmp_path)))
    assert len(structure.ids) == len(set(structure.ids))
    assert structure.sources == []
    for link in structure.links:
        assert link.startswith(("#", "data:")), link
        if link.startswith("#"):
            assert link[1:] in structure.ids


def test_the_same_report_gives_the_same_bytes(tmp_path):
    assert render(example(tmp_path)) == render(example(tmp_path))


def test_text_from_results_cannot_become_markup():
    evil = "</script><script>alert(1)</script><b>&"
    page = render(
        Report(
            evil,
            evil,
            (
                Text(evil, (evil,)),
                Facts(evil, ((evil, evil),)),
                ReportTable(evil, (TableColumn(evil, evil),), ((evil,),), evil),
                Plot(evil, evil, evil, (Series(evil, [0], [1], labels=[evil]),), note=evil, categories=(evil,)),
                Findings(evil, (Remark("error", evil, evil, evil),)),
            ),
            badge=("bad", evil),
            origin=((evil, evil),),
        )
    )
    assert "alert(1)</script>" not in page
    assert "<b>" not in page
    parsed(page)


def test_plots_travel_as_json_of_ten_digits():
    x = [0.1, 1 / 3, math.pi]
    page = render(Report("t", "s", (Plot("p", "x", "y", (Series("a", x, [1.0, None, 2.0]),)),)))
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', page)[1])
    assert data["series"][0]["x"] == [0.1, 0.3333333333, 3.141592654]
    assert data["series"][0]["y"] == [1.0, None, 2.0]


def test_long_tables_say_what_they_leave_out():
    page = render(
        Report("t", "s", (ReportTable("cases", (TableColumn("n"),), tuple((i,) for i in range(30)), limit=20),))
    )
    assert "The first 20 of 30 rows" in page
    assert page.count("<tr>") == 21


def test_large_files_are_linked_and_small_ones_embedded(tmp_path):
    (tmp_path / "small.csv").write_text("a\n1\n")
    (tmp_path / "large.csv").write_text("a\n" * 600_000)
    page = render(Report("t", "s", (), downloads=(tmp_path / "small.csv", tmp_path / "large.csv")))
    assert 'href="data:text/csv;base64,YQoxCg=="' in page
    assert 'href="large.csv"' in page


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"),
        (1234567.0, 4, "1.235e6"),
        (0.012345, 3, "0.0123"),
        (123.0, 4, "123"),
        (12345.0, 4, "12345"),
        (1.5e-9, 4, "1.5e-9"),
        (-2e-5, 4, "-2e-5"),
        (1e22, 1, "1e22"),
        (float("nan"), 4, "–"),
        (None, 4, "–"),
        (True, 4, "yes"),
        (12345678, 4, "12345678"),
        ("word", 4, "word"),
    ],
)
def test_numbers_in_words(value, digits, text):
    assert cell_text(value, digits) == text


def test_a_thinned_curve_keeps_its_peaks_its_gaps_and_its_ends():
    count = 100_000
    y = np.sin(np.arange(count) / 3000.0)
    y[54_321], y[54_400], y[70_000:80_000] = 9.0, -9.0, np.nan
    thin = thin_series(Series("a", np.arange(count), y, labels=[str(i) for i in range(count)]), 1000)
    assert len(thin.x) <= 1002
    assert (np.nanmax(thin.y), np.nanmin(thin.y)) == (9.0, -9.0)
    assert np.isnan(thin.y).any()
    assert (thin.x[0], thin.x[-1]) == (0, count - 1)
    assert all(thin.labels[i] == str(int(x)) for i, x in enumerate(thin.x))
    few = Series("c", [0, 1, 2, 3], [1.0, 2.0, 2.0, 1.0])
    assert thin_series(few, 4) is few
    cloud = thin_series(Series("b", list(range(count)), y, "points"), 1000)
    assert 3500 <= len(cloud.x) <= 4000


def unpack(column):
    """What the page's program makes of a column."""
    if isinstance(column, list):
        return np.array(column, dtype=float)
    if "step" in column:
        return column["start"] + column["step"] * np.arange(column["count"])
    kind = "f4" if "f4" in column else "f8"
    return np.frombuffer(base64.b64decode(column[kind]), f"<{kind}").astype(float) + column.get("offset", 0.0)


@pytest.mark.parametrize("far", [0.0, 1e6, -3e9])
def test_packed_columns_keep_seven_digits_of_their_range(far):
    y = far + np.sin(np.arange(1000) / 30.0)
    y[17] = np.nan
    read = unpack(json.loads(json.dumps(pack(y))))
    assert np.isnan(read[17])
    assert np.nanmax(np.abs(read - y)) < 1e-7 + 2e-16 * abs(far)


def test_small_numbers_beside_large_ones_keep_their_digits():
    y = np.geomspace(1e-12, 1e6, 1000)
    np.testing.assert_allclose(unpack(pack(y)), y, rtol=1e-7)


def test_uniform_times_are_three_numbers_and_others_are_exact():
    uniform = 5.0 + 1e-3 * np.arange(10_000)
    assert pack_times(uniform) == {"start": 5.0, "step": pytest.approx(1e-3, rel=1e-12), "count": 10_000}
    np.testing.assert_allclose(unpack(pack_times(uniform)), uniform, atol=1e-9)
    jittered = uniform + 1e-5 * np.sin(np.arange(10_000))
    np.testing.assert_array_equal(unpack(pack_times(jittered)), jittered)


def test_curves_of_one_time_tell_it_once_and_only_plots_over_time_are_linked():
    x = np.arange(100.0) ** 2
    curves = (Series("a", x, x), Series("b", x, -x), Series("c", x + 1.0, x))
    data = plot_data(Plot("p", "time [s]", "y [rad]", curves))
    assert [set(s["x"]) for s in data["series"]] == [{"f8"}, {"of"}, {"f8"}]
    assert data["series"][1]["x"] == {"of": 0}
    assert (data["link"], plot_data(Plot("q", "alpha [rad]", "y", curves))["link"]) == ("time", "")


def test_a_page_shares_its_room_between_long_curves():
    def plots(*counts):
        return [Plot("p", "x", "y", tuple(Series("a", range(n), range(n)) for n in counts))]

    assert rows_of_a_curve(plots(1000, CURVE_LIMIT - 1000)) == CURVE_LIMIT
    limit = rows_of_a_curve(plots(*[2_000_000] * 10, 1000))
    assert limit == (PAGE_LIMIT - 1000) // 10


@pytest.mark.parametrize("rows", [124_000, 300_000])
def test_a_page_has_at_most_three_megabytes_and_no_peak_is_lost(rows):
    rng = np.random.default_rng(0)
    time, curves = np.arange(rows) * 1e-3, rng.standard_normal((4, rows))
    curves[2, 77_777] = 99.0
    plots = [Plot(f"{n}", "time [s]", "y", (Series("a", time, y),)) for n, y in enumerate(curves)]
    data = [plot_data(plot, rows_of_a_curve(plots)) for plot in plots]
    assert len(json.dumps(data)) < 3_000_000
    series = data[2]["series"][0]
    assert (rows == 124_000) == ("step" in series["x"])
    at = np.argmax(unpack(series["y"]))
    assert unpack(series["x"])[at] == pytest.approx(77.777, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "marked"),
    [("a gap of 0.02 rad.", ["0.02 rad"]), ("0.02 rad (95 %: 0.01 to 0.03), 5", ["0.02 rad (95 %: 0.01 to 0.03)"]),
     ("between 0.01 and 0.03 rad/s", ["0.01 and 0.03 rad/s"]),
     ("1e-05 instead of 0.2 rad", ["1e-05 instead of 0.2 rad"]),
     ("0.138 -> 0.002 rad (noise 0.0003); x", ["0.138 -> 0.002 rad (noise 0.0003)"]),
     ("0.02 rad (1.1 deg)", ["0.02 rad"]),
     ("3300 N.m/rad", []), ("2 rad/sample", []), ("0.1, 0.2 rad", []), ("0.2 rad.s", []), ("x = 2rad", [])],
)  # fmt: skip
def test_angles_in_sentences_are_marked_or_left_alone(text, marked):
    html = str(mark_prose(text))
    assert re.findall(r'<span data-unit="rad[^"]*">([^<]*)</span>', html.replace("&gt;", ">")) == marked
    assert re.sub("<[^>]*>", "", html.replace("&gt;", "\0")).replace("\0", ">") == text


def test_what_stands_in_backticks_is_code_and_stays_harmless():
    assert mark_prose("use `--a <b>` now, `") == "use <code>--a &lt;b&gt;</code> now, `"


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((0.0137166, 0.0136887, 0.0137444), ("0.013717", "0.013689", "0.013744")),
        ((0.02, 0.0199999, 0.0200001), ("0.02", "0.0199999", "0.0200001")),
        ((0.8, 0.1, 3.0), ("0.8", "0.1", "3")),
        ((0.0137166, None, 0.02), ("0.013717", "any size", "0.02")),
    ],
)
def test_a_value_has_the_digits_that_its_interval_allows(given, words):
    assert interval_words(*given) == words
